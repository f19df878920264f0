"""Domes that only push by a curve with ripples: each in a well of its own, and what that changes.

The curve is a double well with a cosine on it, given in closed form beside its spline. Between
rigid bars the units do not feel each other, so that scalar equations tell what each of them does.
"""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from dpgcli.actuation.certificate import certificate
from dpgcli.actuation.directions import Directions
from dpgcli.actuation.pressed import Pressed
from dpgcli.actuation.pulses import intervals
from dpgcli.actuation.rest import at_rest
from dpgcli.actuation.stretches import stretches
from dpgcli.actuation.transition_scatter import spread_rows
from dpgcli.actuation.transitions import Departure, state_graph
from dpgcli.actuation.travel import EventKind, travel
from dpgcli.arrays import Array
from dpgcli.mechanics.curve import spline
from dpgcli.mechanics.finger import STUDY, uniform_finger
from dpgcli.mechanics.laws import PushOnly, Tabulated
from dpgcli.mechanics.pressure import DomeVolumes
from dpgcli.states.patterns import texts
from dpgcli.states.units import UnitSolutions

TRAVEL, STIFFNESS, HINGE, HEIGHT = 13.0, 1.0, 24.2, 10.75
SHARE = np.linspace(0.0, 1.4, 4001)
BARRIER, RIPPLE, WAVES = 0.5, 0.006, 5.0


def energy(share: Array, barrier: float = BARRIER) -> Array:
    """Of the dome over k_b D², by its travel over D."""
    wave = 1.0 - np.cos(2.0 * np.pi * WAVES * share)
    return barrier * share**2 * (1.0 - share) ** 2 + 0.01 * share**2 + RIPPLE * share**2 * wave


def slope(share: Array, barrier: float = BARRIER) -> Array:
    """Its derivative."""
    well = barrier * (2.0 * share * (1.0 - share) ** 2 - 2.0 * share**2 * (1.0 - share))
    angle = 2.0 * np.pi * WAVES * share
    wave = 2.0 * share * (1.0 - np.cos(angle)) + share**2 * 2.0 * np.pi * WAVES * np.sin(angle)
    return well + 0.02 * share + RIPPLE * wave


def rippled(
    areas: list[float], bars: float = np.inf, contact: float = 9.5, barrier: float = BARRIER
) -> Pressed:
    """Units that differ in the areas of their domes alone, mm²."""
    finger = uniform_finger(len(areas), **STUDY, linear_stiffness=bars).changed(
        stroke=np.array([[TRAVEL - contact]]),
        dome_travel=np.array([[TRAVEL]]),
        bistable_stiffness=np.array([[STIFFNESS]]),
    )
    points = tuple(SHARE.tolist()), tuple(energy(SHARE, barrier).tolist())
    finger = replace(finger, law=PushOnly(Tabulated(spline(*points))))
    return Pressed(UnitSolutions.of(finger), DomeVolumes(np.array(areas)[:, None]))


@dataclass(frozen=True)
class Peer:
    """One unit between rigid bars by the extension x of its dome in touch: forces in N."""

    contact: float = 9.5
    barrier: float = BARRIER

    def dome(self, x: Array) -> Array:
        return STIFFNESS * TRAVEL * slope((x + self.contact) / TRAVEL, self.barrier)

    def whole(self, x: Array) -> Array:
        """Of dome and hinge, which the push p A balances."""
        turn = 2.0 * np.arcsin(x / (2.0 * HEIGHT))
        return np.asarray(self.dome(x) + HINGE * turn / (HEIGHT * np.cos(0.5 * turn)))

    def energy(self, x: float, push: float) -> float:
        share, turn = (x + self.contact) / TRAVEL, 2.0 * np.arcsin(x / (2.0 * HEIGHT))
        dome = STIFFNESS * TRAVEL**2 * float(energy(np.array(share), self.barrier))
        return dome + 0.5 * HINGE * turn**2 - push * (x + self.contact)

    def extremes(self, force: str, low: float, high: float, sign: float) -> list[float]:
        """Places of all local maxima (sign 1) or minima (−1) of a force between two places."""
        function = getattr(self, force)
        places = np.linspace(low, high, 4001)
        values = sign * function(places)
        inner = np.flatnonzero((values[1:-1] >= values[:-2]) & (values[1:-1] > values[2:])) + 1
        return [
            float(
                minimize_scalar(
                    lambda x: -sign * float(function(np.array(x))),
                    bounds=(places[k - 1], places[k + 1]),
                    method="bounded",
                    options={"xatol": 1e-12},
                ).x
            )
            for k in inner
        ]

    def falls_to(self, x: float, push: float) -> float:
        """Where the unit comes to rest that goes back from a place: the next zero below."""
        places = np.linspace(x - 1e-3, 0.0, 200_001)
        left = self.whole(places) - push
        return float(places[np.flatnonzero(left < 0.0)[0]])


