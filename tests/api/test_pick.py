"""`dpg.pick`: tables as paths and values, merged ones too, and designs as specs."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import dpgcli as dpg
from dpgcli.errors import NothingSelectedError, UsageError

STROKE = "finger.lattice.stroke_mm"
SPACE: list[dict[str, Any]] = [
    {"key": STROKE, "values": [2.0, 2.5, 3.0, 3.5]},
    {"key": "finger.units", "values": [2, 3]},
]
SERIAL: dict[str, Any] = {"executor": "serial"}
SWEEP = {"base": "study.yaml", "space": SPACE}


@pytest.fixture
def swept(folder: Path) -> Any:
    return dpg.sweep(SWEEP, "out", **SERIAL)


def test_a_folder_a_file_a_table_and_a_frame_are_alike(swept: Any) -> None:
    frame = swept.designs.to_pandas()
    arrow = swept.designs.to_arrow()
    for designs in ("out", Path("out/designs.parquet"), swept.designs, arrow, frame):
        found = dpg.pick(designs, "n_units == 3", maximize="reach_max_mm", minimize="reach_min_mm")
        assert found.table["design"].tolist() == [7]
        assert found.lines[0] == "8 designs: 8 with stable states"


def test_the_rows_are_those_of_the_table(swept: Any) -> None:
    frame = swept.designs.to_pandas()
    found = dpg.pick("out", minimize="min_barrier_mJ", columns="all").to_pandas()
    expected = frame.sort_values("min_barrier_mJ", kind="stable").reset_index(drop=True)
    pd.testing.assert_frame_equal(found, expected)


def test_states_of_a_table_and_their_spec(swept: Any) -> None:
    found = dpg.pick(swept.states, "units == 3", states=True, maximize="energy_mJ", top=1)
    assert found.table["pattern"].tolist() == ["111"]
    found.save_spec("best.yaml")
    states = dpg.predict("best.yaml", patterns="111").to_pandas()
    assert states.energy_mJ.tolist() == found.table["energy_mJ"].tolist()


def test_merged_shards_are_chosen_from_as_the_whole(swept: Any) -> None:
    shards = [f"shard{number}" for number in (1, 2)]
    for number, shard in enumerate(shards, 1):
        dpg.sweep(SWEEP, shard, shard=f"{number}/2", **SERIAL)
    dpg.merge(shards, "merged")
    for folder in ("out", "merged"):
        dpg.pick(folder, minimize="reach_min_mm", top=1).save_spec(f"{folder}.yaml")
    assert Path("merged.yaml").read_bytes() == Path("out.yaml").read_bytes()


def test_axes_that_are_tables(folder: Path) -> None:
    """Their keys are not in the sweep's words, but in those of its columns."""
    pd.DataFrame({STROKE: [2.0, 3.5], "finger.units": [2, 3]}).to_csv("axis.csv", index=False)
    dpg.sweep({"base": "study.yaml", "space": [{"table": "axis.csv"}]}, "out", **SERIAL)
    states = dpg.predict("out", design=1).to_pandas()
    expected = dpg.predict("study.yaml", settings={STROKE: 3.5, "finger.units": 3}).to_pandas()
    pd.testing.assert_frame_equal(states, expected)


def test_predicting_a_design_is_predicting_its_spec(swept: Any) -> None:
    states = swept.states.to_pandas()
    for design in (0, 5):
        found = dpg.predict("out", design=design, patterns="1*").to_pandas()
        own = states[(states.design == design) & states.pattern.str.startswith("1")]
        np.testing.assert_allclose(found.tip_y_mm, own.tip_y_mm, rtol=1e-12, atol=1e-12)
    with pytest.raises(dpg.UsageError, match=r"design 8: out/designs\.parquet has 0 to 7"):
        dpg.predict("out", design=8)


def test_values_without_their_keys_have_no_spec(swept: Any) -> None:
    """A data frame keeps no base; a table that lost a column would be another design."""
    found = dpg.pick(swept.designs.to_pandas(), top=1)
    with pytest.raises(dpg.UsageError, match="no base spec is kept"):
        found.save_spec("best.yaml")
    arrow = swept.designs.to_arrow().drop_columns(["units"])
    found = dpg.pick(arrow, top=1)
    with pytest.raises(dpg.UsageError, match=r"design 0: no column of finger\.units"):
        found.save_spec("best.yaml")
    assert not Path("best.yaml").exists()


