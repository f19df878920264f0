"""Fingers that close on a body by pressure: beside `actuate`, an energy of its own, and SciPy."""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize

from dpgcli.actuation.pressed import Pressed
from dpgcli.actuation.rest import at_rest
from dpgcli.actuation.travel import EventKind, travel
from dpgcli.arrays import Array
from dpgcli.design.bodies import Body, Disc, Jaws
from dpgcli.design.pressure import History, Pressure
from dpgcli.design.scene import Gripper, Held, Scene
from dpgcli.grasping import grasp
from dpgcli.grasping.approach import Approach, Way, approach
from dpgcli.grasping.closing import Closing
from dpgcli.grasping.frames import frames
from dpgcli.grasping.grasp import placed
from dpgcli.grasping.grasped import Placed
from dpgcli.grasping.shapes import Ramp
from dpgcli.grasping.table import Grasps, grasp_rows, grasps
from dpgcli.mechanics.finger import STUDY, Finger
from dpgcli.mechanics.pressure import DomeVolumes
from dpgcli.mechanics.terms import chain_potential
from dpgcli.states.certify import Status
from dpgcli.states.patterns import codes_of
from dpgcli.states.units import UnitSolutions

Fingers = Callable[..., Finger]
AREA = 31.61  # mm², of the study's dome: it snaps at 0.1495 MPa
SHORT, NEAR = 0.002, 0.1  # MPa, mm: SciPy's steps are to lead over no barrier
FAR = Disc(np.array([300.0, -3.0]), 5.0)


@pytest.fixture(autouse=True)
def without_margins(monkeypatch: pytest.MonkeyPatch) -> None:
    """Margins are looked for as far as the load itself: nowhere."""
    monkeypatch.setattr(grasp, "MARGIN_TO", 1.0)


def closing(n_units: int, *steps: float | tuple[float, ...], line_of: Any = None) -> Closing:
    """Through pressures of one line, or of several, MPa."""
    history = np.array(steps, float).reshape(len(steps), -1)
    lines = tuple("ABC"[: history.shape[1]])
    places = np.zeros(n_units, int) if line_of is None else np.array(line_of)
    pressure = Pressure(lines, places, np.array([[AREA]]), None)
    return Closing(DomeVolumes(np.full((n_units, 1), AREA)), pressure, History(history))


def codes(*texts: str) -> Any:
    return codes_of(np.array([[digit == "1" for digit in text] for text in texts]).T)


def on_body(finger: Finger, body: Body, *patterns: str, by: Closing | None = None) -> Placed:
    """A finger alone in its own frame."""
    scene = Scene(finger, (), None, 1.5)
    (frame,) = frames(None)
    return placed(scene, chain_potential, body, frame, codes(*patterns), Way.CLOSE, by)


def ramped(part: Placed, came: Approach, before: float, after: float) -> Approach:
    """From one pressure to another, all units on one line."""
    n = part.own.units.finger.n_units
    begin, change = np.full((n, 1), before), np.full((n, 1), after - before)
    ramp = Ramp(DomeVolumes(np.full((n, 1), AREA)), begin, change)
    own, lanes = replace(part.own, depth=np.zeros(1), ramp=ramp), len(came.load)
    return approach(own, came.shapes, np.zeros(lanes), np.ones(lanes))


