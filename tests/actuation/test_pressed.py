"""Thresholds under pressure: closed forms, independence between rigid bars, ties, cycles."""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from dpgcli.actuation.domes import limits
from dpgcli.actuation.pressed import Halt, Pressed
from dpgcli.actuation.rest import at_rest
from dpgcli.actuation.staircase import Events, driven, staircase
from dpgcli.arrays import Array
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.laws import PUBLISHED, PushOnly
from dpgcli.states.patterns import inverted_units

Study = Callable[..., Finger]
Made = Callable[..., Pressed]
Limits = Callable[[float], tuple[float, float]]
AREA = 4.7261788958 / 0.1495


def events_of(pressed: Pressed, *targets: float, largest_step: float = 0.1) -> Iterator[Events]:
    """Events of one finger, all units at the same pressure, from its straight state."""
    n = pressed.finger.n_units
    shapes, _ = at_rest(pressed, np.zeros((n, 1), bool))
    for target in targets:
        way = driven(pressed, shapes, np.full((n, 1), target), largest_step)
        assert way.reason.tolist() == [Halt.ARRIVED]
        yield from way.events
        shapes = way.shapes


def test_one_unit_snaps_and_resets_where_its_force_turns(
    study: Study, pressed: Made, closed_form: Limits
) -> None:
    snap, reset = events_of(pressed(study(1, np.inf)), 0.3, -0.3)
    expected = closed_form(3.5)
    assert expected == pytest.approx((4.72618, -2.054675), abs=1e-5)  # the reference's numbers
    found = [event.halted.shapes.pressure[0, 0] * AREA for event in (snap, reset)]
    np.testing.assert_allclose(found, expected, rtol=1e-10)
    assert snap.after.inverted.tolist() == [[True]]
    assert reset.after.inverted.tolist() == [[False]]


def test_half_the_step_changes_nothing(study: Study, pressed: Made) -> None:
    strokes = np.array([[3.5], [3.4], [3.7]])
    finger = study(3, 50.0).changed(stroke=strokes)
    ways = [[*events_of(pressed(finger), 0.3, -0.3, largest_step=h)] for h in (0.1, 0.05, 0.025)]
    assert len(ways[0]) == 6
    for way in ways[1:]:
        for event, first in zip(way, ways[0], strict=True):
            assert event.halted.unit.tolist() == first.halted.unit.tolist()
            pressure = event.halted.shapes.pressure
            np.testing.assert_allclose(pressure, first.halted.shapes.pressure, rtol=1e-12)
            np.testing.assert_allclose(event.after.coordinates, first.after.coordinates, atol=1e-9)


def test_units_between_rigid_bars_do_not_feel_each_other(
    study: Study, pressed: Made, closed_form: Limits
) -> None:
    """Each has its own two thresholds, whatever the others do."""
    strokes = np.array([3.5, 3.4, 3.6, 3.7])
    own = np.array([closed_form(stroke) for stroke in strokes]) / AREA
    lanes = inverted_units(np.arange(16, dtype=np.uint64), 4)
    finger = pressed(study(4, np.inf).changed(stroke=strokes[:, None]))
    shapes, _ = at_rest(finger, lanes)
    for sign, column in ((1.0, 0), (-1.0, 1)):
        target = np.full(lanes.shape, sign * 0.5)
        stairs, way = staircase(finger, shapes, target, 1)
        at = {int(lane): k for k, lane in enumerate(stairs[0].events.lanes)}
        for lane in range(16):
            free = np.flatnonzero(lanes[:, lane] == (sign < 0.0))
            if not len(free):
                assert lane not in at
                assert way.reason[lane] == Halt.ARRIVED
                continue
            expected = free[np.abs(own[free, column]).argmin()]
            halted = stairs[0].events.halted
            assert halted.unit[at[lane]] == expected
            found = halted.shapes.pressure[expected, at[lane]]
            assert found == pytest.approx(own[expected, column], rel=1e-10)


def lost(finger: Pressed, event: Events) -> Array:
    """Energy that is lost at an event, mJ."""
    return finger.energy(event.halted.shapes) - finger.energy(event.after)


def test_equal_units_on_one_line_are_a_tie(study: Study, pressed: Made) -> None:
    strokes = np.array([[3.5], [3.5], [3.5], [4.5], [4.5]])
    first, second = events_of(pressed(study(5).changed(stroke=strokes)), 0.3)
    for event, together, after in ((first, 3, "11100"), (second, 2, "11111")):
        assert event.halted.tied.sum() + 1 == together
        assert "".join("01"[int(unit)] for unit in event.after.inverted[:, 0]) == after


def test_a_difference_above_a_millionth_is_no_tie(study: Study, pressed: Made) -> None:
    strokes = np.array([[3.5], [3.5 * (1.0 + 3e-6)]])
    events = [*events_of(pressed(study(2).changed(stroke=strokes)), 0.3)]
    assert [event.halted.tied.any() for event in events] == [False, False]
    assert [int(event.halted.unit[0]) for event in events] == [0, 1]


