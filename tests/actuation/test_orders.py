"""Orders of thresholds that patterns need, against all that a Preisach model reaches."""

from typing import Any

import numpy as np
import pytest

from dpgcli.actuation.alone import Thresholds
from dpgcli.actuation.orders import Obstacle, needed_order, obstacles


def alone(snap: list[float], reset: list[float]) -> Thresholds:
    return Thresholds(np.array(snap)[:, None], np.array(reset)[:, None], np.array([9.0]))


@pytest.mark.parametrize("n_lines", [1, 2])
@pytest.mark.parametrize("seed", range(25))
def test_patterns_without_obstacles_are_those_that_hysterons_reach(
    hysterons: Any, seed: int, n_lines: int
) -> None:
    random = np.random.default_rng(seed)
    n = 5
    snap, reset = random.uniform(0.1, 0.2, n), -random.uniform(0.05, 0.1, n)
    lines = random.integers(0, n_lines, n)
    peer = hysterons(tuple(snap), tuple(reset), tuple(lines.tolist()))
    reached = peer.reached()
    assert 1 < len(reached) < 2**n or n_lines > 1
    for code in range(2**n):
        inverted = np.array([digit == "1" for digit in f"{code:0{n}b}"])
        free = not obstacles(alone([*snap], [*reset]), lines, inverted)
        assert free == (tuple(inverted.tolist()) in reached)


def test_equal_units_are_ties_and_units_in_the_wrong_order_are_not() -> None:
    line, wanted = np.zeros(3, np.int64), np.array([True, False, False])
    found = obstacles(alone([0.15, 0.15, 0.14], [-0.06, -0.06, -0.07]), line, wanted)
    assert found == [Obstacle(0, 1, True), Obstacle(0, 2, False)]
    nearly = obstacles(alone([0.15, 0.15 * (1 + 1e-7), 0.2], [-0.06, -0.06, -0.1]), line, wanted)
    assert nearly == [Obstacle(0, 1, True)]


def test_units_that_never_snap_or_reset_have_no_place_in_the_order() -> None:
    line, wanted = np.zeros(2, np.int64), np.array([True, False])
    never = float("nan")
    assert obstacles(alone([0.1, never], [-0.1, -0.1]), line, wanted) == []
    assert obstacles(alone([0.2, 0.1], [-0.1, never]), line, wanted) == [Obstacle(0, 1, False)]
    assert obstacles(alone([0.2, 0.1], [never, -0.1]), line, wanted) == []


def test_the_order_in_words() -> None:
    every = np.arange(4)
    text = needed_order(np.array([True, False, True, False]), every)
    assert text == "each of units 1,3 must snap before each of units 2,4, or reset after that"
    text = needed_order(np.array([False, False, True, True]), every[1:3])
    assert text == "unit 3 must snap before unit 2, or reset after it"
