"""The payload of a grasp: closed forms, linear programs, and what it must not depend on."""

import numpy as np
import pytest
from scipy.optimize import linprog

from dpgcli.arrays import Array
from dpgcli.design.bodies import Polygon
from dpgcli.grasping.frames import FingerFrame
from dpgcli.grasping.payload import Contacts, payloads

UP, DOWN = (1.0, 0.0), (-1.0, 0.0)


def around(angles: Array, push: Array, radius: float = 20.0) -> Contacts:
    """Pushes into a disc about the origin at angles from x, (place,), of one lane."""
    way = -np.stack((np.cos(angles), np.sin(angles)))
    return Contacts(push[:, None], -radius * way[..., None], way[..., None])


def wrenches(found: Contacts, friction: float, lane: int = 0) -> tuple[Array, Array]:
    """Forces at both edges of each cone with their moments, (3, place) each."""
    x, y = found.places[..., lane]
    along = found.directions[..., lane]
    sides = []
    for sign in (1.0, -1.0):
        fx, fy = along + sign * friction * np.stack((-along[1], along[0]))
        sides.append(np.stack((fx, fy, x * fy - y * fx)))
    return sides[0], sides[1]


def by_linear_program(
    found: Contacts, friction: float, gravity: tuple[float, float], lane: int = 0
) -> float:
    """Σ a_i w_i⁺ + b_i w_i⁻ + P g = 0 with a, b ≥ 0 and a_i + b_i ≤ N_i, for the largest P."""
    push, n = found.push[:, lane], len(found.push)
    balance = np.column_stack((*wrenches(found, friction, lane), (*gravity, 0.0)))
    share = np.column_stack((np.eye(n), np.eye(n), np.zeros(n)))
    options = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}
    cost = np.append(np.zeros(2 * n), -1.0)
    best = linprog(cost, A_ub=share, b_ub=push, A_eq=balance, b_eq=np.zeros(3), options=options)
    assert best.success and np.abs(balance @ best.x).max() < 1e-9 * max(push.max(), 1.0)
    return float(best.x[-1])


@pytest.mark.parametrize("friction", [0.0, 0.1, 0.3, 0.8])
@pytest.mark.parametrize("tilt", [0.0, 0.2, 0.5, -0.2])
def test_two_mirrored_places(friction: float, tilt: float) -> None:
    """2 N (μ cos φ ± sin φ): the more where the pull is against what the places push to."""
    found = around(np.array([0.5 * np.pi - tilt, tilt - 0.5 * np.pi]), np.array([3.0, 3.0]))
    for gravity in (UP, DOWN):
        out = np.sin(tilt) * gravity[0]  # both push to -x where φ > 0
        expected = max(6.0 * (friction * np.cos(tilt) + out), 0.0)
        assert payloads(found, friction, gravity) == pytest.approx([expected], abs=1e-8)


def random_contacts(n_places: int, n_lanes: int, *, is_balanced: bool) -> Contacts:
    """Places anywhere; the last pushes are what balances the others, where that may be."""
    random = np.random.default_rng(n_places)
    angle = random.uniform(0.0, 2.0 * np.pi, (n_places, n_lanes))
    way = -np.stack((np.cos(angle), np.sin(angle)))
    places = -way * random.uniform(5.0, 20.0, (n_places, n_lanes))
    places += random.normal(0.0, 4.0, places.shape)
    push = random.uniform(0.1, 2.0, (n_places, n_lanes))
    if is_balanced:  # each place has one that faces it
        way = np.concatenate((way, -way), axis=1)
        places = np.concatenate((places, places + random.uniform(5.0, 30.0) * way[:, :n_places]), 1)
        push = np.concatenate((push, push))
    return Contacts(push, places, way)


@pytest.mark.parametrize(("n_places", "is_balanced"), [(1, True), (2, True), (3, True), (4, False)])
@pytest.mark.parametrize("friction", [0.2, 0.7])
def test_the_closed_form_is_the_linear_program(
    n_places: int, is_balanced: bool, friction: float
) -> None:
    found = random_contacts(n_places, 25, is_balanced=is_balanced)
    gravity = (0.6, -0.8)
    own = payloads(found, friction, gravity)
    expected = [by_linear_program(found, friction, gravity, lane) for lane in range(25)]
    assert own == pytest.approx(expected, rel=1e-8, abs=1e-8)
    assert (own > 0.0).sum() >= (10 if is_balanced else 0)


def test_more_friction_bears_more() -> None:
    found = random_contacts(3, 30, is_balanced=True)
    own = np.array([payloads(found, mu, UP) for mu in (0.0, 0.1, 0.2, 0.5, 1.0, 3.0)])
    assert (np.diff(own, axis=0) >= -1e-9).all() and (own[-1] > own[1]).all()


