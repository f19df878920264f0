"""Folds of equilibria in extended precision: where the state of a pushed finger ends.

Along the path of equilibria one unknown q is held, and the load λ follows from the others: at the
fold dλ/dq is zero, which the secant method finds (our derivation).
"""

from dataclasses import field
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dpgcli.arrays import Array
from dpgcli.mechanics.finger import Finger
from dpgcli.records import dataclass
from dpgcli.reference.energy import ElasticBars
from dpgcli.reference.equilibria import (
    Energy,
    ExtendedArray,
    digits_lost,
    energy_of,
    extended,
    factorize,
    long_doubles,
    pushed,
    solved,
)
from dpgcli.reference.units import Unit, extended_units
from dpgcli.reference.vectors import cells, corners

if TYPE_CHECKING:
    from mpmath import mpf

GUARD_DIGITS = 40  # the Hessian is singular at a fold
MOST_CORRECTIONS, MOST_SECANTS = 20, 12
FIRST_SECANT = 1e-6  # of the unknowns' scale
SMALLEST_SECANT = 1e-20  # of the unknowns' scale: the load is then known to its square


class ExtendedFold(NamedTuple):
    """A fold: the share λ of the pushes there, and tip x, y (mm) and angle (rad), (3,)."""

    share: np.longdouble
    pose: ExtendedArray


class _Point(NamedTuple):
    """An equilibrium on the path: unknowns, λ and dλ/dq."""

    unknowns: list["mpf"]
    share: "mpf"
    slope: "mpf"


@dataclass
class _Path:
    """Equilibria of a finger under λ times some pushes, (unit,) in N, by one of its unknowns."""

    finger: Finger
    units: list[Unit]
    pushes: Array
    walls: list["mpf"]
    tolerance: "mpf"
    held: int = field(default=0, init=False)

    @cached_property
    def unpushed(self) -> Energy:
        """The energy under no pushes."""
        return energy_of(self.finger, self.units, self.walls)

    @cached_property
    def fully_pushed(self) -> Energy:
        """The energy where λ = 1."""
        return energy_of(self.finger, pushed(self.units, self.pushes), self.walls)

    def _motions(self, unknowns: list["mpf"], share: "mpf") -> tuple[list["mpf"], list["mpf"]]:
        """Newton's step under fixed pushes, and dx/dλ."""
        none, all_of = self.unpushed.at(unknowns), self.fully_pushed.at(unknowns)

        def between(one: "mpf", other: "mpf") -> "mpf":
            return one + share * (other - one)

        pairs = zip(none.band, all_of.band, strict=True)
        band = [list(map(between, *rows)) for rows in pairs]
        gradient = list(map(between, none.gradient, all_of.gradient))
        rate = [one - other for one, other in zip(none.gradient, all_of.gradient, strict=True)]
        factors = factorize(band, 0 * share)
        return solved(factors, [-part for part in gradient]), solved(factors, rate)

    def hold_the_fastest(self, unknowns: list["mpf"], share: "mpf") -> None:
        """Hold the unknown that changes most with λ."""
        rates = self._motions(unknowns, share)[1]
        self.held = max(range(len(rates)), key=lambda row: abs(rates[row]))

    def at(self, target: "mpf", unknowns: list["mpf"], share: "mpf") -> _Point | None:
        """The equilibrium where the unknown that is held is at a target; None if not found."""
        for _ in range(MOST_CORRECTIONS):
            step, rates = self._motions(unknowns, share)
            change = (target - unknowns[self.held] - step[self.held]) / rates[self.held]
            step = [part + change * rate for part, rate in zip(step, rates, strict=True)]
            if max(map(abs, step)) <= self.tolerance * self.unpushed.scale:
                return _Point(unknowns, share, 1 / rates[self.held])
            unknowns = [value + part for value, part in zip(unknowns, step, strict=True)]
            share += change
        return None


def extended_fold(
    finger: Finger, pushes: Array, nodes: Array, walls: Array | None = None, digits: int = 50
) -> ExtendedFold | None:
    """Find the fold next to a shape, by the share λ of some pushes at which it is.

    `pushes` (unit,) in N all grow with λ, and are about right at λ = 1; `nodes` (4 n,) and `walls`
    (unit,), in mm, are the shape. None if nothing is found.

    >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
    >>> unit = uniform_finger(1, **STUDY)  # it bears 4.72618 N
    >>> shape = np.array([13.5, 0.0, 14.3, 10.75])
    >>> fold = extended_fold(unit, np.array([4.7]), shape)
    >>> print(f"{4.7 * fold.share:.5f}")
    4.72618
    """
    import mpmath

    lost = digits_lost(finger)
    with mpmath.workdps(digits + lost + GUARD_DIGITS):
        yielded = np.zeros(finger.n_units) if walls is None else walls
        tolerance = mpmath.mpf(10) ** -(digits // 2 + 5)
        path = _Path(finger, extended_units(finger), pushes, extended(yielded), tolerance)
        try:
            found = _fold(path, path.unpushed.unknowns(extended(nodes)))
        except (ZeroDivisionError, ValueError):  # a mechanism, or nodes that coincide
            found = None
        if found is None:
            return None
        at = path.unpushed.nodes(found.unknowns)
        shape = cells(ElasticBars(path.units).base, at)
        turned = -sum(angle for cell in shape for angle in corners(cell))
        return ExtendedFold(long_doubles([found.share])[0], long_doubles([at[-4], at[-3], turned]))


def _fold(path: _Path, unknowns: list["mpf"]) -> _Point | None:
    """The point where dλ/dq is zero, next to some unknowns at λ = 1."""
    from mpmath import mpf

    one = mpf(1)
    path.hold_the_fastest(unknowns, one)
    scale = path.unpushed.scale
    before = path.at(unknowns[path.held], unknowns, one)
    if before is None:
        return None
    here = path.at(before.unknowns[path.held] + FIRST_SECANT * scale, before.unknowns, before.share)
    for _ in range(MOST_SECANTS):
        if here is None or here.slope == before.slope:
            return None
        at, last = here.unknowns[path.held], before.unknowns[path.held]
        step = -here.slope * (at - last) / (here.slope - before.slope)
        if abs(step) <= SMALLEST_SECANT * scale:
            return here
        before, here = here, path.at(at + step, here.unknowns, here.share)
    return None
