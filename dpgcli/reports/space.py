"""A table of designs, as reports read it: what is swept, which rows are usable, values as text."""

from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from functools import cached_property

import numpy as np

from dpgcli.arrays import Columns, Indices, distinct
from dpgcli.design.outputs import Trust
from dpgcli.files.table_reader import OTHERS
from dpgcli.records import dataclass
from dpgcli.sweeps.gate import swept_names
from dpgcli.text import enumerated

MOST_COLUMNS = 100  # of values that are swept, and that we have no name for: a page is to be read


@dataclass(frozen=True)
class DesignSpace:
    """A table of designs with the units of its columns, its metadata, and its numbers as text.

    `trusts` are those of the outputs that a column shows, where the table says what they rest on.
    """

    designs: Columns
    units: Mapping[str, str]
    metadata: Mapping[str, str] = field(default_factory=dict)
    trusts: Mapping[str, Sequence[Trust]] = field(default_factory=dict)
    left_out: str = ""  # in words: columns of the table that are not here

    def __len__(self) -> int:
        return len(self.designs["design"])

    @property
    def swept(self) -> list[str]:
        return swept_names(self.designs)

    @cached_property
    def varied(self) -> list[str]:
        """The swept columns that have more than one value; all of them where none has."""
        rows = np.arange(len(self))
        return [name for name in self.swept if self.n_values(name, rows) > 1] or self.swept

    @cached_property
    def narrowed(self) -> "DesignSpace":
        """The space that a page has room for: of too many columns those that vary, and not all.

        Columns that we have a name for are all there.
        """
        others = [name for name in self.designs if name not in OTHERS]
        if len(others) <= MOST_COLUMNS:
            return self
        varied = [name for name in others if self._varies(name)]
        n_constant, n_beyond = len(others) - len(varied), max(0, len(varied) - MOST_COLUMNS)
        lost = {*others} - {*varied[:MOST_COLUMNS]}
        constant, beyond = f"{n_constant:,} that have one value", f"{n_beyond:,} behind those here"
        said = enumerated([constant] * (n_constant > 0) + [beyond] * (n_beyond > 0))
        return replace(
            self,
            designs={name: found for name, found in self.designs.items() if name not in lost},
            left_out=f"Of {len(self.designs):,} columns {len(lost):,} are left out: {said}.",
        )

    def _varies(self, name: str) -> bool:
        """Whether a column has more than one value."""
        values = self.designs[name]
        known = values[~np.isnan(values)]
        return bool(np.any(known != known[:1]))

    @cached_property
    def usable(self) -> Indices:
        """Rows of designs that have a state, thus metrics."""
        return np.flatnonzero(self.designs["n_stable"] > 0)

    def of_status(self, *statuses: str) -> Indices:
        """Rows of designs that are any of these."""
        found = self.designs["status"]
        return np.flatnonzero(np.any([found == status for status in statuses], axis=0))

    def known(self, name: str, rows: Indices) -> Indices:
        """Those of the rows in which a column has a value."""
        return rows[~np.isnan(self.designs[name][rows])]

    def n_values(self, name: str, rows: Indices) -> int:
        """How many values a column has in some rows."""
        return len(distinct(self.designs[name][self.known(name, rows)]))

    def shown(self, name: str, value: float) -> str:
        """A value of a column with its unit."""
        text = str(value) if isinstance(value, int | np.integer) else f"{value:.5g}"
        return f"{text} {self.units.get(name, '')}".rstrip()

    def span(self, name: str, rows: Indices) -> str:
        """Smallest to largest value of a column in some rows."""
        values = self.designs[name][self.known(name, rows)]
        low, high = (values.min(), values.max()) if len(values) else (np.nan, np.nan)
        return self.shown(name, low) if low == high else f"{low:.5g} … {self.shown(name, high)}"

    def number(self, row: int) -> str:
        """The number of the design in a row."""
        return str(self.designs["design"][row])

    def point(self, row: int) -> list[str]:
        """The swept values of the design in a row."""
        return [self.shown(name, self.designs[name][row]) for name in self.swept]

    def label(self, name: str) -> str:
        """A column in words, for an axis.

        >>> DesignSpace({}, {"dome_height_mm": "mm"}).label("dome_height_mm")
        'dome height (mm)'
        """
        unit = self.units.get(name, "")
        return f"{self.words(name)} ({unit})" if unit else self.words(name)

    def words(self, name: str) -> str:
        """The same without its unit."""
        unit = self.units.get(name, "")
        spelled = unit.replace("/", "_per_").replace("²", "2").replace(" ", "_").replace("°", "deg")
        return name.removesuffix(f"_{spelled}").removeprefix("n_").replace("_", " ")
