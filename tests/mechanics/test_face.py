"""The face of a finger: its nodes by a sum of its own, and how coordinates move and bend it."""

from collections.abc import Callable

import numpy as np
import pytest

from dpgcli.arrays import Array
from dpgcli.mechanics.coordinates import FingerCoordinates, Internal
from dpgcli.mechanics.face import Face
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.terms import chain_potential

Fingers = Callable[..., Finger]
Shapes = Callable[..., Internal]
CASES = [
    pytest.param(np.inf, 0.0, id="rigid"),
    pytest.param(1e4, 0.0, id="elastic"),
    pytest.param(np.inf, 0.6, id="rigid-walls"),
    pytest.param(1e4, 0.6, id="walls"),
]


def of(finger: Finger, walls: float) -> FingerCoordinates:
    return chain_potential(finger.changed(wall_compliance=np.array([[walls]]))).coordinates


def by_sums(finger: Finger, shape: Internal, thickness: float, lane: int) -> Array:
    """F_0 … F_n as complex numbers: one bar after the other, directions by their angles."""
    tau, base = 0.0, 0j
    face = [base - 0.5j * thickness]
    length = np.broadcast_to(finger.segment_length, (finger.n_units, 2))
    chords = np.broadcast_to(shape.chord, shape.near_angle.shape)
    for unit in range(finger.n_units):
        near, far = shape.near_angle[unit, lane], shape.far_angle[unit, lane]
        chord = 0.0 if finger.is_rigid else chords[unit, lane]
        base += (length[unit, lane] + chord) * np.exp(1j * (tau - near))
        tau -= near + far
        face.append(base - 0.5j * thickness * np.exp(1j * tau))
    return np.array(face)


@pytest.mark.parametrize(("bars", "walls"), CASES)
def test_its_nodes(bars: float, walls: float, graded_finger: Fingers, random_shape: Shapes) -> None:
    finger, shape = graded_finger(4, 11, 2, linear_stiffness=bars), random_shape(4, 12, 2)
    coordinates = of(finger, walls)
    face = Face.of(coordinates, np.array([[1.5, 4.0]]))
    found = face.shape(coordinates.of_shape(shape)).nodes
    for lane, thickness in enumerate((1.5, 4.0)):
        expected = by_sums(finger, shape, thickness, lane)
        assert found[0, :, lane] + 1j * found[1, :, lane] == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize(("bars", "walls"), CASES)
def test_how_it_moves_and_bends(
    bars: float,
    walls: float,
    graded_finger: Fingers,
    random_shape: Shapes,
    central_difference: Callable[..., Array],
) -> None:
    coordinates = of(graded_finger(4, 13, linear_stiffness=bars), walls)
    face = Face.of(coordinates, np.array([[1.5]]))
    at = coordinates.of_shape(random_shape(4, 14)._replace(wall=np.full((1, 1), 0.1)))
    forces = np.random.default_rng(15).normal(0.0, 1.0, (2, 5, 1))
    scale = 1.0 / np.broadcast_to(coordinates.force_unit, at.shape)[:, 0]
    own = scale[face.places]

    def work(x: Array) -> Array:
        return np.asarray((forces * face.shape(x).nodes).sum(axis=(0, 1)))

    def pulled(x: Array) -> Array:
        everywhere = np.zeros_like(at)
        everywhere[face.places] = face.shape(x).pulled(forces[:, :, None])[:, 0]
        return everywhere

    slope = central_difference(work, at, scale)
    assert pulled(at)[:, 0] * scale == pytest.approx(slope[:, 0], rel=1e-7, abs=1e-9)
    bend = central_difference(pulled, at, scale)[:, :, 0] * scale
    exact = face.shape(at).bent(forces)[..., 0] * own[:, None] * own
    assert exact == pytest.approx(bend[np.ix_(face.places, face.places)], rel=1e-7, abs=1e-9)
    assert np.abs(exact).max() > 1e-2
    others = np.setdiff1d(np.arange(len(at)), face.places)
    assert not slope[others].any(), "struts' extensions and walls do not move the face"


def test_of_equal_corners_sides_are_parallel_to_chords(reference_finger: Fingers) -> None:
    coordinates = of(reference_finger(3), 0.0)
    angle = np.array([[0.1], [0.1], [-0.2], [-0.2], [0.05], [0.05]])
    nodes = Face.of(coordinates, np.array([[2.0]])).shape(angle).nodes[..., 0]
    stations = coordinates.stations(angle)
    bases = np.stack((np.append(0.0, stations.base_x), np.append(0.0, stations.base_y)))
    side, chord = np.diff(nodes, axis=1), np.diff(bases, axis=1)
    assert side[0] * chord[1] - side[1] * chord[0] == pytest.approx(0.0, abs=1e-12)


def test_lanes_taken(graded_finger: Fingers, random_shape: Shapes) -> None:
    coordinates = of(graded_finger(3, 16, 3), 0.0)
    face = Face.of(coordinates, np.array([[1.5, 2.5, 3.5]]))
    at, index = coordinates.of_shape(random_shape(3, 17, 3)), np.array([2, 0])
    few = face.take_lanes(index).shape(at[:, index])
    assert (few.nodes == face.shape(at).nodes[..., index]).all()
