"""Walls that give way, in specs: of the whole finger, of some units, from a calibration."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dpgcli as dpg

LATTICE = {
    "segment_length_mm": 13.5,
    "segment_height_mm": 10.75,
    "stroke_mm": 3.5,
    "bistable_stiffness_N_per_mm": 12.84,
    "force_linearity": 0.043,
    "hinge_stiffness_N_mm_per_rad": 24.2,
}
FILE = """\
calibration_version: 1
made_by: hand
method: by hand
values:
  wall_compliance_mm_per_N: {value: 0.8}
"""


def finger(**keys: object) -> dict[str, object]:
    return {"finger": {"units": 3, "lattice": LATTICE, **keys}}


def compliance(spec: dict[str, object], **choices: object) -> list[float]:
    values = dpg.explain(spec, **choices).scene.finger.wall_compliance[:, 0]  # type: ignore[arg-type]
    return [float(value) for value in values]


def test_walls_are_rigid_unless_given() -> None:
    plan = dpg.explain(finger())
    assert not plan.scene.finger.has_walls
    assert plan.unknowns == 12
    assert "wall_compliance_mm_per_N" not in {source.key for source in plan.scene.sources}
    assert any("walls" in omission.what for omission in plan.omissions)


def test_of_the_whole_finger_and_of_some_units() -> None:
    assert compliance(finger(wall_compliance_mm_per_N=0.8)) == [0.8]
    graded = finger(wall_compliance_mm_per_N=0.8, overrides={"3": {"wall_compliance_mm_per_N": 0}})
    assert compliance(graded) == [0.8, 0.8, 0.0]
    one = finger(overrides={"2": {"wall_compliance_mm_per_N": 0.5}})
    assert compliance(one) == [0.0, 0.5, 0.0]
    assert compliance(one, settings={"finger.wall_compliance_mm_per_N": 0.1}) == [0.1, 0.5, 0.1]


def test_a_calibration_may_have_it(tmp_path: Path) -> None:
    (tmp_path / "walls.yaml").write_text(FILE)
    spec = finger(calibration=str(tmp_path / "walls.yaml"))
    assert compliance(spec) == [0.8]
    (source,) = (s for s in dpg.explain(spec).scene.sources if s.key == "wall_compliance_mm_per_N")
    assert source.origin == "calibrated"
    assert compliance(spec, settings={"finger.wall_compliance_mm_per_N": 0.0}) == [0.0]


@pytest.mark.parametrize("value", [-1.0, float("nan"), "soft"])
def test_what_no_wall_has_is_refused(value: object) -> None:
    with pytest.raises(dpg.SpecError, match=r"wall_compliance_mm_per_N: expected a compliance"):
        dpg.explain(finger(wall_compliance_mm_per_N=value))


def test_a_sweep_over_walls_finds_what_predictions_find() -> None:
    """Designs with rigid walls among them, which take no unknown more."""
    values = [0.0, 0.4, 0.8]
    space = [{"key": "finger.wall_compliance_mm_per_N", "values": values}]
    states = dpg.sweep({"base": finger(), "space": space}, executor="serial").states.to_pandas()
    for value in values:
        own = dpg.predict(finger(wall_compliance_mm_per_N=value), columns=("states",)).to_pandas()
        part = states[states["wall_compliance_mm_per_N"] == value]
        for name in ("tip_x_mm", "tip_y_mm", "energy_mJ"):
            np.testing.assert_allclose(part[name].to_numpy(), own[name].to_numpy(), atol=1e-11)
        assert part["pattern"].tolist() == own["pattern"].tolist()


@pytest.mark.parametrize(
    "walls",
    [
        {"wall_compliance_mm_per_N": 0.8},
        {"overrides": {"1": {"wall_compliance_mm_per_N": 0.8}}},
        {"overrides": {"9-14": {"wall_compliance_mm_per_N": 0.8}}},
    ],
)
def test_pairs_of_halves_know_walls(walls: dict[str, Any]) -> None:
    """All states of a long finger, and some of them alone; also where half of it has none."""
    spec = finger(units=14, **walls)
    whole = dpg.predict(spec, columns="states")
    assert whole.plan.method == "pairs of half-fingers"
    few = dpg.predict(spec, patterns="1010*0011", columns="states")
    assert few.plan.method == "direct"
    rows = whole.to_pandas().set_index("pattern").loc[few.table["pattern"].tolist()]
    for name in ("tip_x_mm", "tip_y_mm", "energy_mJ"):
        np.testing.assert_allclose(rows[name], few.table[name].tolist(), atol=1e-9)
