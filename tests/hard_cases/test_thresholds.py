"""Thresholds among the hard cases: what makes them right, and what makes them wrong."""

from dataclasses import replace

import numpy as np
import pytest

from dpgcli.hard_cases.cases import Case, built_in_cases, study_finger
from dpgcli.hard_cases.outcomes import Answer, Verdict
from dpgcli.hard_cases.table import rows, summarized
from dpgcli.hard_cases.variants import Variant, changed, rigid
from dpgcli.hard_cases.verdicts import answered, judged, stress
from dpgcli.mechanics.finger import Finger
from dpgcli.states.certify import Status

UNIT = rigid(study_finger().with_units([0]))
PAIR = changed(study_finger().with_units([0, 1]), stroke=np.array([3.5, 3.6]))


def case_of(finger: Finger, pattern: str, pressure: int = 1) -> Case:
    variant = Variant("as given", finger, pressure=pressure)
    return Case("built-in", "pressure", variant, pattern, "chain")


def moved(answer: Answer, share: float) -> Answer:
    """The same answer with a threshold that is off, relative."""
    threshold = answer.threshold
    assert threshold is not None
    return replace(answer, threshold=replace(threshold, pushes=threshold.pushes * (1.0 + share)))


@pytest.mark.parametrize(("pattern", "pressure"), [("00", 1), ("11", -1), ("10", 1), ("10", -1)])
def test_thresholds_are_right_to_their_last_digits(pattern: str, pressure: int) -> None:
    (outcome,) = stress([case_of(PAIR, pattern, pressure)])
    assert (outcome.verdict, outcome.is_failure) == (Verdict.RIGHT, False)
    assert outcome.true_threshold_error < 1e-13
    assert outcome.true_tip_error < 1e-7
    assert outcome.answer.residual < 1e-8


@pytest.mark.parametrize("pattern", ["00", "11"])
@pytest.mark.parametrize("share", [1e-3, 1e-8, -1e-8, -1e-3])
def test_a_threshold_that_is_off_is_wrong(pattern: str, share: float) -> None:
    case = case_of(PAIR, pattern, 1 if pattern == "00" else -1)
    outcome = judged(case, moved(answered(case), share))
    assert (outcome.verdict, outcome.is_failure) == (Verdict.WRONG, True)


@pytest.mark.parametrize("share", [5e-10, -5e-10])
def test_a_threshold_that_is_off_by_more_than_stated_is_overconfident(share: float) -> None:
    case = case_of(PAIR, "00")
    outcome = judged(case, moved(answered(case), share))
    assert (outcome.verdict, outcome.is_failure) == (Verdict.OVERCONFIDENT, True)
    assert outcome.true_threshold_error == pytest.approx(5e-10, rel=1e-3)


def test_a_threshold_of_another_unit_is_wrong() -> None:
    case = case_of(PAIR, "00")
    answer = answered(case)
    assert answer.threshold is not None
    other = replace(answer, threshold=replace(answer.threshold, unit=1 - answer.threshold.unit))
    assert judged(case, other).verdict is Verdict.WRONG


def test_the_threshold_after_the_first_is_wrong() -> None:
    """A fold that was passed on the way: the second unit's, though the first has left before."""
    case, second = case_of(PAIR, "00"), case_of(PAIR, "10")
    answer = answered(second)
    assert answer.threshold is not None
    nodes = answered(case).nodes  # with the first at its own fold
    assert judged(case, replace(answer, nodes=nodes)).verdict is Verdict.WRONG


def test_a_threshold_that_was_not_seen_is_missed() -> None:
    case = case_of(UNIT, "0")
    answer = answered(case)
    assert answer.threshold is not None
    beyond = replace(answer.threshold, is_fold=False, pushes=answer.threshold.pushes * 1.5)
    outcome = judged(case, replace(answer, threshold=beyond))
    assert (outcome.verdict, outcome.is_failure) == (Verdict.MISSED, True)


@pytest.mark.parametrize(("pattern", "linearity"), [("0", 0.5), ("1", 0.5), ("1", 0.043)])
def test_where_nothing_leaves_there_is_no_threshold(pattern: str, linearity: float) -> None:
    """Without a negative stiffness, without the state, or pressed further into it."""
    (outcome,) = stress([case_of(changed(UNIT, force_linearity=linearity), pattern)])
    assert (outcome.verdict, outcome.is_failure) == (Verdict.NO_SUCH_STATE, False)


def test_what_is_not_followed_to_an_end_is_missed() -> None:
    case = case_of(UNIT, "0")
    outcome = judged(case, replace(answered(case), status=Status.NOT_CONVERGED))
    assert (outcome.verdict, outcome.is_failure) == (Verdict.MISSED, True)


def test_equal_units_are_right_without_a_fold_of_one_alone() -> None:
    (outcome,) = stress([case_of(rigid(study_finger()), "000")])
    assert outcome.verdict is Verdict.RIGHT
    assert outcome.answer.threshold is not None
    assert outcome.answer.threshold.tied.sum() == 2


def test_the_family_is_what_the_manual_says() -> None:
    cases = list(built_in_cases(["pressure"]))
    assert {case.formulation for case in cases} == {"chain"}
    assert {case.variant.pressure for case in cases} == {1, -1}
    assert {case.variant.finger.n_units for case in cases} == {1, 2, 4}
    units = [c.variant.finger for c in cases if c.variant.finger.n_units == 1]
    ratios = {float(f.linear_stiffness.max() / f.bistable_stiffness.max()) for f in units}
    assert {min(ratios), np.inf} <= ratios
    assert min(ratios) == pytest.approx(1.0)
    assert max(ratios - {np.inf}) == pytest.approx(1e15)
    walls = {float((f.wall_compliance * f.bistable_stiffness).max()) for f in units}
    assert (max(walls), min(walls - {0.0})) == pytest.approx((1e3, 1e-6))


def test_tables_have_the_error_of_thresholds_and_of_nothing_else() -> None:
    cases = [case_of(UNIT, "0"), Case("built-in", "patterns", Variant("as", UNIT), "1", "chain")]
    outcomes = list(stress(cases))
    errors = rows(outcomes)["true_threshold_error"]
    assert np.isfinite(errors).tolist() == [True, False]
    pressure, patterns = summarized(outcomes)
    assert pressure.true_threshold_error == errors[0]
    assert np.isnan(patterns.true_threshold_error)
    assert np.isnan(pressure.condition)
    assert np.isfinite(patterns.condition)
