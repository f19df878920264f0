"""Tables of designs, CSV or Parquet: their columns as numbers, none lost and none changed."""

import csv
import io
import warnings
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from dpgcli.files.places import shown

LARGEST_WHOLE = 2**63 - 1
PARQUET = b"PAR1"
UNREADABLE = (  # what pandas and pyarrow raise for content that is no table
    OSError,
    csv.Error,
    ValueError,
    LookupError,
    TypeError,
    AttributeError,
    NotImplementedError,
    pa.ArrowException,
    pd.errors.ParserWarning,
)


def frame_in(content: bytes) -> pd.DataFrame:
    """The table in a file's content; raises one of UNREADABLE.

    An index with a name is a column like the others, as it was before it was made the index.
    """
    if not content.startswith(PARQUET):
        return _csv(content)
    frame: pd.DataFrame = pq.ParquetFile(pa.BufferReader(content)).read().to_pandas()
    is_named = any(name is not None for name in frame.index.names)
    return frame.reset_index() if is_named else frame


def _csv(content: bytes) -> pd.DataFrame:
    if b'"' in content:  # pandas reads "3"4 as 34
        for _ in csv.reader(io.StringIO(content.decode("utf-8")), strict=True):
            pass
    with warnings.catch_warnings():  # rows that do not fit the header
        warnings.simplefilter("error", pd.errors.ParserWarning)
        return pd.read_csv(io.BytesIO(content), index_col=False)


def numbers_in(column: "pd.Series[Any]") -> NDArray[Any] | str:
    """The numbers of a column, whole ones as such; or what stands in place of the first."""
    types = pd.api.types
    if isinstance(column.dtype, pd.CategoricalDtype):
        column = pd.Series(column.to_numpy())
    is_number = types.is_numeric_dtype(column) and not types.is_bool_dtype(column)
    if not is_number or types.is_complex_dtype(column):
        numbers = pd.to_numeric(column.astype(str), errors="coerce").to_numpy(np.float64)
    else:
        numbers = column.to_numpy(np.float64, na_value=np.nan)
    wrong = np.flatnonzero(~np.isfinite(numbers))
    if len(wrong) or not is_number:
        row = int(wrong[0]) if len(wrong) else 0
        return f"{shown(str(column.iloc[row]))} in row {row + 1}"
    if not types.is_integer_dtype(column):
        return numbers
    if column.max() > LARGEST_WHOLE:
        row = int(column.to_numpy().argmax())
        return f"{column.iloc[row]} in row {row + 1}"
    return column.to_numpy(np.int64)
