"""The reference for contact against closed forms, and its sets of contacts."""

from dataclasses import replace

import mpmath
import numpy as np
import pytest

from dpgcli.arrays import Array
from dpgcli.mechanics.finger import STUDY, Finger, uniform_finger
from dpgcli.reference.bodies import RoundBody, exact
from dpgcli.reference.contact import Alone, Balance, Search, extended_contact, penetration
from dpgcli.reference.equilibria import energy_of
from dpgcli.reference.units import extended_units

CENTER, LONG, TURN = (9.0, -8.0), np.hypot(9.0, 8.0), np.arctan2(8.0, 9.0)


def nodes_of(a: float, b: float) -> Array:
    """Nodes (4,) of a rigid unit by its corners."""
    length, height, turned = STUDY["segment_length"], STUDY["segment_height"], a + b
    base = np.array([length * np.cos(a), -length * np.sin(a)])
    return np.concatenate((base, base + height * np.array([np.sin(turned), np.cos(turned)])))


def energy(a: "mpmath.mpf", b: "mpmath.mpf") -> "mpmath.mpf":
    """Of one unit between rigid bars, in the frame of the base."""
    length, height = mpmath.mpf(STUDY["segment_length"]), mpmath.mpf(STUDY["segment_height"])
    along = length * mpmath.cos(a) + height * mpmath.sin(a + b)
    across = -length * mpmath.sin(a) + height * (mpmath.cos(a + b) - 1)
    x, d = mpmath.sqrt(along**2 + across**2) - length, mpmath.mpf(STUDY["stroke"])
    well = 1 + (1 - mpmath.mpf(STUDY["force_linearity"])) * (x**2 / d**2 - 2 * x / d)
    own = mpmath.mpf(STUDY["bistable_stiffness"]) * x**2 * well / 2
    return own + mpmath.mpf(STUDY["hinge_stiffness"]) * (a**2 + b**2)


def unit(bars: float = np.inf) -> Finger:
    return uniform_finger(1, **STUDY, linear_stiffness=bars)


def test_a_rigid_unit_on_a_disc_has_a_closed_form() -> None:
    """Without a layer the face is the chord, so that a = γ − asin(r/ρ), and μ = −E_a/(ρ cos)."""
    body = RoundBody(CENTER, 7.2, 0.0)
    found = extended_contact(unit(), np.array([True]), body, nodes_of(0.1, 0.2), np.zeros(1))
    assert found is not None and found.is_minimum and found.in_pattern
    with mpmath.workdps(40):
        long = mpmath.sqrt(9**2 + 8**2)
        a = mpmath.atan2(8, 9) - mpmath.asin(mpmath.mpf(7.2) / long)
        b = mpmath.findroot(lambda b: mpmath.diff(energy, (a, b), (0, 1)), 0.2)
        push = -mpmath.diff(energy, (a, b), (1, 0)) / (long * mpmath.cos(mpmath.atan2(8, 9) - a))
        assert float(abs(push - mpmath.mpf(str(found.push[0])))) < 1e-18
        assert float(abs(a + b + mpmath.mpf(str(found.pose[2])))) < 1e-18
    assert [place.is_corner for place in found.places] == [False]


@pytest.mark.parametrize("bars", [1.0, 1e4, 1e16, np.inf])
def test_a_push_is_what_the_energy_falls_by_as_the_disc_shrinks(bars: float) -> None:
    """dE/dr = μ: of the energy that is found, by central differences."""
    bodies = [RoundBody(CENTER, 6.45 + by, 1.5) for by in (-1e-6, 0.0, 1e-6)]
    args = unit(bars), np.array([True])
    found = [extended_contact(*args, body, nodes_of(0.1, 0.2), np.zeros(1)) for body in bodies]
    less, here, more = found
    assert less is not None and here is not None and more is not None
    assert float(here.push[0]) > 1e-3
    rate = float((more.energy - less.energy) / 2e-6)
    assert rate == pytest.approx(float(here.push[0]), rel=1e-8)


def test_a_contact_that_would_pull_is_let_go_and_one_that_is_deep_is_closed() -> None:
    straight = nodes_of(0.0, 0.0)
    args = unit(), np.array([False])
    clear = extended_contact(*args, RoundBody(CENTER, 8.0 - 1e-12, 0.0), straight, np.zeros(1))
    assert clear is not None and clear.places == ()
    deep = extended_contact(*args, RoundBody(CENTER, 8.1, 0.0), straight, np.zeros(1))
    assert deep is not None and len(deep.places) == 1
    assert float(deep.push[0]) > 0.0
    assert penetration(RoundBody(CENTER, 8.1, 0.0), deep.nodes, 10.75) < 1e-14


def test_a_saddle_on_a_disc_is_no_minimum() -> None:
    """The unit on its barrier, just touched: nothing but the contact would hold it."""
    half = np.arcsin(2.0041742418404 / 21.5)
    touch = LONG * np.sin(TURN - half)
    body = RoundBody(CENTER, touch, 0.0)
    found = extended_contact(unit(), np.array([True]), body, nodes_of(half, half), np.zeros(1))
    assert found is None or not (found.is_minimum and found.in_pattern)


@pytest.mark.parametrize(
    ("center", "radius", "deep"),
    [
        ((7.0, -5.0), 5.5, 0.5),  # a side
        ((16.5, -4.0), 5.5, 0.5),  # the tip
        ((-3.0, -4.0), 5.25, 0.25),  # the clamp
        ((7.0, 2.0), 1.0, 3.0),  # behind the face
        ((7.0, -5.0), 4.5, 0.0),
    ],
)
def test_penetration_is_that_of_the_nearest_place(
    center: tuple[float, float], radius: float, deep: float
) -> None:
    nodes = np.array([13.5, 0.0, 13.5, 10.75])
    assert penetration(RoundBody(center, radius, 0.0), nodes, 10.75) == pytest.approx(deep)


def test_behind_a_corner_is_as_deep_as_the_corner_is_away() -> None:
    nodes = np.array([13.5, 0.0, 13.5, 10.75, 25.5, -6.0, 30.0, 3.0])
    behind = RoundBody((14.0, 3.0), 1.0, 0.0)
    assert penetration(behind, nodes, 10.75) == pytest.approx(1.0 + np.hypot(0.5, 3.0))


@pytest.mark.parametrize(("along", "is_minimum"), [(2, True), (-2, False)])
def test_curvature_counts_on_the_motions_that_contacts_leave(along: int, is_minimum: bool) -> None:
    """Downhill across the contact, which holds that back; up or down along it."""
    with mpmath.workdps(50):
        bars = energy_of(unit(), extended_units(unit()), [])
        search = Search(bars, Alone(bars, exact(RoundBody(CENTER, 8.0, 0.0))), 50, 0)
        zero, one = mpmath.mpf(0), mpmath.mpf(1)
        hessian = [[-one, zero], [zero, along * one]]
        found = Balance([zero, zero], {}, [[one, zero]], hessian)
        assert search.is_minimum(found) is is_minimum
        assert not search.is_minimum(replace(found, slopes=[]))
