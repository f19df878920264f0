"""Histories with a row for each line and time: those of controllers."""

from pathlib import Path

import numpy as np
import pytest

from dpgcli.design.pressure import History
from dpgcli.errors import SpecError
from dpgcli.files.controller import write_controller
from dpgcli.files.histories import read_history


def problems(path: Path, text: str) -> list[str]:
    path.write_text(text, encoding="utf-8")
    with pytest.raises(SpecError) as caught:
        read_history(path, ["A", "B"])
    return [str(problem).removeprefix(f"{path}:") for problem in caught.value.problems]


@pytest.mark.parametrize("n_lines", [1, 3])
def test_what_is_written_for_controllers_is_read(tmp_path: Path, n_lines: int) -> None:
    rng = np.random.default_rng(n_lines)
    times, pressures = np.cumsum(rng.uniform(0.1, 2.0, 9)), rng.normal(0.0, 0.2, (9, n_lines))
    names = ["A", "left", "0"][:n_lines]
    path = tmp_path / "r.csv"
    write_controller(path, names, History(pressures, times))
    assert path.read_text().splitlines()[1] == "time_s,line,pressure_MPa"
    found = read_history(path, names)
    assert list(found) == ["time_s", *names]
    np.testing.assert_allclose(found["time_s"], times, rtol=1e-9)
    np.testing.assert_allclose([found[name] for name in names], pressures.T, rtol=1e-9)


def test_lines_have_times_of_their_own_and_units(tmp_path: Path) -> None:
    path = tmp_path / "r.csv"
    path.write_text("pressure (kPa),line,time (min)\n0,A,0\n60,A,1\n10,B,0.5\n")
    found = read_history(path, ["A", "B", "C"])
    assert found["time_s"].tolist() == [0.0, 30.0, 60.0]
    assert found["A"] == pytest.approx([0.0, 0.03, 0.06])
    assert found["B"] == pytest.approx([0.01, 0.01, 0.01])
    assert "C" not in found


def test_a_line_may_be_called_so(tmp_path: Path) -> None:
    path = tmp_path / "r.csv"
    path.write_text("time_s,line\n0,0\n1,0.1\n")
    assert read_history(path, ["line"])["line"].tolist() == [0.0, 0.1]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "time_s,line\n0,A\n1,A\n",
            [" header: expected a column pressure_MPa, found time_s, line"],
        ),
        (
            "line,pressure_MPa\nA,0\nA,1\n",
            [" header: expected a column time_s, found line, pressure_MPa"],
        ),
        (
            "time_s,line,pressure_MPa,B\n0,A,0,1\n1,A,0,1\n",
            [' header: expected time_s, line and pressure_MPa, found "B"'],
        ),
        (
            "time_s,line,pressure_MPa\n0,A,0\n2,C,0\n0,A,1\n",
            [
                '3: line: expected a line: A, B, found "C"',
                "4: time_s: expected a time after 0 s, found 0",
            ],
        ),
        (
            "time_s,line,pressure_MPa\n0,A,0\n1,A,x\n",
            ['3: pressure_MPa: expected a number, found "x"'],
        ),
        (
            "time_s,line,pressure_MPa\n0,A,0\n",
            [" file: expected 2 rows or more, found 1"],
        ),
    ],
)
def test_every_problem_has_its_line(tmp_path: Path, text: str, said: list[str]) -> None:
    assert problems(tmp_path / "r.csv", text) == said
