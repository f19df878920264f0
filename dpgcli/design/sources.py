"""Where the values of a single design are from, for tables and plans."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from dpgcli.design.dimensions import HINGE_COUPLING, LINEAR_STIFFNESS, UnitGroup, unit_text
from dpgcli.design.problems import of_design
from dpgcli.design.rules import SEGMENT_HEIGHT, Value
from dpgcli.design.scene import ORIGINS, Source

SHARED = (SEGMENT_HEIGHT.key, LINEAR_STIFFNESS, HINGE_COUPLING)  # by all units


def sources_of(
    values: Mapping[str, Sequence[tuple[UnitGroup, Value]]], n_units: int
) -> Iterator[Source]:
    """One source for each key and each set of units that got the same value the same way."""
    everyone = tuple(range(1, n_units + 1))
    for key, pairs in values.items():
        same: dict[Source, tuple[int, ...]] = {}
        for group, value in pairs:
            units = everyone if key in SHARED else group.units
            source = _source(key, value)
            same[source] = (*same.get(source, ()), *units)
        for source, units in sorted(same.items(), key=lambda item: min(item[1])):
            yield replace(source, units=unit_text(units))


def _source(key: str, value: Value) -> Source:
    """How the value of the first design came about, the units left out."""
    error = value.standard_error
    return Source(
        key,
        "",
        of_design(value.numbers, 0),
        ORIGINS[int(of_design(value.origin, 0))],
        value.rule_of(0),
        None if error is None else of_design(error, 0),
    )
