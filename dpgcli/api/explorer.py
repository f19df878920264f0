"""What the page of a design space shows beside its table: specs, shapes of states."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from dpgcli.api.predict import drawn
from dpgcli.arrays import Columns, Indices, distinct
from dpgcli.design.dimensions import UNITS, Design
from dpgcli.design.resolve import resolve
from dpgcli.design.scene import Scene
from dpgcli.errors import SpecError, UsageError
from dpgcli.files.access import reading
from dpgcli.files.design_spec import swept_base
from dpgcli.files.parts import FINGERPRINT
from dpgcli.files.row_source import RowSource, opened_rows
from dpgcli.files.scene_file import canonical, checked, scene_of
from dpgcli.files.scene_file.settings import changed
from dpgcli.files.yaml_file import Document
from dpgcli.reports.explorer.content import BestDesign, Explored, best_rows, shown_rows
from dpgcli.reports.explorer.poses import StateTips
from dpgcli.reports.explorer.shapes import (
    MOST_STATES,
    MOST_UNITS,
    NO_STATES,
    NO_TABLE,
    NOT_HERE,
    TOO_LONG,
    DesignStates,
    Shapes,
)
from dpgcli.reports.outlines import around_body, notes, sizes
from dpgcli.reports.space import DesignSpace
from dpgcli.reports.summary import N_UNITS
from dpgcli.studies.sweep import DESIGNS, STATES

WITHOUT_BODY = "as they are without the body: dpg grasp draws them on it"
TIPS = ("status", "tip_x_mm", "tip_y_mm", "tip_angle_rad", "energy_mJ")


def explored(folder: Path, space: DesignSpace) -> Explored:
    """What is to be explored of the sweep in a folder, as far as its tables say it."""
    narrowed = space.narrowed
    rows = shown_rows(narrowed)
    with opened_rows(folder / DESIGNS, has_states=False) as source:
        try:
            document = swept_base(space.metadata)
            base = checked(document)
            best = [_best(source, *found) for found in best_rows(space).items()]
        except (SpecError, UsageError):  # a table of somebody else, or of another version
            return Explored(rows)
        keys = source.keys
    shapes = _shapes(folder / STATES, space, keys, base.design, rows)
    is_gripper = base.gripper is not None
    shapes.notes = [
        *notes(scene_of(base)),
        *(["one finger, in its own frame"] * is_gripper),
        *([WITHOUT_BODY] * (base.design.body is not None)),
    ]
    hidden = {
        key: space.designs[name] for name, key in keys.items() if name not in narrowed.designs
    }
    return Explored(rows, best, keys, _shown_base(document, hidden), shapes)


def _shown_base(document: Document, hidden: Columns) -> dict[str, Any] | None:
    """The base with values that no column shows, by key; None where designs differ in them."""
    if any(len(distinct(values)) > 1 for values in hidden.values()):
        return None
    values = {key: values[0].item() for key, values in hidden.items()}
    base: dict[str, Any] = canonical(
        checked(changed(document, values)).model_dump(exclude_none=True)
    )
    return base


def _best(source: RowSource, row: int, metrics: list[str]) -> BestDesign:
    """A design at rest and with all units inverted, whichever of both is stable."""
    scene = scene_of(checked(source.design(row).document))
    n_units = scene.finger.n_units
    states = drawn(scene, ("0" * n_units, "1" * n_units))
    body = None if scene.body is None else around_body(scene.body)
    return BestDesign(row, metrics, [state for state in states if state.fingers], body)


def _shapes(
    path: Path, space: DesignSpace, keys: dict[str, str], base: Design, rows: Indices
) -> Shapes:
    """Shapes of the states of the designs in some rows, as many as a page has room for."""
    with reading(path):
        is_there = path.exists()
    if not is_there or N_UNITS not in space.designs:
        return Shapes(NO_TABLE)
    with opened_rows(path, has_states=True) as source:
        if source.metadata.get(FINGERPRINT) != space.metadata.get(FINGERPRINT):
            return Shapes(NO_TABLE)
        shapes = Shapes(NOT_HERE)
        usable = np.isin(rows, space.usable)
        shapes.reasons = dict.fromkeys(rows[~usable].tolist(), NO_STATES)
        owner = source.columns(["design"])["design"]
        units = space.designs[N_UNITS]
        shapes.reasons |= dict.fromkeys(
            rows[usable & (units[rows] > MOST_UNITS)].tolist(), TOO_LONG
        )
        chosen = _chosen(rows[usable], units, [*best_rows(space)])
        for n_units in distinct(units[chosen]).tolist():
            own = chosen[units[chosen] == n_units]
            values = {key: space.designs[name][own] for name, key in keys.items()}
            for places, scene in _scenes(replace(base, units=int(n_units)), values):
                shapes.add(_states(source, owner, own[places], space.designs["design"], scene))
    return shapes


def _chosen(rows: Indices, units: Indices, best: list[int]) -> Indices:
    """Rows of designs with at most so many states together, the best ones and others evenly."""
    few = rows[units[rows] <= MOST_UNITS]
    every = -int(-(2.0 ** units[few]).sum() // MOST_STATES)
    chosen = np.concatenate((few[:: max(1, every)], few[np.isin(few, best)]))
    return distinct(chosen)


def _scenes(base: Design, values: Columns) -> Iterator[tuple[Indices, Scene]]:
    """Scenes of designs with values by key, equally many units each, with chambers."""
    n_designs = len(next(iter(values.values())))
    others = {key: column for key, column in values.items() if key != UNITS}
    found = resolve(replace(base, n_designs=n_designs).with_values(others))
    for places in found.alike(np.flatnonzero(~found.are_wrong)):
        yield places, replace(found.batch(places), chambers=found.chambers(places))


def _states(
    source: RowSource, owner: Indices, rows: Indices, numbers: Indices, scene: Scene
) -> DesignStates:
    """All states of the designs in some rows; `owner` is the design of each state in the table."""
    n_states = 2**scene.finger.n_units
    first = np.searchsorted(owner, numbers[rows])
    places = np.minimum(first[:, None] + np.arange(n_states), len(owner) - 1)
    found = source.rows(places.ravel(), TIPS)
    status, x, y, angle, energy = (found[name].reshape(places.shape) for name in TIPS)
    tips = StateTips(x + 1j * y, angle, energy)
    return DesignStates(rows, status, tips, sizes(scene))
