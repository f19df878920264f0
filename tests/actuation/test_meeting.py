"""Domes that rest against their neighbors: in touch or apart as pressures begin to change."""

from collections.abc import Callable
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from dpgcli.actuation.meeting import about_to_touch, with_touching
from dpgcli.actuation.pressed import Halt, Pressed
from dpgcli.actuation.rest import at_rest
from dpgcli.actuation.staircase import Way, driven
from dpgcli.arrays import Array
from dpgcli.equilibrium.corrector import corrected
from dpgcli.equilibrium.loaded import along
from dpgcli.equilibrium.steps import AWAY
from dpgcli.mechanics.finger import Finger, uniform_finger
from dpgcli.mechanics.laws import PUBLISHED, PushOnly
from dpgcli.mechanics.pressure import DomeVolumes
from dpgcli.states.certify import Status
from dpgcli.states.units import UnitSolutions

Study = Callable[..., Finger]
Made = Callable[..., Pressed]
Limits = Callable[[float], tuple[float, float]]
AREA = 4.7261788958 / 0.1495
HINGE, COUPLING, HEIGHT = 13.0, 6.0, 12.0
AREAS = np.array([[5.0], [30.0]])


def pushing(finger: Finger) -> Finger:
    return replace(finger, law=PushOnly(PUBLISHED))


def uneven(coupling: float = COUPLING) -> Pressed:
    """Two units between rigid bars; the second turns the first faster than its own dome does."""
    finger = uniform_finger(
        2,
        segment_length=13.0,
        segment_height=HEIGHT,
        stroke=1.0,
        bistable_stiffness=1.0,
        force_linearity=0.05,
        hinge_stiffness=HINGE,
        linear_stiffness=np.inf,
    ).changed(
        stroke=np.array([[2.7], [4.6]]),
        bistable_stiffness=np.array([[48.0], [10.0]]),
        force_linearity=np.array([[0.05], [0.034]]),
        hinge_coupling=np.array([[coupling]]),
    )
    return Pressed(UnitSolutions.of(pushing(finger)), DomeVolumes(AREAS))


def way_from(own: Pressed, pattern: str, *targets: list[float]) -> list[Way]:
    shapes, settled = at_rest(own, np.array([[digit == "1"] for digit in pattern]))
    assert settled.status.tolist() == [Status.STABLE]
    ways = []
    for target in targets:
        ways.append(driven(own, shapes, np.array(target)[:, None]))
        shapes = ways[-1].shapes
    return ways


@pytest.mark.parametrize(
    "bars",
    [
        1e4,
        np.inf,
        *(pytest.param(k, marks=pytest.mark.slow) for k in (1e2, 1e3, 9e3, 1e5, 1e7)),
    ],
)
def test_domes_without_pressure_do_not_flicker(
    bars: float, study: Study, pressed: Made, closed_form: Limits
) -> None:
    """Beside one that resets: bars move their gaps by less than rounding, or by very little."""
    (way,) = way_from(pressed(pushing(study(3, bars))), "001", [0.0, 0.0, -0.1])
    assert way.reason.tolist() == [Halt.ARRIVED]
    flips = [event for event in way.events if event.flipped.any()]
    assert len(way.events) <= (1 if bars >= 1e4 else 5)
    assert [event.flipped[:, 0].tolist() for event in flips] == [[False, False, True]]
    reset = flips[0].halted.shapes.pressure[2, 0] * AREA
    assert reset == pytest.approx(closed_form(3.5)[1], rel=1e-9 + 0.1 / bars)


def test_a_neighbor_that_moves_away_faster_is_not_pushed() -> None:
    """The snap of the second unit, whose hinge is softer by κ²/k as the first one follows it."""
    up, down = way_from(uneven(), "00", [0.3, 0.3], [0.0, 0.0])
    assert up.reason.tolist() == down.reason.tolist() == [Halt.ARRIVED]
    flips = [event for event in (*up.events, *down.events) if event.flipped.any()]
    assert [event.flipped[:, 0].tolist() for event in flips] == [[False, True]]
    assert down.shapes.inverted[:, 0].tolist() == [False, True]

    def push(opening: float) -> float:
        u, beta = opening / 4.6, 1.0 - 0.034
        turn = 2.0 * np.arcsin(opening / (2.0 * HEIGHT))
        by_hinge = (HINGE - COUPLING**2 / HINGE) * turn
        by_dome = 10.0 * opening * (1.0 + beta * (2.0 * u * u - 3.0 * u))
        return float(by_dome + by_hinge / (HEIGHT * np.cos(0.5 * turn)))

    top = minimize_scalar(lambda x: -push(x), bounds=(0.1, 2.0), options={"xatol": 1e-10})
    expected = push(float(top.x)) / 30.0
    assert flips[0].halted.shapes.pressure[1, 0] == pytest.approx(expected, rel=1e-9)
    assert expected == pytest.approx(0.15624, abs=1e-5)


