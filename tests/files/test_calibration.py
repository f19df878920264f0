"""Calibration files: what is written is read back, and every mistake has its place."""

import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from dpgcli.calibration.choices import GridMethod
from dpgcli.calibration.fits import Parameter, fit_linear
from dpgcli.calibration.grid import FittedGridLaw, GridPoints
from dpgcli.design.outputs import Output
from dpgcli.errors import OutputError, SpecError
from dpgcli.files.calibration import (
    Calibration,
    DataFile,
    made_by,
    read_calibration,
    write_calibration,
)
from dpgcli.files.calibration.models import KnownErrors
from dpgcli.files.calibration.results import (
    fitted,
    grid_of,
)
from dpgcli.files.last_line import sealed

WHOLE = """\
calibration_version: 1
made_by: dpg 0.1.0
method: least squares on the energy, linear loss
values:
  bistable_stiffness_N_per_mm: {value: 12.84, standard_error: 0.31, interval: [12.2, 13.5]}
  force_linearity: {value: 0.043, standard_error: 0.002}
  stroke_mm: {value: 3.5}
correlation:
- [1.0, -0.93]
- [-0.93, 1.0]
geometry: {dome_height_mm: 6.5, elastic_modulus_MPa: 26}
curve:
  travel_mm: [0, 1, 14]
  energy_mJ: [0, 20.5, 68]
  opening_per_travel: 0.2553
  unsampled_mm: [[1, 14]]
grid:
  method: scaling
  over: [dome_height_mm]
  points: {dome_height_mm: [4.5, 5.5, 6.5], stroke_mm: [9.0, 11.0, 13.0]}
  scaling:
    stroke_mm: {at_reference: 11, exponents: {dome_height_mm: 1}}
quality: {n_points: 57, r_squared: 0.98, rms_residual: 1.2, residual_unit: mJ}
warnings: [no data from 1 to 14 mm]
sources:
- {file: dome.csv, sha256: "DIGEST", rows: 57}
""".replace("DIGEST", 64 * "0")


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "tpu.yaml"


def read(path: Path, text: str) -> Calibration:
    return read_as_it_is(path, sealed(text))


def read_as_it_is(path: Path, text: str) -> Calibration:
    path.write_text(text, encoding="utf-8")
    return read_calibration(path)


def problems(path: Path, text: str) -> list[str]:
    with pytest.raises(SpecError) as raised:
        read(path, text)
    return [str(problem).removeprefix(f"{path}:") for problem in raised.value.problems]


def test_what_is_written_is_read_back(path: Path) -> None:
    found = read(path, WHOLE)
    again = path.with_name("again.yaml")
    write_calibration(again, found)
    assert read_calibration(again) == found


@pytest.fixture
def own(path: Path) -> str:
    """The text of a file as `dpg fit` writes it."""
    write_calibration(path, read(path, WHOLE).model_copy(update={"made_by": made_by()}))
    return path.read_text(encoding="utf-8")


@pytest.mark.slow
def test_no_beginning_of_a_fitted_file_is_believed(path: Path, own: str) -> None:
    for length in range(len(own) - 1):
        with pytest.raises(SpecError):
            read_as_it_is(path, own[:length])
    assert read_as_it_is(path, own[:-1]) == read_as_it_is(path, own)  # but for its last break


def test_a_curve_without_anything_is_a_problem_of_its_own(path: Path) -> None:
    cut = WHOLE[: WHOLE.index("curve:")] + "curve:\n"
    assert any("curve: expected" in said for said in problems(path, cut))


def test_a_fitted_file_may_have_other_line_breaks(path: Path, own: str) -> None:
    found = read_calibration(path)
    path.write_bytes(own.replace("\n", "\r\n").encode())
    assert read_calibration(path) == found


def test_an_edited_file_says_so(path: Path, own: str) -> None:
    edited = own.replace("12.84", "12.85")
    assert edited != own
    with pytest.raises(SpecError, match="expected the text of the SHA-256 in its last line"):
        read_as_it_is(path, edited)
    without = edited[: edited.rindex("#")]
    with pytest.raises(SpecError, match="expected its SHA-256 in its last line"):
        read_as_it_is(path, without)
    by_hand = without.replace(", SHA-256 in the last line", ", edited")
    assert by_hand != without
    assert read_as_it_is(path, by_hand).made_by.endswith("edited")


