"""Slopes of states by the keys that vary: a complex step through the design rules, then dq/dp.

A step i h in a value goes through every rule from there to the lattice (Squire and Trapp, SIAM
Review 40, 1998, 110); `states.sensitivities` brings it on to the states. Quantities that are not
listed here have no exact slope.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import cast

import numpy as np

from dpgcli.arrays import COMPLEX_STEP, Array, Indices, total
from dpgcli.design.dimensions import Design, Sizes
from dpgcli.design.resolve import resolve
from dpgcli.design.scene import Gripper, Scene, Step
from dpgcli.records import dataclass
from dpgcli.states.certify import Settled
from dpgcli.states.sensitivities import Sensitivities, sensitivities
from dpgcli.states.tip import tip
from dpgcli.states.uncertainty import aperture_slopes, aperture_steps

AFTERWARDS = ("object.", "pressure.")  # keys that no free state depends on


def key_steps(design: Design, values: Sizes, keys: Sequence[str], designs: Indices) -> list[Step]:
    """What a unit of each key changes in some of the designs, which have these values by key."""
    rules = replace(design, pressure=None, body=None, tolerances={}, model_error=None)
    nothing = np.zeros(1)
    return [
        Step(key, {}, nothing, nothing, nothing)
        if key.startswith(AFTERWARDS)
        else _step(rules, key, values[key], designs)
        for key in keys
    ]


def _step(design: Design, key: str, value: Array, designs: Indices) -> Step:
    moved = design.with_values({key: cast("Array", value + 1j * COMPLEX_STEP)})
    scene = resolve(moved).batch(designs)
    arrays = {**scene.finger.arrays(), **scene.finger.conditions()}
    changes = {name: _imaginary(part) for name, part in arrays.items() if np.iscomplexobj(part)}
    gripper = scene.gripper or Gripper(0.0, 0.0)
    spacing, angle = _imaginary(gripper.base_spacing), _imaginary(gripper.mounting_angle)
    return Step(key, changes, spacing, angle, _imaginary(_layer(scene)))


def _layer(scene: Scene) -> float | Array:
    return 0.0 if scene.layer_thickness is None else scene.layer_thickness


def _imaginary(values: float | Array) -> Array:
    return np.asarray(np.asarray(values).imag / COMPLEX_STEP)


@dataclass(frozen=True)
class StateSlopes:
    """Settled states, a design for each, of a scene of as many, and what steps change in them."""

    settled: Settled
    scene: Scene
    steps: Sequence[Step]

    def of(self, names: Sequence[str]) -> Mapping[str, Array]:
        """Slopes of quantities that are exact, (step, state), by name."""
        found = sensitivities(self.settled, [step.finger for step in self.steps])
        return {name: EXACT[name](self, found) for name in names}

    def aperture(self, found: Sensitivities) -> Array:
        """Of the aperture, by the pose and by the gripper itself, (step, state)."""
        gripper, layer = self.scene.gripper, _layer(self.scene)
        assert gripper is not None, "only grippers have an aperture"
        pose = tip(self.settled, with_compliance=False).pose
        by_pose = aperture_slopes(gripper, layer, pose)
        return total(by_pose[:, None] * found.pose) + aperture_steps(
            gripper, layer, pose, self.steps
        )


EXACT: dict[str, Callable[[StateSlopes, Sensitivities], Array]] = {
    "tip_x_mm": lambda _, found: found.pose[0],
    "tip_y_mm": lambda _, found: found.pose[1],
    "tip_angle_rad": lambda _, found: found.pose[2],
    "tip_angle_deg": lambda _, found: np.degrees(found.pose[2]),
    "energy_mJ": lambda _, found: found.energy,
    "aperture_mm": StateSlopes.aperture,
}
