"""The banded factorization against dense linear algebra."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dpgcli.arrays import Array
from dpgcli.equilibrium.banded import backward, factorize, forward

PROFILES = [(3, 2, 1, 4, 3, 2, 1, 4, 3, 2, 1, 0), (1, 0, 1, 0, 1, 0), (2, 2, 2, 1, 0), (0,)]


def random_matrix(reach: tuple[int, ...], seed: int, *, is_definite: bool) -> tuple[Array, Array]:
    """A matrix L D Lᵀ of that profile: dense, and as a band with one lane."""
    random = np.random.default_rng(seed)
    size = len(reach)
    lower = np.eye(size)
    for column, depth in enumerate(reach):
        lower[column + 1 : column + 1 + depth, column] = random.uniform(-1.0, 1.0, depth)
    pivots = random.uniform(0.5, 2.0, size)
    if not is_definite:
        pivots *= random.choice([-1.0, 1.0], size)
    full = lower * pivots @ lower.T
    band = np.zeros((max(reach) + 1, size, 1))
    for depth in range(max(reach) + 1):
        band[depth, : size - depth, 0] = np.diagonal(full, -depth)
    return full, band


@pytest.mark.parametrize("reach", PROFILES)
@pytest.mark.parametrize("is_definite", [True, False])
def test_solves_as_dense_linear_algebra_does(reach: tuple[int, ...], is_definite: bool) -> None:
    full, band = random_matrix(reach, 3, is_definite=is_definite)
    right = np.random.default_rng(4).normal(size=(len(reach), 1))
    factorization = factorize(band, reach)
    solution = forward(factorization, right.copy())
    solution /= factorization.pivots
    backward(factorization, solution)
    np.testing.assert_allclose(solution, np.linalg.solve(full, right), rtol=1e-11, atol=1e-12)


@given(seed=st.integers(0, 10_000), profile=st.sampled_from(PROFILES))
def test_signs_of_the_pivots_are_the_inertia(seed: int, profile: tuple[int, ...]) -> None:
    full, band = random_matrix(profile, seed, is_definite=False)
    eigenvalues = np.linalg.eigvalsh(full)
    assert (factorize(band, profile).pivots < 0.0).sum() == (eigenvalues < 0.0).sum()


def test_forward_takes_many_right_hand_sides_at_once() -> None:
    _, band = random_matrix(PROFILES[0], 5, is_definite=True)
    right = np.random.default_rng(6).normal(size=(12, 3, 1))
    factorization = factorize(band, PROFILES[0])
    together = forward(factorization, right.copy())
    for k in range(3):
        alone = forward(factorization, right[:, k].copy())
        np.testing.assert_array_equal(together[:, k], alone)


def test_a_nan_lane_spoils_itself_only() -> None:
    _, band = random_matrix(PROFILES[0], 7, is_definite=True)
    spoiled = np.concatenate((band, np.full_like(band, np.nan), band), axis=-1)
    alone = factorize(band.copy(), PROFILES[0]).pivots[:, 0]
    pivots = factorize(spoiled, PROFILES[0]).pivots
    np.testing.assert_array_equal(pivots[:, [0, 2]], np.stack((alone, alone), axis=1))
    assert np.isnan(pivots[:, 1]).all()


def test_a_singular_lane_spoils_itself_only_and_warns_nobody() -> None:
    """Warnings are errors here: zero over zero, and infinities that cancel."""
    _, band = random_matrix(PROFILES[0], 7, is_definite=True)
    singular = np.zeros_like(band)
    singular[1:, 0] = 1.0
    alone = factorize(band.copy(), PROFILES[0])
    together = factorize(np.concatenate((band, singular), axis=-1), PROFILES[0])
    np.testing.assert_array_equal(together.pivots[:, 0], alone.pivots[:, 0])
    right = np.stack((np.arange(12.0), np.zeros(12)), axis=1)  # an infinity times 0 is none
    for sweep in (forward, backward):
        solution, expected = sweep(together, right.copy()), sweep(alone, right[:, :1].copy())
        np.testing.assert_array_equal(solution[:, 0], expected[:, 0])
        assert np.isnan(solution[:, 1]).any()
