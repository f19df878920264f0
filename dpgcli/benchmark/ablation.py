"""Ablations: restore one simplification of a plan; measure its cost and its effect on tips."""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from dpgcli.design.scene import Scene
from dpgcli.errors import Field, UsageError
from dpgcli.mechanics.finger import SHARED
from dpgcli.states.plan import Plan, Request, explain
from dpgcli.states.predict import predict

STIFF_BAR_RATIO = 1e3  # of k_L over the stiffest spring: elastic bars that stand for rigid ones
MOST_STATES = 2**20  # states, 100 MB each time
STATES_ONLY = Request(columns=("states",))


class Trial(NamedTuple):
    """A scene and a request, predicted `times` times."""

    scene: Scene
    request: Request
    times: int = 1


class Ablation(NamedTuple):
    """A repeatable prediction, the change of its tips (mm) and the bound on that change (mm)."""

    name: str
    run: Callable[[], object]
    n_states: int
    change: float
    bound: float


def check_ablation(scene: Scene, name: str, target_error: float | None) -> tuple[Plan, Trial]:
    """The plan, and the trial that restores a simplification by its name.

    Raises UsageError for a name that is none of `ABLATIONS`, or that the scene does not leave out.
    """
    if name not in ABLATIONS:
        raise UsageError(Field("keep"), f" {name}: expected {', '.join(ABLATIONS)}")
    plan = explain(scene, replace(STATES_ONLY, target_error=target_error))
    if plan.n_states > MOST_STATES:
        raise UsageError(
            Field("keep"),
            f": all {plan.n_states:,} states would be held twice, {MOST_STATES:,} may be: "
            "take fewer units",
        )
    kept = ABLATIONS[name](plan)
    if kept is None:
        others = ", ".join(other for other in ABLATIONS if ABLATIONS[other](plan) is not None)
        raise UsageError(Field("keep"), f" {name}: this scene leaves out {others}")
    return plan, kept


def ablations(scene: Scene, name: str, target_error: float | None) -> tuple[Ablation, Ablation]:
    """The prediction as planned, for the target error (mm) if any, and with one part restored.

    Raises UsageError as `check_ablation` does.
    """
    plan, kept = check_ablation(scene, name, target_error)
    planned = Trial(scene, _request(plan))
    rows, other = (predict(v.scene, v.request).arrays() for v in (planned, kept))
    both = (rows["status"] == "stable") & (other["status"] == "stable")
    moved = np.hypot(*(rows[key] - other[key] for key in ("tip_x_mm", "tip_y_mm")))
    bound = (rows["numerical_error_mm"] + other["numerical_error_mm"])[both].max(initial=0.0)
    if name == "bars" and scene.finger.is_rigid:
        bound += plan.bar_flexibility
    return (
        Ablation(f"{name} left out", _runner(planned), plan.n_states, 0.0, 0.0),
        Ablation(
            f"{name} put back",
            _runner(kept),
            plan.n_states,
            float(moved[both].max(initial=0.0)),
            float(bound),
        ),
    )


def _runner(variant: Trial) -> Callable[[], object]:
    def run() -> None:
        for _ in range(variant.times):
            for _ in predict(variant.scene, variant.request).blocks():
                pass

    return run


def _request(plan: Plan) -> Request:
    """The request that plans answer here: tips and certificates, for the target error."""
    return replace(STATES_ONLY, target_error=plan.request.target_error)


def _with_elastic_bars(plan: Plan) -> Trial | None:
    """Bars that were dropped; rigid ones as springs a thousand times as stiff as the domes."""
    scene, finger = plan.scene, plan.scene.finger
    if plan.accuracy_level is not None and plan.accuracy_level.drops_bars:
        return Trial(scene, STATES_ONLY)
    if not finger.is_rigid:
        return None
    stiffness = STIFF_BAR_RATIO * float(finger.bistable_stiffness.max())
    return Trial(replace(scene, finger=finger.with_bars(stiffness)), STATES_ONLY)


def _with_hinges(plan: Plan) -> Trial | None:
    """Hinges whose stiffness is zero, as terms of the smallest stiffness there is."""
    scene, finger = plan.scene, plan.scene.finger
    if finger.hinge_stiffness.any():
        return None
    smallest = np.full_like(finger.hinge_stiffness, np.finfo(float).tiny)
    changed = finger.changed(hinge_stiffness=smallest)
    return Trial(replace(scene, finger=changed), _request(plan))


def _with_every_unit(plan: Plan) -> Trial | None:
    """Equal units, each solved for itself."""
    scene, finger = plan.scene, plan.scene.finger
    if plan.n_unit_solves == finger.n_units:
        return None
    arrays = {
        name: values if name in SHARED else np.repeat(values, finger.n_units // len(values), axis=0)
        for name, values in finger.arrays().items()
    }
    return Trial(replace(scene, finger=finger.changed(**arrays)), _request(plan))


def _with_whole_fingers(plan: Plan) -> Trial | None:
    """Every pattern solved as a whole, instead of as a pair of half-fingers."""
    if plan.split is None:
        return None
    return Trial(plan.scene, replace(_request(plan), patterns=("*",)))


def _with_second_finger(plan: Plan) -> Trial | None:
    """A gripper's other finger, solved instead of mirrored."""
    if plan.scene.gripper is None:
        return None
    return Trial(plan.scene, _request(plan), times=2)


def _with_every_column(plan: Plan) -> Trial | None:
    """All that is known of a state, instead of tips and certificates alone."""
    return Trial(plan.scene, replace(_request(plan), columns=("all",)))


ABLATIONS: dict[str, Callable[[Plan], Trial | None]] = {
    "bars": _with_elastic_bars,
    "hinges": _with_hinges,
    "every-unit": _with_every_unit,
    "whole-fingers": _with_whole_fingers,
    "second-finger": _with_second_finger,
    "every-column": _with_every_column,
}
