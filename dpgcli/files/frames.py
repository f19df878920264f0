"""Tables that are handed in as values: data frames, Arrow tables, columns by name."""

from typing import TYPE_CHECKING, Any

from dpgcli.errors import UsageError

if TYPE_CHECKING:
    import pandas as pd


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
        frame = pd.DataFrame(source if convert is None else convert())  # an array's is a series
        return with_index(frame)
    except (ValueError, TypeError, AttributeError) as error:
        raise UsageError(f"expected a table, columns of one length: {error}") from error


def with_index(frame: "pd.DataFrame") -> "pd.DataFrame":
    """A data frame whose index has no name any more: what had one is a column.

    Raises ValueError where there is such a column already.
    """
    named = [level for level, name in enumerate(frame.index.names) if name is not None]
    return frame.reset_index(level=named) if named else frame
