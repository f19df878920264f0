"""Tables as values: named columns with their units, for pandas and for Arrow."""

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dpgcli.arrays import Columns
from dpgcli.records import dataclass
from dpgcli.states.columns import Column

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, repr=False)
class Table:
    """Rows of named columns; unit and meaning of each are in the Arrow field's metadata.

    >>> from dpgcli.states.columns import Group
    >>> tip = Column("tip_x_mm", "mm", "x of the tip")
    >>> table = Table.of((tip,), {"tip_x_mm": np.array([40.5, 38.0])})
    >>> table, table["tip_x_mm"].tolist(), table.units["tip_x_mm"]
    (Table(2 rows: tip_x_mm), [40.5, 38.0], 'mm')
    """

    arrow: Any  # pyarrow.Table

    @classmethod
    def of(cls, columns: tuple[Column, ...], *blocks: Columns) -> "Table":
        """Rows, given as one or more blocks of arrays by name."""
        import pyarrow as pa

        from dpgcli.files.record_batches import record_batch, schema

        batches = [record_batch(columns, block) for block in blocks]
        return cls(pa.Table.from_batches(batches, schema(columns)))

    def to_arrow(self) -> Any:
        """The rows as a `pyarrow.Table`."""
        return self.arrow

    def to_pandas(self) -> "pd.DataFrame":
        """The rows as a `pandas.DataFrame`."""
        frame: pd.DataFrame = self.arrow.to_pandas()
        return frame

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns, in their order."""
        return tuple(self.arrow.column_names)

    @property
    def units(self) -> dict[str, str]:
        """Units by column, empty where there is none."""
        return {f.name: (f.metadata or {}).get(b"unit", b"").decode() for f in self.arrow.schema}

    def __len__(self) -> int:
        return int(self.arrow.num_rows)

    def __getitem__(self, name: str) -> NDArray[Any]:
        return np.asarray(self.arrow[name].to_numpy())

    def __repr__(self) -> str:
        return f"Table({len(self)} rows: {', '.join(self.names)})"


class TableResult(ABC):
    """A result with a `table`, for Arrow and for pandas as well.

    >>> class Tips(TableResult):
    ...     @property
    ...     def table(self):
    ...         return Table.of((Column("tip_x_mm", "mm", "x"),), {"tip_x_mm": np.array([40.5])})
    >>> Tips().to_pandas()["tip_x_mm"].tolist()
    [40.5]
    """

    @property
    @abstractmethod
    def table(self) -> Table:
        """The rows, with a unit for each column."""

    def to_arrow(self) -> Any:
        """The rows of `table` as a `pyarrow.Table`."""
        return self.table.to_arrow()

    def to_pandas(self) -> "pd.DataFrame":
        """The rows of `table` as a `pandas.DataFrame`."""
        return self.table.to_pandas()
