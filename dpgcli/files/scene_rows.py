"""Rows about one scene, such as its landscape or its grasps, in Parquet files."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from dpgcli.arrays import Columns
from dpgcli.design.scene import Scene
from dpgcli.files.record_batches import record_batch, schema
from dpgcli.files.scene_metadata import chosen_metadata, scene_metadata
from dpgcli.files.table_writer import SCHEMA_VERSION, versions, write_table
from dpgcli.files.trust import trust_metadata, with_bases
from dpgcli.states.columns import Column


def write_scene_rows(
    path: Path,
    scene: Scene,
    spec_json: str,
    columns: tuple[Column, ...],
    rows: Columns,
    chosen: Mapping[str, Any],
) -> None:
    """Write rows with the scene, its spec and what its outputs rest on beside them.

    And with what was `chosen` beside the spec, in plain values by name.
    """
    metadata = {
        "dpg.schema_version": str(SCHEMA_VERSION),
        **scene_metadata(scene, spec_json),
        **chosen_metadata(chosen),
        **trust_metadata(scene.trusts, scene.warnings),
        "dpg.versions": versions(),
    }
    described = with_bases(schema(columns), metadata)
    write_table(path, described, [record_batch(columns, rows)], metadata)
