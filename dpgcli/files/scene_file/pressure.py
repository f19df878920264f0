"""The keys of a spec's pressure, their types and their meaning."""

import re
from typing import Annotated

import numpy as np
from pydantic import BeforeValidator, Field, WithJsonSchema

from dpgcli.design.dimensions import MAX_UNITS, UNIT_RANGE, GivenPressure, Sizes, unit_range
from dpgcli.design.lines import HISTORY, LINES, NAME, TIME
from dpgcli.files.sections import Bounded, Positive, Section
from dpgcli.text import KeyPath

UNITS = "units such as 1-3, 4 or 1,3"
RAMP = "pressures in MPa such as 0:0.15:0, or a list of 2 or more"
EXPECTED = {
    "lines": "units by line, such as {A: 1-3, B: 4-5}",
    "history": "pressures by line, such as {A: 0:0.15:0}, or the name of a CSV file",
}
UNIT_LIST = rf"{UNIT_RANGE.pattern}( *, *{UNIT_RANGE.pattern})*"
NUMBER = re.compile(r" *[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)? *")


def expected_at(path: KeyPath) -> str:
    """The values that a key within lines or history can have, in words; empty elsewhere."""
    if path[:-1] == LINES:
        return UNITS
    if path[:-1] == HISTORY:
        return "times in s, a list of 2 or more" if path[-1] == TIME else RAMP
    if path[:-2] == HISTORY:
        return "a time in s" if path[-2] == TIME else "a pressure in MPa"
    return ""


def ramp(text: str) -> list[float]:
    """The pressures of a ramp, in MPa. Raises ValueError for what is none.

    >>> ramp("0:0.15:0")
    [0.0, 0.15, 0.0]
    """
    parts = text.split(":")
    if not all(NUMBER.fullmatch(part) for part in parts):
        raise ValueError(f"{text!r} is no ramp")
    return [float(part) for part in parts]


def _units(said: object) -> object:
    """Units as text, however they are said."""
    parts = said if isinstance(said, list) else [said]
    if not all(isinstance(part, int | str) and not isinstance(part, bool) for part in parts):
        raise ValueError("no units")
    texts = [text.strip() for part in parts for text in str(part).split(",")]
    if not texts or not all(0 < len(unit_range(text)) <= MAX_UNITS for text in texts):
        raise ValueError("no units")
    return ",".join(text.replace(" ", "") for text in texts)


def _pressures(said: object) -> object:
    return ramp(said) if isinstance(said, str) else said


def _history(said: object) -> object:
    """A file's name is another's to read: `histories` has put its pressures there by then."""
    return None if isinstance(said, str) else said


UNITS_SCHEMA = {
    "anyOf": [
        {"type": "string", "pattern": f"^{UNIT_LIST}$"},
        {"type": "integer", "minimum": 1},
        {"type": "array", "items": {"type": ["integer", "string"]}, "minItems": 1},
    ]
}
RAMP_SCHEMA = {
    "anyOf": [
        {"type": "string"},
        {"type": "array", "items": {"type": "number"}, "minItems": 2},
    ]
}
HISTORY_SCHEMA = {
    "anyOf": [
        {"type": "object", "additionalProperties": RAMP_SCHEMA},
        {"type": "string"},
        {"type": "null"},
    ]
}
UnitList = Annotated[str, BeforeValidator(_units), WithJsonSchema(UNITS_SCHEMA)]
Ramp = Annotated[list[Bounded], Field(min_length=2), BeforeValidator(_pressures)]
Pressures = Annotated[
    dict[str, Ramp] | None, BeforeValidator(_history), WithJsonSchema(HISTORY_SCHEMA)
]


class UnitPressure(Section):
    """How domes of some units answer to pressure."""

    effective_area_mm2: Positive | None = Field(
        default=None, description="Area on which the pressure acts along a unit's opening, in mm2."
    )
    snap_pressure_MPa: Positive | None = Field(
        default=None, description="Pressure at which a dome inverts, in MPa."
    )


class PressureSpec(UnitPressure):
    """Pressure lines, how domes answer to them, and a history of pressures."""

    lines: dict[str, UnitList] | None = Field(
        default=None,
        description="Units of each pressure line by its name: one line, A, has all without it.",
        json_schema_extra={"propertyNames": {"pattern": f"^{NAME.pattern}$"}},
    )
    history: Pressures = Field(
        default=None,
        description="Pressures of each line, in MPa: a ramp such as 0:0.15:0, a list, or the name "
        "of a CSV file with a column for each line, and one of times, time_s, perhaps.",
    )
    overrides: dict[str, UnitPressure | None] | None = Field(
        default=None,
        description='Differences by unit ("4") or range of units ("4-5"), counted from the base.',
        json_schema_extra={"propertyNames": {"pattern": f"^{UNIT_RANGE.pattern}$"}},
    )

    @property
    def known(self) -> GivenPressure:
        """The value that designs are resolved with."""
        lines = {
            line: tuple(unit for text in units.split(",") for unit in unit_range(text))
            for line, units in (self.lines or {}).items()
        }
        overrides = {units: _values(own) for units, own in (self.overrides or {}).items()}
        return GivenPressure(lines, _values(self), overrides, self.history or {})


def _values(section: UnitPressure | None) -> Sizes:
    given = {} if section is None else section.given()
    return {key: np.array([given[key]]) for key in UnitPressure.model_fields if key in given}
