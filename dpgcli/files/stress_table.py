"""Outcomes of hard cases as Parquet."""

from collections.abc import Sequence
from pathlib import Path

from dpgcli.files.table_writer import SCHEMA_VERSION, record_batch, schema, versions, write_table
from dpgcli.hard_cases.table import STRESS_COLUMNS, rows
from dpgcli.hard_cases.verdicts import Outcome


def write_stress(path: Path, outcomes: Sequence[Outcome], spec_json: str | None) -> None:
    """Write every case, with the spec whose finger was pushed, if there is one."""
    metadata = {"dpg.schema_version": str(SCHEMA_VERSION), "dpg.versions": versions()}
    if spec_json is not None:
        metadata["dpg.spec"] = spec_json
    batch = record_batch(STRESS_COLUMNS, rows(outcomes))
    write_table(path, schema(STRESS_COLUMNS), [batch], metadata)
