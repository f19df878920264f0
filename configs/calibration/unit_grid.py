"""Make unit_grid.csv and unit_grid_rows.csv: one gap by finite elements over its dimensions.

python unit_grid.py FOLDER runs `dpg fe unit` for each geometry (a minute each), leaves decks and
curves in FOLDER, goes on where it was interrupted, and writes both tables beside this script.
"""

import itertools
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np

from dpgcli.calibration.fe.curves import UnitCurve, unit_stiffness
from dpgcli.calibration.fe.hinge import HingeChambers
from dpgcli.calibration.fe.models import Model, unit_model
from dpgcli.calibration.fe.pushed import Push, lever
from dpgcli.design.geometry import stroke
from dpgcli.studies import finite_elements as studies

HERE = Path(__file__).parent
PUSH = 50.0  # N/mm


class Geometry(NamedTuple):
    """Dimensions of a unit, by the spec's keys."""

    limiting_layer_thickness_mm: float = 1.5
    unit_separation_mm: float = 3.0
    chamber_width_mm: float = 20.0
    dome_height_mm: float = 6.5
    dome_thickness_mm: float = 0.75
    chamber_length_mm: float = 9.0
    elastic_modulus_MPa: float = 26.0  # noqa: N815


REFERENCE = Geometry()
LAYERS, GAPS, WIDTHS = (1.0, 1.5, 2.0), (2.0, 3.0, 4.5), (16.0, 20.0, 24.0)
CUBE = [Geometry(*sizes) for sizes in itertools.product(LAYERS, GAPS, WIDTHS)]
BESIDE = [
    Geometry(dome_height_mm=5.5),
    Geometry(dome_height_mm=7.5),
    Geometry(dome_thickness_mm=0.5),
    Geometry(dome_thickness_mm=1.0),
    Geometry(chamber_length_mm=7.5),
    Geometry(chamber_length_mm=11.0),
    Geometry(elastic_modulus_MPa=13.0),
    Geometry(elastic_modulus_MPa=52.0),
]


def distance(at: Geometry) -> tuple[int, bool]:
    """How many dimensions differ from the reference: the faces' middles first, then the corners."""
    n_changed = sum(a != b for a, b in zip(at, REFERENCE, strict=True))
    return (n_changed, False) if n_changed != 2 else (3, True)


GEOMETRIES = [*sorted(CUBE, key=distance), *BESIDE]


def chambers_of(at: Geometry) -> HingeChambers:
    """The chambers of a geometry."""
    return HingeChambers(
        at.chamber_length_mm,
        at.chamber_width_mm,
        at.dome_thickness_mm,
        at.unit_separation_mm,
        at.limiting_layer_thickness_mm,
        at.elastic_modulus_MPa,
    )


def moment_of(at: Geometry) -> float:
    """A moment (N mm) that turns the unit on the ground by 0.1 to 0.2 rad.

    It neither closes a narrow gap nor takes the push from a wide one: contact is left out.
    """
    gap, width = at.unit_separation_mm / 3.0, at.chamber_width_mm / 20.0
    layer, modulus = at.limiting_layer_thickness_mm / 1.5, at.elastic_modulus_MPa / 26.0
    size = 5.0 * layer**2.5 * min(gap, 1 / gap) ** 0.5 * min(width, 1.0) * modulus
    return float(f"{size:.2g}")


def model_of(at: Geometry) -> Model:
    """The deck of a geometry."""
    push = Push(PUSH, stroke(at.dome_height_mm, at.unit_separation_mm), at.dome_height_mm)
    return unit_model(chambers_of(at), push, "medium", moment_of(at), shares=(1.0, -1.0))


def curve_of(at: Geometry, folder: Path) -> UnitCurve:
    """The curve of a geometry, run if it is not there for the same deck."""
    model = model_of(at)
    folder.mkdir(parents=True, exist_ok=True)
    studies.write_deck(model, folder)
    path = studies.curve_path(model, folder)
    if not path.exists():
        print(at, studies.run(model, folder, studies.Limits(3600.0)), flush=True)
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    cells = [line.split(",") for line in lines[1:]]
    unit, *numbers = zip(*cells, strict=True)
    return UnitCurve(np.array(unit), *(np.array(column, dtype=float) for column in numbers))


def summary(at: Geometry, curve: UnitCurve) -> dict[str, float]:
    """One row: stiffness and compliance by the formulas of `unit_stiffness`."""
    found = unit_stiffness(curve, lever(chambers_of(at)))
    inverted = curve.unit == "inverted"
    couples = (curve.moment_N_mm * np.cos(curve.chamber2_angle_rad))[inverted]
    angles = (curve.chamber1_angle_rad - curve.chamber2_angle_rad)[inverted]
    return {
        **at._asdict(),
        "stroke_mm": stroke(at.dome_height_mm, at.unit_separation_mm),
        "segment_height_mm": lever(chambers_of(at)),
        "moment_N_mm": moment_of(at),
        "opening_mm": found.opening,
        "push_N": found.push,
        "rotation_rad": found.rotation,
        "ground_stiffness_N_mm_per_rad": found.ground,
        "hinge_stiffness_N_mm_per_rad": found.by_push,
        "wall_compliance_mm_per_N": found.walls,
        "inverted_stiffness_N_mm_per_rad": float(np.ptp(couples) / np.ptp(angles)),
    }


def main() -> None:
    """Run what is not there, and write both tables after each geometry."""
    rows, long = [], []
    for at in GEOMETRIES:
        name = "_".join(f"{value:g}" for value in at)
        curve = curve_of(at, Path(sys.argv[1]) / name)
        rows.append(summary(at, curve))
        long += [
            {**at._asdict(), **dict(zip(curve._fields, row, strict=True))}
            for row in zip(*(column.tolist() for column in curve), strict=True)
        ]
        write("unit_grid.csv", rows)
        write("unit_grid_rows.csv", long)


def write(name: str, rows: list[dict[str, float]]) -> None:
    """A table with its origin above it."""
    lines = [line for line in COMMENTS.splitlines() if line]
    lines.append(",".join(rows[0]))
    for row in rows:
        cells = (v if isinstance(v, str) else f"{v:.6g}" for v in row.values())
        lines.append(",".join(cells))
    (HERE / name).write_text("\n".join(lines) + "\n")


COMMENTS = f"""
# One gap between two chambers by finite elements, over its dimensions: dpg fe unit --mesh medium,
# CalculiX 2.20, made by unit_grid.py. nu = 0.48, St Venant-Kirchhoff. Inverted: a push of the
# stroke through a spring of {PUSH:g} N/mm on the dome's axis. Simulations, not measurements.
# Moments are those of forces that keep their direction: they wane as the cosine of
# chamber2_angle_rad.
"""


if __name__ == "__main__":
    main()