def test_nothing_left_says_why(swept: Any) -> None:
    with pytest.raises(dpg.NothingSelectedError, match=r"stroke_mm > 9: met by 0 of 8 designs"):
        dpg.pick("out", ["stroke_mm > 9", "n_units == 3"])
    excluded = swept.designs.to_pandas().assign(status="excluded")
    with pytest.raises(dpg.NothingSelectedError, match="0 with stable states, 8 excluded"):
        dpg.pick(excluded)


def test_a_design_that_is_not_chosen_says_why(folder: Path) -> None:
    """One that is not there with the numbers that are, an invalid one with its problem."""
    space = [{"key": STROKE, "values": [2.0, 3.0]}, {"key": "finger.units", "values": [0, 2]}]
    sweep = {"base": "study.yaml", "space": space, "constraints": ["stroke_mm > 2.5"]}
    dpg.sweep(sweep, "out", **SERIAL)
    for states, numbers in ((False, "0 to 3"), (True, "3 to 3")):
        with pytest.raises(UsageError, match=f"^design 999: .* has {numbers}$"):
            dpg.pick("out", design=999, states=states)
    with pytest.raises(NothingSelectedError, match="design 0 is excluded: it does not meet the sw"):
        dpg.pick("out", design=0)
    with pytest.raises(NothingSelectedError, match=r"design 2 is invalid: finger\.units: expected"):
        dpg.pick("out", design=2)
    with pytest.raises(NothingSelectedError, match=r"^nothing selected\n4 designs"):
        dpg.pick("out", "n_stable > 99", design=3)


def test_saved_rows_are_not_put_over_what_they_come_from(swept: Any) -> None:
    found = dpg.pick("out", top=2)
    for name in ("out/designs.parquet", "out/states.parquet"):
        with pytest.raises(dpg.UsageError, match="is the spec or data that is read"):
            found.save(name)
    found.save("two.parquet")
    written = pd.read_parquet("two.parquet").drop(columns="n_unknown_states")
    assert written.equals(found.to_pandas())


def test_integers_with_gaps_are_numbers(swept: Any) -> None:
    """As pandas has them: a missing one is NaN, and not chosen by."""
    frame = swept.designs.to_pandas().assign(rank=pd.array([3, None, 1, 2] * 2, dtype="Int64"))
    found = dpg.pick(frame, minimize="rank", top=3)
    assert found.table["design"].tolist() == [2, 6, 3]
    assert found.lines[-1] == "rank: 2 designs left out without a value"


def test_rows_come_in_order_from_all_groups_of_a_file(swept: Any) -> None:
    frame = swept.designs.to_pandas()
    frame.to_parquet("groups.parquet", row_group_size=3)
    found = dpg.pick("groups.parquet", maximize="design", columns="all").to_pandas()
    pd.testing.assert_frame_equal(found, frame[::-1].reset_index(drop=True))
    some = dpg.pick("groups.parquet", "n_units == 3", minimize="reach_min_mm", columns="all")
    expected = frame[frame.n_units == 3].sort_values("reach_min_mm", kind="stable")
    pd.testing.assert_frame_equal(some.to_pandas(), expected.reset_index(drop=True))


def with_column(table: Any, name: str, values: Any) -> Any:
    """An Arrow table, without what it says of itself, with other values in a column."""
    arrow = table.to_arrow().replace_schema_metadata(None)
    return arrow.set_column(arrow.schema.get_field_index(name), name, values)


NOT_WHOLE = {
    "strings": pa.array(["3"] * 8),
    "large strings": pa.array(["\x1b[2J\r\n"] * 8, pa.large_string()),
    "strings with gaps": pa.array(["1", None] * 4),
    "dictionary": pa.array(["3"] * 8).dictionary_encode(),
    "fractions": pa.array([0.5] * 8),
    "gaps": pa.array([1, None] * 4),
}
NOT_TEXT = {"numbers": pa.array([1.0] * 8), "flags": pa.array([True] * 8)}
WRONG = [
    *((name, kind) for name in ("design", "n_stable") for kind in NOT_WHOLE),
    *(("status", kind) for kind in NOT_TEXT),
]


