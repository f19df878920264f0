"""What the tests of grasping share: bodies that grow, and a finger and its gaps of their own.

`Own` is written from the definitions on the page "laws" of the manual, in plain coordinates of
nodes that take complex numbers, so that its gradients are exact (complex steps). It shares with
the package the order of the coordinates and nothing else.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import pytest
from scipy.optimize import minimize

from dpgcli.arrays import Array, Flags
from dpgcli.grasping.approach import Approach, approach
from dpgcli.grasping.contact import Obstructed
from dpgcli.grasping.descent import finished
from dpgcli.grasping.shapes import ContactShapes
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.laws import PushOnly
from dpgcli.mechanics.obstacle import Obstacle
from dpgcli.mechanics.terms import chain_potential
from dpgcli.states.settle import settle
from dpgcli.states.units import UnitSolutions

TINY = 1e-30  # of complex steps


class Plane(NamedTuple):
    """Points or directions, x and y (…, batch); complex where they are differentiated."""

    x: Array
    y: Array


@dataclass(frozen=True)
class Own:
    """One finger of a pattern, and a disc: energy and gaps by coordinates (size, batch)."""

    finger: Finger
    inverted: Flags
    thickness: float
    center: tuple[float, float]
    radius: float

    def value(self, name: str) -> Array:
        """One value for each unit."""
        values = getattr(self.finger, name)[:, 0]
        return np.broadcast_to(values, self.finger.n_units)

    def by_unit(self, q: Array) -> tuple[Array, Array, Array, Array, Array]:
        """v, e, a, b and s of each unit, (unit, batch); zero where there are none."""
        rows = list(np.moveaxis(q.reshape(self.finger.n_units, -1, q.shape[1]), 1, 0))
        zero = 0.0 * rows[0]
        v = rows.pop(0) if self.finger.has_walls else zero
        e, a, b, s = (zero, *rows, zero) if self.finger.is_rigid else rows
        return v, e, a, b, s

    def nodes(self, q: Array) -> tuple[list[Plane], list[Plane], list[Plane]]:
        """B_0 … B_n, T_0 … T_n and F_0 … F_n."""
        _, e, a, b, s = self.by_unit(q)
        height, half = float(self.finger.segment_height[0, 0]), self.thickness / 2.0
        zero = 0.0 * q[0]
        base, top = [Plane(zero, zero)], [Plane(zero, zero + height)]
        face, tau = [Plane(zero, zero - half)], zero
        for i, length in enumerate(self.value("segment_length")):
            chord, tau = tau - a[i], tau - a[i] - b[i]
            x = base[-1].x + (length + e[i]) * np.cos(chord)
            y = base[-1].y + (length + e[i]) * np.sin(chord)
            strut = height + s[i]
            base.append(Plane(x, y))
            top.append(Plane(x - strut * np.sin(tau), y + strut * np.cos(tau)))
            face.append(Plane(x + half * np.sin(tau), y - half * np.cos(tau)))
        return base, top, face

    def extensions(self, q: Array) -> list[Array]:
        """Of the domes' springs, walls counted in, by unit."""
        v, top = self.by_unit(q)[0], self.nodes(q)[1]
        soft = np.sqrt(self.value("wall_compliance") * self.value("bistable_stiffness"))
        spans = [np.sqrt((b.x - a.x) ** 2 + (b.y - a.y) ** 2) for a, b in pairwise(top)]
        lengths = self.value("segment_length")
        return [x - lengths[i] + soft[i] * v[i] for i, x in enumerate(spans)]

    def energy(self, q: Array) -> Array:
        """Domes, walls, corners and bars, N mm, (batch,)."""
        v, e, a, b, s = self.by_unit(q)
        xs, result = self.extensions(q), 0.0 * q[0]
        k_b, alpha, d = map(self.value, ("bistable_stiffness", "force_linearity", "stroke"))
        k_t = self.value("hinge_stiffness")
        k_l = float(self.finger.linear_stiffness[0, 0])
        for i, x in enumerate(xs):
            result = result + self._dome(i, x, k_b[i], alpha[i], d[i]) + 0.5 * k_b[i] * v[i] ** 2
            result = result + k_t[i] * (a[i] ** 2 + b[i] ** 2)
            if np.isfinite(k_l):
                result = result + 0.5 * k_l * (e[i] ** 2 + s[i] ** 2)
        return result

    def _dome(self, unit: int, x: Array, k_b: float, alpha: float, d: float) -> Array:
        def attached(x: Array) -> Array:
            return 0.5 * k_b * x**2 * (1.0 + (1.0 - alpha) * (x**2 / d**2 - 2.0 * x / d))

        if not isinstance(self.finger.law, PushOnly):
            return attached(x)
        if not self.inverted[unit]:
            return 0.0 * x
        beta = 1.0 - alpha
        root = np.sqrt(9.0 * beta**2 - 8.0 * beta)
        lowest, highest = ((3.0 * beta + sign * root) / (4.0 * beta) * d for sign in (-1.0, 1.0))
        inside = np.where(x.real < lowest, lowest, np.where(x.real > highest, highest, x))
        return attached(inside)

    def gaps(self, q: Array) -> Array:
        """Distance of the center from each side of the face, less the radius, (side, batch)."""
        face, rows = self.nodes(q)[2], []
        for start, end in pairwise(face):
            along = Plane(end.x - start.x, end.y - start.y)
            away = Plane(self.center[0] - start.x, self.center[1] - start.y)
            share = (away.x * along.x + away.y * along.y) / (along.x**2 + along.y**2)
            share = np.where(share.real < 0.0, 0.0, np.where(share.real > 1.0, 1.0, share))
            x, y = away.x - share * along.x, away.y - share * along.y
            rows.append(np.sqrt(x**2 + y**2) - self.radius)
        return np.stack(rows)

    def gradient(self, function: Callable[[Array], Array], q: Array) -> Array:
        """∂f/∂q by complex steps, (…, size), at one q (size,)."""
        steps = q[:, None] + 1j * TINY * np.eye(len(q))
        return np.asarray(function(steps).imag / TINY)

    def hessian(self, function: Callable[[Array], Array], q: Array) -> Array:
        """∂²f/∂q² by fourth-order differences of the exact gradient, (size, size)."""
        rows = []
        for step in 1e-4 * np.eye(len(q)):
            near = self.gradient(function, q + step) - self.gradient(function, q - step)
            far = self.gradient(function, q + 2 * step) - self.gradient(function, q - 2 * step)
            rows.append((8.0 * near - far) / (12.0 * 1e-4))
        result = np.array(rows)
        return np.asarray(0.5 * (result + result.T))


