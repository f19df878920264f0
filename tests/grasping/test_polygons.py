"""Fingers against jaws and polygons: a closed form, and by an energy and gaps of their own."""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import Any

import mpmath
import numpy as np
import pytest
import shapely
from scipy.optimize import minimize

from dpgcli.arrays import Array
from dpgcli.design.bodies import Body, Jaws, Polygon
from dpgcli.design.scene import Gripper, Scene
from dpgcli.grasping import grasp
from dpgcli.grasping.frames import frames
from dpgcli.grasping.grasp import placed
from dpgcli.grasping.grasped import Placed
from dpgcli.mechanics.finger import STUDY, Finger
from dpgcli.mechanics.terms import chain_potential
from dpgcli.states.certify import Status
from dpgcli.states.patterns import codes_of

Fingers = Callable[..., Finger]
ALONE = frames(None)[0]
BARS = (1e3, 1e4, np.inf)
QUICK = (4, 9)
PRESSED = (*QUICK, 16, 0, 3, 6, 10, 15, 18, 19, 24, 26, 28, 31, 35, 37)
SEEDS = [pytest.param(s, marks=[] if s in QUICK else pytest.mark.slow) for s in PRESSED]
ROUNDING = 1e-9  # mm


def on_body(finger: Finger, patterns: list[str], body: Body, thickness: float = 1.5) -> Placed:
    inverted = np.array([[digit == "1" for digit in text] for text in patterns]).T
    scene = Scene(finger, (), layer_thickness=thickness)
    return placed(scene, chain_potential, body, ALONE, codes_of(inverted))


def below(gap: float, height: float, x: float, top: float) -> Jaws:
    """Jaws whose upper plate is at y = `top` in the finger's frame, about x."""
    return Jaws(np.array([x, top - 0.5 * gap]), gap, height)


@pytest.mark.parametrize("top", [-2.0, -1.5, -1.0])
def test_a_rigid_unit_on_a_jaw(top: float, reference_finger: Fingers) -> None:
    """Its tip, without a layer, is L (cos a, −sin a): on the plate sin a = −top/L.

    The far corner is free, ∂e/∂b = 0, and the push is ∂e/∂a over −L cos a.
    """
    found = on_body(reference_finger(1), ["1"], below(4.0, 30.0, 13.0, top), thickness=0.0)
    assert found.status.tolist() == [Status.STABLE]
    a, b = found.grown.shapes.coordinates[:, 0]
    length, height, kt = 13.5, 10.75, STUDY["hinge_stiffness"]
    assert a == pytest.approx(np.arcsin(-top / length), abs=1e-13)

    def energy(a: Any, b: Any) -> Any:
        along = length * mpmath.cos(a) + height * mpmath.sin(a + b)
        across = -length * mpmath.sin(a) + height * (mpmath.cos(a + b) - 1)
        x, d = mpmath.sqrt(along**2 + across**2) - length, STUDY["stroke"]
        well = 1 + (1 - mpmath.mpf(STUDY["force_linearity"])) * (x**2 / d**2 - 2 * x / d)
        return STUDY["bistable_stiffness"] * x**2 * well / 2 + kt * (a**2 + b**2)

    with mpmath.workdps(25):
        free = mpmath.findroot(lambda b: mpmath.diff(energy, (a, b), (0, 1)), b)
        push = mpmath.diff(energy, (a, free), (1, 0)) / (-length * np.cos(a))
    assert b == pytest.approx(float(free), abs=1e-12)
    own = found.grown.shapes.push[:, 0]
    assert own.max() == pytest.approx(float(push), rel=1e-10)
    assert (own > 0.0).sum() == 1, "the tip on the upper plate"


