"""The shipped tables of units over their dimensions belong together, and to the given unit."""

import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from dpgcli.calibration.fe.curves import UnitCurve

TABLES = Path(__file__).parents[3] / "configs" / "calibration"


@pytest.fixture(scope="module")
def made() -> dict[str, Any]:
    return runpy.run_path(str(TABLES / "unit_grid.py"))


def table(name: str) -> pd.DataFrame:
    return pd.read_csv(TABLES / name, comment="#")


def curve_at(rows: pd.DataFrame, at: dict[str, float]) -> UnitCurve:
    found = rows[(rows[[*at]] == pd.Series(at)).all(axis=1)]
    return UnitCurve(*(found[name].to_numpy() for name in UnitCurve._fields))


def test_every_geometry_has_its_rows(made: dict[str, Any]) -> None:
    summary, rows = table("unit_grid.csv"), table("unit_grid_rows.csv")
    geometries = made["GEOMETRIES"]
    assert len(set(geometries)) == len(geometries) == len(summary) == 35
    assert len(rows) == 6 * len(geometries)
    for at, line in zip(geometries, summary.to_dict("records"), strict=True):
        expected = made["summary"](at, curve_at(rows, at._asdict()))
        assert line == pytest.approx(expected, rel=2e-4)


def test_no_moment_closes_a_gap_or_makes_a_push_a_pull() -> None:
    rows = table("unit_grid_rows.csv")
    assert (rows.opening_mm > -0.9 * rows.unit_separation_mm).all()
    assert (rows.push_N[rows.unit == "inverted"] > 0.0).all()


def test_the_reference_is_the_given_unit(made: dict[str, Any]) -> None:
    given, rows = table("unit_moment.csv"), table("unit_grid_rows.csv")
    curve = curve_at(rows, made["REFERENCE"]._asdict())
    given = given.set_index(["unit", "moment_N_mm"])
    for row, key in enumerate(zip(curve.unit, curve.moment_N_mm, strict=True)):
        for name in ("chamber2_angle_rad", "opening_mm", "push_N"):
            found = getattr(curve, name)[row]
            assert found == pytest.approx(given.loc[key, name], rel=0.01, abs=1e-9), (key, name)


def test_stiffness_and_compliance_go_with_the_modulus() -> None:
    """The chambers' own, but for what little the spring that pushes gives way."""
    grid = table("unit_grid.csv").set_index("elastic_modulus_MPa")
    half, double = grid.loc[13.0], grid.loc[52.0]
    assert double.ground_stiffness_N_mm_per_rad == pytest.approx(
        4 * half.ground_stiffness_N_mm_per_rad, rel=1e-4
    )
    assert half.wall_compliance_mm_per_N == pytest.approx(
        4 * double.wall_compliance_mm_per_N, rel=0.005
    )
    assert np.isfinite(grid.to_numpy()).all()
