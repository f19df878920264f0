"""Two fingers among the hard cases: what makes a state of both right, and what makes it wrong."""

from dataclasses import replace

import numpy as np
import pytest

from dpgcli.arrays import Array
from dpgcli.hard_cases import grips
from dpgcli.hard_cases.cases import Case, built_in_cases
from dpgcli.hard_cases.outcomes import Answer, Verdict
from dpgcli.hard_cases.table import rows
from dpgcli.hard_cases.verdicts import answered, judged
from dpgcli.states.certify import Status

BESIDE = "fingers that meet beside a disc of 2 mm, 0.5 mm deep, k_L = ∞"
NOTCHES = "block with notches, 0.1 mm deep, free to turn, k_L = ∞"
FURTHER = "fingers that meet, 20 mm deep, k_L = ∞"


@pytest.fixture(scope="module")
def built_in() -> dict[tuple[str, str], Case]:
    cases = built_in_cases(["contact"])
    return {(case.variant.label, case.pattern): case for case in cases}


@pytest.fixture(scope="module")
def beside(built_in: dict[tuple[str, str], Case]) -> Case:
    return built_in[BESIDE, "111/110"]


@pytest.fixture(scope="module")
def answer(beside: Case) -> Answer:
    return answered(beside)


def pushed(answer: Answer, push: Array) -> Answer:
    assert answer.touch is not None
    return replace(answer, touch=replace(answer.touch, push=push))


def push_of(answer: Answer) -> Array:
    assert answer.touch is not None
    return answer.touch.push


def test_fingers_that_meet_beside_a_disc_are_right(beside: Case, answer: Answer) -> None:
    outcome = judged(beside, answer)
    assert (outcome.verdict, outcome.is_failure) == (Verdict.RIGHT, False)
    assert outcome.true_tip_error < 1e-12 and outcome.true_force_error < 1e-12
    assert len(push_of(answer)) == 2 and (push_of(answer) > 0.01).all()
    told = rows([outcome])
    assert told["pattern"].tolist() == told["reached_pattern"].tolist() == [b"111/110"]
    assert told["n_units"].tolist() == [3]


@pytest.mark.parametrize("place", [0, 1])
@pytest.mark.parametrize(("by", "verdict"), [(0.9e-9, "right"), (1.1e-9, "overconfident")])
def test_a_push_that_is_off_by_more_than_stated_is_overconfident(
    beside: Case, answer: Answer, by: float, verdict: str, place: int
) -> None:
    """That on the disc, and that between the fingers."""
    push = push_of(answer) + by * (np.arange(2) == place)
    outcome = judged(beside, pushed(answer, push))
    assert (outcome.verdict.value, outcome.is_failure) == (verdict, verdict != "right")


def test_a_tip_that_is_off_by_more_than_stated_is_overconfident(
    beside: Case, answer: Answer
) -> None:
    for place in range(4):
        pose = answer.pose + 2.0 * answer.tip_error * (np.arange(4) == place)
        assert judged(beside, replace(answer, pose=pose)).verdict is Verdict.OVERCONFIDENT


def test_another_number_of_contacts_is_wrong(beside: Case, answer: Answer) -> None:
    for push in (push_of(answer)[:1], np.append(push_of(answer), 0.1)):
        assert judged(beside, pushed(answer, push)).verdict is Verdict.WRONG


def test_fingers_in_each_other_are_wrong(
    beside: Case, answer: Answer, monkeypatch: pytest.MonkeyPatch
) -> None:
    for deep, verdict in ((0.9e-9, Verdict.RIGHT), (1.1e-9, Verdict.WRONG)):
        monkeypatch.setattr(grips, "depth", lambda *_, deep=deep: deep)
        assert judged(beside, answer).verdict is verdict


@pytest.mark.parametrize("place", range(3))
@pytest.mark.parametrize(("by", "verdict"), [(0.9e-9, "right"), (1.1e-9, "overconfident")])
def test_a_body_that_is_elsewhere_is_overconfident(
    beside: Case,
    answer: Answer,
    place: int,
    by: float,
    verdict: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    truth = grips._next_to(beside, answer)
    assert truth is not None
    there = replace(truth, moved=truth.moved + by * (np.arange(3) == place))
    monkeypatch.setattr(grips, "_next_to", lambda *_: there)
    assert judged(beside, answer).verdict.value == verdict


@pytest.mark.slow
def test_a_state_that_is_called_none_is_missed(beside: Case, answer: Answer) -> None:
    outcome = judged(beside, replace(answer, status=Status.NOT_CONVERGED))
    assert (outcome.verdict, outcome.is_failure) == (Verdict.MISSED, True)


def test_what_the_reference_loses_is_no_such_state(
    beside: Case, answer: Answer, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Refused, or another pattern that is none either, or that is right."""
    truth = grips._next_to(beside, answer)
    monkeypatch.setattr(grips, "extended_grip", lambda *_: None)
    refused, other = (
        replace(answer, status=status) for status in (Status.MARGINAL, Status.ANOTHER_PATTERN)
    )
    assert judged(beside, refused).verdict is Verdict.NO_SUCH_STATE
    assert judged(beside, other).verdict is Verdict.WRONG
    monkeypatch.setattr(grips, "_next_to", lambda *_: truth)
    assert judged(beside, other).verdict is Verdict.RECOGNIZED


@pytest.mark.parametrize("flaw", ["is_minimum", "in_pattern"])
def test_what_is_no_minimum_of_the_pattern_is_wrong(
    beside: Case, answer: Answer, flaw: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    truth = grips._next_to(beside, answer)
    assert truth is not None
    monkeypatch.setattr(grips, "_next_to", lambda *_: replace(truth, **{flaw: False}))
    assert judged(beside, answer).verdict is Verdict.WRONG
    monkeypatch.setattr(grips, "_next_to", lambda *_: None)
    assert judged(beside, answer).verdict is Verdict.WRONG


@pytest.mark.slow
def test_a_block_that_has_turned_is_right(built_in: dict[tuple[str, str], Case]) -> None:
    case = built_in[NOTCHES, "010/100"]
    answer = answered(case)
    outcome = judged(case, answer)
    assert outcome.verdict is Verdict.RIGHT and len(push_of(answer)) == 4
    assert answer.touch is not None and abs(answer.touch.moved[2]) > 1e-3


@pytest.mark.slow
def test_units_that_reset_on_the_way_are_recognized(
    built_in: dict[tuple[str, str], Case],
) -> None:
    """The reference loses the pattern as bases come together."""
    case = built_in[FURTHER, "111/110"]
    outcome = judged(case, answered(case))
    assert (outcome.verdict, outcome.answer.status) == (
        Verdict.RECOGNIZED,
        Status.ANOTHER_PATTERN,
    )
