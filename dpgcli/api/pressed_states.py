"""States of fingers under pressure, as people name them: patterns in, patterns out."""

import re
from collections.abc import Iterable

import numpy as np

from dpgcli.actuation.graph import rests
from dpgcli.actuation.pressed import Pressed
from dpgcli.actuation.rest import at_rest
from dpgcli.api.arguments import check_texts
from dpgcli.api.pressure import PressedInput
from dpgcli.errors import Field, UsageError
from dpgcli.states.certify import Status
from dpgcli.states.patterns import inverted_units


def code_of(given: PressedInput, field: str, pattern: str) -> int:
    """The code of a pattern. Raises UsageError for what is none."""
    check_texts(**{field: pattern})
    n_units = given.pressed.finger.n_units
    if not re.fullmatch(f"[01]{{{n_units}}}", str(pattern)):
        raise UsageError(Field(field), f" {pattern}: expected {n_units} digits, 0 or 1")
    return int(pattern, 2)


def begin_of(given: PressedInput, start: str) -> int:
    """The code of the state to start from; of none, that in which the finger rests.

    Raises UsageError for what is no pattern, or none of a stable state.
    """
    check_texts(start=start)
    if start:
        code = code_of(given, "start", start)
    else:
        codes, are_certain = rests(given.pressed, 1)
        code = int(codes[0]) if are_certain[0] else 0
    check_state(given, "start", code)
    return code


def check_state(given: PressedInput, field: str, code: int) -> None:
    """Raise UsageError for the code of a pattern that is no stable state."""
    n_units = given.pressed.finger.n_units
    _, settled = at_rest(given.pressed, inverted_units(np.array([code], np.uint64), n_units))
    status = Status(settled.status[0])
    if status is not Status.STABLE:
        said = f" {pattern_of(given, code)}: expected a stable state, found {status.text}"
        raise UsageError(Field(field), said)


def unknown_rest(pressed: Pressed) -> str:
    """Why it is not known in which state a finger rests before any pulse, for summaries."""
    n_units = pressed.finger.n_units
    _, settled = at_rest(pressed, np.zeros((n_units, 1), bool))
    status = Status(settled.status[0]).text
    return f"without a pulse the finger is in no certified state, {'0' * n_units} is {status}"


def pattern_of(given: PressedInput, code: int) -> str:
    """The pattern with a code."""
    return f"{code:0{given.pressed.finger.n_units}b}"


def patterns_of(
    given: PressedInput, codes: Iterable[int]
) -> np.ndarray[tuple[int], np.dtype[np.bytes_]]:
    """Patterns by their codes, empty for −1."""
    n_units = given.pressed.finger.n_units
    return np.array([pattern_of(given, c) if c >= 0 else "" for c in codes], f"S{n_units}")
