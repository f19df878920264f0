"""Make the calibration that ships, `finite_elements`, from the tables beside this file.

python finite_elements.py FOLDER writes domes.yaml and units.yaml there; the package has them in
dpgcli/finite_elements. Every number comes from a fit of `dpg`, and every known error from data that
the fit has not seen.
"""

import hashlib
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

import dpgcli as dpg
from dpgcli.calibration.comparison import Comparison
from dpgcli.files.calibration import Calibration, write_calibration
from dpgcli.files.calibration.models import DataFile, KnownErrors

HERE = Path(__file__).parent
SPEC = HERE.parent / "three_unit.yaml"
OVER = (
    "limiting_layer_thickness_mm",
    "unit_separation_mm",
    "chamber_width_mm",
    "dome_thickness_mm",
)
CONSTANT = {
    "dome_height_mm": 6.5,
    "chamber_length_mm": 9.0,
    "elastic_modulus_MPa": 26.0,
}
METHOD = "interpolation"
ROWS = "unit_grid_rows.csv"
KEYS = ("hinge_stiffness_N_mm_per_rad", "wall_compliance_mm_per_N", "segment_height_mm")
UNIT = ("unit", "moment_N_mm", "chamber2_angle_rad", "opening_mm", "push_N")


def domes() -> Calibration:
    """The curve of the study's dome; how far its scalings are off the other domes of the grid."""
    curve = HERE / "dome_path_h6.5_t0.75.csv"
    fit = dpg.fit_bistable(curve, travel_to_opening="stroke:3.5", spec=SPEC)
    grid = pd.read_csv(HERE / "dome_grid.csv", comment="#")
    height, thickness = grid.dome_height_mm / 6.5, grid.dome_thickness_mm / 0.75
    own = (grid.dome_height_mm == 6.5) & (grid.dome_thickness_mm == 0.75)
    scaled = grid.inverted_energy_mJ[own].item() * thickness**2.8 * height**1.75
    errors = (scaled / grid.inverted_energy_mJ - 1.0)[~own]
    pressures = grid.limit_pressure_MPa[own].item() * thickness**2.5 * height**1.2
    off = (pressures / grid.limit_pressure_MPa - 1.0)[~own]
    others = "of 8 other domes, heights 4.5-7.5 mm, thicknesses 0.5-1 mm"
    return with_known(
        fit.calibration,
        energies_and_barriers=(errors, f"inverted energies {others}"),
        pressures=(off, f"snap pressures {others}"),
    )


def units() -> Calibration:
    """Hinge, walls and lever over the dimensions of a gap; how far they are off."""
    rows = pd.read_csv(HERE / ROWS, comment="#")
    rows = rows[(rows[[*CONSTANT]] == pd.Series(CONSTANT)).all(axis=1)]
    grid = pd.DataFrame([*fitted(rows)])
    at = {**CONSTANT, "channel_width_mm": 10.0}  # the study's: the finite elements have no channel
    made = dpg.fit_grid(grid, geometry=at, method=METHOD).calibration
    content = (HERE / ROWS).read_bytes()
    source = DataFile(file=ROWS, sha256=hashlib.sha256(content).hexdigest(), rows=len(rows))
    made = made.model_copy(update={"sources": [source]})
    turned = compared(made, "unit_moment.csv", "finger.units=1")
    shapes = compared(made, "three_gap_finger_pure_push.csv")
    inverted, opened = turned.states.settled.inverted[0], shapes.states.settled.inverted
    pushes = shapes.push[opened.any(axis=0)] / np.nanmax(shapes.states.pushes)
    beside = "in 5 states of a finger of three gaps, none of them fitted"
    turns = "what end moments turn a unit by, none of it fitted"
    return with_known(
        made,
        shapes=(shapes.relative, f"tips {beside}"),
        forces=(pushes, f"pushes {beside}"),
        ground_stiffness=(turned.stiffness[~inverted], turns),
        inverted_stiffness=(turned.stiffness[inverted], turns),
    )


def fitted(rows: pd.DataFrame) -> Iterator[dict[str, float]]:
    """The values of each geometry, by `dpg fit unit`."""
    for _, unit in rows.groupby([*OVER], sort=True):
        values = dpg.fit_unit(unit[[*UNIT]]).values
        yield {**{key: float(unit[key].iloc[0]) for key in OVER}, **{k: values[k] for k in KEYS}}


def compared(calibration: Calibration, data: str, *settings: str) -> Comparison:
    """The finite elements' finger with a calibration's values beside known states."""
    spec, lid = HERE / "three_gap_finger.yaml", "finger.geometry.dome_thickness_mm=0.75"
    beside = dpg.compare(spec, HERE / data, settings=(lid, *settings), calibration=calibration)
    found = beside.calibrated
    assert found is not None, "it is asked for"
    return found


def with_known(calibration: Calibration, **errors: tuple[Any, str]) -> Calibration:
    """The calibration with shares that outputs are known to be off by."""
    sections = {}
    for output, (shares, against) in errors.items():
        size = np.abs(np.asarray(shares)[np.isfinite(shares)])
        sections[output] = {
            "largest": float(size.max()),
            "rms": float(np.sqrt((size**2).mean())),
            "against": against,
        }
    return calibration.model_copy(update={"known_errors": KnownErrors.model_validate(sections)})


if __name__ == "__main__":
    folder = Path(sys.argv[1])
    write_calibration(folder / "domes.yaml", domes())
    write_calibration(folder / "units.yaml", units())
