"""`dpg fit`: values, warnings, files and messages, on the finite-element data of the examples."""

import csv
import io
import json
import os
from pathlib import Path
from typing import Any, TextIO

import pytest
from ruamel.yaml import YAML

from dpgcli.cli.exits import ExitCode
from dpgcli.files.calibration import read_calibration

DATA = Path(__file__).parents[2] / "configs" / "calibration"
NAMES = (
    "dome_path_h6.5_t0.75.csv",
    "dome_dynamic_h6.5_t0.75.csv",
    "dome_grid.csv",
    "hinge_moment.csv",
)
PATH, DYNAMIC, GRID, HINGE = NAMES
EQUAL = ("--travel-to-opening", "equal")
DOME = ("-g", "dome_height_mm=6.5", "-g", "dome_thickness_mm=0.75", "-g", "elastic_modulus_MPa=26")


@pytest.fixture
def fit(call: Any, folder: Path) -> Any:
    for name in NAMES:
        (folder / name).write_bytes((DATA / name).read_bytes())
    return lambda *arguments: call("fit", *arguments)


def values(text: str) -> dict[str, dict[str, Any]]:
    return {row.get("key") or row["quantity"]: row for row in json.loads(text)}


def test_a_dome_becomes_a_calibration(fit: Any, folder: Path) -> None:
    result = fit("bistable", PATH, *EQUAL, *DOME, "-o", "dome.yaml", "--plot", "dome.svg")
    assert result.exit_code == ExitCode.DONE
    head, *rows = [line.split() for line in result.stdout.splitlines()]
    assert head == ["key", "value", "standard_error", "unit", "status"]
    assert rows[0] == ["bistable_stiffness_N_per_mm", "44.12", "0.36", "N/mm", "free"]
    assert (
        "55 points: rms residual 1.47 mJ, R^2 0.99703; strongest correlation 0.87" in result.stderr
    )
    assert "opening = 1 travel, as given (assumed, not fitted)" in result.stderr
    assert "warning: nothing is sampled from 1.864 to 13.71 mm: the barrier of" in result.stderr
    assert result.stderr.endswith("written: dome.yaml\nwritten: dome.svg\n")
    found = read_calibration(folder / "dome.yaml")
    assert found.values is not None
    assert found.values.stroke_mm is not None
    assert found.values.stroke_mm.value == pytest.approx(13.494, abs=1e-3)
    assert found.geometry is not None
    assert found.geometry.dome_height_mm == 6.5
    assert found.curve is not None
    assert found.curve.opening_per_travel == 1.0
    assert len(found.curve.travel_mm) == 55
    assert found.curve.unsampled_mm == [[1.86437563, 13.7083004]]
    assert found.sources[0].file == PATH
    assert len(found.correlation or []) == 3
    assert [w.partition(" ")[0] for w in found.warnings] == ["nothing", "neighboring"]
    drawn = (folder / "dome.svg").read_text()
    for text in (
        "travel of the dome (mm)",
        "energy (mJ)",
        "law - data (mJ)",
        "no data: extrapolated",
    ):
        assert text in drawn


def test_the_same_bytes_every_time(fit: Any, folder: Path) -> None:
    written = []
    for name in ("a", "b"):
        files = ("-o", f"{name}.yaml", "--plot", f"{name}.svg")
        fit("bistable", PATH, *EQUAL, "--bootstrap", "10", *files)
        written.append([(folder / file).read_bytes() for file in (f"{name}.yaml", f"{name}.svg")])
    assert written[0] == written[1]


def test_a_stroke_is_a_proportion(fit: Any, folder: Path) -> None:
    result = fit("bistable", PATH, "--travel-to-opening", "stroke:3.5", "-o", "dome.yaml", *DOME)
    assert "opening = 0.25533 travel, so that the inverted well opens 3.5 mm" in result.stderr
    curve = read_calibration(folder / "dome.yaml").curve
    assert curve is not None
    assert curve.opening_per_travel == pytest.approx(3.5 / 13.7083, abs=1e-4)


