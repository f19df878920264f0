"""Judge the solver's answers to hard cases by extended precision.

The truth is the equilibrium that `reference` finds from the shape that the solver called stable
and, where it called none stable, from the reference's own start too.
"""

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from dpgcli.arrays import Array
from dpgcli.hard_cases import contacts, grips, thresholds
from dpgcli.hard_cases.cases import Case
from dpgcli.hard_cases.outcomes import Answer, Outcome, Verdict
from dpgcli.mechanics.coordinates import FingerPotential, Internal
from dpgcli.mechanics.finger import Finger
from dpgcli.reference.equilibria import ExtendedStates, extended_states
from dpgcli.states.accuracy import DEFAULT_TOLERANCE
from dpgcli.states.certify import Settled, Status
from dpgcli.states.guess import stroke_guess
from dpgcli.states.plan import FORMULATIONS
from dpgcli.states.settle import settle
from dpgcli.states.tip import tip
from dpgcli.states.units import UnitSolutions
from dpgcli.states.wells import inverted_wells

FOLD_DISTANCE = 1e-8  # of α: so close to the loss of bistability, errors are good to a factor of
FOLD_FACTOR = 4.0
MARGINAL_EIGENVALUE = (
    1e-6  # of a spring's stiffness: a curvature by nodes that may be called marginal
)
LARGEST_CONDITION = 1.0 / np.finfo(float).eps  # what doubles can tell from infinity


def stress(cases: Iterable[Case]) -> Iterator[Outcome]:
    """Solve cases and judge the answers, one at a time; needs mpmath.

    >>> from dpgcli.hard_cases.cases import built_in_cases
    >>> outcome = next(stress(built_in_cases(["scale"])))
    >>> outcome.case.variant.label, outcome.verdict.value, outcome.true_tip_error < 1e-12
    ('in m', 'right', True)
    """
    return (judged(case, answered(case)) for case in cases)


@np.errstate(divide="ignore", invalid="ignore", over="ignore")  # of mechanisms
def answered(case: Case) -> Answer:
    """Solve a case in its own unit of length; the answer is in mm."""
    if case.variant.pressure:
        return thresholds.answered(case)
    if case.variant.grip is not None:
        return grips.answered(case)
    if case.variant.body is not None:
        return contacts.answered(case)
    scale = case.variant.scale
    units = UnitSolutions.of(scaled(case.variant.finger, scale))
    settled = _settled(case, units)
    equilibrium = settled.equilibrium
    at_tip = tip(settled, with_compliance=False)
    stations = settled.potential.coordinates.stations(equilibrium.coordinates)
    floor, condition = _numerics(settled.potential, equilibrium.coordinates)
    return Answer(
        status=Status(settled.status[0]),
        reached=settled.reached,
        nodes=np.stack(stations, axis=1).reshape(-1, 1) / scale,
        pose=at_tip.pose[:, 0] / np.array([scale, scale, 1.0]),
        tip_error=float(at_tip.error[0]) / scale,
        angle_error=float(at_tip.angle_error[0]),
        residual=float(equilibrium.residual[0]),
        residual_floor=floor,
        condition=condition,
        iterations=int(equilibrium.iterations[0]),
    )


def scaled(finger: Finger, scale: float) -> Finger:
    """The finger with lengths in another unit; forces stay in N.

    `scale` is the number of these units in a mm, such as 1e-3 for meters.

    >>> from dpgcli.hard_cases.cases import study_finger
    >>> float(scaled(study_finger(), 1e-3).segment_length[0, 0])  # m
    0.0135
    """
    lengths = ("segment_length", "segment_height", "stroke", "hinge_stiffness", "hinge_coupling")
    arrays = finger.arrays()
    changes = {name: arrays[name] * scale for name in lengths}
    changes |= {name: arrays[name] / scale for name in ("bistable_stiffness", "linear_stiffness")}
    changes["wall_compliance"] = arrays["wall_compliance"] * scale
    changes["end_moment"] = finger.end_moment * scale
    return finger.changed(**changes)


def _settled(case: Case, units: UnitSolutions) -> Settled:
    """Solve from the case's start: its corner angles, its strokes, or the solver's own guess."""
    begin, shape = case.variant.start, None
    if begin.corners is not None:
        rest = np.zeros((1, 1))
        near, far = (np.full((1, 1), angle) for angle in begin.corners)
        shape = Internal(rest, near, far, rest)
    elif begin.strokes is not None:
        shape = stroke_guess(units.finger, case.inverted, begin.strokes)
    formulate = FORMULATIONS[case.formulation]
    return settle(units, formulate, case.inverted, DEFAULT_TOLERANCE, start=shape)


