"""Locations in files, and how problems with them are worded and ordered."""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass

from dpgcli.errors import Problem
from dpgcli.text import MAX_SHOWN, shortened


@dataclass(frozen=True)
class Location:
    """Where something stands: line and column from 1, none for what is not in a file."""

    file: str
    line: int | None = None
    column: int | None = None


def located(place: Location, key: str, expected: str, found: str, hint: str = "") -> Problem:
    """A problem at a place."""
    return Problem(place.file, place.line, place.column, key, expected, found, hint)


def in_order(problems: Sequence[Problem]) -> tuple[Problem, ...]:
    """Problems by file and line, each place and key once, those without a line last."""
    first: dict[tuple[str, int | None, int | None, str, str], Problem] = {}
    for p in problems:
        first.setdefault((p.file, p.line, p.column, p.key, p.expected), p)
    files = list(dict.fromkeys(p.file for p in problems))

    def order(p: Problem) -> tuple[bool, int, int, int]:
        return p.line is None, files.index(p.file), p.line or 0, p.column or 0

    return tuple(sorted(first.values(), key=order))


def shown(value: object) -> str:
    """A value as a message shows it, in the manner of YAML.

    >>> shown(True), shown(float("inf")), shown("6.5"), shown(None)
    ('true', '.inf', '"6.5"', 'nothing')
    """
    if value is None:
        return "nothing"
    if isinstance(value, dict):
        return "a section"
    if isinstance(value, list):
        return "a list"
    if isinstance(value, float) and not math.isfinite(value):
        return str(value).replace("inf", ".inf").replace("nan", ".nan")
    if isinstance(value, int) and abs(value) >= 10**MAX_SHOWN:
        return "a number of more than 60 digits"
    if isinstance(value, str):
        return shortened(json.dumps(value[: 2 * MAX_SHOWN], ensure_ascii=False))
    return shortened(json.dumps(value, default=str))
