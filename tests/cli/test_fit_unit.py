"""`dpg fit unit` and end moments in `compare`, from the command line."""

from pathlib import Path
from typing import Any

import pytest

EXAMPLES = Path(__file__).parents[2] / "configs" / "calibration"
SPEC = EXAMPLES.parent / "three_unit.yaml"
HEAD = "unit,moment_N_mm,chamber2_angle_rad,opening_mm,push_N\n"
GROUND = "ground,0,0,0,0\nground,2.5,-0.08,0.83,0\nground,-2.5,0.08,-0.83,0\n"
INVERTED = "inverted,0,-0.266,3.4828,0.8601\ninverted,5,-0.3027,3.4904,0.4778\n"


def test_what_is_fitted_is_compared_and_used(call: Any, folder: Path) -> None:
    (folder / "unit.csv").write_bytes((EXAMPLES / "unit_moment.csv").read_bytes())
    fitted = call(
        "fit", "unit", "unit.csv", "--spec", str(SPEC), "-o", "unit.yaml", "--plot", "a.svg"
    )
    assert fitted.exit_code == 0, fitted.stderr
    assert "stiffness, inverted: 5.07 % off" in fitted.stderr
    assert "turn over end moment" in (folder / "a.svg").read_text(encoding="utf-8")
    push = EXAMPLES / "push_3.5mm.yaml"
    spec = str(EXAMPLES / "three_gap_finger.yaml")
    one = ("--set", "finger.units=1", "--set", f"finger.calibration={push}")
    compared = call("compare", spec, "unit.csv", *one, "--calibration", "unit.yaml")
    assert compared.exit_code == 0, compared.stderr
    worst = [line for line in compared.stderr.splitlines() if "stiffness against end" in line]
    before, after = (float(line.split("moments ")[1].split(" %")[0]) for line in worst)
    assert before > 500 and after < 5.1
    assert "stiffness_error_percent" in compared.stdout


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (HEAD + GROUND + INVERTED.replace("inverted", "inv"), "unit: expected ground or inverted"),
        (HEAD + "ground,2.5,0.08,0,0\nground,-2.5,-0.08,0,0\n", "is the sign the other one?"),
        (HEAD + "ground,0.0025,-0.08,0,0\nground,-0.0025,0.08,0,0\n", "N m?"),
        (HEAD + GROUND + "inverted,0,-0.266,3.4828,0.8601\n", "under two moments or more"),
        (HEAD + GROUND + INVERTED + "inverted,5,-0.3,3.4,0.5\n", "for the second time"),
        (HEAD + GROUND + INVERTED.replace("0.8601", "").replace("0.4778", ""), "the data have 0"),
        (HEAD + GROUND.replace("-0.08", "x"), "chamber2_angle_rad: expected a number"),
        ("pattern,tip_angle_rad\n", "file: expected"),
    ],
)
def test_what_is_refused(call: Any, folder: Path, text: str, said: str) -> None:
    (folder / "unit.csv").write_text(text)
    result = call("fit", "unit", "unit.csv", "-o", "unit.yaml")
    assert result.exit_code == 2
    assert said in result.stderr and "Traceback" not in result.stderr
    assert not (folder / "unit.yaml").exists()


def test_a_table_of_one_unit_beside_a_finger_of_three(call: Any) -> None:
    spec, data = (str(EXAMPLES / n) for n in ("three_gap_finger.yaml", "unit_moment.csv"))
    result = call("compare", spec, data)
    assert result.exit_code == 2
    assert "of one unit? then of a finger with finger.units 1" in result.stderr


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--error", "pushes=0"), "expected a number > 0"),
        (("--error", "weight=1"), "expected tips, angles, openings, pushes"),
        (("--error", "pushes=1", "--target", "angles"), "not fitted"),
        (("--free", "stroke"), "expected one of"),
        (("--target", "tips"), "the data have no tips to fit to"),
    ],
)
def test_wrong_choices(call: Any, options: tuple[str, ...], said: str) -> None:
    result = call("fit", "unit", str(EXAMPLES / "unit_moment.csv"), *options)
    assert result.exit_code == 2
    assert said in result.stderr
