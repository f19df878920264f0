"""Lattice values from known states of a finger: least squares through the equilibrium.

The residuals are those of states that are solved and certified at every trial; their derivatives
are exact (`states.sensitivities`).
"""

from collections.abc import Sequence
from enum import StrEnum

import numpy as np

from dpgcli.arrays import Array, Flags
from dpgcli.calibration.fits import Fit, Loss, fit
from dpgcli.calibration.known import Frame, KnownStates, LatticeStates, lattice_states
from dpgcli.calibration.search import Parameter
from dpgcli.errors import FitError
from dpgcli.mechanics.finger import KEYS, Finger
from dpgcli.states.patterns import texts
from dpgcli.states.sensitivities import STEP, sensitivities
from dpgcli.states.solve import Status

WIDEST = 5.0  # times the start, up and down: beyond it a value has lost its meaning
BOUNDS = {"force_linearity": (0.0, 1.0), "linear_stiffness_N_per_mm": (1.0, 1e12)}


class Target(StrEnum):
    """What of the known states is met."""

    TIPS = "tips"
    ANGLES = "angles"


def fit_finger(
    finger: Finger,
    known: KnownStates,
    frame: Frame,
    free: Sequence[str],
    *,
    target: Target | str = Target.TIPS,
    loss: Loss | str = Loss.LINEAR,
    resamples: int = 0,
    seed: int = 0,
) -> Fit:
    """Fit values, the same in all units, to known tips (mm) or angles of phalanges (rad).

    `free` names values by the keys of `mechanics.finger.KEYS`; the finger has the others, and where
    to start. Raises FitError where units differ in a free value, where the finger lacks a known
    state to start with, and as `fits.fit` does.
    """
    target = Target(target)
    values = {key: getattr(finger, array) for key, array in KEYS.items()}
    _check(values, free)
    shared = [key for key, value in values.items() if value.size == 1 and np.isfinite(value).all()]
    parameters = [_parameter(key, float(values[key][0, 0]), key in free) for key in shared]
    observed = known.tip if target is Target.TIPS else known.angles
    given = np.isfinite(observed)
    if not given.any():
        raise FitError(f"the data have no {target} to fit to")

    def solved(trial: Array) -> LatticeStates:
        changed = finger.with_values(dict(zip(shared, trial.tolist(), strict=True)))
        return lattice_states(changed, known.patterns, frame)

    def residual(trial: Array) -> Array:
        states = solved(trial)
        found = states.tip if target is Target.TIPS else states.angles
        return np.asarray((found - observed)[given])

    def jacobian(trial: Array) -> Array:
        return _slopes(solved(trial), shared, frame, target, given)

    _check_start(finger, known, frame)
    return fit(
        parameters,
        residual,
        jacobian,
        observed=observed[given],
        loss=loss,
        resamples=resamples,
        seed=seed,
    )


def _check(values: dict[str, Array], free: Sequence[str]) -> None:
    for key in free:
        if key not in values:
            raise FitError(f"{key}: expected one of {', '.join(values)}")
        if values[key].size > 1:
            raise FitError(f"{key}: units differ in it, expected one value for all")
        if not np.isfinite(values[key]).all():
            raise FitError(f"{key}: is infinite, give it a finite value to start from")


def _parameter(key: str, start: float, is_free: bool) -> Parameter:
    lower, upper = BOUNDS.get(key, (start / WIDEST, start * WIDEST))
    return Parameter(key, start, lower, upper, is_free)


def _check_start(finger: Finger, known: KnownStates, frame: Frame) -> None:
    states = lattice_states(finger, known.patterns, frame)
    missing = [
        f"{pattern.decode()} is {Status(status).text}"
        for pattern, status in zip(texts(known.patterns), states.status, strict=True)
        if status != Status.STABLE
    ]
    if missing:
        raise FitError(f"at the start not every known state exists: {', '.join(missing)}")


def _slopes(
    states: LatticeStates, keys: Sequence[str], frame: Frame, target: Target, given: Flags
) -> Array:
    """Derivatives of what is fitted, (point, value)."""
    found = sensitivities(states.batch, [{KEYS[key]: np.ones((1, 1))} for key in keys])
    if target is Target.ANGLES:
        slopes = found.strut_angles
    else:
        slopes = frame.tips(states.pose[:, None] + 1j * STEP * found.pose).imag / STEP
    return np.asarray(slopes.transpose(0, 2, 1)[given])
