"""Two fingers and what is between them in hard cases, judged by extended precision.

A state is right as one of a finger against a body is, see `contacts`: pushes on the body and
between the fingers, tips, and the place of a body that moves.
"""

from collections.abc import Iterator

import numpy as np

from dpgcli.arrays import Array
from dpgcli.design.bodies import Body as SolverBody
from dpgcli.design.bodies import Disc, Polygon
from dpgcli.design.scene import Gripper, Held, Scene
from dpgcli.grasping.table import Grasps, grasps
from dpgcli.hard_cases.cases import Case
from dpgcli.hard_cases.outcomes import Answer, Outcome, Touch, Verdict
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.terms import chain_potential
from dpgcli.reference.bodies import RoundBody
from dpgcli.reference.gripper import ExtendedGrip, Grip, depth, extended_grip
from dpgcli.states.accuracy import DEFAULT_TOLERANCE
from dpgcli.states.certify import Status
from dpgcli.states.patterns import codes_of, inverted_units
from dpgcli.states.settle import settle
from dpgcli.states.units import UnitSolutions

DEEPEST = 1e-9  # mm: penetration
STATED_ERROR = 1e-9  # of a push, in N and as a share of the largest, and of a body's place in mm
STAGES, STEP = 8, 0.8  # in which a body grows; mm, by which bases come together at most
FAR = 4.0  # lengths of a finger: bases that far apart keep fingers from each other
HELD = (Held.FIXED, Held.GUIDED, Held.FREE, Held.FREE)  # by the number of motions


def answered(case: Case) -> Answer:
    """What the solver says of a case's two fingers."""
    found = gripped(case)
    taken = [found.take(finger, 0) for finger in range(2)]
    n_units = case.variant.finger.n_units
    status = Status(max(own.status[lane] for own, lane in taken))
    after = np.array([own.after[lane] for own, lane in taken])
    reached = inverted_units(after, n_units).T.reshape(-1, 1)
    if status is Status.STABLE and (reached != case.inverted).any():
        status = Status.ANOTHER_PATTERN
    nodes = np.stack([np.stack(own.nodes, axis=1)[..., lane].ravel() for own, lane in taken])
    return Answer(
        status=status,
        reached=reached,
        nodes=nodes.reshape(-1, 1),
        pose=_tips(nodes),
        tip_error=max(float(own.error[lane]) for own, lane in taken),
        angle_error=np.nan,
        residual=max(float(own.residual[lane]) for own, lane in taken),
        residual_floor=np.nan,
        condition=np.nan,
        iterations=0,
        touch=Touch(np.concatenate(_pushes(found)), np.zeros(0), moved=_moved(found)),
    )


def gripped(case: Case) -> Grasps:
    """The two fingers of a case by the solver."""
    grip, finger = _grip(case), case.variant.finger
    body = _grown_as(grip)
    held = HELD[grip.n_motions]
    gripper = Gripper(grip.spacing, 0.0)
    scene = Scene(finger, (), gripper, grip.thickness, body=body, held=held)
    pair = [codes_of(part[:, None]) for part in case.inverted[:, 0].reshape(2, -1)]
    return grasps(scene, chain_potential, body, pair)


def _grip(case: Case) -> Grip:
    assert case.variant.grip is not None, "a case with two fingers"
    return case.variant.grip


def _grown_as(grip: Grip) -> SolverBody | None:
    """The body of the solver, whose place is the center of its area."""
    if grip.body is None:
        return None
    if isinstance(grip.body, RoundBody):
        return Disc(np.array(grip.body.center), grip.body.radius)
    corners = np.array(grip.body.corners).T
    there = Polygon(np.zeros(2), corners)
    return Polygon(there.middle, corners - there.middle[:, None])


def _tips(nodes: Array) -> Array:
    """Tips of both fingers, x and y of each, in their own frames."""
    return nodes[:, -4:-2].ravel()


def _pushes(found: Grasps) -> list[Array]:
    """Pushes of the upper and of the lower finger on the body, and between them, sorted, N."""
    parts, between = [], np.zeros(0)
    for finger in range(2):
        own, lane = found.take(finger, 0)
        parts.append(own.push[:, lane])
        if own.between is not None:
            between = own.between.push[:, lane]
    if found.body is None:
        parts, between = [np.zeros(0), np.zeros(0)], parts[0]
    return [np.sort(push[push > 0.0]) for push in (*parts, between)]


def _moved(found: Grasps) -> Array:
    """How far the body has moved, mm, and turned, rad."""
    if found.body is None:
        return np.zeros(3)
    by = found.centers[:, 0] - found.body.center
    return np.append(by, np.broadcast_to(found.turned, 1))


