"""`dpg fit finger`: the finite-element finger of the examples, and every way to fail."""

import csv
import io
import math
import os
from pathlib import Path
from typing import Any

import pytest

from dpgcli.cli.exits import ExitCode
from dpgcli.files.calibration import Calibration, read_calibration

EXAMPLES = Path(__file__).parents[2] / "configs" / "calibration"
SPEC, DATA = "study.yaml", "tips.csv"
FRAME = ("--first-station", "5.375,0.75", "--tip-offset", "5.375,-0.75")
FIT = ("fit", "finger", SPEC, DATA, *FRAME)
LEVER = "segment_height_mm"
GEOMETRY = ("-g", "chamber_width_mm=20", "-g", "limiting_layer_thickness_mm=1.5")


pytestmark = [pytest.mark.usefixtures("study"), pytest.mark.slow]


@pytest.fixture
def fitted(call: Any, folder: Path) -> Any:
    """What a fit writes."""

    def run(*options: str) -> Calibration:
        result = call(*FIT, *options, "-o", "out.yaml", "-q")
        assert (result.exit_code, result.stderr) == (ExitCode.DONE, "")
        return read_calibration(folder / "out.yaml")

    return run


def value(calibration: Calibration, key: str) -> float:
    found = calibration.values.given().get(key)
    assert found is not None
    return found.value


def test_the_lever_of_the_finite_element_finger(call: Any) -> None:
    result = call(*FIT, "--format", "csv")
    assert result.exit_code == ExitCode.DONE
    rows = {row["key"]: row for row in csv.DictReader(io.StringIO(result.stdout))}
    assert float(rows[LEVER]["value"]) == pytest.approx(12.33, abs=0.01)
    assert float(rows[LEVER]["standard_error"]) == pytest.approx(0.105, abs=0.005)
    assert {key for key, row in rows.items() if row["status"] == "free"} == {LEVER}
    assert (rows["stroke_mm"]["value"], rows["stroke_mm"]["status"]) == ("3.5", "fixed")
    assert "tips before: 15.2 % of the deflection at worst" in result.stderr
    assert "tips after: 7.74 % of the deflection at worst" in result.stderr
    assert "each state from the others alone: " in result.stderr


def test_the_example_with_the_push_that_it_has(call: Any, folder: Path) -> None:
    """What the lever was fitted to is met; what it never saw is met as well."""
    for path in EXAMPLES.glob("[tp][hu]*"):
        (folder / path.name).write_bytes(path.read_bytes())
    spec, data = "three_gap_finger.yaml", "three_gap_finger.csv"
    result = call("fit", "finger", spec, data, *FRAME, "-o", "lever.yaml")
    assert result.exit_code == ExitCode.DONE
    assert value(read_calibration(folder / "lever.yaml"), LEVER) == pytest.approx(13.18, abs=0.01)
    by_file = ("-s", "finger.calibration=[lever.yaml, push_3.5mm.yaml]")
    left_out = read_calibration(folder / "lever.yaml").quality.leave_one_out
    worst = f"each state from the others alone: {100.0 * left_out[1]:.3g} % at worst"
    assert worst in result.stderr
    assert 0.0 < left_out[0] < left_out[1] < 0.2
    counted = ("--uncertainty", "-s", "model_error=leave_one_out", "--pattern", "11?")
    predicted = call("predict", spec, *by_file, *counted)
    percent = f"{100.0 * left_out[0]:.2g} % of the deflection (rms)"
    assert predicted.stderr.splitlines()[-1].startswith(
        f"the model's own error: states that lever.yaml was not fitted to are off by {percent}"
    )
    covers = f"uncertainties cover: fitted values, model error of {100.0 * left_out[0]:.3g} %\n"
    assert covers in predicted.stderr
    rest = ("three_gap_finger_rest.csv", *FRAME, "--format", "csv", "-q")
    errors = []
    for settings in ((), by_file):
        text = call("compare", spec, *rest, *settings).stdout
        rows = csv.DictReader(io.StringIO(text))
        errors.append(max(float(row["error_percent"]) for row in rows))
    assert errors[0] > 19.0
    assert errors[1] < 4.0


def test_the_lever_is_where_the_squares_are_least(call: Any, fitted: Any) -> None:
    """Held against `dpg compare`, which knows nothing of fits: errors only grow beside it."""
    best = value(fitted(), LEVER)

    def squares(lever: float) -> float:
        setting = f"finger.lattice.{LEVER}={lever!r}"
        text = call("compare", SPEC, DATA, *FRAME, "-s", setting, "--format", "csv", "-q").stdout
        return math.fsum(float(row["error_mm"]) ** 2 for row in csv.DictReader(io.StringIO(text)))

    least = squares(best)
    assert squares(best - 0.01) > least < squares(best + 0.01)
    slope = (squares(best + 1e-3) - squares(best - 1e-3)) / 2e-3
    assert abs(slope) < 1e-5 * least / 1e-3


