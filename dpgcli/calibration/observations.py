"""What of known states a fit is to meet, each quantity over its error.

Quantities of different units are weighted by their errors: those that the user states, or those
that a first fit, which takes every quantity by its size, leaves in it (feasible generalized least
squares, Greene, Econometric Analysis, 2012, section 9.3).
"""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from dpgcli.arrays import COMPLEX_STEP, Array, Flags
from dpgcli.calibration.choices import Target
from dpgcli.calibration.known import Frame, KnownStates, LatticeStates
from dpgcli.records import dataclass
from dpgcli.states.sensitivities import Sensitivities

SMALLEST_ERROR = 0.01  # of a quantity's size: no model is known to be better
FIELDS = {  # of known states, and of the lattice's
    Target.TIPS: "tip",
    Target.ANGLES: "angles",
    Target.OPENINGS: "openings",
    Target.PUSHES: "pushes",
}
UNITS = {Target.TIPS: "mm", Target.ANGLES: "rad", Target.OPENINGS: "mm", Target.PUSHES: "N"}


@dataclass(frozen=True)
class Observations:
    """Some quantities of known states, one after the other; `errors` by quantity, in its unit.

    Openings and pushes are those of inverted units, and openings of all units under a moment.
    """

    known: KnownStates
    frame: Frame
    targets: tuple[Target, ...]
    errors: Mapping[Target, float]

    def residual(self, states: LatticeStates) -> Array:
        """Predicted less known over its error, (point,)."""
        return self._joined(
            [
                (getattr(states, FIELDS[target]) - self.of(target))[self.given(target)]
                for target in self.targets
            ]
        )

    def jacobian(self, states: LatticeStates, found: Sensitivities) -> Array:
        """Derivatives of the residuals by each direction of `found`, (point, direction)."""
        slopes = {
            Target.ANGLES: found.strut_angles,
            Target.OPENINGS: found.openings,
            Target.PUSHES: found.pushes,
        }
        if Target.TIPS in self.targets:
            moved = states.pose[:, None] + 1j * COMPLEX_STEP * found.pose
            slopes[Target.TIPS] = self.frame.tips(moved).imag / COMPLEX_STEP
        parts = [slopes[target].transpose(0, 2, 1)[self.given(target)] for target in self.targets]
        return self._joined(parts)

    def deflections(self, straight: Array) -> Array:
        """What is known, less that of the finger at rest with this pose (3, 1), over its error."""
        rest = {Target.TIPS: self.frame.tips(straight)}
        parts = [
            (self.of(target) - rest.get(target, np.zeros((1, 1))))[self.given(target)]
            for target in self.targets
        ]
        return self._joined(parts)

    def of(self, target: Target) -> Array:
        """The known values of a quantity, (…, state)."""
        return np.asarray(getattr(self.known, FIELDS[target]))

    def given(self, target: Target) -> Flags:
        """Which of a quantity's values are known and count, (…, state)."""
        is_known = np.isfinite(self.of(target))
        if target is Target.PUSHES:
            return np.asarray(is_known & self.known.patterns)
        if target is Target.OPENINGS:
            return np.asarray(is_known & (self.known.patterns | (self.known.moments != 0.0)))
        return np.asarray(is_known)

    def by_target(self, points: Array) -> Iterator[tuple[Target, Array]]:
        """The part of an array (point, …) that each quantity has, in its unit."""
        first = 0
        for target in self.targets:
            stop = first + int(self.given(target).sum())
            yield target, points[first:stop] * self.errors.get(target, 1.0)
            first = stop

    def _joined(self, parts: Sequence[Array]) -> Array:
        weighted = zip(self.targets, parts, strict=True)
        return np.concatenate([part / self.errors.get(target, 1.0) for target, part in weighted])


def targets_for(known: KnownStates, *, with_walls: bool) -> tuple[Target, ...]:
    """What is fitted if nothing is named: shapes, and with walls also what is known of forces.

    Tips say more than angles, but hardly turn under a moment: then it is angles.
    """
    tips = np.isfinite(known.tip).all(axis=0)
    wants_angles = not tips.any() or (known.moments.any() and np.isfinite(known.angles).any())
    shape = Target.ANGLES if wants_angles and np.isfinite(known.angles).any() else Target.TIPS
    if not with_walls:
        return (shape,)
    seen = Observations(known, Frame(), (), {})
    return (shape, *(t for t in (Target.OPENINGS, Target.PUSHES) if seen.given(t).any()))


def residual_unit(targets: tuple[Target, ...]) -> str:
    """The unit of residuals: that of the one quantity, or the errors of several."""
    return UNITS[targets[0]] if len(targets) == 1 else "of the errors"


def rms(values: Array) -> float:
    """Root mean square."""
    return float(np.sqrt((values**2).mean()))