def test_dirty_data_are_called_so(fit: Any, folder: Path) -> None:
    result = fit("bistable", DYNAMIC, *EQUAL, *DOME, "-o", "dirty.yaml")
    assert result.exit_code == ExitCode.DONE
    assert "warning: ringing: the travel reverses 76 times" in result.stderr
    assert "warning: drifting energy: at 94 points" in result.stderr
    found = read_calibration(folder / "dirty.yaml")
    assert found.curve is None
    assert any(text.startswith("ringing") for text in found.warnings)


def test_quasi_static_pieces(fit: Any) -> None:
    result = fit("bistable", DYNAMIC, *EQUAL, *DOME, "--branches", "quasi-static")
    assert "dropped 1194 of 1308 points that snap or ring" in result.stderr
    assert "ringing: the travel" not in result.stderr
    assert "written:" not in result.stderr


def test_values_can_be_held(fit: Any) -> None:
    options = ("--fix", "force_linearity=0.02", "--fix", "stroke_mm=13.5", "--format", "json", "-q")
    found = values(fit("bistable", PATH, *EQUAL, *options).stdout)
    assert found["stroke_mm"]["value"] == 13.5
    assert found["stroke_mm"]["status"] == "fixed"
    assert found["stroke_mm"]["standard_error"] is None
    assert found["bistable_stiffness_N_per_mm"]["status"] == "free"
    freed = ("--free", "bistable_stiffness_N_per_mm", *options)
    assert values(fit("bistable", PATH, *EQUAL, *freed).stdout) == found


def test_bootstrap_intervals_are_printed_and_written(fit: Any, folder: Path) -> None:
    options = ("--bootstrap", "50", "--seed", "3", "--format", "csv", "-o", "b.yaml", "-q")
    result = fit("bistable", PATH, *EQUAL, *options)
    (first, *_) = csv.DictReader(io.StringIO(result.stdout))
    assert float(first["lower"]) < float(first["value"]) < float(first["upper"])
    found = read_calibration(folder / "b.yaml")
    assert found.values is not None
    assert found.values.bistable_stiffness_N_per_mm is not None
    assert found.values.bistable_stiffness_N_per_mm.interval == [
        float(first["lower"]),
        float(first["upper"]),
    ]
    assert "bootstrap of 50 (seed 3)" in found.method


def test_a_pressure_over_an_area(fit: Any, folder: Path) -> None:
    options = ("--quantity", "pressure", "--area", "260", "-o", "p.yaml", "--plot", "p.png")
    result = fit("bistable", PATH, *EQUAL, *options)
    assert result.exit_code == ExitCode.DONE
    assert "rms residual 4.03 N" in result.stderr
    assert "area 260 mm2" in read_calibration(folder / "p.yaml").method
    assert (folder / "p.png").read_bytes().startswith(b"\x89PNG")


def test_a_robust_loss_says_its_scale(fit: Any, folder: Path) -> None:
    fit("bistable", PATH, *EQUAL, "--loss", "huber", "--loss-scale", "0.5", "-o", "r.yaml")
    found = read_calibration(folder / "r.yaml")
    assert found.method == "least squares on the energy, huber loss beyond 0.5"


def test_geometry_comes_from_a_spec_or_is_missed(fit: Any, folder: Path) -> None:
    missed = fit("bistable", PATH, *EQUAL)
    assert "no geometry given" in missed.stderr
    options = ("--spec", "three_unit.yaml", "-g", "dome_thickness_mm=0.8", "-o", "s.yaml")
    result = fit("bistable", PATH, *EQUAL, *options)
    assert "no geometry given" not in result.stderr
    found = read_calibration(folder / "s.yaml").geometry
    assert found is not None
    assert (found.unit_separation_mm, found.dome_thickness_mm) == (3.0, 0.8)