@pytest.mark.parametrize(("name", "kind"), WRONG)
def test_a_column_of_another_type_is_named_as_by_check(swept: Any, name: str, kind: str) -> None:
    """Whoever reads the table, wherever it is."""
    table = with_column(swept.designs, name, {**NOT_WHOLE, **NOT_TEXT}[kind])
    said = f"column {name}: expected {'text' if name == 'status' else 'whole numbers'}, found "
    pq.write_table(table, "out/designs.parquet")
    readers = [
        lambda: dpg.check(table, "reach_max_mm > 0"),
        lambda: dpg.pick(table, columns="all"),
        lambda: dpg.pick("out", columns="all", maximize="reach_max_mm"),
    ]
    if name == "design":
        readers.append(lambda: dpg.predict("out", design=3))
    for read in readers:
        with pytest.raises(dpg.UsageError, match=said) as refused:
            read()
        assert str(refused.value).isprintable()


def test_swept_values_that_are_text_are_named(swept: Any) -> None:
    arrow = swept.designs.to_arrow()
    place = arrow.schema.get_field_index("units")
    field = arrow.schema.field(place).with_type(pa.string())
    table = arrow.set_column(place, field, pa.array(["two"] * 8))
    with pytest.raises(dpg.UsageError, match="column units: expected numbers, found string"):
        dpg.pick(table)


@pytest.mark.parametrize("name", ["design", "calibration", "status", "n_stable"])
def test_needed_columns_are_no_values_whatever_describes_them(swept: Any, name: str) -> None:
    arrow = swept.designs.to_arrow().replace_schema_metadata(None)
    place = arrow.schema.get_field_index(name)
    said = {"description": f"value of {STROKE}"}
    table = arrow.cast(arrow.schema.set(place, arrow.schema.field(place).with_metadata(said)))
    pq.write_table(table, "said.parquet")
    for source in (table, "said.parquet"):
        found, usual = (dpg.pick(t, minimize="reach_min_mm") for t in (source, arrow))
        pd.testing.assert_frame_equal(found.to_pandas(), usual.to_pandas())
        assert found.lines == usual.lines


@pytest.mark.parametrize(
    ("name", "values", "kind"),
    [
        ("design", pa.array(["3"] * 48), "whole numbers"),
        ("status", pa.array([1.0] * 48), "text"),
        ("pattern", pa.array([11] * 48), "text"),
    ],
)
def test_a_column_of_states_of_another_type_is_named(
    swept: Any, name: str, values: Any, kind: str
) -> None:
    table = with_column(swept.states, name, values)
    with pytest.raises(dpg.UsageError, match=f"column {name}: expected {kind}, found "):
        dpg.pick(table, states=True, columns="all")


def test_states_that_are_none_of_ours_are_counted_in_one_line(swept: Any) -> None:
    status = pa.array(["stable", "\x1b[2J\r\n", None, ""] * 12)
    found = dpg.pick(with_column(swept.states, "status", status), states=True, top=1)
    assert found.lines[0] == r"48 states: 12 stable, 24 without a status, 12 \x1b[2J\r\n"


def test_a_file_keeps_what_says_where_searches_failed(swept: Any) -> None:
    """Of columns that were chosen without it."""
    found = dpg.pick(swept.designs, columns=["design", "calibration", "status", "n_stable"])
    found.save("p.parquet")
    assert "n_unknown_states" not in found.to_pandas()
    saved = pq.read_table("p.parquet")["n_unknown_states"]
    assert saved.to_pylist() == swept.designs["n_unknown_states"].tolist()


def test_a_count_of_text_is_refused(swept: Any) -> None:
    table = with_column(swept.designs, "n_unknown_states", pa.array(["7"] * 8))
    with pytest.raises(dpg.UsageError, match="n_unknown_states: expected numbers, found string"):
        dpg.pick(table, "reach_max_mm < 1e4")
    with pytest.raises(dpg.UsageError, match="n_unknown_states: expected numbers, found string"):
        dpg.check(table, "reach_max_mm < 1e4")
