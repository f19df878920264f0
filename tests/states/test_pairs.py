"""Pairs of half-fingers against the whole finger, solved directly."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from dpgcli.arrays import Array, Flags
from dpgcli.design.scene import Scene
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.terms import chain_potential
from dpgcli.states.certify import Status, certify
from dpgcli.states.pairs.compose import paired_states
from dpgcli.states.pairs.halves import Split
from dpgcli.states.plan import Method, Request, explain
from dpgcli.states.predict import Prediction, Summary, predict
from dpgcli.states.settle import settle
from dpgcli.states.solved import SolvedStates
from dpgcli.states.tip import tip
from dpgcli.states.units import UnitSolutions

Fingers = Callable[..., Finger]
Patterns = Callable[[int], Flags]


def all_pairs(split: Split) -> SolvedStates:
    blocks = list(paired_states(split))
    assert len(blocks) == 1
    return blocks[0]


def assert_like_direct(split: Split, inverted: Flags, tolerance: float) -> float:
    """All pairs that fit against direct solves; the share that fits."""
    pairs = all_pairs(split)
    batch = settle(split.units, chain_potential, inverted, 1e-13)
    status = certify(batch, split.units, 1e-12)
    direct = tip(batch, with_compliance=False)
    fits = pairs.status != Status.NOT_CONVERGED
    assert (pairs.inverted == inverted).all()
    assert (pairs.status[fits] == status[fits]).all()
    assert (pairs.reached[:, fits] == batch.reached[:, fits]).all()
    stable = fits & (status == Status.STABLE)
    distance = np.hypot(*(pairs.pose - direct.pose)[:2])
    assert (distance <= pairs.tip_error + direct.error)[stable].all()
    energy = sum(batch.equilibrium.energies.values())
    difference = np.abs(sum(pairs.energies.values()) - energy)
    assert (difference <= tolerance * (1.0 + energy))[stable].all()
    return float(fits.mean())


@pytest.mark.parametrize("context", [1, 2, 3])
@pytest.mark.parametrize("linear_stiffness", [1e2, 1e4, 1e6, 1e8])
@pytest.mark.parametrize("is_graded", [False, True])
def test_pairs_are_the_states_of_the_whole(
    reference_finger: Fingers,
    graded_finger: Fingers,
    all_patterns: Patterns,
    context: int,
    linear_stiffness: float,
    is_graded: bool,
) -> None:
    make = (lambda n, k: graded_finger(n, 51, k)) if is_graded else reference_finger
    split = Split(UnitSolutions.of(make(8, linear_stiffness)), 4, context, 1e-12)
    assert_like_direct(split, all_patterns(8), 1e-11)


@pytest.mark.parametrize("n_inner", [1, 3, 5])
def test_rigid_halves_fit_without_context(
    graded_finger: Fingers, all_patterns: Patterns, n_inner: int
) -> None:
    split = Split(UnitSolutions.of(graded_finger(6, 52, np.inf)), n_inner, 0, 1e-12)
    assert assert_like_direct(split, all_patterns(6), 1e-13) == 1.0


@pytest.mark.slow
@pytest.mark.parametrize("n_units", [9, 10, 11, 12])
@pytest.mark.parametrize("linear_stiffness", [1e2, 1e3, 1e5, 1e7])
def test_pairs_of_longer_fingers_are_the_states_of_the_whole(
    graded_finger: Fingers, all_patterns: Patterns, n_units: int, linear_stiffness: float
) -> None:
    units = UnitSolutions.of(graded_finger(n_units, n_units, linear_stiffness))
    for context in (1, 2, 3):
        split = Split(units, n_units // 2, context, 1e-12)
        assert_like_direct(split, all_patterns(n_units), 1e-11)


@pytest.mark.parametrize("tolerance", [1e-12, 1e-9])
def test_what_fits_within_a_looser_tolerance_still_has_an_honest_error(
    reference_finger: Fingers, all_patterns: Patterns, tolerance: float
) -> None:
    split = Split(UnitSolutions.of(reference_finger(8, 1e3)), 4, 1, tolerance)
    assert_like_direct(split, all_patterns(8), 1e-6)


def test_tip_error_of_pairs_covers_loosely_solved_halves(
    reference_finger: Fingers, all_patterns: Patterns
) -> None:
    split = Split(UnitSolutions.of(reference_finger(9, 7e3)), 5, 1, 1e-4)
    assert_like_direct(split, all_patterns(9), 1e-6)


def test_a_unit_without_a_well_is_found_in_pairs_too(
    graded_finger: Fingers, all_patterns: Patterns
) -> None:
    linearity = np.full(8, 0.043)
    linearity[[1, 4]] = 0.12  # one in each half, the second next to the cut
    finger = graded_finger(8, 53, 1e5, force_linearity=linearity)
    split = Split(UnitSolutions.of(finger), 4, 2, 1e-12)
    assert assert_like_direct(split, all_patterns(8), 1e-11) == 1.0
    status = all_pairs(split).status
    impossible = all_patterns(8)[[1, 4]].any(axis=0)
    assert ((status == Status.NOT_BISTABLE) == impossible).all()


def half_coordinates(split: Split, inverted: Flags, tolerance: float) -> tuple[Array, Array]:
    """Coordinates of both solved halves for one pattern, context included."""
    cut, context, finger = split.n_inner, split.context, split.units.finger
    parts = []
    for first, stop in ((0, cut + context), (cut - context, split.n_units)):
        units = UnitSolutions.of(finger.section(first, stop))
        solved = settle(units, chain_potential, inverted[first:stop], tolerance)
        parts.append(solved.equilibrium.coordinates)
    return parts[0], parts[1]


@pytest.mark.parametrize("linear_stiffness", [3e2, 1e3, 1e4])
@pytest.mark.parametrize("context", [1, 2])
def test_the_residual_of_pairs_is_that_of_the_composite(
    graded_finger: Fingers, linear_stiffness: float, context: int
) -> None:
    """The full gradient at the inner half's coordinates followed by the outer half's own.

    The halves are solved to the last digits, so that their disagreement is all that is left;
    second order in it may exceed the bound a little.
    """
    finger = graded_finger(8, 54, linear_stiffness)
    split = Split(UnitSolutions.of(finger), 4, context, 1e-13)
    pairs, chain = all_pairs(split), chain_potential(finger)
    for code in np.random.default_rng(55).integers(0, 2**8, 12):
        inner, outer = half_coordinates(split, pairs.inverted[:, [code]], 1e-13)
        composite = np.concatenate((inner[:16], outer[4 * context :]))
        scales = chain.coordinates
        true = np.abs(chain.evaluate(composite).gradient / scales.force_unit).max()
        rounding = 1e-14 * float((scales.gradient_scale / scales.force_unit).max())
        assert true <= 1.01 * pairs.residual[code] + rounding
        assert pairs.residual[code] <= 2.0 * true + 3.0 * rounding


@pytest.mark.parametrize("linear_stiffness", [1e2, 3e2, 1e3])
def test_the_tip_error_of_pairs_is_what_their_disagreement_does(
    graded_finger: Fingers, all_patterns: Patterns, linear_stiffness: float
) -> None:
    """Pairs that fit too poorly to be rows: there the error is far above rounding."""
    split = Split(UnitSolutions.of(graded_finger(8, 58, linear_stiffness)), 4, 1, 1e-13)
    pairs = all_pairs(split)
    direct = tip(
        settle(split.units, chain_potential, all_patterns(8), 1e-13), with_compliance=False
    )
    distance = np.hypot(*(pairs.pose - direct.pose)[:2])
    apart = distance > 1e-9
    assert apart.sum() > 50
    assert (distance <= 1.05 * pairs.tip_error)[apart].all()
    assert np.median(pairs.tip_error[apart] / distance[apart]) < 5.0


@pytest.mark.parametrize("linear_stiffness", [1e2, 1e4])
def test_curvature_of_pairs_agrees_with_eigenvalues(
    graded_finger: Fingers, dense: Callable[[Array], Array], linear_stiffness: float
) -> None:
    finger = graded_finger(8, 54, linear_stiffness)
    split = Split(UnitSolutions.of(finger), 4, 1, 1e-2)
    pairs, chain = all_pairs(split), chain_potential(finger)
    for code in np.random.default_rng(59).integers(0, 2**8, 12):
        inner, outer = half_coordinates(split, pairs.inverted[:, [code]], 1e-2)
        at = chain.evaluate(np.concatenate((inner[:16], outer[4:])))
        eigenvalues = np.linalg.eigvalsh(dense(at.hessian))
        assert (pairs.status[code] == Status.STABLE) == (eigenvalues.min() > 0.0)


def forced(finger: Finger, context: int, columns: tuple[str, ...]) -> Prediction:
    """A prediction whose halves know less of each other than the plan would give them."""
    plan = explain(Scene(finger, ()), Request(columns=columns))
    assert plan.split is not None
    return Prediction(replace(plan, split=replace(plan.split, context=context)), Summary())


def test_pairs_that_do_not_fit_are_solved_as_a_whole(reference_finger: Fingers) -> None:
    finger = reference_finger(13, 1e3)
    prediction = forced(finger, 1, ("states",))
    rows = prediction.arrays()
    patterns = tuple(rows["pattern"][::511])
    direct = predict(Scene(finger, ()), Request(patterns, ("states",))).arrays()
    assert (rows["status"] == "stable").all()
    assert prediction.plan.split is not None
    assert prediction.summary.n_finger_solves > prediction.plan.split.n_solves
    np.testing.assert_allclose(rows["tip_x_mm"][::511], direct["tip_x_mm"], rtol=0, atol=1e-10)


@pytest.mark.parametrize(
    "hingeless",
    [
        pytest.param(slice(4, 6), id="around"),
        pytest.param(slice(0, 6), id="inner"),
        pytest.param(slice(6, 13), id="outer"),
    ],
)
def test_halves_without_hinges_keep_the_energies_of_the_whole(
    reference_finger: Fingers, hingeless: slice
) -> None:
    hinges = np.full((13, 1), 24.2)
    hinges[hingeless] = 0.0
    arrays = reference_finger(13).arrays() | {"hinge_stiffness": hinges}
    columns = ("states", "energies")
    prediction = predict(Scene(Finger(13, **arrays), ()), Request(columns=columns))
    assert prediction.plan.method is Method.PAIRS
    rows = prediction.arrays()
    parts = rows["bistable_energy_mJ"] + rows["hinge_energy_mJ"]
    np.testing.assert_allclose(rows["energy_mJ"], parts, rtol=1e-12)


@pytest.mark.parametrize("linear_stiffness", [1e4, np.inf])
def test_halves_of_a_mechanism_warn_nobody(
    reference_finger: Fingers, linear_stiffness: float
) -> None:
    """Warnings are errors here; whether the halves agree is found out by solving both."""
    finger = reference_finger(13, linear_stiffness, hinge_stiffness=0.0)
    rows = predict(Scene(finger, ()), Request(columns=("states",))).arrays()
    assert set(rows["status"]) == {"marginal"}


@pytest.mark.slow
@pytest.mark.parametrize("linear_stiffness", [1e3, 1e6, np.inf])
def test_a_long_graded_finger_is_the_same_in_pairs_and_directly(
    graded_finger: Fingers, linear_stiffness: float
) -> None:
    scene = Scene(graded_finger(14, 56, linear_stiffness), ())
    prediction = predict(scene, Request(columns=("states",)))
    assert prediction.plan.method is Method.PAIRS
    rows = prediction.arrays()
    sample = np.random.default_rng(57).choice(2**14, 300, replace=False)
    sample.sort()
    patterns = tuple(rows["pattern"][sample])
    direct = predict(scene, Request(patterns, ("states",))).arrays()
    assert (direct["pattern"] == rows["pattern"][sample]).all()
    assert (direct["status"] == rows["status"][sample]).all()
    error = direct["numerical_error_mm"] + rows["numerical_error_mm"][sample]
    for name in ("tip_x_mm", "tip_y_mm"):
        assert (np.abs(direct[name] - rows[name][sample]) <= error).all()


@pytest.mark.parametrize("soft", [[0, 1, 2], [3, 4, 5], [0, 2, 4], [5]])
def test_a_half_may_have_only_rigid_walls(
    reference_finger: Fingers, all_patterns: Patterns, soft: list[int]
) -> None:
    walls = np.zeros((6, 1))
    walls[soft] = 0.1
    units = UnitSolutions.of(reference_finger(6, 1e4).changed(wall_compliance=walls))
    assert assert_like_direct(Split(units, 3, 2, 1e-12), all_patterns(6), 1e-9) == 1.0
