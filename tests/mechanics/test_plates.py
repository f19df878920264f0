"""Gaps between a face and polygons: derivatives, and distances by shapely."""

from collections.abc import Callable

import numpy as np
import pytest
from shapely import LineString, Point, Polygon

from dpgcli.arrays import Array
from dpgcli.mechanics.coordinates import Internal
from dpgcli.mechanics.face import Face
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.gaps import FAR, FaceGaps
from dpgcli.mechanics.obstacle import Obstacle
from dpgcli.mechanics.terms import chain_potential

Fingers = Callable[..., Finger]
Shapes = Callable[..., Internal]
CASES = [
    pytest.param(np.inf, 0.0, id="rigid"),
    pytest.param(1e4, 0.6, id="walls"),
]
SQUARE = np.array([[0.0, 10.0, 10.0, 0.0], [0.0, 0.0, 10.0, 10.0]])
NOTCHED = np.array([[0.0, 8.0, 12.0, 11.0, 6.0, 1.0], [0.0, -1.0, 2.0, 12.0, 5.0, 10.0]])


def star(random: np.random.Generator, n: int, place: Array) -> Array:
    """A random polygon that does not cross itself, about a place, (2, corner)."""
    turn = np.sort(random.uniform(0.0, 2.0 * np.pi, n))
    turn[:3] = np.array([0.1, 2.2, 4.3]) + random.uniform(0.0, 0.5, 3)
    turn.sort()
    return place[:, None] + random.uniform(2.0, 12.0, n) * np.array([np.cos(turn), np.sin(turn)])


@pytest.mark.parametrize("corners", [SQUARE, NOTCHED], ids=["square", "notched"])
@pytest.mark.parametrize("place", [(27.0, -14.0), (30.0, -14.0), (33.0, -4.0)])
@pytest.mark.parametrize(("bars", "walls"), CASES)
def test_derivatives(
    bars: float,
    walls: float,
    place: tuple[float, float],
    corners: Array,
    graded_finger: Fingers,
    random_shape: Shapes,
    central_difference: Callable[..., Array],
) -> None:
    """Of every cell by itself, and of all under forces: far, near and with nodes in the body."""
    finger = graded_finger(4, 21, linear_stiffness=bars)
    coordinates = chain_potential(finger.changed(wall_compliance=np.array([[walls]]))).coordinates
    at = coordinates.of_shape(random_shape(4, 24)._replace(wall=np.full((1, 1), 0.1)))
    body = Obstacle.polygon(corners + np.array(place)[:, None])
    gaps = FaceGaps(Face.of(coordinates, np.array([[1.5]])), body)
    scale = 1.0 / np.broadcast_to(coordinates.force_unit, at.shape)[:, 0]
    rows = [row.offset for row in gaps.rows]
    own = scale[rows]
    force = np.random.default_rng(25).uniform(1.0, 2.0, (gaps.n_cells, 1))
    force[gaps(at).value >= FAR] = 0.0

    def gradient(x: Array) -> Array:
        result = np.zeros_like(x)
        result[rows] = (gaps(x).gradient * force).sum(axis=1)
        return result

    slopes = central_difference(lambda x: gaps(x).value, at, scale)[:, :, 0]
    exact = gaps(at).gradient[..., 0] * own[:, None]
    assert exact == pytest.approx(slopes[rows], rel=1e-7, abs=1e-8)
    assert not np.delete(slopes, rows, axis=0).any()
    bend = central_difference(gradient, at, scale)[:, :, 0][np.ix_(rows, rows)] * own
    hessian = gaps(at).bent(force)[..., 0] * own[:, None] * own
    tolerance = 1e-7 * np.abs(bend) + 1e-7
    assert (np.abs(hessian - bend) <= tolerance).all()
    assert (np.abs(1.00001 * hessian - bend) > tolerance).any(), "an error of 0.001 % is seen"
    plates = gaps(at).place.ravel() >= len(body.radii) * 4
    assert plates.any(), "some nodes are over plates"


def is_beyond(line: LineString, corners: Array) -> bool:
    """Whether a corner is nearest to an end of a face: bodies there may be behind it."""
    along = [line.project(Point(corner)) for corner in corners.T]
    return bool(min(along) == 0.0 or max(along) == line.length)


@pytest.mark.parametrize("seed", range(10))
def test_the_smallest_gap_is_the_distance(
    seed: int, graded_finger: Fingers, random_shape: Shapes
) -> None:
    """A face that runs into a body has a negative gap to it, and one that does not its distance."""
    coordinates = chain_potential(graded_finger(4, 31)).coordinates
    random, lanes = np.random.default_rng(seed), 24
    at = coordinates.of_shape(random_shape(4, 60 + seed, lanes))
    face = Face.of(coordinates, np.array([[1.5]]))
    nodes = face.shape(at).nodes
    n_met = 0
    for _ in range(16):
        place = np.array([random.uniform(0.0, 60.0), random.uniform(-30.0, 5.0)])
        corners = star(random, int(random.integers(3, 9)), place)
        value = FaceGaps(face, Obstacle.polygon(corners))(at).value
        area = Polygon(corners.T)
        for lane in range(lanes):
            line = LineString(nodes[..., lane].T)
            if not line.intersects(area):
                nearest = np.abs(value[:, lane]).min()
                assert nearest == pytest.approx(line.distance(area), abs=1e-12)
            elif not is_beyond(line, corners):
                assert value[:, lane].min() < 0.0
                n_met += 1
    assert n_met > 20