class Grown(NamedTuple):
    """A finger about which a body has grown, lane by lane, and how it came there."""

    obstructed: Obstructed
    start: ContactShapes
    came: Approach

    @property
    def shapes(self) -> ContactShapes:
        return self.came.shapes


@pytest.fixture(scope="session")
def own() -> type[Own]:
    """The finger and the gaps of these tests."""
    return Own


@pytest.fixture(scope="session")
def begun() -> Callable[..., tuple[Obstructed, ContactShapes]]:
    """Fingers in their free states with a disc of nothing about a center, for each lane."""

    def begin(
        finger: Finger,
        patterns: list[str],
        center: tuple[float, float],
        radius: float,
        thickness: float = 1.5,
    ) -> tuple[Obstructed, ContactShapes]:
        inverted = np.array([[digit == "1" for digit in text] for text in patterns]).T
        units = UnitSolutions.of(finger)
        free = settle(units, chain_potential, inverted, 1e-12)
        assert (free.status == 0).all(), "free states that these tests start from are stable"
        x, n = free.equilibrium.coordinates, len(patterns)
        body = Obstacle(np.array(center)[:, None, None], np.array([[radius]]))
        bare = Obstructed(units, chain_potential, np.array([[thickness]]), (body,), np.zeros(1))
        depth = np.maximum(radius, -bare.gaps()(x).value.min(axis=0))
        obstructed = replace(bare, depth=depth)
        nothing = np.zeros((finger.n_units, n))
        return obstructed, finished(obstructed, x, inverted, nothing, np.zeros(n))

    return begin


@pytest.fixture(scope="session")
def grown(begun: Callable[..., tuple[Obstructed, ContactShapes]]) -> Callable[..., Grown]:
    """The same when the disc has grown, `grown(finger, patterns, center, radius, end=1.0)`."""

    def grow(*args: object, end: float = 1.0, **options: object) -> Grown:
        obstructed, start = begun(*args, **options)
        nothing = np.zeros(start.coordinates.shape[1])
        return Grown(obstructed, start, approach(obstructed, start, nothing, nothing + end))

    return grow


@pytest.fixture(scope="session")
def told() -> Callable[[Approach], list[tuple[int, str, float]]]:
    """What happened to the only lane: each unit, the way it went, and its pressure."""

    def of_lane(came: Approach) -> list[tuple[int, str, float]]:
        parts = []
        for reset in came.resets:
            assert reset.pressure is not None
            for unit in np.flatnonzero(reset.flipped[:, 0]):
                kind = "snap" if reset.snapped[unit, 0] else "reset"
                parts.append((int(unit), kind, float(reset.pressure[unit, 0])))
        return parts

    return of_lane


@pytest.fixture(scope="session")
def slsqp() -> Callable[..., Any]:
    """SciPy's minimum of an energy (coordinate, lane) with gaps (cell, lane) >= 0, from near by.

    `gradient(function, q)` is that of one at coordinates, which are scaled by `unit`.
    """

    def found(energy: Any, gaps: Any, gradient: Any, q: Array, unit: Array) -> Any:
        constraints = {
            "type": "ineq",
            "fun": lambda z: gaps((z / unit)[:, None])[:, 0],
            "jac": lambda z: gradient(gaps, z / unit) / unit,
        }
        return minimize(
            lambda z: float(energy((z / unit)[:, None])[0]),
            q * unit + np.random.default_rng(1).normal(0.0, 0.02, len(unit)),
            jac=lambda z: gradient(energy, z / unit) / unit,
            constraints=constraints,
            method="SLSQP",
            options={"ftol": 1e-14, "maxiter": 500},
        )

    return found
