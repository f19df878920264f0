"""What is said to be known of errors is what finite elements say: the numbers of the page trust."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import dpgcli as dpg

CONFIGS = Path(__file__).parents[2] / "configs"
DATA = CONFIGS / "calibration"
STUDY, PUSHED = CONFIGS / "three_unit.yaml", DATA / "three_gap_finger.yaml"
PUSHES = DATA / "three_gap_finger_pure_push.csv"
WALL, HINGE = "wall_compliance_mm_per_N", "hinge_stiffness_N_mm_per_rad"


def moments(unit: str) -> tuple[float, float]:
    """The smallest and the largest stiffness of a unit against an end moment, N mm/rad."""
    table = pd.read_csv(DATA / "unit_moment.csv", comment="#")
    rows = table[table.unit == unit]
    at_rest = rows.chamber2_angle_rad[rows.moment_N_mm == 0.0].mean()
    loaded = rows[rows.moment_N_mm != 0.0]  # a positive moment opens the gap: a negative turn
    found = loaded.moment_N_mm / (at_rest - loaded.chamber2_angle_rad)
    return float(found.min()), float(found.max())


def stiffness(spec: Path, pattern: str, **settings: Any) -> float:
    keys = {"finger.units": 1, **{k.replace("__", "."): v for k, v in settings.items()}}
    table = dpg.predict(spec, settings=keys, patterns=pattern, columns="stiffness").table
    return float(1.0 / table["tip_compliance_angle_rad_per_N_mm"][0])


def dome(tmp_path: Path) -> list[str]:
    path = DATA / "dome_path_h6.5_t0.75.csv"
    dpg.fit_bistable(path, travel_to_opening="stroke:3.5", spec=STUDY).save(tmp_path / "d.yaml")
    return [str(tmp_path / "d.yaml"), "published"]


def test_ground_units() -> None:
    least, most = moments("ground")
    assert (least, most) == pytest.approx((30.5, 31.0), abs=0.1)
    assert 48.0 < stiffness(STUDY, "0") / most < stiffness(STUDY, "0") / least < 50.0
    assert 0.75 < stiffness(STUDY, "0", finger__law="push_only") / most < 0.8


def test_inverted_units_between_rigid_walls(tmp_path: Path) -> None:
    least, most = moments("inverted")
    assert (least, most) == pytest.approx((137.0, 148.0), abs=1.0)
    assert 6.0 < stiffness(STUDY, "1") / most < stiffness(STUDY, "1") / least < 7.0
    spring = stiffness(PUSHED, "1")
    own = stiffness(STUDY, "1", finger__law="push_only", finger__calibration=dome(tmp_path))
    assert spring / (0.5 * (least + most)) == pytest.approx(40.0, abs=1.0)
    assert own / (0.5 * (least + most)) == pytest.approx(92.0, abs=2.0)


def compared(**settings: Any) -> dict[str, np.ndarray[Any, Any]]:
    keys = {k.replace("__", "."): v for k, v in settings.items()}
    table = dpg.compare(PUSHED, PUSHES, settings=keys).table
    inverted = table["pattern"] != "000"
    known = pd.read_csv(PUSHES, comment="#", dtype={"pattern": str})
    pushes = known[["push1_N", "push2_N", "push3_N"]].max(axis=1)[1:].to_numpy()
    return {
        "deflection": table["error_percent"][inverted],
        "push": 100.0 * table["max_push_error_N"][inverted] / pushes,
    }


@pytest.mark.slow
def test_walls_that_are_fitted_to_the_states_of_a_finger() -> None:
    """The states that they are fitted to: others are predicted as well, by `fit finger` itself."""
    fit = dpg.fit_finger(PUSHED, PUSHES, free=(WALL, HINGE)).values
    found = compared(**{f"finger__{WALL}": fit[WALL], f"finger__lattice__{HINGE}": fit[HINGE]})
    assert 1.0 < found["deflection"].min() < found["deflection"].max() < 6.5
    assert found["push"].max() < 10.0
    least, most = moments("inverted")
    stiff = inverted_stiffness(fit)
    assert 1.3 * least < stiff < 1.65 * least
    assert stiff > most


def test_walls_that_are_fitted_to_moments() -> None:
    """With the segment height, as the axis of the push."""
    fit = dpg.fit_unit(DATA / "unit_moment.csv", spec=STUDY).values
    least, most = moments("inverted")
    assert 0.9 * least < inverted_stiffness(fit) < 1.1 * most
    width = 2.0 * fit["segment_height_mm"] - 1.5 + 2.0  # of the unit cell that has such a height
    found = compared(
        **{
            "finger__geometry__unit_cell_mm": width,
            f"finger__{WALL}": fit[WALL],
            f"finger__lattice__{HINGE}": fit[HINGE],
        }
    )
    assert 3 <= round(found["deflection"].min()) <= round(found["deflection"].max()) <= 10
    assert found["push"].max() < 10.0


def inverted_stiffness(fit: dict[str, float]) -> float:
    height = fit.get("segment_height_mm", 10.75)
    keys = {
        "finger__geometry__unit_cell_mm": 2.0 * height + 0.5,
        f"finger__{WALL}": fit[WALL],
        f"finger__lattice__{HINGE}": fit[HINGE],
    }
    return stiffness(PUSHED, "1", **keys)


def test_pushes_between_rigid_walls() -> None:
    assert 10.0 < compared()["push"].min() < compared()["push"].max() < 14.0
    higher = compared(finger__geometry__unit_cell_mm=26.9)["push"]  # H = 13.2 mm, as a fit finds it
    assert 39.0 < higher.min() < higher.max() < 44.0
