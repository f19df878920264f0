"""The plan of a search, as `dpg explain` prints it."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from dpgcli.text import counted

if TYPE_CHECKING:
    from dpgcli.search.goal import Target
    from dpgcli.search.plan import GoalPlan

SLOPES = {
    "exact": "exact slopes",
    "differences": "slopes by central differences",
    "none": "no slopes: it changes in steps",
}
MOST_VALUES = 8  # of a list, in text


def facts(plan: "GoalPlan") -> dict[str, Any]:
    """The plan as plain values, units in the names."""
    from dpgcli.files.scene_file import canonical

    goal = plan.goal
    return {
        "base": plan.base,
        "lists": {key: canonical([*values]) for key, values in goal.lists.items()},
        "ranges": {each.key: [each.low, each.high] for each in goal.ranges},
        "targets": [
            {
                "pattern": target.pattern or None,
                "quantity": target.quantity,
                "value": [*target.values],
                "tolerance": target.tolerance,
            }
            for target in goal.targets
        ],
        "constraints": [rule.text for rule in goal.constraints],
        "objectives": {each.name: _aim(each.is_maximized) for each in goal.objectives},
        "n_combinations": plan.n_choices,
        "are_all_tried": plan.are_all_tried,
        "n_starts_each": plan.n_starts,
        "most_states": plan.most_states,
        "slopes": {**plan.slopes},
        "trust": [trust.record for trust in plan.trusts],
        "warnings": [*plan.warnings],
    }


def lines(name: str, plan: "GoalPlan") -> list[str]:
    """The plan in words."""
    from dpgcli.cli.trust import trust_lines

    return [
        f"{name}: a goal around {plan.base}",
        "",
        "Varies",
        *(f"  {line}" for line in _varies(plan)),
        "",
        "Asked",
        *(f"  {line}" for line in _asked(plan)),
        "",
        "Search",
        *(f"  {line}" for line in _search(plan)),
        "",
        "What to trust",
        *(f"  {line}" for line in trust_lines(plan.trusts, plan.warnings)),
    ]


def _aim(is_maximized: bool) -> str:
    return "maximize" if is_maximized else "minimize"


def _varies(plan: "GoalPlan") -> Iterator[str]:
    for key, values in plan.goal.lists.items():
        shown = ", ".join(f"{value:g}" for value in values[:MOST_VALUES])
        more = f" and {len(values) - MOST_VALUES} more" if len(values) > MOST_VALUES else ""
        yield f"{key:<44} {shown}{more}"
    for each in plan.goal.ranges:
        yield f"{each.key:<44} {each.low:g} … {each.high:g}"


def _asked(plan: "GoalPlan") -> Iterator[str]:
    goal = plan.goal
    for number, target in enumerate(goal.targets, start=1):
        yield f"target {number}     {target.text}: {_wanted(target)}"
    for rule in goal.constraints:
        yield f"constraint   {rule.text}"
    for each in goal.objectives:
        yield f"{_aim(each.is_maximized):<12} {each.name}"
    for name, way in plan.slopes.items():
        yield f"{name}: {SLOPES[way]}"


def _wanted(target: "Target") -> str:
    from dpgcli.states.columns import REACHABLE

    if target.quantity == REACHABLE.name:
        return "yes" if target.values[0] else "no"
    return f"{', '.join(f'{value:g}' for value in target.values)} ± {target.tolerance:g}"


def _search(plan: "GoalPlan") -> Iterator[str]:
    starts = counted(plan.n_starts, "start")
    if not plan.are_all_tried:
        yield (
            f"{plan.n_choices:,} combinations of listed values, too many to try each: a population "
            "finds the best of them, from which searches begin"
        )
    elif plan.n_choices > 1:
        each = counted(plan.n_choices, "combination")
        yield f"{each} of listed values, {starts} each, without limits"
    else:
        yield f"{starts}, without limits"
    if plan.most_states:
        yield f"{counted(plan.most_states, 'state')} of a design at most, as targets match them"
    if plan.goal.has_maps:
        yield "and all states of the designs that constraints and objectives are about"
