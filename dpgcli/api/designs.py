"""Tables of sweeps as they are given, and their designs as specs."""

import os
from pathlib import Path
from typing import Any

import numpy as np

from dpgcli.api.arguments import files_of, path_of
from dpgcli.api.check import DesignsInput, arrow_of
from dpgcli.api.inputs import SceneInput, Settings, SpecInput, scene_input_in
from dpgcli.errors import Field, UsageError
from dpgcli.files.access import reading
from dpgcli.files.row_source import opened_rows
from dpgcli.studies.sweep import DESIGNS, STATES


def table_of(designs: DesignsInput, *, has_states: bool = False) -> Any:
    """The path of a table, of a sweep's folder that of designs or of states; or Arrow's table."""
    if not isinstance(designs, str | os.PathLike):
        return arrow_of(designs)
    path = path_of("designs", designs)
    with reading(path):
        return path / (STATES if has_states else DESIGNS) if path.is_dir() else path


def tables_beside(source: Any) -> tuple[Path, ...]:
    """A table's path and those of both tables of its sweep, none of which is written over."""
    if not isinstance(source, Path):
        return ()
    return files_of(source, *(source.parent / name for name in (DESIGNS, STATES)))


def design_input(spec: SpecInput, design: int, settings: Settings = ()) -> SceneInput:
    """The design of this number of a sweep's folder, as `scene_input` reads a spec.

    Raises UsageError for a design that is not there, or whose table does not say its base.
    """
    path = table_of(path_of("spec", spec))  # type: ignore[arg-type]  # refuses what is no path
    with opened_rows(path, has_states=False) as rows:
        numbers = rows.columns(["design"])["design"]
        places = np.flatnonzero(numbers == design)
        if not len(places):
            has = f"{numbers.min()} to {numbers.max()}" if len(numbers) else "none"
            raise UsageError(Field("design"), f" {design}: {path} has {has}")
        found = rows.design(int(places[0]))
    return scene_input_in(found.document, path, settings)
