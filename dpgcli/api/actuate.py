"""`actuate`: a finger followed through a history of pressures."""

from collections.abc import Iterator, Mapping
from dataclasses import field, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from dpgcli.actuation.alone import REACH, thresholds_alone
from dpgcli.actuation.certificate import Certificate, certificate
from dpgcli.actuation.pressed import Halt
from dpgcli.actuation.readings import Drift, Readings, drift
from dpgcli.actuation.rest import at_rest
from dpgcli.actuation.tables import event_columns, event_rows, path_columns, path_rows
from dpgcli.actuation.travel import PathPoints, Travel, joined, travel
from dpgcli.actuation.unstable import branches
from dpgcli.api.arguments import check_flags, figure_path, path_of, table_path, whole
from dpgcli.api.histories import GivenHistory, PressureInput, history_input
from dpgcli.api.inputs import Settings, SpecInput
from dpgcli.api.pressed_states import begin_of, pattern_of
from dpgcli.api.pressure import PressedInput, pressed_input
from dpgcli.api.tables import Table, TableResult
from dpgcli.arrays import Array, Columns
from dpgcli.design.outputs import Output
from dpgcli.errors import ActuationError, Field, UsageError
from dpgcli.records import dataclass
from dpgcli.states.columns import Column
from dpgcli.states.patterns import inverted_units, texts
from dpgcli.states.solved import Surroundings
from dpgcli.text import counted, enumerated

MOST_CYCLES = 100_000
MOST_PRESSURES = 1_000_000  # by step and unit: 1 to 5 GB, or more far beyond thresholds
LARGEST_STEP = 0.05  # of a stroke: points near enough for a figure
FAR = 100.0  # times the largest threshold of a unit by itself: what is further may be kPa
WHY = {
    Halt.FOLDED: "the finger folds onto itself",
    Halt.FAILED: "no equilibrium is found",
}