def _numerics(potential: FingerPotential, coordinates: Array) -> tuple[float, float]:
    """The residual's rounding floor (N) and the condition of the Hessian H.

    Each coordinate q is stored to within ε/2 of itself, and evaluating as much again: ε |H| |q|.
    The condition, in the 2-norm, is that of H scaled to a unit diagonal: of what no choice of
    units for the coordinates can mend (van der Sluis 1969, to a factor of their number).
    """
    hessian = dense(potential.evaluate(coordinates).hessian)
    if not np.isfinite(hessian).all():
        return np.nan, np.inf
    rounding = np.abs(hessian) @ np.abs(coordinates) / potential.coordinates.force_unit
    own = np.sqrt(np.abs(np.diag(hessian)))
    own[own == 0.0] = 1.0
    condition = float(np.linalg.cond(hessian / own / own[:, None]))
    return float(np.finfo(float).eps * rounding.max()), min(condition, LARGEST_CONDITION)


def dense(band: Array) -> Array:
    """The full matrix of a band of one lane."""
    size = band.shape[1]
    full = np.zeros((size, size))
    for depth in range(min(len(band), size)):
        columns = np.arange(size - depth)
        entries = band[depth, : size - depth, 0]
        full[columns + depth, columns] = full[columns, columns + depth] = entries
    return full


def judged(case: Case, answer: Answer) -> Outcome:
    """The answer's verdict and true errors by extended precision."""
    if case.variant.grip is not None:
        return grips.judged(case, answer)
    if case.variant.body is not None:
        return contacts.judged(case, answer)
    if answer.status != Status.STABLE:
        return Outcome(case, answer, _refusal(case, answer), np.nan, np.nan)
    if case.variant.pressure:
        return thresholds.judged(case, answer)
    truth = _next_to(case, answer)
    off = np.abs(truth.pose[:, 0] - answer.pose)
    tip_error, angle_error = float(np.hypot(off[0], off[1])), float(off[2])
    allowed = FOLD_FACTOR * answer.tip_error if _is_at_fold(case) else answer.tip_error
    if not _is_state(truth):
        verdict = Verdict.WRONG
    else:
        verdict = Verdict.RIGHT if tip_error <= allowed else Verdict.OVERCONFIDENT
    return Outcome(case, answer, verdict, tip_error, angle_error)


def _next_to(case: Case, answer: Answer) -> ExtendedStates:
    """The equilibrium in extended precision next to the end of the solver's search."""
    return extended_states(case.variant.finger, case.inverted, answer.nodes)


def _is_state(truth: ExtendedStates) -> bool:
    return bool(truth.is_minimum[0] and truth.in_pattern[0])


def _refusal(case: Case, answer: Answer) -> Verdict:
    """The verdict on an answer that is not stable: was there a state to find?"""
    if case.variant.start.corners is not None:
        truth = _next_to(case, answer)
        if truth.is_minimum[0] and not truth.in_pattern[0]:
            return Verdict.RECOGNIZED
        return Verdict.MISSED if _is_state(truth) else Verdict.NO_SUCH_STATE
    truth = extended_states(case.variant.finger, case.inverted)
    if answer.status in (Status.MARGINAL, Status.NOT_CONVERGED) and not _is_state(truth):
        truth = _next_to(case, answer)
    if not _is_state(truth):
        return Verdict.NO_SUCH_STATE
    is_faint = (
        truth.min_eigenvalue[0] < MARGINAL_EIGENVALUE * case.variant.finger.bistable_stiffness.max()
    )
    is_marginal = answer.status is Status.MARGINAL and is_faint
    return Verdict.MARGINAL if is_marginal else Verdict.MISSED


def _is_at_fold(case: Case) -> bool:
    """Whether α is within 1e-8 of an inverted unit's loss of bistability with rigid bars."""
    finger = case.variant.finger
    below, above = (
        inverted_wells(replace(finger, force_linearity=finger.force_linearity + by)).exists
        for by in (-FOLD_DISTANCE, FOLD_DISTANCE)
    )
    return bool(((below != above) & case.inverted).any())
