"""Requirements on a table of designs: thresholds that every design has to meet."""

from collections.abc import Collection, Container, Iterable, Mapping, Sequence
from difflib import get_close_matches
from itertools import compress, product

import numpy as np

from dpgcli.arrays import Columns, Flags, Indices
from dpgcli.design.outputs import Trust, doubts_about
from dpgcli.errors import Field, Message, NothingSelectedError, UsageError
from dpgcli.records import dataclass
from dpgcli.sweeps.comparisons import conjuncts, ends_tell
from dpgcli.sweeps.expressions import Expression, ExpressionError, expression
from dpgcli.sweeps.metrics import (
    METRICS,
    UNKNOWN_DIRECTIONS,
    UNKNOWN_GRASPS,
    UNKNOWN_STATES,
    Metric,
)
from dpgcli.text import counted, printable

BOUNDS = {metric.name: metric for metric in METRICS if metric.unknown}
MEANINGS = {
    UNKNOWN_DIRECTIONS: "more states may be reached there",
    UNKNOWN_STATES: "there may be more states there, and values beyond those found",
    UNKNOWN_GRASPS: "more states may touch the body there, with larger forces",
}


@dataclass(frozen=True)
class Failure:
    """A design that fails a requirement, with the values found in it."""

    design: int
    values: dict[str, float]
    found: dict[str, float]
    status: str
    reason: str

    def __str__(self) -> str:
        reason = " ".join(self.reason.split())
        why = f"{self.status}: {reason}" if reason else _listed(self.found)
        said = f"design {self.design} ({_listed(self.values)}): {why}"
        return printable(said)  # in one line, whatever the table holds


Trusts = Mapping[str, Sequence[Trust]]
"""What the outputs that a column shows rest on, by column; empty where a table does not say it."""


@dataclass(frozen=True)
class RequirementVerdict:
    """One requirement held against the designs; `rows` are those that fail it.

    `warnings` say which of its columns rest on what no design should be judged by.
    """

    designs: Columns
    requirement: Expression
    n_checked: int
    rows: Indices
    warnings: tuple[str, ...] = ()

    @property
    def is_met(self) -> bool:
        return not len(self.rows)

    def __str__(self) -> str:
        if self.is_met:
            return f"met: {self._text}: all {self.n_checked:,} designs"
        return f"not met: {self._text}: {len(self.rows):,} of {self.n_checked:,} designs"

    @property
    def _text(self) -> str:
        return printable(self.requirement.text)

    @property
    def _told(self) -> set[str]:
        """Columns that say why a design fails: those that are named, and counts of the unknown."""
        failed = {metric.unknown for metric, _ in _bounds(self.designs, self.requirement.names)}
        return {*self.requirement.names, *failed}

    def failures(self, limit: int | None = None) -> list[Failure]:
        """The designs that fail, in the order of the table; at most `limit`."""
        swept = swept_names(self.designs)
        needed = [name for name in self.designs if name in self._told]
        shown = {name: column[self.rows[:limit]].tolist() for name, column in self.designs.items()}
        rows = (dict(zip(shown, row, strict=True)) for row in zip(*shown.values(), strict=True))
        return [
            Failure(
                row["design"],
                {name: row[name] for name in swept},
                {name: row[name] for name in needed},
                row["status"],
                row["reason"] or ("" if row["n_stable"] else "no stable state"),
            )
            for row in rows
        ]


def requirement(text: str, columns: Collection[str], field: str = "require") -> Expression:
    """A threshold over columns of numbers, such as `reach_max_mm > 60 and n_stable == 32`.

    Raises UsageError for what is no such threshold, with the nearest name for an unknown one.
    """
    try:
        rule = expression(text)
        for name in sorted(rule.names.difference(columns)):
            raise UsageError(Field(field), f" {text!r}: {unknown_column(name, columns)}")
        rule(dict.fromkeys(rule.names, 1.0))
    except ExpressionError as error:
        raise UsageError(Field(field), f" {text!r}: {error}") from error
    except (TypeError, ValueError, RecursionError) as error:
        raise UsageError(Field(field), f" {text!r}: cannot be evaluated") from error
    if not rule.is_comparison:
        raise UsageError(Field(field), f" {text!r}: expected a comparison, found a number")
    if not rule.names:
        raise UsageError(Field(field), f" {text!r}: expected a comparison of columns, found none")
    return rule


