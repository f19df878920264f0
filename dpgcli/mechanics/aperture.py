"""A force between two plates by their aperture, from points: what keeps jaws apart."""

from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np

from dpgcli.arrays import Array, Flags, Indices
from dpgcli.equilibrium.contracts import Response, take_lanes
from dpgcli.records import dataclass

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

FEWEST_POINTS = 2
STEEPER = 4.0  # than between any two points: a slope of a cubic is at most three times as steep
SEEN = 2.0  # times the shortest range: steps of a path are a tenth of that, a quarter at most


class Softening(NamedTuple):
    """Of forces that rise and fall: what is far beside either's ranges, mm; a stiffness, N/mm.

    It is beyond that of all of them.
    """

    scale: float
    stiffness: float


@dataclass(frozen=True, eq=False)
class ForceCurve:
    """Forces F (N) that keep plates apart by rising apertures a (mm), (point,) each.

    Between points F is a cubic whose slope is continuous and that rises and falls as the points
    do, so that it has no extremes of its own (Fritsch and Butland, SIAM J. Sci. Stat. Comput. 5,
    300, 1984); beyond them it is straight. Raises ValueError for fewer than two points, or
    apertures that do not rise.

    >>> curve = ForceCurve(np.array([10.0, 20.0]), np.array([1.0, 0.0]))
    >>> energy, force, stiffness = curve.response(np.array([12.0, 25.0]))
    >>> force.tolist(), stiffness.tolist()  # the slope of an energy that falls as plates open
    ([-0.8, 0.5], [0.1, 0.1])
    """

    gap: Array
    force: Array

    def __post_init__(self) -> None:
        if len(self.gap) < FEWEST_POINTS or np.any(np.diff(self.gap) <= 0.0):
            raise ValueError(f"gap: expected {FEWEST_POINTS} or more rising apertures: {self.gap}")

    @cached_property
    def _energy(self) -> "PPoly":
        """∫F da."""
        from scipy.interpolate import PchipInterpolator, PPoly

        inner = PchipInterpolator(self.gap, self.force)
        (first, last), (begin, end) = self.gap[[0, -1]], inner(self.gap[[0, -1]], 1)
        before = [[0.0], [0.0], [begin], [self.force[0] - begin]]
        after = [[0.0], [0.0], [end], [self.force[-1]]]
        pieces = np.concatenate((before, inner.c, after), axis=1)
        return PPoly(pieces, [first - 1.0, *inner.x, last + 1.0]).antiderivative()

    def response(self, gap: Array) -> Response:
        """E = −∫F da (N mm, but for a constant), dE/da = −F (N) and −dF/da (N/mm)."""
        return Response(*(-self._energy(gap, order) for order in range(3)))

    def is_beyond(self, gap: Array) -> Flags:
        """Whether apertures are beyond the points."""
        return np.asarray((gap < self.gap[0]) | (gap > self.gap[-1]))

    @property
    def not_falling(self) -> tuple[tuple[float, float], ...]:
        """Ranges of apertures in which the force does not fall as plates open.

        >>> force = np.array([3.0, 1.0, 2.0, 2.0, 0.0])
        >>> ForceCurve(np.arange(5.0), force).not_falling
        ((1.0, 3.0),)
        """
        edges = np.flatnonzero(np.diff(np.diff(self.force, prepend=np.inf, append=-np.inf) >= 0.0))
        return tuple((float(a), float(b)) for a, b in self.gap[edges].reshape(-1, 2))

    @cached_property
    def softening(self) -> "Softening | None":
        """How forces that do not fall everywhere soften; None if they do."""
        if not self.not_falling:
            return None
        turns = np.array([self.gap[0], *np.ravel(self.not_falling), self.gap[-1]])
        stretches = np.diff(turns)
        steepest = np.abs(np.diff(self.force) / np.diff(self.gap)).max()
        shortest = float(stretches[stretches > 0.0].min())
        return Softening(SEEN * shortest, STEEPER * float(steepest))


@dataclass(frozen=True)
class KeptApart:
    """The energy of a `ForceCurve` by how far plates have opened from `rest`, (1 or batch,), mm."""

    curve: ForceCurve
    rest: Array

    def __call__(self, scalar: Array) -> Response:
        """Energy, force and stiffness."""
        return self.curve.response(self.rest + scalar)

    def take_lanes(self, index: Indices) -> Self:
        """The same law for some lanes of the batch."""
        return type(self)(self.curve, take_lanes(self.rest, index))