def test_what_is_alike_is_alike() -> None:
    """Mirrored, turned, larger, stronger; in a batch or alone, to the last bit."""
    found, turn = random_contacts(2, 25, is_balanced=True), 0.7
    own = payloads(found, 0.4, UP)
    mirror = np.array([1.0, -1.0])[:, None, None]
    mirrored = found._replace(places=mirror * found.places, directions=mirror * found.directions)
    assert payloads(mirrored, 0.4, UP) == pytest.approx(own, rel=1e-9)
    frame = FingerFrame(turn, 0.0, 1)
    turned = found._replace(
        places=frame.outside(found.places), directions=frame.outside(found.directions)
    )
    assert payloads(turned, 0.4, (np.cos(turn), np.sin(turn))) == pytest.approx(own, rel=1e-9)
    scaled = Contacts(1e3 * found.push, 1e-3 * found.places, found.directions)
    assert payloads(scaled, 0.4, UP) == pytest.approx(1e3 * own, rel=1e-9)
    alone = [payloads(found.take_lanes(slice(k, k + 1)), 0.4, UP)[0] for k in range(25)]
    assert own.tolist() == alone


def test_one_finger_alone_holds_nothing_and_none_neither() -> None:
    one = around(np.array([0.5 * np.pi]), np.array([3.0]))
    assert payloads(one, 0.9, UP).tolist() == [0.0]
    assert payloads(Contacts(np.zeros((0, 2)), *np.zeros((2, 2, 0, 2))), 0.9, UP).tolist() == [0, 0]


def test_a_moment_that_friction_does_not_bear() -> None:
    """Two places face each other 10 mm beside the middle: the pull would turn the body."""
    found = around(np.array([0.5 * np.pi, -0.5 * np.pi]), np.array([3.0, 3.0]))
    beside = found._replace(places=found.places + np.array([0.0, 10.0])[:, None, None])
    assert payloads(found, 0.5, UP) == pytest.approx([3.0], abs=1e-8)
    assert payloads(beside, 0.5, UP) == pytest.approx(
        [by_linear_program(beside, 0.5, UP)], abs=1e-8
    )
    assert payloads(beside, 0.5, UP) == pytest.approx([2.0], abs=1e-8)  # 2 μ N r/(r + 10)


def test_a_pull_acts_on_the_center_of_area() -> None:
    """A right triangle whose reference point is not its center, seen from the lower finger."""
    corners = np.array([[0.0, 30.0, 0.0], [0.0, 0.0, 12.0]])
    body = Polygon(np.array([5.0, 2.0]), corners)
    assert body.middle.tolist() == pytest.approx([15.0, 6.0])
    many = body.with_value("at_y_mm", np.array([2.0, 3.0]))
    assert many.middle[1].tolist() == pytest.approx([6.0, 7.0])
    frame, opened = FingerFrame(0.0, 30.0, -1), np.zeros(1)
    at = np.array([[15.0, 15.0], [-40.0, -32.0]])  # of the lower finger: y from its base up
    way = np.array([[0.0, 0.0], [1.0, -1.0]])
    found = Contacts(np.ones((2, 1)), at[..., None], way[..., None])
    told = found.about(frame, body.middle[:, None], opened)
    assert told.places[..., 0].tolist() == [[0.0, 0.0], [4.0, -4.0]]
    assert payloads(told, 0.5, UP) == pytest.approx([1.0], abs=1e-8)


def test_plates_that_have_opened_have_longer_levers() -> None:
    at, way = np.array([3.0, 10.0])[:, None, None], np.array([0.0, -1.0])[:, None, None]
    upper = Contacts(np.full((1, 1), 2.0), at, way)
    lower = upper._replace(places=at * np.array([-1.0, 1.0])[:, None, None])
    own, expected = [], []
    for opened in (0.0, 20.0):
        parts = [
            part.about(FingerFrame(0.0, 0.0, side), np.zeros((2, 1)), np.array([opened]))
            for part, side in ((upper, 1), (lower, -1))
        ]
        own.append(payloads(Contacts.joined(parts), 0.4, UP)[0])
        half = 10.0 + 0.5 * opened
        places = np.array([[3.0, -3.0], [half, -half]])[..., None]
        ways = np.array([[0.0, 0.0], [-1.0, 1.0]])[..., None]
        expected.append(by_linear_program(Contacts(np.full((2, 1), 2.0), places, ways), 0.4, UP))
    assert own == pytest.approx(expected, abs=1e-8) and own[1] > own[0] + 0.1


def test_lanes_with_fewer_places_are_as_they_are_alone() -> None:
    few, many = (random_contacts(n, 3, is_balanced=True) for n in (1, 3))
    padded = [np.concatenate((v, np.zeros((*v.shape[:-2], 4, 3))), axis=-2) for v in few]
    both = Contacts(*(np.concatenate(v, axis=-1) for v in zip(padded, many, strict=True)))
    expected = [*payloads(few, 0.5, UP), *payloads(many, 0.5, UP)]
    assert payloads(both, 0.5, UP) == pytest.approx(expected, rel=1e-9, abs=1e-12)
