"""Answers to hard cases, and what they are worth."""

from dataclasses import field
from enum import StrEnum

import numpy as np

from dpgcli.arrays import Array, Flags
from dpgcli.hard_cases.cases import Case
from dpgcli.records import dataclass
from dpgcli.states.certify import Status


class Verdict(StrEnum):
    """Assessment of the solver's answer to a case by extended precision.

    Of a way under pressure the answer is a threshold instead of a state: where the state ends that
    the finger was followed in.

    - right: called stable, and it is, with an error within the stated one
    - recognized: a minimum that is not the pattern's, and not called stable
    - no such state: not called stable, and extended precision finds no such state either
    - marginal: refused as marginal; it is a minimum, but its curvature nearly vanishes
    - missed: not called stable, though extended precision finds the state
    - overconfident: called stable, and it is, but its error exceeds the stated one
    - wrong: called stable, but it is not
    """

    RIGHT = "right"
    RECOGNIZED = "recognized"
    NO_SUCH_STATE = "no such state"
    MARGINAL = "marginal"
    MISSED = "missed"
    OVERCONFIDENT = "overconfident"
    WRONG = "wrong"


@dataclass(frozen=True)
class Threshold:
    """Where a finger stopped under pressure: at a fold, or at the end of the range.

    `pushes` (N) are those of the pressures on the domes and `walls` (mm) what they make walls
    yield, (unit,); `unit` is the one that loses its balance and `tied` (unit,) others that do so
    within `actuation.pressed.TIE`.
    """

    is_fold: bool
    pushes: Array
    walls: Array
    unit: int
    tied: Flags


@dataclass(frozen=True)
class Touch:
    """What a finger against a body is said to feel: pushes (contact,) N, in the reference's order.

    `walls` (unit,) mm are what they make walls yield, and the body has `yielded` by so much, mm.
    Between two fingers it has `moved` (3,) along x and y, mm, and turned, rad.
    """

    push: Array
    walls: Array
    yielded: float = 0.0
    moved: Array = field(default_factory=lambda: np.zeros(3))


@dataclass(frozen=True)
class Answer:
    """The solver's answer to a case, with lengths in mm.

    `nodes` (4 n, 1) in mm and `pose` (3,), tip x, y (mm) and angle (rad), are those at the end of
    the search, whatever its status; `tip_error` (mm) and `angle_error` (rad) are the errors that
    the solver states; `residual` and `residual_floor` in N.
    """

    status: Status
    reached: Flags
    nodes: Array
    pose: Array
    tip_error: float
    angle_error: float
    residual: float
    residual_floor: float
    condition: float
    iterations: int
    threshold: Threshold | None = None
    touch: Touch | None = None


@dataclass(frozen=True)
class Outcome:
    """An answer with its verdict and its true errors (mm, rad), NaN without a true state.

    That of a threshold is relative to it, that of pushes in N.
    """

    case: Case
    answer: Answer
    verdict: Verdict
    true_tip_error: float
    true_angle_error: float
    true_threshold_error: float = np.nan
    true_force_error: float = np.nan

    @property
    def is_failure(self) -> bool:
        """Whether the command fails; a missed state counts for the chain's own guess only."""
        is_default = self.case.formulation == "chain" and self.case.has_own_guess
        return self.verdict in _ALWAYS_FAIL or (self.verdict is Verdict.MISSED and is_default)


_ALWAYS_FAIL = (Verdict.WRONG, Verdict.OVERCONFIDENT)