@pytest.mark.parametrize(
    ("old", "new", "where"),
    [
        ("{value: 3.5}", "", "7:3: values.stroke_mm"),
        ("{dome_height_mm: 6.5, elastic_modulus_MPa: 26}", "", "11:1: geometry"),
        ("elastic_modulus_MPa: 26}", "elastic_modulus_MPa: }", "11:33: geometry.elastic_mod"),
    ],
)
def test_a_key_without_a_value_is_none_that_is_absent(
    path: Path, old: str, new: str, where: str
) -> None:
    found = problems(path, WHOLE.replace(old, new))
    assert any(said.startswith(where) and "found nothing" in said for said in found), found


def test_what_data_do_not_tell_may_have_a_huge_error(path: Path) -> None:
    found = read(path, WHOLE.replace("standard_error: 0.31", "standard_error: 1.0e+23"))
    assert found.uncertain["bistable_stiffness_N_per_mm"] == 1e23


@pytest.mark.slow
def test_other_processes_can_have_it(path: Path) -> None:
    found = read(path, WHOLE)
    assert found.grid is not None
    assert found.grid.law.points.are_inside(np.array([[5.0], [7.0]])).tolist() == [True, False]
    script = "import pickle, sys; found = pickle.load(sys.stdin.buffer); print(found.values)"
    sent = pickle.dumps(found)
    done = subprocess.run(
        [sys.executable, "-c", script], input=sent, capture_output=True, check=False
    )
    assert done.stdout.decode().strip() == str(found.values), done.stderr.decode()


def test_the_same_bytes_every_time(path: Path) -> None:
    found = read(path, WHOLE)
    write_calibration(path, found)
    first = path.read_bytes()
    write_calibration(path, read_calibration(path))
    assert path.read_bytes() == first
    assert [p.name for p in path.parent.iterdir()] == ["tpu.yaml"]


def test_what_a_spec_needs_is_at_hand(path: Path) -> None:
    found = read(path, WHOLE)
    assert found.values is not None
    assert {key: fitted.value for key, fitted in found.values.given().items()} == {
        "bistable_stiffness_N_per_mm": 12.84,
        "force_linearity": 0.043,
        "stroke_mm": 3.5,
    }
    assert found.uncertain == {"bistable_stiffness_N_per_mm": 0.31, "force_linearity": 0.002}