def test_stretches_are_those_of_the_curve() -> None:
    own, peer = rippled([60.0]), Peer()
    found, well = stretches(own.finger, own.volumes), TRAVEL - 9.5
    tops = peer.extremes("dome", -9.5, well, 1.0)
    bottoms = peer.extremes("dome", -9.5, well, -1.0)
    assert len(tops) >= 3, "ripples"
    assert found.ends.ravel()[:-1] == pytest.approx(tops, abs=1e-5)
    assert found.begins.ravel()[1:] == pytest.approx(bottoms, abs=1e-5)
    assert found.most.ravel()[:-1] == pytest.approx(peer.dome(np.array(tops)) / 60.0, rel=1e-6)
    assert found.least.ravel()[1:] == pytest.approx(peer.dome(np.array(bottoms)) / 60.0, rel=1e-6)
    assert found.begins.ravel()[0] == -found.ends.ravel()[-1] == -np.inf


def test_units_reset_each_at_its_own_fold() -> None:
    """Both fold at the same force; one goes to the well before, the other stays where it is."""
    areas = [60.0, 48.0]
    own, peer = rippled(areas), Peer()
    start, _ = at_rest(own, np.ones((2, 1), bool))
    rest = own.extensions(start.coordinates)[0, 0]
    fold = max(x for x in peer.extremes("whole", 0.05, rest, -1.0))
    force = float(peer.whole(np.array(fold)))
    assert force < 0.0
    way = travel(own, start, np.array([[1.05 * force / 48.0] * 2]))
    first, second = way.events[:2]
    assert (first.units, second.units) == ((0,), (1,))
    assert first.kind is EventKind.RESET
    shapes = way.points.shapes
    for event, unit in ((first, 0), (second, 1)):
        at = force / areas[unit]
        assert shapes.pressure[unit, event.before] == pytest.approx(at, rel=1e-7)
    before, after = (own.extensions(shapes.coordinates)[:, k] for k in (first.before, first.after))
    assert after[1] == pytest.approx(before[1], abs=1e-9), "the other one stays"
    there = peer.falls_to(fold, force)
    assert after[0] == pytest.approx(there, abs=1e-4)
    lost = peer.energy(fold, force) - peer.energy(there, force)
    assert first.released == pytest.approx(lost, rel=1e-6)
    assert certificate(own, way.final).is_certified


@pytest.mark.slow
def test_bars_that_give_way_change_little_of_it() -> None:
    rigid, soft = (rippled([60.0, 48.0], bars) for bars in (np.inf, 1e4))
    ways = []
    for own in (rigid, soft):
        start, _ = at_rest(own, np.ones((2, 1), bool))
        ways.append(travel(own, start, np.array([[-0.06] * 2])))
    one, other = ([event.units for event in way.events] for way in ways)
    assert one == other and len(one) > 0