@dataclass(frozen=True)
class ActuateResult(TableResult):
    """What happened to a finger under pressure, and where it ended.

    `given` is the spec with its lines, `history` the pressures by step, `way` what was followed.
    It began at the pattern `start`, and went through the history `cycles` times. `branches` are the
    unstable ones by the number of the event, if they were asked for.
    """

    given: PressedInput
    history: GivenHistory
    way: Travel
    start: str
    cycles: int
    branches: Mapping[int, PathPoints] = field(default_factory=dict)

    @cached_property
    def table(self) -> Table:
        """A row for each event."""
        return Table.of(self.columns, self.rows)

    @cached_property
    def path(self) -> Table:
        """A row for each point of the path, both sides of each event among them.

        Those of unstable branches, if they were asked for, come last.
        """
        return Table.of(*self._path)

    @property
    def pattern(self) -> str:
        """The pattern in which the finger ended."""
        return str(texts(self.way.final.inverted).astype(str)[0])

    @cached_property
    def certificate(self) -> Certificate:
        """Whether the last shape is a stable state, or an equilibrium under its pressures."""
        return certificate(self.given.pressed, self.way.final)

    @cached_property
    def drift(self) -> Drift:
        """How far the ends of cycles are apart, mm."""
        n_steps = len(self.history.history.pressure)
        return drift(self.readings, np.array(self.way.holds[n_steps - 1 :: n_steps]))

    @cached_property
    def columns(self) -> tuple[Column, ...]:
        """The columns of events."""
        return event_columns(is_gripper=self.given.given.scene.gripper is not None)

    @cached_property
    def rows(self) -> Columns:
        """Events by column."""
        return event_rows(self.way, self.readings, self.given.pressure)

    @cached_property
    def readings(self) -> Readings:
        """Quantities of all points of the way."""
        return self._read(self.way.points)

    def _read(self, points: PathPoints) -> Readings:
        scene = self.given.given.scene
        around = Surroundings(scene.gripper, scene.layer_thickness or 0.0)
        return Readings(self.given.pressed, points.shapes, around)

    @cached_property
    def _path(self) -> tuple[tuple[Column, ...], Columns]:
        pressure, history = self.given.pressure, self.history.history
        scene = self.given.given.scene
        columns = path_columns(
            pressure, scene.finger.n_units, history, is_gripper=scene.gripper is not None
        )
        readings = self._read(joined([self.way.points, *self.branches.values()]))
        return columns, path_rows(self.way, self.branches, readings, pressure, history)

    @property
    def summary(self) -> tuple[str, ...]:
        """Where the finger ended, what was lost, what pressures rest on, ties, drift: lines."""
        return tuple(self._lines())

    def _lines(self) -> Iterator[str]:
        events, found = self.way.events, self.certificate
        lost = sum(event.released for event in events)
        yield (
            f"final pattern {self.pattern} at {self._pressures(self.way.final.pressure[:, 0])}, "
            f"{found.text} (residual {found.residual:.1e} N)"
        )
        yield counted(len(events), "event") + (f", {lost:.5g} mJ lost in them" if events else "")
        if n_tied := sum(bool(event.tied) for event in events):
            which = f"{n_tied:,} of {counted(len(events), 'event')}"
            yield f"ties in {which}: the model does not say which of the units goes first"
        if (n_cycles := int(self.way.points.cycle[-1])) > 1:
            yield from self._repeated(n_cycles)
        gripper = self.readings.in_gripper
        if gripper is not None and (n_over := int(gripper.overlaps.sum())):
            of = f"{n_over:,} of {len(gripper.overlaps):,} points"
            yield f"the fingers overlap at {of}: nothing keeps them apart in the model"
        scene = self.given.given.scene
        for trust in scene.trusts:
            if trust.output is Output.PRESSURES:
                yield f"pressures: {trust.basis_text}, {trust.source}; error {trust.known_error}"
        yield from (f"warning: {warning}" for warning in scene.warnings)
        if times := self.times_beyond:
            yield (
                f"warning: pressures go to {times:,.0f} times the largest threshold of any unit "
                "alone: are they in kPa? They are taken in MPa, of which 150 kPa are 0.15"
            )

    def _repeated(self, n_cycles: int) -> Iterator[str]:
        found = self.drift
        ends = f"in {found.patterns[0]}"
        if len(found.patterns) > 1:
            ends = f"in {enumerated(found.patterns)}, each compared with its first"
        yield (
            f"{n_cycles} cycles end {ends}: drift {found.tip:.1e} mm at the tip, "
            f"{found.nodes:.1e} mm at any node"
        )

    def _pressures(self, by_unit: Array) -> str:
        """Pressures of the lines in words."""
        pressure = self.given.pressure
        first = [int(np.argmax(pressure.line_of == k)) for k in range(len(pressure.lines))]
        values = [f"{by_unit[unit]:.7g}" for unit in first]
        if len(values) == 1:
            return f"{values[0]} MPa"
        named = zip(pressure.lines, values, strict=True)
        return ", ".join(f"{line} {value}" for line, value in named) + " MPa"

    @cached_property
    def times_beyond(self) -> float:
        """How many times beyond all thresholds the pressures go, where that is too far; else 0.

        The largest threshold is that of any unit by itself; hundreds of times it are hardly meant.
        """
        largest = thresholds_alone(self.given.pressed).reach[0] / REACH
        times = float(np.abs(self.history.history.pressure).max() / largest)
        return times if times > FAR else 0.0

    @property
    def problem(self) -> str:
        """Why the finger went no further, empty if it came to the end."""
        if self.way.reason is Halt.ARRIVED:
            return "" if self.certificate.is_certified else self.certificate.text
        pressures = self._pressures(self.way.pressure)
        if self.way.folded is None:
            return f"{WHY[self.way.reason]} at {pressures}, {self._place()}"
        reached = texts(self.way.folded[:, None]).astype(str)[0]
        snaps = f"the finger snaps at {pressures} to {reached}, which folds onto itself"
        return f"{snaps}, {self._place()}"

    def _place(self) -> str:
        points = self.way.points
        cycle = f" of cycle {points.cycle[-1]}" if points.cycle[-1] > 1 else ""
        return f"on the way to step {points.step[-1]}{cycle}, in pattern {self.pattern}"

    def save(self, path: str | Path) -> None:
        """Write the path to a Parquet file, the bytes of `dpg actuate --output`.

        Raises OutputError, and UsageError for a file that was read or a name of another format.
        """
        from dpgcli.files.actuation import write_path
        from dpgcli.files.output import Mark, check_outputs
        from dpgcli.files.scene_metadata import told_history

        given, table = self.given.given, path_of("path", path)
        check_outputs((*given.files, *self.history.files), (table, Mark.TABLE))
        events = self.columns, self.rows
        chosen = told_history(self.given.pressure, self.history.history)
        chosen |= {"start": self.start, "cycles": self.cycles}
        write_path(table_path(table), given.scene, given.json, self._path, events, chosen)

    def draw(self, path: str | Path) -> None:
        """Draw pressure against the tip, with shapes at the holds, to a .svg or .png file."""
        from dpgcli.reports.actuation import Drawing

        given = self.given
        branches = [self._read(points) for points in self.branches.values()]
        drawing = Drawing(self.way, self.readings, branches, given.pressure, given.given.scene)
        drawing.draw(figure_path(path))


