"""`compare`: predictions beside finite elements or measurements."""

from collections.abc import Iterator
from functools import cached_property
from pathlib import Path

import numpy as np

from dpgcli.api.arguments import figure_path
from dpgcli.api.data import frame_of
from dpgcli.api.inputs import Place, Settings, SpecInput, scene_input
from dpgcli.api.recalibration import CalibrationInput, recalibrated_scene
from dpgcli.api.tables import Table, TableResult
from dpgcli.arrays import Columns
from dpgcli.benchmark.timing import measured
from dpgcli.calibration import comparison
from dpgcli.calibration.comparison import Comparison, frame_misfit
from dpgcli.calibration.known import Frame, KnownStates, lattice_states
from dpgcli.errors import Message
from dpgcli.files.csv_file import Tabular, name_of
from dpgcli.files.plausible_states import states_of
from dpgcli.mechanics.finger import Finger
from dpgcli.records import dataclass
from dpgcli.reports.comparison import comparison_summary, draw_comparison
from dpgcli.states.columns import Column

REPEATS = 5


@dataclass(frozen=True)
class CompareResult(TableResult):
    """Known states and the lattice's own, `calibrated` by another calibration if there is one.

    `calibrated_law` is that of its domes, in words; `frame_words` say where the `frame` of the data
    is from.
    """

    name: str
    finger: Finger
    known: KnownStates
    found: Comparison
    calibrated: Comparison | None
    calibrated_law: str
    frame: Frame
    frame_words: str

    @cached_property
    def rows(self) -> Columns:
        """Arrays by column."""
        return comparison.rows(self.known, self.found, self.calibrated)

    @property
    def columns(self) -> tuple[Column, ...]:
        """Predicted and known values, and their differences."""
        return comparison.columns(self.rows)

    @property
    def table(self) -> Table:
        """A row for each known state."""
        return Table.of(self.columns, self.rows)

    @property
    def summary(self) -> tuple[str, ...]:
        """Worst and mean errors of states that are in both, and the ratio of run times."""
        law = self.finger.law.description
        errors = comparison_summary(self.found, law, self.calibrated, self.calibrated_law)
        lines = [*errors, *self._frame(), *self._times()]
        if self.known.unused:
            lines.append(f"columns not used: {', '.join(self.known.unused)}")
        return tuple(lines)

    def draw(self, path: str | Path) -> None:
        """Draw shapes and known tips to a .svg or .png file."""
        draw_comparison(self.known, self.found, self.calibrated, self.name, figure_path(path))

    def _frame(self) -> Iterator[str]:
        """Where the frame is from, and whether it fits."""
        if self.frame != Frame():
            yield f"frame: {self.frame_words}"
        if misfit := frame_misfit(self.finger, self.known, self.found, self.frame):
            yield Message("warning: ", misfit)

    def _times(self) -> Iterator[str]:
        """Seconds a state: of the data, where they say, and of the prediction."""
        if not np.isfinite(self.known.seconds).any():
            return
        patterns, moments = self.known.patterns, self.known.moments
        taken = measured(lambda: lattice_states(self.finger, patterns, Frame(), moments), REPEATS)
        own = taken.wall / patterns.shape[1]
        theirs = float(np.nanmean(self.known.seconds))
        ratio = f"{theirs / own:,.0f} times as long"
        yield f"{theirs:.3g} s a state in the data, {own:.2g} s here: {ratio}"


def compare(
    spec: SpecInput,
    data: Tabular,
    *,
    settings: Settings = (),
    calibration: CalibrationInput | None = None,
    shapes: Tabular | None = None,
    first_station: Place = None,
    tip_offset: Place = None,
) -> CompareResult:
    """Compare predictions with finite elements or measurements.

    `data` has `pattern` and what is known of it; `shapes` the layer's points: see
    `files.known_states`. `first_station` is the lattice's first node in the data, `tip_offset`
    what the data call the tip, from the last node along the phalanx and to its left (mm), unless
    the data's header or the spec's section `data` says them. With a
    `calibration`, its file or the name of one that is built in ("published", "finite_elements"),
    its values are compared, too. Raises SpecError for a wrong spec or data.

    >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
    >>> known = {"pattern": ["00"], "tip_x_mm": [27.0], "tip_y_mm": [1.0]}
    >>> compare(uniform_finger(2, **STUDY), known).table["error_mm"].tolist()
    [1.0]
    """
    given = scene_input(spec, settings)
    finger = given.scene.finger
    known = states_of(finger, data, shapes)
    frame, said = frame_of(given, known, first_station, tip_offset)
    better = None if calibration is None else recalibrated_scene(given, calibration).finger
    return CompareResult(
        name_of(data),
        finger,
        known,
        comparison.compare(finger, known, frame),
        None if better is None else comparison.compare(better, known, frame),
        "" if better is None else better.law.description,
        frame,
        said,
    )
