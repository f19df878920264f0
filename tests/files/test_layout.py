"""Curves as other programs write them: each gives the same numbers, or a question."""

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from dpgcli.calibration.opening import parse_number
from dpgcli.cli.options import millimeters
from dpgcli.errors import SpecError, UsageError
from dpgcli.files.csv_file import Choice, read_sheet
from dpgcli.files.layout import NUMBER, doubtful_point, is_number, marks_in, rows_in, separator_of
from dpgcli.files.measured import CURVE, MeasuredCurve, read_curve
from dpgcli.files.units import FACTORS, OWN, factor_of

NAMED = Choice({"travel_mm": "Ext", "force_N": "Load"})
TRAVEL, FORCE = [0.0, 0.5, 1.25, 1234.5], [0.25, 10.5, 1200.0, -3.75]
ROWS = list(zip(TRAVEL, FORCE, strict=True))
LONG = 40_000
MANY = "9" * LONG
UNITS = {"travel": "um", "force": "N"}
Read = Callable[..., MeasuredCurve]


@pytest.fixture
def read(tmp_path: Path) -> Read:
    """Read a curve from a text, or from bytes."""

    def reading(content: str | bytes, choice: Choice = NAMED) -> MeasuredCurve:
        path = tmp_path / "c.csv"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return read_curve(path, None, choice)

    return reading


def problems(read: Read, content: str | bytes, choice: Choice = NAMED) -> list[str]:
    """What is wrong with a curve, without its file's name."""
    with pytest.raises(SpecError) as caught:
        read(content, choice)
    return [str(problem).partition("c.csv:")[2].strip() for problem in caught.value.problems]


def body(separator: str, decimal: str = ".", group: str = "", quote: str = "") -> str:
    def spelled(value: float) -> str:
        text = f"{value:,.2f}".replace(",", "G").replace(".", decimal).replace("G", group)
        return f"{quote}{text}{quote}"

    return "".join(separator.join(map(spelled, row)) + "\n" for row in ROWS)


def labeled(rows: str, separator: str = "\t") -> str:
    """Rows behind a label each, whose parts blanks would part."""
    return "".join(f"Dome {n}{separator}{row}\n" for n, row in enumerate(rows.splitlines()))