@pytest.mark.parametrize(
    ("bars", "walls", "steps"),
    [
        (1e4, 0.0, [0.16, 0.0]),
        pytest.param(np.inf, 0.0, [0.25, -0.15, 0.0], marks=pytest.mark.slow),
        pytest.param(1e3, 0.1, [0.25, -0.15, 0.0], marks=pytest.mark.slow),
    ],
)
def test_what_they_do_not_touch_changes_nothing(
    bars: float, walls: float, steps: list[float], graded_finger: Fingers, told: Callable[..., Any]
) -> None:
    """Thresholds, states and shapes are those of `actuate`."""
    finger = graded_finger(5, 3, bars, force_linearity=0.03).changed(
        wall_compliance=np.array([[walls]])
    )
    by = closing(5, *((p, 0.9 * p) for p in steps), line_of=[0, 0, 1, 1, 0])
    part = on_body(finger, FAR, "00000", by=by)
    pressed = Pressed(UnitSolutions.of(finger), by.volumes)
    rest, _ = at_rest(pressed, np.zeros((5, 1), bool))
    way = travel(pressed, rest, by.history.pressure[:, by.pressure.line_of])
    expected = []
    for event in way.events:
        pressure = way.points.shapes.pressure[:, event.before]
        kind = "snap" if event.kind is EventKind.SNAP else "reset"
        expected += [(unit, kind, pressure[unit]) for unit in event.units]
    found = told(part.grown)
    assert len(expected) >= 2
    assert [event[:2] for event in found] == [event[:2] for event in expected]
    assert [e[2] for e in found] == pytest.approx([e[2] for e in expected], rel=1e-9)
    shape = part.grown.shapes.coordinates
    assert shape == pytest.approx(way.final.coordinates, abs=1e-9)
    (finger_told,) = grasp.described(part.own, [part.codes], part.grown, part.status)
    assert finger_told.status.tolist() == [Status.STABLE]


class Drawn:
    """A random finger, and a disc below it that it meets as it closes."""

    def __init__(self, seed: int) -> None:
        random = np.random.default_rng(900 + seed)
        n = self.n = int(random.integers(2, 5))
        values = {name: value * random.uniform(0.85, 1.15, (n, 1)) for name, value in STUDY.items()}
        values["segment_height"] = values["segment_height"][:1]
        values["force_linearity"] = random.uniform(0.02, 0.04, (n, 1))
        bars = np.array([[(1e3, 1e4, np.inf)[seed % 3]]])
        walls = np.array([[0.3 if seed % 2 else 0.0]])
        self.finger = Finger(n, **values, linear_stiffness=bars).changed(wall_compliance=walls)
        self.center = np.array([random.uniform(12.0, 13.5 * n), -random.uniform(14.0, 24.0)])
        self.radius = 0.85 * -self.center[1]
        self.pressures = [*np.linspace(0.0, 0.25, 8), *np.linspace(0.25, 0.0, 5)[1:]]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(16))
def test_slsqp_finds_each_point_from_the_one_before(seed: int, own: Callable[..., Any]) -> None:
    """Wherever no unit snaps between them; and the balance is that of definitions."""
    drawn = Drawn(seed)
    part = on_body(drawn.finger, Disc(drawn.center, drawn.radius), "0" * drawn.n)
    finger = own(drawn.finger, np.zeros(drawn.n, bool), 1.5, tuple(drawn.center), drawn.radius)
    coordinates = part.own.potentials(part.grown.shapes.inverted)[0].coordinates
    size = len(part.grown.shapes.coordinates)
    unit = np.broadcast_to(coordinates.force_unit, (size, 1))[:, 0]
    came, n_compared, n_touching, n_events = part.grown, 0, 0, 0
    for last, pressure in pairwise(drawn.pressures):
        short = pressure - np.copysign(SHORT, pressure - last)
        earlier = ramped(part, came, last, short)
        came = ramped(part, earlier, short, pressure)
        n_events += len(earlier.resets) + len(came.resets)

        def energy(q: Array, p: float = pressure) -> Array:
            return np.asarray(finger.energy(q) - p * AREA * sum(finger.extensions(q)))

        q, push = came.shapes.coordinates[:, 0], part.own.relabeled(came.shapes).push[:, 0]
        rest = finger.gradient(energy, q) - push @ finger.gradient(finger.gaps, q)
        assert np.abs(rest / unit).max() <= 1e-8
        gaps = finger.gaps(q[:, None])[:, 0]
        assert gaps.min() >= -1e-9 and np.abs(gaps * push).max() <= 1e-9
        n_touching += bool(push.max() > 0.0)
        if came.resets:
            continue
        best = by_scipy(finger, energy, gaps, earlier.shapes.coordinates[:, 0], unit)
        assert best == pytest.approx(q, abs=1e-5)
        n_compared += 1
    assert n_compared >= 6 and n_touching >= 3 and n_events >= 1


