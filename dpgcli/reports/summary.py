"""The summary of a design space: sections of text and tables, which `page` renders.

Same table, same sections: what differs between runs is in run.json alone.
"""

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from dpgcli.arrays import Array, Flags, Indices, distinct
from dpgcli.design.dimensions import LINEAR_STIFFNESS
from dpgcli.design.scene import Origin
from dpgcli.files.trust import trusts_in, warnings_in
from dpgcli.reports.base import bar_stiffness, base_lines
from dpgcli.reports.space import DesignSpace
from dpgcli.sweeps.gate import failed_searches, ranking_doubts

METRICS = {  # whether the largest value is the best one, or else the one nearest zero
    "workspace_area_mm2": True,
    "n_distinct_tips": True,
    "reach_max_mm": True,
    "reach_min_mm": False,
    "stiffness_min_N_per_mm": True,
    "stiffness_max_N_per_mm": True,
    "min_barrier_mJ": True,
    "aperture_max_mm": True,
    "aperture_min_mm": False,
    "n_grasps": True,
    "squeeze_max_N": True,
    "payload_max_N": True,
    "n_reachable": True,
    "snap_pressure_max_MPa": False,
    "reset_pressure_min_MPa": False,
    "smallest_threshold_gap_MPa": True,
}
SHORT_HEAD = ("metric", "best", "of design (best)", "worst", "of design (worst)")
N_UNITS = "n_units"
STIFFEST = "stiffness_max_N_per_mm"
ERRORS = ("max_residual_N", "max_numerical_error_mm")
STATUSES = ("stable", "partly_stable", "invalid", "excluded", "failed")
BOUNDARY_STATUSES = ("stable", "partly_stable", "invalid")
WITHOUT_REASON = {
    "excluded": "a constraint is not met",
    "partly_stable": "some patterns have no certified state; states.parquet says why",
}
RELATIVE_EQUALITY = 1e-9  # relative
MOST_ROWS = 30
BARS_ALONE = 0.01  # relative: how close to k_L/n a stiffness shows nothing but the bars
NUMBER = re.compile(r"-?\d+(\.\d+)?(e[-+]?\d+)?")


class PageTable(NamedTuple):
    """Cells of text under a head."""

    head: Sequence[str]
    rows: Sequence[Sequence[str]]


class PageSection(NamedTuple):
    """Paragraphs and tables under a title."""

    title: str
    blocks: Sequence[str | PageTable]


def sections(space: DesignSpace) -> list[PageSection]:
    """All sections about a space, the best designs first."""
    lines = [_extent(space), *filter(None, [space.left_out]), *base_lines(space.metadata)]
    counted = PageSection("Design space", lines)
    if not len(space):
        return [counted]
    return [
        counted,
        PageSection("Best and worst designs", _extremes(space)),
        *_trust(space),
        PageSection("Designs by status and calibration", [_counts(space)]),
        PageSection("What failed and why", _failures(space)),
        PageSection("Where bistability ends", _bistability(space)),
        PageSection("Largest numerical error", _errors(space)),
    ]


def _extent(space: DesignSpace) -> str:
    if not len(space):
        return "0 designs."
    rows = np.arange(len(space))
    spans = [
        f"{name} ({space.span(name, rows)}, {space.n_values(name, rows):,} values)"
        for name in space.swept
    ]
    return f"{len(space):,} designs{' over ' * bool(spans)}{', '.join(spans)}."


def _counts(space: DesignSpace) -> PageTable:
    columns = (space.designs[name].tolist() for name in ("status", "calibration"))
    counts = Counter(zip(*columns, strict=True))
    found = {kind for _, kind in counts}
    kinds = [kind for kind in (*(origin.value for origin in Origin), "") if kind in found]
    head = ["status", "designs", *(kind or "not solved" for kind in kinds)]
    totals = {s: sum(n for (of, _), n in counts.items() if of == s) for s in STATUSES}
    rows = [
        [status, *(f"{n:,}" for n in (total, *(counts[status, kind] for kind in kinds)))]
        for status, total in totals.items()
        if total
    ]
    return PageTable(head, rows)


class Extreme(NamedTuple):
    """The best or the worst of a metric: which of both, the row, and how many more are alike."""

    metric: str
    word: str
    row: int
    n_more: int


def extremes(space: DesignSpace) -> list[Extreme]:
    """Best and worst designs by metric."""
    metrics = {name: order for name, order in METRICS.items() if name in space.designs}
    return [found for name, order in metrics.items() for found in _extremes_of(space, name, order)]


def _extremes_of(space: DesignSpace, name: str, is_largest_best: bool) -> Iterator[Extreme]:
    rows = space.known(name, space.usable)
    if name == STIFFEST:
        rows = rows[~bars_alone(space, rows)]
    if not len(rows):
        return
    values = space.designs[name][rows]
    merit = values if is_largest_best else -np.abs(values)
    ends = {"best": merit.max(), "worst": merit.min()}
    if is_alike(merit):
        ends = {"all alike": merit.max()}
    for word, end in ends.items():
        first, *others = rows[_are_close(merit, end, RELATIVE_EQUALITY)]
        yield Extreme(name, word, int(first), len(others))


