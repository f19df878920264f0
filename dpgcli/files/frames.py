"""Tables that are handed in as values: data frames, Arrow tables, columns by name."""

from collections.abc import Iterator
from decimal import Decimal
from itertools import islice
from typing import TYPE_CHECKING, Any

from dpgcli.errors import UsageError
from dpgcli.text import quoted

if TYPE_CHECKING:
    import pandas as pd

UNLISTED = (range, Iterator)
MOST_ITEMS = 10**6
MOST_BITS = 1024  # of a whole number: more than double precision reaches


def frame_of(source: Any) -> "pd.DataFrame":
    """A table as a data frame, its index, where that has a name, a column as it was before.

    Takes what `pandas.DataFrame` takes or has `to_pandas`. Raises UsageError for anything else.

    >>> import pandas as pd
    >>> heights = pd.DataFrame({"height_mm": [5.5, 6.5], "stroke_mm": [3.0, 3.5]})
    >>> list(frame_of(heights.set_index("height_mm")))
    ['height_mm', 'stroke_mm']
    """
    import pandas as pd

    convert: Any = getattr(source, "to_pandas", None)  # as of an Arrow table
    try:
        table = _listed(source) if convert is None else convert()
        frame = pd.DataFrame(table)  # an array's is a series
        frame = with_index(frame)
    except (ValueError, TypeError, AttributeError, RecursionError) as error:
        raise UsageError(f"expected a table, columns of one length: {error}") from error
    except MemoryError as error:
        raise UsageError("expected a table that there is memory for") from error
    for name, column in frame.items():
        if _is_no_cell(name):
            raise UsageError(f"expected a table, found a column {quoted(name)}")
        if column.dtype == object and (wrong := [*islice(filter(_is_no_cell, column), 1)]):
            found = f"{quoted(name)}: {quoted(wrong[0])}"
            raise UsageError(f"expected a table of numbers and texts, found in column {found}")
    return frame


def _listed(source: Any) -> Any:
    """A source whose ranges and iterators, which need not be in memory, are lists.

    Raises UsageError for one of more than MOST_ITEMS, which may go on without end.
    """
    if isinstance(source, UNLISTED):
        found = [*islice(iter(source), MOST_ITEMS + 1)]
        if len(found) > MOST_ITEMS:
            raise UsageError(f"expected at most {MOST_ITEMS:,} items of a range or an iterator")
        return _listed(found)
    if isinstance(source, dict):
        return {name: _listed(column) for name, column in source.items()}
    if isinstance(source, list | tuple) and any(isinstance(item, UNLISTED) for item in source):
        return [*map(_listed, source)]
    return source


def _is_no_cell(value: Any) -> bool:
    """Whether no table holds a value: lists within lists, which may go on without end.

    Neither does it hold numbers of more digits than Python writes, nor any that signal.
    """
    import numpy as np

    if isinstance(value, np.ndarray) and not value.ndim:  # as what masked arrays mask
        return False
    if isinstance(value, many := list | tuple | dict | set | np.ndarray):
        parts = value.values() if isinstance(value, dict) else value
        return any(isinstance(part, many) for part in parts)
    if isinstance(value, Decimal):
        return value.is_snan()
    return isinstance(value, int) and value.bit_length() > MOST_BITS


def with_index(frame: "pd.DataFrame") -> "pd.DataFrame":
    """A data frame whose index has no name any more: what had one is a column.

    Raises ValueError where there is such a column already.
    """
    named = [level for level, name in enumerate(frame.index.names) if name is not None]
    return frame.reset_index(level=named) if named else frame
