"""Rows chosen among those of a table: by conditions, then in an order or on a Pareto front."""

from collections.abc import Collection, Iterator, Sequence
from functools import cached_property, reduce

import numpy as np

from dpgcli.arrays import Array, Columns, Flags, Indices
from dpgcli.design.outputs import doubts_about
from dpgcli.errors import Field, Message, UsageError
from dpgcli.records import dataclass
from dpgcli.sweeps.comparisons import conjuncts
from dpgcli.sweeps.expressions import Expression
from dpgcli.sweeps.fronts import on_front
from dpgcli.sweeps.gate import (
    Trusts,
    counts_of,
    doubts,
    failed_searches,
    failed_searches_of,
    have_values,
    holds,
    requirement,
    unknown_column,
)
from dpgcli.text import counted, printable

WHERE = "where"
FEW = 2  # conditions, of which each is the only other one


@dataclass(frozen=True)
class Question:
    """What rows are chosen by: conditions that all have to hold, objectives, and how many.

    Two objectives or more ask for the Pareto front. `top` is None for all that are left.
    """

    conditions: tuple[Expression, ...] = ()
    minimize: tuple[str, ...] = ()
    maximize: tuple[str, ...] = ()
    top: int | None = None

    @property
    def objectives(self) -> tuple[str, ...]:
        """The columns that are to be small or large, in the order in which they count."""
        return (*self.minimize, *self.maximize)

    @property
    def names(self) -> tuple[str, ...]:
        """All columns that it asks for, in the order in which it names them."""
        conditions = (name for rule in self.conditions for name in sorted(rule.names))
        return tuple(dict.fromkeys((*self.objectives, *conditions)))

    @property
    def record(self) -> dict[str, object]:
        """What it asks, for metadata."""
        conditions = [rule.text for rule in self.conditions]
        objectives = {"minimize": [*self.minimize], "maximize": [*self.maximize]}
        return {"where": conditions, **objectives, "top": self.top}

    @property
    def is_front(self) -> bool:
        """Whether it asks for a Pareto front."""
        return len(self.objectives) > 1


def question(
    where: Sequence[str],
    minimize: Sequence[str],
    maximize: Sequence[str],
    top: int | None,
    numbers: Collection[str],
) -> Question:
    """A question in words to a table with these columns of numbers; raises UsageError."""
    rules = [requirement(text, numbers, WHERE) for text in where]
    conditions = tuple(part for rule in rules for part in conjuncts(rule))
    for field, names in (("minimize", minimize), ("maximize", maximize)):
        for name in names:
            if name not in numbers:
                raise UsageError(Field(field), f" {name}: {unknown_column(name, numbers)}")
    objectives = [*minimize, *maximize]
    if twice := [name for name in objectives if objectives.count(name) > 1]:
        raise UsageError(f"{twice[0]}: expected one objective once")
    if top is not None and top < 1:
        raise UsageError(Field("top"), f" {top}: expected a whole number from 1 on")
    return Question(conditions, tuple(minimize), tuple(maximize), top)


@dataclass(frozen=True)
class Selection:
    """What a question chose from the usable rows of a table, and what became of the others.

    `met` is (condition, row), `valued` (objective, row), both of usable rows alone. `places` are
    the rows that are chosen, in their order; `n_best` of them are there without the `top`.
    """

    question: Question
    met: Flags
    valued: Flags
    known: Flags
    places: Indices
    n_best: int

    @cached_property
    def n_meeting(self) -> int:
        """How many usable rows meet all conditions."""
        return int(self.met.all(axis=0).sum())

    def lines(self, what: str) -> Iterator[str]:
        """How many rows met each condition, and what was left, in words; `what` is a row."""
        n_usable, n_conditions = self.met.shape[1], len(self.met)
        n_met = self.met.sum(axis=0)
        for rule, met, known in zip(self.question.conditions, self.met, self.known, strict=True):
            others = int((n_met - met == n_conditions - 1).sum())
            said = f"{printable(rule.text)}: met by {met.sum():,} of {counted(n_usable, what)}"
            alone = f"; all others by {others:,}" if n_conditions > FEW else ""
            yield f"{said}{_unknown(int((~known).sum()))}{alone}"
        if n_conditions > 1:
            yield f"all of them: met by {counted(self.n_meeting, what)}"
        for name, valued in zip(self.question.objectives, self.valued, strict=True):
            if n := int((~valued & self.met.all(axis=0)).sum()):
                yield f"{name}: {counted(n, what)} left out without a value"
        if self.question.is_front and self.n_best:
            yield f"Pareto front: {counted(self.n_best, what)}{_of_front(self)}"


