"""Tables that are handed in as values: a named index is a column, and every row counts."""

from collections.abc import Callable
from itertools import count
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow as pa
import pytest

import dpgcli as dpg
from dpgcli.files.frames import frame_of
from dpgcli.mechanics.finger import STUDY, uniform_finger

FINGER = uniform_finger(3, **STUDY)
TRAVEL = [0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0]
DOME = pd.DataFrame({"travel_mm": TRAVEL, "energy_mJ": [x**2 * (1 - x / 2) ** 2 for x in TRAVEL]})
GRID = pd.DataFrame({"dome_height_mm": [1.0, 2.0, 4.0], "stroke_mm": [0.5, 2.0, 8.0]})
TIPS = pd.DataFrame(
    {
        "pattern": ["100", "010", "001"],
        "tip_x_mm": [50.5, 50.9, 51.4],
        "tip_y_mm": [-10.3, -7.2, -3.4],
        "tip_angle_rad": [-0.264, -0.275, -0.266],
    }
)
DESIGNS = pd.DataFrame(
    {
        "design": [0, 1],
        "height_mm": [5.5, 6.5],
        "calibration": ["given"] * 2,
        "status": ["stable"] * 2,
        "reason": [""] * 2,
        "n_stable": [8, 8],
    }
)
FORMS = [pd.DataFrame, pa.Table.from_pandas]
Form = Callable[[pd.DataFrame], Any]


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("index", ["tip_angle_rad", ["pattern", "tip_angle_rad"]])
def test_an_index_of_known_states(form: Form, index: Any) -> None:
    known = dpg.compare(FINGER, form(TIPS.set_index(index))).known
    assert known.angles[-1].tolist() == TIPS["tip_angle_rad"].tolist()
    assert known.patterns.sum() == 3


@pytest.mark.parametrize("form", FORMS)
def test_an_index_of_a_grid(form: Form) -> None:
    found = dpg.fit_grid(form(GRID.set_index("dome_height_mm")))
    assert found.table["exponent_dome_height_mm"].round(9).tolist() == [2.0]


@pytest.mark.parametrize("form", FORMS)
def test_an_index_of_a_curve(form: Form) -> None:
    curve = form(DOME.set_index("travel_mm"))
    fit = dpg.fit_bistable(curve, travel_to_opening="equal", fix={"force_linearity": 0.0})
    assert round(fit.values["stroke_mm"], 6) == 2.0


@pytest.mark.parametrize("form", FORMS)
def test_an_index_of_a_hinge(form: Form) -> None:
    hinge = pd.DataFrame({"moment_N_mm": [12.1, 24.2, 36.3], "rotation_rad": [0.5, 1.0, 1.5]})
    found = dpg.fit_hinge(form(hinge.set_index("rotation_rad")))
    assert round(found.values["hinge_stiffness_N_mm_per_rad"], 6) == 24.2


@pytest.mark.parametrize("form", FORMS)
def test_an_index_of_shapes(form: Form) -> None:
    points = pd.DataFrame({"pattern": ["100"] * 2, "x_mm": [0.0, 50.0], "y_mm": [0.0, -9.0]})
    found = dpg.compare(FINGER, TIPS, shapes=form(points.set_index("pattern")))
    assert [shape.shape[1] for shape in found.known.shapes] == [2, 0, 0]


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("index", ["height_mm", "design", ["design", "height_mm"]])
def test_an_index_of_designs(form: Form, index: Any) -> None:
    (verdict,) = dpg.check(form(DESIGNS.set_index(index)), "height_mm > 6 and n_stable == 8")
    assert [failure.design for failure in verdict.failures()] == [0]


def test_an_index_that_arrow_only_describes() -> None:
    """The numbers of a range are no column of an Arrow table, its name is in the metadata."""
    designs = DESIGNS.drop(columns="design")
    designs.index = pd.RangeIndex(2, name="design")
    table = pa.Table.from_pandas(designs)
    assert "design" not in table.column_names
    (verdict,) = dpg.check(table, "height_mm > 6")
    assert [failure.design for failure in verdict.failures()] == [0]


@pytest.mark.parametrize("form", FORMS)
def test_an_index_of_an_axis(form: Form, study: dict[str, Any]) -> None:
    axis = pd.DataFrame({"finger.lattice.stroke_mm": [2.5, 3.5], "finger.units": [1, 2]})
    table = form(axis.set_index("finger.units"))
    found = dpg.sweep({"base": study, "space": [{"table": table}]}, executor="serial")
    assert found.designs["units"].tolist() == [1, 2]
    assert found.designs["stroke_mm"].tolist() == [2.5, 3.5]


