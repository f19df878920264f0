"""`transitions`: what first happens to every stable state under pressure, and what is reached."""

from collections.abc import Iterator, Sequence
from dataclasses import field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dpgcli.actuation.alone import REACH
from dpgcli.actuation.rest import at_rest
from dpgcli.actuation.transition_scatter import SPREAD_COLUMNS, spread_rows
from dpgcli.actuation.transition_table import COLUMNS, transition_rows
from dpgcli.actuation.transitions import Departure, StateGraph, state_graph
from dpgcli.api.arguments import figure_path, path_of, table_path
from dpgcli.api.inputs import Settings, SpecInput
from dpgcli.api.predict import MOST_DRAWN
from dpgcli.api.pressed_states import pattern_of, unknown_rest
from dpgcli.api.pressure import PressedInput, pressed_input
from dpgcli.api.scatter import Draws, ScatterInput, drawn_by
from dpgcli.api.tables import Table, TableResult
from dpgcli.arrays import Columns, Flags, keep_freed_memory
from dpgcli.design.outputs import Output
from dpgcli.errors import Field, UsageError
from dpgcli.records import dataclass
from dpgcli.states.certify import Status
from dpgcli.states.columns import REACHABLE, Column
from dpgcli.states.patterns import inverted_units, texts
from dpgcli.states.plan import Request
from dpgcli.states.predict import predict
from dpgcli.text import counted

if TYPE_CHECKING:
    import networkx as nx

MOST_UNITS = 16  # minutes of work
MOST_SCATTERED = 2_000_000  # thresholds: minutes of work, too
MOST_NAMED = 16  # states in a line of the summary
OF_STATES = ("pattern", "status", "energy_mJ", "tip_x_mm", "tip_y_mm", "tip_angle_rad")


