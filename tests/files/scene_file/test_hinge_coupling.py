"""Hinges that turn their neighbors, in specs: given, calibrated, swept, refused."""

from pathlib import Path

import numpy as np
import pytest

import dpgcli as dpg
from dpgcli.api.inputs import scene_input
from dpgcli.api.recalibration import recalibrated_scene
from dpgcli.design.dimensions import Tolerance
from dpgcli.design.resolve import resolve
from dpgcli.design.scatter import scattered
from dpgcli.files.scene_file import read_spec

CONFIGS = Path(__file__).parents[3] / "configs"
WALLS = "wall_compliance_mm_per_N"
KEY = "hinge_coupling_N_mm_per_rad"
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
  hinge_coupling_N_mm_per_rad: {value: 1.2, standard_error: 0.1}
geometry: {elastic_modulus_MPa: 26, channel_width_mm: 10, limiting_layer_thickness_mm: 1.5,
  unit_separation_mm: 3}
"""


def finger(**keys: object) -> dict[str, object]:
    return {"finger": {"units": 3, "lattice": LATTICE, **keys}}


def coupling(spec: dict[str, object], **choices: object) -> float:
    found = dpg.explain(spec, **choices).scene.finger  # type: ignore[arg-type]
    return float(found.hinge_coupling[0, 0])


def test_there_is_none_unless_it_is_given() -> None:
    plan = dpg.explain(finger())
    assert not plan.scene.finger.is_coupled
    assert KEY not in {source.key for source in plan.scene.sources}
    assert KEY not in {source.key for source in dpg.explain(finger(**{KEY: 0.0})).scene.sources}


def test_it_is_said_where_it_is_from() -> None:
    plan = dpg.explain(finger(**{KEY: 1.2}))
    (source,) = (source for source in plan.scene.sources if source.key == KEY)
    assert (source.value, source.origin, source.units) == (1.2, "given", "1-3")
    assert coupling(finger(**{KEY: 1.2}), settings={f"finger.{KEY}": -0.3}) == -0.3
    graded = finger(overrides={"2": {"lattice": {"stroke_mm": 3.4}}}, **{KEY: 1.2})
    (source,) = (source for source in dpg.explain(graded).scene.sources if source.key == KEY)
    assert source.units == "1-3"


def test_a_calibration_may_have_it_and_it_is_scaled_as_hinges_are(tmp_path: Path) -> None:
    (tmp_path / "coupled.yaml").write_text(FILE)
    spec = finger(calibration=str(tmp_path / "coupled.yaml"))
    assert coupling(spec) == 1.2
    (source,) = (s for s in dpg.explain(spec).scene.sources if s.key == KEY)
    assert (source.origin, source.standard_error) == ("calibrated", 0.1)
    assert coupling(spec, settings={f"finger.{KEY}": 0.0}) == 0.0
    thick = {
        "elastic_modulus_MPa": 52.0,
        "channel_width_mm": 10.0,
        "limiting_layer_thickness_mm": 1.2,
        "unit_separation_mm": 3.0,
    }
    scaled = finger(calibration=str(tmp_path / "coupled.yaml"), geometry=thick)
    assert coupling(scaled) == pytest.approx(1.2 * 2.0 * 0.8**3, rel=1e-12)


@pytest.mark.parametrize("value", [12.1, -12.1, 100.0])
def test_half_the_hinge_stiffness_is_too_much(value: float) -> None:
    with pytest.raises(dpg.SpecError, match=r"less than half the hinge stiffness, 12.1 N mm/rad"):
        dpg.explain(finger(**{KEY: value}))
    soft = {"2": {"lattice": {"hinge_stiffness_N_mm_per_rad": 2.0}}}
    with pytest.raises(dpg.SpecError, match=r"1 N mm/rad, found 1.2 \(of units 2:"):
        dpg.explain(finger(overrides=soft, **{KEY: 1.2}))
    assert coupling(finger(**{KEY: 12.09})) == 12.09


@pytest.mark.parametrize("value", [float("nan"), float("inf"), "stiff", True])
def test_what_is_no_number_is_refused(value: object) -> None:
    with pytest.raises(dpg.SpecError, match=f"{KEY}: expected a number in N mm/rad"):
        dpg.explain(finger(**{KEY: value}))


@pytest.mark.parametrize("place", ["overrides.2", "overrides.2.lattice", "lattice"])
def test_it_is_of_the_whole_finger(place: str) -> None:
    with pytest.raises(dpg.SpecError, match=rf"did you mean finger\.{KEY}\?"):
        dpg.explain(finger(), settings={f"finger.{place}.{KEY}": 1.0})


def test_a_sweep_over_it_finds_what_predictions_find() -> None:
    """Designs without one among them, and one that no finger can have."""
    values = [0.0, 1.2, 5.0, 13.0]
    space = [{"key": f"finger.{KEY}", "values": values}]
    found = dpg.sweep({"base": finger(), "space": space}, executor="serial")
    states = found.states.to_pandas()
    for value in values[:-1]:
        own = dpg.predict(finger(**{KEY: value}), columns=("states",)).to_pandas()
        part = states[states[KEY] == value]
        for name in ("tip_x_mm", "tip_y_mm", "energy_mJ"):
            np.testing.assert_allclose(part[name].to_numpy(), own[name].to_numpy(), atol=1e-11)
        assert part["pattern"].tolist() == own["pattern"].tolist()
    assert not (states[KEY] == 13.0).any()
    designs = found.designs.to_pandas()
    (problem,) = designs[designs[KEY] == 13.0]["reason"]
    assert "half the hinge stiffness" in problem


def test_errors_and_tolerances_of_it_reach_the_tips() -> None:
    spec = finger(**{KEY: 1.2}) | {"uncertainty": {KEY: 0.1}}
    row = dpg.predict(spec, patterns="110", columns="uncertainty").to_pandas().iloc[0]
    low, high = (
        dpg.predict(finger(**{KEY: value}), patterns="110").to_pandas().iloc[0]
        for value in (1.19, 1.21)
    )
    for axis in "xy":
        moved = abs(high[f"tip_{axis}_mm"] - low[f"tip_{axis}_mm"]) / 0.02 * 0.1
        assert row[f"tip_{axis}_uncertainty_mm"] == pytest.approx(moved, rel=1e-4)
    with pytest.raises(dpg.SpecError, match="hinges do not turn each other"):
        dpg.explain(finger() | {"uncertainty": {KEY: 0.1}})
    with pytest.raises(dpg.SpecError, match=f"{KEY} is 0"):
        dpg.explain(finger(**{KEY: 0.0}) | {"uncertainty": {KEY: "10%"}})
    none = dpg.predict(finger(**{KEY: 0.0}) | {"uncertainty": {KEY: 0.1}}, columns="uncertainty")
    assert none.to_pandas()["tip_y_uncertainty_mm"].max() > 1e-4, "what a little of it would do"


def test_draws_whose_hinges_would_run_away_are_none() -> None:
    design = read_spec(CONFIGS / "three_unit.yaml", [f"finger.{KEY}=11"]).design
    draws = scattered(design, {KEY: Tolerance(1.0, False)}, 400, 1)
    moved = 11.0 + draws.moves[KEY][0]
    assert draws.are_wrong.tolist() == (moved >= 12.1).tolist()
    hinge = "hinge_stiffness_N_mm_per_rad"
    draws = scattered(design, {hinge: Tolerance(1.0, False)}, 400, 1)
    moved = (24.2 + draws.moves[hinge]).min(axis=0)
    assert draws.are_wrong.tolist() == (moved <= 22.0).tolist() and draws.are_wrong.any()


def test_designs_with_and_without_one_are_no_batch() -> None:
    base = read_spec(CONFIGS / "three_unit.yaml").design
    design = base.with_values({f"finger.{KEY}": np.array([0.0, 1.2, 0.0, -5.0])})
    parts = resolve(design).alike(np.arange(4))
    assert [part.tolist() for part in parts] == [[0, 2], [1, 3]]


def test_a_calibration_takes_the_place_of_what_a_spec_says(tmp_path: Path) -> None:
    """As in `compare --calibration`; one that has none leaves it."""
    (tmp_path / "coupled.yaml").write_text(FILE)
    (tmp_path / "other.yaml").write_text(
        FILE.replace(KEY + ": {value: 1.2", f"{WALLS}: {{value: 1")
    )
    given = scene_input(finger(**{KEY: 5.0}), {})
    for name, expected in (("coupled.yaml", 1.2), ("other.yaml", 5.0)):
        found = recalibrated_scene(given, tmp_path / name).finger
        assert found.hinge_coupling[0, 0] == expected


def test_long_fingers_are_solved_whole() -> None:
    assert dpg.explain(finger(units=14, **{KEY: 1.2}), columns="states").method == "direct"
