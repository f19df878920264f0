"""Lattice values from known states of a finger: least squares through the equilibrium.

The residuals are those of states that are solved and certified at every trial; their derivatives
are exact (`states.sensitivities`).
"""

from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dpgcli.arrays import Array, Flags
from dpgcli.calibration.choices import COUPLING, HINGES, LEVER, WALLS, Loss, Target
from dpgcli.calibration.comparison import Comparison, compare, frame_misfit
from dpgcli.calibration.fits import Fit, fit
from dpgcli.calibration.known import Frame, KnownStates, LatticeStates, lattice_states
from dpgcli.calibration.observations import SMALLEST_ERROR, Observations, rms
from dpgcli.calibration.search import Parameter
from dpgcli.design.coupling import is_bounded
from dpgcli.errors import Field, FitError, Message
from dpgcli.mechanics.finger import KEYS, Finger
from dpgcli.records import dataclass
from dpgcli.states.certify import Status
from dpgcli.states.patterns import texts
from dpgcli.states.sensitivities import sensitivities

EDGE_FRACTION = 1e-3  # of a value: ending so close to where a state ceases to exist is no fit
LARGEST_YIELD = 1e3  # times the start of walls: next to nothing holds them
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


FIRST_YIELD = 0.1  # of H²/k_θ, what a hinge yields at the dome's axis, or 1/k_b without one
FIRST_COUPLING, LARGEST_COUPLING = 0.01, 0.499  # of k_θ, where the search begins and may end
TOGETHER = (HINGES, WALLS, LEVER)  # of an opened gap: each may stand for the others
NEARLY_ALIKE = 1e-2  # of unit columns: a smaller singular value is nearly none
ALIKE = 0.95  # correlation: beyond it data hardly tell values apart
TELL_APART = (
    "turns under an end moment tell hinges and walls apart: rows with moment_N_mm, of a ground "
    "unit for the hinge and of an inverted one for both"
)


