"""Curves and tables from CSV: what is read, and the message of every mistake."""

import hashlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dpgcli.errors import SpecError
from dpgcli.files import csv_file
from dpgcli.files.csv_file import Choice
from dpgcli.files.measured import read_curve, read_moments, read_table

DOME = {"dome_height_mm": 6.5, "dome_thickness_mm": 0.75, "elastic_modulus_MPa": 26.0}
GOOD = "travel_mm,energy_mJ\n0,0\n1,20\n13,68\n"


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "c.csv"


def problems(error: pytest.ExceptionInfo[SpecError]) -> list[str]:
    return [str(problem).rpartition("c.csv")[2].lstrip(":") for problem in error.value.problems]


def test_columns_in_any_order_with_comments_marks_and_spaces(path: Path) -> None:
    head = "# from a test\n\n note , energy_mJ, pole_travel_mm ,time_s\n"
    text = head + "  # more\na,0,0,1\nb, 2e1,1,2\n"
    path.write_bytes(b"\xef\xbb\xbf" + text.encode())
    found = read_curve(path)
    assert found.curve.travel.tolist() == [0.0, 1.0]
    assert found.curve.energy is not None
    assert found.curve.energy.tolist() == [0.0, 20.0]
    assert found.curve.time is not None
    assert found.curve.force is None
    assert found.ignored == ("note",)
    assert found.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()


def test_a_column_is_found_at_once_among_a_million() -> None:
    class Names(tuple[str, ...]):
        def index(self, *_: object) -> int:
            raise AssertionError("from the first name on, for each column")

    sheet = csv_file.Sheet("a.csv", Names(("x", "y")), [["1", "2"], ["3", "4"]], [2, 3], "")
    assert [sheet.cells(name) for name in sheet.names] == [["1", "3"], ["2", "4"]]