def test_a_file_that_cannot_be_written_is_not_begun(path: Path) -> None:
    found = read(path, WHOLE)
    with pytest.raises(OutputError, match="cannot write"):
        write_calibration(path / "below.yaml", found)


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        ("version: 1", "version: 2", "1:1: calibration_version: expected 1: what this version"),
        ("made_by:", "made_buy:", '2:1: made_buy: expected a known key, found "made_buy" (did'),
        ("value: 12.84", "value: -1", "5:33: values.bistable_stiffness_N_per_mm.value: expected"),
        ("value: 12.84", 'value: "12.84"', 'found "12.84"'),
        ("value: 12.84", "value: .nan", "found .nan"),
        ("value: 0.043", "value: 1.5", "6:21: values.force_linearity.value: expected"),
        (
            "error: 0.31",
            "error: -0.31",
            "values.bistable_stiffness_N_per_mm.standard_error: expected",
        ),
        ("stroke_mm: {value", "strike_mm: {value", "did you mean stroke_mm?"),
        ("- [1.0, -0.93]\n", "", "8:1: correlation: expected 2 rows of as many numbers"),
        ("- [1.0, -0.93]", "- [1.0, 0.93]", "correlation: expected a symmetric matrix"),
        ("0.93", "1.93", "correlation: expected a matrix without negative eigenvalue"),
        ("- [1.0, -0.93]", "- [0.99999, -0.93]", "correlation: expected a symmetric matrix with 1"),
        ("- [1.0, -0.93]", "- [1.0, -0.93001]", "correlation: expected a symmetric matrix"),
        ("- [1.0, -0.93]", "- [.nan, -0.93]", "correlation"),
        ("dome_height_mm: 6.5", "dome_hight_mm: 6.5", "did you mean dome_height_mm?"),
        ("[0, 1, 14]", "[0, 14, 1]", "13:22: curve.travel_mm.2: expected more than 14, found 1"),
        ("[0, 1, 14]", "[0, 1, true]", "13:21: curve.travel_mm.2: expected numbers in mm"),
        ("[0, 1, 14]", "[0, 1]", "13:3: curve.travel_mm: expected 3 numbers, as energies, found 2"),
        (
            "[[1, 14]]",
            "[[14, 1]]",
            "16:18: curve.unsampled_mm.0: expected the smaller travel first",
        ),
        ("travel: 0.2553", "travel: 0", "curve.opening_per_travel: expected a number > 0"),
        ("over: [dome_height_mm]", "over: [stroke_mm]", "expected a key of the geometry section"),
        ("over: [dome_height_mm]", "over: [unit_cell_mm]", "expected a list for unit_cell_mm"),
        (
            "[4.5, 5.5, 6.5]",
            "[4.5, 5.5]",
            "20:3: grid.points: expected lists of one length, found 2 and 3",
        ),
        ("[4.5, 5.5, 6.5]", "[4.5, 5.5, -6.5]", "expected lists of numbers > 0 by key"),
        ("method: scaling", "method: interpolation", "expected nothing beside another method"),
        (
            "over: [dome_height_mm]",
            "over: [dome_height_mm, dome_height_mm]",
            "grid.over.1: expected each key once, found dome_height_mm again",
        ),
        ("[4.5, 5.5, 6.5]", "[4.5, 4.5, 4.5]", "grid.points: expected points for method scaling"),
        ("at_reference: 11", "at_reference: 12", "expected the law of the points: at_reference 11"),
        (
            "exponents: {dome_height_mm",
            "exponents: {stroke_mm",
            "expected those of dome_height_mm, found stroke_mm",
        ),
        (
            "    stroke_mm: {at",
            "    limit_pressure_MPa: {at",
            "expected a quantity among the points",
        ),
        ("n_points: 57", "n_points: 57.5", "quality.n_points: expected a whole number from 1"),
        ('000"', '00x"', "sources.0.sha256: expected 64 hexadecimal digits"),
    ],
)
def test_a_mistake_has_its_place(path: Path, before: str, after: str, said: str) -> None:
    assert before in WHOLE
    found = problems(path, WHOLE.replace(before, after))
    assert any(said in problem for problem in found), found


def test_every_mistake_is_said_at_once(path: Path) -> None:
    wrong = WHOLE.replace("12.84", "-1").replace("n_points: 57", "n_points: 0") + "colour: red\n"
    assert [problem.split(":")[0] for problem in problems(path, wrong)] == ["5", "23", "27"]


def test_a_calibration_says_something(path: Path) -> None:
    head = "calibration_version: 1\nmade_by: dpg\nmethod: none\n"
    assert problems(path, head) == ["1:1: document: expected values, a grid or both, found neither"]
    assert problems(path, head + "values: {}\n")


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(SpecError, match="no such file"):
        read_calibration(tmp_path / "none.yaml")


@pytest.mark.parametrize(
    ("travel", "gaps", "said"),
    [
        ("[0, 1, 14]", "[[2, 13]]", None),
        ("[0, 1, 14]", "[[0, 1], [1, 14]]", None),
        ("[0.5, 1, 14]", "[[0, 0.5]]", None),
        ("[0, 1, 14]", "[[1, 15]]", "unsampled_mm.0: expected travels from 0 to 14, gap after gap"),
        ("[0, 1, 14]", "[[-1, 0]]", "unsampled_mm.0: expected travels from 0 to 14, gap after gap"),
        ("[0, 1, 14]", "[[1, 14], [0, 1]]", "unsampled_mm.1: expected travels from 14 to 14"),
        ("[0, 1, 14]", "[[0, 14]]", "unsampled_mm.0: expected no travel_mm between the two"),
        ("[0, 1, 1e300]", "[]", "travel_mm.2: expected numbers in mm up to 1e12"),
        ("[0, 1e-300, 1]", "[]", "travel_mm.1: expected more than 0, found 1e-300"),
    ],
)
def test_gaps_and_points_of_a_curve_fit_together(
    path: Path, travel: str, gaps: str, said: str | None
) -> None:
    text = WHOLE.replace("[0, 1, 14]", travel).replace("[[1, 14]]", gaps)
    if said is None:
        read(path, text)
        return
    (problem,) = problems(path, text)
    assert f"curve.{said}" in problem