def test_a_push_may_grow_and_end_within_a_step() -> None:
    """At first both push; the faster one's neighbor soon turns away from its own dome."""
    finger = pushing(
        uniform_finger(
            2,
            segment_length=13.0,
            segment_height=HEIGHT,
            stroke=1.0,
            bistable_stiffness=1.0,
            force_linearity=0.043,
            hinge_stiffness=22.77074019774967,
            linear_stiffness=np.inf,
        )
    ).changed(
        stroke=np.array([[3.4197321791770556], [4.386344695479607]]),
        bistable_stiffness=np.array([[18.194989198155575], [41.66548195450408]]),
        hinge_coupling=np.array([[9.704460954845704]]),
    )
    own = Pressed(UnitSolutions.of(finger), DomeVolumes(np.array([[30.0]])))
    (way,) = way_from(own, "00", [0.1, 0.1])
    assert way.reason.tolist() == [Halt.ARRIVED]
    (event,) = way.events
    assert (event.halted.reason[0], event.halted.unit[0]) == (Halt.RELEASE, 1)
    at = event.halted.shapes
    law = own.family(at, at.pressure).law
    force = law.free(own.extensions(at.coordinates), np.zeros(1)).force
    assert at.pressure[1, 0] > 0.01
    assert abs(force[1, 0]) <= AWAY * finger.force_scale.min() < abs(force[0, 0])


def rates(own: Pressed, coordinates: Array, change: Array, touching: Array) -> Array | None:
    """Rates of free forces with these domes in touch; None where that is no equilibrium."""
    shapes, _ = at_rest(own, np.zeros(change.shape, bool))
    family = with_touching(own.family(shapes, change), touching)
    nothing, none = np.zeros(1), np.full(1, -1)
    depth = max(family.column_depths)
    here = corrected(family, coordinates, nothing, none, nothing, depth)
    moved = along(family.measure.rows, here.measured, here.along_load)
    stiffness = family.law.free(here.measured.value, nothing).stiffness
    return stiffness * moved + family.law.free_rate(here.measured.value) if here.is_fine else None


@pytest.mark.parametrize("seed", [0, 1, pytest.param(2, marks=pytest.mark.slow)])
def test_it_is_the_one_choice_of_all_that_is_right(seed: int, study: Study) -> None:
    """Against all 2^n: pushes that do not pull, gaps that do not close below nothing."""
    random = np.random.default_rng(seed)
    n = 3
    for _ in range(4):
        finger = pushing(study(n, random.choice([np.inf, 300.0]))).changed(
            stroke=random.uniform(2.0, 5.0, (n, 1)),
            bistable_stiffness=10.0 ** random.uniform(1.0, 1.7, (n, 1)),
            hinge_coupling=24.2 * random.uniform(-0.45, 0.45, (1, 1)),
        )
        own = Pressed(UnitSolutions.of(finger), DomeVolumes(random.uniform(5.0, 50.0, (n, 1))))
        shapes, _ = at_rest(own, np.zeros((n, 1), bool))
        change = random.normal(size=(n, 1)) * random.choice([0.0, 1.0], (n, 1), p=[0.3, 0.7])
        if not change.any():
            continue
        right = []
        for choice in product([False, True], repeat=n):
            touching = np.array(choice)[:, None]
            rate = rates(own, shapes.coordinates, change, touching)
            if rate is not None and (np.where(touching, -rate, rate) >= -1e-9 * AREA).all():
                right.append(touching)
        found = about_to_touch(own.family(shapes, change), shapes.coordinates)
        assert found is not None
        assert any((found == one).all() for one in right)
        assert len(right) == 1 or (change == 0.0).any()  # at no rate both are


@pytest.mark.parametrize("travel", [0.0, 16.0])
def test_gaps_close_onto_domes_at_rest_where_these_are(travel: float) -> None:
    """By the published energy at once; by a curve of its travel a ground dome is far away."""
    own = uneven(-COUPLING)
    finger = own.finger.changed(dome_travel=np.full((2, 1), travel))
    own = Pressed(UnitSolutions.of(finger), own.volumes)
    shapes, settled = at_rest(own, np.array([[False], [True]]))
    assert own.extensions(shapes.coordinates)[0, 0] < -0.1
    is_closed = travel == 0.0
    assert settled.status.tolist() == [Status.GAP_CLOSED if is_closed else Status.STABLE]