@pytest.mark.parametrize(
    "content",
    [
        "Ext,Load\n" + body(","),
        "Ext,Load,\n" + body(",").replace("\n", ",\n"),
        "Ext,Load\n" + body(",").replace("\n", ",\n"),
        "Ext,Load\n" + body(",", ",", quote='"'),
        "Ext,Load\n" + body(",", ".", ",", '"'),
        "Ext;Load\n" + body(";"),
        "Ext;Load\n" + body(";", ","),
        "Ext;Load\n" + body(";", ",", "."),
        "Ext;Load\n" + body(";", ".", "'"),
        "Ext;Load\n" + body(";", ",", "\u202f"),
        "Ext;Load;\n;;\n" + body(";", ",").replace("\n", ";\n"),
        "Ext\tLoad\n" + body("\t", ","),
        "Ext\tLoad\n" + body("\t", ".", "\u00a0"),
        "Ext\tLoad\n" + body("\t", ",", "\u202f"),
        "No.\tExt\tLoad\n" + labeled(body("\t")),
        "No.\tExt (um)\tLoad (N)\n" + labeled(body("\t", ",")),
        '"No. 1"\tExt\tLoad\n' + labeled(body("\t", quote='"')),
        "No.,\tExt,\tLoad\n" + labeled(body(",\t"), ",\t"),
        "Ext|Load\n" + body("|"),
        "Ext Load\n" + body(" "),
        "  Ext     Load  \n" + body("   ", ","),
        "Ext  Load\n" + body("  ", ".", "\u00a0"),
        "Ext Load\n" + body(" ", ",", "\u202f"),
        "Ext (um) Load [N]\n" + body(" "),
        "Ext Load\n(um) [N]\n" + body(" "),
        "No.  Ext (um) Load\n[] (um) [N]\n"
        + labeled(body(" ")).replace("Dome ", "").replace("\t", " "),
        '"Ext\n(um)";"Load\n(N)"\n' + body(";", ","),
        "Ext,Load\n(um),(N)\n\n" + body(","),
        "Probe 1;Dome, Nr. 3\nDatum;26.11.2026\n\nExt;Load\num;N\n" + body(";", ","),
        "Name,Max,Min\nA,4,2\nB,5,1\n\nExt,Load\n" + body(","),
        "# by hand\nExt,Load\n" + body(",") + "# the end\n",
        ("\ufeffExt;Load\n" + body(";", ",")).encode("utf-16-le"),
        ("\ufeffExt;Load\n" + body(";", ",")).encode("utf-16-be"),
        ("Prüfer;Größe\nExt;Load\n" + body(";", ",")).encode("cp1252"),
        ("Ext,Load\n" + body(",")).replace("\n", "\r"),
    ],
)
def test_whatever_the_program_the_numbers_are_the_same(read: Read, content: str | bytes) -> None:
    found = read(content, Choice(NAMED.columns, None, UNITS)).curve
    assert found.travel.tolist() == [1e-3 * value for value in TRAVEL]
    assert found.force is not None
    assert found.force.tolist() == FORCE


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("Ext;Load\n0,5;1\n1.5;2\n", '2: travel_mm: expected a number, found "0,5" (write a dec'),
        ("Ext;Load\n1,234;1\n2,345;2\n", '2: travel_mm: expected a number, found "1,234" (thous'),
        ("Ext;Load\n950;1\n1.000;2\n", '3: travel_mm: expected a number, found "1.000" (thousands'),
        ("Ext\tLoad\n0\t1\n1\t1.250.000\n", '3: force_N: expected a number, found "1.250.000"'),
        ("Ext;Load\n1.234,5;1\n2.5;2\n", '3: travel_mm: expected a number, found "2.5" (write a'),
        ('Ext,Load\n1,2\n3,4\n"5,5",6\n', '4: travel_mm: expected a number, found "5,5" (write'),
        ("Ext,Load\n0,5,1\n1,5,2\n", "2: row: expected 2 cells, found 3"),
        ("Ext,Load\n0,5,\n1,5\n", "2: row: expected 2 cells, found 3"),
        ("Ext,Load,\n0,0,5,\n1,5,25,\n", "1: header: expected a title for column 3, found none"),
        (",Ext,,Load\n0,0,5,1\n1,1,0,2\n", "1: header: expected a title for column 3, found non"),
        ("Ext Load cell F\n1 2 3\n2 3 4\n", "1: header: expected 3 titles, as many as cells below"),
        ("Ext,Ext, Load,F\n1,2,3\n2,3,4\n", "1: header: expected 3 titles, as many as cells below"),
        ("Ext in um Load in N T\n1 2 3\n", "1: header: expected 3 titles, as many as cells below"),
        ("Ext,Load\n0,5,\n", "2: row: expected 2 cells, found 3"),
        ("Ext,Load,Ext,Load\n0,5,0,6\n", '1: header: expected each column once, found "Ext" again'),
        ("Ext,Load\n0,5\n1,6\nEnd of test\n", "4: row: expected 2 cells, found 1"),
        ("Ext,Load\n0,5\nExt,Load\n0,6\n", '3: travel_mm: expected a number, found "Ext"'),
        ("Ext,Load\n0,5\n1,\n", '3: force_N: expected a number, found ""'),
        ("Ext [um],Load [V]\n0,5\n1,6\n", "force_N: expected a unit of force: N, kN, mN, MN, cN"),
        (b"PK\x03\x04", "file: expected text, found an Excel workbook or an archive (save it as"),
        ("Ext,Load\n".encode("utf-16-le"), "file: expected text, found zero bytes (save it as U"),
        (b"\xff\xfeE\x00x", "file: expected text in UTF-16, found truncated data"),
        ("Ext,Load \u0100\n".encode("cp1257"), "1:10: file: expected text in UTF-8, found byte"),
    ],
)
def test_what_can_be_read_in_two_ways_is_asked_about(
    read: Read, content: str | bytes, said: str
) -> None:
    assert problems(read, content)[0].startswith(said)


def test_names_of_ours_need_no_choice_wherever_the_table_begins(read: Read) -> None:
    rows = body(";", ",")
    none = Choice(units=UNITS)
    assert read(f"travel_mm;force_N\n{rows}", none).curve.travel.tolist() == [
        1e-3 * value for value in TRAVEL
    ]
    assert read(f"Test 3\nfoo;bar\ntravel_mm;force_N\n{rows}", none).ignored == ()


def test_a_name_with_a_unit_of_its_own_is_not_contradicted(read: Read) -> None:
    (said,) = problems(read, "travel_mm,force_N\n(mm),(kN)\n0,5\n1,6\n", Choice())
    assert (
        said
        == "force_N: expected N, as the name has it, found kN beside it (say which: units force=N)"
    )


