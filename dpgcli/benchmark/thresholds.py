"""Followers of paths beside each other: the pressure at which a straight finger first snaps.

Pressure rises on all lines together. Each method is set up as a competent user would; errors are
those of the threshold, against the fold in extended precision.
"""

from collections.abc import Callable, Iterator
from contextlib import redirect_stdout
from dataclasses import replace
from importlib.util import find_spec
from io import StringIO
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from dpgcli.actuation.pressed import Halt, Halted, Pressed
from dpgcli.actuation.rest import at_rest
from dpgcli.arrays import Array
from dpgcli.benchmark.network import SpringNetwork
from dpgcli.benchmark.peers import springable_parts
from dpgcli.mechanics.finger import Finger
from dpgcli.records import dataclass
from dpgcli.reference.folds import extended_fold
from dpgcli.states.units import UnitSolutions

HIGHEST = 1.3  # of the threshold: where ways end
STEPS = 200  # of SciPy's way
CLOSEST = 1e-7  # of the range: where halving its steps ends
BATCH = 256  # fingers in a call
ARC = 0.1  # mm, springable's steps along the path
MOST_ARCS = 2000
FURTHEST = 1.0  # strokes of its loaded node


class Follower(NamedTuple):
    """A method; `run` gives the pressure (MPa) of `n_states` thresholds, NaN if it gave up."""

    name: str
    run: Callable[[], Array]
    n_states: int


@dataclass(frozen=True)
class SnapCase:
    """A straight finger, and the pressure (MPa) at which it snaps in truth, NaN if it does not."""

    pressed: Pressed
    threshold: float

    @classmethod
    def of(cls, pressed: Pressed) -> "SnapCase":
        """The case with its truth, from the end of the package's own way."""
        halted = _halted(pressed, _pressure_in_play(pressed), 1)
        if halted.reason[0] != Halt.FOLD:
            return cls(pressed, np.nan)
        if pressed.finger.is_rigid and pressed.finger.n_units > 1:  # units do not feel each other
            return cls(pressed, cls.of(_alone(pressed, int(halted.unit[0]))).threshold)
        pushes = (pressed.volumes.area * halted.shapes.pressure)[:, 0]
        coordinates, at = pressed.coordinates, halted.shapes.coordinates
        nodes = np.stack(coordinates.stations(at), axis=1).reshape(-1)
        walls = (pressed.extensions(at) - coordinates.openings(at))[:, 0]
        fold = extended_fold(pressed.finger, pushes, nodes, walls)
        own = float(halted.shapes.pressure[0, 0])
        return cls(pressed, np.nan if fold is None else float(own * fold.share))

    @property
    def pushes(self) -> Array:
        """Pushes at the threshold, N, (unit,)."""
        finger = self.pressed.finger
        return np.broadcast_to(self.pressed.volumes.area * self.threshold, (finger.n_units, 1))[
            :, 0
        ]

    def followers(self) -> Iterator[Follower]:
        """This package, one finger and many; third parties where only bars give way."""
        for n, name in (
            (1, "this package, one way"),
            (BATCH, f"this package, {BATCH} ways at once"),
        ):
            yield Follower(name, self._package(n), n)
        finger = self.pressed.finger
        if finger.is_rigid or finger.has_walls or finger.is_coupled:
            return
        yield Follower(
            "SciPy root, small steps", lambda: _stepped(finger, self.pushes) * self.threshold, 1
        )
        is_even = bool(np.ptp(self.pushes) == 0.0)
        if is_even and find_spec("springable"):
            push = float(self.pushes[0])
            yield Follower(
                "springable, arc length", lambda: _springable(finger, push) * self.threshold, 1
            )

    def _package(self, n: int) -> Callable[[], Array]:
        end = HIGHEST * self.threshold
        return lambda: _halted(self.pressed, end, n).shapes.pressure[0]


def _alone(pressed: Pressed, unit: int) -> Pressed:
    """One unit of a finger."""
    volumes = pressed.volumes
    area = np.broadcast_to(volumes.area, (pressed.finger.n_units, 1))[[unit]]
    finger = pressed.finger.with_units([unit])
    return Pressed(UnitSolutions.of(finger), replace(volumes, area=area))


def _pressure_in_play(pressed: Pressed) -> float:
    """A pressure that snaps every dome that can, MPa."""
    return float((pressed.finger.force_scale / pressed.volumes.area).max())


def _halted(pressed: Pressed, pressure: float, n: int) -> Halted:
    """Where straight fingers stop on the way to a pressure."""
    inverted = np.zeros((pressed.finger.n_units, n), bool)
    shapes, _ = at_rest(pressed, inverted)
    return pressed.followed(shapes, np.full(inverted.shape, pressure))


def _stepped(finger: Finger, pushes: Array) -> Array:
    """SciPy's root at loads that rise by small steps, halved where it finds no stable state.

    As a share of `pushes`, N.
    """
    from scipy.optimize import root

    network = SpringNetwork.of(finger)
    nodes, share = _straight(finger), 0.0
    step = HIGHEST / STEPS
    while step > CLOSEST and share < HIGHEST:
        there = network.pushed((share + step) * pushes)
        found = root(there.gradient, nodes, jac=there.hessian, tol=1e-12)
        is_near = np.abs(found.x - nodes).max() < finger.stroke.min()
        if is_near and found.success and np.linalg.eigvalsh(there.hessian(found.x))[0] > 0.0:
            nodes, share = found.x, share + step
        else:
            step *= 0.5
    return np.array([share])


def _straight(finger: Finger) -> Array:
    """Nodes of the straight finger, (4 n,)."""
    x = np.cumsum(np.broadcast_to(finger.segment_length, (finger.n_units, 1))[:, 0])
    height = np.full_like(x, finger.segment_height[0, 0])
    return np.stack((x, 0.0 * x, x, height), axis=1).reshape(-1)


def _springable(finger: Finger, push: float) -> Array:
    """The package springable, by arc length, as a share of the push of each dome, N.

    Its loads are forces on nodes. One more spring takes the sum of the domes' lengths and of the
    way of a node beside the finger: a force on that node acts along every dome alike.
    """
    from springable.mechanics.assembly import Assembly
    from springable.mechanics.element import Element
    from springable.mechanics.load import LoadStep
    from springable.mechanics.mechanical_behavior import LinearBehavior
    from springable.mechanics.model import Model
    from springable.mechanics.node import Node
    from springable.mechanics.shape import SegmentLength, SignedXDist, Sum
    from springable.mechanics.static_solver import StaticSolver

    base, top, elements = springable_parts(finger)
    number = len(base) + len(top)
    still = Node(0.0, -10.0, True, True, number)
    end = Node(10.0, -10.0, False, True, number + 1)
    domes = [SegmentLength(*ends) for ends in pairwise(top)]
    drawn = Sum(*domes, SignedXDist(end, still))
    spring = LinearBehavior(drawn.compute(0), float(finger.linear_stiffness.max()))
    nodes = {*base, *top, still, end}
    assembly = Assembly(nodes, [*elements, Element(drawn, spring)], auto_node_numbering=False)
    furthest = FURTHEST * float(finger.stroke.max())
    step = LoadStep([end], ["X"], [-HIGHEST * push], [furthest], ([], []))
    with redirect_stdout(StringIO()):
        result = StaticSolver(Model(assembly, [step]), radius=ARC, i_max=MOST_ARCS).solve()
    force = np.abs(result.get_node_forces(end, "X", check_usability=False))
    falls = np.flatnonzero(np.diff(force) < 0.0)
    return np.array([np.nan if not len(falls) else force[falls[0]] / push])
