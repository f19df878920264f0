"""A design as a spec: complete in one file, and the same numbers as in the tables of its sweep."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dpgcli as dpg
from dpgcli.errors import SpecError, UsageError
from dpgcli.files.design_spec import design_spec, spec_text, swept_base, write_spec
from dpgcli.files.scene_file import canonical_json, read_scene, read_spec

GEOMETRY = {
    "dome_height_mm": 6.5,
    "dome_thickness_mm": 0.75,
    "unit_cell_mm": 22,
    "chamber_length_mm": 9,
    "channel_width_mm": 10,
    "limiting_layer_thickness_mm": 1.5,
    "unit_separation_mm": 3,
    "elastic_modulus_MPa": 26,
}
BASE: dict[str, Any] = {"finger": {"units": 3, "calibration": "published", "geometry": GEOMETRY}}
GRIPPER = {"base_spacing_mm": 40.0}
SHIPPED = {"finger": {**BASE["finger"], "calibration": "finite_elements"}}
FILES = {"finger": {**BASE["finger"], "calibration": ["push.yaml", "published"]}}
LOADS = {"tip_force_N": [0.0, -0.01], "unit_mass_g": [1.0, 2.0, 3.0]}
DISC = {"disc": {"diameter_mm": 20.0}, "at_mm": [30.0, 0.0]}
PRESSURE = {"lines": {"B": "1-2", "A": 3}, "effective_area_mm2": 30.0}
AXES = {
    "units": (BASE, {"finger.units": [2, 4]}),
    "some units alone": (BASE, {"finger.overrides.2-3.geometry.dome_height_mm": [6.0, 7.0]}),
    "bars": (BASE, {"finger.linear_stiffness_N_per_mm": [1e3, float("inf")]}),
    "gripper": ({**BASE, "gripper": GRIPPER}, {"gripper.mounting_angle_deg": [-5.0, 12.5]}),
    "loads": ({**BASE, "loads": LOADS}, {"loads.tip_force_y_N": [-0.02, 0.01]}),
    "masses": ({**BASE, "loads": LOADS}, {"loads.unit_mass_g": [0.5, 2.5]}),
    "object": ({**BASE, "gripper": GRIPPER, "object": DISC}, {"object.at_x_mm": [25.0, 35.0]}),
    "pressure": ({**BASE, "pressure": PRESSURE}, {"pressure.effective_area_mm2": [20.0, 31.0]}),
    "shipped calibration": (SHIPPED, {"finger.geometry.dome_height_mm": [6.0, 6.75]}),
    "calibration file": (FILES, {"finger.wall_compliance_mm_per_N": [0.0, 0.1]}),
}


@pytest.fixture(autouse=True)
def _calibration(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    push = Path("configs/calibration/push_3.5mm.yaml").read_text(encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    Path("push.yaml").write_text(push, encoding="utf-8")


@pytest.mark.parametrize("axis", AXES)
def test_a_written_spec_gives_the_numbers_of_the_sweep(axis: str) -> None:
    """Every state of the second design, in every column that both tables have."""
    base, paired = AXES[axis]
    space = [{"paired": paired}]
    swept = dpg.sweep({"base": base, "space": space}, executor="serial")
    metadata = {k.decode(): v.decode() for k, v in swept.states.to_arrow().schema.metadata.items()}
    Path("push.yaml").unlink()  # a spec stands alone
    spec = design_spec(swept_base(metadata), {key: values[1] for key, values in paired.items()})
    write_spec(Path("design.yaml"), spec, f"design 1 of {axis}")
    assert canonical_json(read_spec("design.yaml")) == canonical_json(spec)

    found = dpg.predict("design.yaml", columns="all").to_pandas()
    states = swept.states.to_pandas()
    states = states[states.design == 1].reset_index(drop=True)
    shared = [name for name in found if name in states]
    assert {"pattern", "status", "tip_x_mm", "energy_mJ", "tip_stiffness_min_N_per_mm"} <= {*shared}
    for name in shared:
        if states[name].dtype.kind == "f":
            np.testing.assert_allclose(found[name], states[name], 1e-12, 1e-12, err_msg=name)
        else:
            assert found[name].tolist() == states[name].tolist(), name


def test_a_spec_of_a_file_takes_its_calibrations_along(tmp_path: Path) -> None:
    """Their sections are those of the file, and its uncertainties, data and model error stay."""
    said = {**FILES, "uncertainty": {"dome_height_mm": "2%"}, "model_error": "5%"}
    (tmp_path / "base.yaml").write_text(json.dumps(said), encoding="utf-8")
    spec = design_spec(read_scene("base.yaml"), {"finger.units": 5})
    text = spec_text(spec, "five units")
    assert text.startswith("# Written by dpg: five units\n# It may be replaced until")
    Path("design.yaml").write_text(text, encoding="utf-8")
    Path("push.yaml").unlink()
    read = read_spec("design.yaml")
    assert read.finger.units == 5
    assert read.model_error == "5%"
    assert canonical_json(read) == canonical_json(spec)
    (calibration, published) = read.finger.calibration
    assert (calibration.file, published) == ("push.yaml", "published")


def test_a_name_cannot_leave_the_comment() -> None:
    spec = design_spec(swept_base({"dpg.sweep": json.dumps({"base": json.dumps(BASE)})}), {})
    assert "# Written by dpg: a\\nfinger: b\n#" in spec_text(spec, "a\nfinger: b")


def test_what_is_no_design_is_refused_with_its_reason() -> None:
    base = swept_base({"dpg.sweep": json.dumps({"base": json.dumps(BASE)})})
    with pytest.raises(SpecError, match=r"stroke_mm = -0\.5"):
        design_spec(base, {"finger.geometry.unit_separation_mm": 7.0})
    with pytest.raises(SpecError, match="dome_hight_mm"):
        design_spec(base, {"finger.geometry.dome_hight_mm": 7.0})


@pytest.mark.parametrize("said", [{}, {"dpg.sweep": "{"}, {"dpg.sweep": '{"base": "[]"}'}])
def test_tables_without_a_base_have_none(said: dict[str, str]) -> None:
    with pytest.raises(UsageError, match="no base spec"):
        swept_base(said)


def test_a_spec_that_no_file_can_hold_is_refused() -> None:
    history = {"A": [0.0] * 10_001}
    with pytest.raises(UsageError, match="room for 10,000"):
        spec_text(design_spec(swept_base_of({**BASE, "pressure": {"history": history}}), {}), "x")


def swept_base_of(data: dict[str, Any]) -> Any:
    return swept_base({"dpg.sweep": json.dumps({"base": json.dumps(data)})})


def test_what_somebody_else_wrote_is_not_replaced() -> None:
    spec = design_spec(swept_base_of(BASE), {})
    path = Path("best.yaml")
    write_spec(path, spec, "one")
    write_spec(path, spec, "two")
    assert "two" in path.read_text(encoding="utf-8")
    path.write_text(path.read_text(encoding="utf-8").partition("\n")[2], encoding="utf-8")
    with pytest.raises(dpg.OutputError, match="not of dpg"):
        write_spec(path, spec, "three")
