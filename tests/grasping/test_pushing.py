"""Domes that only push, beside a body under pressure: own energy, SciPy, `actuate`, work, folds.

The energy of these tests has each dome's place y as a coordinate behind the finger's, and that its
neighbor is in its way as one more inequality beside the disc's. With the package it shares the
order of coordinates and the curve of a dome.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize

from dpgcli.actuation.domes import limits
from dpgcli.actuation.pressed import Pressed
from dpgcli.actuation.rest import at_rest
from dpgcli.actuation.travel import travel
from dpgcli.arrays import Array
from dpgcli.design.bodies import Body, Disc
from dpgcli.design.pressure import History, Pressure
from dpgcli.design.scene import Scene
from dpgcli.grasping import grasp
from dpgcli.grasping.approach import Approach, Way, approach
from dpgcli.grasping.closing import Closing
from dpgcli.grasping.contact import Obstructed
from dpgcli.grasping.descent import finished
from dpgcli.grasping.frames import frames
from dpgcli.grasping.grasp import placed
from dpgcli.grasping.grasped import Placed
from dpgcli.grasping.shapes import Ramp
from dpgcli.grasping.travels import with_travels
from dpgcli.mechanics.curve import spline
from dpgcli.mechanics.finger import STUDY, Finger
from dpgcli.mechanics.laws import PUBLISHED, PushOnly, Tabulated
from dpgcli.mechanics.pressure import DomeVolumes
from dpgcli.mechanics.terms import chain_potential
from dpgcli.states.certify import Status
from dpgcli.states.patterns import codes_of
from dpgcli.states.units import UnitSolutions

SHORT, NEAR = 0.002, 0.1  # MPa, mm: SciPy's steps are to lead over no barrier
FAR = Disc(np.array([300.0, -3.0]), 5.0)
KNOTS = np.linspace(0.0, 1.2, 41)
CURVE = spline(
    tuple(KNOTS.tolist()), tuple((0.5 * KNOTS**2 * (0.05 + 0.95 * (1.0 - KNOTS) ** 2)).tolist())
)


@pytest.fixture(autouse=True)
def without_margins(monkeypatch: pytest.MonkeyPatch) -> None:
    """Margins are looked for as far as the load itself: nowhere."""
    monkeypatch.setattr(grasp, "MARGIN_TO", 1.0)


class Drawn:
    """A random finger and a disc below it; even ones touch their neighbors at rest, others far on.

    Those have the study's energy by the opening, these a curve by the travel.
    """

    def __init__(self, seed: int, least: int = 2) -> None:
        random = self.random = np.random.default_rng(1200 + seed)
        n = self.n = int(random.integers(least, 5))
        values = {name: value * random.uniform(0.85, 1.15, (n, 1)) for name, value in STUDY.items()}
        values["segment_height"] = values["segment_height"][:1]
        values["force_linearity"] = random.uniform(0.02, 0.04, (n, 1))
        bars = np.array([[(1e3, 1e4, np.inf)[seed % 3]]])
        finger = Finger(n, **values, linear_stiffness=bars)
        finger = finger.changed(wall_compliance=np.array([[0.3 if seed % 4 < 2 else 0.0]]))
        if seed % 2:
            far = finger.stroke * random.uniform(3.0, 4.0, (n, 1))
            soft = finger.bistable_stiffness * random.uniform(0.1, 0.3, (n, 1))
            finger = finger.changed(dome_travel=far, bistable_stiffness=soft)
            self.finger = replace(finger, law=PushOnly(Tabulated(CURVE)))
        else:
            self.finger = replace(finger, law=PushOnly(PUBLISHED))
        peak = limits(self.finger, DomeVolumes(np.ones((n, 1)))).snap_pressure
        self.area = peak / random.uniform(0.12, 0.18, (n, 1))
        self.center = np.array([random.uniform(12.0, 13.5 * n), -random.uniform(14.0, 24.0)])
        self.radius = 0.85 * -self.center[1]
        self.pressures = [*np.linspace(0.0, 0.25, 8), *np.linspace(0.25, 0.0, 5)[1:], -0.05, 0.0]

    def ramp(self, before: Array | float, after: Array | float) -> Ramp:
        """Pressures of all units, or by unit, (unit,)."""
        begin, end = (np.broadcast_to(p, self.n)[:, None] for p in (before, after))
        return Ramp(DomeVolumes(self.area), begin, end - begin)

    def on(self, body: Body, *patterns: str, by: Closing | None = None) -> Placed:
        """The finger alone in its own frame."""
        flags = np.array([[digit == "1" for digit in text] for text in patterns or ["0" * self.n]])
        scene, (frame,) = Scene(self.finger, (), None, 1.5), frames(None)
        return placed(scene, chain_potential, body, frame, codes_of(flags.T), Way.CLOSE, by)

    def begun(self, body: Body, *patterns: str) -> tuple[Obstructed, Approach]:
        """Beside a body, its domes by themselves, before any pressure."""
        part = self.on(body, *patterns)
        own = replace(part.own, depth=np.zeros(1), ramp=self.ramp(0.0, 0.0))
        return own, replace(part.grown, shapes=with_travels(own, part.grown.shapes))

    @property
    def disc(self) -> Disc:
        return Disc(self.center, self.radius)


def ramped(own: Obstructed, came: Approach, ramp: Ramp) -> Approach:
    n = len(came.load)
    return approach(replace(own, ramp=ramp), came.shapes, np.zeros(n), np.ones(n))


class WithTravels:
    """The energy of a finger without domes, and domes at places y: by z, coordinates and then y."""

    def __init__(self, drawn: Drawn, own: Callable[..., Any]) -> None:
        at = tuple(drawn.center), drawn.radius
        self.bare = own(drawn.finger, np.zeros(drawn.n, bool), 1.5, *at)
        self.finger, self.area, self.n = drawn.finger, drawn.area, drawn.n

    def energy(self, z: Array, pressure: Array | float) -> Array:
        """Less the work of pressures, N mm, (batch,)."""
        q, y = z[: -self.n], z[-self.n :]
        dome = self.finger.law.pulling.response(y, self.finger.domes).energy
        work = np.broadcast_to(pressure, self.n)[:, None] * self.area * y
        return np.asarray(self.bare.energy(q) + (dome - work).sum(axis=0))

    def unit(self, there: Obstructed, came: Approach) -> Array:
        """What makes mm of coordinates, (size,)."""
        (bare,), size = there.potentials(came.shapes.inverted), len(came.shapes.coordinates)
        own = np.broadcast_to(bare.coordinates.force_unit, (size - self.n, 1))[:, 0]
        return np.concatenate([own, np.ones(self.n)])

    def gaps(self, z: Array) -> Array:
        """To the disc and then between domes and neighbors, mm."""
        q, y = z[: -self.n], z[-self.n :]
        return np.concatenate([self.bare.gaps(q), np.array(self.bare.extensions(q)) - y])


def also_slow(quick: Sequence[int], stop: int) -> list[Any]:
    """Seeds up to a last one, all but the quick ones slow."""
    marks = {seed: [] if seed in quick else [pytest.mark.slow] for seed in range(stop)}
    return [pytest.param(seed, marks=own) for seed, own in marks.items()]


def check(known: WithTravels, there: Obstructed, came: Approach, p: Array | float) -> Array:
    """Assert balance and complementarity at pressures; the pushes, (cell,), N."""
    z, push = came.shapes.coordinates[:, 0], there.relabeled(came.shapes).push[:, 0]
    unit = known.unit(there, came)
    gradient = known.bare.gradient(lambda z: known.energy(z, p), z)
    slopes, gaps = known.bare.gradient(known.gaps, z), known.gaps(z[:, None])[:, 0]
    assert np.abs((gradient - push @ slopes) / unit).max() <= 1e-8, "N"
    assert gaps.min() >= -1e-9 and push.min() >= -1e-12
    assert np.abs(gaps * push).max() <= 1e-9, "N mm"
    return np.asarray(push)


@pytest.mark.parametrize("seed", also_slow((), 24))
def test_slsqp_finds_each_point_from_the_one_before(seed: int, own: Callable[..., Any]) -> None:
    """Wherever nothing snaps between them; and the balance is that of definitions."""
    drawn = Drawn(seed)
    known, (there, came) = WithTravels(drawn, own), drawn.begun(drawn.disc)
    n_compared = n_touching = n_events = 0
    for last, pressure in pairwise(drawn.pressures):
        short = pressure - np.copysign(SHORT, pressure - last)
        earlier = ramped(there, came, drawn.ramp(last, short))
        came = ramped(there, earlier, drawn.ramp(short, pressure))
        assert came.shapes.is_there.all()
        n_events += len(earlier.resets) + len(came.resets)
        push = check(known, there, came, pressure)
        n_touching += bool(push[: drawn.n].max() > 0.0)
        start, z = (own.shapes.coordinates[:, 0] for own in (earlier, came))
        if came.resets or np.abs(start - z).max() > 0.5 * NEAR:
            continue
        best = by_scipy(known, pressure, z, start, known.unit(there, came))
        assert best == pytest.approx(z, abs=1e-5)
        n_compared += 1
    assert n_compared >= 6 and n_events + n_touching >= 1


def by_scipy(known: WithTravels, p: float, z: Array, start: Array, unit: Array) -> Array:
    """The minimum that SLSQP finds from a start, by coordinates of which `unit` makes mm."""
    gaps = known.gaps(z[:, None])[:, 0]

    def energy(z: Array) -> Array:
        return known.energy(z, p)

    slopes = known.bare.gradient(known.gaps, start) / unit
    away = np.abs(gaps[:, None] - gaps) + np.abs(slopes[:, None] - slopes).max(axis=2)
    apart = [k for k in range(len(gaps)) if not (away[k, :k] < 1e-6).any()]  # not another's
    limits = {
        "type": "ineq",
        "fun": lambda z: known.gaps((z / unit)[:, None])[apart, 0],
        "jac": lambda z: known.bare.gradient(known.gaps, z / unit)[apart] / unit,
    }
    best = minimize(
        lambda z: float(energy((z / unit)[:, None])[0]),
        start * unit,
        jac=lambda z: known.bare.gradient(energy, z / unit) / unit,
        constraints=limits,
        method="SLSQP",
        bounds=[(z - NEAR, z + NEAR) for z in start * unit],
        options={"ftol": 1e-13, "maxiter": 400},
    )
    return np.asarray(best.x / unit)


def wandering(drawn: Drawn) -> list[Array]:
    """Pressures of every unit by itself, up and down, some of them none, MPa."""
    ways = drawn.random.uniform(-0.12, 0.25, (6, drawn.n))
    return [way * (drawn.random.random(drawn.n) < 0.8) for way in ways]


@pytest.mark.parametrize("seed", [120, *also_slow((4,), 60)])
def test_they_balance_wherever_pressures_go(seed: int, own: Callable[..., Any]) -> None:
    """Of 120 a contact was closed that is met beyond the end of a way."""
    drawn = Drawn(seed)
    known, (there, came) = WithTravels(drawn, own), drawn.begun(drawn.disc)
    assert came.shapes.is_there.all()
    for last, pressure in pairwise([np.zeros(drawn.n), *wandering(drawn)]):
        came = ramped(there, came, drawn.ramp(last, pressure))
        assert came.shapes.is_there.all()
        check(known, there, came, pressure)


def history(*steps: Sequence[float], line_of: Sequence[int]) -> tuple[Pressure, History]:
    lines = tuple("ABC"[: len(steps[0])])
    return Pressure(lines, np.array(line_of), np.ones((1, 1)), None), History(np.array(steps))


@pytest.mark.parametrize("seed", also_slow((2,), 60))
def test_what_they_do_not_touch_changes_nothing(seed: int, told: Callable[..., Any]) -> None:
    """Thresholds and shapes on two lines are those of `actuate`, in which travels are left out."""
    drawn = Drawn(seed, least=1)
    n, random = drawn.n, drawn.random
    steps = ([0.25, 0.2], [-0.15, -0.12], [0.1, 0.2], [0.0, 0.0])
    lines, pressures = history(*steps, line_of=random.integers(0, 2, n).tolist())
    by = Closing(DomeVolumes(drawn.area), lines, pressures)
    part = drawn.on(FAR, by=by)
    pressed = Pressed(UnitSolutions.of(drawn.finger), by.volumes)
    rest, _ = at_rest(pressed, np.zeros((n, 1), bool))
    way = travel(pressed, rest, pressures.pressure[:, lines.line_of])
    expected, points = [], way.points.shapes
    for event in way.events:  # a dome that leaves its neighbor may go back thereby
        before, after = (points.inverted[:, place] for place in (event.before, event.after))
        for unit in np.flatnonzero(before ^ after):
            kind = "snap" if after[unit] else "reset"
            expected.append((int(unit), kind, float(points.pressure[unit, event.before])))
    found = told(part.grown)
    assert len(expected) >= 2 and part.status.tolist() == [Status.STABLE]
    assert [event[:2] for event in found] == [event[:2] for event in expected]
    assert [e[2] for e in found] == pytest.approx([e[2] for e in expected], rel=1e-9)
    assert part.grown.shapes.coordinates == pytest.approx(way.final.coordinates, abs=1e-9)
    (finger_told,) = grasp.described(part.own, [part.codes], part.grown, part.status)
    assert finger_told.status.tolist() == [Status.STABLE]


@pytest.mark.parametrize("seed", [pytest.param(1, marks=pytest.mark.slow), 4])
def test_the_work_of_pressures_is_the_change_of_energy(seed: int, own: Callable[..., Any]) -> None:
    """dΠ = −Σ A y dp wherever nothing snaps: neither body nor neighbors work on what they touch."""
    drawn = Drawn(seed)
    known, (there, came) = WithTravels(drawn, own), drawn.begun(drawn.disc)
    came = ramped(there, came, drawn.ramp(0.0, 0.25))
    pressures, n_touching = np.linspace(0.25, 0.15, 41), 0
    volumes, energies = [], []
    for before, after in pairwise([0.25, *pressures]):
        came = ramped(there, came, drawn.ramp(before, after))
        assert came.shapes.is_there.all() and not came.resets
        z = came.shapes.coordinates
        volumes.append(float((drawn.area * z[-drawn.n :]).sum()))
        energies.append(float(known.energy(z, after)[0]))
        push = came.shapes.push[:, 0]
        n_touching += push[: drawn.n].max() > 0.01 and push[drawn.n :].max() > 0.01
    weights = np.array([1.0, *[4.0, 2.0] * 19, 4.0, 1.0]) / 3.0 * -0.0025  # Simpson
    changed = energies[-1] - energies[0]
    assert changed == pytest.approx(-weights @ np.array(volumes), rel=1e-8)
    assert abs(changed) > 1.0 and n_touching == 41


@pytest.mark.parametrize("seed", also_slow((), 12))
def test_stops_on_the_way_change_nothing(seed: int) -> None:
    """Events and shapes are the same to the last digits."""
    drawn = Drawn(seed)
    there, begun = drawn.begun(drawn.disc)
    ends = np.array([0.0, 0.23, -0.1])
    came = other = begun
    events: list[list[tuple[float, list[int]]]] = [[], []]
    for before, after in pairwise(ends):
        came = ramped(there, came, drawn.ramp(before, after))
        events[0] += at_pressures(came, before, after)
        stops = before + (after - before) * np.array([0.0, 0.21, 0.47, 0.62, 0.83, 1.0])
        for one, two in pairwise(stops):
            other = ramped(there, other, drawn.ramp(one, two))
            events[1] += at_pressures(other, one, two)
    assert [units for _, units in events[0]] == [units for _, units in events[1]] != []
    assert [p for p, _ in events[0]] == pytest.approx([p for p, _ in events[1]], rel=1e-9)
    assert came.shapes.coordinates == pytest.approx(other.shapes.coordinates, abs=1e-9)
    assert came.shapes.push == pytest.approx(other.shapes.push, abs=1e-8)


def at_pressures(came: Approach, before: float, after: float) -> list[tuple[float, list[int]]]:
    """The pressures at which units flipped on a way, MPa, and which."""
    return [
        (before + float(told.load[0]) * (after - before), np.flatnonzero(told.flipped).tolist())
        for told in came.resets
    ]


@pytest.mark.parametrize("seed", also_slow((), 16))
def test_units_flip_where_their_equilibrium_ends(seed: int, own: Callable[..., Any]) -> None:
    """It is there until 1 − 1e-9 of the load, and not at 1 + 1e-9; the last one is nearly level."""
    drawn = Drawn(seed)
    known, (there, came) = WithTravels(drawn, own), drawn.begun(drawn.disc)
    n_folds = 0
    for before, after in pairwise([0.0, 0.23, -0.12]):
        ramp = replace(there, ramp=drawn.ramp(before, after))
        for told in ramped(there, came, ramp.ramp).resets:
            short, beyond = told.load * (1.0 - 1e-9), told.load * (1.0 + 1e-9)
            last = approach(ramp, came.shapes, np.zeros(1), short)
            assert last.shapes.is_there.all()
            n_before = sum(one.load[0] < short[0] for one in last.resets)
            assert len(last.resets) == n_before
            assert is_nearly_lost(known, there, last, float(before + short[0] * (after - before)))
            at = last.shapes
            on = finished(ramp, at.coordinates, at.inverted, at.push, beyond)
            moved = np.abs(on.coordinates - at.coordinates).max()
            assert not on.is_there.all() or not moved < 1e-2 or on.push.min() < 0.0, "it pulls"
            n_folds += 1
        came = ramped(there, came, ramp.ramp)
    assert n_folds >= 1


def is_nearly_lost(known: WithTravels, there: Obstructed, came: Approach, p: float) -> bool:
    """Whether a minimum on the tangent space of closed contacts is nearly none, or one opens."""
    z, shapes = came.shapes.coordinates[:, 0], there.relabeled(came.shapes)
    unit, active, push = known.unit(there, came), shapes.active[:, 0], shapes.push[:, 0]
    lagrangian = known.bare.hessian(
        lambda z: known.energy(z, p) - np.tensordot(push, known.gaps(z), 1), z
    )
    normals = (known.bare.gradient(known.gaps, z) / unit)[active].T
    tangent = np.linalg.svd(normals)[0][:, normals.shape[1] :] if active.any() else np.eye(len(z))
    stiffness = np.linalg.eigvalsh(tangent.T @ (lagrangian / unit / unit[:, None]) @ tangent)
    assert stiffness.min() >= 0.0
    return bool(stiffness.min() < 0.05 or push[active].min() < 1e-6)
