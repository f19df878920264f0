"""Tables of designs or of states: columns when they are asked for, and rows by their places.

A table of states may be larger than memory: no more of it is read than a question needs.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from dpgcli.arrays import Columns, Indices, distinct
from dpgcli.design.dimensions import UNITS
from dpgcli.design.outputs import Trust
from dpgcli.errors import Field, UsageError
from dpgcli.files.design_spec import SWEEP, swept_base
from dpgcli.files.parts import BASE
from dpgcli.files.scene_file.settings import changed
from dpgcli.files.table_reader import (
    NEEDED,
    NUMBERS,
    TEXT,
    WHOLE,
    check_kinds,
    check_names,
    column_of,
    counts_in,
    is_number,
    is_text,
    trusts_of,
    undamaged_file,
    with_dictionaries,
)
from dpgcli.files.trust import outputs_of
from dpgcli.files.yaml_file import Document
from dpgcli.records import dataclass
from dpgcli.states.columns import Column, Kind
from dpgcli.sweeps.evaluation import VALUE_OF
from dpgcli.text import printable

STATES = Field("states")
OF_STATES = {"design": WHOLE, "pattern": TEXT, "status": TEXT}
KINDS = {"b": Kind.FLAG, "i": Kind.COUNT, "f": Kind.NUMBER}  # by the kind of NumPy's type


@dataclass(frozen=True)
class RowSource:
    """A table: in memory, or a Parquet file that is open."""

    name: str
    table: Any  # pyarrow.Table or pyarrow.parquet.ParquetFile
    has_states: bool
    stream: BinaryIO | None = None  # of the file

    @property
    def what(self) -> str:
        """What a row is."""
        return "state" if self.has_states else "design"

    @property
    def needed(self) -> dict[str, str]:
        """The columns that it has to have, and what they hold."""
        return OF_STATES if self.has_states else NEEDED

    @property
    def schema(self) -> Any:
        """Its pyarrow schema."""
        return self.table.schema if self.stream is None else self.table.schema_arrow

    @property
    def metadata(self) -> dict[str, str]:
        """What it says of itself."""
        return _texts_of(self.schema)

    @property
    def trusts(self) -> Mapping[str, Sequence[Trust]]:
        """What its columns rest on, as far as it says so."""
        return trusts_of(self.schema)

    @property
    def numbers(self) -> tuple[str, ...]:
        """Its columns of numbers."""
        return tuple(field.name for field in self.schema if is_number(field.type))

    @property
    def readable(self) -> tuple[str, ...]:
        """Its columns of numbers or of text."""
        return tuple(f.name for f in self.schema if is_number(f.type) or is_text(f.type))

    @property
    def swept(self) -> tuple[str, ...]:
        """Its columns of the swept values."""
        names = self.schema.names
        if "calibration" in names and (keys := self.keys):
            return tuple(keys)
        first, last = (names.index(n) if n in names else 0 for n in ("design", "calibration"))
        numbers = frozenset(self.numbers)
        return tuple(name for name in names[first + 1 : last] if name in numbers)

    @property
    def keys(self) -> dict[str, str]:
        """The keys of the spec whose values columns hold, by column; none of the needed ones."""
        own = (field for field in self.schema if field.name not in self.needed)
        said = {field.name: _texts_of(field).get("description", "") for field in own}
        begun = {name: text for name, text in said.items() if text.startswith(VALUE_OF)}
        return {name: text.removeprefix(VALUE_OF) for name, text in begun.items()}

    def columns(self, names: Sequence[str]) -> Columns:
        """Whole columns, as numbers or texts. Raises UsageError for what is not as it should."""
        if self.stream is None:
            return self._plain(self.table.select([*names]))
        return self._plain(with_dictionaries(self.stream, self.table, [*names]))

    def rows(self, places: Indices, names: Sequence[str]) -> Columns:
        """The rows at some places, in their order, texts as an array of their own."""
        starts = self._starts
        groups = np.searchsorted(starts, places, side="right") - 1
        met = distinct(groups).tolist() or [0]
        parts = [self._rows_of(g, places[groups == g] - starts[g], names) for g in met]
        order = np.argsort(groups, kind="stable")
        back = np.empty_like(order)
        back[order] = np.arange(len(order))
        return {name: np.concatenate([part[name] for part in parts])[back] for name in names}

    @property
    def _starts(self) -> Indices:
        """The places where groups of rows start."""
        if self.stream is None:
            return np.zeros(1, np.int64)
        metadata = self.table.metadata
        sizes = [metadata.row_group(group).num_rows for group in range(metadata.num_row_groups)]
        return np.cumsum([0, *sizes[:-1]])

    def _rows_of(self, group: int, places: Indices, names: Sequence[str]) -> Columns:
        """Rows of a group, texts as arrays of their own; NumPy takes, as Arrow loads pandas."""
        if self.stream is None:
            found = self.columns(names)
        else:
            found = self._plain(self.table.read_row_group(group, columns=[*names]))
        taken = {name: found[name][places] for name in names}
        return {n: c.astype(str) if c.dtype == object else c for n, c in taken.items()}

    def described(self, rows: Columns) -> tuple[Column, ...]:
        """The columns of some rows, with their units and descriptions."""
        return tuple(_described(self.schema.field(name), rows[name]) for name in rows)

    def design(self, place: int) -> "DesignRow":
        """The design of a row, with what its columns say of its values."""
        keys = self.keys
        found = self.rows(np.array([place]), ("design", *keys))
        row = {name: column[0].item() for name, column in found.items()}
        values = {key: _said(key, row[name]) for name, key in keys.items()}
        return DesignRow(self.name, row["design"], values, self.metadata)

    def _plain(self, table: Any) -> Columns:
        names = table.column_names
        return {name: self._plain_column(name, table.column(name)) for name in names}

    def _plain_column(self, name: str, column: Any) -> NDArray[Any]:
        """Numbers, truths or texts."""
        kind = self.needed.get(name, TEXT if is_text(column.type) else NUMBERS)
        found = column_of(self.name, name, column, kind)
        return found == 1 if pa.types.is_boolean(column.type) and kind == NUMBERS else found


@dataclass(frozen=True)
class DesignRow:
    """A design of the table of this name: its number, and its values by key of the spec."""

    name: str
    number: int
    values: Mapping[str, float]
    metadata: Mapping[str, str]

    @property
    def document(self) -> Document:
        """Its spec, calibrations read.

        Raises UsageError for a table that keeps no base spec, or has lost columns of values: it
        would be another design.
        """
        name = f"{self.name}, design {self.number}"
        base = swept_base(self.metadata, name)
        lost = [key for key in _varied(self.metadata) if key not in self.values]
        if lost or not self.values:
            raise UsageError(f"{name}: no column of {', '.join(lost) or 'values'} in the table")
        return changed(base, self.values)

    def __str__(self) -> str:
        values = ", ".join(f"{key} = {value!r}" for key, value in self.values.items())
        base = self.metadata.get(BASE, "a sweep")
        return printable(f"design {self.number} of the sweep around {base}: {values}")


@contextmanager
def opened_rows(source: Path | Any, *, has_states: bool) -> Iterator[RowSource]:
    """A table of designs or of states, in a Parquet file or a pyarrow Table.

    Raises UsageError for what is damaged or no such table.
    """
    if not isinstance(source, Path):
        yield _checked(RowSource("the table", source, has_states))
        return
    with undamaged_file(source) as (stream, file):
        yield _checked(RowSource(str(source), file, has_states, stream))


def _checked(source: RowSource) -> RowSource:
    name, schema = source.name, source.schema
    if not source.has_states and {*OF_STATES} <= {*schema.names}:
        raise UsageError(f"{name} is a table of states: choose among them with ", STATES)
    check_names(name, schema, f"{source.what}s", source.needed)
    check_kinds(name, schema, dict.fromkeys(source.swept, NUMBERS) | source.needed)
    check_kinds(name, schema, counts_in(schema))
    return source


def _texts_of(described: Any) -> dict[str, str]:
    """The metadata of a schema or a field."""
    said = (described.metadata or {}).items()
    return {k.decode(errors="replace"): v.decode(errors="replace") for k, v in said}


def _described(field: Any, values: NDArray[Any]) -> Column:
    said = _texts_of(field)
    unit, description = said.get("unit", ""), said.get("description", "")
    kind = KINDS.get(values.dtype.kind, Kind.TEXT)
    return Column(field.name, unit, description, kind=kind, outputs=outputs_of(field))


def _said(key: str, value: float) -> float:
    """A value as a spec has it: numbers of units are whole."""
    return int(value) if key == UNITS and float(value).is_integer() else value


def _varied(metadata: Mapping[str, str]) -> list[str]:
    """Keys that a sweep varied, as far as its metadata say them: not those of tables."""
    try:
        axes = json.loads(metadata[SWEEP])["space"]["space"]
        named = [axis.get("paired") or axis.get("sample", {}).get("ranges") for axis in axes]
        listed = [
            [*some] if some else [axis["key"]] * ("key" in axis)
            for some, axis in zip(named, axes, strict=True)
        ]
        return [key for keys in listed for key in keys]
    except (KeyError, TypeError, ValueError, AttributeError, RecursionError):
        return []
