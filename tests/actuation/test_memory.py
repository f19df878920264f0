"""Histories of pressure in the rigid limit: the Preisach model, and a published package of it."""

from collections.abc import Callable

import numpy as np
import pytest

from dpgcli.actuation.pressed import Halt, Pressed
from dpgcli.actuation.rest import at_rest
from dpgcli.actuation.staircase import driven, staircase
from dpgcli.arrays import Array, Flags
from dpgcli.mechanics.finger import Finger

Study = Callable[..., Finger]
Made = Callable[..., Pressed]
STROKES = np.array([[3.5], [2.6], [4.4], [3.1], [3.9]])
SEEDS = range(4)


@pytest.fixture
def finger(study: Study, pressed: Made) -> Pressed:
    """Five units between rigid bars, no two alike."""
    domes = 12.84 * np.array([[1.0], [1.1], [0.8], [1.25], [0.9]])
    made = study(5, np.inf).changed(stroke=STROKES, bistable_stiffness=domes)
    return pressed(made.with_bars(np.inf))


def thresholds(finger: Pressed) -> tuple[Array, Array]:
    """Pressures at which each unit goes up and down by itself, the first of each state's stairs."""
    n = finger.finger.n_units
    found = []
    for sign in (1.0, -1.0):
        only = np.eye(n, dtype=bool)
        start = ~only if sign > 0.0 else only  # one unit is free to go
        shapes, _ = at_rest(finger, start)
        stairs, _ = staircase(finger, shapes, np.full((n, n), sign), 1)
        assert (stairs[0].events.flipped == only).all()
        found.append(np.diag(stairs[0].events.halted.shapes.pressure))
    return found[0], found[1]


def history(seed: int, up: Array, down: Array, n_turns: int = 16) -> Array:
    """Turning points of one pressure, MPa: at random, among the thresholds up or those down."""
    random = np.random.default_rng(seed)
    ends = [(0.9 * side.min(), 1.1 * side.max()) for side in (up, -down)]
    highs, lows = (random.uniform(*end, n_turns) for end in ends)
    return np.where(random.random(n_turns) < 0.5, highs, -lows)


def states(finger: Pressed, pressures: Array) -> list[Flags]:
    """Patterns at the turning points, from rest."""
    n = finger.finger.n_units
    shapes, _ = at_rest(finger, np.zeros((n, 1), bool))
    found = []
    for pressure in pressures:
        way = driven(finger, shapes, np.full((n, 1), pressure))
        assert way.reason.tolist() == [Halt.ARRIVED]
        shapes = way.shapes
        found.append(shapes.inverted[:, 0].copy())
    return found


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS)
def test_random_histories_go_as_independent_hysterons_do(finger: Pressed, seed: int) -> None:
    up, down = thresholds(finger)
    state = np.zeros(len(up), bool)
    pressures = history(seed, up, down)
    patterns = states(finger, pressures)
    for pressure, pattern in zip(pressures, patterns, strict=True):
        state = (state | (pressure >= up)) & ~(pressure <= down)
        assert pattern.tolist() == state.tolist()
    assert len({tuple(pattern) for pattern in patterns}) >= 3, "a history that tells"


@pytest.mark.parametrize("seed", SEEDS)
def test_a_loop_within_a_loop_is_forgotten(finger: Pressed, seed: int) -> None:
    """Return-point memory: back at a turning point, the finger has the state that it had there."""
    random = np.random.default_rng(seed)
    low, high = -0.02 - 0.1 * random.random(), 0.1 + 0.1 * random.random()
    inner = np.sort(random.uniform(low, high, (4, 2)), axis=1)
    way = [high, low, *inner[:, ::-1].ravel(), low, *inner.ravel(), high, low]
    at = states(finger, np.array(way))
    assert at[10].tolist() == at[1].tolist() == at[-1].tolist()
    assert at[-2].tolist() == at[0].tolist()


@pytest.mark.parametrize("seed", SEEDS)
def test_a_published_package_of_hysterons_goes_the_same_way(finger: Pressed, seed: int) -> None:
    """hysteron 0.1.0 by N. Keim and J. Paulsen, without interactions."""
    package = pytest.importorskip("hysteron")
    up, down = thresholds(finger)
    state, field = -np.ones(len(up)), 0.0
    none, recorder = np.zeros((len(up), len(up))), package.hysteron.Recorder(0)
    pressures = history(seed, up, down)
    patterns = states(finger, pressures)
    for pressure, pattern in zip(pressures, patterns, strict=True):
        rising = int(pressure > field)
        package.hysteron.evolve_event(state, pressure, rising, none, up, down, recorder)
        assert (state > 0.0).tolist() == pattern.tolist()
        field = pressure
