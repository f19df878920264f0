"""States against a body in hard cases: what the solver finds, judged by extended precision.

A state is right if the reference finds it next to the one that is called stable: an equilibrium of
the same pattern, pushed at as many places, no place pulling and none penetrated, that gives way on
no motion which its contacts leave.
"""

import numpy as np

from dpgcli.arrays import Array
from dpgcli.design.bodies import Body as SolverBody
from dpgcli.design.bodies import Disc, Jaws, Polygon
from dpgcli.design.scene import Gripper, Held
from dpgcli.grasping.frames import FingerFrame, frames
from dpgcli.grasping.grasp import described, met
from dpgcli.grasping.grasped import Grasped, Placed
from dpgcli.grasping.release import let_go, motion_of
from dpgcli.hard_cases.cases import Case
from dpgcli.hard_cases.outcomes import Answer, Outcome, Touch, Verdict
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.terms import chain_potential
from dpgcli.reference.bodies import Body, RoundBody, StraightBody
from dpgcli.reference.contact import ExtendedContact, extended_contact, penetration
from dpgcli.states.accuracy import DEFAULT_TOLERANCE
from dpgcli.states.certify import Status
from dpgcli.states.patterns import codes_of, inverted_units
from dpgcli.states.settle import settle
from dpgcli.states.units import UnitSolutions

DEEPEST = 1e-9  # mm: penetration
STATED_ERROR = 1e-9  # of a push, in N and as a share of the largest
STAGES = 8  # in which a body grows about the reference's own search


def answered(case: Case) -> Answer:
    """Let the body of a case grow about the finger in its pattern, and yield if it does."""
    finger, body = case.variant.finger, _body(case)
    if isinstance(body, StraightBody) and np.isfinite(body.stiffness):
        return _on_jaws(case, body)
    placed = _met(case, _grown_as(body), frames(None)[0])
    (found,) = described(
        placed.own, [placed.codes], placed.grown, placed.status, with_margins=False
    )
    shapes = placed.grown.shapes
    return _answer(finger.with_domes(shapes.inverted), shapes.coordinates, found)


def _met(case: Case, body: SolverBody, frame: FingerFrame) -> Placed:
    return met(
        UnitSolutions.of(case.variant.finger),
        chain_potential,
        np.array([_body(case).thickness]),
        body,
        frame,
        codes_of(case.inverted),
    )


def _on_jaws(case: Case, body: StraightBody) -> Answer:
    """Of one of two mirrored fingers about jaws, each of whose plates moves half of the way."""
    (left, low), (right, high) = (f(np.array(body.corners), axis=0) for f in (np.min, np.max))
    center = np.array([0.5 * (left + right), 0.0])
    jaws = Jaws(center, high - low, right - left, 0.5 * body.stiffness)
    seen = frames(Gripper(-(low + high), 0.0))
    parts, lane = [_met(case, jaws, frame) for frame in seen], np.zeros(1, int)
    motion = motion_of(jaws, Held.FIXED, seen)
    assert motion is not None, "jaws that give way"
    found, opened, shapes = let_go(parts, [lane, lane], motion, Held.FIXED, with_margins=False)
    n = case.variant.finger.n_units
    own = case.variant.finger.with_domes(shapes.inverted[:n])
    at = shapes.coordinates[: -len(opened)][::2]
    return _answer(own, at, found[0], -0.5 * float(opened[-1, 0]))


def _body(case: Case) -> Body:
    assert case.variant.body is not None, "a case with a body"
    return case.variant.body


def _grown_as(body: Body) -> Disc | Polygon:
    """The body of the solver."""
    if isinstance(body, RoundBody):
        return Disc(np.array(body.center), body.radius)
    corners = np.array(body.corners).T
    middle = corners.mean(axis=1)
    return Polygon(middle, corners - middle[:, None])


