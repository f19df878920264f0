"""Files with more rows, cells or mistakes than anybody would read: bounded, and said."""

from pathlib import Path

import pytest

from dpgcli.errors import SpecError
from dpgcli.files import csv_file
from dpgcli.files.csv_file import read_sheet
from dpgcli.files.histories import read_history

MORE = "found something else in more than 100 places"


def problems(path: Path, text: str) -> list[str]:
    """What is wrong with a curve of this text, if its numbers are asked for."""
    path.write_text(text)
    with pytest.raises(SpecError) as raised:
        read_sheet(path, {"x_mm", "F_N"}).numbers(["x_mm", "F_N"])
    return [str(problem).removeprefix(str(path)) for problem in raised.value.problems]


@pytest.mark.parametrize(
    ("row", "first", "last", "n_kinds"),
    [
        ("a,a", ':2: x_mm: expected a number, found "a"', "F_N: expected a number, ", 2),
        ("1", ":2: row: expected 2 cells, found 1", "row: expected 2 cells, ", 1),
        ('"a"b,1', ":2: row: expected cells of a CSV, found", "row: expected cells of a CSV, ", 1),
    ],
)
def test_of_the_same_mistakes_the_first_are_named(
    tmp_path: Path, row: str, first: str, last: str, n_kinds: int
) -> None:
    """A file of 4 MB made problems of 1.4 GB."""
    found = problems(tmp_path / "t.csv", "x_mm,F_N\n" + f"{row}\n" * 1000 + "1,2\n")
    assert len(found) == 101 * n_kinds
    assert any(problem.startswith(first) for problem in found[:2])
    assert f": {last}{MORE}" in found[-n_kinds:]
    few = problems(tmp_path / "t.csv", "x_mm,F_N\n" + f"{row}\n" * 100 + "1,2\n")
    assert len(few) == 100 * n_kinds
    assert not any(MORE in problem for problem in few)


def test_words_above_the_header_hide_no_mistake_below(tmp_path: Path) -> None:
    above = '"a"b\n' * 200
    good = tmp_path / "good.csv"
    good.write_text(above + "x_mm,F_N\n1,2\n")
    assert len(read_sheet(good, {"x_mm", "F_N"}).rows) == 1
    found = problems(tmp_path / "t.csv", above + 'x_mm,F_N\n1,2\n"a"b,1\n3,4\n')
    assert len(found) == 1
    assert found[0].startswith(":203: row: expected cells of a CSV")


@pytest.mark.parametrize("text", ["x_mm,F_N\n1,2\n3,4\n", "x_mm F_N\r\n1   2\r\n3 4\r\n"])
def test_more_lines_or_cells_than_a_curve_has(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str
) -> None:
    path = tmp_path / "t.csv"
    path.write_bytes(text.encode())
    for name, most, what in (("MOST_LINES", 3, "lines"), ("MOST_CELLS", 6, "cells")):
        monkeypatch.setattr(csv_file, name, most)
        assert len(read_sheet(path).rows) == 2
        monkeypatch.setattr(csv_file, name, most - 1)
        with pytest.raises(SpecError, match=f"expected at most {most - 1} {what}, found about"):
            read_sheet(path)
        monkeypatch.setattr(csv_file, name, most)


def test_of_many_columns_the_first_are_named(tmp_path: Path) -> None:
    header = ",".join(f"a{n}" for n in range(5000))
    (tmp_path / "t.csv").write_text(header + "\n" + "1," * 4999 + "1\n")
    with pytest.raises(SpecError, match="a98, a99 and 4,900 more"):
        read_sheet(tmp_path / "t.csv").check_names(["x_mm"])


def test_times_that_go_back_everywhere() -> None:
    times = [float(n % 2) for n in range(1000)]
    with pytest.raises(SpecError) as raised:
        read_history({"time_s": times, "A": times}, ["A"])
    assert len(raised.value.problems) == 101
