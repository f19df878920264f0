"""Inverse design from Python: goals as data, results as tables and specs, certified anew."""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import dpgcli as dpg
from dpgcli.api import reached as module
from dpgcli.api.inputs import spec_document
from dpgcli.errors import NothingSelectedError, SpecError, UsageError
from dpgcli.files.design_spec import spec_text
from dpgcli.files.goal_output import folder_beside
from dpgcli.files.scene_file import checked
from dpgcli.files.yaml_file import read_document
from dpgcli.search.search import search

CONFIGS = Path(__file__).parents[2] / "configs"
Goal = dict[str, Any]
STROKE = "finger.lattice.stroke_mm"
HINGE = "finger.lattice.hinge_stiffness_N_mm_per_rad"


@pytest.fixture
def goal(study: dict[str, Any]) -> Callable[..., Goal]:
    """A goal around the study's finger of three units."""

    def made(value: tuple[float, float] = (35.0, -19.0), **more: Any) -> Goal:
        target = {"pattern": "11*", "quantity": "tip", "value": value, "tolerance_mm": 0.1}
        vary = {STROKE: {"from": 2.5, "to": 4.5}, HINGE: {"from": 15.0, "to": 40.0}}
        return {"base": study, "vary": vary, "targets": [target], **more}

    return made


def test_each_design_is_what_predict_finds_for_its_spec(goal: Callable[..., Goal]) -> None:
    """Through the spec's text, with numbers that agree to 1e-9."""
    found = dpg.inverse_design(goal(vary={"finger.units": [2, 3], STROKE: {"from": 3, "to": 4}}))
    frame = found.table.to_pandas()
    assert frame["units"].tolist() == [3, 2]
    for row, spec in zip(frame.itertuples(), found.specs, strict=True):
        assert spec_text(spec, "a test")
        data = spec.model_dump(exclude_none=True)
        states = dpg.predict(data, patterns=row.target_1_pattern).to_pandas()
        assert dpg.predict(spec, patterns=row.target_1_pattern).to_pandas().equals(states)
        assert states["status"].tolist() == ["stable"]
        for name in ("tip_x_mm", "tip_y_mm"):
            assert states[name][0] == pytest.approx(getattr(row, f"target_1_{name}"), abs=1e-9)
        miss = np.hypot(row.target_1_tip_x_mm - 35.0, row.target_1_tip_y_mm + 19.0)
        assert row.target_1_miss_mm == pytest.approx(miss)
        assert row.misfit == pytest.approx(miss / 0.1)
        assert row.meets_all == (miss <= 0.1)


def test_a_number_that_is_not_predicts_is_a_bug(
    goal: Callable[..., Goal], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "AGREEMENT", 0.0)
    told = np.array([1.0])
    module.check_agreement(told, told)
    with pytest.raises(AssertionError, match="predict finds the same"):
        module.check_agreement(told, told + 2e-16 * np.array([2.0]))


def test_tables_and_specs_in_a_folder(goal: Callable[..., Goal], tmp_path: Path) -> None:
    folder = tmp_path / "found"
    found = dpg.inverse_design(goal(), folder)
    best = pd.read_parquet(folder / "best.parquet")
    pd.testing.assert_frame_equal(best, found.table.to_pandas())
    trace = pd.read_parquet(folder / "trace.parquet")
    assert set(trace.columns) == {
        "search", "step", "stroke_mm", "hinge_stiffness_N_mm_per_rad", "misfit"
    }  # fmt: skip
    assert (trace.groupby("search")["misfit"].diff().dropna() <= 0.0).all()
    assert trace.groupby("search")["step"].min().eq(0).all()
    names = {f"design_{number}.yaml" for number in best["design"]}
    assert {path.name for path in folder.glob("*.yaml")} == names
    states = dpg.predict(folder / "design_1.yaml", patterns=best["target_1_pattern"][0])
    assert states.table["tip_x_mm"][0] == pytest.approx(best["target_1_tip_x_mm"][0], abs=1e-9)


@pytest.mark.slow
def test_the_same_goal_gives_the_same_bytes(goal: Callable[..., Goal], tmp_path: Path) -> None:
    found = dpg.inverse_design(goal(vary={STROKE: {"from": 3, "to": 4}}), tmp_path / "one")
    dpg.inverse_design(goal(vary={STROKE: {"from": 3, "to": 4}})).save(tmp_path / "other")
    assert len(found.specs) < 4
    for path in (tmp_path / "one").iterdir():
        assert path.read_bytes() == (tmp_path / "other" / path.name).read_bytes()


