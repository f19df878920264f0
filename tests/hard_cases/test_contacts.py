"""Discs among the hard cases: what makes a state against one right, and what makes it wrong."""

from dataclasses import replace

import numpy as np
import pytest

from dpgcli.hard_cases import contacts
from dpgcli.hard_cases.cases import Case, built_in_cases
from dpgcli.hard_cases.outcomes import Answer, Touch, Verdict
from dpgcli.hard_cases.table import rows, summarized
from dpgcli.hard_cases.verdicts import answered, judged, stress
from dpgcli.reference.bodies import RoundBody, StraightBody
from dpgcli.states.certify import Status


@pytest.fixture(scope="module")
def built_in() -> dict[str, Case]:
    return {case.variant.label: case for case in built_in_cases(["contact"])}


@pytest.fixture(scope="module")
def held(built_in: dict[str, Case]) -> Case:
    """A disc that two phalanges of a rigid finger hold."""
    return built_in["disc of 40 mm held by phalanges 2 and 3, 0.1 mm deep, k_L = ∞"]


@pytest.fixture(scope="module")
def answer(held: Case) -> Answer:
    return answered(held)


def pushed(answer: Answer, *push: float) -> Answer:
    assert answer.touch is not None
    return replace(answer, touch=Touch(np.array(push), answer.touch.walls))


def test_two_contacts_are_right_to_their_last_digits(held: Case, answer: Answer) -> None:
    outcome = judged(held, answer)
    assert (outcome.verdict, outcome.is_failure) == (Verdict.RIGHT, False)
    assert outcome.true_tip_error < 1e-12
    assert outcome.true_force_error < 1e-12
    assert answer.touch is not None and len(answer.touch.push) == 2


@pytest.mark.parametrize(("by", "verdict"), [(0.9e-9, "right"), (1.1e-9, "overconfident")])
def test_a_push_that_is_off_by_more_than_stated_is_overconfident(
    held: Case, answer: Answer, by: float, verdict: str
) -> None:
    assert answer.touch is not None
    outcome = judged(held, pushed(answer, *(answer.touch.push + np.array([0.0, by]))))
    assert (outcome.verdict.value, outcome.is_failure) == (verdict, verdict != "right")
    assert outcome.true_force_error == pytest.approx(by, rel=1e-3)


@pytest.mark.parametrize("pushes", [(), (0.0139,), (0.0139, 0.0145, 0.01)])
def test_another_number_of_contacts_is_wrong(
    held: Case, answer: Answer, pushes: tuple[float, ...]
) -> None:
    assert judged(held, pushed(answer, *pushes)).verdict is Verdict.WRONG


def test_a_tip_that_is_off_by_more_than_stated_is_overconfident(held: Case, answer: Answer) -> None:
    moved = answer.pose + np.array([0.0, 1.5 * answer.tip_error, 0.0])
    assert judged(held, replace(answer, pose=moved)).verdict is Verdict.OVERCONFIDENT


def test_a_disc_that_is_penetrated_is_wrong(held: Case, answer: Answer) -> None:
    """By nodes that are off by little more than a billionth, next to a state that is right."""
    for by, verdict in ((0.5e-9, Verdict.RIGHT), (2e-9, Verdict.WRONG)):
        lower = answer.nodes - np.tile([[0.0], [by]], (6, 1))
        assert judged(held, replace(answer, nodes=lower)).verdict is verdict