@dataclass(frozen=True)
class TransitionsResult(TableResult):
    """What first happens to every stable state on each line, up and down.

    `given` is the spec with its lines, `graph` what was found. `draws` are scattered fingers whose
    thresholds are in `spread`, by column, if they were asked for.
    """

    given: PressedInput
    graph: StateGraph
    draws: Draws | None = None
    spread: Columns = field(default_factory=dict)

    @property
    def columns(self) -> tuple[Column, ...]:
        """The columns of transitions."""
        return (*COLUMNS, *(SPREAD_COLUMNS if self.draws is not None else ()))

    @cached_property
    def rows(self) -> Columns:
        """Transitions by column."""
        return transition_rows(self.graph.transitions, self.given.pressure) | self.spread

    @cached_property
    def table(self) -> Table:
        """A row for each stable state, line and direction."""
        return Table.of(self.columns, self.rows)

    @property
    def reachable(self) -> tuple[str, ...]:
        """Patterns that pulses of any height lead to from rest."""
        return self._patterns(self.graph.is_reached)

    @property
    def unreachable(self) -> tuple[str, ...]:
        """Patterns of the other stable states."""
        return self._patterns(self.graph.is_stable & ~self.graph.is_reached)

    @cached_property
    def states(self) -> tuple[tuple[Column, ...], Columns]:
        """Pattern, energy and tip of each stable state, and whether it is reached: by column."""
        prediction = predict(self.given.given.scene, Request(columns=OF_STATES))
        blocks = [*prediction.blocks()]
        which = np.flatnonzero(self.graph.is_stable)
        columns = tuple(column for column in prediction.plan.columns if column.name != "status")
        rows = {c.name: np.concatenate([b[c.name] for b in blocks])[which] for c in columns}
        rows[REACHABLE.name] = self.graph.is_reached[which]
        return (*columns, REACHABLE), rows

    @property
    def summary(self) -> tuple[str, ...]:
        """How much was found, what can be reached, what pressures rest on: lines."""
        return tuple(self._lines())

    def _lines(self) -> Iterator[str]:
        graph, outcome = self.graph, self.graph.transitions.outcome
        n_states, n_left_out = int(graph.is_stable.sum()), int((~graph.is_stable).sum())
        lines = self.given.pressure.lines
        yield (
            f"{counted(n_states, 'stable state')} on {counted(len(lines), 'line')}, from "
            f"{-graph.reach:.4g} to {graph.reach:.4g} MPa: {REACH:g} times the largest threshold "
            "of any unit alone"
        )
        for kind, (of_one, of_more) in _COUNTED.items():
            if n := int((outcome == kind).sum()):
                yield f"{counted(n, 'direction')} {of_one if n == 1 else of_more}"
        if n_left_out:
            left_out = counted(n_left_out, "pattern")
            yield f"{left_out} without a certified stable state left out: dpg predict says why"
            if n_closed := self._n_closed():
                yield f"{n_closed} of these under pressure only: {Status.GAP_CLOSED.meaning}"
        if n_tied := int((graph.transitions.tied != 0).sum()):
            tied = counted(n_tied, "transition")
            yield f"ties in {tied}: the model does not say which of these units goes first"
        yield from self._reachable()
        if self.draws is not None:
            yield from self.draws.lines
        yield from pressure_lines(self.given)

    def _reachable(self) -> Iterator[str]:
        """Which states pulses reach, and from where."""
        graph = self.graph
        if graph.rest < 0:
            yield f"not known what is reachable: {unknown_rest(self.given.pressed)}"
            return
        if graph.rest:
            yield f"loads bring the finger at rest to {pattern_of(self.given, graph.rest)}"
        yield f"reachable from rest: {_listed(self.reachable)}"
        if graph.n_unknown and self.unreachable:
            yield (
                f"not found to be reachable from rest: {_listed(self.unreachable)}; "
                f"{failed_searches(graph.n_unknown)}, which may lead there"
            )
        else:
            yield f"not reachable from rest with these lines: {_listed(self.unreachable)}"

    def to_networkx(self) -> "nx.MultiDiGraph[str]":
        """States as nodes, transitions as edges, with what is known of both as attributes."""
        from dpgcli.files.transitions import graph_of

        return graph_of(self.states, (self.columns, self.rows))

    def save(self, path: str | Path) -> None:
        """Write the transitions to a Parquet file, the bytes of `dpg transitions --output`.

        Raises OutputError, and UsageError for a file that was read or a name of another format.
        """
        from dpgcli.files.output import Mark, check_outputs
        from dpgcli.files.transitions import write_transitions

        given, table = self.given.given, path_of("path", path)
        check_outputs(given.files, (table, Mark.TABLE))
        file = table_path(table)
        write_transitions(file, given.scene, given.json, self.graph.reach, self.columns, self.rows)

    def save_graph(self, path: str | Path) -> None:
        """Write the graph as GraphML, for Gephi, yEd or NetworkX; raises as `save`."""
        from dpgcli.files.output import Mark, check_outputs
        from dpgcli.files.transitions import write_graph

        file = graph_path(path)
        check_outputs(self.given.given.files, (file, Mark.GRAPH))
        write_graph(file, self.to_networkx())

    def draw(self, path: str | Path) -> None:
        """Draw the graph, 64 states at most, to a .svg or .png file.

        Layer by layer of inverted units; gray are states that are not reached from rest.
        """
        from dpgcli.reports.transitions import draw_transitions

        check_drawable_graph(self.given)
        draw_transitions(self.states[1], self.rows, figure_path(path))

    def _n_closed(self) -> int:
        """How many states are left out that are stable until pressure comes."""
        pressed = self.given.pressed
        if pressed.stretches is None:
            return 0
        codes = np.flatnonzero(~self.graph.is_stable).astype(np.uint64)
        _, settled = at_rest(pressed, inverted_units(codes, pressed.finger.n_units))
        return int((settled.status == Status.GAP_CLOSED).sum())

    def _patterns(self, which: Flags) -> tuple[str, ...]:
        codes = np.flatnonzero(which).astype(np.uint64)
        n_units = self.given.pressed.finger.n_units
        return tuple(texts(inverted_units(codes, n_units)).astype(str).tolist())


def failed_searches(n_directions: int) -> str:
    """In how many directions searches failed, for summaries.

    >>> failed_searches(1)
    'no equilibrium or no certified state is found in 1 direction of pressure'
    """
    directions = counted(n_directions, "direction")
    return f"no equilibrium or no certified state is found in {directions} of pressure"


