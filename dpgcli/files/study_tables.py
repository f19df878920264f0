"""Tables of `bench` and `stress`, and records of benchmarks for later ones."""

import json
import os
import platform
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from dpgcli.benchmark.bench import COLUMNS, BenchRow, as_columns
from dpgcli.files.record_batches import record_batch, schema
from dpgcli.files.scene_file import spelled
from dpgcli.files.table_writer import SCHEMA_VERSION, versions, write_run, write_table
from dpgcli.hard_cases.outcomes import Outcome
from dpgcli.hard_cases.table import STRESS_COLUMNS
from dpgcli.hard_cases.table import rows as stress_rows


def write_bench(
    path: Path, rows: Sequence[BenchRow], spec_json: str, command: Sequence[str]
) -> None:
    """Write all rows to a Parquet file; the machine and the command are in its metadata."""
    metadata = {"dpg.bench": json.dumps(_machine(command)), "dpg.spec": spec_json}
    write_table(path, schema(COLUMNS), [record_batch(COLUMNS, as_columns(rows))], metadata)


def write_record(
    path: Path, rows: Sequence[BenchRow], spec_json: str, command: Sequence[str]
) -> None:
    """Write all rows, the machine and the command to a JSON file."""
    plain = [{key: json_value(value) for key, value in row.items()} for row in rows]
    write_run(path, {**_machine(command), "spec": spec_json, "rows": plain})


def write_stress(path: Path, outcomes: Sequence[Outcome], spec_json: str | None) -> None:
    """Write every case, with the spec whose finger was pushed, if there is one."""
    metadata = {"dpg.schema_version": str(SCHEMA_VERSION), "dpg.versions": versions()}
    if spec_json is not None:
        metadata["dpg.spec"] = spec_json
    batch = record_batch(STRESS_COLUMNS, stress_rows(outcomes))
    write_table(path, schema(STRESS_COLUMNS), [batch], metadata)


def json_value(value: Any) -> Any:
    """The rows as JSON: null for what was not measured, and .inf as in a spec."""
    if not isinstance(value, float):
        return value
    return None if value != value else spelled(value)


def _machine(command: Sequence[str]) -> dict[str, Any]:
    return {
        "machine": platform.machine(),
        "processor": _processor(),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "command": list(command),
    }


def _processor() -> str:
    """The processor's name, where the system tells it."""
    with suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor()
