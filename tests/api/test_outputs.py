"""What functions write: never over what they read, never under a name of another format."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import dpgcli as dpg
from dpgcli.mechanics.finger import STUDY, uniform_finger

FINGER = uniform_finger(2, **STUDY)
CALIBRATION = """\
calibration_version: 1
made_by: dpg 0.1.0
method: by hand
values:
  hinge_stiffness_N_mm_per_rad: {value: 24.2}
"""
HINGE = {"moment_N_mm": [12.1, 24.2, 36.3], "rotation_rad": [0.5, 1.0, 1.5]}


@pytest.fixture
def calibrated(folder: Path, study: dict[str, Any]) -> dict[str, Any]:
    """A spec that names a calibration as `dpg fit` writes it."""
    (folder / "lever.yaml").write_text(CALIBRATION)
    del study["finger"]["lattice"]["hinge_stiffness_N_mm_per_rad"]
    study["finger"]["calibration"] = "lever.yaml"
    (folder / "calibrated.yaml").write_text(json.dumps(study))
    return study


@pytest.mark.parametrize("is_file", [True, False])
def test_a_calibration_is_not_replaced_by_what_was_fitted_with_it(
    folder: Path, calibrated: dict[str, Any], monkeypatch: pytest.MonkeyPatch, is_file: bool
) -> None:
    fit = dpg.fit_finger("calibrated.yaml" if is_file else calibrated, "tips.csv")
    for name in ("lever.yaml", "tips.csv", *(["calibrated.yaml"] if is_file else [])):
        with pytest.raises(dpg.UsageError, match="is the spec or data that is read"):
            fit.save(name)
    (folder / "elsewhere").mkdir()
    monkeypatch.chdir(folder / "elsewhere")  # a name is that of the file it was
    with pytest.raises(dpg.UsageError, match="is the spec or data that is read"):
        fit.save(folder / "lever.yaml")
    assert (folder / "lever.yaml").read_text() == CALIBRATION
    fit.save("lever.yaml")
    fit.save("lever.yaml")


def test_nor_the_spec_whose_geometry_a_fit_has(folder: Path) -> None:
    curve = folder / "curve.csv"
    curve.write_text("moment_N_mm,rotation_rad\n12.1,0.5\n24.2,1.0\n36.3,1.5\n")
    fit = dpg.fit_hinge(curve, spec="study.yaml")
    for path in (curve, "study.yaml"):
        with pytest.raises(dpg.UsageError, match="is the spec or data that is read"):
            fit.save(path)


def test_grids_and_domes(folder: Path) -> None:
    (folder / "grid.csv").write_text("dome_height_mm,stroke_mm\n1,0.5\n2,2\n4,8\n")
    travel = [0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0]
    rows = "\n".join(f"{x},{x**2 * (1 - x / 2) ** 2}" for x in travel)
    (folder / "dome.csv").write_text(f"travel_mm,energy_mJ\n{rows}\n")
    grid = dpg.fit_grid("grid.csv")
    dome = dpg.fit_bistable("dome.csv", travel_to_opening="equal", fix={"force_linearity": 0.0})
    for fit, path in ((grid, "grid.csv"), (dome, "dome.csv")):
        with pytest.raises(dpg.UsageError, match="is the spec or data that is read"):
            fit.save(path)


@pytest.mark.slow
def test_a_record_is_not_replaced_by_what_was_compared_with_it(folder: Path) -> None:
    result = dpg.bench(FINGER, repeats=1)
    result.record("record.json")
    before = (folder / "record.json").read_bytes()
    later = dpg.bench(FINGER, repeats=1, compare="record.json")
    with pytest.raises(dpg.UsageError, match="is the spec or data that is read"):
        later.record("record.json")
    assert (folder / "record.json").read_bytes() == before
    with pytest.raises(dpg.UsageError, match="writes Parquet"):
        later.save("bench.csv")
    later.record("later.json")


@pytest.mark.parametrize("name", ["a.csv", "a.JSON", "a.svg", "a.yml"])
def test_a_table_is_not_written_under_another_format_s_name(folder: Path, name: str) -> None:
    with pytest.raises(dpg.UsageError, match=r"writes Parquet, give a name that ends in .parquet"):
        dpg.predict(FINGER).save(name)
    assert not (folder / name).exists()


@pytest.mark.parametrize("names", [("t", "t.parquet"), ("t.parquet", "t")])
def test_facts_of_two_tables_do_not_share_a_file(folder: Path, names: tuple[str, str]) -> None:
    first, second = names
    result = dpg.predict(FINGER)
    result.save(first)
    result.save(first)
    with pytest.raises(dpg.UsageError, match=rf"t.run.json has the facts of {first}: give another"):
        result.save(second)
    assert json.loads((folder / "t.run.json").read_text())["table"] == first
    assert not (folder / second).exists()


DESIGNS = {"design": [0], "calibration": ["given"], "status": ["stable"], "reason": [""]}
NAMES = ["a\0b", "a\ud800b"]
CALLS: dict[str, Callable[[str], object]] = {
    "check": lambda name: dpg.check(name, "n_stable > 1"),
    "report": dpg.report,
    "merge": lambda name: dpg.merge(name, "out"),
    "merge to": lambda name: dpg.merge(["study.yaml"], name),
    "predict": dpg.predict,
    "validate": dpg.validate,
    "predict.save": lambda name: dpg.predict(FINGER).save(f"{name}.parquet"),
    "predict.draw": lambda name: dpg.predict(FINGER).draw(f"{name}.svg"),
    "sweep": dpg.sweep,
    "sweep to": lambda name: dpg.sweep(
        {"base": "study.yaml", "space": [{"key": "finger.units", "values": [2]}]}, name
    ),
    "sweep of": lambda name: dpg.sweep({"base": name, "space": []}),
    "table": lambda name: dpg.sweep({"base": "study.yaml", "space": [{"table": name}]}),
    "calibration": lambda name: dpg.predict({"finger": {"calibration": name}}),
    "compare": lambda name: dpg.compare(FINGER, name),
    "compare.shapes": lambda name: dpg.compare(FINGER, "tips.csv", shapes=name),
    "compare.calibration": lambda name: dpg.compare("study.yaml", "tips.csv", calibration=name),
    "fit": dpg.fit_hinge,
    "fit.spec": lambda name: dpg.fit_hinge(HINGE, spec=name),
    "fit.save": lambda name: dpg.fit_hinge(HINGE).save(f"{name}.yaml"),
    "fit.draw": lambda name: dpg.fit_hinge(HINGE).draw(f"{name}.svg"),
    "grid": dpg.fit_grid,
    "read_calibration": dpg.read_calibration,
    "bench": lambda name: dpg.bench(FINGER, compare=name),
    "stress": dpg.stress,
}


@pytest.mark.parametrize("name", NAMES, ids=["zero", "surrogate"])
@pytest.mark.parametrize("call", CALLS)
def test_names_that_no_file_has(folder: Path, call: str, name: str) -> None:
    before = sorted(folder.rglob("*"))
    with pytest.raises(dpg.DpgError):
        problems = CALLS[call](name)
        if problems:
            raise dpg.SpecError(problems)  # type: ignore[arg-type]
    assert sorted(folder.rglob("*")) == before


@pytest.mark.parametrize("repeats", [0, -1, 10**12])
def test_a_benchmark_is_repeated_as_often_as_by_the_command(repeats: int) -> None:
    with pytest.raises(dpg.UsageError, match=rf"^repeats {repeats}: expected from 1 to 1,000"):
        dpg.bench(FINGER, repeats=repeats)


def test_no_more_samples_than_by_the_command() -> None:
    with pytest.raises(dpg.UsageError, match=r"^bootstrap 100001: expected at most 100,000"):
        dpg.fit_hinge(HINGE, bootstrap=100_001)


def test_a_check_without_requirements_is_none() -> None:
    for require in ([], ()):
        with pytest.raises(dpg.UsageError, match=r"^require: expected one requirement or more"):
            dpg.check({**DESIGNS, "n_stable": [4]}, require)
