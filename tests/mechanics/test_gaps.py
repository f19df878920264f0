"""Gaps between a face and round bodies: derivatives, and distances by brute force."""

from collections.abc import Callable

import numpy as np
import pytest
from shapely import LineString, Point

from dpgcli.arrays import Array, Flags
from dpgcli.mechanics.coordinates import FingerCoordinates, Internal
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
PLACES = {  # on which side, share along it, how far inwards (mm)
    "a side": (1, 0.4, 9.0),
    "the outer side": (2, 0.6, -3.0),
    "beyond the tip": (3, 1.7, 5.0),
    "above the tip": (3, 1.4, -5.0),
    "a corner": (1, 1.0, 8.0),
    "the outside of a corner": (1, 1.0, -7.0),
}


def gaps_of(
    coordinates: FingerCoordinates, at: Array, place: str, first: Flags | None = None
) -> FaceGaps:
    """The gaps to a body of 3 mm near some place of the face as it is at coordinates."""
    face = Face.of(coordinates, np.array([[1.5]]))
    side, share, inwards = PLACES[place]
    nodes = face.shape(at).nodes[..., 0]
    along = nodes[:, side + 1] - nodes[:, side]
    normal = np.array([along[1], -along[0]]) / np.hypot(*along)
    if "corner" in place:  # along the bisector of the normals
        after = nodes[:, side + 2] - nodes[:, side + 1]
        normal = normal + np.array([after[1], -after[0]]) / np.hypot(*after)
        normal /= np.hypot(*normal)
    center = nodes[:, side] + share * along + inwards * normal
    return FaceGaps(face, Obstacle(center[:, None, None], np.array([[3.0]])), first)


def bent_shape(coordinates: FingerCoordinates, random_shape: Shapes, place: str) -> Array:
    """A random shape whose second corner points to the inner or to the outer side."""
    turned = 0.6 if place == "the outside of a corner" else -0.6
    shape = random_shape(4, 24)._replace(wall=np.full((1, 1), 0.1))
    shape.far_angle[1] = shape.near_angle[2] = 0.5 * turned
    return np.asarray(coordinates.of_shape(shape))


class Derivatives:
    """Σ F g with its gradient and Hessian, by coordinates over their scales."""

    def __init__(self, coordinates: FingerCoordinates, gaps: FaceGaps, force: Array) -> None:
        unit = np.broadcast_to(coordinates.force_unit, (coordinates.size, 1))
        self.gaps, self.force, self.scale = gaps, force, 1.0 / unit[:, 0]
        self.rows = [row.offset for row in gaps.rows]

    def energy(self, x: Array) -> Array:
        return np.asarray((self.force * self.gaps(x).value).sum(axis=0))

    def gradient(self, x: Array) -> Array:
        result = np.zeros_like(x)
        result[self.rows] = (self.gaps(x).gradient * self.force).sum(axis=1)
        return result

    def hessian(self, x: Array) -> Array:
        result = np.zeros((len(x), len(x)))
        result[np.ix_(self.rows, self.rows)] = self.gaps(x).bent(self.force)[..., 0]
        return np.asarray(result * self.scale[:, None] * self.scale)


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize(("bars", "walls"), CASES)
def test_derivatives(
    bars: float,
    walls: float,
    place: str,
    graded_finger: Fingers,
    random_shape: Shapes,
    central_difference: Callable[..., Array],
) -> None:
    finger = graded_finger(4, 21, linear_stiffness=bars)
    finger = finger.changed(wall_compliance=np.array([[walls]]))
    coordinates = chain_potential(finger).coordinates
    at = bent_shape(coordinates, random_shape, place)
    gaps = gaps_of(coordinates, at, place)
    force = np.random.default_rng(22).uniform(1.0, 2.0, (gaps.n_cells, 1))
    d = Derivatives(coordinates, gaps, force)
    slope = central_difference(d.energy, at, d.scale)[:, 0]
    assert d.gradient(at)[:, 0] * d.scale == pytest.approx(slope, rel=1e-7, abs=1e-8)
    bend = central_difference(d.gradient, at, d.scale)[:, :, 0] * d.scale
    tolerance = 1e-7 * np.abs(bend) + 1e-7
    exact = d.hessian(at)
    assert (np.abs(exact - bend) <= tolerance).all()
    assert (np.abs(1.00001 * exact - bend) > tolerance).any(), "an error of 0.001 % is seen"
    step = 2e-3 * np.vstack((np.diag(d.scale), -np.diag(d.scale))).T
    assert (gaps(at + step).place == gaps(at).place).all(), "no place is left on the way"


