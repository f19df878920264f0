"""Every verdict can be had, and the gauntlet is passed but for what is marked."""

from dataclasses import replace

import numpy as np
import pytest

from dpgcli.arrays import Array
from dpgcli.hard_cases.cases import Case, built_in_cases, study_finger
from dpgcli.hard_cases.families import FAMILIES, FOLDED_STARTS
from dpgcli.hard_cases.outcomes import Verdict
from dpgcli.hard_cases.table import STRESS_COLUMNS, rows, summarized
from dpgcli.hard_cases.variants import Start, Variant, changed, rigid
from dpgcli.hard_cases.verdicts import answered, judged, scaled, stress
from dpgcli.mechanics.chain import Chain
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.lattice import Lattice
from dpgcli.mechanics.terms import chain_potential
from dpgcli.states.certify import MARGINAL_CURVATURE, Status, certify
from dpgcli.states.columns import Kind
from dpgcli.states.margins import limits
from dpgcli.states.plan import FORMULATIONS
from dpgcli.states.settle import settle, settle_from
from dpgcli.states.units import UnitSolutions

UNIT = rigid(study_finger().with_units([0]))


def case_of(
    finger: Finger, pattern: str, formulation: str = "chain", start: Start | None = None
) -> Case:
    variant = Variant("as given", finger, start=start or Start())
    return Case("built-in", "patterns", variant, pattern, formulation)


def nodes_at(finger: Finger, angle: float) -> Array:
    """Nodes (4, 1) of a rigid unit whose corners are both open by an angle."""
    chain = Chain(finger)
    both = np.full((2, 1), angle)
    return np.stack(chain.stations(both), axis=1).reshape(4, 1)


def with_values(finger: Finger, **values: float) -> Finger:
    return changed(finger, **values)


@pytest.mark.parametrize("formulation", ["chain", "lattice"])
@pytest.mark.parametrize("pattern", ["101", "111", "000"])
def test_the_study_finger_is_right(pattern: str, formulation: str) -> None:
    (outcome,) = stress([case_of(study_finger(), pattern, formulation)])
    assert (outcome.verdict, outcome.is_failure) == (Verdict.RIGHT, False)
    assert outcome.true_tip_error <= outcome.answer.tip_error < 1e-11
    assert outcome.true_angle_error < 1e-14


def test_the_answer_is_what_predict_says() -> None:
    answer = answered(case_of(study_finger(), "101"))
    assert answer.status is Status.STABLE
    assert answer.pose[:2] == pytest.approx([38.35981703, -11.99285355], abs=1e-8)
    assert answer.nodes[-4:-2, 0].tolist() == answer.pose[:2].tolist()
    assert answer.reached[:, 0].tolist() == [True, False, True]


def test_a_saddle_called_stable_is_wrong() -> None:
    case = case_of(UNIT, "1")
    half = np.arcsin(2.0041742418404 / 21.5)  # x at the barrier's top
    saddle = replace(answered(case), nodes=nodes_at(UNIT, half))
    outcome = judged(case, saddle)
    assert (outcome.verdict, outcome.is_failure) == (Verdict.WRONG, True)


@pytest.mark.parametrize("corners", [turned[0] for turned in FOLDED_STARTS.values()])
def test_whatever_is_no_state_is_wrong_when_called_stable(corners: tuple[float, float]) -> None:
    """The two physical minima are right for their own pattern only, the others for none."""
    turned = answered(case_of(UNIT, "1", start=Start(corners=corners)))
    called = replace(turned, status=Status.STABLE)
    outcome = judged(case_of(UNIT, "1", start=Start(corners=corners)), called)
    own = Verdict.RIGHT if corners == FOLDED_STARTS["inverted"][0] else Verdict.WRONG
    assert outcome.verdict is own
    assert outcome.is_failure is (own is Verdict.WRONG)


def test_a_pose_of_another_pattern_is_wrong() -> None:
    other = answered(case_of(study_finger(), "110"))
    assert judged(case_of(study_finger(), "101"), other).verdict is Verdict.WRONG


@pytest.mark.parametrize("nodes", [np.full((12, 1), np.nan), np.zeros((12, 1))])
def test_no_shape_at_all_is_wrong(nodes: Array) -> None:
    case = case_of(study_finger(), "101")
    assert judged(case, replace(answered(case), nodes=nodes)).verdict is Verdict.WRONG


