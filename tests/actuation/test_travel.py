"""The way of a finger through pressures: its points are equilibria, its events are downhill."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest

from dpgcli.actuation.certificate import certificate
from dpgcli.actuation.folding import folded
from dpgcli.actuation.pressed import Halt, Pressed
from dpgcli.actuation.readings import Readings, drift
from dpgcli.actuation.rest import at_rest
from dpgcli.actuation.travel import EventKind, Travel, travel
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.laws import PUBLISHED, PushOnly
from dpgcli.mechanics.terms import chain_potential
from dpgcli.states.solved import ALONE

Study = Callable[..., Finger]
Made = Callable[..., Pressed]
Limits = Callable[[float], tuple[float, float]]
AREA = 4.7261788958 / 0.1495  # mm²
STROKES = np.array([[3.5], [3.4], [3.7]])
ROUND = (0.0, 0.3, -0.3, 0.0)


def way_of(
    pressed: Pressed, pressures: Sequence[float], pattern: str = "", **options: float
) -> Travel:
    """All units at the same pressures."""
    n = pressed.finger.n_units
    inverted = np.array([[digit == "1"] for digit in pattern or "0" * n])
    shapes, _ = at_rest(pressed, inverted)
    history = np.array(pressures)[:, None] * np.ones(n)
    return travel(pressed, shapes, history, **options)  # type: ignore[arg-type]


@pytest.fixture(params=["published", "push only"])
def finger(request: pytest.FixtureRequest, study: Study, pressed: Made) -> Pressed:
    """Three units of other strokes."""
    made = study(3, 100.0).changed(stroke=STROKES)
    if request.param == "push only":
        made = type(made)(**{**vars(made), "law": PushOnly(PUBLISHED)})
    return pressed(made)


def test_every_point_is_an_equilibrium(finger: Pressed) -> None:
    way = way_of(finger, ROUND)
    readings = Readings(finger, way.points.shapes, ALONE)
    assert way.reason is Halt.ARRIVED
    assert len(way.points) > 40
    assert float(readings.balance.relative_residual.max()) < 1e-9
    sides = [event.before for event in way.events]
    inner = np.setdiff1d(np.arange(len(way.points)), sides)
    assert float(readings.balance.curvature[inner].min()) > 0.0
    assert not folded(finger.coordinates, way.points.shapes.coordinates).any()


@pytest.mark.parametrize("largest_step", [0.1, 0.4])  # some steps of the latter fail
def test_pressures_are_landed_on_and_go_one_way_between(
    finger: Pressed, largest_step: float
) -> None:
    way = way_of(finger, ROUND, largest_step=largest_step)
    pressure = way.points.shapes.pressure[0]
    assert pressure[list(way.holds)].tolist() == list(ROUND)
    assert way.points.share[list(way.holds)].tolist() == [1.0] * 4
    for step, (start, end) in enumerate(zip((0.0, *ROUND), ROUND, strict=False), start=1):
        own = pressure[way.points.step == step]
        assert ((own >= min(start, end)) & (own <= max(start, end))).all()
        moves = np.diff(own) * np.sign(end - start)
        assert (moves >= 0.0).all()
        here = [event for event in way.events if way.points.step[event.after] == step]
        assert (moves == 0.0).sum() == (len(here) if start != end else len(own) - 1)
        share = way.points.share[way.points.step == step]
        np.testing.assert_allclose(own, start + share * (end - start), atol=1e-14)


def test_what_an_event_releases_is_what_the_energy_falls_by(finger: Pressed) -> None:
    way = way_of(finger, ROUND)
    readings = Readings(finger, way.points.shapes, ALONE)
    snaps = [event for event in way.events if event.kind in (EventKind.SNAP, EventKind.RESET)]
    assert [event.kind for event in snaps] == [EventKind.SNAP] * 3 + [EventKind.RESET] * 3
    assert {event.units for event in snaps[:3]} == {(0,), (1,), (2,)}
    for event in way.events:
        before, after = (readings.potential_energy[side] for side in (event.before, event.after))
        assert event.released == pytest.approx(before - after, abs=1e-9)
        assert event.after == event.before + 1
        pressures = way.points.shapes.pressure[:, [event.before, event.after]]
        assert (pressures[:, 0] == pressures[:, 1]).all()
    assert all(event.released > 1.0 for event in snaps)


def test_without_pressure_the_energy_is_that_of_the_state(finger: Pressed) -> None:
    way = way_of(finger, (0.3, 0.0))
    _, settled = at_rest(finger, way.final.inverted)
    energy = sum(part[0] for part in settled.equilibrium.energies.values())
    readings = Readings(finger, way.final, ALONE)
    assert readings.energy[0] == pytest.approx(energy, rel=1e-9)
    assert readings.potential_energy[0] == pytest.approx(energy, rel=1e-9)


def test_under_pressure_the_energy_is_that_of_springs_in_the_same_shape(
    study: Study, pressed: Made
) -> None:
    finger = pressed(study(3, 100.0).changed(stroke=STROKES))
    shapes = way_of(finger, ROUND).points.shapes
    expected = chain_potential(finger.finger).evaluate(shapes.coordinates).energy
    readings = Readings(finger, shapes, ALONE)
    np.testing.assert_allclose(readings.energy, expected, rtol=1e-9, atol=1e-9)
    work = AREA * (shapes.pressure * readings.openings).sum(axis=0)
    np.testing.assert_allclose(readings.potential_energy, expected - work, rtol=1e-9, atol=1e-9)
    assert np.abs(work).max() > 10.0


@pytest.mark.slow
def test_half_the_step_finds_the_same_events(finger: Pressed) -> None:
    ways = [way_of(finger, ROUND, largest_step=step) for step in (0.1, 0.05, 0.025)]
    assert len(ways[2].points) > 1.4 * len(ways[0].points)
    for way in ways[1:]:
        assert len(way.events) == len(ways[0].events)
        for event, first in zip(way.events, ways[0].events, strict=True):
            assert (event.kind, event.units, event.tied) == (first.kind, first.units, first.tied)
            assert event.released == pytest.approx(first.released, rel=1e-9, abs=1e-9)
            pressures = (
                a.points.shapes.pressure[0, e.before] for a, e in ((way, event), (ways[0], first))
            )
            assert next(pressures) == pytest.approx(next(pressures), rel=1e-11, abs=1e-13)


@pytest.mark.slow
def test_cycles_close(finger: Pressed) -> None:
    way = way_of(finger, (0.3, -0.3, 0.05), n_cycles=100)
    assert way.points.cycle[-1] == 100
    assert len(way.holds) == 300
    found = drift(Readings(finger, way.points.shapes, ALONE), np.array(way.holds[2::3]))
    assert found.patterns == ("000",)
    assert found.tip <= found.nodes < 1e-9


@pytest.mark.slow
def test_cycles_that_are_known_are_those_that_one_would_find(finger: Pressed) -> None:
    """The first differs: it begins at rest."""
    history = (0.3, -0.066, 0.1)
    way = way_of(finger, history, n_cycles=4)
    shapes, _ = at_rest(finger, np.zeros((3, 1), bool))
    for cycle in range(1, 5):
        alone = travel(finger, shapes, np.array(history)[:, None] * np.ones(3))
        own = way.points.take(np.flatnonzero(way.points.cycle == cycle))
        skipped = int(cycle > 1)  # the first point is where the last cycle ended
        expected = alone.points.take(np.arange(skipped, len(alone.points)))
        assert (own.shapes.coordinates == expected.shapes.coordinates).all()
        assert (own.step == expected.step).all()
        assert (own.share == expected.share).all()
        shapes = alone.final
    per_cycle = len(alone.events)
    last = way.events[-per_cycle:]
    assert [e.units for e in last] == [e.units for e in alone.events]
    cycles = [way.points.cycle[[e.before, e.after]].tolist() for e in last]
    assert cycles == [[4, 4]] * per_cycle


def test_cycles_that_end_in_other_patterns_are_compared_with_their_own_first(
    finger: Pressed,
) -> None:
    way = way_of(finger, (0.3, 0.0, -0.3, 0.0))
    found = drift(Readings(finger, way.points.shapes, ALONE), np.array(way.holds))
    assert found.patterns == ("111", "000")
    assert found.nodes > 0.1  # under pressure, not at rest


def test_tied_units_are_named_by_their_numbers_alone(study: Study, pressed: Made) -> None:
    strokes = np.array([[3.7], [3.5], [3.7], [3.5]])
    way = way_of(pressed(study(4).changed(stroke=strokes)), (0.3, -0.3))
    assert [(event.units, event.tied) for event in way.events] == [
        ((1, 3), (3,)),
        ((0, 2), (2,)),
        ((1, 3), (3,)),
        ((0, 2), (2,)),
    ]


def test_a_unit_that_takes_others_with_it_is_one_event(study: Study, pressed: Made) -> None:
    """Between bars that give way the middle one goes first, and its neighbors are no tie."""
    way = way_of(pressed(study(3, 1.0)), (0.3,))
    (event,) = way.events
    assert event.units == (1, 0, 2)
    assert event.tied == ()
    after = way.points.shapes.inverted[:, event.after]
    assert after.all()


@pytest.mark.parametrize("seed", range(4))
def test_between_rigid_bars_units_are_independent_hysterons(
    study: Study, pressed: Made, closed_form: Limits, hysterons: Any, seed: int
) -> None:
    """Each flips up at its own largest force and down at its smallest, whatever the history."""
    random = np.random.default_rng(seed)
    strokes = random.uniform(3.2, 3.9, 5)
    up, down = (np.array(force) / AREA for force in zip(*map(closed_form, strokes), strict=True))
    line_of = random.integers(0, 2, 5)
    fields_of = random.uniform(-0.12, 0.2, (12, 2))
    finger = pressed(study(5, np.inf).changed(stroke=strokes[:, None]))
    shapes, _ = at_rest(finger, np.zeros((5, 1), bool))
    way = travel(finger, shapes, fields_of[:, line_of])
    peer = hysterons(tuple(up), tuple(down), tuple(line_of))
    state, known = (False,) * 5, []
    for fields in fields_of:
        for line, field in enumerate(fields):
            state = peer.at(state, line, field)
        known.append([*state])
    found = way.points.shapes.inverted[:, list(way.holds)].T
    assert found.tolist() == known
    assert len(way.events) > 5
    for event in way.events:
        (unit,) = event.units
        limit = up if event.kind is EventKind.SNAP else down
        pressure = way.points.shapes.pressure[unit, event.before]
        assert pressure == pytest.approx(limit[unit], rel=1e-9)


def test_units_on_two_lines_can_be_tied(study: Study, pressed: Made) -> None:
    finger = pressed(study(2, np.inf))
    shapes, _ = at_rest(finger, np.zeros((2, 1), bool))
    way = travel(finger, shapes, np.array([[0.0, 0.0], [0.3, 0.3]]))
    assert [(event.units, event.tied) for event in way.events] == [((0, 1), (1,))]


@pytest.mark.slow
def test_a_finger_folds_onto_itself_where_it_does_whatever_the_step(
    study: Study, pressed: Made
) -> None:
    finger = pressed(study(3))
    ways = [way_of(finger, (0.0, 0.2, 2000.0), largest_step=step) for step in (0.1, 0.07)]
    for way in ways:
        assert way.reason is Halt.FOLDED
        assert len(way.events) == 1
        assert not folded(finger.coordinates, way.points.shapes.coordinates).any()
        assert way.points.shapes.pressure.max() < way.pressure[0] < 2000.0
    assert ways[0].pressure == pytest.approx(ways[1].pressure, rel=1e-4)


def test_a_long_finger_that_meets_itself_under_pressure_is_folded(
    study: Study, pressed: Made
) -> None:
    """Its free state has room enough: 20 units turn by 17.4° each, by more under pressure."""
    way = way_of(pressed(study(20)), (0.0, 1.5), "1" * 20)
    assert way.reason is Halt.FOLDED
    assert 0.0 < way.pressure[0] < 1.5


def test_the_end_is_certified_beside_the_state_of_its_pattern(finger: Pressed) -> None:
    for pressures in ((0.3, 0.0), (0.3, 0.05), (0.14, 0.0)):
        found = certificate(finger, way_of(finger, pressures).final)
        assert found.is_certified
        assert ("under its pressures" in found.text) == bool(pressures[-1])


def test_a_shape_beside_its_state_is_not_certified(finger: Pressed) -> None:
    final = way_of(finger, (0.3, 0.0)).final
    moved = type(final)(1.001 * final.coordinates, *list(vars(final).values())[1:])
    found = certificate(finger, moved)
    assert not found.is_certified
    assert "another shape" in found.text
    pressed = type(final)(final.coordinates, final.pressure + 0.05, *list(vars(final).values())[2:])
    assert certificate(finger, pressed).text == "not certified: forces are left"


def test_the_fold_itself_is_not_certified(study: Study, pressed: Made) -> None:
    finger = pressed(study(1, np.inf))
    way = way_of(finger, (0.3,))
    before = way.points.shapes.take_lanes(np.array([way.events[0].before]))
    assert "at a fold" in certificate(finger, before).text
