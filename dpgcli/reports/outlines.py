"""What a finger looks like in its states: chambers with their domes and the limiting layer, mm.

A station of the lattice is the middle of a chamber: n units are the n gaps between n + 1 chambers.
The dome of a unit is drawn in the wall of the chamber before the gap (assumed; the lattice does not
say which): folded into it in its ground state, pushed out against the next chamber when inverted.
Points are complex numbers x + iy. What neither geometry nor lattice says has the study's
proportions.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dpgcli.arrays import Array, Flags
from dpgcli.design.bodies import Body, Disc
from dpgcli.design.geometry import REFERENCE
from dpgcli.design.scene import Chambers, Scene
from dpgcli.mechanics.finger import STUDY
from dpgcli.records import dataclass
from dpgcli.states.certify import Status
from dpgcli.states.predict import Prediction

Points = NDArray[np.complex128]

COLUMNS = ("pattern", "status", "tip_x_mm", "tip_y_mm", "nodes")
OF_GRIPPERS = ("aperture_mm", "fingers_overlap")
GAP = REFERENCE.unit_separation / STUDY["segment_length"]  # of the segment's length
LAYER = REFERENCE.limiting_layer_thickness / STUDY["segment_height"]  # of the segment's height
DOME_WIDTH = 0.7  # of the chamber's
DEEPEST = 0.85  # of a chamber's length: how far a dome is drawn into it
ROUND = np.exp(1j * np.linspace(-0.5 * np.pi, 0.5 * np.pi, 19))


@dataclass(frozen=True)
class Profile:
    """Sizes in mm of a finger's side view.

    By unit: its `length`, the `gap` between its chambers and the `dome` height; by chamber its
    `height`, the greater the higher its dome; `axis` is the height of the domes' axis and `layer`
    the thickness of the limiting layer.
    """

    length: Array
    gap: Array
    dome: Array
    height: Array
    axis: float
    layer: float

    @classmethod
    def of(cls, scene: Scene) -> "Profile":
        """The sizes of the geometry where it has them, else those that the lattice allows.

        >>> from dpgcli.mechanics.finger import uniform_finger
        >>> profile = Profile.of(Scene(uniform_finger(3, **STUDY), sources=()))
        >>> profile.gap.round(9).tolist(), profile.dome.round(9).tolist(), profile.layer
        ([3.0, 3.0, 3.0], [6.5, 6.5, 6.5], 1.5)
        """
        *by_unit, axis, layer = (values[..., 0] for values in sizes(scene))
        length, gap, dome, height = by_unit
        return cls(length, gap, dome, np.append(height, height[-1]), float(axis), float(layer))

    def reach(self) -> tuple[Array, Array]:
        """How far each chamber reaches from its station towards the base and towards the tip."""
        half = 0.5 * np.maximum(self.length - self.gap, GAP * self.length)
        return np.append(half[:1], half), np.append(half, half[-1:])


class Sizes(NamedTuple):
    """What a profile has, of many designs: by (unit, design), and of each design (design,)."""

    length: Array
    gap: Array
    dome: Array
    height: Array
    axis: Array
    layer: Array


def sizes(scene: Scene) -> Sizes:
    """The sizes of a batch's designs, all chambers but the last one."""
    finger = scene.finger
    shape = (finger.n_units, finger.n_designs)
    length, stroke, axis = (
        np.broadcast_to(values, shape)
        for values in (finger.segment_length, finger.stroke, finger.segment_height[:1])
    )
    thickness = LAYER * axis[0] if scene.layer_thickness is None else scene.layer_thickness
    layer = np.minimum(thickness, axis[0])  # a thicker one would hide the chambers
    known = scene.chambers or Chambers(*np.full((3, 1, 1), np.nan))
    gap = _known(known.gap, GAP * length)
    dome = _known(known.dome_height, gap + stroke)
    width = _known(known.width, 2.0 * axis - layer)
    height = 0.5 * layer + width * dome / dome.min(axis=0)
    return Sizes(length, gap, dome, height, axis[0], layer)