def test_the_mapping_is_asked_for(fit: Any) -> None:
    result = fit("bistable", PATH)
    assert result.exit_code == ExitCode.USAGE
    for text in ("--travel-to-opening is needed", "equal", "proportional:FACTOR", "stroke:3.5"):
        assert text in result.stderr


def test_a_hinge(fit: Any, folder: Path) -> None:
    result = fit(
        "hinge",
        HINGE,
        "--where",
        "variant=gap 4.5 mm",
        "-o",
        "h.yaml",
        "-g",
        "unit_separation_mm=4.5",
    )
    assert result.exit_code == ExitCode.DONE
    row = ["hinge_stiffness_N_mm_per_rad", "22.7", "-", "N", "mm/rad", "free"]
    assert result.stdout.splitlines()[1].split() == row
    assert "1 point, met exactly" in result.stderr
    assert "1 point for as many free values: no error estimate" in result.stderr
    found = read_calibration(folder / "h.yaml")
    assert found.values is not None
    assert found.values.hinge_stiffness_N_mm_per_rad is not None
    assert found.values.hinge_stiffness_N_mm_per_rad.value == pytest.approx(22.7, abs=1e-3)
    assert found.correlation is None


def test_rows_of_different_hinges_are_said(fit: Any, folder: Path) -> None:
    result = fit("hinge", HINGE, "--plot", "h.svg")
    assert "rows of 9 different variant are fitted as one hinge" in result.stderr
    assert "rotation (rad)" in (folder / "h.svg").read_text()


@pytest.mark.parametrize("method", ["scaling", "interpolation"])
def test_a_grid(fit: Any, folder: Path, method: str) -> None:
    result = fit("grid", GRID, "--method", method, "--format", "json", "-o", "g.yaml")
    assert result.exit_code == ExitCode.DONE
    row = values(result.stdout)["inverted_energy_mJ"]
    assert row["left_out_largest_percent"] == pytest.approx(2.3, abs=0.2)
    assert "9 points over dome_height_mm, dome_thickness_mm" in result.stderr
    found = read_calibration(folder / "g.yaml").grid
    assert found is not None
    assert found.method == method
    assert len(found.points["inverted_energy_mJ"]) == 9
    if method == "scaling":
        assert row["exponent_dome_thickness_mm"] == pytest.approx(2.79, abs=0.01)
        assert found.scaling is not None
        law = found.scaling["inverted_energy_mJ"]
        assert law.exponents["dome_height_mm"] == row["exponent_dome_height_mm"]


def test_what_all_points_of_a_grid_share(fit: Any, folder: Path) -> None:
    fit("grid", GRID, "-g", "elastic_modulus_MPa=26", "--spec", "three_unit.yaml", "-o", "g.yaml")
    found = read_calibration(folder / "g.yaml").geometry
    assert found is not None
    assert (found.elastic_modulus_MPa, found.unit_separation_mm) == (26.0, 3.0)
    assert found.dome_height_mm is None, "the points differ in it"


