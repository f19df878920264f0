"""The targets of a goal, read: quantities of states, what they should be, and how exactly."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from math import isfinite
from typing import Any

from dpgcli.errors import NothingSelectedError, UsageError
from dpgcli.files.places import shown
from dpgcli.files.sweep_file.space import SpaceReader
from dpgcli.search.goal import OF_TIP, TIP, Target, state_quantities, suffix_of
from dpgcli.states.patterns import select
from dpgcli.text import KeyPath, quoted

MOST_STATES = 2**12  # of a finger, among which the nearest is looked for


@dataclass
class TargetReader:
    """Reads targets for fingers of some numbers of units; problems go to those of the space."""

    space: SpaceReader
    n_units: Sequence[int]
    is_gripper: bool

    def __post_init__(self) -> None:
        longest = max(self.n_units, default=1)
        self.columns = state_quantities(longest, is_gripper=self.is_gripper)

    def target(self, place: int, said: Any) -> Target | None:
        """A target, or None with a problem."""
        path: KeyPath = ("targets", place)
        if not isinstance(said, dict):
            self.space.wrong(path, "a target, with pattern, quantity, value", shown(said))
            return None
        quantity, n_before = said.get("quantity"), len(self.space.problems)
        if not self._is_known(path, quantity):
            return None
        tolerance_key = f"tolerance{suffix_of(self._unit(str(quantity)))}"
        for key in said:
            if key not in (known := ("pattern", "quantity", "value", tolerance_key)):
                close = get_close_matches(key, known, n=1)
                hint = f"did you mean {close[0]}?" if close else f"known here: {', '.join(known)}"
                self.space.wrong((*path, key), "a known key", shown(key), hint)
        values = self._values(path, said.get("value"), 2 if quantity == TIP else 1)
        tolerance = said.get(tolerance_key)
        if not (_is_number(tolerance) and float(tolerance or 0.0) > 0.0):
            self.space.wrong((*path, tolerance_key), "a number > 0", shown(tolerance))
        self._check_pattern((*path, "pattern"), said.get("pattern"))
        if len(self.space.problems) > n_before:
            return None
        return Target(said["pattern"], str(quantity), values, float(said[tolerance_key]))

    def _unit(self, quantity: str) -> str:
        return self.columns[OF_TIP[0] if quantity == TIP else quantity].unit

    def _is_known(self, path: KeyPath, quantity: Any) -> bool:
        known = [TIP, *self.columns]
        if isinstance(quantity, str) and quantity in known:
            return True
        close = get_close_matches(str(quantity), known, n=1, cutoff=0.0)
        hint = f"the nearest is {close[0]}; dpg help columns"
        self.space.wrong((*path, "quantity"), "tip, or a column of states", shown(quantity), hint)
        return False

    def _values(self, path: KeyPath, said: Any, n: int) -> tuple[float, ...]:
        values = said if isinstance(said, list) else [said]
        is_right = len(values) == n and (n > 1) == isinstance(said, list)
        if not (is_right and all(map(_is_number, values))):
            expected = "a number" if n == 1 else "two numbers in mm, such as [45, -30]"
            self.space.wrong((*path, "value"), expected, shown(said))
            return ()
        return tuple(map(float, values))

    def _check_pattern(self, path: KeyPath, pattern: Any) -> None:
        if not isinstance(pattern, str):
            hint = "a pattern without * in quotes" if isinstance(pattern, int) else ""
            self.space.wrong(path, "a pattern such as 111*", shown(pattern), hint)
            return
        try:
            n_states = max(self._n_matches(pattern), default=1)
            if not n_states:
                expected = f"a pattern of {' or '.join(map(str, self.n_units))} units"
                self.space.wrong(path, expected, shown(pattern))
            elif n_states > MOST_STATES:
                expected = f"a pattern that at most {MOST_STATES:,} states match"
                self.space.wrong(path, expected, f"{shown(pattern)}, of {n_states:,}")
        except UsageError as error:
            self.space.wrong(path, "a pattern such as 111*", quoted(pattern), str(error))

    def _n_matches(self, pattern: str) -> Iterator[int]:
        """How many such patterns fingers of each number of units have. Raises UsageError."""
        for n_units in self.n_units:
            try:
                yield len(select((pattern,), n_units))
            except NothingSelectedError:
                yield 0


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value)