def test_a_state_that_only_its_contacts_hold_back_is_wrong(
    held: Case, answer: Answer, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Called stable where the reference finds a saddle, or another pattern."""
    found = contacts.extended_contact
    for name in ("is_minimum", "in_pattern"):
        monkeypatch.setattr(
            contacts,
            "extended_contact",
            lambda *args, name=name: replace(found(*args), **{name: False}),
        )
        assert judged(held, answer).verdict is Verdict.WRONG
    monkeypatch.setattr(contacts, "extended_contact", lambda *args: None)
    assert judged(held, answer).verdict is Verdict.WRONG


@pytest.mark.parametrize("status", [Status.NOT_CONVERGED, Status.MARGINAL, Status.ANOTHER_PATTERN])
def test_a_state_that_is_refused_is_missed(held: Case, answer: Answer, status: Status) -> None:
    outcome = judged(held, replace(answer, status=status))
    assert (outcome.verdict, outcome.is_failure) == (Verdict.MISSED, True)


@pytest.mark.slow
def test_a_unit_that_resets_is_recognized_and_its_new_state_is_judged(
    built_in: dict[str, Case],
) -> None:
    case = built_in["disc of 25 mm between phalanges 1 and 2, 5 mm deep, k_L = ∞"]
    answer = answered(case)
    assert answer.status is Status.ANOTHER_PATTERN
    assert answer.reached[:, 0].tolist() == [False, True, False]
    assert judged(case, answer).verdict is Verdict.RECOGNIZED
    assert judged(case, pushed(answer)).verdict is Verdict.WRONG
    lost = replace(answer, status=Status.NOT_CONVERGED)
    assert judged(case, lost).verdict is Verdict.NO_SUCH_STATE


@pytest.mark.parametrize("by", [1e-9, 1e-8, 1e-7, 1e-6])
@pytest.mark.parametrize("bars", ["k_L = ∞", "k_L/k_b = 1e3"])
def test_a_disc_that_grazes_two_phalanges_pushes_one_or_none(
    built_in: dict[str, Case], by: float, bars: str
) -> None:
    """Both would close at the same size of the disc; the first lifts the finger off the other."""
    words = "disc of 25 mm between phalanges 1 and 2,"
    cases = [built_in[f"{words} {by:g} mm {side}, {bars}"] for side in ("deep", "away")]
    outcomes = list(stress(cases))
    assert [outcome.verdict for outcome in outcomes] == [Verdict.RIGHT, Verdict.RIGHT]
    touching, clear = (outcome.answer.touch for outcome in outcomes)
    assert touching is not None and clear is not None
    assert (len(touching.push), len(clear.push)) == (1, 0)
    assert touching.push[0] == pytest.approx(0.72 * by, rel=1e-2)


def test_the_family_is_what_the_manual_says(built_in: dict[str, Case]) -> None:
    variants = [case.variant for case in built_in.values()]
    bodies = [variant.body for variant in variants if variant.body is not None]
    assert {case.formulation for case in built_in.values()} == {"chain"}
    diameters = {2.0 * body.radius for body in bodies if isinstance(body, RoundBody)}
    assert (min(diameters), max(diameters)) == (1.0, 500.0)
    straight = [body for body in bodies if isinstance(body, StraightBody)]
    sizes = [np.ptp(np.array(body.corners), axis=0).max() for body in straight]
    assert min(sizes) < 1.2 and max(sizes) > 500.0, "mm"
    yields = {body.stiffness for body in straight}
    assert np.inf in yields and (min(yields), max(yields - {np.inf})) == (1e-6, 1e9)
    n_jaws = sum("jaws" in label for label in built_in)
    assert (len(bodies) - len(straight), len(straight) - n_jaws, n_jaws) == (128, 112, 18)
    fingers = [variant.finger for variant in variants]
    ratios = {float(f.linear_stiffness.max() / f.bistable_stiffness.max()) for f in fingers}
    assert np.inf in ratios
    assert (min(ratios), max(ratios - {np.inf})) == pytest.approx((1.0, 1e15))
    for words in ("clamp", "tip", "between", "held by", "walls", "away", "wedge", "block"):
        assert any(words in label for label in built_in)


@pytest.mark.parametrize(
    ("label", "n_pushes"),
    [
        ("plate held by phalanx 2 at both ends, 5 mm, 0.1 mm deep, k_L/k_b = 1e+15", 2),
        ("plate held by phalanx 3 and its tip, 5 mm, 1e-09 mm deep, k_L = ∞", 2),
        ("plate along phalanx 2, 8 mm, 1e-09 mm deep, k_L = ∞", 1),
        ("wedge next to the clamp, 4 mm, 0.001 mm deep, k_L/k_b = 1e3", 1),
        ("block below the tip, 500 mm, 0.1 mm deep, k_L = ∞", 1),
        ("jaws below the tip, 12 mm, 0.1 mm deep, 1e-06 N/mm, k_L = ∞", 1),
        ("jaws below the tip, 12 mm, 1 mm deep, 1e+09 N/mm, k_L/k_b = 1e3", 1),
    ],
)
def test_straight_sides_and_jaws_are_right(
    built_in: dict[str, Case], label: str, n_pushes: int
) -> None:
    case = built_in[label]
    answer = answered(case)
    outcome = judged(case, answer)
    assert outcome.verdict is Verdict.RIGHT and answer.touch is not None
    assert len(answer.touch.push) == n_pushes and (answer.touch.push > 0.0).all()
    assert outcome.true_tip_error < 1e-11 and outcome.true_force_error < 1e-12


def test_jaws_that_have_yielded_less_are_penetrated(built_in: dict[str, Case]) -> None:
    case = built_in["jaws below the tip, 12 mm, 0.1 mm deep, 1 N/mm, k_L = ∞"]
    answer = answered(case)
    assert answer.touch is not None and answer.touch.yielded > 0.01, "mm"
    for by, verdict in ((0.5e-9, Verdict.RIGHT), (2e-9, Verdict.WRONG)):
        less = replace(answer.touch, yielded=answer.touch.yielded - by)
        assert judged(case, replace(answer, touch=less)).verdict is verdict


def test_a_push_on_jaws_that_is_off_is_overconfident(built_in: dict[str, Case]) -> None:
    case = built_in["jaws below the tip, 12 mm, 0.1 mm deep, 1 N/mm, k_L = ∞"]
    answer = answered(case)
    assert answer.touch is not None
    off = replace(answer.touch, push=answer.touch.push + 1.1e-9)
    assert judged(case, replace(answer, touch=off)).verdict is Verdict.OVERCONFIDENT


def test_tables_have_the_error_of_pushes_and_of_nothing_else(held: Case) -> None:
    (mirrored, *_) = built_in_cases(["mirror"])
    outcomes = list(stress([held, mirrored]))
    errors = rows(outcomes)["true_force_error_N"]
    assert np.isfinite(errors).tolist() == [True, False]
    contact, mirror = summarized(outcomes)
    assert contact.true_force_error == errors[0]
    assert np.isnan(mirror.true_force_error)


def test_a_state_of_another_pattern_is_not_the_one_that_was_missed(
    held: Case, answer: Answer, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = contacts.extended_contact
    refused = replace(answer, status=Status.NOT_CONVERGED)
    for name in ("is_minimum", "in_pattern"):
        monkeypatch.setattr(
            contacts,
            "extended_contact",
            lambda *args, name=name: replace(found(*args), **{name: False}),
        )
        assert judged(held, refused).verdict is Verdict.NO_SUCH_STATE