def by_scipy(
    finger: Any, energy: Callable[[Array], Array], gaps: Array, start: Array, unit: Array
) -> Array:
    """The minimum that SLSQP finds from a start, by coordinates of which `unit` makes mm."""
    slopes = finger.gradient(finger.gaps, start) / unit
    away = np.abs(gaps[:, None] - gaps) + np.abs(slopes[:, None] - slopes).max(axis=2)
    apart = [k for k in range(len(gaps)) if not (away[k, :k] < 1e-6).any()]  # not another's
    limits = {
        "type": "ineq",
        "fun": lambda z: finger.gaps((z / unit)[:, None])[apart, 0],
        "jac": lambda z: finger.gradient(finger.gaps, z / unit)[apart] / unit,
    }
    best = minimize(
        lambda z: float(energy((z / unit)[:, None])[0]),
        start * unit,
        jac=lambda z: finger.gradient(energy, z / unit) / unit,
        constraints=limits,
        method="SLSQP",
        bounds=[(z - NEAR, z + NEAR) for z in start * unit],
        options={"ftol": 1e-13, "maxiter": 200},
    )
    return np.asarray(best.x / unit)


def gripped(
    finger: Finger, body: Body, by: Closing, *pairs: str, held: Held = Held.FIXED
) -> Grasps:
    """Two fingers of a gripper that close on a body."""
    uppers, lowers = zip(*(pair.split("/") for pair in pairs), strict=True)
    scene = Scene(finger, (), Gripper(40.0, 0.0), 1.5, body=body, held=held)
    both = codes(*uppers), codes(*lowers)
    return grasps(scene, chain_potential, body, both, Way.CLOSE, by)


def test_the_work_of_pressures_is_the_change_of_energy(graded_finger: Fingers) -> None:
    """dΠ = −Σ A x dp, and the body does no work: beside it from 0.02 to 0.12 MPa, no event."""
    part = on_body(graded_finger(4, 5), Disc(np.array([30.0, -14.0]), 13.0), "0110")
    came = ramped(part, part.grown, 0.0, 0.02)
    dome = part.own.potentials(came.shapes.inverted)[0].coordinates.dome

    def swept(came: Approach) -> float:
        return float(AREA * dome(came.shapes.coordinates).value.sum())

    def energy(came: Approach) -> float:
        (own,) = part.own.potentials(came.shapes.inverted)
        return float(own.evaluate(came.shapes.coordinates).energy[0])

    volumes, energies = [swept(came)], [energy(came)]
    pressures = np.linspace(0.02, 0.12, 41)
    for before, after in pairwise(pressures):
        came = ramped(part, came, before, after)
        assert came.shapes.is_there.all() and not came.resets
        volumes.append(swept(came))
        energies.append(energy(came))
    assert came.shapes.push.max() > 0.05
    weights = np.array([1.0, *[4.0, 2.0] * 19, 4.0, 1.0]) / 3.0 * 0.0025  # Simpson
    changed = energies[-1] - energies[0] - pressures[-1] * volumes[-1] + pressures[0] * volumes[0]
    assert changed == pytest.approx(-weights @ volumes, rel=1e-8)
    assert abs(changed) > 1.0


def test_stops_on_the_way_change_nothing(told: Callable[..., Any]) -> None:
    """Events and shapes are the same to the last digits."""
    drawn = Drawn(0)
    disc, n = Disc(drawn.center, drawn.radius), drawn.n
    at_once = on_body(drawn.finger, disc, "0" * n, by=closing(n, 0.2, 0.0)).grown
    part = on_body(drawn.finger, disc, "0" * n)
    bit_by_bit, other = part.grown, list[tuple[int, str, float]]()
    for before, after in pairwise((0.0, 0.07, 0.12, 0.16, 0.2, 0.09, 0.0)):
        bit_by_bit = ramped(part, bit_by_bit, before, after)
        way = (replace(r, pressure=0.0 * r.flipped + r.load) for r in bit_by_bit.resets)
        events = told(replace(bit_by_bit, resets=tuple(way)))
        other += [(unit, kind, before + p * (after - before)) for unit, kind, p in events]
    one = told(at_once)
    assert [event[:2] for event in one] == [event[:2] for event in other] and len(one) >= 2
    assert [event[2] for event in one] == pytest.approx([event[2] for event in other], rel=1e-9)
    there, again = at_once.shapes, bit_by_bit.shapes
    assert there.coordinates == pytest.approx(again.coordinates, abs=1e-9)
    assert there.push == pytest.approx(again.push, abs=1e-8) and there.push.max() > 0.1