def test_an_error_that_is_stated_too_small_is_overconfident() -> None:
    case = case_of(study_finger(), "111")
    answer = answered(case)
    for off, verdict in ((0.9, Verdict.RIGHT), (1.1, Verdict.OVERCONFIDENT)):
        moved = answer.pose + np.array([0.0, off * answer.tip_error, 0.0])
        outcome = judged(case, replace(answer, pose=moved))
        assert outcome.verdict is verdict
        assert outcome.is_failure is (verdict is Verdict.OVERCONFIDENT)


@pytest.mark.parametrize(("distance", "verdict"), [(1e-9, "right"), (1e-6, "overconfident")])
def test_next_to_a_fold_an_error_may_be_four_times_the_stated_one(
    distance: float, verdict: str
) -> None:
    limit = limits(UNIT).force_linearity[0]
    case = case_of(with_values(UNIT, force_linearity=limit - distance), "1")
    answer = answered(case)
    moved = answer.pose + np.array([3.0 * answer.tip_error, 0.0, 0.0])
    assert judged(case, replace(answer, pose=moved)).verdict == verdict
    moved = answer.pose + np.array([5.0 * answer.tip_error, 0.0, 0.0])
    assert judged(case, replace(answer, pose=moved)).verdict is Verdict.OVERCONFIDENT


@pytest.mark.parametrize(
    ("formulation", "start", "is_failure"),
    [
        ("chain", Start(), True),
        ("chain", Start(strokes=0.5), False),
        ("lattice", Start(), False),
    ],
)
@pytest.mark.parametrize("status", [Status.MARGINAL, Status.NOT_CONVERGED, Status.ANOTHER_PATTERN])
def test_to_miss_a_state_fails_only_the_chain_from_its_own_guess(
    formulation: str, start: Start, is_failure: bool, status: Status
) -> None:
    case = case_of(study_finger().with_units([0]), "1", formulation, start)
    outcome = judged(case, replace(answered(case), status=status))
    assert (outcome.verdict, outcome.is_failure) == (Verdict.MISSED, is_failure)
    assert np.isnan([outcome.true_tip_error, outcome.true_angle_error]).all()


def test_a_state_that_there_is_not_is_no_such_state() -> None:
    (outcome,) = stress([case_of(with_values(study_finger(), force_linearity=0.2), "101")])
    assert outcome.answer.status is Status.NOT_BISTABLE
    assert (outcome.verdict, outcome.is_failure) == (Verdict.NO_SUCH_STATE, False)


@pytest.mark.parametrize("formulation", ["chain", "lattice"])
def test_the_six_minima_of_one_unit_are_found_and_two_are_physical(formulation: str) -> None:
    outcomes = [
        outcome
        for outcome in stress(built_in_cases(["mirror"]))
        if outcome.case.formulation == formulation
        and outcome.case.variant.finger.is_rigid is (formulation == "chain")
    ]
    shapes = np.concatenate([outcome.answer.nodes for outcome in outcomes], axis=1)
    apart = np.linalg.norm(shapes[:, :, None] - shapes[:, None], axis=0) + 99.0 * np.eye(6)
    assert apart.min() > 0.1  # mm
    assert [outcome.verdict.value for outcome in outcomes] == 2 * ["right"] + 4 * ["recognized"]
    statuses = [outcome.answer.status for outcome in outcomes]
    assert statuses == 2 * [Status.STABLE] + 4 * [Status.FOLDED]


def test_from_anywhere_one_unit_ends_in_one_of_six_minima_and_two_are_certified() -> None:
    angles = np.linspace(-3.0, 3.0, 25)
    guess = np.stack(np.meshgrid(angles, angles)).reshape(2, -1)
    chain, units = chain_potential(UNIT), UnitSolutions.of(UNIT)
    ground = np.zeros((1, guess.shape[1]), bool)
    batches = [settle_from(units, chain, pattern, guess, 1e-12) for pattern in (ground, ~ground)]
    stable = [certify(batch, units, 1e-12) == Status.STABLE for batch in batches]
    found = batches[0].equilibrium
    is_minimum = (found.relative_residual <= 1e-12) & (found.curvature > MARGINAL_CURVATURE)
    assert len(np.unique(found.coordinates[:, is_minimum].round(6), axis=1).T) == 6
    certified = found.coordinates[:, stable[0] | stable[1]]
    assert len(np.unique(certified.round(6), axis=1).T) == 2


