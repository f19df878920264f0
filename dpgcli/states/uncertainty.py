"""Standard uncertainties of certified states: σ² = s C sᵀ, and what the model adds.

s are the derivatives of tip and aperture by what may be off, C its covariance (GUM, JCGM 100, 5.2).
"""

from collections.abc import Sequence

import numpy as np

from dpgcli.arrays import Array, total
from dpgcli.design.scene import MODEL, Gripper, Step, Uncertainty
from dpgcli.mechanics.finger import Finger
from dpgcli.records import dataclass
from dpgcli.states.certify import Settled
from dpgcli.states.sensitivities import Direction, sensitivities


@dataclass(frozen=True)
class Spread:
    """Standard uncertainties, (…, state).

    `pose` (3, state) of the tip's x, y (mm) and angle (rad); `aperture` (mm) in a gripper, else
    NaN; `shares` of the tip's place (mm) by cause: their squares add up to those of x and y.
    """

    pose: Array
    aperture: Array
    shares: dict[str, Array]


def spread(
    settled: Settled,
    pose: Array,
    known: Uncertainty,
    gripper: Gripper | None,
    layer_thickness: float | Array,
) -> Spread:
    """What the uncertainty comes to for states with this `pose` (3, state), to first order.

    Both fingers of a gripper have the same errors. The model's is of no known direction: a share of
    the deflection, equally in x and y.

    >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
    >>> from dpgcli.mechanics.terms import chain_potential
    >>> from dpgcli.states.settle import settle
    >>> from dpgcli.states.tip import tip
    >>> from dpgcli.states.units import UnitSolutions
    >>> units = UnitSolutions.of(uniform_finger(1, **STUDY))
    >>> one = settle(units, chain_potential, np.array([[True]]), 1e-12)
    >>> pose = tip(one, with_compliance=False).pose
    >>> found = spread(one, pose, Uncertainty((), np.eye(0), 0.05), None, 0.0)
    >>> deflection = np.hypot(pose[0] - 13.5, pose[1])
    >>> (found.shares["model_error"] / deflection).round(12), found.pose[2] / pose[2]
    (array([0.05]), array([-0.05]))
    """
    model = known.model_error * _deflections(settled, pose)
    slopes = _slopes(settled, known)
    variance = _variance(slopes, known.covariance)
    variance += np.stack((0.5 * model[0] ** 2, 0.5 * model[0] ** 2, model[1] ** 2))
    aperture = np.full(pose.shape[1], np.nan)
    if gripper is not None:
        by_pose = aperture_slopes(gripper, layer_thickness, pose)
        steps = total(by_pose[:, None] * slopes) if len(known.steps) else slopes[0]
        steps = steps + aperture_steps(gripper, layer_thickness, pose, known.steps)
        modeled = by_pose**2 * np.stack((0.5 * model[0] ** 2, 0.5 * model[0] ** 2, model[1] ** 2))
        aperture = np.sqrt(_variance(steps[None], known.covariance)[0] + total(modeled))
    return Spread(np.sqrt(variance), aperture, _shares(slopes, known, model[0]))


def _deflections(settled: Settled, pose: Array) -> Array:
    """How far tips are from the straight finger's, mm, and how far they turn, rad, (2, state)."""
    x, y, angle = pose
    return np.stack((np.hypot(x - settled.finger.straight_length, y), np.abs(angle)))


def _slopes(settled: Settled, known: Uncertainty) -> Array:
    """Derivatives of poses by the steps, (3, step, state)."""
    if not known.steps:
        return np.zeros((3, 0, settled.inverted.shape[1]))
    return sensitivities(settled, [_direction(step, settled.finger) for step in known.steps]).pose


def _direction(step: Step, finger: Finger) -> Direction:
    """What a step changes in a finger: gravity turns the other way as its mounting angle grows."""
    if not step.mounting_angle or not finger.unit_weight.any():
        return step.finger
    turn = step.mounting_angle
    gravity = {"gravity_x": turn * finger.gravity_y, "gravity_y": -turn * finger.gravity_x}
    return {**step.finger, **gravity}


def _variance(slopes: Array, covariance: Array) -> Array:
    """s C sᵀ of each quantity, (quantity, state), by slopes (quantity, step, state)."""
    found = np.zeros((slopes.shape[0], slopes.shape[2]))
    for (first, second), value in np.ndenumerate(covariance):
        found = found + value * slopes[:, first] * slopes[:, second]
    return np.maximum(found, 0.0)


def _shares(slopes: Array, known: Uncertainty, model: Array) -> dict[str, Array]:
    """By cause: √(σ_x² + σ_y²), mm."""
    found = {}
    for cause in known.causes:
        own = [place for place, step in enumerate(known.steps) if step.cause == cause]
        covariance = known.covariance[np.ix_(own, own)]
        found[cause] = np.sqrt(total(_variance(slopes[:2, own], covariance)))
    return {**found, MODEL: model} if known.model_error else found


def aperture_slopes(gripper: Gripper, layer_thickness: float | Array, pose: Array) -> Array:
    """Derivatives of the aperture, 2 (s/2 + x sin m + y cos m) − t cos(φ + m), by x, y and φ."""
    mount = np.broadcast_to(gripper.mounting_angle, pose.shape[1])
    turned = layer_thickness * np.sin(pose[2] + mount)
    return np.stack((2.0 * np.sin(mount), 2.0 * np.cos(mount), turned))


def aperture_steps(
    gripper: Gripper, layer_thickness: float | Array, pose: Array, steps: Sequence[Step]
) -> Array:
    """What the steps change in the aperture at the same pose, mm, (step, state)."""
    x, y, angle = pose
    mount = gripper.mounting_angle
    by_mount = 2.0 * (x * np.cos(mount) - y * np.sin(mount))
    by_mount = by_mount + layer_thickness * np.sin(angle + mount)
    by_layer = -np.cos(angle + mount)
    found = np.zeros((len(steps), pose.shape[1]))
    for place, step in enumerate(steps):
        found[place] = (
            step.base_spacing + step.mounting_angle * by_mount + step.layer_thickness * by_layer
        )
    return found
