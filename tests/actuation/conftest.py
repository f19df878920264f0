"""Fingers under pressure, as the tests of this folder take them."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from dpgcli.actuation.pressed import Pressed
from dpgcli.mechanics.finger import STUDY, Finger, uniform_finger
from dpgcli.mechanics.pressure import DomeVolumes
from dpgcli.states.units import UnitSolutions

AREA = 4.7261788958 / 0.1495  # mm², of the study's springs


@pytest.fixture
def study() -> Callable[..., Finger]:
    """The study's finger, of n units and with bars of some stiffness."""

    def made(n_units: int, linear_stiffness: float = 1e4) -> Finger:
        return uniform_finger(n_units, **STUDY, linear_stiffness=linear_stiffness)

    return made


@pytest.fixture
def pressed() -> Callable[..., Pressed]:
    """A finger under pressure, by its effective area, mm²."""

    def made(finger: Finger, area: float = AREA) -> Pressed:
        return Pressed(UnitSolutions.of(finger), DomeVolumes(np.array([[area]])))

    return made


@pytest.fixture
def closed_form() -> Callable[[float], tuple[float, float]]:
    """The largest and the smallest force of the study's unit between rigid bars, by its stroke."""

    def limits(stroke: float) -> tuple[float, float]:
        """Largest and smallest slope of e(x) = E(x) + ½ k_θ φ², x = 2H sin(φ/2), N; by SciPy."""
        k, alpha, hinge, height = 12.84, 0.043, 24.2, 10.75

        def slope(x: float) -> float:
            u = x / stroke
            turn = 2.0 * np.arcsin(x / (2.0 * height))
            spring = k * x * (1.0 + (1.0 - alpha) * (2.0 * u * u - 3.0 * u))
            return float(spring + hinge * turn / (height * np.cos(turn / 2.0)))

        ways = {"method": "bounded", "options": {"xatol": 1e-12}}
        snap = minimize_scalar(lambda x: -slope(x), bounds=(0.0, 0.5 * stroke), **ways)
        reset = minimize_scalar(slope, bounds=(0.5 * stroke, stroke), **ways)
        return -float(snap.fun), float(reset.fun)

    return limits


State = tuple[bool, ...]


@dataclass(frozen=True)
class Hysterons:
    """Independent hysterons, the Preisach model: each flips up and down at thresholds of its own.

    A second way to what fingers between rigid bars do, which shares nothing with the program:
    thresholds up > 0 > down, and the line that each is on.
    """

    up: tuple[float, ...]
    down: tuple[float, ...]
    line: tuple[int, ...]

    def at(self, state: State, line: int, field: float) -> State:
        """The state once the field of a line has gone to a value, and stays there."""
        return tuple(
            is_up if own != line else (is_up or field >= up) and not field <= down
            for is_up, up, down, own in zip(state, self.up, self.down, self.line, strict=True)
        )

    def thresholds(self, state: State, line: int, sign: int) -> list[float]:
        """Fields at which units of a state flip as its line goes that way, nearest first."""
        own = [
            self.up[i] if sign > 0 else self.down[i]
            for i, is_up in enumerate(state)
            if self.line[i] == line and is_up == (sign < 0)
        ]
        return sorted(own, key=abs)

    def pulses(self, state: State, line: int, sign: int, reach: float) -> list[tuple[object, ...]]:
        """Ranges of peaks and the state that each leads to: hysterons stay when the field goes."""
        fields = [*self.thresholds(state, line, sign), sign * reach]
        return [(start, stop, self.at(state, line, start)) for start, stop in pairwise(fields)]

    def reached(self) -> set[State]:
        """States that pulses lead to from the one in which all are down."""
        found, todo = set[State](), [(False,) * len(self.up)]
        while todo:
            state = todo.pop()
            if state not in found:
                found.add(state)
                fields = zip((*self.up, *self.down), (*self.line, *self.line), strict=True)
                todo += [self.at(state, line, field) for field, line in fields]
        return found


@pytest.fixture
def hysterons() -> type[Hysterons]:
    """The peer of fingers between rigid bars."""
    return Hysterons