def _unknown(n: int) -> str:
    return f" ({n:,} without a value)" if n else ""


def _of_front(found: Selection) -> str:
    if len(found.places) == found.n_best:
        return ""
    name = found.question.objectives[0]
    return f"; the first {len(found.places):,} of them by {name}"


def selected(columns: Columns, is_usable: Flags, asked: Question) -> Selection:
    """Answer a question about rows with these columns, of which some are usable.

    A condition does not hold where a value is missing, and what misses the value of an objective
    is not chosen. Rows go by the first objective, then by the next, and last by their place.
    """
    usable = np.flatnonzero(is_usable)
    names = (*asked.names, *counts_of(asked.names, columns))
    own = {name: columns[name][usable] for name in names} | {"": usable}
    n_rows = len(usable)
    met = [holds(rule, own) for rule in asked.conditions]
    known = [have_values(own, rule.names) for rule in asked.conditions]
    valued = [have_values(own, [name]) for name in asked.objectives]
    is_left = reduce(np.logical_and, [*met, *valued], np.ones(n_rows, bool))
    left = np.flatnonzero(is_left)
    values = _objectives(own, asked, left)
    if asked.is_front:
        front = on_front(values)
        left, values = left[front], values[front]
    order = np.lexsort((left, *values.T[::-1]))
    return Selection(
        asked,
        _stacked(met, n_rows),
        _stacked(valued, n_rows),
        _stacked(known, n_rows),
        usable[left[order][: asked.top]],
        len(left),
    )


def _objectives(columns: Columns, asked: Question, rows: Indices) -> Array:
    """Values of objectives, (row, objective), the least ones best."""
    small = [columns[name][rows] * 1.0 for name in asked.minimize]
    large = [columns[name][rows] * -1.0 for name in asked.maximize]
    return np.array([*small, *large]).reshape(len(asked.objectives), len(rows)).T


def _stacked(flags: Sequence[Flags], n_rows: int) -> Flags:
    return np.array([*flags], bool).reshape(len(flags), n_rows)


def warnings_of(asked: Question, columns: Columns, trusts: Trusts) -> tuple[Message | str, ...]:
    """Why nothing should be chosen by some of the columns, in a line for each reason."""
    named: list[Message | str] = []
    for rule in asked.conditions:
        named += [*doubts(rule, trusts, WHERE), *failed_searches_of(rule, columns, WHERE)]
    for field, names in (("minimize", asked.minimize), ("maximize", asked.maximize)):
        found = doubts_about({name: trusts.get(name, ()) for name in names})
        found += failed_searches(columns, names)
        named += [Message(Field(field), f": {why}") for why in found]
    return tuple(dict.fromkeys(named))


def check_undoubted(trusts: Trusts, warnings: Sequence[str]) -> None:
    """Raise UsageError where there are warnings, or a table does not say what it rests on."""
    if not trusts:
        where = " needs a table that says what its columns rest on, as dpg sweep writes it"
        raise UsageError(Field("strict"), where)
    if warnings:
        lines = (part for warning in warnings for part in ("\n", warning))
        raise UsageError(Field("strict"), " allows no choice by what is doubted:", *lines)
