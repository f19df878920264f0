"""`landscape`: the energy along the path of least barriers between two states."""

import re
from collections.abc import Iterator, Sequence
from functools import cached_property
from itertools import pairwise
from math import prod
from pathlib import Path

from dpgcli.api.arguments import as_texts, check_texts, figure_path, path_of, table_path
from dpgcli.api.inputs import SceneInput, Settings, SpecInput, scene_input
from dpgcli.api.tables import Table, TableResult
from dpgcli.arrays import Columns, keep_freed_memory
from dpgcli.design.outputs import Output
from dpgcli.errors import Field, UsageError
from dpgcli.mechanics.terms import chain_potential
from dpgcli.records import dataclass
from dpgcli.states.accuracy import DEFAULT_TOLERANCE
from dpgcli.states.certify import Status
from dpgcli.states.columns import Column
from dpgcli.states.landscape import BarrierGraph, Landscape
from dpgcli.states.landscape_table import COLUMNS, landscape_rows
from dpgcli.states.least_barriers import BestWay, best_way
from dpgcli.states.units import UnitSolutions
from dpgcli.text import counted

MOST_UNITS = 12  # seconds of work


@dataclass(frozen=True)
class LandscapeResult(TableResult):
    """States and saddles on the path of least barriers, and the energy between them.

    `graph` has all states and barriers, `landscape` those on the path from `start` over `via` to
    `end`; `n_ways` paths are as good.
    """

    given: SceneInput
    graph: BarrierGraph
    landscape: Landscape
    n_ways: int
    start: str
    end: str
    via: tuple[str, ...]

    @property
    def columns(self) -> tuple[Column, ...]:
        """The columns of states and saddles."""
        return COLUMNS

    @cached_property
    def rows(self) -> Columns:
        """States and saddles by column, in the order of the path."""
        return landscape_rows(self.landscape)

    @cached_property
    def table(self) -> Table:
        """A row for each state, and for each saddle between two."""
        return Table.of(self.columns, self.rows)

    @property
    def summary(self) -> tuple[str, ...]:
        """The largest barrier, ties, what was not found, what barriers rest on: lines."""
        return tuple(self._lines())

    def _lines(self) -> Iterator[str]:
        barrier, flips = self.landscape.barrier, self.landscape.flips
        if len(barrier):
            largest = int(barrier.argmax())
            before = self.rows["pattern"][2 * largest]
            yield (
                f"{counted(len(barrier), 'flip')}, each over a certified saddle; largest barrier "
                f"{barrier[largest]:.5g} mJ (unit {flips.unit[largest] + 1} in {before}), "
                f"together {barrier.sum():.5g} mJ"
            )
        if self.n_ways > 1:
            yield (
                f"{self.n_ways:,} paths are as good within a millionth: the model does not say "
                "which is taken; this one flips the units nearest to the base first"
            )
        if n_missed := int(self.graph.barriers.n_not_found.sum()):
            missed = counted(n_missed, "barrier")
            yield f"{missed} not found: paths over them were not looked at"
        scene = self.given.scene
        for trust in scene.trusts:
            if trust.output is Output.BARRIERS:
                yield f"barriers: {trust.basis_text}, {trust.source}; error {trust.known_error}"
        yield from (f"warning: {warning}" for warning in scene.warnings)

    def save(self, path: str | Path) -> None:
        """Write states and saddles to a Parquet file, the bytes of `dpg landscape --output`.

        Raises OutputError, and UsageError for a file that was read or a name of another format.
        """
        from dpgcli.files.output import Mark, check_outputs
        from dpgcli.files.scene_rows import write_scene_rows

        table = path_of("path", path)
        check_outputs(self.given.files, (table, Mark.TABLE))
        chosen = {"from": self.start, "to": self.end, "via": [*self.via]}
        write_scene_rows(
            table_path(table), self.given.scene, self.given.json, self.columns, self.rows, chosen
        )

    def draw(self, path: str | Path) -> None:
        """Draw the energy along the path, states and saddles marked, to a .svg or .png file."""
        from dpgcli.reports.landscape import draw_landscape

        draw_landscape(self.landscape, self.rows, figure_path(path))


def landscape(
    spec: SpecInput,
    *,
    start: str,
    end: str,
    via: str | Sequence[str] = (),
    settings: Settings = (),
) -> LandscapeResult:
    """The energy along the path of least barriers from one state to another.

    `start`, `end` and the states `via` which it leads, in their order, are patterns such as
    "11100". Each step flips one unit. Of all paths the one whose largest barrier is the least is
    taken, and of those the one whose barriers add up to the least.
    Raises SpecError for a wrong spec, UsageError for patterns that are no stable state, for states
    between which there is no path, and for more than 12 units.

    >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
    >>> found = landscape(uniform_finger(1, **STUDY), start="0", end="1")
    >>> found.table["pattern"].tolist(), found.table["energy_mJ"].round(4).tolist()
    (['0', '?', '1'], [0.0, 6.0382, 4.3614])
    """
    return landscape_of(scene_input(spec, settings), start, end, as_texts("via", via))


def landscape_of(
    given: SceneInput, start: str, end: str, via: Sequence[str] = ()
) -> LandscapeResult:
    """The same, of what was read before."""
    check_texts(start=start, end=end)
    named = [("start", start), *(("via", pattern) for pattern in via), ("end", end)]
    finger = given.scene.finger
    _check(named, finger.n_units)
    keep_freed_memory()
    graph = BarrierGraph.of(UnitSolutions.of(finger), chain_potential, DEFAULT_TOLERANCE)
    for field, pattern in named:
        _check_stable(graph, field, pattern)
    legs = [_leg(graph, pattern, field, other) for (_, pattern), (field, other) in pairwise(named)]
    units = [unit for leg in legs for unit in leg.units]
    n_ways = prod(leg.n_ways for leg in legs)
    along = graph.along(int(start, 2), units)
    return LandscapeResult(given, graph, along, n_ways, start, end, tuple(via))


def _check(named: Sequence[tuple[str, str]], n_units: int) -> None:
    """Raise UsageError for what is no pattern of the finger, or for too many units."""
    if n_units > MOST_UNITS:
        raise UsageError(
            f"landscape of {n_units} units: expected at most {MOST_UNITS}, with "
            f"{2**MOST_UNITS:,} states and {MOST_UNITS * 2**MOST_UNITS:,} barriers"
        )
    for field, pattern in named:
        if not re.fullmatch(f"[01]{{{n_units}}}", str(pattern)):  # None is no text that is wrong
            raise UsageError(Field(field), f" {pattern}: expected {n_units} digits, 0 or 1")


def _check_stable(graph: BarrierGraph, field: str, pattern: str) -> None:
    status = Status(graph.states.status[int(pattern, 2)])
    if status not in (Status.STABLE, Status.MARGINAL):
        raise UsageError(Field(field), f" {pattern}: expected a stable state, found {status.text}")


def _leg(graph: BarrierGraph, start: str, field: str, end: str) -> BestWay:
    way = best_way(graph.barriers.energy, int(start, 2), int(end, 2))
    if way is None:
        n_missed = int(graph.barriers.n_not_found.sum())
        missed = f"; {counted(n_missed, 'barrier')} not found" if n_missed else ""
        raise UsageError(
            Field(field), f" {end}: no flips of single units lead there from {start}{missed}"
        )
    return way