def notes(scene: Scene) -> list[str]:
    """What of a picture is not to scale, or not of the spec.

    >>> from dpgcli.mechanics.finger import uniform_finger
    >>> notes(Scene(uniform_finger(3, **STUDY), sources=()))
    ['gaps and domes in the proportions of the study: the spec has no geometry']
    """
    profile, known = Profile.of(scene), scene.chambers
    said = []
    if np.ptp(profile.height) > 0.0:
        said.append("the height of a chamber grows with its dome's and is not to scale")
    if known is None or np.isnan(known.gap).any():
        said.append("gaps and domes in the proportions of the study: the spec has no geometry")
    return said


def _known(values: Array, otherwise: Array) -> Array:
    return np.where(np.isnan(values), otherwise, values)


def around_body(body: Body) -> Points:
    """Points around a body where it is placed, mm; of jaws the ends of both plates.

    >>> around_body(Disc(np.array([40.0, 0.0]), 20.0))[[0, 30]].round(9).tolist()
    [(60+0j), (40+20j)]
    """
    if isinstance(body, Disc):
        turn = np.linspace(0.0, 2.0 * np.pi, 121)
        circle: Points = complex(*body.center) + body.radius * np.exp(1j * turn)
        return circle
    x, y = body.corners
    return np.asarray(x + 1j * y)


@dataclass(frozen=True)
class FingerShape:
    """One finger in one state.

    The outline of each chamber from the base on, and whether its dome is inverted; the limiting
    layer's middle line and thickness (mm); the tip, the last node of the layer; the two ends of
    the mount.
    """

    chambers: tuple[Points, ...]
    are_inverted: Flags
    layer: Points
    thickness: float
    tip: complex
    mount: Points

    def mirrored(self) -> "FingerShape":
        """The same below the x axis."""
        return replace(
            self,
            chambers=tuple(np.conj(points) for points in self.chambers),
            layer=np.conj(self.layer),
            tip=self.tip.conjugate(),
            mount=np.conj(self.mount),
        )

    @property
    def points(self) -> Points:
        """All points of the outlines."""
        return np.concatenate((*self.chambers, self.layer, self.mount))


def finger_shape(profile: Profile, base: Points, top: Points, inverted: Flags) -> FingerShape:
    """The shape on the nodes of the layer and of the domes' axis, (station,), in a pattern (unit,).

    >>> from dpgcli.mechanics.finger import uniform_finger
    >>> profile = Profile.of(Scene(uniform_finger(1, **STUDY), sources=()))
    >>> base = np.array([0j, 13.5])
    >>> shape = finger_shape(profile, base, base + 10.75j, np.array([False]))
    >>> shape.layer.real.tolist(), shape.tip
    ([-5.25, 5.25, 8.25, 18.75], (13.5+0j))
    """
    upright = (top - base) / np.abs(top - base)
    along = -1j * upright
    before, after = profile.reach()
    left, right = base - before * along, base + after * along
    frames = np.stack((along, upright))
    facing = left[1:] + profile.axis * upright[1:]  # where domes meet the next chamber
    chambers = []
    for place, (start, end) in enumerate(zip(left, right, strict=True)):
        way, up = frames[:, place]
        floor, roof = 0.5 * profile.layer * up, profile.height[place] * up
        wall: Points = np.zeros(0, np.complex128)
        if place < len(inverted):
            wall = end + _dome(profile, place, facing[place] - end, way, up, inverted[place])
        corners = np.array([start + roof, start + floor, end + floor])
        chambers.append(np.concatenate((corners, wall, [end + roof])))
    mount = left[0] + upright[0] * np.array([-0.15, 1.15]) * profile.height[0]
    layer = np.stack((left, right), axis=1).ravel()
    filled = np.append(inverted, False)
    tip = complex(base[-1])
    return FingerShape(tuple(chambers), filled, layer, profile.layer, tip, mount)