def test_a_grid_for_people(fit: Any) -> None:
    result = fit("grid", GRID)
    line = next(text for text in result.stdout.splitlines() if text.startswith("inverted_energy"))
    name, *numbers = line.split()
    assert name == "inverted_energy_mJ"
    assert [float(number) for number in numbers] == pytest.approx(
        [67.37, 0.4, 1.762, 0.0181, 2.787, 0.0126, 2.2, 1.3], rel=5e-3
    )


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (
            ("bistable", PATH, "--travel-to-opening", "stroke"),
            "expected equal, proportional:FACTOR",
        ),
        (("bistable", PATH, "--travel-to-opening", "stroke:-1"), "with a number > 0"),
        (("bistable", PATH, "--travel-to-opening", "equal:2"), "expected equal, proportional"),
        (("bistable", PATH, *EQUAL, "--quantity", "force"), "the curve has energy, pressure"),
        (("bistable", PATH, *EQUAL, "--quantity", "pressure"), "pressure needs --area MM2"),
        (("bistable", PATH, *EQUAL, "--quantity", "work"), "no work without force_N"),
        (("bistable", PATH, *EQUAL, "--area", "3"), "--area is for pressure"),
        (("bistable", PATH, *EQUAL, "--fix", "stroke=3"), "did you mean stroke_mm?"),
        (
            ("bistable", PATH, *EQUAL, "--fix", "stroke_mm=x"),
            "--fix stroke_mm=x: expected a number from 1e-12 to 1e+12",
        ),
        (("bistable", PATH, *EQUAL, "--fix", "force_linearity=2"), "expected a number from 0 to 1"),
        (("bistable", PATH, *EQUAL, "--free", "stroke_mm"), "is not free: give its value, --fix"),
        (("bistable", PATH, *EQUAL, "--free", "stroke"), "did you mean stroke_mm?"),
        (
            ("bistable", PATH, *EQUAL, "--loss", "huber", "--loss-scale", "0"),
            "--loss-scale 0: expected a number > 0",
        ),
        (("bistable", PATH, *EQUAL, "--loss-scale", "1"), "--loss-scale is for a robust loss"),
        (("bistable", PATH, *EQUAL, "--bootstrap", "1"), "one sample gives no interval"),
        (("grid", GRID, "-g", "dome_height_mm=3"), "the table has a column dome_height_mm"),
        (
            ("bistable", PATH, "--travel-to-opening", "proportional:1e-6"),
            "is not from 1e-12 to 1e+12: is a unit, or the mapping, another one?",
        ),
        (
            ("bistable", PATH, *EQUAL, "--fix", "stroke_mm=1e-300"),
            "--fix stroke_mm=1e-300: expected a number from 1e-12 to 1e+12",
        ),
        (
            ("hinge", HINGE, "-g", "unit_cell_mm=22", "-g", "chamber_width_mm=50"),
            "--geometry: geometry.chamber_width_mm: expected 20 as unit_cell_mm has it, found 50",
        ),
        (
            ("hinge", HINGE, "--loss", "huber", "--loss-scale", "1e-300"),
            "--loss-scale 1e-300: expected a number > 0, from 1e-12",
        ),
        (("bistable", PATH, *EQUAL, "-g", "dome_hight_mm=6.5"), "did you mean dome_height_mm?"),
        (("bistable", PATH, *EQUAL, "-g", "dome_height_mm=-1"), "expected a length > 0 in mm"),
        (("bistable", PATH, *EQUAL, "-g", "dome_height_mm"), "expected KEY=VALUE"),
        (("bistable", PATH, *EQUAL, "-g", "dome_height_mm=650"), "(meters?)"),
        (
            ("bistable", PATH, *EQUAL, "--plot", "p.pdf"),
            "expected a name that ends in .svg or .png",
        ),
        (("bistable", PATH, *EQUAL, "-o", "none/x.yaml"), "cannot write none/x.yaml"),
        (("bistable", PATH, *EQUAL, "-o", PATH), "expected a name that ends in .yaml"),
        (
            ("bistable", PATH, *EQUAL, "--spec", "three_unit.yaml", "-o", "three_unit.yaml"),
            "is the spec or data that is read",
        ),
        (("bistable", GRID, *EQUAL), "expected a column pole_travel_mm or travel_mm"),
        (("bistable", "none.csv", *EQUAL), "none.csv: file: expected a readable file"),
        (("hinge", GRID), "expected a column rotation_rad or rotation_mid_chamber_rad"),
        (("hinge", HINGE, "--loss-scale", "-1"), "--loss-scale is for a robust loss"),
        (("grid", PATH), "expected a column of the geometry, such as dome_height_mm"),
        (("grid", GRID, "-o", "g.csv"), "expected a name that ends in .yaml"),
    ],
)
def test_what_makes_no_sense(fit: Any, folder: Path, options: tuple[str, ...], said: str) -> None:
    output = () if "-o" in options or "--plot" in options else ("-o", "out.yaml")
    result = fit(*options, *output)
    assert result.exit_code == ExitCode.USAGE
    assert said in result.stderr
    assert result.stdout == ""
    assert not (folder / "out.yaml").exists()


