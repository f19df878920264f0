"""Fits as functions: the numbers of their commands, from paths and data frames, into files."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest
from typer.testing import CliRunner

import dpgcli as dpg
from dpgcli.cli.main import app

Rows = Callable[..., list[dict[str, Any]]]

DATA = Path(__file__).parents[2] / "configs" / "calibration"
DOME, DYNAMIC = DATA / "dome_path_h6.5_t0.75.csv", DATA / "dome_dynamic_h6.5_t0.75.csv"
HINGE, GRID = DATA / "hinge_moment.csv", DATA / "dome_grid.csv"
SIZES = {"dome_height_mm": 6.5, "dome_thickness_mm": 0.75, "elastic_modulus_MPa": 26.0}


def assert_same(table: Any, rows: list[dict[str, Any]]) -> None:
    """A table and rows of JSON, in which null stands for NaN."""
    assert len(table) == len(rows) > 0
    for name in table.names:
        expected = [np.nan if row[name] is None else row[name] for row in rows]
        found = table[name].tolist()
        if isinstance(expected[0], str):
            assert found == expected
        else:
            np.testing.assert_array_equal(found, expected)


def test_a_dome_as_by_its_command(printed: Rows, folder: Path) -> None:
    options = ("--travel-to-opening", "stroke:3.5", "--bootstrap", "5", "-o", "command.yaml")
    rows = printed("fit", "bistable", str(DOME), *options, "-g", "dome_height_mm=6.5")
    fit = dpg.fit_bistable(
        str(DOME), travel_to_opening="stroke:3.5", bootstrap=5, geometry={"dome_height_mm": 6.5}
    )
    assert_same(fit.table, rows)
    fit.save("function.yaml")
    assert (folder / "function.yaml").read_bytes() == (folder / "command.yaml").read_bytes()
    assert any(line.startswith("opening = 0.25533 travel") for line in fit.summary)


def test_a_dome_s_pressures_are_kept(folder: Path) -> None:
    fit = dpg.fit_bistable(DOME, travel_to_opening="stroke:3.5", geometry=SIZES)
    curve, data = fit.calibration.curve, pd.read_csv(DOME, comment="#")
    np.testing.assert_allclose(curve.pressure_MPa, data.pressure_MPa, rtol=1e-12)
    assert curve.volume_mm3 is None
    assert curve.snap_pressure_MPa == data.pressure_MPa[:40].max()
    assert "snap pressure: 0.1495 MPa, the largest before the dome snapped" in fit.summary
    without = data.drop(columns="pressure_MPa")
    plain = dpg.fit_bistable(without, travel_to_opening="stroke:3.5", geometry=SIZES)
    plain.save(folder / "plain.yaml")
    assert "MPa:" not in (folder / "plain.yaml").read_text().replace("elastic_modulus_MPa:", "")


def test_a_dynamic_dome_s_pressures_and_volumes_are_kept() -> None:
    data = pd.read_csv(DYNAMIC, comment="#")
    data["volume_mm3"] = 90.0 * data.pole_travel_mm
    options = {"travel_to_opening": "stroke:3.5", "branches": "quasi-static"}
    curve = dpg.fit_bistable(data, **options).calibration.curve
    lengths = {len(v) for v in (curve.travel_mm, curve.pressure_MPa, curve.volume_mm3)}
    assert len(lengths) == 1
    np.testing.assert_allclose(curve.volume_mm3, 90.0 * np.array(curve.travel_mm), rtol=1e-9)
    assert curve.snap_pressure_MPa == pytest.approx(0.151, rel=0.012)


def test_one_branch_keeps_the_snap_pressure_of_the_whole() -> None:
    """Its curve may be that of the way back; the dome has snapped on the way there."""
    travel = np.concatenate((np.linspace(0.0, 14.0, 57), np.linspace(14.0, 0.0, 57)[1:]))
    pressure = 0.15 * travel * (travel - 13.0) * (travel - 7.0) / 110.0
    energy = 0.02 * travel**2 * (travel - 13.0) ** 2 + 0.1 * travel**2
    data = {"travel_mm": travel, "energy_mJ": energy, "pressure_MPa": pressure}
    for branch in ("loading", "unloading"):
        fit = dpg.fit_bistable(data, travel_to_opening="equal", branches=branch)
        snap = fit.calibration.curve.snap_pressure_MPa
        assert snap == pytest.approx(pressure[travel < 7.0].max(), rel=1e-9)


def test_a_calibration_that_is_not_saved_serves_a_spec(study: dict[str, Any]) -> None:
    fit = dpg.fit_bistable(DOME, travel_to_opening="stroke:3.5", geometry=SIZES)
    lattice = {k: v for k, v in study["finger"]["lattice"].items() if k not in fit.values}
    finger = {**study["finger"], "lattice": lattice, "calibration": fit.calibration}
    plan = dpg.explain({"finger": {**finger, "geometry": SIZES}}, settings={"finger.units": 2})
    values = {source.key: source.value for source in plan.scene.sources}
    assert values["stroke_mm"] == fit.values["stroke_mm"]


def test_a_saved_calibration_is_read_back(folder: Path) -> None:
    fit = dpg.fit_hinge(HINGE, geometry=SIZES)
    fit.save(folder / "hinge.yaml")
    assert dpg.read_calibration("hinge.yaml") == fit.calibration


def test_a_hinge_as_by_its_command(printed: Rows) -> None:
    fit = dpg.fit_hinge(HINGE, loss="huber", bootstrap=3)
    rows = printed("fit", "hinge", str(HINGE), "--loss", "huber", "--bootstrap", "3")
    assert_same(fit.table, rows)
    assert "choose with where 'variant=...'" in fit.warnings[0]


@pytest.mark.parametrize("method", ["scaling", "interpolation"])
def test_a_grid_as_by_its_command(printed: Rows, folder: Path, method: str) -> None:
    rows = printed("fit", "grid", str(GRID), "--method", method, "-o", "command.yaml")
    fit = dpg.fit_grid(GRID, method=method)
    assert_same(fit.table, rows)
    fit.save("function.yaml")
    assert (folder / "function.yaml").read_bytes() == (folder / "command.yaml").read_bytes()
    with pytest.raises(dpg.UsageError, match="no figure"):
        fit.draw("grid.svg")


def test_a_finger_as_by_its_command(printed: Rows, folder: Path) -> None:
    place = ("--first-station", "5.4,-0.8", "--tip-offset", "4,-0.7")
    rows = printed("fit", "finger", "study.yaml", "tips.csv", *place, "-o", "command.yaml")
    fit = dpg.fit_finger(
        "study.yaml", "tips.csv", first_station=(5.4, -0.8), tip_offset=(4.0, -0.7)
    )
    assert_same(fit.table, rows)
    fit.draw("finger.svg")
    assert "predicted, calibrated" in (folder / "finger.svg").read_text()


@pytest.mark.parametrize("form", [pd.DataFrame, pa.Table.from_pandas, dict])
def test_data_frames_are_curves(form: Any) -> None:
    frame = pd.read_csv(DOME, comment="#")
    data = {name: frame[name].tolist() for name in frame} if form is dict else form(frame)
    found = dpg.fit_bistable(data, travel_to_opening="equal", geometry=SIZES)
    expected = dpg.fit_bistable(DOME, travel_to_opening="equal", geometry=SIZES)
    assert (found.values, found.warnings) == (expected.values, expected.warnings)
    assert found.calibration.sources[0].file == "data frame"


def test_known_states_are_data_frames(folder: Path, study: dict[str, Any]) -> None:
    known = pd.read_csv("tips.csv", dtype={"pattern": str})
    assert dpg.fit_finger(study, known).values == dpg.fit_finger("study.yaml", "tips.csv").values


def test_values_hold_at_the_geometry_of_the_spec(study: dict[str, Any], folder: Path) -> None:
    study["finger"]["geometry"] = {"dome_thickness_mm": 0.75}
    given = dpg.fit_finger(study, "tips.csv")
    added = dpg.fit_finger(study, "tips.csv", geometry={"dome_thickness_mm": 0.5})
    for fit, thickness in ((given, 0.75), (added, 0.5)):
        assert fit.calibration.geometry is not None
        assert fit.calibration.geometry.dome_thickness_mm == thickness
        assert not any(text.startswith("no geometry") for text in fit.warnings)


def test_wrong_data_are_named_by_row(folder: Path) -> None:
    frame = pd.DataFrame({"travel_mm": [0.0, 1.0, 2.0], "energy_mJ": [0.0, "much", 2.0]})
    with pytest.raises(dpg.SpecError, match=r"^data frame:3: energy_mJ: expected a number"):
        dpg.fit_bistable(frame, travel_to_opening="equal")


@pytest.mark.parametrize(
    ("choices", "message"),
    [
        ({"travel_to_opening": "half"}, "^travel_to_opening half: expected equal"),
        ({"quantity": "force"}, "^quantity force: the curve has energy, pressure"),
        ({"quantity": "heat"}, "^quantity 'heat': expected energy, force, pressure, work"),
        ({"quantity": "pressure"}, "^pressure needs area MM2"),
        ({"area": 50.0}, "^area is for pressure"),
        ({"quantity": "pressure", "area": -1.0}, "^area -1: expected a number > 0"),
        ({"loss_scale": 2.0}, "^loss_scale is for a robust loss: loss soft_l1"),
        ({"loss": "cauchy", "loss_scale": 0.0}, "^loss_scale 0: expected a number > 0"),
        ({"fix": {"force_linearity": 2.0}}, "^fix force_linearity=2: expected a number from 0 to"),
        ({"fix": {"stroke": 2.0}}, "^fix stroke: no value of the law .did you mean stroke_mm"),
        ({"free": ["stroke_mm"]}, "is not free: give its value, fix bistable_stiffness_N_per_mm"),
        ({"branches": "some"}, "^branches 'some': expected both, loading, unloading, quasi-static"),
        ({"loss": "square"}, "^loss 'square': expected linear, soft_l1, huber, cauchy"),
    ],
)
def test_errors_name_fields(choices: dict[str, Any], message: str) -> None:
    with pytest.raises(dpg.UsageError, match=message):
        dpg.fit_bistable(DOME, **{"travel_to_opening": "equal", "geometry": SIZES, **choices})


def test_other_errors_name_fields_too(folder: Path) -> None:
    with pytest.raises(dpg.SpecError, match=r"^geometry: geometry.height: expected a known key"):
        dpg.fit_hinge(HINGE, geometry={"height": 6.5})
    with pytest.raises(dpg.SpecError, match="where: expected COLUMN=TEXT, found 'variant'"):
        dpg.fit_hinge(HINGE, where="variant")
    with pytest.raises(dpg.FitError, match=r"^free height: expected one of segment_length_mm"):
        dpg.fit_finger("study.yaml", "tips.csv", free=["height"])
    with pytest.raises(dpg.UsageError, match=r"^geometry dome_height_mm=3.0: the table has a col"):
        dpg.fit_grid(GRID, geometry={"dome_height_mm": 3.0})
    with pytest.raises(dpg.UsageError, match=r"^target 'toes': expected tips, angles"):
        dpg.fit_finger("study.yaml", "tips.csv", target="toes")


def test_warnings_name_fields_and_in_the_shell_options(folder: Path) -> None:
    fit = dpg.fit_bistable(DYNAMIC, travel_to_opening="equal")
    assert "; branches quasi-static leaves that out" in fit.warnings[0]
    assert "by geometry or a spec" in fit.warnings[-1]
    assert fit.calibration.warnings == list(fit.warnings)
    command = ["fit", "bistable", str(DYNAMIC), "--travel-to-opening", "equal", "-o", "c.yaml"]
    result = CliRunner().invoke(app, command)
    assert "; --branches quasi-static leaves that out" in result.stderr
    assert "--branches quasi-static" in (folder / "c.yaml").read_text()


def test_nothing_of_others_is_replaced(folder: Path) -> None:
    with pytest.raises(dpg.OutputError, match=r"study.yaml: it is there and not of dpg"):
        dpg.fit_hinge(HINGE).save("study.yaml")


def test_an_export_is_read_as_by_its_command(tmp_path: Path) -> None:
    frame = pd.read_csv(DOME, comment="#")
    path = tmp_path / "export.csv"
    renamed = frame.rename(columns={"pole_travel_mm": "Weg", "energy_mJ": "Arbeit (J)"})
    renamed["Arbeit (J)"] /= 1e3
    renamed["Weg"] *= -1.0
    path.write_text("Titel\n" + renamed.to_csv(index=False, sep=";", decimal=","))
    column = {"pole_travel_mm": "-Weg", "energy_mJ": "Arbeit"}
    found = dpg.fit_bistable(path, travel_to_opening="equal", column=column, skip=1)
    whole = dpg.fit_bistable(DOME, travel_to_opening="equal")
    assert found.values == pytest.approx(whole.values, rel=1e-9)
    assert found.warnings[0] == "Arbeit (J) times 1000 is energy_mJ"
    of_frame = dpg.fit_bistable(
        renamed, travel_to_opening="equal", column=["pole_travel_mm=-Weg", "energy_mJ=Arbeit (J)"]
    )
    assert of_frame.values == pytest.approx(whole.values, rel=1e-9)


@pytest.mark.parametrize(
    ("choices", "message"),
    [
        ({"skip": -1}, "^skip -1: expected a number of lines"),
        ({"skip": 1.5}, "^skip 1.5: expected a whole number"),
        ({"column": "Weg"}, "^column Weg: expected NAME=TITLE"),
        ({"column": 3}, "^column 3: expected a text or several"),
        ({"units": {"energy": "kWh"}}, "^units energy=kWh: expected a unit of energy: mJ, J"),
        ({"branches": "up"}, "^branches 'up': expected both, loading, unloading, quasi-static"),
    ],
)
def test_choices_of_an_export_are_checked(choices: dict[str, Any], message: str) -> None:
    with pytest.raises(dpg.UsageError, match=message):
        dpg.fit_bistable(DOME, travel_to_opening="equal", **choices)