def actuate(
    spec: SpecInput,
    *,
    pressure: PressureInput | None = None,
    start: str = "",
    cycles: int = 1,
    unstable: bool = False,
    settings: Settings = (),
) -> ActuateResult:
    """Follow a finger quasi-statically through pressures: what snaps, resets, meets, and when.

    `pressure` (MPa): a ramp such as "0:0.15:0", one such as "A=0:0.15:0" for each line, numbers,
    or a table with a column for each line; None takes that of the spec. `start` is the pattern
    to start from, that in which the finger rests without it. The history is run through `cycles`
    times. With `unstable` the path goes on beyond folds, along branches that no finger stays on.
    Raises SpecError for a wrong spec or history, UsageError for wrong choices, ActuationError where
    the finger folds onto itself or no equilibrium is found: its `result` has what happened before.

    >>> found = actuate({"finger": {"units": 3, "lattice": {
    ...     "segment_length_mm": 13.5, "segment_height_mm": 10.75, "stroke_mm": 3.5,
    ...     "bistable_stiffness_N_per_mm": 12.84, "force_linearity": 0.043,
    ...     "hinge_stiffness_N_mm_per_rad": 24.2}}}, pressure="0:0.16:0")
    >>> found.pattern, found.table["unit"].tolist(), found.table["tie"].tolist()
    ('111', ['1,2,3'], ['2,3'])
    """
    given = pressed_input(spec, settings)
    history = history_input(pressure, given.pressure)
    return followed(given, history, start, cycles, unstable=unstable)


def followed(
    given: PressedInput, history: GivenHistory, start: str, cycles: int, *, unstable: bool
) -> ActuateResult:
    """The same, of what was read before."""
    cycles = whole("cycles", cycles)
    check_flags(unstable=unstable)
    if cycles is None or not 1 <= cycles <= MOST_CYCLES:
        raise UsageError(Field("cycles"), f" {cycles}: expected 1 to {MOST_CYCLES:,}")
    by_unit = history.history.pressure[:, given.pressure.line_of]
    if (n := cycles * by_unit.size) > MOST_PRESSURES:
        n_steps, n_units = by_unit.shape
        raise UsageError(
            f"{n:,} pressures, of {n_steps:,} steps of {counted(n_units, 'unit')}, ",
            Field("cycles"),
            f" {cycles:,}: expected at most {MOST_PRESSURES:,}, as the path is held in memory",
        )
    begin = begin_of(given, start)
    inverted = inverted_units(np.array([begin], np.uint64), given.pressed.finger.n_units)
    shapes, _ = at_rest(given.pressed, inverted)
    way = travel(given.pressed, shapes, by_unit, cycles, LARGEST_STEP)
    result = ActuateResult(given, history, way, pattern_of(given, begin), cycles)
    if result.problem:
        hint = "; pressures are in MPa, of which 150 kPa are 0.15" if result.times_beyond else ""
        raise ActuationError(result, result.problem, hint)
    return replace(result, branches=branches(given.pressed, way)) if unstable else result
