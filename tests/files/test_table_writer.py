"""Parquet files: the same bytes, described columns, and what they were made from."""

import hashlib
import json
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from dpgcli.design.outputs import Output
from dpgcli.files.prediction import write_states
from dpgcli.files.record_batches import record_batch, schema
from dpgcli.files.scene_file import canonical_json, read_spec, scene_of
from dpgcli.files.table_writer import write_table
from dpgcli.states.columns import Column, Group
from dpgcli.states.plan import Request
from dpgcli.states.predict import predict

CONFIGS = Path(__file__).parents[2] / "configs"
RIGID = "finger.linear_stiffness_N_per_mm=.inf"


def written(
    path: Path, name: str = "three_unit", settings: tuple[str, ...] = (), **request: object
) -> pq.ParquetFile:
    spec = read_spec(CONFIGS / f"{name}.yaml", settings)
    prediction = predict(scene_of(spec), Request(**request))  # type: ignore[arg-type]
    write_states(prediction, path, canonical_json(spec))
    return pq.ParquetFile(path)


def metadata(table: pq.ParquetFile) -> dict[str, str]:
    return {key.decode(): value.decode() for key, value in table.metadata.metadata.items()}


@pytest.mark.parametrize("name", ["three_unit", "gripper", "graded_five_unit"])
def test_every_column_has_a_unit_and_a_description(tmp_path: Path, name: str) -> None:
    table = written(tmp_path / "states.parquet", name, columns=("all",))
    assert {"pattern", "tip_x_mm"} <= set(table.schema_arrow.names)
    for field in table.schema_arrow:
        assert set(field.metadata) - {b"outputs", b"basis"} == {b"unit", b"description"}
        assert (b"outputs" in field.metadata) is (b"basis" in field.metadata)
        assert field.metadata[b"description"]
        assert bool(field.metadata[b"unit"]) == (field.type == pa.float64())


def test_metadata_says_what_it_was_made_from(tmp_path: Path) -> None:
    table = written(tmp_path / "states.parquet", patterns=("1*",), tolerance=1e-11)
    facts = metadata(table)
    spec = json.loads(facts["dpg.spec"])
    assert spec["finger"]["units"] == 3
    assert facts["dpg.spec_sha256"] == hashlib.sha256(facts["dpg.spec"].encode()).hexdigest()
    assert set(json.loads(facts["dpg.versions"])) == {"dpg", "numpy", "scipy", "shapely", "pyarrow"}
    assert json.loads(facts["dpg.patterns"]) == ["1*"]
    assert float(facts["dpg.tolerance"]) == 1e-11
    assert facts["dpg.formulation"] == "chain"
    assert len(facts["dpg.content_sha256"]) == 64


@pytest.mark.parametrize("settings", [(), (RIGID,)])
def test_metadata_is_strict_json(tmp_path: Path, settings: tuple[str, ...]) -> None:
    def refused(constant: str) -> None:
        raise AssertionError(f"{constant} is not JSON")

    facts = metadata(written(tmp_path / "states.parquet", settings=settings))
    for key in ("dpg.spec", "dpg.sources", "dpg.versions", "dpg.patterns"):
        json.loads(facts[key], parse_constant=refused)


def test_the_same_input_gives_the_same_bytes(tmp_path: Path) -> None:
    for name in ("one", "two"):
        written(tmp_path / name)
    assert (tmp_path / "one").read_bytes() == (tmp_path / "two").read_bytes()


def test_the_content_hash_is_of_the_values(tmp_path: Path) -> None:
    def content(settings: tuple[str, ...]) -> str:
        return metadata(written(tmp_path / "states", settings=settings))["dpg.content_sha256"]

    assert content(()) == content(("finger.calibration=published",))
    assert content(()) != content(("finger.linear_stiffness_N_per_mm=1e5",))


def test_rows_can_be_skipped_by_what_is_given_and_not_by_what_is_computed(tmp_path: Path) -> None:
    path = tmp_path / "t.parquet"
    computed = Column("tip_x_mm", "mm", "x of the tip", outputs=(Output.SHAPES,))
    columns = (Column("design", "", "number"), computed)
    rows = {"design": np.array([3.0, 4.0]), "tip_x_mm": np.array([1.0, 2.0])}
    write_table(path, schema(columns), [record_batch(columns, rows)], {})
    group = pq.read_metadata(path).row_group(0)
    assert (group.column(0).statistics.min, group.column(0).statistics.max) == (3.0, 4.0)
    assert not group.column(1).is_stats_set


@pytest.mark.slow
def test_a_large_table_has_large_row_groups(tmp_path: Path) -> None:
    table = written(tmp_path / "states.parquet", "twenty_unit")
    sizes = [table.metadata.row_group(i).num_rows for i in range(table.num_row_groups)]
    assert sum(sizes) == 2**20
    assert set(sizes[:-1]) == {2**17}
    patterns = table.read(columns=["pattern"]).column(0)
    assert patterns[0].as_py() == "0" * 20
    assert patterns[2**20 - 1].as_py() == "1" * 20
    assert len(patterns.unique()) == 2**20


def test_a_wide_table_has_row_groups_of_fewer_rows(tmp_path: Path) -> None:
    """What is gathered before it is written has a bound in bytes, not in rows."""
    columns = tuple(Column(f"x{i}", "", "a number", Group.NODES) for i in range(320))
    rows = {column.name: np.zeros(40_000) for column in columns}
    batches = [record_batch(columns, rows)]
    write_table(tmp_path / "wide.parquet", schema(columns), batches, {})
    metadata = pq.read_metadata(tmp_path / "wide.parquet")
    sizes = [metadata.row_group(i).num_rows for i in range(metadata.num_row_groups)]
    assert sizes == [2**17 // 10] * 3 + [40_000 - 3 * (2**17 // 10)]


def test_a_column_of_truths_reads_back(tmp_path: Path) -> None:
    table = written(tmp_path / "states.parquet", "gripper").read()
    flags = table.column("fingers_overlap").to_pylist()
    apertures = table.column("aperture_mm").to_pylist()
    assert len(flags) == 32
    assert all(flag for flag, gap in zip(flags, apertures, strict=True) if gap < 0)