_COUNTED = {
    Departure.LEAVES: ("leads to another state or back", "lead to another state or back"),
    Departure.STAYS: ("in which no unit leaves",) * 2,
    Departure.FOLDS: ("in which the finger folds onto itself",) * 2,
    Departure.LOST: ("in which no equilibrium is found",) * 2,
    Departure.ASTRAY: ("that ends in no certified state", "that end in no certified state"),
}


def transitions(
    spec: SpecInput,
    *,
    scatter: ScatterInput | None = None,
    draws: int | None = None,
    seed: int | None = None,
    settings: Settings = (),
) -> TransitionsResult:
    """For each stable state, line and direction: where it is left, and for which other one.

    Pressures of one line go up or down, the others stay at zero, up to twice the largest threshold
    of a unit by itself. A spec without a section on pressure has all units on one line.
    `scatter`, such as "dome_thickness_mm=2%,dome_height_mm=0.1mm", are standard deviations of
    values around those of the spec: so many `draws` of fingers, 1000 unless given, have thresholds
    of their own.
    Raises SpecError for a wrong spec or scatter, UsageError for wrong choices or more than 16
    units.

    >>> found = transitions({"finger": {"units": 2, "lattice": {
    ...     "segment_length_mm": 13.5, "segment_height_mm": 10.75, "stroke_mm": 3.5,
    ...     "bistable_stiffness_N_per_mm": 12.84, "force_linearity": 0.043,
    ...     "hinge_stiffness_N_mm_per_rad": 24.2}}})
    >>> found.table["pattern"].tolist(), found.reachable
    (['00', '00', '01', '01', '10', '10', '11', '11'], ('00', '11'))
    """
    given = pressed_input(spec, settings)
    drawn = drawn_by(given, scatter, draws, seed)
    return transitions_of(given, drawn)


def transitions_of(given: PressedInput, draws: Draws | None = None) -> TransitionsResult:
    """The same, of what was read before."""
    check_size(given)
    keep_freed_memory()
    line_of = given.pressure.line_of
    graph = state_graph(given.pressed, line_of)
    if draws is None:
        return TransitionsResult(given, graph)
    rows = graph.transitions
    if (n := len(rows.code) * draws.n_draws) > MOST_SCATTERED:
        raise UsageError(
            f"{n:,} thresholds, of {len(rows.code):,} transitions of {draws.n_draws:,} draws: "
            f"expected at most {MOST_SCATTERED:,}; give fewer ",
            Field("draws"),
        )
    spread = spread_rows(draws.batches(), line_of, graph.reach, rows, draws.n_draws)
    return TransitionsResult(given, graph, draws, spread)


def check_size(given: PressedInput) -> None:
    """Raise UsageError for more states than there is time for."""
    n_units = given.pressed.finger.n_units
    if n_units > MOST_UNITS:
        raise UsageError(
            f"transitions of {n_units} units: expected at most {MOST_UNITS}, with "
            f"{2**MOST_UNITS:,} states"
        )


def check_drawable_graph(given: PressedInput) -> None:
    """Raise UsageError for a graph that nobody could read."""
    n_states = 2**given.pressed.finger.n_units
    if n_states > MOST_DRAWN:
        what = f" draws at most {MOST_DRAWN} states, not {n_states:,}: take the GraphML file"
        raise UsageError(Field("plot"), f"{what}, and a program for large graphs")


def graph_path(path: str | Path) -> Path:
    """The path of a graph. Raises UsageError for a name that says something else."""
    file = path_of("path", path)
    if file.suffix.lower() != ".graphml":
        raise UsageError(f"{path}: expected a name that ends in .graphml, for a graph")
    return file


def pressure_lines(given: PressedInput) -> Iterator[str]:
    """What pressures rest on, and warnings of calibrations in use."""
    scene = given.given.scene
    for trust in scene.trusts:
        if trust.output is Output.PRESSURES:
            yield f"pressures: {trust.basis_text}, {trust.source}; error {trust.known_error}"
    yield from (f"warning: {warning}" for warning in scene.warnings)


def _listed(patterns: Sequence[str]) -> str:
    """How many states, and the first of them by name."""
    if not patterns:
        return "none"
    named = ", ".join(patterns[:MOST_NAMED])
    more = f" and {len(patterns) - MOST_NAMED:,} more" if len(patterns) > MOST_NAMED else ""
    return f"{counted(len(patterns), 'state')}: {named}{more}"
