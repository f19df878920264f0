"""Constraints and objectives of a goal, read: over columns of designs, and keys."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cached_property
from typing import Any

from dpgcli.design.dimensions import Design
from dpgcli.files.places import shown
from dpgcli.files.sweep_file.space import SpaceReader
from dpgcli.search.columns import NUMBERS, design_columns
from dpgcli.search.goal import Objective
from dpgcli.sweeps.expressions import Expression, ExpressionError, contradict, expression
from dpgcli.sweeps.metrics import METRICS
from dpgcli.text import KeyPath


@dataclass
class MapReader:
    """Reads constraints and objectives over designs around a base, whose numbers are `known`."""

    space: SpaceReader
    base: Design
    known: dict[str, float]

    @cached_property
    def names(self) -> list[str]:
        """Columns that designs have, and keys, by their last part where one key alone has it."""
        columns = [*design_columns(self.base)]
        keys = self.space.keys | self.known.keys()
        last = Counter(key.rsplit(".", 1)[-1] for key in keys)
        return [*columns, *sorted(keys), *sorted(n for n, count in last.items() if count == 1)]

    def constraints(self, said: Sequence[Any]) -> tuple[Expression, ...]:
        """The constraints that are right; the others are problems."""
        found: dict[int, Expression] = {}
        for place, text in enumerate(said):
            path: KeyPath = ("constraints", place)
            try:
                rule = expression(str(text))
            except ExpressionError as error:
                self.space.wrong(path, "a comparison", shown(text), str(error))
                continue
            if not rule.is_comparison:
                self.space.wrong(path, "a comparison, such as min_barrier_mJ > 1", shown(text))
            elif sum(not self._is_known(path, name) for name in sorted(rule.names)) == 0:
                found[place] = rule
        for place, text in self._contradictions(found):
            expected = "constraints that can hold together"
            self.space.wrong(("constraints", place), expected, text)
        return tuple(found.values())

    @staticmethod
    def _contradictions(found: dict[int, Expression]) -> Iterator[tuple[int, str]]:
        """Later ones of two that no number can meet, and both in words."""
        places = list(found)
        for last, place in enumerate(places):
            for before in places[:last]:
                if contradict(found[before], found[place]):
                    yield place, f"{found[place].text} beside {found[before].text}"

    def objectives(self, smaller: Sequence[Any], larger: Sequence[Any]) -> tuple[Objective, ...]:
        """What should be as small, or as large, as can be; each name once."""
        found: dict[str, Objective] = {}
        for key, said in (("minimize", smaller), ("maximize", larger)):
            for place, name in enumerate(said):
                path: KeyPath = (key, place)
                if not self._is_known(path, name):
                    continue
                if name in found:
                    self.space.wrong(path, "each objective once", f"{name} again")
                found[name] = Objective(name, key == "maximize")
        return tuple(found.values())

    def _is_known(self, path: KeyPath, name: Any) -> bool:
        if isinstance(name, str) and name in self.names:
            return True
        every = {metric.name: metric for metric in METRICS if metric.kind in NUMBERS}
        if isinstance(name, str) and name in every:
            needs = "pressure" if every[name].needs_pressure else every[name].group.value
            section = {"grasp": "object"}.get(needs, needs)
            hint = f"the base has no {section}"
        else:
            close = get_close_matches(str(name), self.names, n=1, cutoff=0.0)
            hint = f"the nearest is {close[0]}; dpg help sweeps"
        self.space.wrong(path, "a column of designs, or a key", shown(name), hint)
        return False
