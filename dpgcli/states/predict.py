"""Carry out a plan: every state asked for, certified, as blocks of columns."""

from collections.abc import Iterator, Mapping
from dataclasses import field, replace
from time import perf_counter, process_time

import numpy as np

from dpgcli.arrays import Codes, Columns, Flags, keep_freed_memory
from dpgcli.design.scene import Scene
from dpgcli.records import dataclass
from dpgcli.states.certify import Status
from dpgcli.states.patterns import chunks, codes_of, inverted_units
from dpgcli.states.plan import Plan, Request, explain
from dpgcli.states.quantities import LEAST, MISSED, rows
from dpgcli.states.rows import as_text, solved_rows
from dpgcli.states.settle import lanes_at_once


@dataclass(frozen=True)
class Breakdown:
    """The largest standard uncertainty of a tip's place (mm), the state's pattern, its causes."""

    total: float
    pattern: str
    shares: Mapping[str, float]


@dataclass(frozen=True)
class LeastRobust:
    """The smallest barrier of all states, mJ, its pattern and its unit, or units where they tie.

    `n_states` have as small a one, that of `pattern` among them.
    """

    barrier: float
    pattern: str
    unit: str
    n_states: int = 1


@dataclass
class Summary:
    """Summary of the states solved so far; errors and residuals are the largest of stable states.

    Residual in N, tip error in mm, times in seconds spent on the states alone. `breakdown` is of
    the least certain state, by the columns of `shares`, if there are any; `least_robust` and the
    number of saddles that were not found where barriers are asked for.
    """

    n_finger_solves: int = 0
    statuses: dict[Status, int] = field(default_factory=lambda: dict.fromkeys(Status, 0))
    residual: float = 0.0
    tip_error: float = 0.0
    seconds: float = 0.0
    cpu_seconds: float = 0.0
    shares: Mapping[str, str] = field(default_factory=dict)
    breakdown: Breakdown | None = None
    least_robust: LeastRobust | None = None
    n_saddles_not_found: int = 0

    @property
    def n_states(self) -> int:
        return sum(self.statuses.values())

    def add(self, block: Columns) -> None:
        """Count a block's rows in."""
        for status, count in enumerate(np.bincount(block["status"], minlength=len(Status))):
            self.statuses[Status(status)] += int(count)
        stable = block["status"] == Status.STABLE
        if stable.any():
            self.residual = max(self.residual, float(block["residual_N"][stable].max()))
            self.tip_error = max(self.tip_error, float(block["numerical_error_mm"][stable].max()))
            self._break_down(block, stable)
        if MISSED.name in block:
            self._add_barriers(block)

    def _add_barriers(self, block: Columns) -> None:
        self.n_saddles_not_found += int(block[MISSED.name].sum())
        barriers, units = (block[column.name] for column in LEAST)
        if np.isnan(barriers).all():
            return
        from dpgcli.states.barriers import TIE

        ties = barriers <= (1.0 + TIE) * np.nanmin(barriers)
        place = int(ties.argmax())  # the first pattern: which is less by rounding says nothing
        known = self.least_robust
        if known is None or (1.0 + TIE) * barriers[place] < known.barrier:
            pattern = block["pattern"][place].decode()
            unit, n_states = str(units[place]), int(ties.sum())
            self.least_robust = LeastRobust(float(barriers[place]), pattern, unit, n_states)
        elif barriers[place] <= (1.0 + TIE) * known.barrier:
            self.least_robust = replace(known, n_states=known.n_states + int(ties.sum()))

    def _break_down(self, block: Columns, stable: Flags) -> None:
        if not self.shares:
            return
        parts = np.stack([block[column] for column in self.shares.values()])
        totals = np.where(stable, np.sqrt((parts**2).sum(axis=0)), -1.0)
        worst = int(totals.argmax())
        if self.breakdown is None or totals[worst] > self.breakdown.total:
            own = dict(zip(self.shares, parts[:, worst].tolist(), strict=True))
            pattern = block["pattern"][worst].decode()
            self.breakdown = Breakdown(float(totals[worst]), pattern, own)


@dataclass(frozen=True)
class Prediction:
    """A plan, and the rows it gives block by block."""

    plan: Plan
    summary: Summary

    def blocks(self) -> Iterator[Columns]:
        """Columns by name, a block of states at a time; counts in `summary` as it goes."""
        keep_freed_memory()
        names = [column.name for column in self.plan.columns]
        solved = _blocks(self.plan, self.summary)
        while True:
            wall, cpu = perf_counter(), process_time()
            block = next(solved, None)
            self.summary.seconds += perf_counter() - wall
            self.summary.cpu_seconds += process_time() - cpu
            if block is None:
                return
            self.summary.add(block)
            yield {name: block[name] for name in names}

    def arrays(self) -> Columns:
        """All rows at once, patterns and statuses as text, as `pandas.DataFrame` takes them."""
        blocks = list(self.blocks())
        columns = {c: np.concatenate([b[c.name] for b in blocks]) for c in self.plan.columns}
        return {column.name: as_text(column, values) for column, values in columns.items()}


def predict(scene: Scene, request: Request | None = None) -> Prediction:
    """Plan the stable states of a scene; iterating over the result's blocks solves them.

    Raises UsageError and NothingSelectedError. What happens to a state is its row's status.

    >>> from dpgcli.mechanics.finger import uniform_finger
    >>> finger = uniform_finger(
    ...     3, segment_length=13.5, segment_height=10.75, stroke=3.5,
    ...     bistable_stiffness=12.84, force_linearity=0.043, hinge_stiffness=24.2,
    ...     linear_stiffness=1e4)
    >>> rows = predict(Scene(finger, sources=())).arrays()
    >>> rows["pattern"][5], rows["status"][5], rows["tip_x_mm"][5].round(8)
    (np.str_('101'), np.str_('stable'), np.float64(38.35981703))
    """
    plan = explain(scene, request)
    shares = {cause: column.name for cause, column in plan.shares.items()}
    return Prediction(plan, Summary(shares=shares))


def _blocks(plan: Plan, summary: Summary) -> Iterator[Columns]:
    if plan.split is None:
        for codes in _batches(plan):
            yield _solved(plan, codes, summary)
        return
    from dpgcli.states.pairs.compose import paired_states

    summary.n_finger_solves += plan.split.n_solves
    for states in paired_states(plan.split):
        states = replace(states, tip_error=states.tip_error + plan.dropped_error)
        columns = rows(states, plan.quantities)
        unfit = np.flatnonzero(states.status == Status.NOT_CONVERGED)
        if len(unfit):  # a pair that did not fit is solved as a whole
            solved = _solved(plan, codes_of(states.inverted[:, unfit]), summary)
            for name, values in columns.items():
                columns[name] = values.copy()
                columns[name][unfit] = solved[name]
        yield columns


def _batches(plan: Plan) -> Iterator[Codes]:
    size = lanes_at_once(plan.n_units)
    if plan.selection is None:
        yield from chunks(plan.n_states, size)
        return
    for first in range(0, plan.n_states, size):
        yield plan.selection.codes(first, min(first + size, plan.n_states))


def _solved(plan: Plan, codes: Codes, summary: Summary) -> Columns:
    """Rows of the states with these codes, each solved as a whole finger."""
    summary.n_finger_solves += len(codes)
    return solved_rows(plan.units, inverted_units(codes, plan.n_units), plan.rows)
