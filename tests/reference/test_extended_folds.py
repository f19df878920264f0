"""Folds in extended precision: closed forms, and what pushes do to the energy."""

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from dpgcli.mechanics.finger import STUDY, Finger, uniform_finger
from dpgcli.reference.equilibria import extended_states
from dpgcli.reference.folds import extended_fold


def opened(x: float) -> np.ndarray:
    """Nodes (4,) of a unit between rigid bars, both corners open alike, by its opening x, mm."""
    m = np.arcsin(x / 21.5)
    base = 13.5 * np.cos(m), -13.5 * np.sin(m)
    return np.array([*base, base[0] + 10.75 * np.sin(2.0 * m), base[1] + 10.75 * np.cos(2.0 * m)])


SHAPE, INVERTED = opened(0.8), opened(2.7)


def unit(linear_stiffness: float = np.inf, **changes: float) -> Finger:
    return uniform_finger(1, **{**STUDY, **changes}, linear_stiffness=linear_stiffness)


def force(x: float) -> float:
    """Of dome and hinge on the opening of a unit between rigid bars, N."""
    u, turn = x / 3.5, 2.0 * np.arcsin(x / 21.5)
    dome = 12.84 * x * (1.0 + 0.957 * (2.0 * u * u - 3.0 * u))
    return float(dome + 24.2 * turn / (10.75 * np.cos(turn / 2.0)))


@pytest.mark.parametrize(
    ("nodes", "guess", "bounds"),
    [(SHAPE, 4.7, (0.3, 1.3)), (INVERTED, -2.0, (2.2, 3.2))],
)
def test_a_unit_between_rigid_bars_has_the_folds_of_its_force(
    nodes: np.ndarray, guess: float, bounds: tuple[float, float]
) -> None:
    fold = extended_fold(unit(), np.array([guess]), nodes)
    assert fold is not None
    sign = np.sign(guess)
    ways = {"bounds": bounds, "method": "bounded", "options": {"xatol": 1e-10}}
    found = minimize_scalar(lambda x: -sign * force(x), **ways)
    assert float(guess * fold.share) == pytest.approx(-sign * found.fun, rel=1e-13)
    assert float(fold.pose[2]) == pytest.approx(-2.0 * np.arcsin(found.x / 21.5), rel=1e-6)


@pytest.mark.parametrize("stiffness", [12.84, 1e4, 1e13])
def test_there_is_a_state_just_below_and_none_just_above(stiffness: float) -> None:
    """Far closer to the fold than doubles can tell: in shares of 1e-14."""
    finger = unit(stiffness)
    fold = extended_fold(finger, np.array([4.7]), SHAPE)
    assert fold is not None
    exact = 4.7 * float(fold.share)
    shares = np.array([1.0 - 1e-14, 1.0 + 1e-14])
    inverted = np.zeros((1, 2), bool)
    nodes = np.repeat(SHAPE[:, None], 2, axis=1)
    truth = extended_states(finger, inverted, nodes, pushes=exact * shares[None])
    assert truth.is_minimum.tolist() == [True, True]
    assert truth.in_pattern.tolist() == [True, False]


def test_walls_let_a_unit_bear_less() -> None:
    """P = F(y) + h(x) with the dome's extension y = x + w and w = c_w h."""
    walls = 0.5
    finger = unit().changed(wall_compliance=np.array([[walls]]))
    fold = extended_fold(finger, np.array([4.7]), SHAPE, np.array([0.1]))
    assert fold is not None

    def push(x: float) -> float:
        turn = 2.0 * np.arcsin(x / 21.5)
        hinge = 24.2 * turn / (10.75 * np.cos(turn / 2.0))
        y = x + walls * hinge
        u = y / 3.5
        return float(12.84 * y * (1.0 + 0.957 * (2.0 * u * u - 3.0 * u)) + hinge)

    ways = {"bounds": (0.3, 1.3), "method": "bounded", "options": {"xatol": 1e-10}}
    found = minimize_scalar(lambda x: -push(x), **ways)
    assert float(4.7 * fold.share) == pytest.approx(-found.fun, rel=1e-13)


@pytest.mark.parametrize(
    ("finger", "nodes"),
    [(unit(force_linearity=0.9), SHAPE), (unit(), np.full(4, np.nan))],
)
def test_where_there_is_no_fold_none_is_found(finger: Finger, nodes: np.ndarray) -> None:
    assert extended_fold(finger, np.array([4.7]), nodes) is None


def test_pushes_and_walls_have_the_shape_of_the_states() -> None:
    inverted = np.zeros((1, 2), bool)
    for name in ("walls", "pushes"):
        with pytest.raises(ValueError, match=f"{name} has shape"):
            extended_states(unit(), inverted, **{name: np.zeros((1, 1))})