def test_an_axis_with_a_column_twice(study: dict[str, Any]) -> None:
    axis = pd.DataFrame([[2, 2], [3, 3]], columns=["finger.units"] * 2)
    with pytest.raises(dpg.UsageError, match=r"table: expected each column once, found finger"):
        dpg.sweep({"base": study, "space": [{"table": axis}]}, executor="serial")


def test_an_index_named_as_a_column() -> None:
    frame = GRID.set_index("dome_height_mm", drop=False)
    with pytest.raises(dpg.UsageError, match="dome_height_mm, already exists"):
        dpg.fit_grid(frame)


def test_columns_of_two_lengths() -> None:
    with pytest.raises(dpg.UsageError, match=r"^expected a table, columns of one length"):
        dpg.fit_grid({"dome_height_mm": [1.0, 2.0], "stroke_mm": [0.5]})


@pytest.mark.parametrize("note", ["# a", "#", "#a", "  # a", "\ufeff", "PAR1"])
def test_rows_of_a_frame_are_no_comments(note: str) -> None:
    grid = pd.concat([pd.DataFrame({"note": [note, "b", note]}), GRID], axis=1)
    assert dpg.fit_grid(grid).calibration.sources[0].rows == 3
    tips = pd.concat([pd.DataFrame({"note": [note, "b", "# c"]}), TIPS], axis=1)
    assert dpg.compare(FINGER, tips).known.patterns.shape == (3, 3)


@pytest.mark.parametrize("name", ["#n", "# n", "PAR1", "PK\x03\x04", "\ufeffn"])
def test_a_first_column_of_any_name(name: str) -> None:
    frame = pd.concat([pd.DataFrame({name: [1.0, 2.0, 3.0]}), TIPS], axis=1)
    found = dpg.compare(FINGER, frame)
    assert found.table["pattern"].tolist() == TIPS["pattern"].tolist()


def test_names_that_are_numbers_are_no_row() -> None:
    curve = DOME.set_axis([0, 1], axis=1)
    columns = {"travel_mm": "1", "energy_mJ": "2"}
    held = {"force_linearity": 0.0}
    fit = dpg.fit_bistable(curve, travel_to_opening="equal", fix=held, column=columns)
    assert fit.found.fit.n_points == len(DOME)


def test_a_row_of_empty_cells_is_one() -> None:
    frame = pd.concat([GRID.astype(object), pd.DataFrame({"stroke_mm": [None]})])
    with pytest.raises(dpg.SpecError, match=r"^data frame:5: "):
        dpg.fit_grid(frame)


def test_a_file_of_the_name_that_frames_have(folder: Path) -> None:
    text = TIPS.to_csv(index=False, sep=";")
    (folder / "data frame").write_text(f"# of a machine\n{text}")
    assert len(dpg.compare(FINGER, "data frame").table) == 3


ENDLESS = [
    lambda: range(10**12),
    lambda: count(),
    lambda: {"travel_mm": range(10**12), "energy_mJ": [0.0]},
    lambda: {"travel_mm": count(), "energy_mJ": [0.0]},
    lambda: [range(10**12)],
]


@pytest.mark.parametrize("made", ENDLESS)
@pytest.mark.parametrize(
    "call",
    [
        lambda table: dpg.check(table, "n_stable > 1"),
        dpg.pick,
        lambda table: dpg.compare(FINGER, table),
        lambda table: dpg.fit_finger(FINGER, table),
        lambda table: dpg.fit_bistable(table, travel_to_opening="equal"),
        dpg.fit_hinge,
        dpg.fit_unit,
        dpg.fit_grid,
    ],
)
def test_what_need_not_be_in_memory_is_no_table_without_end(
    monkeypatch: pytest.MonkeyPatch, call: Callable[[Any], Any], made: Callable[[], Any]
) -> None:
    monkeypatch.setattr("dpgcli.files.frames.MOST_ITEMS", 1000)
    with pytest.raises(dpg.DpgError):
        call(made())


def test_ranges_are_columns_and_memory_may_lack(monkeypatch: pytest.MonkeyPatch) -> None:
    found = frame_of({"a": range(3), "b": iter([1.0, 2.0, 3.0])})
    assert found.to_dict("list") == {"a": [0, 1, 2], "b": [1.0, 2.0, 3.0]}
    monkeypatch.setattr("dpgcli.files.frames.MOST_ITEMS", 2)
    with pytest.raises(dpg.UsageError, match="at most 2 items"):
        frame_of({"a": range(3)})

    def lacking(*_: object) -> None:
        raise MemoryError

    monkeypatch.setattr(pd, "DataFrame", lacking)
    with pytest.raises(dpg.UsageError, match="there is memory for"):
        frame_of({"a": [1.0]})