class Drawn:
    """A random finger, its pattern and jaws or a polygon below it."""

    def __init__(self, seed: int) -> None:
        random = np.random.default_rng(900 + seed)
        n = self.n = int(random.integers(2, 5))
        values = {name: value * random.uniform(0.9, 1.1, (n, 1)) for name, value in STUDY.items()}
        values["segment_height"] = values["segment_height"][:1]
        values["force_linearity"] = random.uniform(0.02, 0.04, (n, 1))
        finger = Finger(n, **values, linear_stiffness=np.array([[BARS[seed % 3]]]))
        self.finger = finger.changed(wall_compliance=np.array([[0.6 if seed % 2 else 0.0]]))
        self.pattern = "".join(random.choice(["0", "1"], n, p=[0.4, 0.6]))
        x, top = random.uniform(10.0, 13.5 * n), -random.uniform(1.0, 3.0)
        self.body: Body = below(random.uniform(5.0, 20.0), random.uniform(8.0, 30.0), x, top)
        if seed % 2:
            turn = np.sort(random.uniform(0.0, 2.0 * np.pi, 5))
            around = random.uniform(5.0, 12.0, 5) * np.array([np.cos(turn), np.sin(turn)])
            self.body = Polygon(np.array([x, top - around[1].max()]), around)


class Found:
    """What the package found for it, with its coordinates in mm and gaps of shapely's."""

    def __init__(self, seed: int, own: Callable[..., Any]) -> None:
        self.drawn = drawn = Drawn(seed)
        self.placed = on_body(drawn.finger, [drawn.pattern], drawn.body)
        assert self.placed.status.tolist() == [Status.STABLE]
        shapes = self.placed.grown.shapes
        self.own = own(drawn.finger, shapes.inverted[:, 0], 1.5, (0.0, 0.0), 0.0)
        self.q = shapes.coordinates[:, 0]
        coordinates = self.placed.own.potentials(shapes.inverted)[0].coordinates
        self.unit = np.broadcast_to(coordinates.force_unit, (len(self.q), 1))[:, 0]
        self.corners = drawn.body.corners.T
        push = self.placed.own.relabeled(shapes).push[:, 0]
        (told,) = grasp.described(
            self.placed.own, [self.placed.codes], self.placed.grown, self.placed.status
        )
        self.contacts = [
            (
                float(push[cell]),
                told.touches.places[:, cell, 0],
                told.touches.directions[:, cell, 0],
            )
            for cell in np.flatnonzero(push > 1e-9)
        ]

    def nodes(self, q: Array) -> Array:
        """F_0 … F_n, (2, node, batch)."""
        face = self.own.nodes(q)[2]
        return np.array([[node.x for node in face], [node.y for node in face]])

    def touching(self, q: Array) -> Array:
        """Own gaps of the contacts: of a corner to its side's line, of a node to its plate's."""
        nodes, values = self.nodes(q), []
        for _, at, way in self.contacts:
            corner = np.hypot(*(self.corners - at).T).min()
            if corner < 1e-7:  # a side, or a node, on a corner
                point = self.corners[np.hypot(*(self.corners - at).T).argmin()]
                values.append(self._to_face(nodes, point))
            else:
                ends = nodes[..., 0].real
                node = np.hypot(*(ends - at[:, None])).argmin()
                away = nodes[:, node] - at[:, None]
                values.append(-(way[0] * away[0] + way[1] * away[1]))
        return np.reshape(np.array(values), (len(self.contacts), q.shape[1]))

    def _to_face(self, nodes: Array, point: Array) -> Array:
        """The distance of a point from the line of the side that it is on in the solution."""
        sides = pairwise(self.nodes(self.q[:, None])[..., 0].T)
        on = shapely.Point(point)
        side = int(np.argmin([shapely.LineString(ends).distance(on) for ends in sides]))
        along, away = nodes[:, side + 1] - nodes[:, side], point[:, None] - nodes[:, side]
        length = np.sqrt(along[0] ** 2 + along[1] ** 2)
        return np.asarray((away[0] * along[1] - away[1] * along[0]) / length)


