"""Domes that only push, with walls: against an energy in which each dome's travel is a coordinate.

A dome has its travel y beside its unit's opening x, and touches through the wall: c_w in series is
½ max(0, y − x)²/c_w. Between rigid bars turns θ and travels y are all there is. Nothing of the
package is in it; minima are followed in small steps, and gone downhill from where they end.
"""

from dataclasses import replace

import numpy as np
import pytest

from dpgcli.actuation.pressed import Halt, Pressed
from dpgcli.actuation.rest import at_rest
from dpgcli.actuation.staircase import driven
from dpgcli.arrays import Array
from dpgcli.mechanics.finger import uniform_finger
from dpgcli.mechanics.laws import PUBLISHED, PushOnly
from dpgcli.mechanics.pressure import DomeVolumes
from dpgcli.states.patterns import texts
from dpgcli.states.units import UnitSolutions

pytestmark = pytest.mark.slow

HEIGHT, N_STEPS = 12.0, 400


class OwnEnergy:
    """Of some domes with their hinges: gradient and Hessian by turns θ, then travels y."""

    def __init__(
        self, stroke: Array, k: Array, alpha: Array, hinge: float, coupling: float
    ) -> None:
        self.stroke, self.k, self.beta, self.n = stroke, k, 1.0 - alpha, len(k)
        beside = np.eye(self.n, k=1) + np.eye(self.n, k=-1)
        self.hinges = hinge * np.eye(self.n) - coupling * beside
        self.wall = 0.0

    def derivatives(self, place: Array, push: Array) -> tuple[Array, Array]:
        turn, y = place[: self.n], place[self.n :]
        x, slope = 2.0 * HEIGHT * np.sin(turn / 2.0), HEIGHT * np.cos(turn / 2.0)
        u, overlap = y / self.stroke, np.maximum(y - x, 0.0)
        dome = self.k * y * (1.0 + self.beta * (2.0 * u * u - 3.0 * u))
        stiffness = self.k * (1.0 + self.beta * (6.0 * u * u - 6.0 * u))
        contact, rate = overlap / self.wall, (overlap > 0.0) / self.wall
        gradient = np.concatenate([self.hinges @ turn - contact * slope, dome + contact - push])
        corner = self.hinges + np.diag(rate * slope**2 + contact * x / 4.0)
        across = np.diag(-rate * slope)
        return gradient, np.block([[corner, across], [across, np.diag(stiffness + rate)]])

    def minimum(self, place: Array, push: Array) -> Array:
        """Downhill by Newton steps with positive curvatures, none longer than a small share."""
        scale = np.concatenate([np.full(self.n, 1.0 / HEIGHT), np.ones(self.n)])
        for _ in range(4000):
            gradient, hessian = self.derivatives(place, push)
            values, vectors = np.linalg.eigh(hessian * scale * scale[:, None])
            step = -vectors @ ((vectors.T @ (gradient * scale)) / np.abs(values))
            size = np.abs(step).max()
            place = place + scale * step * min(1.0, 0.02 / size)
            if size < 1e-11:
                break
        return place


@pytest.mark.parametrize("seed", range(6))
def test_flips_are_those_of_the_own_energy(seed: int) -> None:
    random = np.random.default_rng(seed)
    n, alpha = int(random.integers(2, 4)), 0.043
    stroke, k = random.uniform(2.0, 5.0, n), 10.0 ** random.uniform(1.0, 1.7, n)
    hinge, area = 10.0 ** random.uniform(1.0, 1.7), random.uniform(10.0, 50.0, n)
    coupling, wall = hinge * random.uniform(0.03, 0.45), 10.0 ** random.uniform(-3.0, -1.5)
    own = OwnEnergy(stroke, k, np.full(n, alpha), hinge, coupling)
    own.wall = wall
    furthest = float((0.25 * k * stroke / area).max())

    finger = uniform_finger(
        n,
        segment_length=13.0,
        segment_height=HEIGHT,
        stroke=1.0,
        bistable_stiffness=1.0,
        force_linearity=alpha,
        hinge_stiffness=hinge,
        linear_stiffness=np.inf,
    ).changed(
        stroke=stroke[:, None],
        bistable_stiffness=k[:, None],
        wall_compliance=np.array([[wall]]),
        hinge_coupling=np.array([[coupling]]),
    )
    finger = replace(finger, law=PushOnly(PUBLISHED))
    pressed = Pressed(UnitSolutions.of(finger), DomeVolumes(area[:, None]))
    shapes, _ = at_rest(pressed, np.zeros((n, 1), bool))
    way = driven(pressed, shapes, np.full((n, 1), furthest))
    assert way.reason.tolist() == [Halt.ARRIVED]
    flips = [event for event in way.events if event.flipped.any()]
    found = [
        (texts(event.after.inverted)[0].decode(), event.halted.shapes.pressure[0, 0])
        for event in flips
    ]

    place, expected, before = np.zeros(2 * n), [], "0" * n
    top = stroke * (3.0 * own.beta - np.sqrt(9.0 * own.beta**2 - 8.0 * own.beta)) / (4.0 * own.beta)
    for pressure in np.linspace(0.0, furthest, N_STEPS + 1)[1:]:
        place = own.minimum(place, pressure * area)
        pattern = "".join("1" if y > t else "0" for y, t in zip(place[n:], top, strict=True))
        if pattern != before:
            expected.append((pattern, pressure))
        before = pattern
    step = furthest / N_STEPS
    assert [pattern for pattern, _ in found] == [pattern for pattern, _ in expected]
    assert len(found) >= 1
    for (_, threshold), (_, seen) in zip(found, expected, strict=True):
        assert seen - 1.05 * step <= threshold <= seen