@pytest.mark.parametrize(
    "rows",
    [
        "1.125;1\n2.250;2\n",
        "0.500;1\n1;2\n1.125;3\n",
        "1.125;95\n2.000;90\n",
        "1.0;1.125\n2;3\n",
    ],
)
def test_a_point_is_a_decimal_one_unless_it_may_be_another(read: Read, rows: str) -> None:
    found = read(f"Ext;Load\n{rows}").curve.travel.tolist()
    assert found == [float(row.partition(";")[0]) for row in rows.splitlines()]


def test_columns_by_place_signs_and_lines_above(read: Read) -> None:
    places = Choice({"travel_mm": "2", "force_N": "-1"}, skip=2)
    found = read("1 2\nnot,a,table\n" + "5,0.5,x\n6,1.5,y\n", places)
    assert found.curve.travel.tolist() == [0.5, 1.5]
    assert found.curve.force is not None
    assert found.curve.force.tolist() == [-5.0, -6.0]


def test_no_row_of_numbers_is_taken_for_the_titles_that_are_places(read: Read) -> None:
    places = Choice({"travel_mm": "1", "force_N": "2"})
    found = read("0 5\n0.5 6\n1 2\n2 1\n", places)
    assert found.curve.travel.tolist() == [0, 0.5, 1, 2]
    named = read("Nr 4;Kraft\nWeg;Kraft\n0;5\n0,5;6\n1;2\n", places)
    assert named.curve.travel.tolist() == [0, 0.5, 1]


TITLES = [
    "0,1\n0,5\n0.5,6\n",
    "a,1,2\n9,0,5\n9,0.5,6\n",
    "Test,of,domes\na,1,2\n9,0,5\n9,0.5,6\n",
    "1,2\n0,5\n0.5,6\n",
]


@pytest.mark.parametrize("text", TITLES)
def test_titles_that_are_numbers_are_no_point_of_a_curve(read: Read, text: str) -> None:
    first, second = ("2", "3") if "a" in text else ("1", "2")
    columns = {"travel_mm": first, "force_N": second}
    line = text.splitlines().index(next(c for c in text.splitlines() if "1" in c)) + 1
    if text.startswith("a"):  # above numbers: the title 2 is not at place 2
        (said,) = problems(read, text, Choice(columns))
        assert said.startswith("header: expected a column 2, found a, 1, 2 (a title that stands")
        assert read(text, Choice(columns, skip=1)).curve.travel.tolist() == [0.0, 0.5]
        return
    (said,) = problems(read, text, Choice(columns))
    assert said.startswith(f"{line}: row: expected numbers, not what may be titles")
    assert f"skip {line} if these are titles" in said
    assert read(text, Choice(columns, skip=line)).curve.travel.tolist() == [0.0, 0.5]


def test_numbers_that_count_on_are_a_point_where_it_is_said(read: Read) -> None:
    places = Choice({"travel_mm": "1", "force_N": "2"}, skip=0)
    assert read("0,1\n0.5,6\n", places).curve.travel.tolist() == [0.0, 0.5]
    labels = Choice({"travel_mm": "2", "force_N": "3"})
    assert read("a,0,5\nb,0.5,6\n", labels).curve.travel.tolist() == [0.0, 0.5]


def test_a_title_that_begins_with_a_minus_is_itself(read: Read) -> None:
    found = read("-Load,Ext\n5,0.5\n6,1.5\n", Choice({"travel_mm": "Ext", "force_N": "-Load"}))
    assert found.curve.force is not None
    assert found.curve.force.tolist() == [5.0, 6.0]


def test_a_column_that_no_row_has_is_none(read: Read) -> None:
    found = read("Ext\tLoad\tComment\n0.5\t5\n1.5\t6\n")
    assert found.ignored == ()
    assert problems(read, "Comment\tExt\tLoad\n0.5\t5\n1.5\t6\n")[0].startswith(
        "2: row: expected 3"
    )


def test_an_index_without_a_title_is_no_column_of_decimals(read: Read) -> None:
    assert read(",Ext,Load\n0,0.5,5\n1,1.5,6\n").curve.travel.tolist() == [0.5, 1.5]
    assert read("Ext;Load;\n0,5;5;1\n1,5;6;2\n").curve.travel.tolist() == [0.5, 1.5]


@pytest.mark.parametrize("cell", [MANY + "x", MANY + "." + MANY + "x", "1,234" * LONG + "x"])
def test_a_long_cell_is_read_as_fast_as_a_long_file(read: Read, cell: str) -> None:
    """The time grows with its length, not with the square: that would be minutes."""
    begin = time.process_time()
    assert problems(read, f'Ext,Load\n0,5\n"{cell}",6\n1,2\n')
    assert problems(read, f"Ext Load\n0 5\n1 6 {cell.replace(',', '.')}\n")
    assert not is_number(cell)
    assert NUMBER.fullmatch(cell) is None
    assert parse_number(cell) is None
    with pytest.raises(UsageError):
        millimeters("--target-error", f"{cell}-")
    assert time.process_time() - begin < 5.0