@pytest.mark.parametrize("scale", [1e-3, 1e3])
@pytest.mark.parametrize("formulation", ["chain", "lattice"])
def test_the_unit_of_length_does_not_matter(formulation: str, scale: float) -> None:
    case = case_of(study_finger(), "101", formulation)
    other = replace(case, variant=replace(case.variant, scale=scale))
    in_mm, elsewhere = answered(case), answered(other)
    assert elsewhere.pose == pytest.approx(in_mm.pose, rel=1e-12)
    assert elsewhere.tip_error == pytest.approx(in_mm.tip_error, rel=0.1)
    assert elsewhere.condition == pytest.approx(in_mm.condition, rel=1e-3)
    assert elsewhere.residual_floor == pytest.approx(in_mm.residual_floor, rel=1e-3)


def test_scaled_lengths_leave_forces_alone() -> None:
    finger = study_finger().changed(hinge_coupling=np.array([[1.2]]))
    in_meters = scaled(finger, 1e-3)
    assert in_meters.hinge_coupling.item() == pytest.approx(0.0012)  # N m/rad
    assert in_meters.stroke.item() == pytest.approx(3.5e-3)
    assert in_meters.bistable_stiffness.item() == pytest.approx(12840.0)  # N/m
    assert in_meters.hinge_stiffness.item() == pytest.approx(0.0242)  # N m/rad
    assert in_meters.force_scale == pytest.approx(finger.force_scale)


@pytest.mark.parametrize("name", ["chain", "lattice"])
def test_rounding_the_coordinates_leaves_no_more_than_the_floor(name: str) -> None:
    finger = study_finger()
    answer = answered(case_of(finger, "111", name))
    potential = FORMULATIONS[name](finger)
    batch = settle(UnitSolutions.of(finger), FORMULATIONS[name], np.ones((3, 1), bool), 1e-12)
    here = batch.equilibrium.coordinates
    signs = np.random.default_rng(1).choice([-1.0, 1.0], (len(here), 500))
    half_a_digit = here * (1.0 + 0.5 * np.finfo(float).eps * signs)
    forces = potential.evaluate(half_a_digit).gradient / potential.coordinates.force_unit
    left = np.abs(forces).max(axis=0)
    assert 0.02 * answer.residual_floor < left.max() <= 1.5 * answer.residual_floor


def test_the_floor_of_the_lattice_is_about_what_it_says_itself() -> None:
    finger = study_finger()
    own = Lattice(finger).rounding_floor.item()
    assert 0.5 * own < answered(case_of(finger, "000", "lattice")).residual_floor < 4.0 * own


def test_the_condition_is_that_of_the_scaled_hessian() -> None:
    """Two corners, A on the diagonal and B beside it: (A + |B|)/(A − |B|)."""
    answer = answered(case_of(UNIT, "0"))
    diagonal, beside = 12.84 * 10.75**2 + 48.4, 12.84 * 10.75**2
    exact = (diagonal + beside) / (diagonal - beside)
    assert answer.condition == pytest.approx(exact, rel=1e-10)


def test_the_table_shows_where_node_coordinates_lose_digits() -> None:
    chosen = ("k_L/k_b = 1e3", "k_L/k_b = 1e9", "k_L/k_b = 1e15")
    cases = [
        case
        for case in built_in_cases(["stiffness"])
        if case.variant.label in chosen and case.pattern == "111"
    ]
    outcomes = list(stress(cases))
    chain, lattice = (outcomes[start::2] for start in (0, 1))
    assert [o.verdict.value for o in chain] == ["right", "right", "right"]
    assert [o.verdict.value for o in lattice] == ["right", "right", "missed"]
    assert max(o.answer.condition for o in chain) < 100.0
    assert [o.answer.condition for o in lattice] > [1e4, 1e10, 1e15]
    assert max(o.answer.residual for o in chain) < 1e-10
    assert lattice[1].answer.residual > 1e-6
    assert not any(outcome.is_failure for outcome in outcomes)


