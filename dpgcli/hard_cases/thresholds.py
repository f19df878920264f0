"""Thresholds of pressure in hard cases: what the solver finds, judged by extended precision.

A threshold is right if the finger has its state just below and leaves it just above, and if states
were there all the way from no pressure. Pressures are given by their pushes, areas being 1 mm².
"""

import numpy as np

from dpgcli.actuation.pressed import Halt, Halted, Pressed
from dpgcli.actuation.rest import at_rest
from dpgcli.arrays import Array, Flags
from dpgcli.hard_cases.cases import Case
from dpgcli.hard_cases.outcomes import Answer, Outcome, Threshold, Verdict
from dpgcli.mechanics.pressure import DomeVolumes
from dpgcli.reference.equilibria import ExtendedStates, extended_states
from dpgcli.reference.folds import extended_fold
from dpgcli.states.certify import Settled, Status
from dpgcli.states.units import UnitSolutions

RANGE = 0.3  # of the forces in play, to which pressures go: the study's domes snap at 0.1
STATED_ERROR = 1e-10  # of a threshold,
ROUNDING = 1e-15  # and of the forces in play: measured 2e-16
BRACKET = 10.0  # stated errors, from which on both sides the finger must do as it is said to
ON_THE_WAY = (0.3, 0.7, 0.99)  # of a threshold, where there must be states
LEFT = 0.01  # of a stroke: what moves as far within the bracket has left its place
REASONS = {Halt.FAILED: Status.NOT_CONVERGED, Halt.FOLDED: Status.FOLDED}


@np.errstate(divide="ignore", invalid="ignore", over="ignore")  # of mechanisms
def answered(case: Case) -> Answer:
    """Settle a case's pattern, and follow it under pressure until something happens."""
    finger = case.variant.finger
    pressed = Pressed(UnitSolutions.of(finger), DomeVolumes(np.ones((1, 1))))
    shapes, settled = at_rest(pressed, case.inverted)
    if settled.status[0] != Status.STABLE:
        return _answer(pressed, settled, None, Status(settled.status[0]))
    end = case.variant.pressure * RANGE * finger.force_scale.max()
    halted = pressed.followed(shapes, np.full((finger.n_units, 1), end))
    status = REASONS.get(Halt(halted.reason[0]), Status.STABLE)
    return _answer(pressed, settled, halted, status)


def _answer(pressed: Pressed, settled: Settled, halted: Halted | None, status: Status) -> Answer:
    """What is known where the finger stopped, or where it began if it does not rest there."""
    coordinates = settled.potential.coordinates
    at, reached = settled.equilibrium.coordinates, settled.reached
    threshold, residual = None, float(settled.equilibrium.residual[0])
    if halted is not None:
        at, reached = halted.shapes.coordinates, halted.shapes.inverted
        residual = _residual(pressed, halted)
        threshold = Threshold(
            is_fold=bool(halted.reason[0] == Halt.FOLD),
            pushes=halted.shapes.pressure[:, 0],
            walls=(pressed.extensions(at) - coordinates.openings(at))[:, 0],
            unit=int(halted.unit[0]),
            tied=halted.tied[:, 0],
        )
    pose, _ = coordinates.tip(at)
    return Answer(
        status=status,
        reached=reached,
        nodes=np.stack(coordinates.stations(at), axis=1).reshape(-1, 1),
        pose=pose[:, 0],
        tip_error=np.nan,
        angle_error=np.nan,
        residual=residual,
        residual_floor=np.nan,
        condition=np.nan,
        iterations=int(settled.equilibrium.iterations[0]),
        threshold=threshold,
    )


def _residual(pressed: Pressed, halted: Halted) -> float:
    """The largest unbalanced force where a finger stopped, N."""
    shapes = halted.shapes
    potential = pressed.as_touching(shapes)
    gradient = potential.evaluate(shapes.coordinates).gradient
    return float(np.abs(gradient / potential.coordinates.force_unit).max())


def judged(case: Case, answer: Answer) -> Outcome:
    """The verdict on an answer that has a threshold or none, and the true errors."""
    threshold = answer.threshold
    assert threshold is not None, "a finger that was followed stopped somewhere"
    if not threshold.is_fold:
        truth = _states(case, answer, np.ones(1))
        is_there = bool(truth.is_minimum[0] and truth.in_pattern[0])
        verdict = Verdict.NO_SUCH_STATE if is_there else Verdict.MISSED
        return Outcome(case, answer, verdict, np.nan, np.nan)
    stated = stated_error(case, threshold.pushes)
    if not _brackets(case, answer, BRACKET * stated):
        return Outcome(case, answer, Verdict.WRONG, np.nan, np.nan)
    args = case.variant.finger, threshold.pushes, answer.nodes[:, 0], threshold.walls
    fold = extended_fold(*args)
    if fold is None:  # of several units at once
        return Outcome(case, answer, Verdict.RIGHT, np.nan, np.nan)
    error = abs(float(fold.share - 1.0))
    off = np.abs(fold.pose - answer.pose).astype(float)
    verdict = Verdict.RIGHT if error <= stated else Verdict.OVERCONFIDENT
    return Outcome(case, answer, verdict, float(np.hypot(off[0], off[1])), float(off[2]), error)


def stated_error(case: Case, pushes: Array) -> float:
    """The relative error that thresholds are said to have."""
    rounding = ROUNDING * case.variant.finger.force_scale.max() / np.abs(pushes).max()
    return float(STATED_ERROR + rounding)


def _brackets(case: Case, answer: Answer, width: float) -> bool:
    """Whether states are there up to the threshold, and the unit leaves its place beyond."""
    assert answer.threshold is not None
    shares = np.array([*ON_THE_WAY, 1.0 - width, 1.0 + width])
    truth = _states(case, answer, shares)
    *before, beyond = range(len(shares))
    are_there = (truth.is_minimum & truth.in_pattern)[before].all()
    opened = np.abs(truth.openings[:, beyond] - truth.openings[:, before[-1]]).astype(float)
    left = opened > LEFT * np.broadcast_to(case.variant.finger.stroke[:, 0], opened.shape)
    return bool(are_there and truth.is_minimum[beyond] and left[answer.threshold.unit])


def _states(case: Case, answer: Answer, shares: Array) -> ExtendedStates:
    """States in extended precision at shares of the pushes, next to where the finger stopped."""
    threshold = answer.threshold
    assert threshold is not None
    n = len(shares)
    inverted: Flags = np.repeat(case.inverted, n, axis=1)
    return extended_states(
        case.variant.finger,
        inverted,
        np.repeat(answer.nodes, n, axis=1),
        walls=np.repeat(threshold.walls[:, None], n, axis=1),
        pushes=threshold.pushes[:, None] * shares,
    )
