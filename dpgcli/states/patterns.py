"""Activation patterns: as text ("101", unit 1 first), as bits and as codes.

A code is the pattern read as a binary number, unit 1 the most significant bit, so that codes
sort as the texts do.
"""

import re
from collections.abc import Iterator, Sequence
from functools import reduce
from typing import Self

import numpy as np
from numpy.typing import NDArray

from dpgcli.arrays import Codes, Flags
from dpgcli.errors import Field, Message, NothingSelectedError, UsageError
from dpgcli.records import dataclass

MOST_SELECTED = 2**26  # states of a run
MOST_COUNTED = np.uint64(2**62)  # so that the sum of two is a number of 64 bits
MOST_WAYS, MOST_BITS = 10_000, 10**9  # states of the automaton that matches: at most 10 s


def chunks(n_codes: int, size: int) -> Iterator[Codes]:
    """All codes below n_codes, in order, at most `size` at a time.

    >>> [codes.tolist() for codes in chunks(5, 2)]
    [[0, 1], [2, 3], [4]]
    """
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
    """Codes of patterns (unit, state), the inverse of `inverted_units`.

    >>> codes_of(np.array([[True], [False], [True]])).tolist()
    [5]
    """
    return reduce(lambda code, bit: (code << np.uint64(1)) | bit, inverted.astype(np.uint64))


def texts(inverted: Flags) -> np.ndarray[tuple[int], np.dtype[np.bytes_]]:
    """Patterns as byte strings of length n, shape (state,).

    >>> texts(inverted_units(np.array([1, 6], np.uint64), 3)).tolist()
    [b'001', b'110']
    """
    digits = np.ascontiguousarray(inverted.T.astype(np.uint8) + np.uint8(ord("0")))
    return digits.view(f"S{len(inverted)}").ravel()


def select(globs: Sequence[str], n_units: int) -> "Selection":
    """All patterns that match any glob; `*` is any run, `?` either digit.

    Raises UsageError for a glob that is none, or where too many patterns match or there are too
    many ways to match, and NothingSelectedError where none does.

    >>> select(["1*1"], 4).codes(0, 4).tolist()
    [9, 11, 13, 15]
    """
    for glob in globs:
        if not glob or set(glob) - set("01*?"):
            raise UsageError(
                Field("patterns"),
                f" {shortened(glob)!r}: expected digits 0 and 1 with wildcards * and ?, "
                f"such as {'1' * n_units} or 1*",
            )
    selection = Selection(_transitions(_Globs.of(globs, n_units), n_units))
    if not len(selection):
        named = shortened(", ".join(globs))
        raise NothingSelectedError(f"no pattern of {n_units} units matches {named}")
    if len(selection) > MOST_SELECTED:
        raise UsageError(too_many(n_units, Field("patterns"), " selects"))
    return selection


class Selection:
    """Patterns in order, made from their places when they are asked for.

    `steps` has for each unit the state of an automaton that each of its states goes to by 0 and
    by 1, −1 where nothing can match any more; the states after the last unit all match.
    """

    def __init__(self, steps: Sequence[NDArray[np.int64]]) -> None:
        counts = [np.ones(1 + steps[-1].max(initial=-1), np.uint64)]
        for step in reversed(steps):  # how many patterns go on from each state, none from −1
            after = np.append(counts[-1], np.uint64(0))[step].sum(axis=1)
            counts.append(np.minimum(after, MOST_COUNTED))
        self.steps, self.counts = steps, [np.append(n, np.uint64(0)) for n in counts[::-1]]

    def __len__(self) -> int:
        return int(self.counts[0].sum())

    def codes(self, first: int, stop: int) -> Codes:
        """Codes of the patterns number first … stop − 1 of the selection."""
        place = np.arange(first, stop, dtype=np.uint64)
        state = np.zeros(len(place), np.int64)
        codes = np.zeros(len(place), np.uint64)
        for step, counts in zip(self.steps, self.counts[1:], strict=True):
            with_zero = counts[step[state, 0]]
            is_one = place >= with_zero
            place -= np.where(is_one, with_zero, np.uint64(0))
            state = step[state, is_one.astype(np.int64)]
            codes = (codes << np.uint64(1)) | is_one
        return codes


@dataclass(frozen=True)
class _Globs:
    """All globs side by side as one row of bits, a bit for each symbol and one for each end.

    The set bits say where in the globs one may be; `zero` and `one` are the symbols that take
    a digit, `star` those that take any.
    """

    start: int
    zero: int
    one: int
    star: int
    end: int

    @classmethod
    def of(cls, globs: Sequence[str], n_units: int) -> Self:
        """Globs that differ and can match so many digits; a run of stars is one."""
        plain = dict.fromkeys(re.sub(r"\*+", "*", glob) for glob in globs)
        fitting = [glob for glob in plain if len(glob) - glob.count("*") <= n_units]
        symbols = "".join(f"{glob}$" for glob in fitting)[::-1]

        def at(wanted: str) -> int:
            return int("0" + "".join("01"[symbol in wanted] for symbol in symbols), 2)

        ends = at("$")
        start = (ends << 1 | 1) & ((1 << len(symbols)) - 1)
        return cls(start, at("0?"), at("1?"), at("*"), ends)

    def without_digit(self, places: int) -> int:
        """The places, and those behind a star that takes nothing."""
        return places | (places & self.star) << 1

    def after(self, places: int, digit: int) -> int:
        """The places after a digit from these places."""
        taking = self.one if digit else self.zero
        return self.without_digit((places & taking) << 1 | (places & self.star))

    def before(self, places: int) -> int:
        """The places from which some digit leads to these places."""
        found = (places >> 1) & (self.zero | self.one) | (places & self.star)
        return found | (found >> 1) & self.star


def _transitions(globs: _Globs, n_units: int) -> list[NDArray[np.int64]]:
    """The automaton of `Selection`, whose states are sets of places in the globs."""
    hopeful = [globs.end | (globs.end >> 1) & globs.star]  # from where the rest can match
    for _ in range(n_units):
        hopeful.append(globs.before(hopeful[-1]))
    states = {globs.without_digit(globs.start) & hopeful.pop(): 0}
    steps = []
    for _ in range(n_units):
        can_match = hopeful.pop()
        after: dict[int, int] = {0: -1}
        step = [
            after.setdefault(globs.after(places, digit) & can_match, len(after) - 1)
            for places in states
            for digit in (0, 1)
        ]
        del after[0]
        n_symbols = globs.end.bit_length()
        if len(after) > MOST_WAYS or len(after) * n_symbols > MOST_BITS:
            raise UsageError(
                Field("patterns"),
                f": globs of {n_symbols:,} symbols that match in {len(after):,} ways or "
                "more: give fewer at a time, or simpler ones",
            )
        steps.append(np.array(step, np.int64).reshape(-1, 2))
        states = after
    return steps


def shortened(text: str) -> str:
    """A text cut to the 80 characters that a message has room for.

    >>> len(shortened("01" * 100)), shortened("1*")
    (80, '1*')
    """
    return text if len(text) <= 80 else f"{text[:77]}..."


def too_many(n_units: int, *what: str) -> Message:
    """The message that refuses so many states, after the words `what`."""
    most = f"more than {MOST_SELECTED:,} of the 2^{n_units} states"
    return Message(*what, f" {most}: select fewer with ", Field("patterns"))
