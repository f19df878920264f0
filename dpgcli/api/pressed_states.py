"""States of fingers under pressure, as people name them: patterns in, patterns out."""

import re
from collections.abc import Iterable

import numpy as np

from dpgcli.actuation.rest import at_rest
from dpgcli.api.arguments import check_texts
from dpgcli.api.pressure import PressedInput
from dpgcli.errors import Field, UsageError
from dpgcli.states.certify import Status
from dpgcli.states.patterns import inverted_units


def code_of(given: PressedInput, field: str, pattern: str, *, may_lack: bool = False) -> int:
    """The code of a pattern; of an empty one, if it may be, that of rest.

    Raises UsageError for what is none.
    """
    check_texts(**{field: pattern})
    n_units = given.pressed.finger.n_units
    said = pattern or "0" * n_units if may_lack else str(pattern)
    if not re.fullmatch(f"[01]{{{n_units}}}", said):
        raise UsageError(Field(field), f" {pattern}: expected {n_units} digits, 0 or 1")
    return int(said, 2)


def check_state(given: PressedInput, field: str, code: int) -> None:
    """Raise UsageError for the code of a pattern that is no stable state."""
    n_units = given.pressed.finger.n_units
    _, settled = at_rest(given.pressed, inverted_units(np.array([code], np.uint64), n_units))
    status = Status(settled.status[0])
    if status is not Status.STABLE:
        said = f" {pattern_of(given, code)}: expected a stable state, found {status.text}"
        raise UsageError(Field(field), said)


def pattern_of(given: PressedInput, code: int) -> str:
    """The pattern with a code."""
    return f"{code:0{given.pressed.finger.n_units}b}"


def patterns_of(
    given: PressedInput, codes: Iterable[int]
) -> np.ndarray[tuple[int], np.dtype[np.bytes_]]:
    """Patterns by their codes, empty for −1."""
    n_units = given.pressed.finger.n_units
    return np.array([pattern_of(given, c) if c >= 0 else "" for c in codes], f"S{n_units}")