def _answer(finger: Finger, at: Array, found: Grasped, yielded: float = 0.0) -> Answer:
    n_units, coordinates = finger.n_units, chain_potential(finger).coordinates
    pose, _ = coordinates.tip(at)
    walls = coordinates.springs(at).extension - coordinates.openings(at)
    reached = inverted_units(found.after, n_units)
    status = Status(found.status[0])
    if status is Status.STABLE and found.after[0] != found.code[0]:
        status = Status.ANOTHER_PATTERN
    push = found.push[:, 0]
    return Answer(
        status=status,
        reached=reached,
        nodes=np.stack(found.nodes, axis=1).reshape(-1, 1),
        pose=pose[:, 0],
        tip_error=float(found.error[0]),
        angle_error=np.nan,
        residual=float(found.residual[0]),
        residual_floor=np.nan,
        condition=np.nan,
        iterations=0,
        touch=Touch(push[push > 0.0], walls[:, 0], yielded),
    )


def judged(case: Case, answer: Answer) -> Outcome:
    """The verdict on an answer with a body in the way, and the true errors."""
    if answer.status != Status.STABLE:
        return Outcome(case, answer, _refusal(case, answer), np.nan, np.nan)
    truth = _next_to(case, answer)
    if truth is None or not _is_right(case, answer, truth):
        return Outcome(case, answer, Verdict.WRONG, np.nan, np.nan)
    assert answer.touch is not None, "an answer of contact"
    off = np.abs(truth.pose - answer.pose).astype(float)
    tip_error, angle_error = float(np.hypot(off[0], off[1])), float(off[2])
    pushed = np.abs(truth.push - answer.touch.push).astype(float)
    force_error = float(pushed.max(initial=0.0))
    stated = STATED_ERROR * max(1.0, float(answer.touch.push.max(initial=0.0)))
    is_exact = tip_error <= answer.tip_error and force_error <= stated
    verdict = Verdict.RIGHT if is_exact else Verdict.OVERCONFIDENT
    return Outcome(case, answer, verdict, tip_error, angle_error, true_force_error=force_error)


def _next_to(case: Case, answer: Answer) -> ExtendedContact | None:
    """The equilibrium in extended precision next to an answer, in the pattern that it is in."""
    assert answer.touch is not None, "an answer of contact"
    return extended_contact(
        case.variant.finger,
        answer.reached[:, 0],
        _body(case),
        answer.nodes[:, 0],
        answer.touch.walls,
        answer.touch.yielded,
    )


def _is_right(case: Case, answer: Answer, truth: ExtendedContact) -> bool:
    """Whether an answer is the state that is next to it, and does not penetrate the body."""
    assert answer.touch is not None, "an answer of contact"
    height = float(case.variant.finger.segment_height[0, 0])
    body = _body(case)
    if isinstance(body, StraightBody):
        body = body.lowered(answer.touch.yielded)
    deep = penetration(body, answer.nodes[:, 0], height)
    is_state = truth.is_minimum and truth.in_pattern
    return is_state and len(truth.push) == len(answer.touch.push) and deep <= DEEPEST


def _refusal(case: Case, answer: Answer) -> Verdict:
    """The verdict on an answer that is not stable in its pattern: was there a state to find?"""
    if _is_held(case):
        return Verdict.MISSED
    if answer.status is not Status.ANOTHER_PATTERN:
        return Verdict.NO_SUCH_STATE
    truth = _next_to(case, answer)
    is_state = truth is not None and _is_right(case, answer, truth)
    return Verdict.RECOGNIZED if is_state else Verdict.WRONG


def _is_held(case: Case) -> bool:
    """Whether the reference keeps the pattern as the body grows from where it meets the finger."""
    finger, body = case.variant.finger, _body(case)
    free = settle(UnitSolutions.of(finger), chain_potential, case.inverted, DEFAULT_TOLERANCE)
    coordinates, at = free.potential.coordinates, free.equilibrium.coordinates
    nodes, yielded = np.stack(coordinates.stations(at), axis=1).reshape(-1), 0.0
    walls = (coordinates.springs(at).extension - coordinates.openings(at))[:, 0]
    deep = penetration(body, nodes, float(finger.segment_height[0, 0]))
    for left in np.arange(STAGES)[::-1] / STAGES:
        smaller = body.smaller(left * deep)
        found = extended_contact(finger, case.inverted[:, 0], smaller, nodes, walls, yielded)
        if found is None or not (found.is_minimum and found.in_pattern):
            return False
        nodes, walls, yielded = found.nodes, found.walls, found.yielded
    return True
