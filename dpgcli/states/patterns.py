"""Activation patterns: as text ("101", unit 1 first), as bits and as codes.

A code is the pattern read as a binary number, unit 1 the most significant bit, so that codes
sort as the texts do.
"""

from collections.abc import Iterator, Sequence
from functools import reduce

import numpy as np

from dpgcli.arrays import Codes, Flags
from dpgcli.errors import NothingSelectedError, UsageError

MOST_SELECTED = 2**26


def chunks(n_codes: int, size: int) -> Iterator[Codes]:
    """All codes below n_codes, in order, at most `size` at a time."""
    for first in range(0, n_codes, size):
        yield np.arange(first, min(first + size, n_codes), dtype=np.uint64)


def inverted_units(codes: Codes, n_units: int) -> Flags:
    """Bits of the codes, shape (unit, state).

    >>> inverted_units(np.array([5], np.uint64), 3).ravel().tolist()
    [True, False, True]
    """
    shifts = np.arange(n_units - 1, -1, -1, dtype=np.uint64)
    return np.asarray((codes >> shifts[:, None]) & np.uint64(1), bool)


def codes_of(inverted: Flags) -> Codes:
    """Inverse of `inverted_units`."""
    return reduce(lambda code, bit: (code << np.uint64(1)) | bit, inverted.astype(np.uint64))


def texts(inverted: Flags) -> np.ndarray[tuple[int], np.dtype[np.bytes_]]:
    """Patterns as byte strings of length n, shape (state,).

    >>> texts(inverted_units(np.array([1, 6], np.uint64), 3)).tolist()
    [b'001', b'110']
    """
    digits = np.ascontiguousarray(inverted.T.astype(np.uint8) + np.uint8(ord("0")))
    return digits.view(f"S{len(inverted)}").ravel()


def select(globs: Sequence[str], n_units: int) -> Codes:
    """Codes of all patterns that match any glob, sorted; `*` is any run, `?` either digit.

    Raises UsageError for a glob that is none, or where too many patterns match, and
    NothingSelectedError where none does.

    >>> select(["1*1"], 4).tolist()
    [9, 11, 13, 15]
    """
    for glob in globs:
        if not glob or set(glob) - set("01*?"):
            raise UsageError(
                f"--pattern {glob!r}: expected digits 0 and 1 with wildcards * and ?, "
                f"such as {'1' * n_units} or 1*"
            )
    found = np.unique(np.concatenate([_matches(glob, n_units) for glob in globs]))
    if not len(found):
        raise NothingSelectedError(f"no pattern of {n_units} units matches {', '.join(globs)}")
    return found


def _matches(glob: str, n_units: int) -> Codes:
    """Walk the glob's automaton unit by unit; each state is a set of positions in the glob."""
    possible = _completable(glob, n_units)
    partial: dict[frozenset[int], Codes] = {}
    start = _closure(glob, {0})
    if start & possible[0]:
        partial[start] = np.zeros(1, np.uint64)
    for unit in range(n_units):
        reached: dict[frozenset[int], list[Codes]] = {}
        for positions, codes in partial.items():
            for digit in "01":
                after = _step(glob, positions, digit)
                if after & possible[unit + 1]:
                    longer = (codes << np.uint64(1)) | np.uint64(digit == "1")
                    reached.setdefault(after, []).append(longer)
        partial = {after: np.concatenate(parts) for after, parts in reached.items()}
        if sum(map(len, partial.values())) > MOST_SELECTED:
            raise UsageError(too_many(n_units, f"--pattern {glob} matches"))
    return np.concatenate([np.empty(0, np.uint64), *partial.values()])


def too_many(n_units: int, what: str) -> str:
    """Why so many states are refused, and what to do instead."""
    return (
        f"{what} more than {MOST_SELECTED:,} of the 2^{n_units} states: select fewer with --pattern"
    )


def _closure(glob: str, positions: set[int]) -> frozenset[int]:
    """Positions reachable without a digit: `*` may be empty."""
    closed = set(positions)
    for position in sorted(positions):
        while position < len(glob) and glob[position] == "*":
            position += 1
            closed.add(position)
    return frozenset(closed)


def _step(glob: str, positions: frozenset[int], digit: str) -> frozenset[int]:
    after = set()
    for position in positions:
        if position < len(glob):
            symbol = glob[position]
            if symbol == "*":
                after.add(position)
            elif symbol in ("?", digit):
                after.add(position + 1)
    return _closure(glob, after)


def _completable(glob: str, n_units: int) -> list[frozenset[int]]:
    """Per number of digits read, the positions from which the rest can still match."""
    possible = [frozenset({len(glob)})]
    stars = [len(glob)]
    while stars[-1] > 0 and glob[stars[-1] - 1] == "*":
        stars.append(stars[-1] - 1)
    possible = [frozenset(stars)]
    for _ in range(n_units):
        before = frozenset(
            position
            for position in range(len(glob) + 1)
            if any(_step(glob, _closure(glob, {position}), d) & possible[0] for d in "01")
        )
        possible.insert(0, before)
    return possible
