"""Bodies with straight sides in the reference: closed forms, gaps, and what yields."""

import mpmath
import numpy as np
import pytest

from dpgcli.mechanics.finger import STUDY, Finger, uniform_finger
from dpgcli.reference.bodies import Place, StraightBody, exact
from dpgcli.reference.contact import extended_contact, penetration

LENGTH, HEIGHT = STUDY["segment_length"], STUDY["segment_height"]
STRAIGHT = np.array([LENGTH, 0.0, LENGTH, HEIGHT])
GROUND, INVERTED, RIGID = np.array([False]), np.array([True]), np.zeros(1)
TURN = np.array([0.15, 0.3])  # about those of the base and of the end where the unit is inverted
BASE = LENGTH * np.array([np.cos(TURN[0]), -np.sin(TURN[0])])
CURLED = np.concatenate((BASE, BASE + HEIGHT * np.array([np.sin(TURN[1]), np.cos(TURN[1])])))
TOP = -1.9  # mm: of a plate that the end of an inverted unit comes down on


def unit(bars: float = np.inf) -> Finger:
    return uniform_finger(1, **STUDY, linear_stiffness=bars)


def block(left: float, right: float, top: float, stiffness: float = np.inf) -> StraightBody:
    corners = ((left, top - 5.0), (right, top - 5.0), (right, top), (left, top))
    return StraightBody(corners, 0.0, stiffness)


def turned(turn: "mpmath.mpf", near: float) -> "tuple[mpmath.mpf, mpmath.mpf]":
    """Of a rigid unit turned by a at its base: b in balance near some, and the moment E_a."""

    def energy(a: "mpmath.mpf", b: "mpmath.mpf") -> "mpmath.mpf":
        length, height = mpmath.mpf(LENGTH), mpmath.mpf(HEIGHT)
        along = length * mpmath.cos(a) + height * mpmath.sin(a + b)
        across = -length * mpmath.sin(a) + height * (mpmath.cos(a + b) - 1)
        x, d = mpmath.sqrt(along**2 + across**2) - length, mpmath.mpf(STUDY["stroke"])
        well = 1 + (1 - mpmath.mpf(STUDY["force_linearity"])) * (x**2 / d**2 - 2 * x / d)
        own = mpmath.mpf(STUDY["bistable_stiffness"]) * x**2 * well / 2
        return own + mpmath.mpf(STUDY["hinge_stiffness"]) * (a**2 + b**2)

    b = mpmath.findroot(lambda b: mpmath.diff(energy, (turn, b), (0, 1)), (near, near + 1e-3))
    return b, mpmath.diff(energy, (turn, b), (1, 0))


def test_the_end_of_a_unit_on_a_plate_has_a_closed_form() -> None:
    """Without a layer: y = −L sin a, and μ = −E_a/(L cos a) up."""
    found = extended_contact(unit(), INVERTED, block(9.0, 20.0, TOP), CURLED, RIGID)
    assert found is not None and found.is_minimum and found.in_pattern
    assert found.places == (Place(1, True, 2),)
    with mpmath.workdps(40):
        a = -mpmath.asin(mpmath.mpf(TOP) / mpmath.mpf(LENGTH))
        _, moment = turned(a, 0.15)
        push = -moment / (mpmath.mpf(LENGTH) * mpmath.cos(a))
        assert float(push) > 0.01
        assert float(abs(push - mpmath.mpf(str(found.push[0])))) < 1e-17


def test_a_corner_under_a_unit_has_a_closed_form() -> None:
    """At x = 9 and y = 0.2: tan a = −y/x, and μ = −E_a over the way from the base."""
    corners = ((9.0, 0.2), (7.0, -4.0), (11.0, -4.0))
    found = extended_contact(unit(), GROUND, StraightBody(corners, 0.0), STRAIGHT, RIGID)
    assert found is not None and found.places == (Place(0, False, 0),)
    with mpmath.workdps(40):
        a = -mpmath.atan2(mpmath.mpf(0.2), 9)
        _, moment = turned(a, 0.022)
        push = -moment / mpmath.hypot(9, mpmath.mpf(0.2))
        assert float(abs(push - mpmath.mpf(str(found.push[0])))) < 1e-17


@pytest.mark.parametrize("stiffness", [1e-6, 0.3, 1e6])
@pytest.mark.parametrize("bars", [np.inf, 1e4])
def test_a_body_yields_to_the_push_on_it(stiffness: float, bars: float) -> None:
    """k u = μ, and where it is then a body that does not yield takes the same push."""
    body = block(9.0, 20.0, TOP, stiffness)
    found = extended_contact(unit(bars), INVERTED, body, CURLED, RIGID)
    assert found is not None and found.is_minimum and len(found.places) == 1
    assert found.yielded == pytest.approx(float(found.push[0]) / stiffness, rel=1e-14)
    fixed = block(9.0, 20.0, TOP).lowered(found.yielded)
    same = extended_contact(unit(bars), INVERTED, fixed, CURLED, RIGID)
    assert same is not None
    assert float(same.push[0]) == pytest.approx(float(found.push[0]), rel=1e-9, abs=1e-13)


def test_a_body_that_nothing_touches_does_not_yield() -> None:
    found = extended_contact(unit(), GROUND, block(9.0, 20.0, -1.0, 1.0), STRAIGHT, RIGID)
    assert found is not None and found.places == () and found.yielded == 0.0


@pytest.mark.parametrize(
    ("body", "deep"),
    [
        (block(9.0, 20.0, 0.5), 0.5),  # the end of the face in a plate, and a corner in a side
        (block(15.0, 20.0, 0.5), 0.0),  # beyond the end
        (StraightBody(((5.0, 0.3), (3.0, -2.0), (6.0, -2.0)), 0.0), 0.3),  # a corner in a side
        (StraightBody(((5.0, -0.3), (3.0, -2.0), (6.0, -2.0)), 0.0), 0.0),
        (StraightBody(((5.0, 0.0), (3.0, -2.0), (6.0, -2.0)), 1.0), 0.5),  # the layer is below
    ],
)
def test_penetration_is_that_of_corners_and_nodes(body: StraightBody, deep: float) -> None:
    assert penetration(body, STRAIGHT, HEIGHT) == pytest.approx(deep, abs=1e-14)


def test_the_gap_at_a_place_needs_only_what_is_beside_it() -> None:
    body = exact(block(9.0, 40.0, 0.25))
    with mpmath.workdps(30):
        nodes = [13.5, 0.1, 13.4, 10.8, 27.0, 0.4, 26.6, 11.0]
        stations = [mpmath.mpf(value) for value in (0.0, 0.0, 0.0, HEIGHT, *nodes)]
        face = body.face(stations)
        places = body.places(face)
        assert {place.is_corner for place in places} == {True, False}
        for place in places:
            assert body.gap_of(stations, place) == body.gap(face, place)
