"""What a page shows of a sweep beside its tables, and what it says where that is not there."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

import dpgcli as dpg
from dpgcli.api import explorer as module
from dpgcli.api.explorer import WITHOUT_BODY, explored
from dpgcli.api.report import space_in
from dpgcli.reports.base import base_lines
from dpgcli.reports.explorer import shapes as reasons
from dpgcli.reports.explorer.content import content
from dpgcli.reports.explorer.drawings import best_designs

ROOT = Path(dpg.__file__).parent.parent
HEIGHT = "finger.geometry.dome_height_mm"
SPACE = [{"key": HEIGHT, "values": [2.5, 5.5, 6.5]}]  # the first one is not possible


def swept(folder: Path, *settings: str, base: str = "three_unit", **more: Any) -> Path:
    sweep = {"base": str(ROOT / "configs" / f"{base}.yaml"), "space": SPACE, **more}
    dpg.sweep(sweep, folder / "out", settings=settings, jobs=1)
    return folder / "out"


def data_of(folder: Path) -> dict[str, Any]:
    """The data behind the explorer, without the figures of the page, which take longer."""
    space = space_in(folder)
    data: dict[str, Any] = json.loads(content(space, explored(folder, space)))
    return data


def why(folder: Path) -> list[str | None]:
    """Of each design why no states are drawn; None where they are."""
    shapes = data_of(folder)["shapes"]
    return [None if place >= 0 else shapes["reasons"][-1 - place] for place in shapes["places"]]


def test_states_are_drawn_of_designs_that_have_any(tmp_path: Path) -> None:
    folder = swept(tmp_path)
    data = data_of(folder)
    shapes = data["shapes"]
    assert why(folder) == [reasons.NO_STATES, None, None]
    states = pq.read_table(folder / "states.parquet").to_pandas()
    own = states[states.design == 1].set_index("pattern")
    assert shapes["values"]["units"] == [3, 3]
    assert shapes["values"]["length"][0] * 3 == pytest.approx(own.tip_x_mm["000"])
    np.testing.assert_allclose(shapes["values"]["turn"][0], own.tip_angle_rad["001"], rtol=1e-6)
    off = re.search(
        r"at most (\S+) mm from those of states.parquet, energies (\S+) mJ", shapes["note"]
    )
    assert off
    assert 1e-8 < float(off[1]) < 0.01
    assert data["base"]["finger"]["geometry"]["dome_height_mm"] == 6.5
    assert data["columns"][1]["key"] == HEIGHT


def test_designs_of_several_numbers_of_units_are_drawn_together(tmp_path: Path) -> None:
    space = [*SPACE, {"key": "finger.units", "values": [1, 4]}]
    shapes = data_of(swept(tmp_path, space=space))["shapes"]
    assert sorted(shapes["values"]["units"]) == [1, 1, 4, 4]
    by_design = [shapes["values"]["units"][place] for place in shapes["places"] if place >= 0]
    assert by_design == [1, 4, 1, 4]


def test_states_under_loads_are_not_composed(tmp_path: Path) -> None:
    folder = swept(tmp_path, "loads.tip_force_N=[0.05, 0.1]")
    assert why(folder) == [reasons.NO_STATES, *[reasons.NOT_COMPOSED] * 2]
    assert (
        "<svg" in dpg.report(folder, format="html").partition("Explorer</h2>")[0]
    )  # the best ones


def test_without_states_the_page_says_so(tmp_path: Path) -> None:
    folder = swept(tmp_path)
    (folder / "states.parquet").unlink()
    assert set(why(folder)) == {reasons.NO_TABLE}


def test_states_of_another_sweep_are_not_taken(tmp_path: Path) -> None:
    folder = swept(tmp_path)
    (tmp_path / "other").mkdir()
    other = swept(tmp_path / "other", base="five_unit")
    (folder / "states.parquet").write_bytes((other / "states.parquet").read_bytes())
    assert set(why(folder)) == {reasons.NO_TABLE}


def test_damaged_states_are_refused(tmp_path: Path) -> None:
    folder = swept(tmp_path)
    content = bytearray((folder / "states.parquet").read_bytes())
    content[200] ^= 1
    (folder / "states.parquet").write_bytes(content)
    with pytest.raises(dpg.UsageError, match=r"states\.parquet is damaged"):
        data_of(folder)


def test_a_table_of_nobody_has_a_page(tmp_path: Path) -> None:
    folder = swept(tmp_path)
    path = folder / "designs.parquet"
    pq.write_table(pq.read_table(path).replace_schema_metadata(None), path)
    data = data_of(folder)
    assert (data["base"], data["selected"]) == (None, -1)
    assert set(why(folder)) == {reasons.NO_BASE}


def test_more_states_than_a_page_has_room_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = swept(tmp_path, space=[{"key": HEIGHT, "linear": {"from": 5, "to": 7, "count": 9}}])
    monkeypatch.setattr("dpgcli.api.explorer.MOST_STATES", 4 * 8)
    found = why(folder)
    assert found.count(reasons.NOT_HERE) + found.count(None) == 9
    best = data_of(folder)["selected"]
    assert found[best] is None
    assert 3 <= found.count(None) <= 6


def test_a_gripper_is_drawn_as_one_finger(tmp_path: Path) -> None:
    folder = swept(tmp_path, base="gripper")
    shapes = data_of(folder)["shapes"]
    assert "one finger, in its own frame" in shapes["note"]
    assert why(folder)[1:] == [None, None]


def test_the_body_is_drawn_and_states_are_without_it(tmp_path: Path) -> None:
    """A disc is drawn around its place, and the base spec that is shown has it, too."""
    folder = swept(tmp_path, "finger.units=2", base="gripper_and_can")
    space = space_in(folder)
    shown = explored(folder, space)
    best = shown.best[0]
    assert best.body is not None
    assert np.abs(best.body - 40.0) == pytest.approx(20.0)
    assert any(WITHOUT_BODY in note for note in shown.shapes.notes)
    drawn = best_designs(space, shown.best, shown.rows.tolist())
    assert drawn.count('<polygon class="body"') == len(shown.best)
    assert "Dashed: the body" in drawn
    assert any("object.at_mm 40/0" in line for line in base_lines(space.metadata))


def test_long_fingers_are_not_drawn_and_that_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "MOST_UNITS", 2)
    assert set(why(swept(tmp_path))[1:]) == {reasons.TOO_LONG}


def test_the_same_tables_give_the_same_page(tmp_path: Path) -> None:
    folder = swept(tmp_path)
    page = dpg.report(folder, format="html")
    assert page == dpg.report(folder, format="html")
    assert (
        page.index("<h2>The best designs") < page.index("<h2>Explorer") < page.index("<h2>Best and")
    )


def test_values_without_a_column_on_the_page_are_in_its_spec(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = swept(tmp_path, space=[{"key": HEIGHT, "values": [5.5]}])
    monkeypatch.setattr("dpgcli.reports.space.MOST_COLUMNS", 0)
    found = explored(folder, space_in(folder))
    assert found.base
    assert found.base["finger"]["geometry"]["dome_height_mm"] == 5.5
    assert not {*space_in(folder).swept} & {*space_in(folder).narrowed.designs}
    several = swept(tmp_path / "b")
    assert explored(several, space_in(several)).base is None