def unknown_column(name: str, columns: Collection[str]) -> str:
    """That there is no such column of numbers, and which is the nearest."""
    nearest = get_close_matches(name, sorted(columns), n=1, cutoff=0.0)
    return f"no column {name} of numbers; the nearest is {nearest[0]}"


def doubts(rule: Expression, trusts: Trusts, field: str = "require") -> tuple[Message, ...]:
    """Why no design should be judged by columns of a requirement, in a line for each reason."""
    found = doubts_about({name: trusts.get(name, ()) for name in sorted(rule.names)})
    return tuple(Message(Field(field), f" {rule.text!r}: {why}") for why in found)


def ranking_doubts(metrics: Iterable[str], trusts: Trusts) -> list[str]:
    """Why designs should not be ranked by some of the metrics, in a line for each reason."""
    return [f"ranking: {why}" for why in doubts_about({m: trusts.get(m, ()) for m in metrics})]


def check_beyond_doubt(
    trusts: Trusts, rules: Sequence[Expression] = (), ranked: Iterable[str] = ()
) -> None:
    """Raise UsageError for requirements on, and rankings by, what no design should be judged by.

    And for a table that does not say what its columns rest on. `ranked` are metrics.
    """
    if not trusts:
        where = " needs a table that says what its columns rest on, as dpg sweep writes it"
        raise UsageError(Field("strict"), where)
    refused: dict[str, Sequence[str]] = {
        "requirement on": [doubt for rule in rules for doubt in doubts(rule, trusts)],
        "ranking by": ranking_doubts(ranked, trusts),
    }
    lines = [
        line
        for what, found in refused.items()
        if found
        for line in (Message(Field("strict"), f" allows no {what} what is doubted:"), *found)
    ]
    if lines:
        first, *others = lines
        raise UsageError(first, *(part for line in others for part in ("\n", line)))


def number_columns(designs: Columns) -> list[str]:
    """Columns that a requirement can name."""
    return [name for name, column in designs.items() if column.dtype.kind in "biuf"]


def swept_names(designs: Columns) -> list[str]:
    """Columns of the swept values: those between the design's number and its calibration."""
    names = list(designs)
    return names[names.index("design") + 1 : names.index("calibration")]


def failing(designs: Columns, rule: Expression) -> Indices:
    """Numbers of the rows that do not meet a requirement; excluded designs are left aside.

    A design without a stable state meets none, nor does one where a value is NaN or has none. Where
    searches failed, what is not known has to meet it as well as what was found.
    """
    met = (designs["n_stable"] > 0) & holds(rule, designs)
    return np.flatnonzero(~met & _in_question(designs))


def holds(rule: Expression, columns: Columns) -> Flags:
    """In which rows a comparison holds: in none where a value is NaN, or where it has none.

    Where searches failed it holds for all that may be there: if both ends of that do not tell, it
    does not hold.
    """
    parts = [_part_holds(part, columns) for part in conjuncts(rule)]
    return np.asarray(np.logical_and.reduce(parts))


def _part_holds(rule: Expression, columns: Columns) -> Flags:
    """The same of what no `and` joins, at all ends of what is not known."""
    values = {name: columns[name] for name in rule.names}
    met = have_values(columns, rule.names)
    bounds = _bounds(columns, rule.names)
    for metric, is_open in bounds:
        if not ends_tell(rule, metric.name):
            met &= ~is_open
    for beyond in product((False, True), repeat=len(bounds)):
        ends = {
            metric.name: np.where(is_open, metric.furthest, values[metric.name])
            for metric, is_open in compress(bounds, beyond)
        }
        truth = np.asarray(rule({**values, **ends}), float)
        met &= np.isfinite(truth) & (truth != 0.0)
    return met