MEASURED = """\
  pressure_MPa: [0, 0.15, null]
  volume_mm3: [null, 30.5, 400]
  snap_pressure_MPa: 0.15
"""


def with_measured(text: str) -> str:
    return WHOLE.replace("  unsampled_mm: [[1, 14]]\n", f"  unsampled_mm: [[1, 14]]\n{text}")


def test_a_curve_keeps_what_was_measured_beside_it(path: Path) -> None:
    found = read(path, with_measured(MEASURED))
    again = path.with_name("again.yaml")
    write_calibration(again, found)
    assert read_calibration(again) == found
    curve = found.known.curve
    assert curve is not None
    assert (curve.pressure, curve.volume) == ([0.0, 0.15, None], [None, 30.5, 400.0])
    assert curve.snap_pressure == 0.15


def test_a_curve_without_is_written_as_before(path: Path) -> None:
    found = read(path, WHOLE)
    write_calibration(path, found)
    written = path.read_text(encoding="utf-8")
    assert not any(key in written for key in ("pressure_MPa", "volume_mm3"))
    assert found.known.curve is not None
    assert found.known.curve.snap_pressure is None


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        ("[0, 0.15, null]", "[0, 0.15]", "curve.pressure_MPa: expected 3 numbers, as travels, fou"),
        ("[null, 30.5, 400]", "[30.5, 400]", "curve.volume_mm3: expected 3 numbers, as travels"),
        ("[0, 0.15, null]", "[0, .nan, 1]", "curve.pressure_MPa.1: expected numbers in MPa, one"),
        ("[0, 0.15, null]", "[0, x, 1]", "curve.pressure_MPa.1: expected numbers in MPa, one"),
        ("[0, 0.15, null]", "0.15", "curve.pressure_MPa: expected numbers in MPa, one for each"),
        (
            "pressure_MPa: 0.15",
            "pressure_MPa: 0",
            "curve.snap_pressure_MPa: expected a pressure > 0",
        ),
        ("pressure_MPa: 0.15", "pressure_MPa:", "curve.snap_pressure_MPa: expected a pressure > 0"),
        ("volume_mm3", "volume_mm", "curve.volume_mm: expected a known key"),
    ],
)
def test_mistakes_beside_a_curve(path: Path, before: str, after: str, said: str) -> None:
    assert before in MEASURED
    (problem,) = problems(path, with_measured(MEASURED.replace(before, after)))
    assert said in problem


@pytest.mark.parametrize(
    "rows",
    [
        "[0.9999999999999998, -0.93]\n- [-0.93, 1.0000000000000002]",
        "[1, -0.9299999999999999]\n- [-0.93, 1]",
        "[1, -1.0000000000000002]\n- [-1, 1]",
    ],
)
def test_a_correlation_is_one_up_to_rounding(path: Path, rows: str) -> None:
    """What np.corrcoef gives, written by hand."""
    path.write_text(WHOLE.replace("[1.0, -0.93]\n- [-0.93, 1.0]", rows), encoding="utf-8")
    found = read_calibration(path).known
    keys = ("bistable_stiffness_N_per_mm", "force_linearity")
    assert found.correlation_of(*keys) == pytest.approx(-0.93, abs=0.0701)
    assert found.correlation_of(keys[0], keys[0]) == 1.0


def test_a_correlation_needs_the_order_of_its_values(path: Path) -> None:
    (first,) = (f"{line}\n" for line in WHOLE.splitlines() if line.startswith("  bistable"))
    turned = WHOLE.replace(first, "").replace("  stroke_mm: {value: 3.5}\n", first)
    (said,) = problems(path, turned)
    assert said.startswith("4:1: values: expected the order bistable_stiffness_N_per_mm, force_lin")