def bars_alone(space: DesignSpace, rows: Indices) -> Flags:
    """Rows whose largest stiffness is that of the straight finger's bars in series, k_L/n.

    It says what was assumed of the bars, and nothing of the design. None where the table lacks the
    number of units.
    """
    bars = space.designs.get(LINEAR_STIFFNESS)
    stiffness = bar_stiffness(space.metadata) if bars is None else bars[rows]
    n_units = space.designs[N_UNITS][rows] if N_UNITS in space.designs else np.nan
    in_series = stiffness / n_units
    return _are_close(space.designs[STIFFEST][rows], in_series, BARS_ALONE)


def in_short(space: DesignSpace) -> tuple[str, PageTable]:
    """How many designs there are of each status, and the best and the worst of each metric."""
    counts = {status: len(space.of_status(status)) for status in STATUSES}
    listed = ", ".join(f"{n:,} {status}" for status, n in counts.items() if n)
    rows: dict[str, list[str]] = {}
    for name, _, row, n_more in extremes(space):
        more = f" and {n_more:,} more" if n_more else ""
        cells = (space.shown(name, space.designs[name][row]), space.number(row) + more)
        rows.setdefault(name, [name]).extend(cells)
    filled = [[*cells, "all alike", ""][: len(SHORT_HEAD)] for cells in rows.values()]
    return f"{len(space):,} designs: {listed or 'none'}", PageTable(SHORT_HEAD, filled)


def _extremes(space: DesignSpace) -> list[str | PageTable]:
    rows = []
    for name, word, row, n_more in extremes(space):
        more = f" and {n_more:,} more" if n_more else ""
        value = space.shown(name, space.designs[name][row])
        rows.append([name, word, value, space.number(row) + more, *space.point(row)])
    small = [name for name, largest in METRICS.items() if not largest and name in space.designs]
    text = "The largest value counts as best"
    text += f", of {' and '.join(small)} the one nearest zero." if small else "."
    return [
        text,
        *_left_out(space),
        *(f"Warning: {doubt}." for doubt in doubts(space)),
        *_unknown(space, ranked_metrics(space)),
        PageTable(["metric", "", "value", "design", *space.swept], rows),
    ]


def doubts(space: DesignSpace) -> list[str]:
    """Why designs should not be ranked by some of the metrics, in a line for each reason."""
    return ranking_doubts(ranked_metrics(space), space.trusts)


def ranked_metrics(space: DesignSpace) -> list[str]:
    """The metrics by which designs are ranked."""
    return [*dict.fromkeys(extreme.metric for extreme in extremes(space))]


def surely_ranked(columns: Iterable[str]) -> list[str]:
    """The same of a table with these columns, before it is made.

    Whether a largest stiffness shows more than bars is not known before.
    """
    found = {*columns} - {STIFFEST}
    return [name for name in METRICS if name in found]


def _trust(space: DesignSpace) -> Iterator[PageSection]:
    """What outputs rest on, and the warnings of calibrations; nothing where no table says so."""
    known = trusts_in(space.metadata).values()
    if not known:
        return
    rows = [[t.output.value, t.basis_text, t.known_error, t.source] for t in known]
    table = PageTable(["output", "basis", "known error", "from"], rows)
    warnings = [f"Warning: {warning}." for warning in warnings_in(space.metadata)]
    yield PageSection("What to trust", [table, *warnings])


def _left_out(space: DesignSpace) -> Iterator[str]:
    """What is not ranked, since it only shows an assumption."""
    rows = space.known(STIFFEST, space.usable) if STIFFEST in space.designs else np.zeros(0, int)
    if len(rows) and N_UNITS not in space.designs:
        yield (
            f"{STIFFEST} may be that of the straight finger's bars, k_L/n: the table has no "
            f"numbers {N_UNITS} to tell by."
        )
    if len(rows) and (n_alone := int(bars_alone(space, rows).sum())):
        which = "any design" if n_alone == len(rows) else f"{n_alone:,} designs"
        yield (
            f"{STIFFEST} is not ranked for {which}: it is that of the straight finger's bars, "
            "k_L/n, whose stiffness is assumed unless it was measured."
        )


def is_alike(values: Any) -> bool:
    """Whether values differ by no more than rounding."""
    return bool(_are_close(values.max(), values.min(), RELATIVE_EQUALITY))


def _are_close(values: Any, others: Any, relative: float) -> Flags:
    """Which values differ relatively little from others; 1e308 and -1e308 do not, in silence."""
    with np.errstate(over="ignore"):
        return np.asarray(np.isclose(values, others, rtol=relative, atol=0))


