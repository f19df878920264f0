"""Domes that only push, beside a body under pressure: own energy, SciPy, `actuate`, work, folds.

The energy of these tests has each dome's place y as a coordinate behind the finger's, and that its
neighbor is in its way as one more inequality beside the disc's. With the package it shares the
order of coordinates and the curve of a dome.
"""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize

from dpgcli.actuation.domes import limits
from dpgcli.actuation.pressed import Pressed
from dpgcli.actuation.rest import at_rest
from dpgcli.actuation.travel import MEETINGS, travel
from dpgcli.arrays import Array, Flags
from dpgcli.design.bodies import Body, Disc
from dpgcli.design.pressure import History, Pressure
from dpgcli.design.scene import Scene
from dpgcli.grasping import grasp
from dpgcli.grasping.approach import Approach, Way, approach
from dpgcli.grasping.closing import Closing
from dpgcli.grasping.contact import Obstructed
from dpgcli.grasping.frames import frames
from dpgcli.grasping.grasp import Placed, placed
from dpgcli.grasping.shapes import ContactShapes, Ramp
from dpgcli.grasping.travels import with_travels
from dpgcli.mechanics.curve import spline
from dpgcli.mechanics.finger import STUDY, Finger
from dpgcli.mechanics.laws import PUBLISHED, PushOnly, Tabulated
from dpgcli.mechanics.pressure import DomeVolumes
from dpgcli.mechanics.terms import chain_potential
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

    def gaps(self, z: Array) -> Array:
        """To the disc and then between domes and neighbors, mm."""
        q, y = z[: -self.n], z[-self.n :]
        return np.concatenate([self.bare.gaps(q), np.array(self.bare.extensions(q)) - y])


@pytest.mark.parametrize(
    "seed", [0, 1, *(pytest.param(s, marks=pytest.mark.slow) for s in range(2, 24))]
)
def test_slsqp_finds_each_point_from_the_one_before(seed: int, own: Callable[..., Any]) -> None:
    """Wherever nothing snaps between them; and the balance is that of definitions."""
    drawn = Drawn(seed)
    known, by = WithTravels(drawn, own), drawn.begun(drawn.disc)
    obstructed, came = by
    size, n = len(came.shapes.coordinates), drawn.n
    (bare,) = obstructed.potentials(came.shapes.inverted)
    unit = np.ones(size)
    unit[:-n] = np.broadcast_to(bare.coordinates.force_unit, (size - n, 1))[:, 0]
    n_compared = n_touching = n_events = n_both = 0
    for last, pressure in pairwise(drawn.pressures):
        short = pressure - np.copysign(SHORT, pressure - last)
        earlier = ramped(obstructed, came, drawn.ramp(last, short))
        came = ramped(obstructed, earlier, drawn.ramp(short, pressure))
        assert came.shapes.is_there.all()
        n_events += len(earlier.resets) + len(came.resets)

        def energy(z: Array, p: float = pressure) -> Array:
            return known.energy(z, p)

        z = came.shapes.coordinates[:, 0]
        push = obstructed.relabeled(came.shapes).push[:, 0]
        gradient, slopes = known.bare.gradient(energy, z), known.bare.gradient(known.gaps, z)
        assert np.abs((gradient - push @ slopes) / unit).max() <= 1e-8
        gaps = known.gaps(z[:, None])[:, 0]
        assert gaps.min() >= -1e-9 and np.abs(gaps * push).max() <= 1e-9 and push.min() >= 0.0
        n_touching += bool(push[:n].max() > 0.0)
        n_both += bool(push[:n].max() > 0.0 and push[n:].max() > 0.0 and gaps[n:].max() > 1e-6)
        start = earlier.shapes.coordinates[:, 0]
        if came.resets or np.abs(start - z).max() > 0.5 * NEAR:
            continue
        best = by_scipy(known, energy, gaps, start, unit)
        assert best == pytest.approx(z, abs=1e-5)
        n_compared += 1
    print(seed, n_compared, n_touching, n_events, n_both)
    assert n_compared >= 6


def by_scipy(
    known: WithTravels, energy: Callable[[Array], Array], gaps: Array, start: Array, unit: Array
) -> Array:
    """The minimum that SLSQP finds from a start, by coordinates of which `unit` makes mm."""
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
