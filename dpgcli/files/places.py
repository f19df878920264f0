"""Locations in files, and how problems with them are worded and ordered."""

import json
import math
from collections.abc import Iterable, Iterator, Sequence

from dpgcli.errors import Problem
from dpgcli.records import dataclass
from dpgcli.text import MAX_SHOWN, shortened

MOST_ALIKE = 100  # problems of one kind: each takes a hundred times the room of its cell


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


def few(problems: Iterable[Problem]) -> Iterator[Problem]:
    """The first problems of one kind in data, and a word where there are more of them.

    >>> here = located(Location("t.csv", 3), "x_mm", "a number", '"a"')
    >>> [str(problem) for problem in few([here] * 2_000)][MOST_ALIKE:]
    ['t.csv: x_mm: expected a number, found something else in more than 100 places']
    """
    for number, problem in enumerate(problems):
        if number == MOST_ALIKE:
            found = f"something else in more than {MOST_ALIKE} places"
            yield located(Location(problem.file), problem.key, problem.expected, found)
            return
        yield problem


def shown(value: object) -> str:
    """A value as a message shows it, in the manner of YAML.

    >>> shown(True), shown(float("inf")), shown("6.5"), shown(None), shown([4, 5])
    ('true', '.inf', '"6.5"', 'nothing', 'a list of 2')
    """
    if value is None:
        return "nothing"
    if isinstance(value, dict):
        return "a section"
    if isinstance(value, list):
        return f"a list of {len(value):,}" if value else "an empty list"
    if isinstance(value, float) and not math.isfinite(value):
        return str(value).replace("inf", ".inf").replace("nan", ".nan")
    if isinstance(value, int) and abs(value) >= 10**MAX_SHOWN:
        return "a number of more than 60 digits"
    if isinstance(value, str):
        return shortened(json.dumps(value[: 2 * MAX_SHOWN], ensure_ascii=False))
    return shortened(json.dumps(value, default=str))
