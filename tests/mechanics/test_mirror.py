"""Gaps between two fingers: derivatives, and distances by brute force."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from shapely import LineString, Point

from dpgcli.arrays import Array
from dpgcli.mechanics.coordinates import Internal
from dpgcli.mechanics.face import Face
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.gaps import FAR
from dpgcli.mechanics.mirror import Axis, Heights, NodeGaps, OfNodes
from dpgcli.mechanics.terms import chain_potential

Fingers = Callable[..., Finger]
Shapes = Callable[..., Internal]
AXIS = Axis(np.array([[np.sin(0.1)], [np.cos(0.1)]]), np.array([9.0]))
KINDS = ("heights", "upper", "lower")


def made(finger: Finger, kind: str, *, moves: bool) -> tuple[Heights | NodeGaps, int]:
    """The gaps of a finger to the axis, or of one finger's sides; and the number of coordinates."""
    coordinates = chain_potential(finger).coordinates
    face = Face.of(coordinates, np.array([[1.5]])).with_end()
    size = coordinates.size
    if kind == "heights":
        return Heights(face, AXIS), size
    upper, lower = (replace(face, places=2 * face.places + part) for part in range(2))
    if moves:
        apart = 0.5 * AXIS.normal[:, None]
        upper, lower = (own.seen_from(apart, np.array([2 * size])) for own in (upper, lower))
    reach = np.array([finger.segment_height[0, 0] + 0.75])
    faces = (upper, lower) if kind == "upper" else (lower, upper)
    return NodeGaps(*faces, AXIS, 2 * size + moves, reach, kind == "upper"), 2 * size + moves


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("bars", [np.inf, 1e4])
@pytest.mark.parametrize("moves", [False, True])
def test_derivatives(
    kind: str,
    bars: float,
    moves: bool,
    graded_finger: Fingers,
    central_difference: Callable[..., Array],
) -> None:
    gaps, size = made(graded_finger(3, 21, linear_stiffness=bars), kind, moves=moves)
    random = np.random.default_rng(5)
    at = random.uniform(-0.3, 0.5, (size, 1))
    found = gaps(at)
    told = found.value[:, 0] < FAR
    assert told.sum() >= 4
    rows = [row.offset for row in gaps.rows]
    scale = np.full(size, 1e-2)
    slopes = central_difference(lambda x: gaps(x).value, at, scale)[:, :, 0] / scale[:, None]
    assert found.gradient[:, told, 0] == pytest.approx(slopes[rows][:, told], rel=1e-6, abs=1e-6)
    force = random.uniform(1.0, 2.0, (gaps.n_cells, 1)) * told[:, None]

    def pulled(x: Array) -> Array:
        return np.asarray((gaps(x).gradient * force[:, :1]).sum(axis=1))

    bend = central_difference(pulled, at, scale)[:, :, 0] / scale[:, None]
    exact = found.bent(force)[..., 0]
    assert exact == pytest.approx(bend[rows], rel=1e-5, abs=1e-4)
    assert exact == pytest.approx(exact.T, abs=1e-9)


@pytest.mark.parametrize("kind", ["upper", "lower"])
def test_gaps_are_distances(kind: str, graded_finger: Fingers, random_shape: Shapes) -> None:
    """Of each node the nearest place that it is told for, of those in front of the other finger."""
    finger = graded_finger(4, 21)
    gaps, size = made(finger, kind, moves=False)
    assert isinstance(gaps, NodeGaps)
    random, seen = np.random.default_rng(8), 0
    for _ in range(20):
        at = random.uniform(0.0, 0.25, (size, 1))
        nodes = gaps.face.shape(at).nodes[..., 0]
        others = AXIS.mirrored(gaps.other.shape(at).nodes)[..., 0]
        line, value = LineString(nodes.T), gaps(at).value[:, 0].reshape(-1, gaps.face.n_sides)
        for node, point in enumerate(others.T):
            nearest = value[node].min()
            if 0.0 < nearest < FAR:
                assert nearest == pytest.approx(line.distance(Point(point)), abs=1e-9)
                seen += 1
    assert seen > 50


def test_both_fingers_see_the_same_touches(graded_finger: Fingers) -> None:
    gaps, size = made(graded_finger(3, 21), "upper", moves=False)
    assert isinstance(gaps, NodeGaps)
    at = np.random.default_rng(1).uniform(0.0, 0.3, (size, 1))
    by_sides, by_nodes = gaps.touches(at), OfNodes(gaps).touches(at)
    assert AXIS.mirrored(by_nodes.places) == pytest.approx(by_sides.places, abs=1e-12)
    assert AXIS.turned(by_nodes.directions) == pytest.approx(-by_sides.directions, abs=1e-12)
    nodes = gaps.other.shape(at).nodes[:, gaps.nodes]
    assert by_nodes.places == pytest.approx(nodes, abs=1e-12)


@pytest.mark.parametrize(("along", "inwards", "expected"), [
    (-0.1, 8.0, -0.1), (0.1, 8.0, 0.1), (-8.0, 0.1, -0.1), (-8.0, -0.1, 0.1), (0.3, -0.4, 0.5)
])  # fmt: skip
def test_at_its_end_a_finger_is_behind_the_nearer_of_two_sides(
    along: float, inwards: float, expected: float, graded_finger: Fingers
) -> None:
    """Points along the last side, beyond its end, and behind the face, by mm."""
    finger = graded_finger(2, 21)
    gaps, size = made(finger, "upper", moves=False)
    assert isinstance(gaps, NodeGaps)
    straight = np.zeros((size, 1))
    end = gaps.face.shape(straight).nodes[:, -2]
    point = np.asarray(end + np.array([[along], [inwards]]))
    shift = AXIS.mirrored(point[:, None])[:, 0] - gaps.other.shape(straight).nodes[:, -1]
    moved = replace(
        gaps, other=gaps.other.seen_from(-shift[:, None], np.array([size])), size=size + 1
    )
    value = moved(np.append(straight, [[1.0]], axis=0)).value[:, 0]
    own = value.reshape(-1, gaps.face.n_sides)[-1]
    assert own[own < FAR] == pytest.approx(np.full(int((own < FAR).sum()), expected), abs=1e-12)
    once = replace(moved, has_corners=False)(np.append(straight, [[1.0]], axis=0)).value[:, 0]
    is_told = (once.reshape(-1, gaps.face.n_sides)[-1] < FAR).any()
    assert is_told == (expected != 0.5), "two nodes have one distance, told by one finger"
