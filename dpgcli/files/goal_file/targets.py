"""The targets of a goal, read: quantities of states or designs, what these should be."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from difflib import get_close_matches
from typing import Any

import numpy as np

from dpgcli.design.dimensions import Design, GivenPressure
from dpgcli.design.outputs import Output
from dpgcli.errors import NothingSelectedError, UsageError
from dpgcli.files.places import shown
from dpgcli.files.sweep_file.space import SpaceReader
from dpgcli.records import dataclass
from dpgcli.search.columns import design_columns, state_columns
from dpgcli.search.goal import OF_TIP, TIP, Target, suffix_of
from dpgcli.states.columns import Column, Group, Kind
from dpgcli.states.patterns import select
from dpgcli.sweeps.extent import MOST_PRESSED
from dpgcli.sweeps.metrics import METRICS
from dpgcli.text import KeyPath, is_finite, quoted

HALF = 0.5  # the tolerance of what is so or not
MOST_STATES = 2**12  # of a finger, among which the nearest is looked for


@dataclass
class TargetReader:
    """Reads targets around a base, for some numbers of units; problems go to those of the space."""

    space: SpaceReader
    n_units: Sequence[int]
    base: Design

    def __post_init__(self) -> None:
        self.of_states = state_columns(self.base, max(self.n_units, default=1))
        self.of_designs = design_columns(self.base)
        self.columns = {**self.of_designs, **self.of_states}

    def target(self, place: int, said: Any) -> Target | None:
        """A target, or None with a problem."""
        path: KeyPath = ("targets", place)
        if not isinstance(said, dict):
            self.space.wrong(path, "a target, with pattern, quantity, value", shown(said))
            return None
        quantity, n_before = said.get("quantity"), len(self.space.problems)
        if not self._is_known(path, quantity):
            return None
        column = self.columns[OF_TIP[0] if quantity == TIP else str(quantity)]
        is_flag, has_pattern = column.kind is Kind.FLAG, column.name in self.of_states
        tolerance_key = f"tolerance{suffix_of(column.unit)}"
        known = ["pattern"] * has_pattern + ["quantity", "value"] + [tolerance_key] * (not is_flag)
        for key in said:
            if key not in known:
                close = get_close_matches(key, known, n=1)
                hint = f"did you mean {close[0]}?" if close else f"known here: {', '.join(known)}"
                if key == "pattern":
                    hint = f"{quantity} is of whole designs"
                self.space.wrong((*path, key), "a known key", shown(key), hint)
        values = self._values(path, said.get("value"), quantity, is_flag=is_flag)
        tolerance = HALF if is_flag else said.get(tolerance_key)
        if not (is_finite(tolerance) and tolerance > 0.0):
            self.space.wrong((*path, tolerance_key), "a number > 0", shown(tolerance))
        if has_pattern:
            self._check_pattern((*path, "pattern"), said.get("pattern"))
        self._check_pressed(path, column)
        if len(self.space.problems) > n_before or tolerance is None:
            return None
        return Target(said.get("pattern", ""), str(quantity), values, float(tolerance))

    def _is_known(self, path: KeyPath, quantity: Any) -> bool:
        known = [TIP, *self.columns]
        if isinstance(quantity, str) and quantity in known:
            return True
        close = get_close_matches(str(quantity), known, n=1, cutoff=0.0)
        hint = self._lacking(str(quantity)) or f"the nearest is {close[0]}; dpg help designing"
        expected = "tip, or a column of states or of designs"
        self.space.wrong((*path, "quantity"), expected, shown(quantity), hint)
        return False

    def _lacking(self, quantity: str) -> str:
        """Which section the base would need for a quantity to be there."""
        from dpgcli.sweeps.grasps import grasp_columns

        with_gripper = replace(self.base, gripper={"base_spacing_mm": np.ones(1)})
        with_pressure = replace(self.base, pressure=self.base.pressure or GivenPressure())
        every = grasp_columns(is_pair=True, has_friction=True, may_turn=True)
        of_body = {column.name for column in every}
        of_body |= {metric.name for metric in METRICS if metric.group is Group.GRASP}
        if quantity in of_body:
            return "the base has no object" if self.base.body is None else "its object has it not"
        for section, base in (("gripper", with_gripper), ("pressure", with_pressure)):
            if quantity in {**state_columns(base, base.units), **design_columns(base)}:
                return f"the base has no {section}"
        return ""

    def _check_pressed(self, path: KeyPath, column: Column) -> None:
        """Note fingers that are too long to be followed under pressure."""
        longest = max(self.n_units, default=1)
        if Output.PRESSURES in column.outputs and longest > MOST_PRESSED:
            expected = f"at most {MOST_PRESSED} units under pressure"
            self.space.wrong((*path, "quantity"), expected, f"{longest}")

    def _values(
        self, path: KeyPath, said: Any, quantity: Any, *, is_flag: bool
    ) -> tuple[float, ...]:
        if is_flag:
            if not isinstance(said, bool):
                self.space.wrong((*path, "value"), "true or false", shown(said))
            return (float(bool(said)),)
        n = 2 if quantity == TIP else 1
        values = said if isinstance(said, list) else [said]
        is_right = len(values) == n and (n > 1) == isinstance(said, list)
        if not (is_right and all(map(is_finite, values))):
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
