"""What CalculiX prints, and what it may print when things go wrong."""

import numpy as np
import pytest

from dpgcli.calibration.fe.results import displacements, reported_error, version
from dpgcli.errors import SolverError

HEAD = " displacements (vx,vy,vz) for set ALL and time  {}"
ROWS = (
    "         1  0.000000E+00 -1.798169E-02  0.000000E+00",
    "         2  1.000000E+00  2.500000E+01 -3.000000E-03",
)


def block(time: str = "0.2000000E-02", rows: tuple[str, ...] = ROWS) -> str:
    return "\n".join(["", HEAD.format(time), "", *rows, ""])


def test_increments_by_node() -> None:
    times, found = displacements(block() + block("0.4000000E-02", ROWS), 2)
    assert times.tolist() == [0.002, 0.004]
    assert found.shape == (2, 2, 3)
    assert found[1].tolist() == [[0.0, -0.01798169, 0.0], [1.0, 25.0, -0.003]]


def test_increments_too_short_to_tell_apart() -> None:
    """Times are printed with seven digits, and a snap takes increments of less."""
    times, _ = displacements(block() + block(), 2)
    assert times.tolist() == [0.002, 0.002]


def test_what_else_is_printed_is_passed_over() -> None:
    other = "\n total force (fx,fy,fz) for set ALL and time  0.2E-02\n\n  1.0  2.0  3.0\n"
    _, found = displacements(block() + other + block("0.3E-02"), 2)
    assert len(found) == 2


@pytest.mark.parametrize(
    ("word", "value"),
    [("1.000000-100", 1e-100), ("-2.50000-300", -2.5e-300), ("1.0D+00", 1.0), ("1.E+00", 1.0)],
)
def test_numbers_as_fortran_may_write_them(word: str, value: float) -> None:
    row = f"         2  {word} 0.000000E+00  0.000000E+00"
    _, found = displacements(block(rows=(ROWS[0], row)), 2)
    assert found[0, 1, 0] == value


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "no displacements"),
        ("\n stresses (elem, integ.pnt.) for set ALL\n", "no displacements"),
        (block(rows=ROWS[:1]), "ends within the increment at time 0.2000000E-02"),
        (block() + block("0.3E-02", (ROWS[0], ROWS[1][:30])), "the increment at time 0.3E-02"),
        (block() + "\n" + HEAD.format("0.3E-02") + "\n", "within the increment at time 0.3E-02"),
        (block(rows=(ROWS[1], ROWS[0])), "other nodes than the deck's"),
        (block(rows=(ROWS[0], "  2  NaN 0.0 0.0")), "the run went astray"),
        (block(rows=(ROWS[0], "  2  Infinity 0.0 0.0")), "the run went astray"),
        (block(rows=(ROWS[0], "  2  ************* 0.0 0.0")), "too large to print at time 0.2"),
        (block(rows=(ROWS[0], "  2  1.0 what? 0.0")), "found 'what?'"),
        (block("never"), "found 'never'"),
        (block("0.3E-02") + block("0.2E-02"), "go backwards"),
    ],
)
def test_what_makes_no_sense(text: str, said: str) -> None:
    with pytest.raises(SolverError, match="ccx wrote") as caught:
        displacements(text, 2)
    assert said in str(caught.value)


def test_logs_are_read_for_version_and_error() -> None:
    log = """
CalculiX Version 2.20, Copyright(C) 1998-2022 Guido Dhondt
 *WARNING reading *NODE
 *ERROR reading *ELASTIC: no material
        card was found

 *ERROR: another
"""
    assert version(log) == "2.20"
    assert reported_error(log) == "*ERROR reading *ELASTIC: no material card was found"
    assert version("") == "of unknown version"
    assert reported_error("all is well") == ""


def test_a_large_file_is_read_in_no_time() -> None:
    rows = tuple(f"{n:10d}  1.000000E+00 -2.000000E+00  3.000000E+00" for n in range(1, 1001))
    _, found = displacements("".join(block(f"{k}.0", rows) for k in range(50)), 1000)
    assert np.unique(found).tolist() == [-2.0, 1.0, 3.0]