def test_columns_that_are_needed_are_asked_for_first(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("dpgcli.files.measured._is_numeric", None)
    path.write_text("a,b\n1,2\n3,4\n", encoding="utf-8")
    with pytest.raises(SpecError, match="expected a column of the geometry"):
        read_table(path)


def test_a_cell_without_end(path: Path) -> None:
    path.write_text(f"travel_mm,energy_mJ\n0,0\n{'1' * 200_000},2\nx,3\n", encoding="utf-8")
    with pytest.raises(SpecError, match="3: row: expected cells of a CSV, found field larger"):
        read_curve(path)


@pytest.mark.parametrize("error", ["#DIV/0!", "#N/A", "#VALUE!", "#####", "#WERT!", "#NAME?"])
def test_an_error_of_a_spreadsheet_in_the_first_cell_is_no_comment(path: Path, error: str) -> None:
    path.write_text(f"# mine\n{GOOD}{error},60\n", encoding="utf-8")
    with pytest.raises(SpecError) as caught:
        read_curve(path)
    said = f'6: travel_mm: expected a number, found "{error}" (behind the # of a comment'
    assert problems(caught)[0].startswith(said)
    path.write_text(f"{GOOD}{error}\n", encoding="utf-8")
    with pytest.raises(SpecError, match="expected 2 cells, found 1"):
        read_curve(path)


def test_comments_below_the_header(path: Path) -> None:
    path.write_text(f"{GOOD}# 14,60\n ## a title\n#\n", encoding="utf-8")
    assert read_curve(path).curve.travel.tolist() == [0.0, 1.0, 13.0]


@pytest.mark.parametrize("row", ["#15,60", "#-1,0", "#.5,0", "#+5,0.2"])
def test_a_row_behind_a_bare_mark_is_not_dropped(path: Path, row: str) -> None:
    path.write_text(f"{GOOD}{row}\n", encoding="utf-8")
    with pytest.raises(SpecError) as caught:
        read_curve(path)
    assert "behind the # of a comment stands a space" in problems(caught)[0]


@pytest.mark.parametrize("mark", ["\x0b", "\x0c", "\x1c", "\x1e", "\x85", "\u2028", "\u2029"])
def test_what_is_no_end_of_a_line_of_csv_starts_no_row(path: Path, mark: str) -> None:
    path.write_text(f"{GOOD}# a note{mark}14,60\n", encoding="utf-8")
    assert read_curve(path).curve.travel.tolist() == [0.0, 1.0, 13.0]


@pytest.mark.parametrize("text", ['1.5,"2', '1.5,"2"0'])
def test_an_open_quote_is_no_cell(path: Path, text: str) -> None:
    path.write_text(f"{GOOD}{text}\n", encoding="utf-8")
    with pytest.raises(SpecError, match="5: row: expected cells of a CSV"):
        read_curve(path)


def test_a_file_without_end_is_read_to_a_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(csv_file, "MAX_BYTES", 2**20)
    with pytest.raises(SpecError, match="/dev/zero: file: expected at most 1,024 KiB, found more"):
        read_moments(Path("/dev/zero"))


def test_windows_line_ends(path: Path) -> None:
    path.write_bytes(GOOD.replace("\n", "\r\n").encode())
    assert read_curve(path).curve.travel.tolist() == [0.0, 1.0, 13.0]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "file: expected a header and rows, found nothing"),
        ("# only a comment\n", "file: expected a header and rows, found nothing"),
        ("# c\ntravel_mm,energy_mJ\n", "2: file: expected rows below the header, found none"),
        (
            "energy_mJ\n1\n",
            "header: expected a column pole_travel_mm or travel_mm, found energy_mJ",
        ),
        (
            "travel_m,energy_mJ\n0,1\n",
            '1: header: expected travel_mm, in mm, found "travel_m"',
        ),
        (
            "travel_mm,energy_J\n0,1\n",
            '1: header: expected energy_mJ, in mJ, found "energy_J"',
        ),
        (
            "travel_mm,pole_travel_mm,force_N\n0,0,0\n",
            "header: expected one of pole_travel_mm, travel_mm, found pole_travel_mm and travel_mm",
        ),
        ("travel_mm;energy_mJ\n0;1\n1.5;2;5\n", "3: row: expected 2 cells, found 3"),
        (
            "travel_mm,energy_mJ,energy_mJ\n0,1,1\n",
            '1: header: expected each column once, found "energy_mJ" again',
        ),
        (GOOD + "14\n", "5: row: expected 2 cells, found 1"),
        (GOOD + "14,70,\n", "5: row: expected 2 cells, found 3"),
        (GOOD + "14,\n", '5: energy_mJ: expected a number, found ""'),
        (GOOD + "14,nan\n", '5: energy_mJ: expected a number, found "nan"'),
        (GOOD + "inf,70\n", '5: travel_mm: expected a number, found "inf"'),
        (GOOD + "14,70 mJ\n", '5: energy_mJ: expected a number, found "70 mJ"'),
        (
            GOOD + "1e300,1\n",
            '5: travel_mm: expected a number from -1e+12 to 1e+12, found "1e300" '
            "(is the unit another one?)",
        ),
        (
            GOOD + '"14,5",1\n',
            '5: travel_mm: expected a number, found "14,5" (write a decimal point)',
        ),
        (GOOD + "1_0,1\n", '5: travel_mm: expected a number, found "1_0"'),
        (GOOD + "\uff11\uff14,1\n", '5: travel_mm: expected a number, found "\uff11\uff14"'),
        (
            "travel_mm,energy_mJ\n0,0\n-1,20\n-13,68\n",
            "travel_mm: expected travels that are positive towards inversion, found -13 to 0 "
            "(column travel_mm=-travel_mm reverses it)",
        ),
    ],
)
def test_a_mistake_in_a_curve(path: Path, text: str, said: str) -> None:
    path.write_text(text, encoding="utf-8")
    with pytest.raises(SpecError) as error:
        read_curve(path)
    found = problems(error)
    assert said in [text.strip() for text in found], found


def test_every_mistake_is_said_at_once(path: Path) -> None:
    path.write_text("travel_mm,energy_mJ\n0,x\n1,nan\ny,2\n", encoding="utf-8")
    with pytest.raises(SpecError) as error:
        read_curve(path)
    assert [text.split(":")[0] for text in problems(error)] == ["2", "3", "4"]
    path.write_text("speed,temperature\n0,1\n", encoding="utf-8")
    with pytest.raises(SpecError) as error:
        read_curve(path)
    assert len(problems(error)) == 2


def test_not_utf8_and_not_there(path: Path) -> None:
    path.write_bytes(b"\xfftravel")
    with pytest.raises(SpecError, match="expected text in UTF-8, found byte 0xff"):
        read_curve(path)
    with pytest.raises(SpecError, match="expected a readable file, found no such file"):
        read_curve(path.with_name("none.csv"))
    with pytest.raises(SpecError, match="expected a file, found a directory"):
        read_curve(path.parent)


