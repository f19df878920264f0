"""Make the calibration that ships, `finite_elements`, from the tables beside this file.

python finite_elements.py FOLDER writes domes.yaml and units.yaml there; the package has them in
dpgcli/finite_elements. Every number comes from a fit of `dpg`. Known errors are over all geometries
of the tables: of each by the values as they are, which a few of its rows decide, and by those of
the others.
"""

import hashlib
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

import dpgcli as dpg
from dpgcli.calibration.choices import HINGES, LEVER, WALLS
from dpgcli.calibration.comparison import compare
from dpgcli.calibration.known import Frame, KnownStates
from dpgcli.calibration.unit import unit_finger
from dpgcli.files.calibration import Calibration, write_calibration
from dpgcli.files.calibration.models import DataFile, KnownErrors
from dpgcli.files.known_states import read_states

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
STUDY = {  # of the table's geometries, that of the study
    **CONSTANT,
    "limiting_layer_thickness_mm": 1.5,
    "unit_separation_mm": 3.0,
    "chamber_width_mm": 20.0,
    "dome_thickness_mm": 0.75,
}
LID = "finger.geometry.dome_thickness_mm=0.75"
OUTPUTS = {
    "ground_stiffness": "units at rest",
    "inverted_stiffness": "inverted units",
    "forces": "pushes",
}
METHOD = "interpolation"
ROWS = "unit_grid_rows.csv"
KEYS = (HINGES, WALLS, LEVER)
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
    table = pd.read_csv(HERE / ROWS, comment="#")
    rows = table[(table[[*CONSTANT]] == pd.Series(CONSTANT)).all(axis=1)]
    grid = pd.DataFrame([*fitted(rows)])
    made = between(grid)
    content = (HERE / ROWS).read_bytes()
    source = DataFile(file=ROWS, sha256=hashlib.sha256(content).hexdigest(), rows=len(rows))
    made = made.model_copy(update={"sources": [source]})
    spec, data = HERE / "three_gap_finger.yaml", HERE / "three_gap_finger_pure_push.csv"
    shapes = dpg.compare(spec, data, settings=(LID,), calibration=made).calibrated
    assert shapes is not None, "it is asked for"
    against = "tips in 5 states of a finger of three gaps at the study's dimensions, none fitted"
    return with_known(made, shapes=(shapes.relative, against), **over_the_table(made, grid, table))


def fitted(rows: pd.DataFrame) -> Iterator[dict[str, float]]:
    """The values of each geometry, by `dpg fit unit`."""
    for _, unit in rows.groupby([*OVER], sort=True):
        values = dpg.fit_unit(unit[[*UNIT]]).values
        yield {**{key: float(unit[key].iloc[0]) for key in OVER}, **{k: values[k] for k in KEYS}}


def between(grid: pd.DataFrame) -> Calibration:
    """The values between those of a grid."""
    at = {**CONSTANT, "channel_width_mm": 10.0}  # the study's: the finite elements have no channel
    return dpg.fit_grid(grid, geometry=at, method=METHOD).calibration


def over_the_table(
    made: Calibration, grid: pd.DataFrame, table: pd.DataFrame
) -> dict[str, tuple[Any, str]]:
    """What units of all its geometries are off by, and those of the study's dimensions at most."""
    geometries = [unit for _, unit in table.groupby([*OVER, *CONSTANT], sort=True)]
    found = pd.concat([off(made, grid, unit) for unit in geometries])
    is_study_s = (found[[*STUDY]] == pd.Series(STUDY)).all(axis=1)
    largest = 100.0 * found[is_study_s][[*OUTPUTS]].abs().max()
    return {
        output: (
            found[output],
            f"{what} of {len(geometries)} geometries under end moments, each also by the values "
            f"of the others; at the study's dimensions {largest[output]:.2g} % at most",
        )
        for output, what in OUTPUTS.items()
    }


def off(made: Calibration, grid: pd.DataFrame, unit: pd.DataFrame) -> pd.DataFrame:
    """Shares that one geometry is off by: of the grid's, also by the values of all others.

    Moments count as they are stated and as they act: the couple's arm turns with the chamber.
    """
    at = unit[[*OVER, *CONSTANT]].iloc[0]
    others = grid[(grid[[*OVER]] != at[[*OVER]]).any(axis=1)]
    is_known = len(others) < len(grid) and (at[[*CONSTANT]] == pd.Series(CONSTANT)).all()
    parts = []
    for calibration in (made, between(others)) if is_known else (made,):
        for arm in (1.0, np.cos(unit.chamber2_angle_rad)):
            acting = unit.assign(moment_N_mm=unit.moment_N_mm * arm)
            parts.append(beside(calibration, at, read_states(acting[[*UNIT]], 1)))
    return pd.concat(parts).assign(**at)


def beside(calibration: Calibration, at: pd.Series, known: KnownStates) -> pd.DataFrame:
    """Shares that the states of a unit are off by with a calibration's values, by output."""
    assert calibration.grid is not None, "it is made of one"
    size = at["elastic_modulus_MPa"] / CONSTANT["elastic_modulus_MPa"]
    place = at[[*OVER]].to_numpy(float)[None]
    values = {key: calibration.grid.law.at(key, place).value[0] for key in KEYS}
    values[HINGES] *= size
    values[WALLS] /= size
    found = compare(unit_finger(known, values[LEVER]).with_values(values), known, Frame())
    is_inverted = known.patterns[0]
    pushes = np.where(is_inverted, known.pushes[0], 1.0)
    return pd.DataFrame(
        {
            "ground_stiffness": np.where(is_inverted, np.nan, found.stiffness),
            "inverted_stiffness": np.where(is_inverted, found.stiffness, np.nan),
            "forces": np.where(is_inverted, found.push / pushes, np.nan),
        }
    )


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