def test_rows_have_the_declared_columns() -> None:
    outcomes = list(stress(built_in_cases(["mirror"])))
    columns = rows(outcomes)
    assert tuple(columns) == tuple(column.name for column in STRESS_COLUMNS)
    assert {len(values) for values in columns.values()} == {len(outcomes)}
    kinds = {Kind.NUMBER: "f", Kind.COUNT: "i", Kind.FLAG: "b", Kind.STATUS: "u"}
    for column in STRESS_COLUMNS:
        assert columns[column.name].dtype.kind == kinds.get(
            column.kind, columns[column.name].dtype.kind
        )
    assert all(column.description for column in STRESS_COLUMNS)


def test_families_are_counted_by_formulation() -> None:
    outcomes = list(stress(built_in_cases(["mirror"])))
    chain, lattice = summarized(outcomes)
    assert (chain.formulation, lattice.formulation) == ("chain", "lattice")
    assert (chain.n_cases, lattice.n_cases) == (12, 6)
    assert chain.verdicts[Verdict.RIGHT] == 4
    assert chain.verdicts[Verdict.RECOGNIZED] == 8
    assert (chain.n_failures, lattice.n_failures) == (0, 0)
    right = [o for o in outcomes if o.verdict is Verdict.RIGHT and o.case.formulation == "chain"]
    assert chain.true_tip_error == max(outcome.true_tip_error for outcome in right)
    assert chain.condition == max(outcome.answer.condition for outcome in right)


def test_a_family_with_nothing_right_has_no_numbers() -> None:
    case = case_of(UNIT, "1")
    straight = replace(answered(case), nodes=nodes_at(UNIT, 0.0))
    (summary,) = summarized([judged(case, straight)])
    assert (summary.n_failures, summary.verdicts[Verdict.WRONG]) == (1, 1)
    assert np.isnan([summary.condition, summary.true_tip_error, summary.iterations]).all()


@pytest.mark.slow
@pytest.mark.parametrize(
    "family",
    [family.name for family in FAMILIES],
)
def test_the_gauntlet_is_passed(family: str) -> None:
    outcomes = list(stress(built_in_cases([family])))
    assert outcomes
    for outcome in outcomes:
        case = outcome.case
        what = (case.variant.label, case.pattern, case.formulation, outcome.answer.status)
        assert not outcome.is_failure, (*what, outcome.verdict)


@pytest.mark.parametrize("hinge", [1e-6, 1e-9])
def test_a_faint_hinge_is_marginal_not_stable(hinge: float) -> None:
    """It exists, but its curvature is below what a certificate trusts."""
    (outcome,) = stress([case_of(with_values(UNIT, hinge_stiffness=hinge), "1")])
    assert outcome.answer.status is Status.MARGINAL
    assert outcome.verdict is Verdict.MARGINAL
    assert not outcome.is_failure


def test_marginal_is_no_excuse_where_the_curvature_is_sound() -> None:
    case = case_of(UNIT, "1")
    outcome = judged(case, replace(answered(case), status=Status.MARGINAL))
    assert outcome.verdict is Verdict.MISSED
    assert outcome.is_failure


def test_without_hinges_an_inverted_finger_is_a_mechanism() -> None:
    (outcome,) = stress([case_of(with_values(study_finger(), hinge_stiffness=0.0), "111")])
    assert outcome.verdict is Verdict.NO_SUCH_STATE


def test_a_state_whose_energy_cancels_is_right() -> None:
    even = with_values(study_finger(), force_linearity=1e-12, hinge_stiffness=2.42e-5)
    (outcome,) = stress([case_of(rigid(even), "111")])
    assert outcome.verdict is Verdict.RIGHT


def test_between_stiff_bars_the_lattices_error_is_within_the_stated_one() -> None:
    cases = [case for case in built_in_cases(["guess"]) if "1e+12" in case.variant.label]
    assert {outcome.verdict for outcome in stress(cases)} == {Verdict.RIGHT}


@pytest.mark.slow
def test_the_angle_of_a_long_finger_is_as_exact_as_stated() -> None:
    (outcome,) = stress([case_of(study_finger().with_units([0] * 64), "1000" * 16)])
    assert outcome.true_angle_error <= outcome.answer.angle_error
