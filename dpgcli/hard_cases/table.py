"""Results of the hard cases: a table row for every case, a summary for every family."""

from collections.abc import Iterable, Sequence

import numpy as np

from dpgcli.arrays import Columns
from dpgcli.hard_cases.outcomes import Outcome, Verdict
from dpgcli.records import dataclass
from dpgcli.states.columns import Column, Kind
from dpgcli.states.patterns import texts


def _column(name: str, unit: str, description: str, kind: Kind = Kind.NUMBER) -> Column:
    return Column(name, unit, description, kind=kind)


STRESS_COLUMNS = (
    _column("subject", "", "whose finger is pushed: the spec's or the built-in one", Kind.TEXT),
    _column("family", "", "what is pushed", Kind.TEXT),
    _column("case", "", "how far it is pushed", Kind.TEXT),
    _column("formulation", "", "chain or lattice", Kind.TEXT),
    _column("n_units", "", "number of units", Kind.COUNT),
    _column("pattern", "", "activation pattern that is asked for", Kind.PATTERN),
    _column("verdict", "", "what the answer is worth", Kind.TEXT),
    _column("fails", "", "the verdict makes the command fail", Kind.FLAG),
    _column("status", "", "stable where certified, else why not", Kind.STATUS),
    _column("reached_pattern", "", "the pattern whose wells the units are in", Kind.PATTERN),
    _column("residual_N", "N", "largest unbalanced force; moments over the segment height H"),
    _column("residual_floor_N", "N", "what rounding the coordinates leaves of it: ε |H| |q|"),
    _column("condition", "", "of the Hessian scaled to a unit diagonal, 2-norm, at most 1/ε"),
    _column("numerical_error_mm", "mm", "stated numerical error of the tip position"),
    _column("true_tip_error_mm", "mm", "distance from the tip in extended precision"),
    _column("true_angle_error_rad", "rad", "difference from the tip angle in extended precision"),
    _column("iterations", "", "steps of Newton's method, 0 of paths against a disc", Kind.COUNT),
    _column("true_threshold_error", "", "relative error of a threshold pressure"),
    _column("true_force_error_N", "N", "largest error of a push of a body in the way"),
)


def rows(outcomes: Sequence[Outcome]) -> Columns:
    """Columns of `STRESS_COLUMNS` by name, a row for each outcome."""
    cases, answers = [o.case for o in outcomes], [o.answer for o in outcomes]
    return {
        "subject": np.array([case.subject for case in cases]),
        "family": np.array([case.family for case in cases]),
        "case": np.array([case.variant.label for case in cases]),
        "formulation": np.array([case.formulation for case in cases]),
        "n_units": np.array([case.variant.finger.n_units for case in cases]),
        "pattern": np.array([case.pattern.encode() for case in cases]),
        "verdict": np.array([outcome.verdict.value for outcome in outcomes]),
        "fails": np.array([outcome.is_failure for outcome in outcomes]),
        "status": np.array([answer.status for answer in answers], np.uint8),
        "reached_pattern": np.array([_reached(outcome) for outcome in outcomes]),
        "residual_N": np.array([answer.residual for answer in answers]),
        "residual_floor_N": np.array([answer.residual_floor for answer in answers]),
        "condition": np.array([answer.condition for answer in answers]),
        "numerical_error_mm": np.array([answer.tip_error for answer in answers]),
        "true_tip_error_mm": np.array([outcome.true_tip_error for outcome in outcomes]),
        "true_angle_error_rad": np.array([outcome.true_angle_error for outcome in outcomes]),
        "iterations": np.array([answer.iterations for answer in answers]),
        "true_threshold_error": np.array([outcome.true_threshold_error for outcome in outcomes]),
        "true_force_error_N": np.array([outcome.true_force_error for outcome in outcomes]),
    }


def _reached(outcome: Outcome) -> bytes:
    """The pattern that a finger is in, or upper/lower that two are in."""
    n_units = outcome.case.variant.finger.n_units
    return b"/".join(texts(outcome.answer.reached.reshape(-1, n_units).T))


@dataclass(frozen=True)
class FamilySummary:
    """Counts by verdict of one family and formulation, and the worst of its right states.

    Residual in N, true tip error in mm; `residual_over_floor` is of states with an inverted
    unit, since a straight finger rounds nothing. Each is NaN where no right answer has one.
    """

    subject: str
    family: str
    formulation: str
    n_cases: int
    verdicts: dict[Verdict, int]
    n_failures: int
    residual: float
    residual_over_floor: float
    condition: float
    true_tip_error: float
    iterations: float
    true_threshold_error: float
    true_force_error: float


def summarized(outcomes: Iterable[Outcome]) -> list[FamilySummary]:
    """One summary for each family and formulation of each subject, in their order."""
    groups: dict[tuple[str, str, str], list[Outcome]] = {}
    for outcome in outcomes:
        case = outcome.case
        groups.setdefault((case.subject, case.family, case.formulation), []).append(outcome)
    return [_family_summary(names, members) for names, members in groups.items()]


def _family_summary(names: tuple[str, str, str], outcomes: list[Outcome]) -> FamilySummary:
    found = [outcome for outcome in outcomes if outcome.verdict is Verdict.RIGHT]
    bent = [o.answer for o in found if "1" in o.case.pattern]
    verdicts = [outcome.verdict for outcome in outcomes]
    return FamilySummary(
        *names,
        n_cases=len(outcomes),
        verdicts={verdict: verdicts.count(verdict) for verdict in Verdict},
        n_failures=sum(outcome.is_failure for outcome in outcomes),
        residual=_worst(outcome.answer.residual for outcome in found),
        residual_over_floor=_worst(answer.residual / answer.residual_floor for answer in bent),
        condition=_worst(outcome.answer.condition for outcome in found),
        true_tip_error=_worst(outcome.true_tip_error for outcome in found),
        iterations=_worst(outcome.answer.iterations for outcome in found),
        true_threshold_error=_worst(outcome.true_threshold_error for outcome in found),
        true_force_error=_worst(outcome.true_force_error for outcome in found),
    )


def _worst(values: Iterable[float]) -> float:
    return max((value for value in values if not np.isnan(value)), default=np.nan)
