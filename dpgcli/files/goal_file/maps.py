"""Constraints and objectives of a goal, read: over columns of designs, and keys."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from difflib import get_close_matches
from functools import cached_property
from typing import Any

import numpy as np

from dpgcli.design.dimensions import Design
from dpgcli.files.places import shown
from dpgcli.files.sweep_file.space import SpaceReader
from dpgcli.records import dataclass
from dpgcli.search.columns import NUMBERS, design_columns
from dpgcli.search.goal import Objective
from dpgcli.search.maps import COUNTS
from dpgcli.sweeps.comparisons import Bounds, bounds
from dpgcli.sweeps.evaluation import short_names
from dpgcli.sweeps.expressions import Expression, ExpressionError, expression
from dpgcli.sweeps.metrics import METRICS
from dpgcli.text import KeyPath

ORDERED = frozenset(
    {
        *(
            (name, name.replace("_min_", "_max_"))
            for name in (metric.name for metric in METRICS)
            if "_min_" in name
        ),
        ("n_stable", "n_states"),
        ("n_distinct_tips", "n_stable"),
        ("n_grasps", "n_stable"),
        ("n_reachable", "n_stable"),
    }
)  # columns of which the first is never above the second


@dataclass
class MapReader:
    """Reads constraints and objectives over designs around a base, whose numbers are `known`."""

    space: SpaceReader
    base: Design
    known: dict[str, float]
    ends: Mapping[str, tuple[float, float]]

    @cached_property
    def varied(self) -> dict[str, Bounds]:
        """What keys that vary can be, by key and by its last part."""
        own = {key: Bounds(*ends) for key, ends in self.ends.items()}
        return {**{short: own[key] for key, short in short_names([*own]).items()}, **own}

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
        for place, expected, text in self._contradictions(found):
            self.space.wrong(("constraints", place), expected, text)
        return tuple(found.values())

    def _contradictions(self, found: dict[int, Expression]) -> Iterator[tuple[int, str, str]]:
        """Those that no design can meet, or not beside an earlier one: place, expected, found.

        As far as each bounds one name by numbers: what keys can be, and smallest values that are
        above largest ones. Whether a finger can meet the rest is for the search to find out.
        """
        known: dict[int, tuple[str, Bounds]] = {}
        for place, rule in found.items():
            if (bounded := bounds(rule)) is None:
                continue
            name, own = bounded
            possible = self.varied.get(name, Bounds(low=0.0) if name in COUNTS else Bounds())
            if not own.within(possible).are_met:
                what = f"a constraint that can hold: {name} is {_between(possible)}"
                yield place, what, rule.text
                continue
            for before, (other, theirs) in known.items():
                if _contradict(name, own, other, theirs):
                    both = f"{rule.text} beside {found[before].text}"
                    yield place, "constraints that can hold together", both
            known[place] = name, own

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


def _contradict(name: str, own: Bounds, other: str, theirs: Bounds) -> bool:
    """Whether no design meets both: a smallest value is never above the largest one."""
    if name == other:
        return not own.within(theirs).are_met
    for (low, least), (high, most) in (
        ((name, own), (other, theirs)),
        ((other, theirs), (name, own)),
    ):
        if (low, high) in ORDERED:
            between = Bounds(least.low, most.high, least.has_low, most.has_high)
            return not between.are_met
    return False


def _between(possible: Bounds) -> str:
    if not np.isfinite(possible.high):
        return f"{possible.low:g} or more"
    return f"from {possible.low:g} to {possible.high:g}"