def test_what_is_written_can_be_compared_with(call: Any, fitted: Any) -> None:
    fitted()
    result = call("compare", SPEC, DATA, *FRAME, "--calibration", "out.yaml")
    assert result.exit_code == ExitCode.DONE
    before, after = result.stderr.split("(calibrated, ")
    assert "15.2 % at worst" in before and "7.74 % at worst" in after


def test_what_is_written_can_be_calibrated_by(call: Any, fitted: Any, folder: Path) -> None:
    lever = value(fitted(), LEVER)
    given = (folder / SPEC).read_text().replace("10.75", repr(lever))
    (folder / "given.yaml").write_text(given)
    fitted_one = (
        "-s",
        "finger.lattice.segment_height_mm=null",
        "-s",
        "finger.calibration=out.yaml",
    )
    results = [
        call("predict", *arguments, "--format", "csv", "-q")
        for arguments in ((SPEC, *fitted_one), ("given.yaml",))
    ]
    assert results[0].exit_code == ExitCode.DONE, results[0].stderr
    assert results[0].stdout == results[1].stdout


def test_where_it_holds_is_where_it_is_not_scaled(call: Any, fitted: Any) -> None:
    assert fitted(*GEOMETRY).geometry.chamber_width_mm == 20.0
    wider = ("-s", "finger.calibration=[out.yaml, published]")
    same = call("explain", "three_unit.yaml", *wider)
    assert f"{LEVER:<30} 12.3325" in same.stdout
    wider = (*wider, "-s", "finger.geometry.unit_cell_mm=24")
    scaled = call("explain", "three_unit.yaml", *wider).stdout
    expected = 12.3325 * (22 / 2 + 0.75) / 10.75
    assert f"{LEVER:<30} {expected:.6g}"[:36] in scaled
    assert "scaled" in scaled


def test_the_method_says_frame_and_law(fitted: Any) -> None:
    assert fitted("-s", "finger.law=push_only").method.startswith(
        "least squares on the tips through the equilibrium, linear loss, "
        "first station 5.375,0.75 mm, tip offset 5.375,-0.75 mm, "
        "push-only law, published energy of the dome; held: segment_length_mm 13.75, "
    )


def test_residuals_beyond_a_size_count_less(fitted: Any) -> None:
    robust = fitted("--loss", "huber", "--loss-scale", "0.2")
    assert "huber loss beyond 0.2, first station" in robust.method
    assert value(robust, LEVER) != pytest.approx(value(fitted(), LEVER), abs=1e-3)
    beyond_all = fitted("--loss", "huber", "--loss-scale", "100")
    assert value(beyond_all, LEVER) == pytest.approx(value(fitted(), LEVER), rel=1e-9)


def test_several_values_at_once(fitted: Any) -> None:
    found = fitted("--free", LEVER, "--free", "segment_length_mm")
    assert list(found.uncertain) == [LEVER, "segment_length_mm"]
    assert found.quality.rms_residual < fitted().quality.rms_residual
    (one, other), (again, _) = found.correlation
    assert one == 1.0 and other == again and 0.0 < abs(other) < 1.0


def test_values_that_stand_for_each_other_end_at_a_bound(fitted: Any) -> None:
    """Only the ratio of stroke and lever turns a phalanx."""
    found = fitted("--free", LEVER, "--free", "stroke_mm")
    assert any(f"{LEVER} ended at its bound" in warning for warning in found.warnings)
    assert list(found.uncertain) == ["stroke_mm"]


def test_a_value_named_twice_is_free_once(fitted: Any) -> None:
    assert fitted("--free", LEVER, "--free", LEVER) == fitted()


def test_angles_are_another_target(fitted: Any) -> None:
    """One lever for all gaps: what meets the angles best is near the lever of the tips."""
    found = fitted("--target", "angles")
    assert found.quality.residual_unit == "rad"
    assert found.quality.n_points == 5
    assert value(found, LEVER) == pytest.approx(12.33, abs=0.3)
    assert value(found, LEVER) != value(fitted(), LEVER)


def test_a_seed_gives_the_same_bytes_twice(call: Any, folder: Path) -> None:
    texts = []
    for seed in ("3", "3", "4"):
        options = ("--bootstrap", "4", "--seed", seed, "-q", "-o", "out.yaml")
        assert call(*FIT, *options).exit_code == ExitCode.DONE
        texts.append((folder / "out.yaml").read_bytes())
    assert texts[0] == texts[1] != texts[2]
    found = read_calibration(folder / "out.yaml").values.given().get(LEVER)
    assert found is not None and found.interval is not None
    assert found.interval[0] <= found.value <= found.interval[1]
    assert "bootstrap of 4 (seed 4)" in read_calibration(folder / "out.yaml").method


def test_a_graded_value_that_stays_is_left_out(fitted: Any) -> None:
    found = fitted("-s", "finger.overrides.2.lattice.stroke_mm=3.4")
    assert list(found.values.given()) == [LEVER]
    assert "stroke_mm" not in found.method
    assert "force_linearity 0.043" in found.method