def _dome(
    profile: Profile, unit: int, pole: complex, way: complex, up: complex, is_inverted: bool
) -> Points:
    """Points of a dome, from below, counted from the foot of its wall."""
    center = profile.axis * up
    if not is_inverted:
        before, after = profile.reach()
        depth = min(profile.dome[unit], DEEPEST * (before[unit] + after[unit]))
        pole = center - depth * way
    radius = 0.5 * DOME_WIDTH * 2.0 * (profile.axis - 0.5 * profile.layer)
    points: Points = center + radius * ROUND.imag * up + (pole - center) * ROUND.real
    return points


@dataclass(frozen=True)
class DrawnState:
    """A state to draw: its shapes, two of a gripper, none if it is not stable.

    `tip` is in mm, in the finger's frame. `faces` are the two ends of a gripper's `aperture`,
    whose fingers may overlap: no two that are made could.
    """

    pattern: str
    status: str
    tip: complex
    fingers: tuple[FingerShape, ...]
    aperture: float | None = None
    faces: tuple[complex, complex] | None = None
    overlaps: bool = False

    @property
    def n_inverted(self) -> int:
        """Number of inverted units."""
        return self.pattern.count("1")

    @property
    def description(self) -> str:
        """The state in one line, for those who do not see it.

        >>> DrawnState("01", "folded", complex("nan"), ()).description
        '01: folded'
        """
        if not self.fingers:
            return f"{self.pattern}: {self.status.replace('_', ' ')}"
        place = f"tip at x {self.tip.real:.6g} mm, y {self.tip.imag:.6g} mm"
        aperture = "" if self.aperture is None else f", aperture {self.aperture:.6g} mm"
        overlap = ", the fingers overlap" if self.overlaps else ""
        return f"{self.pattern}: {place}{aperture}{overlap}"


def drawn_states(prediction: Prediction) -> list[DrawnState]:
    """The states of a prediction that has `COLUMNS`, those with fewer inverted units first."""
    plan = prediction.plan
    profile = Profile.of(plan.scene)
    rows = prediction.arrays()
    states = _states(profile, rows, plan.n_units, plan.scene.gripper is not None)
    return sorted(states, key=lambda state: state.n_inverted)


def _states(
    profile: Profile, rows: Mapping[str, NDArray[Any]], n_units: int, is_gripper: bool
) -> Iterator[DrawnState]:
    for place, pattern in enumerate(map(str, rows["pattern"])):
        status = str(rows["status"][place])
        tip = complex(rows["tip_x_mm"][place], rows["tip_y_mm"][place])
        if status != Status.STABLE.text:
            yield DrawnState(pattern, status, tip, ())
            continue
        base, top = (_nodes(rows, place, n_units, node, is_gripper) for node in "BT")
        inverted = np.array([digit == "1" for digit in pattern])
        shape = finger_shape(profile, base, top, inverted)
        if not is_gripper:
            yield DrawnState(pattern, status, tip, (shape,))
            continue
        outward = (top[-1] - base[-1]) / abs(top[-1] - base[-1])
        face = complex(base[-1] - 0.5 * profile.layer * outward)
        fingers, faces = (shape, shape.mirrored()), (face, face.conjugate())
        aperture, overlaps = rows["aperture_mm"][place], rows["fingers_overlap"][place]
        yield DrawnState(pattern, status, tip, fingers, float(aperture), faces, bool(overlaps))


def _nodes(
    rows: Mapping[str, NDArray[Any]], place: int, n_units: int, node: str, is_gripper: bool
) -> Points:
    finger = "upper_" if is_gripper else ""
    names = [f"{finger}{node}{station}" for station in range(n_units + 1)]
    x, y = (np.array([rows[f"{name}_{axis}_mm"][place] for name in names]) for axis in "xy")
    nodes: Points = x + 1j * y
    return nodes