@pytest.mark.parametrize("seed", SEEDS)
def test_they_balance_without_penetration(seed: int, own: Callable[..., Any]) -> None:
    found = Found(seed, own)
    line = shapely.LineString(found.nodes(found.q[:, None])[..., 0].T)
    body = shapely.Polygon(found.corners)
    inside = line.intersection(body.buffer(-ROUNDING, join_style="mitre"))
    assert inside.is_empty, "the face does not enter the body"
    gaps = found.touching(found.q[:, None])[:, 0]
    push = np.array([force for force, _, _ in found.contacts])
    assert np.abs(gaps).max(initial=0.0) <= 1e-9 and (push >= 0.0).all()
    assert np.abs(push * gaps).max(initial=0.0) <= 1e-9, "N mm"
    pulled = found.own.gradient(found.own.energy, found.q)
    if len(push):
        pulled = pulled - push @ found.own.gradient(found.touching, found.q)
    assert np.abs(pulled / found.unit).max() <= 1e-9, "N"


@pytest.mark.parametrize("seed", SEEDS)
def test_slsqp_finds_the_same_minima(seed: int, own: Callable[..., Any]) -> None:
    """On the energy of the tests, held by own gaps of the contacts; no face is in the body."""
    found = Found(seed, own)

    def energy(z: Array) -> float:
        return float(found.own.energy((z / found.unit)[:, None])[0])

    def slope(z: Array) -> Array:
        return np.asarray(found.own.gradient(found.own.energy, z / found.unit) / found.unit)

    gaps = {
        "type": "ineq",
        "fun": lambda z: found.touching((z / found.unit)[:, None])[:, 0],
        "jac": lambda z: found.own.gradient(found.touching, z / found.unit) / found.unit,
    }
    start = found.q * found.unit + np.random.default_rng(seed).normal(0.0, 0.01, len(found.q))
    options = {"ftol": 1e-13, "maxiter": 400}
    held = gaps if found.contacts else ()
    best = minimize(energy, start, jac=slope, constraints=held, method="SLSQP", options=options)
    assert best.x / found.unit == pytest.approx(found.q, abs=2e-6)
    assert best.fun == pytest.approx(energy(found.q * found.unit), rel=1e-9, abs=1e-12)


@pytest.mark.slow
def test_all_of_them_touch(own: Callable[..., Any]) -> None:
    touched = [len(Found(seed, own).contacts) for seed in QUICK]
    assert min(touched) > 0


@pytest.mark.parametrize("kind", ["jaws", "polygon"])
def test_mirrored_bodies_are_solved_once(kind: str, reference_finger: Fingers) -> None:
    """Seen from both fingers of a gripper a mirrored body is the same, to the last bit."""
    around = np.array([[-8.0, 9.0, -8.0], [-6.0, 0.0, 6.0]])
    body = Jaws(np.array([20.0, 0.0]), 12.0, 16.0)
    other = Polygon(np.array([20.0, 0.0]), around)
    mine: Body = body if kind == "jaws" else other
    assert mine.is_mirrored and not replace(mine, center=np.array([20.0, 1.0])).is_mirrored
    upper, lower = frames(Gripper(base_spacing=30.0, mounting_angle=0.0))
    scene = Scene(reference_finger(2), (), layer_thickness=1.5)
    codes = np.array([3, 2, 0], np.uint64)
    one, two = (placed(scene, chain_potential, mine, frame, codes) for frame in (upper, lower))
    assert one.grown.shapes.coordinates == pytest.approx(two.grown.shapes.coordinates, abs=1e-11)


def test_the_largest_circle() -> None:
    square = Polygon(np.zeros(2), np.array([[0.0, 10.0, 10.0, 0.0], [0.0, 0.0, 6.0, 6.0]]))
    assert square.inner_radius == pytest.approx(3.0, rel=1e-6)
    assert Jaws(np.zeros(2), gap=30.0, height=8.0).inner_radius == 4.0
