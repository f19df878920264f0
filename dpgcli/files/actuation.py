"""The path of a finger through pressures in a file, with its events and what it rests on."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from dpgcli.arrays import Columns
from dpgcli.design.scene import Scene
from dpgcli.files.record_batches import record_batch, schema
from dpgcli.files.scene_metadata import chosen_metadata, scene_metadata
from dpgcli.files.table_writer import SCHEMA_VERSION, versions, write_table
from dpgcli.files.trust import trust_metadata, with_bases
from dpgcli.states.columns import Column
from dpgcli.states.rows import as_text

ColumnsAndRows = tuple[tuple[Column, ...], Columns]


def write_path(
    path: Path,
    scene: Scene,
    spec_json: str,
    points: ColumnsAndRows,
    events: ColumnsAndRows,
    chosen: Mapping[str, Any],
) -> None:
    """Write a row for each point to a Parquet file; the events are in its metadata, as JSON.

    And what was `chosen` beside the spec, in plain values by name.
    """
    columns, rows = points
    metadata = {
        "dpg.schema_version": str(SCHEMA_VERSION),
        **scene_metadata(scene, spec_json),
        **chosen_metadata(chosen),
        **trust_metadata(scene.trusts, scene.warnings),
        "dpg.events": json.dumps(_records(events)),
        "dpg.versions": versions(),
    }
    described = with_bases(schema(columns), metadata)
    write_table(path, described, [record_batch(columns, rows)], metadata)


def _records(table: ColumnsAndRows) -> Sequence[dict[str, object]]:
    """Rows as objects by name."""
    columns, rows = table
    texts = [np.asarray(as_text(column, rows[column.name])).tolist() for column in columns]
    names = [column.name for column in columns]
    return [dict(zip(names, row, strict=True)) for row in zip(*texts, strict=True)]
