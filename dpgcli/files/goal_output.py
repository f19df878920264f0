"""What a search found, in a folder: tables of designs and of all steps, a spec for each design."""

import json
import re
from collections.abc import Sequence
from pathlib import Path
from tempfile import gettempdir

from dpgcli.arrays import Columns
from dpgcli.design.scene import Scene
from dpgcli.files.access import writing
from dpgcli.files.design_spec import write_spec
from dpgcli.files.goal_file import GoalFile
from dpgcli.files.output import Mark, check_outputs
from dpgcli.files.record_batches import record_batch, schema
from dpgcli.files.scene_file import Spec, canonical_json
from dpgcli.files.scene_metadata import scene_metadata
from dpgcli.files.table_writer import SCHEMA_VERSION, versions, write_table
from dpgcli.files.trust import trust_metadata, with_bases
from dpgcli.states.columns import Column

BEST, TRACE = "best.parquet", "trace.parquet"
SPEC_NAME = re.compile(r"design_[0-9]+\.yaml")
NamedTable = tuple[str, tuple[Column, ...], Columns]


def check_folder(folder: Path, given: GoalFile) -> None:
    """Raise OutputError or UsageError for a folder that tables cannot go into, before the work.

    Nor may there be specs of designs that no search wrote, or that were edited since: what it
    finds would take their names, or their place.
    Whoever calls has the folder to himself, here and below.
    """
    tables = ((folder / name, Mark.TABLE) for name in (BEST, TRACE))
    check_outputs(given.files, *tables, *((path, Mark.FOUND) for path in _specs(folder)))


def folder_beside(folder: Path) -> Path:
    """A new folder for what cannot go into this one, of its name and a number.

    It is among the temporary files where it cannot be beside it. Raises OSError where there can be
    neither.
    """
    named = folder if folder.name.strip(".") else folder.resolve()
    try:
        return _numbered(named)
    except OSError:  # such as a folder around it that is not ours
        return _numbered(Path(gettempdir()) / named.name)


def _numbered(named: Path) -> Path:
    """The first new folder of this name with a number behind it, from 2 on."""
    number = 2
    while True:
        try:
            beside = named.with_name(f"{named.name}_{number}")
            beside.mkdir()
        except FileExistsError:
            number += 1
        else:
            return beside


def _specs(folder: Path) -> list[Path]:
    with writing(folder):
        return sorted(path for path in folder.iterdir() if SPEC_NAME.fullmatch(path.name))


def write_designs(
    folder: Path,
    given: GoalFile,
    tables: Sequence[NamedTable],
    specs: Sequence[Spec],
    first: Scene,
) -> tuple[str, ...]:
    """Write tables by name, and the specs as design_1.yaml and so on; `first` is the best's scene.

    Specs of more designs that an earlier search left there are removed: their names.
    """
    check_folder(folder, given)
    own = {folder / f"design_{number}.yaml": spec for number, spec in enumerate(specs, start=1)}
    metadata = {
        "dpg.schema_version": str(SCHEMA_VERSION),
        "dpg.goal": json.dumps(given.said, sort_keys=True),
        **scene_metadata(first, canonical_json(specs[0])),
        **trust_metadata(first.trusts, first.warnings),
        "dpg.versions": versions(),
    }
    for name, columns, rows in tables:
        described = with_bases(schema(columns), metadata)
        write_table(folder / name, described, [record_batch(columns, rows)], metadata)
    for number, (path, spec) in enumerate(own.items(), start=1):
        write_spec(path, spec, f"design {number} of {BEST}", Mark.FOUND)
    return tuple(path.name for path in _specs(folder) if path not in own and _removed(path))


def _removed(path: Path) -> bool:
    """Remove a spec of an earlier search, which is as it was; whether it was one."""
    with writing(path):
        is_old = path.stat().st_size > 0
        if is_old:
            path.unlink()
    return is_old