@pytest.mark.parametrize("place", PLACES)
def test_every_gap_has_its_own_derivatives(
    place: str,
    graded_finger: Fingers,
    random_shape: Shapes,
    central_difference: Callable[..., Array],
) -> None:
    coordinates = chain_potential(graded_finger(4, 21)).coordinates
    at = bent_shape(coordinates, random_shape, place)
    gaps = gaps_of(coordinates, at, place)
    d = Derivatives(coordinates, gaps, np.ones((4, 1)))
    slopes = central_difference(lambda x: gaps(x).value, at, d.scale)[:, :, 0] / d.scale[:, None]
    assert gaps(at).gradient[..., 0] == pytest.approx(slopes[d.rows], rel=1e-7, abs=1e-8)


def walked(nodes: Array, center: Array, side: int) -> tuple[float, float]:
    """The local minimum of the distance that leads on from the nearest place of one side.

    By small steps along the polyline, from the best sampled place of the side: distance, and the
    place in sides.
    """
    n, fine = nodes.shape[1] - 1, 400
    share = np.arange(n * fine + 1) / fine
    x, y = (np.interp(share, np.arange(n + 1), row) for row in nodes)
    away = np.hypot(x - center[0], y - center[1])
    own = slice(side * fine, (side + 1) * fine + 1)
    k = side * fine + int(away[own].argmin())
    while k < n * fine and away[k + 1] < away[k]:
        k += 1
    while k > 0 and away[k - 1] < away[k]:
        k -= 1
    return float(away[k]), k / fine


def on_outer_side(nodes: Array, center: Array, place: float) -> bool:
    """Whether a point is on the outer side of the face at a place; beyond its ends it is not."""
    n = nodes.shape[1] - 1
    if place in (0.0, float(n)):
        return False
    k = min(max(round(place), 1), n - 1) if abs(place - round(place)) < 2e-3 else int(place)
    first, last = (k - 1, k + 1) if abs(place - k) < 2e-3 else (k, k + 1)
    along, away = nodes[:, last] - nodes[:, first], center - nodes[:, k]
    return bool(along[0] * away[1] - along[1] * away[0] > 0.0)


@pytest.mark.parametrize("seed", range(6))
def test_gaps_are_distances_of_places_that_are_nearest_around(
    seed: int, graded_finger: Fingers, random_shape: Shapes
) -> None:
    coordinates = chain_potential(graded_finger(4, 31)).coordinates
    random, lanes = np.random.default_rng(seed), 16
    at = coordinates.of_shape(random_shape(4, 32 + seed, lanes))
    face = Face.of(coordinates, np.array([[1.5]]))
    place = random.uniform(-15.0, 65.0, (2, lanes)), random.uniform(-35.0, 15.0, (2, lanes))
    centers = np.stack(place)
    measured = FaceGaps(face, Obstacle(centers, np.array([[2.0], [5.0]])))(at)
    nodes = face.shape(at).nodes
    for lane, body in np.ndindex(lanes, 2):
        center, own = centers[:, body, lane], slice(4 * body, 4 * body + 4)
        signed = measured.value[own, lane] + (2.0, 5.0)[body]
        nearest = LineString(nodes[..., lane].T).distance(Point(center))
        assert np.abs(signed).min() == pytest.approx(nearest, abs=1e-12)
        expected = [walked(nodes[..., lane], center, side) for side in range(4)]
        signs = [-1.0 if on_outer_side(nodes[..., lane], center, k) else 1.0 for _, k in expected]
        assert signed * signs == pytest.approx([away for away, _ in expected], abs=0.02)
        assert (signed == signed[measured.place[own, lane] - 4 * body]).all()


def test_sides_that_lead_to_one_place_are_told_apart_on_request(
    graded_finger: Fingers, random_shape: Shapes
) -> None:
    coordinates = chain_potential(graded_finger(4, 31)).coordinates
    at = bent_shape(coordinates, random_shape, "a corner")
    every = gaps_of(coordinates, at, "a corner")(at)
    assert every.place.ravel().tolist() == [1] * 4, "all lead to the corner, on its first side"
    for wanted, told in ((None, 1), (2, 2)):
        first = np.arange(4)[:, None] == wanted
        distinct = gaps_of(coordinates, at, "a corner", first)(at)
        own = np.arange(4) == told
        assert distinct.value[own] == every.value[own]
        assert (distinct.value[~own] == FAR).all() and not distinct.gradient[:, ~own].any()
        assert (distinct.gradient[:, own] == every.gradient[:, own]).all()