def judged(case: Case, answer: Answer) -> Outcome:
    """The verdict on an answer of two fingers, and the true errors."""
    if answer.status is not Status.STABLE:
        return Outcome(case, answer, _refusal(case, answer), np.nan, np.nan)
    truth = _next_to(case, answer)
    if truth is None or not _is_right(case, answer, truth):
        return Outcome(case, answer, Verdict.WRONG, np.nan, np.nan)
    touch = answer.touch
    assert touch is not None, "an answer of contact"
    off = (truth.pose[:, :2].ravel() - answer.pose).astype(float).reshape(2, 2)
    tip_error = float(np.hypot(*off.T).max())
    pushed = (np.concatenate(truth.push) - touch.push).astype(float)
    force_error = float(np.abs(pushed).max(initial=0.0))
    stated = STATED_ERROR * max(1.0, float(touch.push.max(initial=0.0)))
    is_exact = tip_error <= answer.tip_error and force_error <= stated
    is_exact &= bool(np.abs(truth.moved - touch.moved).max() <= STATED_ERROR)
    verdict = Verdict.RIGHT if is_exact else Verdict.OVERCONFIDENT
    return Outcome(case, answer, verdict, tip_error, np.nan, true_force_error=force_error)


def _next_to(case: Case, answer: Answer) -> ExtendedGrip | None:
    """The equilibrium in extended precision next to an answer, in the pattern that it is in."""
    assert answer.touch is not None, "an answer of contact"
    if not np.isfinite(answer.nodes).all() or not np.isfinite(answer.touch.moved).all():
        return None
    pattern, nodes = answer.reached.reshape(2, -1), answer.nodes.reshape(2, -1)
    return extended_grip(case.variant.finger, pattern, _grip(case), nodes, answer.touch.moved)


def _is_right(case: Case, answer: Answer, truth: ExtendedGrip) -> bool:
    """Whether an answer is the state that is next to it, without penetration."""
    assert answer.touch is not None, "an answer of contact"
    nodes = answer.nodes.reshape(2, -1)
    deep = depth(case.variant.finger, _grip(case), nodes, answer.touch.moved)
    is_state = truth.is_minimum and truth.in_pattern
    n_pushes = sum(map(len, truth.push))
    return is_state and n_pushes == len(answer.touch.push) and deep <= DEEPEST


def _refusal(case: Case, answer: Answer) -> Verdict:
    """The verdict on an answer that is not stable in its patterns: was there a state to find?"""
    if _is_held(case):
        return Verdict.MISSED
    if answer.status is not Status.ANOTHER_PATTERN:
        return Verdict.NO_SUCH_STATE
    truth = _next_to(case, answer)
    is_state = truth is not None and _is_right(case, answer, truth)
    return Verdict.RECOGNIZED if is_state else Verdict.WRONG


def _is_held(case: Case) -> bool:
    """Whether the reference keeps the patterns on a way of its own.

    The body grows with the bases far apart, these come together, and the body is let go of.
    """
    finger, pattern = case.variant.finger, case.inverted.reshape(2, -1)
    free = settle(UnitSolutions.of(finger), chain_potential, pattern.T, DEFAULT_TOLERANCE)
    stations = free.potential.coordinates.stations(free.equilibrium.coordinates)
    nodes = np.stack(stations, axis=1).reshape(-1, 2).T
    moved, walls = np.zeros(3), None
    for grip, apart in _stages(finger, _grip(case), nodes):
        found = extended_grip(finger, pattern, grip, nodes, moved, walls, apart)
        if found is None or not (found.is_minimum and found.in_pattern):
            return False
        nodes, moved, walls = found.nodes, found.moved, found.walls
    return True


def _stages(finger: Finger, grip: Grip, nodes: Array) -> Iterator[tuple[Grip, float]]:
    """What is between fingers that are free first, and by how much their bases are apart, mm."""
    still, far = grip.with_motions(0), FAR * float(finger.straight_length[0])
    shares = np.arange(STAGES)[::-1] / STAGES
    if grip.body is not None:
        deep = depth(finger, still, nodes, np.zeros(3), far)
        yield from ((still.smaller(share * deep), far) for share in shares)
    lowest = np.minimum(nodes[:, 1::2].min(axis=1), 0.0) - grip.thickness
    met = max(0.0, -float(lowest.sum()) - grip.spacing)
    n = max(STAGES, int(np.ceil(met / STEP)))
    yield from ((still, share * met) for share in np.arange(n)[::-1] / n)
    if grip.n_motions:
        yield grip, 0.0