def varies(space: DesignSpace, name: str) -> bool:
    """Whether a column tells designs apart that have states, by more than an assumption."""
    known = space.known(name, space.usable)
    if name == STIFFEST:
        known = known[~bars_alone(space, known)]
    return len(known) > 0 and not is_alike(space.designs[name][known])


def _failures(space: DesignSpace) -> list[str | PageTable]:
    """Designs that are not stable, grouped by reason; reasons that differ in numbers are one."""
    others, unknown = space.of_status(*STATUSES[1:]), [*_unknown(space, space.designs)]
    if not len(others):
        return ["Every design is stable.", *unknown]
    statuses, reasons = (space.designs[name] for name in ("status", "reason"))
    groups: dict[tuple[str, str], list[int]] = {}
    for row in others.tolist():
        groups.setdefault((statuses[row], NUMBER.sub("#", reasons[row])), []).append(row)
    rows = []
    for found in sorted(groups.values(), key=lambda found: (-len(found), found[0])):
        count, row = len(found), found[0]
        status, reason = statuses[row], reasons[row]
        why = reason or WITHOUT_REASON.get(status, "")
        rows.append([status, f"{count:,}", why, space.number(row), *space.point(row)])
    head = ["status", "designs", "reason, as of the example", "example", *space.swept]
    return [*shortened(PageTable(head, rows[:MOST_ROWS]), len(rows)), *unknown]


def _unknown(space: DesignSpace, names: Iterable[str]) -> Iterator[str]:
    """Where searches failed, of the columns with these names."""
    return (f"Warning: {line}." for line in failed_searches(space.designs, {*names}))


def _bistability(space: DesignSpace) -> list[str | PageTable]:
    judged = space.of_status(*BOUNDARY_STATUSES)
    by_status = {status: space.of_status(status) for status in BOUNDARY_STATUSES}
    found = [status for status, rows in by_status.items() if len(rows)]
    if found == ["stable"]:
        return ["Nowhere in this space: every design in it is stable."]
    if "stable" not in found:
        return ["No design in this space is stable."]
    rows = [
        [name, *(space.span(name, by_status[status]) for status in found)] for name in space.swept
    ]
    return [PageTable(["range of", *found], rows), *_boundary(space, judged)]


def _boundary(space: DesignSpace, judged: Indices) -> list[str | PageTable]:
    """Runs of stable designs along one swept value, for each value of the other."""
    if not 1 <= len(space.swept) <= 2:
        return []
    *fixed, along = sorted(space.swept, key=lambda name: space.n_values(name, judged))
    if fixed and space.n_values(fixed[0], judged) > MOST_ROWS:
        return []
    values = space.designs[along]
    rows = []
    for line in _lines(space, fixed[0], judged) if fixed else [judged]:
        line = line[np.argsort(values[line], kind="stable")]
        at = [space.span(name, line) for name in fixed]
        runs = list(_stable_runs(values[line], space.designs["status"][line] == "stable"))
        rows += [
            [*at, *("–" if value is None else space.shown(along, value) for value in run)]
            for run in runs or [(None, None, None, None)]
        ]
    head = [*fixed, "not stable up to", "stable from", "stable to", "not stable from"]
    text = f"Along {along}; – where the space ends first or nothing is stable."
    return [text, *shortened(PageTable(head, rows[:MOST_ROWS]), len(rows))]


def _lines(space: DesignSpace, name: str, rows: Indices) -> Iterator[Indices]:
    """Those of the rows that share a value of a column, value by value."""
    rows = space.known(name, rows)
    values = space.designs[name][rows]
    return (rows[values == value] for value in distinct(values))


def _stable_runs(values: Array, is_stable: Flags) -> Iterator[tuple[float | None, ...]]:
    """The value before each run of stable ones, its first and last, and the value behind it."""
    ends = np.flatnonzero(np.diff(is_stable.astype(int), prepend=0, append=0))
    padded = [None, *values.tolist(), None]
    for start, stop in ends.reshape(-1, 2).tolist():
        yield padded[start], padded[start + 1], padded[stop], padded[stop + 1]


def _errors(space: DesignSpace) -> list[str | PageTable]:
    rows = []
    for name in ERRORS:
        known = space.known(name, space.usable) if name in space.designs else ()
        if len(known):
            values = space.designs[name]
            row = known[np.argmax(values[known])]
            value = space.shown(name, values[row])
            rows.append([name, value, space.number(row), *space.point(row)])
    return (
        [PageTable(["", "value", "design", *space.swept], rows)] if rows else ["No design has any."]
    )


def shortened(table: PageTable, n_rows: int) -> list[str | PageTable]:
    """A table, and a line that counts the rows left out."""
    n_more = n_rows - len(table.rows)
    return [table, f"And {n_more:,} more."] if n_more else [table]