def test_a_wide_header_is_read_as_fast_as_a_long_file(read: Read) -> None:
    begin = time.process_time()
    assert problems(read, "Ext" + ",a" * LONG + "\n1\n")
    assert problems(read, "Ext" + "\t" * LONG + "a\n1\n")
    assert time.process_time() - begin < 5.0


def test_line_breaks_in_quotes_do_not_move_lines(read: Read) -> None:
    text = 'Ext,Load,"a\n# no comment\nb"\n0.5,5,"x\ny"\n1.5,bad,z\n'
    assert problems(read, text) == ['6: force_N: expected a number, found "bad"']


@pytest.mark.parametrize(
    ("cells", "separator", "decimal", "grouping"),
    [
        (["0,5"], ";", ",", ""),
        (["1,5", "2"], ";", ",", ""),
        (["1,234", "0,100"], ";", ",", ""),
        (["1,234", "1,2345"], ";", ",", ""),
        (["1.234,5"], ";", ",", "."),
        (["1,234.5"], ",", ".", ","),
        (["1.5", "1,234"], ",", ".", ""),
        (["1,5", "2", "3"], ",", ".", ""),
        (["12", "13"], ";", ".", ""),
    ],
)
def test_marks(cells: list[str], separator: str, decimal: str, grouping: str) -> None:
    found = marks_in(cells, separator)
    assert (found.decimal, found.grouping, found.doubtful) == (decimal, grouping, "")


@pytest.mark.parametrize(
    ("lines", "separator"),
    [
        (["a b;c", "1;2"], ";"),
        (["a,b", "0.5, 1.5"], ","),
        (["a;b", "0,5;1,5"], ";"),
        (["variant,x", '"base (1 mm, 0.75 mm)",5', "fine mesh,6"], ","),
        (["x", "1", "2"], ","),
        (["No.\tx\ty", "Dome 1\t0.1\t2"], "\t"),
        (["Dome\tNo.\tSet\tF", "a b\tNo. 3\tc d\t1,5"], "\t"),
        (["x,\ty", "1,\t2"], ","),
        (['x,"a\tb"', '1,"c\td"'], ","),
        (["x y", "1 2"], " "),
    ],
)
def test_separators(lines: list[str], separator: str) -> None:
    found = separator_of(lines)
    assert found == separator or {found, separator} <= {" ", "  "}


def test_thousands_without_a_point_say_that_points_are_decimal_ones() -> None:
    assert doubtful_point([["1.125", "2"], ["1", "950"]]) == "1.125"
    assert doubtful_point([["1.125", "2"], ["1", "1200"]]) == ""


def test_what_groups_thousands_parts_no_cells() -> None:
    assert [row.cells for row in rows_in(["a \u00a0b  c"], "  ")[0]] == [["a \u00a0b", "c"]]
    assert [row.cells for row in rows_in(["a\u202fb c"], " ")[0]] == [["a\u202fb", "c"]]


def test_every_unit_is_one_of_its_own_kind() -> None:
    for quantity, own in OWN.items():
        assert factor_of(quantity, own) == 1.0
        assert factor_of(quantity, f"({own})") == 1.0
        assert factor_of(quantity, "x") is None
    assert factor_of("pressure", "psi") == pytest.approx(6.894757e-3, rel=1e-7)
    assert factor_of("rotation", "°") == pytest.approx(np.pi / 180)
    assert set(FACTORS) == set(OWN)
    assert set(CURVE.values()) <= set(OWN)


def test_a_data_frame_is_read_as_it_is() -> None:
    sheet = read_sheet({"a": ["0,5", "1,5"], "b": [1.0, 2.0]})
    assert sheet.cells("a") == ["0,5", "1,5"]
    with pytest.raises(SpecError, match="write a decimal point"):
        sheet.numbers(["a"])


def test_the_titles_that_are_shown_are_those_above_the_longest_table(read: Read) -> None:
    rows = "".join(f"{n};{n / 10};{n}\n" for n in range(9))
    text = f"Name;Max\nA;4\nB;5\n\nTime;Ext (mm);Load (N)\ns;mm;N\n{rows}"
    assert "found Time, Ext (mm), Load (N) (--column" in problems(read, text, Choice())[0].replace(
        "(column", "(--column"
    )