@pytest.mark.parametrize(
    ("column", "largest", "geometry", "said"),
    [
        ("travel_mm", 0.0135, {}, "(meters? if it is right, say how large the dome is"),
        (
            "travel_mm",
            0.0135,
            DOME,
            "expected a largest value of 0.325 to 130, found 0.0135 (meters?)",
        ),
        ("travel_mm", 13500.0, {}, "(micrometers?"),
        ("energy_mJ", 0.068, {}, "(joules?"),
        ("energy_mJ", 0.068, DOME, "found 0.068 (joules?)"),
        ("energy_mJ", 68000.0, DOME, "found 6.8e+04 (microjoules?)"),
        ("pressure_MPa", 150.0, {}, "(kPa or Pa?"),
        ("pressure_MPa", 150000.0, DOME, "(kPa or Pa?)"),
        ("force_N", 40000.0, {}, "(millinewtons?"),
    ],
)
def test_another_unit_is_suspected(
    path: Path, column: str, largest: float, geometry: dict[str, float], said: str
) -> None:
    other = "energy_mJ" if column == "travel_mm" else "travel_mm"
    path.write_text(f"{column},{other}\n0,0\n{largest},14\n", encoding="utf-8")
    with pytest.raises(SpecError) as error:
        read_curve(path, geometry)
    assert said in problems(error)[0]


SIZES = {"energy_mJ": (68.0, 3), "force_N": (68.0 / 6.5, 2), "pressure_MPa": (0.1495, 0)}


@pytest.mark.parametrize("column", SIZES)
@pytest.mark.parametrize("scale", [1e-3, 0.02, 0.1, 1.0, 30.0, 1e3])
def test_a_scaled_copy_of_a_dome_is_no_mistake(path: Path, column: str, scale: float) -> None:
    """Travel s, force s², energy s³ and the pressure the same, up to rims ten times as stiff."""
    size, power = SIZES[column]
    geometry = {key: v * scale if key.endswith("_mm") else v for key, v in DOME.items()}
    for factor in (0.1, 1.0, 10.0):
        largest = factor * size * scale**power
        path.write_text(f"travel_mm,{column}\n0,0\n{14 * scale},{largest}\n", encoding="utf-8")
        assert read_curve(path, geometry).curve.largest_travel == 14 * scale


@pytest.mark.parametrize("column", SIZES)
@pytest.mark.parametrize("height", [4.5, 6.5, 7.5])
def test_a_thousand_times_as_much_is_one_at_usual_sizes(
    path: Path, column: str, height: float
) -> None:
    size, _ = SIZES[column]
    for factor in (1e-3, 1e3):
        path.write_text(f"travel_mm,{column}\n0,0\n14,{factor * size}\n", encoding="utf-8")
        with pytest.raises(SpecError, match=column):
            read_curve(path, {**DOME, "dome_height_mm": height})


def test_a_small_dome_is_no_mistake_where_the_geometry_says_so(path: Path) -> None:
    path.write_text("travel_mm,force_N\n0,0\n0.06,1\n", encoding="utf-8")
    assert read_curve(path, {"dome_height_mm": 0.03}).curve.largest_travel == 0.06


MOMENTS = 'variant,moment_N_mm,rotation_rad,note\n"a, b",2.5,0.1,1\n"a, b",5,0.2,2\nc,5,0.3,3\n'


def test_moments_of_one_variant(path: Path) -> None:
    path.write_text(MOMENTS, encoding="utf-8")
    found = read_moments(path, "variant=a, b")
    assert found.moment.tolist() == [2.5, 5.0]
    assert found.texts == {"variant": ("a, b", "a, b")}
    assert found.ignored == ("note",)
    assert len(read_moments(path).moment) == 3


@pytest.mark.parametrize(
    ("text", "where", "said"),
    [
        (MOMENTS, "variant=d", "where: expected a text of variant, found 'd' (a, b; c)"),
        (MOMENTS, "varian=c", "header: expected a column varian, found variant, moment_N_mm"),
        (MOMENTS, "variant", "where: expected COLUMN=TEXT, found 'variant'"),
        ("moment_N_m,rotation_rad\n1,1\n", None, "expected moment_N_mm, in N mm, found"),
        ("moment_N_mm,angle\n1,1\n", None, "expected a column rotation_rad or rotation_mid"),
        ("moment_N_mm,rotation_rad\n5,10.3\n", None, "found 10.3 (degrees?)"),
        ("moment_N_mm,rotation_rad\n0.005,0.2\n", None, "found 0.005 (N m? if it is right"),
        ("moment_N_mm,rotation_rad\n5,\n", None, '2: rotation_rad: expected a number, found ""'),
    ],
)
def test_a_mistake_in_moments(path: Path, text: str, where: str | None, said: str) -> None:
    path.write_text(text, encoding="utf-8")
    with pytest.raises(SpecError) as error:
        read_moments(path, where)
    assert said in problems(error)[0]


