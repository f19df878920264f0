"""A mechanism between the fingers: a force against closing, and the rest that it finds with them.

Its force by the aperture is F = k (a_0 − a), that of the fingers the squeeze of a path of jaws up
to where a first unit resets. One measured force gives k, for a rest aperture a_0 that is known;
then the others are predictions.
"""

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import brentq

from dpgcli.arrays import Array
from dpgcli.grasping.jaws import JawPath
from dpgcli.records import dataclass

STUDY = {"11100": 0.91, "11111": 1.28}  # N, measured on a two-bar mechanism of unknown sizes


@dataclass(frozen=True)
class Branch:
    """Squeeze (N) of a state by the aperture (mm) before any unit resets: points and slopes."""

    gap: Array
    squeeze: Array
    stiffness: Array

    @classmethod
    def of(cls, path: JawPath, lane: int) -> "Branch":
        """The beginning of a lane's path, by rising apertures."""
        halts = [halt.step for halt in path.halts if halt.lane == lane]
        turn = len(path.gap) // 2 + 1
        known = ~np.isnan(path.squeeze[:turn, lane])
        stop = min([*halts, turn, *np.flatnonzero(~known)])
        rows = np.arange(stop)
        if path.gap[0] > path.gap[turn - 1]:
            rows = rows[::-1]  # they close first
        return cls(path.gap[rows], path.squeeze[rows, lane], path.stiffness[rows, lane])

    @property
    def force(self) -> CubicHermiteSpline:
        """Squeeze by the aperture."""
        return CubicHermiteSpline(self.gap, self.squeeze, self.stiffness)

    def where(self, stiffness: float, rest: float, force: float = 0.0) -> float | None:
        """The first aperture at which squeeze − `stiffness` (rest − a) − `force` is zero, or None.

        >>> branch = Branch(np.array([10.0, 20.0]), np.array([0.0, 1.0]), np.array([0.1, 0.1]))
        >>> branch.where(0.1, 30.0)  # 0.1 (a − 10) = 0.1 (30 − a)
        20.0
        """
        own = self.squeeze - stiffness * (rest - self.gap) - force
        signs = np.flatnonzero((own[:-1] < 0.0) & (own[1:] >= 0.0))
        if not len(signs):
            return None
        curve = self.force
        first, last = self.gap[signs[0]], self.gap[signs[0] + 1]

        def unbalance(gap: float) -> float:
            return float(curve(gap)) - stiffness * (rest - gap) - force

        return float(brentq(unbalance, first, last, xtol=1e-10))


@dataclass(frozen=True)
class Mechanism:
    """A linear mechanism: stiffness N/mm, and the aperture (mm) at which it exerts no force."""

    stiffness: float
    rest: float

    @classmethod
    def fitted(cls, branch: Branch, rest: float, force: float) -> "Mechanism | None":
        """That which a state holds with a force, N; None if it holds no such force below `rest`."""
        gap = branch.where(0.0, rest, force)
        if gap is None or gap >= rest:
            return None
        return cls(force / (rest - gap), rest)

    def force(self, branch: Branch) -> float | None:
        """The force with which a state holds it, N; None where a unit resets before."""
        gap = branch.where(self.stiffness, self.rest)
        return None if gap is None else self.stiffness * (self.rest - gap)