def test_mirrored_fingers_close_alike(reference_finger: Fingers) -> None:
    """A body above the axis, and the same below: all that is told changes places."""
    finger, by = reference_finger(2), closing(2, 0.16, 0.0)
    up, down = (
        gripped(finger, Disc(np.array([19.0, y]), 14.0), by, pair)
        for y, pair in ((1.0, "00/01"), (-1.0, "01/00"))
    )
    for upper, lower in zip(up.fingers, down.fingers[::-1], strict=True):
        assert (upper.force == lower.force).all() and (upper.after == lower.after).all()
        assert [r.load.tolist() for r in upper.resets] == [r.load.tolist() for r in lower.resets]
    rows, others = grasp_rows(up), grasp_rows(down)
    assert rows["events"][0].split("/") == others["events"][0].split("/")[::-1]
    assert rows["squeeze_N"] == pytest.approx(others["squeeze_N"], rel=1e-12)


def test_equal_units_are_tied_unless_the_body_tells_them_apart(reference_finger: Fingers) -> None:
    finger, by = reference_finger(3), closing(3, 0.16, 0.0)
    free = on_body(finger, FAR, "000", "010", by=by).grown
    assert [reset.tied[:, 0].tolist() for reset in free.resets if 0 in reset.lanes] == [[True] * 3]
    others = [
        reset.tied[:, place] for reset in free.resets for place in np.flatnonzero(reset.lanes)
    ]
    assert [flags.tolist() for flags in others] == [[True, False, True]]
    pressed = on_body(finger, Disc(np.array([22.0, -15.0]), 14.2), "000", by=by).grown
    assert pressed.resets and not any(reset.tied.any() for reset in pressed.resets)
    apart = finger.changed(bistable_stiffness=np.array([[12.84], [12.8401], [12.8402]]))
    assert not any(r.tied.any() for r in on_body(apart, FAR, "000", by=by).grown.resets)


def test_units_that_are_nearly_equal_snap_where_they_do_without_a_body(
    reference_finger: Fingers, told: Callable[..., Any]
) -> None:
    """Where nothing touches it yet: no contact that slides over a corner is looked for there."""
    finger, by = reference_finger(3, 1e4), closing(3, 0.2, 0.0)
    found = on_body(finger, Disc(np.array([28.35, -20.0]), 14.0), "000", by=by).grown
    pressed = Pressed(UnitSolutions.of(finger), by.volumes)
    way = travel(pressed, at_rest(pressed, np.zeros((3, 1), bool))[0], np.full((1, 3), 0.2))
    first = way.points.shapes.pressure[0, way.events[0].before]
    assert told(found)[0][2] == pytest.approx(first, rel=1e-11)
    assert found.resets[0].tied[:, 0].tolist() == [True, True, True]


def test_fingers_that_fold_onto_themselves_are_lost(reference_finger: Fingers) -> None:
    """Though the shape is back in its place without pressure."""
    lost, kept = (
        on_body(reference_finger(5), FAR, "00000", by=closing(5, peak, 0.0)).grown
        for peak in (100.0, 1.0)
    )
    assert kept.shapes.is_there.all() and not lost.shapes.is_there.any()


def test_what_is_behind_the_domes_is_out_of_the_way(reference_finger: Fingers) -> None:
    """Six units turn by more than a right angle, in front of what lay beyond the tip."""
    found = on_body(reference_finger(6), FAR, "000000", by=closing(6, 0.16, 0.0))
    assert found.grown.shapes.is_there.all()
    assert found.own.is_open(found.grown.shapes).all()


