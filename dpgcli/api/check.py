"""`check`: test a table of designs against requirements."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeAlias

from dpgcli.api.arguments import as_texts, check_flags, path_of
from dpgcli.api.tables import Table
from dpgcli.errors import Field, UsageError
from dpgcli.files.frames import frame_of
from dpgcli.files.table_reader import DesignTable, designs_in, read_designs
from dpgcli.sweeps.gate import RequirementVerdict, check_designs

DesignsInput: TypeAlias = str | Path | Table | Any
"""The designs.parquet of a sweep, or its content: of pandas, of Arrow, or a Table."""


def check(
    designs: DesignsInput, require: str | Sequence[str], *, strict: bool = False
) -> tuple[RequirementVerdict, ...]:
    """Test every design of a table against requirements, one verdict each.

    A verdict's `warnings` say which columns rest on what no design should be judged by, as far as
    the table says what they rest on. Raises UsageError for what is no table of designs or no
    requirement, and where it is `strict` instead of such a warning; NothingSelectedError where
    every design is excluded.

    >>> designs = {"design": [0, 1], "height_mm": [5.5, 6.5], "calibration": ["given"] * 2,
    ...            "status": ["stable"] * 2, "reason": [""] * 2, "n_stable": [8, 8]}
    >>> verdict, = check(designs, "height_mm > 6")
    >>> verdict.is_met, [failure.design for failure in verdict.failures()]
    (False, [0])
    """
    check_flags(strict=strict)
    requirements = as_texts("require", require)
    if not requirements:
        raise UsageError(Field("require"), ": expected one requirement or more")
    table = designs_of(designs)
    return check_designs(table.columns, requirements, table.trusts, strict=strict)


def designs_of(designs: DesignsInput) -> DesignTable:
    """A table of designs, with what it says of its columns."""
    if isinstance(designs, str | os.PathLike):
        return read_designs(path_of("designs", designs))
    return designs_in(arrow_of(designs), "the table")


def arrow_of(designs: Any) -> Any:
    """A table of designs as one of Arrow. Raises UsageError for what is no table."""
    import pyarrow as pa

    rows: Any = designs.arrow if isinstance(designs, Table) else designs
    if not isinstance(rows, pa.Table) or rows.schema.pandas_metadata:  # there may be an index
        try:
            rows = pa.Table.from_pandas(frame_of(rows), preserve_index=False)
        except (ValueError, TypeError, pa.ArrowException) as error:
            raise UsageError(f"expected a table of designs: {error}") from error
    return rows
