"""`dpg explain`: what a spec, a sweep or a goal comes to, before any work."""

from collections.abc import Iterator
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from dpgcli.cli.options import (
    ColumnNames,
    FormulationName,
    FormulationOption,
    Nodes,
    Patterns,
    Settings,
    TargetError,
    Tolerance,
    WithUncertainty,
    request_of,
)
from dpgcli.cli.spelling import with_options
from dpgcli.cli.streams import put, put_json
from dpgcli.text import counted

if TYPE_CHECKING:
    from dpgcli.design.scene import Source
    from dpgcli.states.plan import Plan


SpecOrSweep = Annotated[
    Path, typer.Argument(metavar="SPEC", help="YAML spec, sweep or goal; - reads standard input")
]


class PlanFormat(StrEnum):
    """How the plan is printed."""

    TEXT = "text"
    JSON = "json"


def explain(
    spec: SpecOrSweep,
    settings: Settings = None,
    patterns: Patterns = None,
    columns: ColumnNames = "default",
    nodes: Nodes = False,
    uncertainty: WithUncertainty = False,
    formulation: FormulationOption = FormulationName.CHAIN,
    tolerance: Tolerance = None,
    target_error: TargetError = None,
    printed_as: Annotated[
        PlanFormat, typer.Option("--format", help="How to print the plan")
    ] = PlanFormat.TEXT,
) -> None:
    """Say what predict, sweep or design will do, and leave out, and why."""
    from dpgcli.api.explain import plan_of
    from dpgcli.api.given import any_input
    from dpgcli.states.plan import Plan

    given = any_input(spec, settings or ())
    request = request_of(
        patterns, columns, nodes, uncertainty, formulation, tolerance, target_error
    )
    made = plan_of(given, request)
    is_json = printed_as is PlanFormat.JSON
    if isinstance(made, Plan):
        _print(facts(made) if is_json else _lines(str(spec), made))
        return
    from dpgcli.studies.plan import SweepPlan

    if isinstance(made, SweepPlan):
        from dpgcli.cli import sweep_plan

        _print(sweep_plan.facts(made) if is_json else sweep_plan.lines(str(spec), made))
    else:
        from dpgcli.cli import goal_plan

        _print(goal_plan.facts(made) if is_json else goal_plan.lines(str(spec), made))


def _print(said: dict[str, Any] | list[str]) -> None:
    """Facts as JSON, lines as they are."""
    if isinstance(said, list):
        put("\n".join(said))
        return
    import json

    put_json(json.dumps(said, indent=2) + "\n")


def facts(plan: "Plan") -> dict[str, Any]:
    """The plan as plain values, units in the names."""
    from dpgcli.files.scene_file import spelled

    return {
        "n_units": plan.n_units,
        "n_states": plan.n_states,
        "method": plan.method.value,
        "formulation": plan.request.formulation,
        "terms": list(plan.terms),
        "loads": _loads(plan),
        "pressure_lines": plan.scene.pressure and plan.scene.pressure.units_by_line,
        "unknowns_per_solve": plan.unknowns,
        "n_unit_solves": plan.n_unit_solves,
        "n_finger_solves": plan.n_finger_solves,
        "tolerance": plan.request.tolerance,
        "residual_limit_N": plan.residual_limit,
        "bar_flexibility_mm": spelled(plan.bar_flexibility),
        "accuracy_level": plan.accuracy_level and plan.accuracy_level.name,
        "error_bound_mm": spelled(plan.error_bound),
        "model_error": plan.scene.model_error.text,
        "trust": [trust.record for trust in plan.trusts],
        "warnings": [*plan.warnings],
        "uncertainty": _uncertainty_facts(plan),
        "columns": [column.name for column in plan.columns],
        "left_out": [
            {"what": o.what, "why": with_options(o.why), "keep": o.keep} for o in plan.omissions
        ],
        "expected_seconds": plan.expected_seconds,
        "expected_bytes": plan.expected_bytes,
        "sources": [
            {
                "key": s.key,
                "units": s.units,
                "value": spelled(s.value),
                "origin": s.origin,
                "rule": s.rule,
                "standard_error": s.standard_error,
            }
            for s in plan.scene.sources
        ],
    }


def _uncertainty_facts(plan: "Plan") -> dict[str, Any] | None:
    known = plan.scene.uncertainty
    if known is None:
        return None
    sizes = {step.cause: step.size for step in known.steps if step.size}
    return {"covers": known.covers, "tolerances": sizes, "model_error": known.model_error or None}


def _uncertainty(plan: "Plan") -> Iterator[str]:
    """What is known of the model's error, and what values may be off by."""
    known = plan.scene.uncertainty
    yield f"{'the model itself':<30} {plan.scene.model_error.text}"
    for step in known.steps if known else ():
        if step.size:
            yield f"{step.cause:<30} ± {step.size}, the same error in all units"
    if known is not None:
        yield f"{'counted in by --uncertainty':<30} {known.covers}"


