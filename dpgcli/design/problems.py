"""Problems of designs: masks of those that have one, and words, made only if asked for."""

from collections.abc import Callable
from dataclasses import field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dpgcli.arrays import Flags
from dpgcli.errors import Problem
from dpgcli.records import dataclass
from dpgcli.text import KeyPath, dotted


class Issue(NamedTuple):
    """A mistake between keys: the key to look at, and the words of a problem."""

    path: KeyPath
    expected: str
    found: str
    hint: str = ""

    @property
    def statement(self) -> str:
        """The problem in one line."""
        return Problem("", None, None, dotted(self.path), *self[1:]).statement


@dataclass
class Problems:
    """Issues of a batch of designs, in the order in which they were met."""

    met: list[tuple[Flags, Callable[[int], Issue]]] = field(default_factory=list)

    def add(self, where: Flags, issue: Callable[[int], Issue]) -> None:
        """Note what is wrong `where` (design,), or (1,) for all; `issue` words it for a design."""
        if where.any():
            self.met.append((where, issue))

    def everywhere(self, issue: Issue) -> None:
        """Note what is wrong with every design."""
        self.add(np.ones(1, bool), lambda _: issue)

    def are_met(self, n_designs: int) -> Flags:
        """Designs with any problem, (design,)."""
        wrong = np.zeros(n_designs, bool)
        for where, _ in self.met:
            wrong |= where
        return wrong

    def of(self, design: int) -> list[Issue]:
        """The issues of one design."""
        return [issue(design) for where, issue in self.met if of_design(where, design)]


def of_design(values: NDArray[Any], design: int) -> float:
    """The value of one design among those of a batch, (design,) or (1,) for all; its real part."""
    return float(np.real(values[design if len(values) > 1 else 0]))


def number(value: float) -> str:
    """A number as messages show it."""
    return f"{value:.10g}"
