"""`dpg compare`: errors, messages and a figure, on the finite-element finger of the examples."""

import json
from pathlib import Path
from typing import Any

import pytest

from dpgcli.cli.exits import ExitCode

EXAMPLES = Path(__file__).parents[2] / "configs" / "calibration"
NAMES = ("three_gap_finger.yaml", "three_gap_finger.csv", "push_3.5mm.yaml")
FRAME = ("--first-station", "5.375,0.75", "--tip-offset", "5.375,-0.75")


@pytest.fixture
def arguments(folder: Path) -> tuple[str, ...]:
    for name in NAMES:
        (folder / name).write_bytes((EXAMPLES / name).read_bytes())
    return ("compare", *NAMES[:2], *FRAME)


def rows(text: str) -> dict[str, dict[str, Any]]:
    return {row["pattern"]: row for row in json.loads(text)}


def test_the_published_lever_curls_the_finite_element_finger_too_far(
    call: Any, arguments: tuple[str, ...]
) -> None:
    result = call(*arguments, "--format", "json")
    assert result.exit_code == ExitCode.DONE
    found = rows(result.stdout)
    assert found["000"]["error_mm"] < 0.01
    assert found["000"]["error_percent"] is None
    assert 23.0 < found["110"]["error_percent"] < 25.0
    assert found["110"]["tip_y_mm"] < found["110"]["known_y_mm"], "it curls further"
    assert "5 states, errors of the model (push-only law" in result.stderr
    assert "tips 4.06 mm at worst" in result.stderr
    assert "23.8 % at worst" in result.stderr
    assert "22.5 s a state in the data" in result.stderr


def test_each_opened_gap_turns_by_a_quarter_too_much(call: Any, arguments: tuple[str, ...]) -> None:
    """2 asin(3.485/21.5) = 0.326 rad in the lattice where finite elements have 0.264."""
    found = rows(call(*arguments, "--format", "json", "-q").stdout)
    assert found["100"]["angle_error_rad"] == pytest.approx(0.3257 - 0.2638, abs=5e-4)
    assert found["110"]["angle_error_rad"] == pytest.approx(0.6513 - 0.5242, abs=5e-4)


def test_another_lever_is_nearer(call: Any, arguments: tuple[str, ...]) -> None:
    def worst(*settings: str) -> float:
        found = rows(call(*arguments, "--format", "json", "-q", *settings).stdout)
        return max(row["angle_error_rad"] for row in found.values())

    lever = ("-s", "finger.geometry=null", "-s", "finger.lattice.segment_height_mm=13.2")
    assert worst(*lever) < 0.25 * worst()


def test_a_table_for_people(call: Any, arguments: tuple[str, ...]) -> None:
    result = call(*arguments, "-q")
    assert result.stderr == ""
    head, *lines = result.stdout.splitlines()
    assert head.split()[:3] == ["pattern", "status", "tip_x_mm"]
    assert [line.split()[0] for line in lines] == ["000", "001", "010", "100", "110"]
    assert " - " in lines[0], "no percentage of no deflection"


def test_a_figure(call: Any, arguments: tuple[str, ...], folder: Path) -> None:
    assert call(*arguments, "--plot", "c.svg", "-q").exit_code == ExitCode.DONE
    figure = (folder / "c.svg").read_text()
    for text in ("x (mm)", "y (mm)", "known tip", "110"):
        assert text in figure


def test_states_that_do_not_exist_are_said(call: Any, arguments: tuple[str, ...]) -> None:
    published = ("law=published", "calibration=null", "lattice.bistable_stiffness_N_per_mm=12.84")
    settings = [f"finger.{text}" for text in (*published, "lattice.force_linearity=0.9")]
    result = call(*arguments, *(word for text in settings for word in ("-s", text)))
    assert result.exit_code == ExitCode.DONE
    assert "4 states of the data do not exist in the lattice" in result.stderr
    assert "not_bistable" in result.stdout


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--tip-offset", "5"), "--tip-offset 5: expected two numbers in mm"),
        (("--first-station", "a,b"), "--first-station a,b: expected two numbers in mm"),
        (("--first-station", "nan,0"), "--first-station nan,0: expected two numbers in mm"),
        (("--plot", "c.pdf"), "expected a name that ends in .svg or .png"),
        (("--plot", "none/c.svg"), "cannot write none/c.svg"),
        (("-s", "finger.units=2"), "three_gap_finger.csv:9: pattern: expected 2 digits 0 and 1"),
    ],
)
def test_what_makes_no_sense(
    call: Any, arguments: tuple[str, ...], options: tuple[str, ...], said: str
) -> None:
    result = call(*arguments, *options)
    assert result.exit_code == ExitCode.USAGE
    assert said in result.stderr
    assert result.stdout == ""
