"""Lattice values from known states of a finger: least squares through the equilibrium.

The residuals are those of states that are solved and certified at every trial; their derivatives
are exact (`states.sensitivities`).
"""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dpgcli.arrays import COMPLEX_STEP, Array, Flags
from dpgcli.calibration.choices import Loss, Target
from dpgcli.calibration.comparison import Comparison, compare, frame_misfit
from dpgcli.calibration.fits import Fit, fit
from dpgcli.calibration.known import Frame, KnownStates, LatticeStates, lattice_states
from dpgcli.calibration.search import Parameter
from dpgcli.errors import Field, FitError, Message
from dpgcli.mechanics.finger import KEYS, Finger
from dpgcli.states.certify import Status
from dpgcli.states.patterns import texts
from dpgcli.states.sensitivities import sensitivities

EDGE_FRACTION = 1e-3  # of a value: ending so close to where a state ceases to exist is no fit
LARGEST_FACTOR = 5.0  # between the start and a bound: beyond it a value means nothing
LARGE_ERROR = 0.3  # of the deflection
LARGE_ERROR_WARNING = Message(
    "tips are still off by more than 30 % of the deflection: look at ",
    Field("first_station"),
    ", ",
    Field("tip_offset"),
    ", units, and the sign of y (inverted units curl towards -y)",
)
BAR_STIFFNESS_RATIOS = (
    1.0,
    1e11,
)  # times the stiffest bistable spring: bounds of the bars' stiffness