def test_a_fit_that_fails_leaves_the_old_file(fit: Any, folder: Path) -> None:
    (folder / "out.yaml").write_text("calibration_version: 1\nmade_by: dpg old")
    (folder / "two.csv").write_text("travel_mm,energy_mJ\n0,0\n1,2\n")
    result = fit("bistable", "two.csv", *EQUAL, "-o", "out.yaml")
    assert result.exit_code == ExitCode.USAGE
    assert "2 points for 3 free values: give more, or fix some" in result.stderr
    assert (folder / "out.yaml").read_text() == "calibration_version: 1\nmade_by: dpg old"


def test_a_reader_that_has_had_enough_gets_its_file(fit: Any, folder: Path, start: Any) -> None:
    read, write = os.pipe()
    os.close(read)
    process = start("fit", "bistable", PATH, *EQUAL, "-o", "d.yaml", stdout=write)
    os.close(write)
    assert process.wait(30) == ExitCode.DONE
    assert read_calibration(folder / "d.yaml").values is not None


def test_an_interrupt_while_writing_leaves_the_old_file(
    fit: Any, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def half(_: YAML, __: Any, stream: TextIO) -> None:
        stream.write("calibration_version: 1")
        raise KeyboardInterrupt

    monkeypatch.setattr(YAML, "dump", half)
    (folder / "d.yaml").write_text("calibration_version: 1\nmade_by: dpg old")
    before = sorted(path.name for path in folder.iterdir())
    result = fit("bistable", PATH, *EQUAL, "-o", "d.yaml")
    assert result.exit_code == ExitCode.INTERRUPTED
    assert "nothing half-written is left" in result.stderr
    assert (folder / "d.yaml").read_text() == "calibration_version: 1\nmade_by: dpg old"
    assert sorted(path.name for path in folder.iterdir()) == before


def test_the_geometry_of_a_spec_whose_calibration_is_yet_to_be_made(
    call: Any, fit: Any, folder: Path
) -> None:
    """From finite elements to a fit to a spec that names it: nothing waits for itself."""
    text = (folder / "three_unit.yaml").read_text()
    named = text.replace("calibration: published", "calibration: [dome.yaml, published]")
    (folder / "new.yaml").write_text(named)
    assert call("predict", "new.yaml").exit_code == ExitCode.USAGE
    assert call("fe", "hinge", "new.yaml", "--output", "deck", "-q").exit_code == ExitCode.DONE
    options = ("--travel-to-opening", "stroke:3.5", "--spec", "new.yaml", "-o", "dome.yaml", "-q")
    assert fit("bistable", PATH, *options).exit_code == ExitCode.DONE
    assert call("predict", "new.yaml", "-q").exit_code == ExitCode.DONE


def test_columns_with_decimal_commas_are_no_labels(call: Any, folder: Path) -> None:
    rows = "\n".join(f"0,{n:02};{2.5 * n:.2f}".replace(".", ",") for n in range(1, 11))
    (folder / "comma.csv").write_text(f"rotation_rad;moment_N_mm\n{rows}\n", encoding="utf-8")
    result = call("fit", "hinge", "comma.csv")
    assert result.exit_code == ExitCode.DONE
    assert "are fitted as one hinge" not in result.stderr


def test_units_that_contradict_each_other_are_asked_about(call: Any, folder: Path) -> None:
    rows = "0;0\n0,5;0,005\n1;0,008\n2;-0,002\n3;-0,003\n4;0,006\n"
    (folder / "kn.csv").write_text(f"Weg (mm);Kraft (kN)\n(mm);(N)\n{rows}", encoding="utf-8")
    chosen = ("--column", "travel_mm=Weg", "--column", "force_N=Kraft")
    result = call("fit", "bistable", "kn.csv", *chosen, "--travel-to-opening", "equal")
    assert result.exit_code == ExitCode.USAGE
    assert "found kN and N (say which: --units force=N)" in result.stderr