def test_a_unit_that_goes_along_is_told_of_though_no_digit_flips() -> None:
    """Two alike between bars that give way go together: a tie, and both are named."""
    own = rippled([60.0, 60.0])
    start, _ = at_rest(own, np.ones((2, 1), bool))
    first = travel(own, start, np.array([[-0.06] * 2])).events[0]
    assert (first.units, first.tied) == ((0, 1), (1,))
    assert texts(start.inverted)[0] == b"11"


def test_pulses_end_where_a_fold_leaves_the_state_and_no_digit_flips() -> None:
    own, line, down = rippled([60.0]), np.zeros(1, np.int64), np.array([1])
    graph = state_graph(own, line)
    (row,) = np.flatnonzero((graph.transitions.code == 1) & (graph.transitions.sign < 0))
    found = graph.transitions.take(np.array([row]))
    start, _ = at_rest(own, np.ones((1, 1), bool))
    way = travel(own, start, np.array([[-graph.reach]]))
    first = float(way.points.shapes.pressure[0, way.events[0].before])
    assert found.pressure[0] == pytest.approx(first, rel=1e-9)
    assert Departure(int(found.outcome[0])) is Departure.ASTRAY
    assert (found.unit[0], found.flipped[0]) == (0, 0)

    ways = Directions.of(np.zeros(1, np.int64), np.ones(1, np.uint64), 1).take(down)
    table = intervals(own, line, np.array([graph.reach]), ways)
    assert table.low[1] == pytest.approx(first, rel=1e-9)
    assert table.at_peak[:2].tolist() == [1, 1]
    assert table.after[:2].tolist() == [1, -1]
    assert table.after[-1] == 0
    assert table.low[2:] == pytest.approx(table.high[1:-1])

    draws = [(np.arange(1), own.take_lanes(np.zeros(1, np.int64)))]
    spread = spread_rows(draws, line, graph.reach, found, 1)
    assert spread["pressure_mean_MPa"][0] == pytest.approx(first, rel=1e-9)


def test_a_free_dome_goes_from_well_to_well() -> None:
    """Far from its neighbor it snaps at each of its tops in turn, and meets it where it comes."""
    own, peer = rippled([60.0], contact=12.5, barrier=0.3), Peer(12.5, 0.3)
    start, _ = at_rest(own, np.zeros((1, 1), bool))
    tops = peer.extremes("dome", -12.5, TRAVEL - 12.5, 1.0)
    forces = peer.dome(np.array(tops))
    rising = [float(f) for k, f in enumerate(forces) if f > forces[:k].max(initial=-1.0)]
    way = travel(own, start, np.array([[1.2 * max(rising) / 60.0]]))
    pressures = [float(way.points.shapes.pressure[0, event.before]) for event in way.events]
    assert len(rising) > 1, "it has tops one higher than the other"
    assert pressures[: len(rising)] == pytest.approx([f / 60.0 for f in rising], rel=1e-6)
    kinds = {event.kind for event in way.events[: len(rising)]}
    assert kinds == {EventKind.SNAP}
    assert way.final.inverted.all()


def test_a_dome_that_leaves_its_neighbor_at_rest_is_as_inverted_as_before() -> None:
    """The unit is straight then; it flips where the dome loses its place, at its own bottom."""
    own, peer = rippled([60.0], contact=10.0), Peer(10.0)
    start, _ = at_rest(own, np.ones((1, 1), bool))
    bottoms = peer.dome(np.array(peer.extremes("dome", -6.0, TRAVEL - 10.0, -1.0)))
    way = travel(own, start, np.array([[1.05 * float(bottoms.min()) / 60.0]]))
    digits = way.points.shapes.inverted[0]
    found = [(event.kind, bool(digits[event.after])) for event in way.events]
    kinds = [(EventKind.RESET, True), (EventKind.RELEASE, True), (EventKind.RESET, False)]
    assert found == kinds
    release = way.points.shapes.pressure[0, way.events[1].before]
    assert release == pytest.approx(float(peer.dome(np.zeros(()))) / 60.0, rel=1e-6)
