"""Displacements from the text that CalculiX prints."""

import re

import numpy as np

from dpgcli.arrays import Array
from dpgcli.errors import SolverError

_HEAD = re.compile(r"^ *displacements \(vx,vy,vz\) for set \S+ and time +(\S+) *$", re.MULTILINE)
_SHORT = re.compile(r"(?<=[0-9.])([+-][0-9]{2,3})$")
_VERSION = re.compile(r"CalculiX Version ([0-9][0-9.]*)")
_SECONDS = re.compile(r"^ *Total CalculiX Time: +([0-9.]+) *$", re.MULTILINE)
_ERROR = re.compile(r"^ *\*ERROR.*(?:\n(?! *\*|\s*$).*){0,2}", re.MULTILINE)


def displacements(text: str, n_nodes: int) -> tuple[Array, Array]:
    """Times (k,) and displacements (k, n_nodes, 3) of all increments of a .dat file.

    Raises SolverError if there is none, or one that is not whole or not made of numbers.
    """
    parts = _HEAD.split(text)
    times, blocks = parts[1::2], parts[2::2]
    if not times:
        raise SolverError("ccx wrote no displacements")
    found = [_block(block, time, n_nodes) for time, block in zip(times, blocks, strict=True)]
    at = np.array([_number(time, time) for time in times])
    if (np.diff(at) < 0).any():
        raise SolverError("the times in what ccx wrote go backwards")
    return at, np.stack(found)


def version(log: str) -> str:
    """The version of CalculiX that a log names.

    >>> version("CalculiX Version 2.20, Copyright(C) 1998-2022 Guido Dhondt")
    '2.20'
    """
    match = _VERSION.search(log)
    return match[1].rstrip(".") if match else "of unknown version"


def seconds(log: str) -> float:
    """The seconds that a run took, as its log says; NaN if it does not.

    >>> seconds(" Total CalculiX Time: 38.250000")
    38.25
    """
    match = _SECONDS.search(log)
    return float(match[1]) if match else float("nan")


def reported_error(log: str) -> str:
    """The first error that a log reports, in one line; empty if there is none.

    >>> reported_error(" *ERROR: increment size smaller than minimum\\n\\n best solution")
    '*ERROR: increment size smaller than minimum'
    """
    match = _ERROR.search(log)
    return " ".join(match[0].split())[:200] if match else ""


def _block(text: str, time: str, n_nodes: int) -> Array:
    """The displacements of one increment, by node."""
    # anything else that is printed comes after an empty line
    rows = text.strip().split("\n\n", 1)[0].split("\n")
    words = [row.split() for row in rows]
    if len(words) != n_nodes or any(len(row) != 4 for row in words):
        raise SolverError(f"what ccx wrote ends within the increment at time {time}")
    numbers = _plain([word for row in words for word in row], time).reshape(n_nodes, 4)
    if (numbers[:, 0] != np.arange(1, n_nodes + 1)).any():
        raise SolverError(f"other nodes than the deck's in what ccx wrote at time {time}")
    return numbers[:, 1:]


def _plain(words: list[str], time: str) -> Array:
    try:
        numbers = np.array(words, dtype=float)
    except ValueError:
        numbers = np.array([_number(word, time) for word in words])
    if not np.isfinite(numbers).all():
        raise SolverError(f"ccx wrote numbers that are none at time {time}: the run went astray")
    return numbers


def _number(word: str, time: str) -> float:
    """Parse a number of Fortran: 1.0-100 means 1.0E-100, stars a number that does not fit."""
    try:
        return float(_SHORT.sub(r"e\1", word.replace("D", "E")))
    except ValueError:
        pass
    if set(word) <= {"*"}:
        raise SolverError(f"ccx wrote a number too large to print at time {time}")
    raise SolverError(f"expected a number in what ccx wrote at time {time}, found {word[:20]!r}")