def _lines(name: str, plan: "Plan") -> list[str]:
    from dpgcli.cli.trust import trust_lines

    return [
        f"{name}: {_what(plan)}",
        "",
        "Values",
        *(
            f"  {s.key:<30} {s.value:<10.6g} units {s.units:<6} {s.origin:<13} {s.rule}{_error(s)}"
            for s in plan.scene.sources
        ),
        "",
        "Kept",
        f"  energy terms    {', '.join(plan.terms)} ({plan.scene.finger.law.description})",
        *_load_lines(plan),
        *_pressure_lines(plan),
        f"  unknowns        {plan.unknowns} a finger, {plan.request.formulation} coordinates",
        f"  states          {plan.n_states:,} of {2**plan.n_units:,}, method: {plan.method}",
        f"  solves          {counted(plan.n_unit_solves, 'unit well')}, "
        f"{counted(plan.n_finger_solves, 'finger')}{_barriers(plan)}",
        f"  certificate     residual up to {plan.residual_limit:.1e} N "
        f"({plan.request.tolerance:g} of the forces in play), positive pivots, "
        "every unit in its own well",
        f"  columns         {_column_names(plan)}",
        "",
        "Left out",
        *(
            f"  {o.what}: {with_options(o.why)}" + (f" [{o.keep}]" if o.keep else "")
            for o in plan.omissions
        ),
        "  [names] are what dpg bench --keep puts back, to show what it costs and changes",
        "",
        "What to trust",
        *(f"  {line}" for line in trust_lines(plan.trusts, plan.warnings)),
        "",
        "Uncertainty",
        *(f"  {line}" for line in _uncertainty(plan)),
        "",
        "Error and cost",
        f"  {_bar_error(plan)}",
        f"  {_bound(plan)}",
        f"  {expected(plan)}",
    ]


def _loads(plan: "Plan") -> dict[str, Any] | None:
    """The dead loads of the finger, in its own frame; None where there are none."""
    finger = plan.scene.finger
    if not finger.is_loaded:
        return None
    return {
        "tip_force_N": [finger.tip_force_x.item(), finger.tip_force_y.item()],
        "tip_moment_N_mm": 0.0 - finger.end_moment.item(),
        "unit_weight_N": finger.unit_weight[:, 0].tolist(),
        "gravity_direction": [finger.gravity_x.item(), finger.gravity_y.item()],
    }


def _load_lines(plan: "Plan") -> Iterator[str]:
    """The dead loads that act, in the finger's frame."""
    loads = _loads(plan)
    if loads is None:
        return
    parts = []
    if any(loads["tip_force_N"]):
        parts.append("tip force ({:.4g}, {:.4g}) N".format(*loads["tip_force_N"]))
    if loads["tip_moment_N_mm"]:
        parts.append(f"couple on the end {loads['tip_moment_N_mm']:.4g} N mm")
    if any(loads["unit_weight_N"]):
        weights = "/".join(f"{weight:.4g}" for weight in loads["unit_weight_N"])
        way = "({:.4g}, {:.4g})".format(*loads["gravity_direction"])
        parts.append(f"weight of {weights} N a unit along {way}, on its chamber's middle (assumed)")
    yield f"  loads           {'; '.join(parts)}"


def _pressure_lines(plan: "Plan") -> Iterator[str]:
    """The pressure lines, if the spec has pressure."""
    from dpgcli.design.dimensions import unit_text

    if plan.scene.pressure is not None:
        lines = plan.scene.pressure.units_by_line.items()
        named = ", ".join(
            f"{line} (unit{'s' * (len(units) > 1)} {unit_text(units)})" for line, units in lines
        )
        yield f"  pressure lines  {named}"


def _barriers(plan: "Plan") -> str:
    """What is solved between states, if it is asked for."""
    from dpgcli.states.columns import Group

    is_asked = Group.BARRIERS in plan.groups
    return f", {counted(plan.n_states * plan.n_units, 'barrier')} between states" * is_asked


def expected(plan: "Plan") -> str:
    """Time and memory of the work, before it is done."""
    return (
        f"about {plan.expected_seconds:,.1f} s on one core and "
        f"{plan.expected_bytes / 2**20:,.0f} MiB (rough: a factor of two either way)"
    )


def _error(source: "Source") -> str:
    return "" if source.standard_error is None else f" (± {source.standard_error:.2g})"


def _what(plan: "Plan") -> str:
    alike = "equal" if plan.scene.finger.is_uniform else "graded"
    finger = f"finger of {counted(plan.n_units, f'{alike} unit')}"
    return (
        f"a gripper of two mirrored fingers, each a {finger}"
        if plan.scene.gripper
        else f"a {finger}"
    )


def _bar_error(plan: "Plan") -> str:
    if plan.bar_flexibility == float("inf"):
        return "how far the bars' flexibility moves the tip under the loads is not bounded"
    bound = f"the tip by less than {plan.bar_flexibility:.2g} mm"
    if plan.scene.finger.is_rigid:
        return f"bars 1000 times as stiff as the stiffest spring would move {bound}"
    return f"the bars' flexibility moves {bound}"


def _bound(plan: "Plan") -> str:
    if plan.error_bound == float("inf"):
        return "the tip's numerical error is bounded only after the work, in numerical_error_mm"
    level = (
        f"{plan.accuracy_level.name}, chosen for the target error: " if plan.accuracy_level else ""
    )
    return f"{level}the tip's numerical error will be below {plan.error_bound:.1e} mm"


def _column_names(plan: "Plan") -> str:
    shown = [c.name for c in plan.columns[:9]]
    more = len(plan.columns) - len(shown)
    return ", ".join(shown) + (f" and {more} more (--format json lists all)" if more else "")