@pytest.mark.parametrize(
    ("place", "expected"),
    [
        ((2.0, -15.75), 5.0),  # below the face, at y = -0.75 mm
        ((2.0, -10.25), -0.5),  # its upper corners are over the face
        ((37.5, -9.75), -1.0),  # the tip, at 40.5 mm, is in its upper side
        ((43.5, -5.0), 3.0),  # beyond the tip
        ((43.5, -14.75), 5.0),  # 3, 4, 5 from its corner
        ((39.5, -5.0), -5.75),  # the tip is in, and a corner is beyond the face
    ],
)
def test_a_square_below_a_straight_finger(
    place: tuple[float, float], expected: float, reference_finger: Fingers
) -> None:
    coordinates = chain_potential(reference_finger(3)).coordinates
    face = Face.of(coordinates, np.array([[1.5]]))
    gaps = FaceGaps(face, Obstacle.polygon(SQUARE + np.array(place)[:, None]))
    assert gaps(np.zeros((6, 1))).value.min() == pytest.approx(expected, abs=1e-14)


def test_a_node_that_slides_over_an_end_keeps_its_gap(reference_finger: Fingers) -> None:
    """The tip of a straight finger over the end of a side, and beyond it: the corner's gap."""
    coordinates = chain_potential(reference_finger(3)).coordinates
    face = Face.of(coordinates, np.array([[1.5]]))
    tip, left_of_end, beyond = 4 * 3 + 2 * 4 + 3, -1e-9, 1e-9
    found = []
    for by in (left_of_end, beyond):
        place = np.array([30.5 - by, -15.75])
        measured = FaceGaps(face, Obstacle.polygon(SQUARE + place[:, None]))(np.zeros((6, 1)))
        found.append(measured)
        assert measured.value[tip] == pytest.approx(5.0, abs=1e-15)
    before, after = (int(measured.place[tip, 0]) for measured in found)
    assert (before, after) == (tip, 2 * 3 + 2), "the third corner, at the third phalanx"
    assert found[0].gradient[:, tip] == pytest.approx(found[1].gradient[:, tip], abs=1e-7)


def test_a_notch_is_touched_on_both_sides_but_not_in_its_corner(reference_finger: Fingers) -> None:
    """The tip in the notch of a body: two gaps of 0, none of the corner between them."""
    coordinates = chain_potential(reference_finger(2)).coordinates
    face = Face.of(coordinates, np.array([[1.5]]))
    corners = NOTCHED + (np.array([27.0, -0.75]) - NOTCHED[:, 4])[:, None]
    body = Obstacle.polygon(corners)
    assert body.is_reentrant.ravel().tolist() == [False] * 4 + [True, False]
    measured = FaceGaps(face, body)(np.zeros((4, 1)))
    at_tip = 6 * 2 + 3 * np.arange(6) + 2
    is_own = measured.place[at_tip, 0] == at_tip
    assert is_own.tolist() == [False, False, False, True, True, False]
    assert measured.value[at_tip[3:5]] == pytest.approx(0.0, abs=1e-12)
    assert (measured.value[8:10] == FAR).all() and not measured.gradient[:, 8:10].any()


def test_corners_in_a_straight_side_are_left_out() -> None:
    more = np.insert(SQUARE, 1, [4.0, 0.0], axis=1)[:, ::-1]
    assert Obstacle.polygon(more).points.shape == (2, 4, 1)


def test_lanes_have_their_own_bodies(graded_finger: Fingers, random_shape: Shapes) -> None:
    coordinates = chain_potential(graded_finger(3, 41, 3)).coordinates
    face = Face.of(coordinates, np.array([[1.5, 2.0, 2.5]]))
    body = Obstacle.polygon(NOTCHED)
    places = np.array([[25.0, 20.0, 30.0], [-12.0, -9.0, -3.0]])
    lanes = Obstacle(body.points + places[:, None], body.radii, body.plates)
    gaps, index = FaceGaps(face, lanes), np.array([2, 0])
    at = coordinates.of_shape(random_shape(3, 43, 3))
    force = np.random.default_rng(44).uniform(0.0, 1.0, (gaps.n_cells, 3))
    every, few = gaps(at), gaps.take_lanes(index)(at[:, index])
    assert (few.value == every.value[:, index]).all()
    assert (few.gradient == every.gradient[..., index]).all()
    assert (few.bent(force[:, index]) == every.bent(force)[..., index]).all()
    for lane in range(3):
        own = Obstacle.polygon(NOTCHED + places[:, lane, None])
        alone = FaceGaps(face.take_lanes(np.array([lane])), own)
        assert (alone(at[:, lane : lane + 1]).value[:, 0] == every.value[:, lane]).all()


def test_where_it_is_touched(reference_finger: Fingers) -> None:
    """A straight finger on a square: its corners are touched on the face, its sides at nodes."""
    coordinates = chain_potential(reference_finger(3)).coordinates
    face = Face.of(coordinates, np.array([[1.5]]))
    gaps = FaceGaps(face, Obstacle.polygon(SQUARE + np.array([[22.0], [-10.75]])))
    at = np.zeros((6, 1))
    touches, measured = gaps.touches(at), gaps(at)
    own = measured.place[:, 0] == np.arange(gaps.n_cells)
    at_zero = np.flatnonzero(own & (np.abs(measured.value[:, 0]) < 1e-12))
    places = touches.places[:, at_zero, 0].T.tolist()
    assert sorted(places) == [[22.0, -0.75], [27.0, -0.75], [32.0, -0.75]]
    ways = touches.directions[:, at_zero, 0]
    assert ways == pytest.approx(np.array([[0.0, -1.0]] * 3).T, abs=1e-15)
    assert gaps.phalanges[at_zero].tolist() == [2, 1, 1]
