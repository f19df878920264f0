"""Designs whose units each have a section of their own, so that each can be changed by itself."""

from dataclasses import replace

import numpy as np

from dpgcli.arrays import Array
from dpgcli.design.dimensions import Design, GivenValues, Sizes, groups_of, unit_range


def unit_by_unit(design: Design) -> Design:
    """The same designs with an override for each unit.

    >>> base = Design(3, GivenValues(), {"2-3": GivenValues({"dome_height_mm": np.array([7.5])})})
    >>> {unit: dict(own.geometry) for unit, own in unit_by_unit(base).overrides.items()}
    {'1': {}, '2': {'dome_height_mm': array([7.5])}, '3': {'dome_height_mm': array([7.5])}}
    """
    own = {unit: part for text, part in design.overrides.items() for unit in unit_range(text)}
    units = range(1, design.units + 1)
    overrides = {str(unit): own.get(unit, GivenValues()) for unit in units}
    return replace(design, overrides=overrides)


def size_by_unit(design: Design, key: str) -> Array | None:
    """A dimension of each unit, (unit, design or 1); None where it is not given in all.

    >>> base = Design(2, GivenValues({"dome_height_mm": np.array([6.5])}))
    >>> size_by_unit(base, "dome_height_mm").tolist()
    [[6.5], [6.5]]
    """
    sizes: dict[int, Sizes] = {
        unit: group.geometry for group in groups_of(design) for unit in group.units
    }
    if not all(key in sizes[unit] for unit in range(1, design.units + 1)):
        return None
    rows = np.broadcast_arrays(*(sizes[unit][key] for unit in range(1, design.units + 1)))
    return np.stack(rows)


def with_sizes(design: Design, key: str, values: Array) -> Design:
    """The designs, unit by unit, with a dimension of each unit, (unit, design)."""
    columns = {
        f"finger.overrides.{unit}.geometry.{key}": row for unit, row in enumerate(values, start=1)
    }
    return unit_by_unit(design).with_values(columns)
