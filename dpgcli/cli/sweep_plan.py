"""The plan of a sweep, as `dpg explain` prints it."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from dpgcli.cli.spelling import with_options
from dpgcli.text import counted

if TYPE_CHECKING:
    from dpgcli.studies.plan import SweepPlan
    from dpgcli.sweeps.space import Axis

MOST_KEYS = 12  # of an axis, in text


def facts(plan: "SweepPlan") -> dict[str, Any]:
    """The plan as plain values, units in the names."""
    from dpgcli.files.scene_file import canonical

    sweep = plan.sweep
    return {
        "base": str(sweep.base_path),
        "axes": [
            {
                "n_values": len(axis),
                "keys": [
                    {"key": key, "least": canonical(least), "most": canonical(most)}
                    for key, (least, most) in _spans(axis)
                ],
            }
            for axis in sweep.space.axes
        ],
        "constraints": [rule.text for rule in sweep.constraints],
        "n_designs": plan.n_designs,
        "n_excluded": plan.n_excluded,
        "n_invalid": plan.n_invalid,
        "n_states": plan.n_states,
        "most_units": plan.most_units,
        "expected_seconds": plan.expected_seconds,
        "expected_disk_bytes": plan.expected_disk_bytes,
        "expected_memory_bytes": plan.expected_memory_bytes,
        "trust": [trust.record for trust in plan.trusts],
        "warnings": [*plan.warnings],
        "refused": with_options(plan.refusal) or None,
        "files": [str(path) for path in sweep.files],
    }


def lines(name: str, plan: "SweepPlan") -> list[str]:
    """The plan in words."""
    from dpgcli.cli.trust import trust_lines

    sweep = plan.sweep
    rules = [rule.text for rule in sweep.constraints]
    return [
        f"{name}: a sweep around {sweep.base_path}",
        "",
        "Axes",
        *(f"  {line}" for axis in sweep.space.axes for line in _axis(axis)),
        *(["", "Constraints", *(f"  {rule}" for rule in rules)] if rules else []),
        "",
        "What to trust",
        *(f"  {line}" for line in trust_lines(plan.trusts, plan.warnings)),
        "",
        "Work",
        *(f"  {line}" for line in _work(plan)),
    ]


def _spans(axis: "Axis") -> Iterator[tuple[str, tuple[float, float]]]:
    """The least and the largest value of each key."""
    for key, values in axis.values.items():
        yield key, (values.min().item(), values.max().item())


def _axis(axis: "Axis") -> Iterator[str]:
    """A line for each key; those of one axis vary together."""
    together = "" if len(axis.values) == 1 else f", {len(axis.values)} keys together"
    for place, (key, (least, most)) in enumerate(_spans(axis)):
        if place == MOST_KEYS:
            yield f"and {len(axis.values) - place} more keys (--format json lists all)"
            return
        span = f"{least:g}" if least == most else f"{least:g} … {most:g}"
        yield f"{key:<44} {span}, {counted(len(axis), 'value')}{together}"


def _work(plan: "SweepPlan") -> Iterator[str]:
    """Designs, states and cost; what is refused says so last."""
    from dpgcli.sweeps.extent import size_text, time_text

    yield f"designs  {plan.n_designs:,}{_looked_at(plan)}"
    at_most = "" if plan.n_excluded is not None else "at most "
    yield f"states   {at_most}{plan.n_states:,}; the longest finger has " + counted(
        plan.most_units, "unit"
    )
    yield (
        f"cost     about {time_text(plan.expected_seconds)} of one core, "
        f"{size_text(plan.expected_disk_bytes)} of disk, "
        f"{size_text(plan.expected_memory_bytes)} of memory (rough: a factor of two either way)"
    )
    if plan.refusal:
        yield f"refused  by dpg sweep: {with_options(plan.refusal)}"


def _looked_at(plan: "SweepPlan") -> str:
    if plan.n_excluded is None or plan.n_invalid is None:
        return ", too many to hold each against the rules before the work"
    n_solved = plan.n_designs - plan.n_excluded - plan.n_invalid
    excluded = f", {plan.n_excluded:,} excluded by constraints" if plan.sweep.constraints else ""
    return f": {n_solved:,} to solve{excluded}, {plan.n_invalid:,} that cannot exist"