@dataclass(frozen=True)
class FingerFit:
    """Fits values, the same in all units, to quantities of known states.

    `free` names values by the keys of `mechanics.finger.KEYS`; the finger has the others, and
    where to start. `errors` are those that quantities are taken to have, in mm, rad or N; of
    several quantities those that have none get one that is estimated, see `observations`.
    Raises FitError where units differ in a free value.
    """

    finger: Finger
    known: KnownStates
    frame: Frame
    free: tuple[str, ...]
    targets: tuple[Target, ...] = (Target.TIPS,)
    loss: Loss = Loss.LINEAR
    loss_scale: float | None = None
    errors: Mapping[Target, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        values = {key: getattr(self.finger, array) for key, array in KEYS.items()}
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
            if key == COUPLING and not self.finger.hinge_stiffness.all():
                raise FitError(Field("free"), f" {key}: hinges have no stiffness to couple")

    def fit(self, resamples: int = 0, seed: int = 0) -> Fit:
        """The least-squares fit.

        Raises FitError where the finger lacks a known state to start with, where the data have
        nothing to fit to, and as `fits.fit` does.
        """
        self._check_start()
        try:
            found = self._fit(self.observations, resamples, seed)
            self._check_apart(found)
            self._check_bounded(found)
        except FitError as error:
            if {WALLS, HINGES} <= {*self.free} and "apart" in error.message:
                raise FitError(f"{error.message}; {TELL_APART}") from None
            raise
        return replace(found, warnings=(*found.warnings, *self._edges(found), *_alike(found)))

    def _check_apart(self, found: Fit) -> None:
        """Raise FitError where a bound hides that data do not tell these values apart."""
        places = [i for i, p in enumerate(found.parameters) if p.is_free and p.key in TOGETHER]
        if not found.at_bound[places].any():
            return
        slopes = self._slopes(self.observations, found.values)[:, places]
        size = np.sqrt((slopes**2).sum(axis=0))
        least = np.linalg.svd(slopes / np.where(size > 0.0, size, 1.0), compute_uv=False)[-1]
        if least < NEARLY_ALIKE:
            keys = " and ".join(found.parameters[place].key for place in places)
            raise FitError(f"the data cannot tell {keys} apart: fix one of them")

    def _check_bounded(self, found: Fit) -> None:
        """Raise FitError where hinges and their neighbors would run away together."""
        finger = self.finger.with_values(found.by_key)
        if not is_bounded(finger.hinge_coupling, finger.hinge_stiffness).all():
            raise FitError(
                f"{COUPLING} ended at {float(finger.hinge_coupling[0, 0]):g}, half of {HINGES} or "
                "more: the data do not know it, fix it"
            )

    def _fit(self, observed: Observations, resamples: int = 0, seed: int = 0) -> Fit:
        return fit(
            self._parameters,
            lambda values: observed.residual(self._states(values)),
            lambda values: self._slopes(observed, values),
            observed=observed.deflections(self._straight),
            loss=self.loss,
            loss_scale=self.loss_scale,
            resamples=resamples,
            seed=seed,
        )

    def _slopes(self, observed: Observations, values: Array) -> Array:
        """Derivatives of the residuals by all values, (point, value); 0 by those that are held."""
        states = self._states(values)
        free = [place for place, p in enumerate(self._parameters) if p.is_free]
        steps = [{KEYS[self._parameters[place].key]: np.ones((1, 1))} for place in free]
        slopes = observed.jacobian(states, sensitivities(states.settled, steps))
        whole = np.zeros((len(slopes), len(self._parameters)))
        whole[:, free] = slopes
        return whole

    @cached_property
    def observations(self) -> Observations:
        """What is to be met, every quantity over its error; one alone is not weighted."""
        plain = Observations(self.known, self.frame, self.targets, {})
        stated = replace(plain, errors=self.errors)
        wanted = [target for target in self.targets if target not in self.errors]
        if len(self.targets) == 1 or not wanted:
            return stated
        deflections = dict(plain.by_target(plain.deflections(self._straight)))
        sizes = {target: rms(deflections[target]) or 1.0 for target in wanted}
        by_size = replace(plain, errors={**self.errors, **sizes})
        left = dict(by_size.by_target(self._fit(by_size).residuals))
        estimated = {t: max(rms(left[t]), SMALLEST_ERROR * sizes[t]) for t in wanted}
        return replace(plain, errors={**self.errors, **estimated})

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
        left_out = np.full(self.known.patterns.shape[1], np.nan)
        errors = self.observations.errors
        for state in np.flatnonzero(np.isfinite(self.compared(None).relative)):
            others = np.delete(np.arange(len(left_out)), state)
            with suppress(FitError):
                found = replace(self, known=self.known.chosen(others), errors=errors).fit()
                left_out[state] = self.compared(found).relative[state]
        return left_out

    @property
    def _straight(self) -> Array:
        """The pose (3, 1) of the straight finger: R² is that of the deflections."""
        return np.array([self.finger.straight_length, [0.0], [0.0]])

    @cached_property
    def _parameters(self) -> tuple[Parameter, ...]:
        """Values that all units share, the infinite ones left out."""
        values = {key: getattr(self.finger, array) for key, array in KEYS.items()}
        stiffest = float(self.finger.bistable_stiffness.max())
        parameters = [
            _parameter(key, float(value[0, 0]), key in self.free, stiffest)
            for key, value in values.items()
            if key not in (WALLS, COUPLING)
            and value.size == 1
            and np.isfinite(value).all()
            and self._has(key)
        ]
        walls = self.finger.wall_compliance
        if WALLS in self.free or (walls.size == 1 and walls.any()):
            parameters.append(self._walls(float(walls[0, 0])))
        if COUPLING in self.free or self.finger.hinge_coupling.any():
            parameters.append(self._coupling(float(self.finger.hinge_coupling[0, 0])))
        return tuple(parameters)

    def _walls(self, start: float) -> Parameter:
        """Walls may turn out to be rigid; those that are rigid begin with what a hinge yields."""
        finger = self.finger
        stiffness = finger.hinge_stiffness / finger.segment_height**2
        holds = stiffness if stiffness.any() else finger.bistable_stiffness
        begin = start or FIRST_YIELD / float(holds.max())
        is_free = WALLS in self.free
        return Parameter(WALLS, begin if is_free else start, 0.0, LARGEST_YIELD * begin, is_free)

    def _coupling(self, start: float) -> Parameter:
        """Hinges may turn out not to turn each other; the sign is that of the data."""
        hinge = float(self.finger.hinge_stiffness.min())
        most, is_free = LARGEST_COUPLING * hinge, COUPLING in self.free
        begin = start or FIRST_COUPLING * hinge
        return Parameter(COUPLING, begin if is_free else start, -most, most, is_free)

    def _has(self, key: str) -> bool:
        """A law with a curve of its own has no force linearity."""
        return key != "force_linearity" or self.finger.law.curve is None

    def _states(self, values: Array) -> LatticeStates:
        """The states at a trial; those of the last one are kept for its derivatives."""
        key = values.tobytes()
        if self._last.get("key") != key:
            keys = (parameter.key for parameter in self._parameters)
            changed = self.finger.with_values(dict(zip(keys, values.tolist(), strict=True)))
            states = lattice_states(changed, self.known.patterns, self.frame, self.known.moments)
            self._last.update(key=key, states=states)
        last: LatticeStates = self._last["states"]
        return last

    @cached_property
    def _last(self) -> dict[str, Any]:
        return {}

    def _check_start(self) -> None:
        observed = Observations(self.known, self.frame, self.targets, {})
        if lacking := [target for target in self.targets if not observed.given(target).any()]:
            raise FitError(f"the data have no {' and no '.join(lacking)} to fit to")
        states = lattice_states(self.finger, self.known.patterns, self.frame, self.known.moments)
        missing = _missing(self.known.patterns, states.status)
        if missing:
            raise FitError(f"at the start not every known state exists: {', '.join(missing)}")


def _alike(found: Fit) -> Iterator[str]:
    """A warning of hinges and walls that the data hardly tell apart."""
    keys = [parameter.key for parameter in found.parameters]
    if {HINGES, WALLS} <= {*keys}:
        together = float(found.correlation[keys.index(HINGES), keys.index(WALLS)])
        if abs(together) > ALIKE:
            yield f"hinges and walls are correlated by {together:.3f}: {TELL_APART}"


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
