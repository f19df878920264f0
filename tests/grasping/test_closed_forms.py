"""One rigid unit and a disc in closed form; folds against roots of their own."""

from collections.abc import Callable
from typing import Any

import mpmath
import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar, root

from dpgcli.arrays import Array
from dpgcli.mechanics.finger import STUDY, Finger

CENTER, LONG, TURN = (9.0, -8.0), np.hypot(9.0, 8.0), np.arctan2(8.0, 9.0)


def energy(a: Any, b: Any) -> Any:
    """Of one unit between rigid bars, by its corners: the study's spring from T_0 to T_1."""
    length, height, kt = STUDY["segment_length"], STUDY["segment_height"], STUDY["hinge_stiffness"]
    turned = a + b
    along = length * mpmath.cos(a) + height * mpmath.sin(turned)
    across = -length * mpmath.sin(a) + height * (mpmath.cos(turned) - 1)
    x, d = mpmath.sqrt(along**2 + across**2) - length, STUDY["stroke"]
    well = 1 + (1 - mpmath.mpf(STUDY["force_linearity"])) * (x**2 / d**2 - 2 * x / d)
    return STUDY["bistable_stiffness"] * x**2 * well / 2 + kt * (a**2 + b**2)


def derivative(a: Any, b: Any, *order: int) -> Any:
    return mpmath.diff(energy, (a, b), order)


@pytest.mark.parametrize("radius", [7.2, 8.0, 9.5])
@pytest.mark.parametrize("pattern", ["1", "0"])
def test_a_disc_under_a_unit_pushes_with_its_moment_over_the_lever(
    radius: float,
    pattern: str,
    reference_finger: Callable[..., Finger],
    grown: Callable[..., Any],
) -> None:
    """A face without thickness is the chord: tangent to the disc, so that a = γ − asin(r/ρ)."""
    found = grown(reference_finger(1), [pattern], CENTER, radius, thickness=0.0)
    a, b = found.shapes.coordinates[:, 0]
    tangent = TURN - np.arcsin(radius / LONG)
    if tangent > 0.0 and pattern == "0":
        assert not found.shapes.push.any()
        return
    assert a == pytest.approx(tangent, abs=1e-13)
    with mpmath.workdps(25):
        free = mpmath.findroot(lambda b: derivative(a, b, 0, 1), b)
        push = derivative(a, free, 1, 0) / (-LONG * np.cos(TURN - tangent))
        assert derivative(a, free, 0, 2) > 0
    assert b == pytest.approx(float(free), abs=1e-12)
    assert found.shapes.push[0, 0] == pytest.approx(float(push), rel=1e-10)


@pytest.mark.slow
def test_a_unit_resets_where_its_far_corner_loses_its_balance(
    reference_finger: Callable[..., Finger], grown: Callable[..., Any]
) -> None:
    """The disc turns the chord back until ∂²e/∂b² = 0 beside ∂e/∂b = 0."""
    found = grown(reference_finger(1), ["1"], CENTER, 11.5, thickness=0.0)
    (reset,) = found.came.resets
    assert reset.flipped.tolist() == [[True]]
    with mpmath.workdps(25):
        a, _ = mpmath.findroot(
            lambda a, b: (derivative(a, b, 0, 1), derivative(a, b, 0, 2)), (-0.25, 0.52)
        )
    expected = LONG * np.sin(TURN - float(a)) / 11.5
    assert reset.load[0] == pytest.approx(expected, rel=1e-10)


def test_the_first_touch(
    reference_finger: Callable[..., Finger], grown: Callable[..., Any]
) -> None:
    """At the well's own angle, x = 3.2450151985 of 2H sin m, the disc has r = ρ sin(γ − m)."""
    m = np.arcsin(3.2450151985 / 21.5)
    touch = LONG * np.sin(TURN - m)
    before, after = (
        grown(reference_finger(1), ["1"], CENTER, touch + by, thickness=0.0).shapes.push[0, 0]
        for by in (-1e-6, 1e-6)
    )
    assert before == 0.0
    assert 0.0 < after < 1e-3


def two_units(
    pattern: str, reference_finger: Callable[..., Finger], grown: Callable[..., Any]
) -> Any:
    return grown(reference_finger(2), [pattern], (20.0, -16.0), 15.0)


@pytest.mark.slow
def test_a_fold_under_a_push_is_the_largest_load_of_its_path(
    reference_finger: Callable[..., Finger], grown: Callable[..., Any], own: Callable[..., Any]
) -> None:
    """Along the first unit's turn s: E, g and λ from definitions, the top of λ(s) by Brent."""
    found = two_units("11", reference_finger, grown)
    (reset,) = found.came.resets
    assert reset.flipped[:, 0].tolist() == [True, False]
    finger = own(reference_finger(2), np.ones(2, bool), 1.5, (20.0, -16.0), 15.0)
    free = finger.gaps(found.start.coordinates)[:, 0]
    side = int(np.argmin(free))
    known = np.append(found.start.coordinates[:, 0], [0.0, 1.0 + free[side] / 15.0])

    def rest(at: Array, turn: float) -> Array:
        q, push, load = at[:4], at[4], at[5]
        pulled = finger.gradient(finger.energy, q)
        pushed = push * finger.gradient(finger.gaps, q)[side]
        gap = finger.gaps(q[:, None])[side, 0] - (load - 1.0) * 15.0
        return np.array([*(pulled - pushed), gap, q[0] + q[1] - turn])

    def load(turn: float) -> float:
        nonlocal known
        solved = root(rest, known, args=(turn,), tol=1e-13)
        assert np.abs(solved.fun).max() < 1e-9
        known = solved.x
        return float(solved.x[5])

    start = float(known[0] + known[1])
    turns = start - 0.005 * np.arange(1, 17)
    loads = [load(turn) for turn in turns]
    top = int(np.argmax(loads))
    assert 0 < top < 15, "it rises and falls"
    for turn in turns[top::-1]:
        load(turn)
    bracket = (turns[top - 1], turns[top], turns[top + 1])
    best = minimize_scalar(lambda turn: -load(turn), bracket=bracket)
    assert reset.load[0] == pytest.approx(-best.fun, rel=1e-10)


def test_the_known_reset_force_of_one_unit() -> None:
    """The own energy gives the reference's numbers: −2.054675 N on x, of the model's page."""

    def on_opening(m: float) -> float:
        slope = float(mpmath.diff(lambda t: energy(t, t), m))
        return slope / (21.5 * np.cos(m))

    found = minimize_scalar(on_opening, bounds=(0.09, 0.15), method="bounded")
    assert found.fun == pytest.approx(-2.054675, abs=5e-6)
    assert brentq(on_opening, 0.05, 0.12) == pytest.approx(np.arcsin(2.0041742418 / 21.5))