def test_derivatives_by_pressures(graded_finger: Fingers, dense: Callable[[Array], Array]) -> None:
    """Gradient, Hessian and what changes with the load, by differences of the energy."""
    part = on_body(graded_finger(3, 2, 1e3), Disc(np.array([24.0, -14.0]), 12.0), "000")
    volumes = DomeVolumes(np.array([[30.0], [31.0], [33.0]]))
    ramp = Ramp(volumes, np.array([[0.02], [0.03], [0.0]]), np.array([[0.1], [-0.05], [0.07]]))
    own, shapes = replace(part.own, depth=np.zeros(1), ramp=ramp), part.grown.shapes
    potential = own.bare(shapes.inverted, np.array([0.4]))
    q = shapes.coordinates + 0.01 * np.random.default_rng(1).normal(size=shapes.coordinates.shape)
    (alone,) = own.potentials(shapes.inverted)
    stretch = alone.coordinates.dome(q).value
    pressure = ramp.begin + 0.4 * ramp.change
    here, bare = potential.evaluate(q), alone.evaluate(q)
    work = float((pressure * volumes.area * stretch).sum())
    assert float(here.energy[0]) == pytest.approx(float(bare.energy[0]) - work, rel=1e-12)
    step = 1e-6 * np.eye(len(q))
    slopes = [
        (potential.evaluate(q + h[:, None]).energy - potential.evaluate(q - h[:, None]).energy)[0]
        for h in step
    ]
    assert here.gradient[:, 0] == pytest.approx(np.array(slopes) / 2e-6, abs=1e-5)
    family = own.family(shapes.inverted, shapes.active)
    y = own.stacked(replace(shapes, coordinates=q))
    none = np.zeros((3, 1))
    depth = max(family.column_depths)
    before, here, after = (
        family.linearized(y, np.array([load]), none, np.zeros(1), depth) for load in (0.3, 0.4, 0.5)
    )
    assert here.rate == pytest.approx((after.gradient - before.gradient) / 0.2, abs=1e-9)


def test_bodies_that_may_move_are_kept_until_there_is_no_pressure(
    reference_finger: Fingers,
) -> None:
    """Then they are let go of: what happened before is that of one that stays, row by row."""
    finger, by = reference_finger(2), closing(2, 0.2, 0.0)
    can = Disc(np.array([18.9, 0.0]), 14.0)
    pairs = ("00/00", "01/10")
    fixed, free = (gripped(finger, can, by, *pairs, held=h) for h in (Held.FIXED, Held.FREE))
    rows = grasp_rows(free)
    for name in ("events", "tie"):
        assert rows[name].tolist() == grasp_rows(fixed)[name].tolist()
    assert (rows["events"] != "").all() and rows["status"].tolist() == [Status.NOT_HELD] * 2


@pytest.mark.slow
def test_jaws_that_give_way_do_so_all_the_while(reference_finger: Fingers) -> None:
    """The squeeze is k (a₀ − a) in the end; stiff ones are rigid; soft ones let others snap."""
    finger, by = reference_finger(3), closing(3, 0.2, 0.0)
    jaws = Jaws(np.array([28.35, 0.0]), 28.0, 20.0)
    rigid, stiff, soft = (
        grasp_rows(gripped(finger, replace(jaws, stiffness=k), by, "000/000"))
        for k in (None, 20.0, 0.05)
    )
    assert soft["squeeze_N"][0] == pytest.approx(0.05 * (28.0 - soft["jaw_gap_mm"][0]), abs=1e-9)
    assert soft["squeeze_N"][0] > 0.5
    texts = [rows["events"][0].split("snap 3 at ")[1] for rows in (rigid, stiff)]
    one, other = (float(text.split()[0]) for text in texts)
    assert one == pytest.approx(other, rel=1e-3) and one != other
    assert stiff["pattern_after"].tolist() == rigid["pattern_after"].tolist() == ["001"]
    assert soft["pattern_after"].tolist() == ["111"]


@pytest.mark.slow
def test_free_jaws_that_give_way(reference_finger: Fingers) -> None:
    """They are let go of once there is no pressure, their aperture as it is then."""
    finger, by = reference_finger(3), closing(3, 0.2, 0.0)
    jaws = Jaws(np.array([28.35, 0.0]), 28.0, 20.0, stiffness=0.05)
    fixed, guided = (
        grasp_rows(gripped(finger, jaws, by, "000/000", held=held))
        for held in (Held.FIXED, Held.GUIDED)
    )
    assert guided["events"].tolist() == fixed["events"].tolist()
    assert guided["status"].tolist() == [Status.NOT_HELD]  # flat plates: nothing keeps their x
