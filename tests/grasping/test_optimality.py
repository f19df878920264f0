"""Fingers against discs are constrained minima: by an energy and gaps of its own, and by SciPy."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.optimize import NonlinearConstraint, minimize

from dpgcli.arrays import Array
from dpgcli.mechanics.finger import STUDY, Finger

BARS = (1e3, 1e4, np.inf)
QUICK = (2, 3, 7, 15, 20, 22, 24, 26)
PRESSED = (*QUICK, 1, 4, 5, 6, 8, 18, 21, 27, 29, 31, 33, 38, 39, 41, 48, 49, 50, 53, 54, 57, 59)
SEEDS = [pytest.param(s, marks=[] if s in QUICK else pytest.mark.slow) for s in PRESSED]
LOST = pytest.param(43)


class Drawn:
    """A random finger, its pattern and a disc below it that its free shape is not behind."""

    def __init__(self, seed: int) -> None:
        random = np.random.default_rng(500 + seed)
        n = self.n = int(random.integers(2, 5))
        values = {name: value * random.uniform(0.85, 1.15, (n, 1)) for name, value in STUDY.items()}
        values["segment_height"] = values["segment_height"][:1]
        values["force_linearity"] = random.uniform(0.02, 0.04, (n, 1))
        finger = Finger(n, **values, linear_stiffness=np.array([[BARS[seed % 3]]]))
        walls = np.array([[0.6 if seed % 2 else 0.0]])
        self.finger = finger.changed(wall_compliance=walls)
        self.pattern = "".join(random.choice(["0", "1"], n, p=[0.4, 0.6]))
        self.center = (random.uniform(6.0, 13.5 * n - 3.0), -random.uniform(8.0, 22.0))
        self.radius = random.uniform(0.5, 0.95) * -self.center[1]


class Found:
    """What the package found for it, and the finger of these tests."""

    def __init__(self, seed: int, grown: Callable[..., Any], own: Callable[..., Any]) -> None:
        self.drawn = drawn = Drawn(seed)
        self.grown = grown(drawn.finger, [drawn.pattern], drawn.center, drawn.radius)
        shapes = self.grown.shapes
        assert shapes.is_there.all()
        self.own = own(drawn.finger, shapes.inverted[:, 0], 1.5, drawn.center, drawn.radius)
        self.push = self.grown.obstructed.relabeled(shapes).push[:, 0]
        self.q = shapes.coordinates[:, 0]
        coordinates = self.grown.obstructed.potentials(shapes.inverted)[0].coordinates
        self.unit = np.broadcast_to(coordinates.force_unit, (len(self.q), 1))[:, 0]


@pytest.mark.parametrize("seed", [*SEEDS, LOST])
def test_they_balance_without_penetration(
    seed: int, grown: Callable[..., Any], own: Callable[..., Any]
) -> None:
    found = Found(seed, grown, own)
    gaps = found.own.gaps(found.q[:, None])[:, 0]
    assert gaps.min() >= -1e-9, "mm"
    assert (found.push >= 0.0).all() and found.push.max() > 0.0
    assert np.abs(found.push * gaps).max() <= 1e-9, "N mm"
    pulled = found.own.gradient(found.own.energy, found.q)
    rest = pulled - found.push @ found.own.gradient(found.own.gaps, found.q)
    assert np.abs(rest / found.unit).max() <= 1e-9, "N"


@pytest.mark.parametrize("seed", SEEDS)
def test_they_are_minima_on_the_tangent_space(
    seed: int, grown: Callable[..., Any], own: Callable[..., Any]
) -> None:
    found = Found(seed, grown, own)

    def lagrangian(q: Array) -> Array:
        return np.asarray(found.own.energy(q) - found.push @ found.own.gaps(q))

    normals = found.own.gradient(found.own.gaps, found.q)[found.push > 0.0].T / found.unit[:, None]
    tangent = np.linalg.svd(normals)[0][:, normals.shape[1] :]
    hessian = found.own.hessian(lagrangian, found.q) / found.unit / found.unit[:, None]
    assert np.linalg.eigvalsh(tangent.T @ hessian @ tangent).min() > 1e-3, "N/mm"


def scaled(found: Found) -> tuple[Callable[[Array], float], Callable[[Array], Array], list[int]]:
    """Energy and gradient by coordinates in mm, and the sides whose gaps are not another's."""
    gaps = found.own.gaps(found.q[:, None])[:, 0]
    apart = [k for k, gap in enumerate(gaps) if not (np.abs(gaps[:k] - gap) < 1e-9).any()]

    def energy(z: Array) -> float:
        return float(found.own.energy((z / found.unit)[:, None])[0])

    def slope(z: Array) -> Array:
        return np.asarray(found.own.gradient(found.own.energy, z / found.unit) / found.unit)

    return energy, slope, apart


@pytest.mark.parametrize("seed", SEEDS)
def test_slsqp_finds_the_same_minima(
    seed: int, grown: Callable[..., Any], own: Callable[..., Any]
) -> None:
    found = Found(seed, grown, own)
    energy, slope, apart = scaled(found)
    start = found.q * found.unit + np.random.default_rng(seed).normal(0.0, 0.02, len(found.q))
    gaps = {
        "type": "ineq",
        "fun": lambda z: found.own.gaps((z / found.unit)[:, None])[apart, 0],
        "jac": lambda z: found.own.gradient(found.own.gaps, z / found.unit)[apart] / found.unit,
    }
    options = {"ftol": 1e-13, "maxiter": 400}
    best = minimize(energy, start, jac=slope, constraints=gaps, method="SLSQP", options=options)
    assert best.x / found.unit == pytest.approx(found.q, abs=2e-6)
    assert best.fun == pytest.approx(energy(found.q * found.unit), rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("seed", (2, 3, 15, 24, 26))
def test_trust_constr_finds_the_same_minima(
    seed: int, grown: Callable[..., Any], own: Callable[..., Any]
) -> None:
    found = Found(seed, grown, own)
    energy, slope, apart = scaled(found)

    def curvature(function: Callable[[Array], Array], z: Array) -> Array:
        bend = found.own.hessian(function, z / found.unit)
        return np.asarray(bend / found.unit / found.unit[:, None])

    gaps = NonlinearConstraint(
        lambda z: found.own.gaps((z / found.unit)[:, None])[apart, 0],
        0.0,
        np.inf,
        jac=lambda z: found.own.gradient(found.own.gaps, z / found.unit)[apart] / found.unit,
        hess=lambda z, v: curvature(lambda q: v @ found.own.gaps(q)[apart], z),
    )
    start = found.q * found.unit + np.random.default_rng(seed).normal(0.0, 0.02, len(found.q))

    options = {"gtol": 1e-9, "xtol": 1e-12, "maxiter": 600}
    best = minimize(
        energy,
        start,
        jac=slope,
        hess=lambda z: curvature(found.own.energy, z),
        constraints=gaps,
        method="trust-constr",
        options=options,
    )
    assert best.x / found.unit == pytest.approx(found.q, abs=1e-5)
    assert best.fun == pytest.approx(energy(found.q * found.unit), rel=1e-6)
