"""`explain`: what a spec, a sweep or a goal will come to, before any work."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from dpgcli.api.given import any_input
from dpgcli.api.inputs import SceneInput, Settings, SpecInput
from dpgcli.api.predict import request_of
from dpgcli.errors import Field, UsageError
from dpgcli.files.goal_file import GoalFile
from dpgcli.states import plan
from dpgcli.states.accuracy import check_exactness
from dpgcli.states.plan import Plan, Request

if TYPE_CHECKING:
    from dpgcli.files.sweep_file import Sweep
    from dpgcli.search.plan import GoalPlan
    from dpgcli.studies.plan import SweepPlan

COLUMNS, FORMULATION = ("default",), "chain"


def explain(
    spec: SpecInput,
    *,
    settings: Settings = (),
    patterns: str | Sequence[str] = (),
    columns: str | Sequence[str] = COLUMNS,
    formulation: str = FORMULATION,
    tolerance: float | None = None,
    target_error: float | None = None,
) -> "Plan | SweepPlan | GoalPlan":
    """Decide what `predict` would do, and leave out, and why; arguments and errors are the same.

    Of a sweep, its file or its data: how many designs and states it has, and what they take. Of a
    goal how it will be searched for. Raises UsageError for patterns, columns or a formulation
    beside a sweep or a goal.

    >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
    >>> plan = explain(uniform_finger(5, **STUDY))
    >>> plan.n_states, plan.terms, plan.omissions[2].why.partition(";")[0]
    (32, ('bistable', 'hinge'), 'k_L is infinite')
    >>> lattice = {"segment_length_mm": 13.5, "segment_height_mm": 10.75, "stroke_mm": 3.5,
    ...            "bistable_stiffness_N_per_mm": 12.84, "force_linearity": 0.043,
    ...            "hinge_stiffness_N_mm_per_rad": 24.2}
    >>> space = [{"key": "finger.units", "values": [2, 3, 0]}]
    >>> wide = explain({"base": {"finger": {"units": 2, "lattice": lattice}}, "space": space})
    >>> wide.n_designs, wide.n_invalid, wide.n_states
    (3, 1, 12)
    """
    given = any_input(spec, settings)
    request = request_of(patterns, columns, formulation, tolerance, target_error)
    return plan_of(given, request)


def plan_of(
    given: "SceneInput | Sweep | GoalFile", request: Request
) -> "Plan | SweepPlan | GoalPlan":
    """The plan of a spec, a sweep or a goal that was read."""
    if isinstance(given, SceneInput):
        return plan.explain(given.scene, request)
    if request.patterns or request.columns != COLUMNS or request.formulation != FORMULATION:
        words = (Field("patterns"), ", ", Field("columns"), " and ", Field("formulation"))
        what = " are for specs: sweeps and goals have states and columns of their own"
        raise UsageError(*words, what)
    if isinstance(given, GoalFile):
        from dpgcli.files.scene_file import scene_of
        from dpgcli.search.plan import GoalPlan

        scene = scene_of(given.base)
        return GoalPlan(given.goal, str(given.said["base"]), scene.trusts, scene.warnings)
    from dpgcli.studies.plan import plan_of_sweep
    from dpgcli.studies.sweep import Study

    check_exactness(request.tolerance, request.target_error)
    return plan_of_sweep(Study(given, Path(), request.tolerance, request.target_error))