def test_a_fit_is_written_and_read_back(path: Path) -> None:
    """A value that was held has no error; the correlation is that of the others."""
    keys = ("bistable_stiffness_N_per_mm", "force_linearity", "stroke_mm")
    design = np.random.default_rng(0).normal(size=(20, 3))
    free = [Parameter(key, 0.5, is_free=key != "force_linearity") for key in keys]
    observed = design @ np.array([2.0, 0.5, 1.0]) + np.random.default_rng(1).normal(size=20) / 10
    found = fit_linear(free, design, observed, resamples=20)
    head = {"calibration_version": 1, "made_by": made_by(), "method": "test"}
    source = DataFile(file="some.csv", sha256=64 * "0", rows=20)
    written = Calibration.model_validate({**head, **fitted(found, "N", source)})
    write_calibration(path, written)
    again = read_calibration(path)
    assert again.values == written.values
    assert list(again.uncertain) == [keys[0], keys[2]]
    assert again.correlation == written.correlation
    assert again.correlation is not None
    assert again.correlation[0][1] == pytest.approx(found.correlation[0, 2])
    assert again.values is not None
    assert again.values.force_linearity is not None
    assert again.values.force_linearity.interval is None


@pytest.mark.parametrize("method", list(GridMethod))
def test_a_grid_is_written_and_read_back(path: Path, method: GridMethod) -> None:
    geometry = np.array([[4.0, 0.5], [5.0, 0.5], [4.0, 1.0], [6.0, 1.0], [5.0, 0.8]])
    quantities = {"bistable_stiffness_N_per_mm": np.array([5.0, 4.8, 35.0, 31.0, 18.0])}
    law = FittedGridLaw(
        method, GridPoints(("dome_height_mm", "dome_thickness_mm"), geometry, quantities)
    )
    head = {"calibration_version": 1, "made_by": made_by(), "method": "test"}
    write_calibration(path, Calibration.model_validate({**head, "grid": grid_of(law)}))
    grid = read_calibration(path).grid
    assert grid is not None
    asked = np.array([[4.5, 0.7], [7.0, 0.7]])
    for first, second in zip(
        law.at("bistable_stiffness_N_per_mm", asked),
        grid.law.at("bistable_stiffness_N_per_mm", asked),
        strict=True,
    ):
        assert np.array_equal(first, second)


ERRORS = """\
known_errors:
  shapes: {largest: 0.05, rms: 0.02, against: states not given}
  inverted_stiffness: {largest: 0.15, against: "moments: -10 N mm"}
"""


def test_what_is_known_of_outputs_is_written_and_read_back(path: Path) -> None:
    found = read(path, WHOLE + ERRORS)
    write_calibration(path, found)
    known = read_as_it_is(path, path.read_text(encoding="utf-8")).known
    assert known.known_errors == {
        "shapes": (0.05, 0.02, "states not given"),
        "inverted_stiffness": (0.15, None, "moments: -10 N mm"),
    }
    assert known.shape_error == known.known_errors["shapes"]
    assert (known.warnings, known.residual) == (
        ("no data from 1 to 14 mm",),
        "1.2 mJ rms at 57 points",
    )


def test_a_fit_s_own_errors_of_states_come_first(path: Path) -> None:
    quality = "quality: {n_points: 57, left_out_rms: 0.03, left_out_largest: 0.04}"
    text = WHOLE.replace(WHOLE.splitlines()[-4], quality)
    assert "residual_unit" not in text
    known = read(path, text + ERRORS).known
    assert known.shape_error is not None
    assert known.shape_error[:2] == (0.04, 0.03)
    assert known.residual == ""


def test_one_point_has_no_residual(path: Path) -> None:
    assert read(path, WHOLE.replace("n_points: 57", "n_points: 1")).known.residual == ""


def test_outputs_are_those_that_are_told_apart() -> None:
    assert [*KnownErrors.model_fields] == [output.key for output in Output]


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("  shape: {largest: 1, against: x}", 'a known key, found "shape" (did you mean shapes?)'),
        ("  shapes: {largest: -1, against: x}", "largest: expected a number >= 0, relative"),
        ("  shapes: {rms: 1, against: x}", "largest: expected a number >= 0, relative, found noth"),
        ("  shapes: {largest: 1}", "against: expected what it was compared with, a line of text"),
    ],
)
def test_a_wrong_error_has_its_place(path: Path, line: str, said: str) -> None:
    (problem,) = problems(path, f"{WHOLE}known_errors:\n{line}\n")
    assert f"{len(WHOLE.splitlines()) + 2}:" in problem
    assert said in problem