def test_specs_of_an_earlier_search_go_and_those_of_people_stay(
    goal: Callable[..., Goal], tmp_path: Path
) -> None:
    folder = tmp_path / "found"
    found = dpg.inverse_design(goal(vary={STROKE: {"from": 3, "to": 4}}), folder)
    own = (folder / "design_1.yaml").read_text()
    (folder / "design_98.yaml").write_text(own)
    (folder / "design_97.yaml").touch()
    found.save(folder)
    assert not (folder / "design_98.yaml").exists()
    assert (folder / "design_97.yaml").exists()
    (folder / "design_99.yaml").write_text(own)
    again = dpg.inverse_design(goal(vary={STROKE: {"from": 3, "to": 4}}), folder)
    assert again.removed == ("design_99.yaml",)
    assert again.summary[-1].endswith("removed as it wrote them: design_99.yaml")


@pytest.mark.parametrize("name", ["design_1.yaml", "design_99.yaml"])
def test_specs_that_somebody_edited_stay(
    goal: Callable[..., Goal], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.setattr("dpgcli.api.inverse_design.search", None)  # nothing is begun
    spec = checked(spec_document(goal()["base"]))
    edited = spec_text(spec, "design 99 of best.parquet") + "# mine\n"
    (tmp_path / name).write_text(edited)
    with pytest.raises(dpg.OutputError, match=f"{name}: it was edited since dpg wrote it; move"):
        dpg.inverse_design(goal(), tmp_path)
    assert (tmp_path / name).read_text() == edited


def edit(folder: Path) -> None:
    (folder / "design_7.yaml").write_text("finger: {}\n")


@pytest.mark.parametrize("harm", [edit, shutil.rmtree])
@pytest.mark.parametrize("is_beside_there", [False, True])
def test_what_was_found_is_kept_where_its_folder_takes_it_no_more(
    goal: Callable[..., Goal],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    harm: Callable[[Path], None],
    is_beside_there: bool,
) -> None:
    """Somebody works in it, or removes it, while the search goes on until its time is up."""
    folder = tmp_path / "out"
    beside = tmp_path / ("out_3" if is_beside_there else "out_2")
    if is_beside_there:
        (tmp_path / "out_2").mkdir()

    def searched(*args: Any) -> Any:
        found = search(*args)
        harm(folder)
        return found

    monkeypatch.setattr("dpgcli.api.inverse_design.search", searched)
    few = goal(vary={STROKE: {"from": 3, "to": 4}})
    with pytest.raises(dpg.OutputError, match=f"; what was found is in .*{beside.name}$"):
        dpg.inverse_design(few, folder, budget=30, evaluations=40)
    names = {path.name for path in beside.iterdir()}
    assert {"best.parquet", "trace.parquet", "design_1.yaml"} <= names
    if harm is edit:
        assert [path.name for path in folder.iterdir()] == ["design_7.yaml"]
    if is_beside_there:
        assert not [*(tmp_path / "out_2").iterdir()]


def test_a_folder_beside_is_a_temporary_one_where_there_can_be_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert folder_beside(Path()).name == f"{tmp_path.name}_2"
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    assert folder_beside(tmp_path / "no" / "out") == tmp_path / "out_2"
    assert (tmp_path / "out_2").is_dir()


@pytest.mark.parametrize("first", ["finger: {}", "# Written by dpg: design 99 of the sweep x"])
@pytest.mark.parametrize("name", ["design_1.yaml", "design_99.yaml"])
def test_specs_that_no_search_wrote_are_asked_about_before(
    goal: Callable[..., Goal],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    name: str,
    first: str,
) -> None:
    monkeypatch.setattr("dpgcli.api.inverse_design.search", None)  # nothing is begun
    (tmp_path / name).write_text(f"{first}\n")
    with pytest.raises(dpg.OutputError, match=f"{name}: it is there and (not )?of dpg"):
        dpg.inverse_design(goal(), tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == [name]
    assert (tmp_path / name).read_text() == f"{first}\n"


def test_a_base_that_an_earlier_search_found_is_not_replaced(
    goal: Callable[..., Goal], tmp_path: Path
) -> None:
    folder = tmp_path / "found"
    dpg.inverse_design(goal(vary={STROKE: {"from": 3, "to": 4}}), folder)
    base = (folder / "design_1.yaml").rename(folder / "design_9.yaml")
    (tmp_path / "goal.yaml").write_text(
        "base: found/design_9.yaml\n"
        f"vary: {{{HINGE}: {{from: 15, to: 40}}}}\n"
        "targets: [{pattern: '111', quantity: tip, value: [35, -19], tolerance_mm: 1}]\n"
    )
    with pytest.raises(UsageError, match=r"design_9\.yaml is the spec or data that is read"):
        dpg.inverse_design(tmp_path / "goal.yaml", folder)
    assert base.exists()


def test_what_is_asked_of_maps_is_certified_too(goal: Callable[..., Goal]) -> None:
    given = goal(constraints=["min_barrier_mJ > 1.0"], minimize=["stroke_mm"], targets=[])
    found = dpg.inverse_design(given)
    row = found.table.to_pandas().iloc[0]
    assert row["min_barrier_mJ"] == pytest.approx(1.0, rel=1e-5)
    assert row["min_barrier_mJ"] > 1.0
    assert "min_barrier_mJ > 1.0" in row["active"]
    assert "misfit" not in found.table.names
    space = [{"key": STROKE, "values": [row["stroke_mm"]]},
             {"key": HINGE, "values": [row["hinge_stiffness_N_mm_per_rad"]]}]  # fmt: skip
    swept = dpg.sweep({"base": given["base"], "space": space}, executor="serial").designs
    assert swept["min_barrier_mJ"][0] == pytest.approx(row["min_barrier_mJ"], rel=1e-12)


def test_what_is_not_met_is_said(goal: Callable[..., Goal]) -> None:
    found = dpg.inverse_design(goal((10.0, -39.0)))
    assert not found.is_met
    assert found.summary[0].startswith("no design meets all that is asked")
    assert any("in the way: stroke_mm <= 4.5" in line for line in found.summary)
    assert found.table["active"][0].startswith("stroke_mm <= 4.5")


def test_a_search_that_was_stopped_does_not_say_that_there_is_nothing_better(
    goal: Callable[..., Goal],
) -> None:
    found = dpg.inverse_design(goal(), evaluations=1)
    assert not found.is_met and "stopped by the limit" in found.summary[-1]
    assert any("the limit ended the search, and further starts may" in s for s in found.summary)


def test_a_body_varies_and_no_free_state_depends_on_it(
    goal: Callable[..., Goal], study: dict[str, Any]
) -> None:
    thick = {**study["finger"], "geometry": {"limiting_layer_thickness_mm": 1.5}}
    body = {"disc": {"diameter_mm": 10.0}, "at_mm": [25.0, -14.0]}
    vary = {STROKE: {"from": 2.5, "to": 4.5}, "object.at_x_mm": {"from": 20.0, "to": 30.0}}
    one = {"pattern": "110", "quantity": "tip_x_mm", "value": 37.0, "tolerance_mm": 0.1}
    found = dpg.inverse_design(
        {"base": {"finger": thick, "object": body}, "vary": vary, "targets": [one]}
    )
    assert found.is_met and np.ptp(found.table["stroke_mm"]) < 1e-6


def test_fingers_that_overlap_are_warned_of(
    goal: Callable[..., Goal], study: dict[str, Any]
) -> None:
    thick = {**study["finger"], "geometry": {"limiting_layer_thickness_mm": 1.5}}
    warned = []
    for spacing in (10.0, 200.0):
        base = {"finger": thick, "gripper": {"base_spacing_mm": spacing, "mounting_angle_deg": 0}}
        warned.append(dpg.inverse_design({**goal(), "base": base}).warnings)
    said = "fingers overlap, since nothing keeps them apart in the model: design 1 in 11"
    assert any(line.startswith(said) for line in warned[0])
    assert not any("overlap" in line for line in warned[1])


def test_warnings_name_what_no_design_should_be_chosen_by(goal: Callable[..., Goal]) -> None:
    """And it is strict about them before any work; tips may be chosen by."""
    data = read_document(CONFIGS / "three_unit.yaml").data
    energy = {"pattern": "11*", "quantity": "energy_mJ", "value": 9.0, "tolerance_mJ": 0.1}
    height = {"finger.geometry.dome_height_mm": {"from": 5.5, "to": 6.5}}
    given = goal(base=data, vary=height, targets=[energy])
    found = dpg.inverse_design(given)
    assert any(line.startswith("goal: energy_mJ rests on energies") for line in found.warnings)
    with pytest.raises(UsageError, match=r"^strict allows no goal about what is doubted:\n?energy"):
        dpg.inverse_design(given, strict=True)
    tip = {"pattern": "11*", "quantity": "tip_y_mm", "value": -15.0, "tolerance_mm": 5.0}
    strict = dpg.inverse_design(goal(base=data, vary=height, targets=[tip]), strict=True)
    assert strict.warnings == ()


def test_differences_are_said(goal: Callable[..., Goal]) -> None:
    opening = {"pattern": "11*", "quantity": "opening_1_mm", "value": 3.4, "tolerance_mm": 0.1}
    found = dpg.inverse_design(goal(targets=[opening]))
    assert found.is_met
    assert "slopes of opening_1_mm by central differences" in found.summary[-1]


def test_no_finger_with_such_states(goal: Callable[..., Goal]) -> None:
    """With stiff hinges no dome stays inverted."""
    given = goal(vary={HINGE: {"from": 1000.0, "to": 2000.0}})
    with pytest.raises(NothingSelectedError, match="none of 32 starts is a finger with certified"):
        dpg.inverse_design(given)


def test_why_no_design_can_exist_is_said(goal: Callable[..., Goal]) -> None:
    """Where the geometry has a stroke, too, another is refused."""
    given = goal()
    sizes = ("dome_height_mm", 6.5), ("unit_separation_mm", 3.0)
    given["base"]["finger"]["geometry"] = {**dict(sizes)}
    given["vary"] = {STROKE: {"from": 3.6, "to": 4.0}}
    with pytest.raises(NothingSelectedError, match=r"stroke_mm: expected 3\.5"):
        dpg.inverse_design(given)


@pytest.mark.parametrize(
    ("choice", "field"), [({"seed": -1}, "seed"), ({"evaluations": 0}, "evaluations"),
                          ({"budget": 0.0}, "budget"), ({"budget": float("nan")}, "budget")]
)  # fmt: skip
def test_wrong_choices(goal: Callable[..., Goal], choice: dict[str, Any], field: str) -> None:
    with pytest.raises(UsageError, match=f"^{field}"):
        dpg.inverse_design(goal(), **choice)


def test_what_was_found_until_time_is_up_is_kept(goal: Callable[..., Goal]) -> None:
    found = dpg.inverse_design(goal(), budget=1e-9)
    assert found.searched.is_stopped
    assert found.summary[-1].endswith("stopped by the limit")
    assert len(found.table) > 0


def test_goals_are_validated_and_other_commands_name_the_right_one(
    goal: Callable[..., Goal],
) -> None:
    assert dpg.validate(goal()) == ()
    assert [p.key for p in dpg.validate(goal(minimize=["mass_g"]))] == ["minimize.0"]
    with pytest.raises(SpecError):
        dpg.predict(goal())


def test_goals_are_explained(goal: Callable[..., Goal]) -> None:
    """How each column is followed, what is tried, and nothing solved."""
    opening = {"pattern": "11*", "quantity": "opening_1_mm", "value": 3.4, "tolerance_mm": 0.1}
    given = goal(constraints=["n_stable >= 4"])
    given["targets"].append(opening)
    plan = dpg.explain(given)
    assert plan.slopes == {
        "tip_x_mm": "exact", "tip_y_mm": "exact", "opening_1_mm": "differences", "n_stable": "none"
    }  # fmt: skip
    assert (plan.n_choices, plan.n_starts, plan.most_states) == (1, 32, 4)
    assert plan.are_all_tried
    many = dpg.explain(goal(vary={STROKE: [2.5 + k / 1000 for k in range(1001)]}))
    assert not many.are_all_tried and many.n_starts == 1
    with pytest.raises(UsageError, match="are for specs: sweeps and goals have"):
        dpg.explain(given, patterns="11*")


def test_which_searches_a_limit_ended_is_said(goal: Callable[..., Goal]) -> None:
    found = dpg.inverse_design(goal(), evaluations=1)
    assert not found.table["finished"].any()
    assert "finished" not in dpg.inverse_design(goal()).table.names