def have_values(columns: Columns, names: Iterable[str]) -> Flags:
    """In which rows all of these columns have a value: one that is not NaN."""
    have = np.ones(len(next(iter(columns.values()))), bool)
    for name in names:
        have &= ~np.isnan(columns[name])
    return have


def counts_of(names: Iterable[str], columns: Container[str]) -> list[str]:
    """Those of the columns that count failed searches for columns with some names."""
    counts = dict.fromkeys(BOUNDS[name].unknown for name in names if name in BOUNDS)
    return [count for count in counts if count in columns]


def _bounds(columns: Columns, names: Collection[str]) -> list[tuple[Metric, Flags]]:
    """Metrics among columns that are bounds where searches failed, and in which rows.

    Where a count has no value it is not known whether they did.
    """
    told = [BOUNDS[name] for name in sorted(names) if name in BOUNDS]
    known = [metric for metric in told if metric.unknown in columns]
    found = [(metric, ~(columns[metric.unknown] == 0)) for metric in known]
    return [(metric, is_open) for metric, is_open in found if is_open.any()]


def check_designs(
    designs: Columns, texts: Sequence[str], trusts: Trusts, *, strict: bool = False
) -> tuple[RequirementVerdict, ...]:
    """Hold every design against requirements in words; see `check_requirements`.

    Raises UsageError where it is `strict` and one of them is about what is doubted.
    """
    columns = number_columns(designs)
    rules = [requirement(text, columns) for text in texts]
    if strict and (designs["n_stable"] > 0).any():  # else there is nothing to doubt
        check_beyond_doubt(trusts, rules)
    return check_requirements(designs, rules, trusts)


def check_requirements(
    designs: Columns, requirements: Sequence[Expression], trusts: Trusts | None = None
) -> tuple[RequirementVerdict, ...]:
    """Hold every requirement against every design that is not excluded.

    Raises NothingSelectedError if none is left: an empty space meets every requirement.
    """
    n_checked = int(_in_question(designs).sum())
    if not n_checked:
        n = len(designs["status"])
        found = f"{n:,}, all of them excluded" if n else "no rows"
        raise NothingSelectedError(f"no design to check: the table has {found}")
    return tuple(
        RequirementVerdict(
            designs,
            rule,
            n_checked,
            failing(designs, rule),
            (*doubts(rule, trusts or {}), *failed_searches_of(rule, designs)),
        )
        for rule in requirements
    )


def failed_searches_of(
    rule: Expression, columns: Columns, field: str = "require"
) -> tuple[Message, ...]:
    """The same of the columns that a comparison names."""
    found = failed_searches(columns, rule.names)
    return tuple(Message(Field(field), f" {rule.text!r}: {why}") for why in found)


def failed_searches(columns: Columns, names: Collection[str]) -> list[str]:
    """What is not known of columns with these names, where searches failed: in lines."""
    found = {metric.unknown: int(is_open.sum()) for metric, is_open in _bounds(columns, names)}
    counts = dict.fromkeys(BOUNDS[name].unknown for name in sorted(names) if name in BOUNDS)
    return [
        f"searches failed or did not decide in {counted(n, 'design')} ({name}): {MEANINGS[name]}"
        for name, n in found.items()
    ] + [
        f"whether searches failed is not known: the table has no column {name}"
        for name in counts
        if name not in columns
    ]


def _in_question(designs: Columns) -> Flags:
    return np.asarray(designs["status"] != "excluded", bool)


def _listed(values: dict[str, float]) -> str:
    return ", ".join(f"{name} = {value:.8g}" for name, value in values.items())