@dataclass(frozen=True)
class FingerFit:
    """Fits values, the same in all units, to known tips (mm) or angles of phalanges (rad).

    `free` names values by the keys of `mechanics.finger.KEYS`; the finger has the others, and
    where to start. Raises FitError where units differ in a free value.
    """

    finger: Finger
    known: KnownStates
    frame: Frame
    free: tuple[str, ...]
    target: Target = Target.TIPS
    loss: Loss = Loss.LINEAR
    loss_scale: float | None = None

    def __post_init__(self) -> None:
        fitted = {key: array for key, array in KEYS.items() if array != "wall_compliance"}
        values = {key: getattr(self.finger, array) for key, array in fitted.items()}
        for key in self.free:
            if key not in values or not self._has(key):
                known = ", ".join(filter(self._has, values))
                raise FitError(Field("free"), f" {key}: expected one of {known}")
            if values[key].size > 1:
                raise FitError(
                    Field("free"), f" {key}: units differ in it, expected one value for all"
                )
            if not np.isfinite(values[key]).all():
                raise FitError(Field("free"), f" {key}: is infinite, start from a finite value")

    def fit(self, resamples: int = 0, seed: int = 0) -> Fit:
        """The least-squares fit.

        Raises FitError where the finger lacks a known state to start with, where the data have
        nothing to fit to, and as `fits.fit` does.
        """
        self._check_start()
        found = fit(
            self._parameters,
            self._residual,
            self._jacobian,
            observed=(self._observed - self._straight)[self._given],
            loss=self.loss,
            loss_scale=self.loss_scale,
            resamples=resamples,
            seed=seed,
        )
        return replace(found, warnings=(*found.warnings, *self._edges(found)))

    def _edges(self, found: Fit) -> Iterator[str]:
        """Warnings of values at the edge of existence of a known state."""
        for place, parameter in enumerate(found.parameters):
            for step in (1.0 - EDGE_FRACTION, 1.0 + EDGE_FRACTION) if parameter.is_free else ():
                values = found.values.copy()
                values[place] *= step
                if lost := _missing(self.known.patterns, self._states(values).status):
                    yield (
                        f"{parameter.key} ended at {found.values[place]:g}, next to where known "
                        f"states cease to exist ({', '.join(lost)}): the search can go no "
                        "further, and its standard error may mean nothing"
                    )

    def judgments(self, found: Fit) -> Iterator[str]:
        """Warnings about a fit and its data."""
        yield from found.warnings
        if misfit := frame_misfit(self.finger, self.known, self.compared(None), self.frame):
            yield misfit
        elif np.nanmax(self.compared(found).relative, initial=0.0) > LARGE_ERROR:
            yield LARGE_ERROR_WARNING
        if self.known.unused:
            yield f"columns not used: {', '.join(self.known.unused)}"

    def compared(self, found: Fit | None) -> Comparison:
        """The states beside the known ones: as the finger is, or as it was fitted."""
        finger = self.finger if found is None else self.finger.with_values(found.by_key)
        return compare(finger, self.known, self.frame)

    @cached_property
    def left_out(self) -> Array:
        """Relative errors (state,) of tips, each predicted by a fit to the other states.

        NaN for states that hardly move, and where the others do not suffice.
        """
        errors = np.full(self.known.patterns.shape[1], np.nan)
        for state in np.flatnonzero(np.isfinite(self.compared(None).relative)):
            others = np.delete(np.arange(len(errors)), state)
            with suppress(FitError):
                found = replace(self, known=self.known.chosen(others)).fit()
                errors[state] = self.compared(found).relative[state]
        return errors

    @cached_property
    def _observed(self) -> Array:
        return self.known.tip if self.target == Target.TIPS else self.known.angles

    @cached_property
    def _straight(self) -> Array:
        """The observations of the straight finger, (…, 1): R² is that of the deflections."""
        if self.target == Target.ANGLES:
            return np.zeros((1, 1))
        return self.frame.tips(np.array([self.finger.straight_length, [0.0], [0.0]]))

    @cached_property
    def _given(self) -> Flags:
        return np.isfinite(self._observed)

    @cached_property
    def _parameters(self) -> tuple[Parameter, ...]:
        """Values that all units share, the infinite ones left out."""
        values = {key: getattr(self.finger, array) for key, array in KEYS.items()}
        stiffest = float(self.finger.bistable_stiffness.max())
        return tuple(
            _parameter(key, float(value[0, 0]), key in self.free, stiffest)
            for key, value in values.items()
            if value.size == 1 and np.isfinite(value).all() and self._has(key)
        )

    def _has(self, key: str) -> bool:
        """A law with a curve of its own has no force linearity."""
        return key != "force_linearity" or self.finger.law.curve is None

    def _states(self, values: Array) -> LatticeStates:
        """The states at a trial; those of the last one are kept for its derivatives."""
        key = values.tobytes()
        if self._last.get("key") != key:
            keys = (parameter.key for parameter in self._parameters)
            changed = self.finger.with_values(dict(zip(keys, values.tolist(), strict=True)))
            states = lattice_states(changed, self.known.patterns, self.frame)
            self._last.update(key=key, states=states)
        last: LatticeStates = self._last["states"]
        return last

    @cached_property
    def _last(self) -> dict[str, Any]:
        return {}

    def _residual(self, values: Array) -> Array:
        states = self._states(values)
        found = states.tip if self.target == Target.TIPS else states.angles
        return np.asarray((found - self._observed)[self._given])

    def _jacobian(self, values: Array) -> Array:
        """Derivatives of the fitted observations by the values, (point, value)."""
        states = self._states(values)
        free = [place for place, p in enumerate(self._parameters) if p.is_free]
        steps = [{KEYS[self._parameters[place].key]: np.ones((1, 1))} for place in free]
        found = sensitivities(states.settled, steps)
        slopes = found.strut_angles
        if self.target == Target.TIPS:
            moved = states.pose[:, None] + 1j * COMPLEX_STEP * found.pose
            slopes = self.frame.tips(moved).imag / COMPLEX_STEP
        jacobian = np.zeros((int(self._given.sum()), len(self._parameters)))
        jacobian[:, free] = slopes.transpose(0, 2, 1)[self._given]
        return jacobian

    def _check_start(self) -> None:
        if not self._given.any():
            raise FitError(f"the data have no {self.target} to fit to")
        states = lattice_states(self.finger, self.known.patterns, self.frame)
        missing = _missing(self.known.patterns, states.status)
        if missing:
            raise FitError(f"at the start not every known state exists: {', '.join(missing)}")


def _missing(patterns: Flags, status: NDArray[np.uint8]) -> list[str]:
    """Patterns that have no certified state, and why."""
    return [
        f"{pattern.decode()} is {Status(number).text}"
        for pattern, number in zip(texts(patterns), status, strict=True)
        if number != Status.STABLE
    ]


def _parameter(key: str, start: float, is_free: bool, stiffest: float) -> Parameter:
    bounds = {
        "force_linearity": (0.0, 1.0),
        "linear_stiffness_N_per_mm": (
            BAR_STIFFNESS_RATIOS[0] * stiffest,
            BAR_STIFFNESS_RATIOS[1] * stiffest,
        ),
    }
    lower, upper = bounds.get(key, (start / LARGEST_FACTOR, start * LARGEST_FACTOR))
    return Parameter(key, start, min(lower, start), max(upper, start), is_free)
