"""Pressures over steps: ramps, numbers and tables; what is wrong with them, all at once."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from dpgcli.api.histories import history_input
from dpgcli.design.pressure import History, Pressure
from dpgcli.errors import SpecError, UsageError

ONE = Pressure(("A",), np.zeros(3, int), None, None)
TWO = Pressure(("left", "B"), np.array([0, 1]), None, None)


@pytest.mark.parametrize(
    "given",
    [
        "0:0.15:0",
        "A=0:0.15:0",
        " A = 0 : +.15 : 0.0 ",
        "0:1.5e-1:-0",
        ["0:0.15:0"],
        [0.0, 0.15, 0.0],
        (0, 0.15, 0),
        np.array([0.0, 0.15, 0.0]),
        {"A": "0:0.15:0"},
        {"A": [0.0, 0.15, 0.0]},
        {"A (kPa)": [0, 150, 0]},
        pd.DataFrame({"A_MPa": [0.0, 0.15, 0.0]}),
    ],
)
def test_one_line_however_it_is_said(given: Any) -> None:
    history = history_input(given, ONE).history
    np.testing.assert_allclose(history.pressure, [[0.0], [0.15], [0.0]], rtol=1e-15)
    assert history.time is None


@pytest.mark.parametrize(
    "given",
    [
        ["left=0:0.1", "B=0:-0.1"],
        ["B=0:-0.1", "left=0:0.1"],
        {"B": "0:-0.1", "left": [0, 0.1]},
        {"B (kPa)": [0, -100], "left": [0, 0.1]},
    ],
)
def test_lines_in_any_order(given: Any) -> None:
    pressure = history_input(given, TWO).history.pressure
    np.testing.assert_allclose(pressure, [[0.0, 0.0], [0.1, -0.1]], rtol=1e-15)


def test_a_file_with_times(tmp_path: Path) -> None:
    path = tmp_path / "history.csv"
    path.write_text("time (ms);left;B (kPa)\n0;0,0;0\n500;0,1;-100\n")
    for given in (path, str(path), [str(path)]):
        found = history_input(given, TWO)
        np.testing.assert_allclose(found.history.pressure, [[0.0, 0.0], [0.1, -0.1]])
        assert found.history.time is not None
        np.testing.assert_allclose(found.history.time, [0.0, 0.5])
        assert found.files == (path,)


@pytest.mark.parametrize("nothing", [None, [], ()])
def test_that_of_the_spec_is_taken_where_none_is_given(nothing: Any) -> None:
    known = Pressure(("A",), np.zeros(1, int), None, None, None, History(np.array([[0.0], [0.1]])))
    assert history_input(nothing, known).history is known.history
    with pytest.raises(UsageError, match=r"pressure: expected pressures in MPa such as 0:0\.15:0"):
        history_input(nothing, ONE)


WRONG: dict[str, tuple[Pressure, Any, list[str]]] = {
    "a number": (ONE, "0.15", ["found one (0:0.15 goes there from 0, 0:0.15:0 back as well)"]),
    "nothing": (ONE, "", ["expected pressures in MPa such as 0:0.15:0, found nothing"]),
    "a line's nothing": (ONE, "A=", ["A=: expected pressures in MPa", "found nothing"]),
    "kPa": (ONE, "0:150kPa:0", ["without a unit, found kPa (in MPa: 0:0.15:0; "]),
    "kPa once": (ONE, "A=0:150:0 kPa", ["found kPa", "A (kPa)"]),
    "bar": (ONE, "0:1.5bar:0bar", ["found bar (in MPa: 0:0.15:0; "]),
    "MPa": (ONE, "0:0.15MPa:0", ["without a unit, found MPa (in MPa: 0:0.15:0; "]),
    "no unit": (ONE, "0:3x:0", ["found x (a CSV file may be in MPa, kPa,"]),
    "a gap": (ONE, "0::0.1", ['0::0.1: expected pressures in MPa such as 0:0.15:0, found ""']),
    "an open end": (ONE, "0:0.1:", ['found ""']),
    "not a number": (ONE, "0:nan:0", ['found "nan"']),
    "infinite": (ONE, "0:inf", ['found "inf"']),
    "huge": (ONE, "0:1e99", ["expected pressures from -1e+12 to 1e+12 MPa, found 1e99"]),
    "hugely negative": (ONE, "0:-1.1e16", ["from -1e+12 to 1e+12 MPa, found -1.1e16"]),
    "commas": (ONE, "0,15:0", ['found "0,15"']),
    "no file": (ONE, "missing.csv", ["missing.csv: file: expected a readable file"]),
    "a long text": (ONE, "0:0.15," * 50, ["expected pressures in MPa such as 0:0.15:0, found"]),
    "a long one of two": (TWO, ["left=0:1", "B" * 300], ["expected the line before the pressures"]),
    "no ramp": (ONE, "missing", ['found "missing" (or the name of a CSV file that is there)']),
    "another line": (ONE, "C=0:1", ["C=0:1: expected a line: A, found C"]),
    "nearly a line": (TWO, ["lefd=0:1", "B=0:1"], ["found lefd (did you mean left?)"]),
    "twice": (ONE, ["A=0:1", "0:2"], ["0:2: expected each line once, found A again"]),
    "no line of two": (TWO, "0:1", ["found none (such as left=0:1 and B=0:1)"]),
    "one left out": (TWO, "left=0:1:0", ["found none for B (B=0:0:0 keeps it at 0 MPa)"]),
    "lengths": (TWO, ["left=0:1", "B=0:1:0"], ["B: expected 2 pressures, as left", "found 3"]),
    "many": (TWO, ["C=0:1", "B=0:x"], ["C=0:1: expected a line: left, B", 'B=0:x: expected']),
    "beside a table": (TWO, ["a.csv", "B=0:1"], ["a.csv: expected a table alone, of all lines"]),
    "one row": (ONE, [0.1], ["expected 2 rows or more, found 1"]),
    "NaN": (ONE, [0.0, float("nan")], ['A: expected a number, found ""']),
    "a column left out": (TWO, {"left": [0, 1]}, ["found none for B (a column of zeros"]),
    "other columns": (ONE, {"pressure": [0, 1]}, ["header: expected a column for a line: A"]),
    "times back": (ONE, {"time": [0, 2, 1], "A": [0, 1, 0]}, ["expected a time from 2 s on"]),
    "numbers for two": (TWO, [0.0, 0.1], ["found none for B"]),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_is_said(case: str) -> None:
    lines, given, parts = WRONG[case]
    with pytest.raises(SpecError) as caught:
        history_input(given, lines)
    assert not [part for part in parts if part not in str(caught.value)], str(caught.value)


@pytest.mark.parametrize("given", [3, 0.15, object(), {"A": [0, 1], "time": [0]}])
def test_what_is_no_history_at_all_is_an_error_of_ours(given: Any) -> None:
    with pytest.raises((SpecError, UsageError)):
        history_input(given, ONE)


def test_every_problem_of_a_file_has_its_line(tmp_path: Path) -> None:
    path = tmp_path / "history.csv"
    path.write_text("time_s,A\n0,0\n1,x\n2,\n1,0\n")
    with pytest.raises(SpecError) as caught:
        history_input(path, ONE)
    places = [(problem.line, problem.key) for problem in caught.value.problems]
    assert places == [(3, "A"), (4, "A")]


def test_names_of_lines_do_not_hide_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    named: Callable[[str], Any] = lambda name: history_input(name, ONE).history.pressure  # noqa: E731
    for name in ("pressures", "./A=1.csv", "0.csv"):
        Path(name).write_text("A\n0\n0.1\n")
        assert named(name).tolist() == [[0.0], [0.1]]


@pytest.mark.parametrize("given", [[0, "a"], 5, ["0:1", 0.1], [[0, 1], [0]], {0, 0.1}])
def test_numbers_beside_something_else_are_no_ramp(given: Any) -> None:
    with pytest.raises(UsageError, match="expected two numbers or more, pressures in MPa such as"):
        history_input(given, ONE)


@pytest.mark.parametrize(
    "nothing",
    [np.array([]), pd.Series([], dtype=float), set(), iter([]), range(0), b"", frozenset()],
)
def test_what_is_empty_is_not_that_of_the_spec(nothing: Any) -> None:
    known = Pressure(("A",), np.zeros(1, int), None, None, None, History(np.array([[0.0], [0.1]])))
    with pytest.raises(UsageError, match=r"pressures in MPa such as 0:0\.15:0"):
        history_input(nothing, known)
