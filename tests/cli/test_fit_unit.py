"""`dpg fit unit` and end moments in `compare`, from the command line."""

from contextlib import suppress
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy.optimize import brentq

import dpgcli as dpg
from dpgcli.calibration.choices import HINGES, LEVER, WALLS
from dpgcli.errors import FitError, SpecError

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


@pytest.mark.filterwarnings("error")
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
        (HEAD + GROUND + INVERTED.replace("inverted,0", "inverted,"), "a number, 0 for none"),
        (HEAD + "ground,0.0025,-0.08,0,0\n", "N m?"),
        (HEAD + GROUND + INVERTED.replace(",-0.", ",0."), "angles that fall as the finger"),
        (
            HEAD + GROUND + INVERTED.replace("3.48", "-3.48").replace("3.49", "-3.49"),
            "openings > 0",
        ),
        (HEAD + GROUND + INVERTED.replace("0.8601", "860.1").replace("0.4778", "477.8"), "push_N"),
        (HEAD + GROUND.replace("0.08", "4.6") + INVERTED.replace("-0.", "-15."), "degrees?"),
        (HEAD + "ground,2.5,-0.08,0.00083,0\nground,-2.5,0.08,-0.00083,0\n", "moments in N mm"),
        (
            HEAD + GROUND + INVERTED.replace("3.4828", "0").replace("3.4904", "0"),
            "opening_mm: expected openings > 0 of inverted units, found 0 at most",
        ),
        (
            HEAD + GROUND + INVERTED.replace("3.4828", "1e-300").replace("3.4904", "1e-300"),
            "opening_mm: expected openings > 0 of inverted units, found 1e-300 at most",
        ),
        (
            HEAD + GROUND.replace("0.83", "8e-10") + INVERTED.replace("3.48", "3e-9"),
            "opening_mm: expected openings in mm that are turns in rad times a height of 0.001 to",
        ),
        (
            HEAD + GROUND.replace("0.08", "1e-300") + INVERTED.replace("-0.", "-1e-30"),
            "chamber2_angle_rad: expected angles of 1 unit in rad, found 1e-300 at most",
        ),
        (
            HEAD + GROUND.replace("0.08", "0") + INVERTED.replace("0.266", "0.3027"),
            "chamber2_angle_rad: expected angles that fall as moments rise, found the same under",
        ),
        (
            HEAD + GROUND.replace("2.5", "2.5e-12"),
            "(is the unit another one, of moments or of angles?)",
        ),
        (HEAD + GROUND.replace("2.5", "2.5e4"), "(N um?)"),
    ],
)
def test_what_is_refused(call: Any, folder: Path, text: str, said: str) -> None:
    (folder / "unit.csv").write_text(text)
    result = call("fit", "unit", "unit.csv", "-o", "unit.yaml")
    assert result.exit_code == 2
    assert said in result.stderr and "Traceback" not in result.stderr
    assert not (folder / "unit.yaml").exists()


def test_pushes_that_end_at_no_opening_are_refused() -> None:
    """Inverted rows under moments alone, whose openings nothing else is known of."""
    table = pd.read_csv(StringIO(HEAD + GROUND + INVERTED.replace("inverted,0", "inverted,-5")))
    for opening in (0.0, 1e-300):
        wrong = table.assign(opening_mm=table.opening_mm.where(table.unit == "ground", opening))
        with pytest.raises(FitError, match=r"its push ends at .* mm, expected an opening > 0"):
            dpg.fit_unit(wrong)


@pytest.mark.slow
@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("column", ["moment_N_mm", "chamber2_angle_rad", "opening_mm", "push_N"])
@pytest.mark.parametrize("value", [0.0, 5e-324, 1e-300, 1e-12, 1.0, -1.0, 1e12, np.nan])
def test_nothing_is_divided_by(column: str, value: float) -> None:
    """Columns and rows of one value are fitted, or refused in words, without a warning."""
    table = pd.read_csv(StringIO(HEAD + GROUND + INVERTED))
    for rows in (slice(None), 0, 3):
        changed = table.copy()
        changed[column] = changed[column].astype(float)
        changed.loc[rows, column] = value
        for one in (changed, changed[changed.unit == "ground"], changed[changed.unit != "ground"]):
            with suppress(SpecError, FitError):
                dpg.fit_unit(one)


@pytest.mark.parametrize("has_geometry", [True, False])
@pytest.mark.parametrize("scale", [1e-3, 0.02, 0.1, 1.0, 10.0, 50.0, 1e3])
def test_a_scaled_copy_has_the_scaled_values(scale: float, has_geometry: bool) -> None:
    """All lengths times s at one modulus: k_θ s³, c_w/s, H s; exact data of the same equations."""
    given = {"chamber_width_mm": 20, "limiting_layer_thickness_mm": 1.5, "channel_width_mm": 10}
    given = {key: scale * size for key, size in given.items()}
    given |= {"unit_separation_mm": 3.0 * scale, "elastic_modulus_MPa": 26.0}
    found = dpg.fit_unit(exact_unit(scale), geometry=given if has_geometry else None).values
    assert found[HINGES] == pytest.approx(30.9154 * scale**3, rel=1e-7)
    assert found[WALLS] == pytest.approx(0.930485 / scale, rel=1e-7)
    assert found[LEVER] == pytest.approx(10.2552 * scale, rel=1e-7)


@pytest.mark.parametrize("scale", [0.02, 1.0, 50.0])
def test_a_scaled_copy_at_rest_or_in_other_units(scale: float) -> None:
    table = exact_unit(scale)
    rest = table[table.unit == "ground"]
    assert dpg.fit_unit(rest).values[HINGES] == pytest.approx(30.9154 * scale**3, rel=1e-9)
    for column in ("moment_N_mm", "push_N", "opening_mm"):
        for factor in (1e-3, 1e3):
            with pytest.raises((SpecError, FitError)):
                dpg.fit_unit(table.assign(**{column: table[column] * factor}))


def exact_unit(scale: float) -> pd.DataFrame:
    """A unit of the study's size times a scale under moments, pushed by a spring of 50 N/mm."""
    lever, stroke, push = 10.2552 * scale, 3.5 * scale, 50.0 * scale
    hinge, walls = 30.9154 * scale**3, 0.930485 / scale

    def pushed(turn: float) -> float:
        return push * (stroke - 2.0 * lever * np.sin(turn / 2)) / (1.0 + push * walls)

    rows = []
    for unit, is_pushed in (("ground", 0.0), ("inverted", 1.0)):
        for moment in np.array([0.0, 2.5, 5.0, -2.5, -5.0]) * scale**3:
            turn = brentq(
                lambda t, m=moment, i=is_pushed: (
                    hinge * t - m - i * pushed(t) * lever * np.cos(t / 2)
                ),
                -0.8,
                1.2,
                xtol=1e-16,
            )
            force = is_pushed * pushed(turn)
            opening = 2.0 * lever * np.sin(turn / 2) + walls * force
            rows.append((unit, moment, -turn, opening, force))
    return pd.DataFrame(rows, columns=HEAD.strip().split(","))


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
