"""A prediction in files: the table of its states, and what differs between runs beside it."""

import json
import platform
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from dpgcli.arrays import Columns
from dpgcli.errors import UsageError
from dpgcli.files.access import reading
from dpgcli.files.output import run_file
from dpgcli.files.record_batches import record_batch, schema
from dpgcli.files.scene_metadata import scene_metadata
from dpgcli.files.table_writer import SCHEMA_VERSION, versions, write_run, write_table
from dpgcli.files.trust import trust_metadata, with_bases
from dpgcli.states.plan import Plan
from dpgcli.states.predict import Prediction


def write_prediction(
    prediction: Prediction,
    table: Path,
    spec_json: str,
    rows: Iterable[Columns],
    command: Sequence[str] = (),
) -> None:
    """Write rows, as they come, and then what the run came to, with the `command` behind it."""
    write_states(prediction, table, spec_json, rows)
    summary = prediction.summary
    write_run(
        run_file(table),
        {
            "table": table.name,
            "states": {status.text: n for status, n in summary.statuses.items()},
            "finger_solves": summary.n_finger_solves,
            "worst_residual_N": summary.residual,
            "worst_numerical_error_mm": summary.tip_error,
            "model_error": prediction.plan.scene.model_error.text,
            **_uncertainty(prediction),
            "seconds": summary.seconds,
            "cpu_seconds": summary.cpu_seconds,
            "machine": platform.machine(),
            "host": platform.node(),
            "python": platform.python_version(),
            "command": list(command),
        },
    )


def _uncertainty(prediction: Prediction) -> dict[str, Any]:
    """What uncertainties cover, and what the largest one is made of, if they are asked for."""
    worst, known = prediction.summary.breakdown, prediction.plan.scene.uncertainty
    if worst is None or known is None:
        return {}
    said = {"covers": known.covers, "largest_tip_mm": worst.total, "pattern": worst.pattern}
    return {"uncertainty": {**said, "tip_by_cause_mm": dict(worst.shares)}}


def check_facts(table: Path) -> None:
    """Raise UsageError where those of another table would go: t and t.parquet share one name."""
    beside = run_file(table)
    try:
        other = json.loads(beside.read_bytes())["table"]
    except (OSError, ValueError, KeyError, TypeError, RecursionError):  # nobody's
        return
    with reading(beside):
        is_there = (table.parent / str(other)).is_file()
    if other != table.name and is_there:
        raise UsageError(f"{beside} has the facts of {other}: give another name")


def write_states(
    prediction: Prediction, path: Path, spec_json: str, blocks: Iterable[Columns] | None = None
) -> None:
    """Write all states of a prediction, as they come; see `write_table`."""
    columns = prediction.plan.columns
    rows = prediction.blocks() if blocks is None else blocks
    batches = (record_batch(columns, block) for block in rows)
    metadata = _metadata(prediction.plan, spec_json)
    write_table(path, with_bases(schema(columns), metadata), batches, metadata)


def _metadata(plan: Plan, spec_json: str) -> dict[str, str]:
    request = plan.request
    return {
        "dpg.schema_version": str(SCHEMA_VERSION),
        **scene_metadata(plan.scene, spec_json),
        "dpg.patterns": json.dumps(request.patterns),
        "dpg.formulation": request.formulation,
        "dpg.method": plan.method,
        "dpg.tolerance": repr(request.tolerance),
        **trust_metadata(plan.trusts, plan.warnings),
        **({"dpg.uncertainty": plan.covers} if plan.covers else {}),
        "dpg.versions": versions(),
    }