def test_a_corner_that_opens_towards_the_body_has_two_gaps(reference_finger: Fingers) -> None:
    """The finger curls by 0.4 rad at its one corner: both sides are nearest to themselves."""
    coordinates = chain_potential(reference_finger(2)).coordinates
    at, center = np.array([[0.0], [0.2], [0.2], [0.0]]), np.array([12.5, -7.0])
    face = Face.of(coordinates, np.array([[1.5]]))
    gaps = FaceGaps(face, Obstacle(center[:, None, None], np.array([[2.0]])))(at)
    nodes = face.shape(at).nodes[..., 0]
    for side in range(2):
        own = LineString(nodes[:, side : side + 2].T).distance(Point(center)) - 2.0
        assert gaps.value[side, 0] == pytest.approx(own, abs=1e-12)
    assert gaps.place.ravel().tolist() == [0, 1]


@pytest.mark.parametrize(
    ("center", "gap", "places"),
    [
        ((5.0, -4.75), 3.0, [0, 0, 0]),  # below the first phalanx
        ((30.0, 1.25), -3.0, [2, 2, 2]),  # in the finger
        ((-3.0, -4.75), 4.0, [0, 0, 0]),  # 3, 4, 5 from the base
        ((43.5, 3.25), 4.0, [2, 2, 2]),  # 3, 4, 5 beyond the tip, above the face
        ((13.5, -4.75), 3.0, [0, 0, 0]),  # below a corner
    ],
)
def test_a_straight_finger(
    center: tuple[float, float], gap: float, places: list[int], reference_finger: Fingers
) -> None:
    """Of 40.5 mm, its face at y = −0.75 mm, and a body of 1 mm."""
    coordinates = chain_potential(reference_finger(3)).coordinates
    face = Face.of(coordinates, np.array([[1.5]]))
    body = Obstacle(np.array(center)[:, None, None], np.array([[1.0]]))
    gaps = FaceGaps(face, body)(np.zeros((6, 1)))
    assert gaps.value == pytest.approx(np.full((3, 1), gap), abs=1e-14)
    assert gaps.place.ravel().tolist() == places


def test_the_base_does_not_move(reference_finger: Fingers) -> None:
    coordinates = chain_potential(reference_finger(3, 1e4)).coordinates
    face = Face.of(coordinates, np.array([[1.5]]))
    body = Obstacle(np.array([[[-3.0]], [[-4.75]]]), np.array([[1.0]]))
    gaps = FaceGaps(face, body)(np.zeros((12, 1)))
    assert not gaps.gradient.any()
    assert not gaps.bent(np.ones((3, 1))).any()


def test_lanes_have_their_own_bodies(graded_finger: Fingers, random_shape: Shapes) -> None:
    coordinates = chain_potential(graded_finger(3, 41, 3)).coordinates
    face = Face.of(coordinates, np.array([[1.5, 2.0, 2.5]]))
    random, index = np.random.default_rng(42), np.array([2, 0])
    centers = np.stack((random.uniform(0.0, 40.0, (2, 3)), random.uniform(-20.0, -5.0, (2, 3))))
    gaps = FaceGaps(face, Obstacle(centers, random.uniform(1.0, 4.0, (2, 3))))
    at, force = coordinates.of_shape(random_shape(3, 43, 3)), random.uniform(0.0, 1.0, (6, 3))
    every, few = gaps(at), gaps.take_lanes(index)(at[:, index])
    assert (few.value == every.value[:, index]).all()
    assert (few.gradient == every.gradient[..., index]).all()
    assert (few.bent(force[:, index]) == every.bent(force)[..., index]).all()


@pytest.mark.parametrize(
    ("beyond", "inwards", "bound", "slips"),
    [
        pytest.param(0.0, -2.999, 0.0, True, id="touched"),
        pytest.param(0.0, 2.999, 0.0, False, id="in front of the face"),
        pytest.param(0.1, -2.99, 0.0, False, id="beyond the end"),
        pytest.param(-0.1, -2.99, 0.0, False, id="before the end"),
        pytest.param(0.0, -3.1, 0.0, False, id="not touched"),
        pytest.param(0.0, -2.999, -1.0, False, id="not as large yet"),
    ],
)
def test_a_finger_slips_where_a_body_is_level_with_its_end_and_behind(
    beyond: float, inwards: float, bound: float, slips: bool, reference_finger: Fingers
) -> None:
    face = Face.of(chain_potential(reference_finger(2, np.inf)).coordinates, np.array([[1.5]]))
    center = np.array([27.0 + beyond, -0.75 - inwards])  # the inner side is below
    gaps = FaceGaps(face, Obstacle.disc(center, 3.0))
    assert gaps.are_slipping(np.zeros((4, 1)), np.array([bound])).tolist() == [slips]