def test_a_figure(call: Any, folder: Path) -> None:
    assert call(*FIT, "--plot", "f.svg", "-q").exit_code == ExitCode.DONE
    assert "known tip" in (folder / "f.svg").read_text()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (
            ("--free", LEVER, "--free", "linear_stiffness_N_per_mm"),
            "do not depend on linear_stiffness_N_per_mm: fix it",
        ),
        (("--free", "lever"), "--free lever: expected one of segment_length_mm, "),
        (
            ("--free", "stroke_mm", "-s", "finger.overrides.2.lattice.stroke_mm=3.4"),
            "--free stroke_mm: units differ in it, expected one value for all",
        ),
        (
            (
                "--free",
                "linear_stiffness_N_per_mm",
                "-s",
                "finger.linear_stiffness_N_per_mm=.inf",
            ),
            "--free linear_stiffness_N_per_mm: is infinite, start from a finite value",
        ),
        (
            ("-s", "finger.lattice.force_linearity=0.9"),
            "at the start not every known state exists: 001 is not_bistable, 010 is",
        ),
        (("-s", "finger.units=2"), "tips.csv:2: pattern: expected 2 digits"),
        (("-s", "finger.lattice.stroke_mm=-1"), "finger.lattice.stroke_mm: expected a length"),
        (("--tip-offset", "1e300,0"), "--tip-offset 1e300,0: expected two numbers in mm"),
        (("-g", "chamber_width_mm=0"), "--geometry: geometry.chamber_width_mm: expected a length"),
        (("-g", "dome_hight_mm=3"), "did you mean dome_height_mm?"),
        (("--loss", "square"), "--loss"),
        (("--loss", "huber", "--loss-scale", "0"), "--loss-scale 0: expected a number > 0"),
        (("--bootstrap", "-1"), "--bootstrap"),
        (("--plot", "f.pdf"), "expected a name that ends in .svg or .png"),
    ],
)
def test_a_fit_that_cannot_be_writes_nothing(
    call: Any, folder: Path, options: tuple[str, ...], said: str
) -> None:
    before = sorted(folder.iterdir())
    result = call(*FIT, "-o", "out.yaml", *options)
    assert (result.exit_code, result.stdout) == (ExitCode.USAGE, "")
    assert said in result.stderr
    assert sorted(folder.iterdir()) == before


@pytest.mark.parametrize(
    ("states", "options", "said"),
    [
        ("pattern,tip_x_mm,tip_y_mm\n000,52,0\n", (), "do not depend on segment_height_mm"),
        (
            "pattern,tip_angle_rad\n100,-0.26\n",
            ("--target", "tips"),
            "the data have no tips to fit to",
        ),
        (
            "pattern,tip_x_mm,tip_y_mm\n100,50,-10\n",
            ("--target", "angles"),
            "the data have no angles to fit to",
        ),
        (
            "pattern,tip_angle_rad\n100,-0.26\n",
            ("--target", "angles", "--free", LEVER, "--free", "stroke_mm"),
            "1 point for 2 free values",
        ),
    ],
)
def test_data_that_say_too_little(
    call: Any, folder: Path, states: str, options: tuple[str, ...], said: str
) -> None:
    (folder / DATA).write_text(states)
    result = call(*FIT, "-o", "out.yaml", *options)
    assert (result.exit_code, result.stdout) == (ExitCode.USAGE, "")
    assert said in result.stderr
    assert not (folder / "out.yaml").exists()


@pytest.mark.parametrize(
    ("output", "said"),
    [
        (SPEC, f"{SPEC} is the spec or data that is read"),
        (f"./{SPEC}", "is the spec or data that is read"),
        ("lever.yaml", "lever.yaml is the spec or data that is read"),
        ("out.csv", "--output out.csv: expected a name that ends in .yaml"),
        ("none/out.yaml", "cannot write none/out.yaml"),
    ],
)
def test_no_file_that_is_read_is_written(call: Any, folder: Path, output: str, said: str) -> None:
    (folder / "lever.yaml").write_text(
        "calibration_version: 1\nmade_by: hand\nmethod: none\n"
        "values: {force_linearity: {value: 0.04}}\n"
    )
    spec = (
        (folder / SPEC).read_text().replace("  lattice:", "  calibration: lever.yaml\n  lattice:")
    )
    (folder / SPEC).write_text(spec.replace("    force_linearity: 0.043\n", ""))
    before = {path: path.read_bytes() for path in folder.iterdir()}
    result = call(*FIT, "-o", output)
    assert (result.exit_code, result.stdout) == (ExitCode.USAGE, "")
    assert said in result.stderr
    assert {path: path.read_bytes() for path in folder.iterdir()} == before


def test_a_reader_that_has_had_enough_is_no_mistake(start: Any, folder: Path) -> None:
    read, write = os.pipe()
    os.close(read)
    process = start(*FIT, "--format", "csv", "-q", "-o", "out.yaml", stdout=write)
    os.close(write)
    _, error = process.communicate(timeout=60)
    assert (process.returncode, error) == (ExitCode.DONE, b"")
    assert value(read_calibration(folder / "out.yaml"), LEVER) == pytest.approx(12.33, abs=0.01)