def test_a_table_over_geometries(path: Path) -> None:
    path.write_text(
        "name,elastic_modulus_MPa,stroke_mm,dome_height_mm,limit_pressure_MPa\n"
        "a,26,3.5,6.5,0.15\nb,26,4.5,7.5,0.18\n",
        encoding="utf-8",
    )
    found = read_table(path)
    assert found.over == ("dome_height_mm",)
    assert np.array_equal(found.geometry, [[6.5], [7.5]])
    assert {key: values.tolist() for key, values in found.quantities.items()} == {
        "stroke_mm": [3.5, 4.5],
        "limit_pressure_MPa": [0.15, 0.18],
    }
    assert found.constant == {"elastic_modulus_MPa": 26.0}
    assert found.ignored == ("name",)
    assert found.doubts == ()


@pytest.mark.parametrize(
    ("head", "rows", "doubt"),
    [
        ("dome_height_mm", ("0.004", "0.0065"), "dome_height_mm is 0.0065 at most: meters?"),
        ("dome_height_mm", ("4000", "6500"), "dome_height_mm is 6500 at most: micrometers?"),
        ("elastic_modulus_MPa", ("1e6", "26e6"), "elastic_modulus_MPa is 2.6e+07 at most: kPa or"),
        ("elastic_modulus_MPa", ("1e-4", "2e-4"), "elastic_modulus_MPa is 0.0002 at most: gigap"),
    ],
)
def test_a_geometry_that_no_soft_finger_has(
    path: Path, head: str, rows: tuple[str, str], doubt: str
) -> None:
    path.write_text(f"{head},stroke_mm\n{rows[0]},1\n{rows[1]},2\n", encoding="utf-8")
    (said,) = read_table(path).doubts
    assert said.startswith(doubt)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("height,stroke_mm\n1,1\n", "expected a column of the geometry, such as dome_height_mm"),
        ("dome_height_mm,name\n1,a\n", "expected a column of a quantity, such as bistable_stiff"),
        (
            "dome_height_mm,stroke_mm\n1,0\n2,1\n",
            "2: stroke_mm: expected a number > 0, at least 1e-12, since log",
        ),
        ("dome_height_mm,stroke_mm\n-1,1\n2,1\n", "2: dome_height_mm: expected a number > 0"),
        (
            "dome_height_mm,stroke_mm\n1,1\n2,2\n1,1\n",
            "4: geometry: expected each geometry once, found that of line 2 again",
        ),
        ("dome_height_mm,stroke_mm\n1,1\n2,x\n", '3: stroke_mm: expected a number, found "x"'),
        (
            "dome_height_mm,force_linearity\n1,0.04\n2,1.5\n",
            "3: force_linearity: expected a number from 0 to 1, found 1.5",
        ),
        ("dome_height_mm,stroke_mm\n1,1\n", "file: expected geometries that differ, found one"),
    ],
)
def test_a_mistake_in_a_table(path: Path, text: str, said: str) -> None:
    path.write_text(text, encoding="utf-8")
    with pytest.raises(SpecError) as error:
        read_table(path)
    assert said in problems(error)[0]


def test_grouped_thousands_are_no_texts_that_tell_hinges_apart(tmp_path: Path) -> None:
    path = tmp_path / "h.csv"
    path.write_text("moment_N_mm;rotation_rad\n1\u00a0133.2;0.04\n2\u00a0250.8;0.08\n")
    found = read_moments(path)
    assert found.moment.tolist() == [1133.2, 2250.8]
    assert found.doubts == ()


@pytest.mark.parametrize("moment", [0.006, 2e6])
def test_a_hinge_of_another_size_is_taken_when_its_unit_is_said(
    tmp_path: Path, moment: float
) -> None:
    path = tmp_path / "hinge.csv"
    path.write_text(f"moment_N_mm,rotation_rad\n{moment / 2},0.1\n{moment},0.2\n")
    with pytest.raises(SpecError, match=r"if it is right, say so: .*'moment=N mm'"):
        read_moments(path)
    said = read_moments(path, choice=Choice(units={"moment": "N mm"}))
    assert said.moment.tolist() == [moment / 2, moment]


@pytest.mark.parametrize(
    "text",
    [
        "hunter2",
        "user: x\npassword: hunter2",
        "hunter2,x\na,b",
        "hunter2,hunter2\na,b",
        "machine a login hunter2\nmachine b login c",
        "-----BEGIN hunter2-----\nMII=\n-----END",
    ],
)
@pytest.mark.parametrize("read", [read_curve, read_moments, read_table])
def test_a_file_without_numbers_is_not_quoted(path: Path, text: str, read: Any) -> None:
    path.write_text(text)
    with pytest.raises(SpecError) as error:
        read(path)
    assert "hunter2" not in str(error.value)


def test_columns_of_a_table_are_named(path: Path) -> None:
    path.write_text("way,pull\n1,x\n")
    with pytest.raises(SpecError, match="found way, pull"):
        read_curve(path)