def test_energy_is_lost_at_every_event(study: Study, pressed: Made) -> None:
    finger = pressed(study(3, 20.0))
    events = [*events_of(finger, 0.3, -0.3, 0.3)]
    assert len(events) >= 3
    assert all(lost(finger, event)[0] > 1.0 for event in events)


def test_a_cycle_closes(study: Study, pressed: Made) -> None:
    finger = pressed(study(4))
    start, _ = at_rest(finger, np.zeros((4, 1), bool))
    shapes = start
    for _ in range(3):
        for target in (0.3, 0.0, -0.3, 0.0):
            shapes = driven(finger, shapes, np.full((4, 1), target)).shapes
    np.testing.assert_allclose(shapes.coordinates, start.coordinates, atol=1e-11)


def test_a_dome_that_only_pushes_leaves_its_neighbor_when_sucked_back(
    study: Study, pressed: Made, closed_form: Limits
) -> None:
    """Published energies: in touch from the start, so snap and reset are those of the spring."""
    finger = study(1, np.inf)
    pushing = pressed(replace(finger, law=PushOnly(PUBLISHED)))
    snap, reset = events_of(pushing, 0.3, -0.3)
    found = [event.halted.shapes.pressure[0, 0] * AREA for event in (snap, reset)]
    np.testing.assert_allclose(found, closed_form(3.5), rtol=1e-10)
    shapes, _ = at_rest(pushing, np.zeros((1, 1), bool))
    way = driven(pushing, shapes, np.array([[-0.3]]))
    assert float(np.abs(way.shapes.coordinates).max()) == 0.0  # it does not pull
    assert way.shapes.touching is not None
    assert not way.shapes.touching.any()


def test_domes_that_are_pulled_back_meet_their_neighbors_at_no_pressure(
    study: Study, pressed: Made
) -> None:
    """Nothing moves before, so that there is no path to be followed but that of the pressure."""
    finger = study(3)
    finger = pressed(type(finger)(**{**vars(finger), "law": PushOnly(PUBLISHED)}))
    start, _ = at_rest(finger, np.zeros((3, 1), bool))
    shapes = driven(finger, start, np.full((3, 1), -0.3)).shapes
    way = driven(finger, shapes, np.full((3, 1), 0.1))
    (event,) = way.events
    assert event.halted.reason.tolist() == [Halt.CONTACT]
    assert event.halted.shapes.pressure[:, 0] == pytest.approx([0.0] * 3, abs=1e-12)
    assert event.halted.tied.sum() == 2
    assert way.shapes.touching is not None
    assert way.shapes.touching.all()
    assert (finger.extensions(way.shapes.coordinates) > 0.3).all()


def test_the_inverted_state_under_pressure_is_the_root_of_its_force(
    study: Study, pressed: Made
) -> None:
    finger = pressed(study(1, np.inf))
    shapes, _ = at_rest(finger, np.ones((1, 1), bool))
    pressure = 0.1
    there = driven(finger, shapes, np.array([[pressure]])).shapes

    def unbalanced(x: float) -> float:
        spring = 12.84 * x * (1.0 + 0.957 * (2.0 * (x / 3.5) ** 2 - 3.0 * x / 3.5))
        turn = 2.0 * np.arcsin(x / 21.5)
        return float(spring + 24.2 * turn / (10.75 * np.cos(turn / 2.0)) - pressure * AREA)

    opening: Array = finger.extensions(there.coordinates)
    assert opening[0, 0] == pytest.approx(brentq(unbalanced, 3.0, 4.0, xtol=1e-13), rel=1e-12)


@pytest.mark.parametrize("hinge_stiffness", [24.2, 120.0, 300.0])
def test_a_dome_that_its_hinge_holds_back_has_the_energy_of_one_that_is_attached(
    study: Study, pressed: Made, hinge_stiffness: float
) -> None:
    """In touch on both sides of the snap, beyond the pressure at which it snaps by itself."""
    finger = study(1, np.inf).changed(
        hinge_stiffness=np.array([[hinge_stiffness]]), force_linearity=np.zeros((1, 1))
    )
    pushing = replace(finger, law=PushOnly(PUBLISHED))
    (attached,) = events_of(pressed(finger), 0.4)
    (pushed,) = events_of(pressed(pushing), 0.4)
    energy = lost(pressed(finger), attached)
    assert lost(pressed(pushing), pushed) == pytest.approx(energy, rel=1e-9)
    before = pushed.halted.shapes
    own = pressed(pushing)
    assert limits(own.finger, own.volumes).snap_pressure[0, 0] < before.pressure[0, 0]
    np.testing.assert_array_equal(own.travels(before), own.extensions(before.coordinates))
