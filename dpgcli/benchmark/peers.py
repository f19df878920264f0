"""Third-party methods for the stable states of a finger: minimizers, and a spring package.

Each peer is set up as a competent user would, and finds one state at a time from a starting
shape. Shapes are the free nodes (B_1x, B_1y, T_1x, T_1y, B_2x, …) in mm.
"""

from collections.abc import Callable
from contextlib import redirect_stdout
from importlib.util import find_spec
from io import StringIO
from typing import Any, NamedTuple

import numpy as np

from dpgcli.arrays import Array
from dpgcli.benchmark.network import SpringNetwork, by_unit
from dpgcli.mechanics.finger import Finger

LARGEST_IMBALANCE = 1e-2  # of the forces in play: more unbalanced force is no result
MOST_STEPS = 500  # of Newton's method
SHORTEST_STEP = 1e-9  # mm; what remains after it is its square
SUFFICIENT_DECREASE = 1e-4  # Nocedal and Wright, Numerical Optimization (2006), page 33
ENERGY_ROUNDING = 1e-14  # of the energy: a decrease smaller than that cannot be seen

Solve = Callable[[Array], Array]


class Peer(NamedTuple):
    """A third-party method that finds stable states.

    `prepare` does what a user would do once for a finger (one design, elastic bars); what it
    returns takes a starting shape, (4 n,), to the state found, (4 n,), NaN if it gave up.
    """

    name: str
    prepare: Callable[[Finger], Solve]


def peers() -> tuple[Peer, ...]:
    """The peers whose package is installed; SciPy always is."""
    always = (
        Peer("SciPy BFGS, numerical gradient", _bfgs_by_differences),
        Peer("SciPy BFGS, analytic gradient", _bfgs),
        Peer("Newton, state by state", _newton),
    )
    return (*always, Peer("springable", _springable)) if find_spec("springable") else always


def tip_pose(nodes: Array) -> Array:
    """Tip x, y (mm) and angle (rad) of shapes (4 n, state), as an array (3, state).

    The angle is the sum of the turns from strut to strut, negative where the finger curls.

    >>> tip_pose(np.array([[3.0], [0.0], [5.0], [0.0]])).ravel().round(4)
    array([ 3.    ,  0.    , -1.5708])
    """
    strut = nodes[2::4] - nodes[0::4] + 1j * (nodes[3::4] - nodes[1::4])
    turned = np.concatenate((strut[:1] / 1j, strut[1:] * strut[:-1].conj()))
    return np.stack((nodes[-4], nodes[-3], np.angle(turned).sum(axis=0)))


def _bfgs_by_differences(finger: Finger) -> Solve:
    """BFGS with the energy alone, by central differences.

    SciPy's default, forward differences over 1.5e-8 mm, errs by 1e-4 N on bars of 1e4 N/mm.
    Most searches still end with "precision loss", where a line search fails.
    """
    from scipy.optimize import minimize

    network = SpringNetwork.of(finger)

    def solve(start: Array) -> Array:
        found = minimize(
            network.energy, start, method="BFGS", jac="3-point", options={"gtol": 1e-5}
        )
        return _balanced_or_nan(finger, network, found.x)

    return solve


def _bfgs(finger: Finger) -> Solve:
    """BFGS with the gradient, to 1e-6 N.

    Below that nothing is gained: energies differ by less than their rounding, line searches
    fail and most searches end with "precision loss".
    """
    from scipy.optimize import minimize

    network = SpringNetwork.of(finger)

    def solve(start: Array) -> Array:
        found = minimize(
            network.energy_and_gradient, start, method="BFGS", jac=True, options={"gtol": 1e-6}
        )
        return _balanced_or_nan(finger, network, found.x)

    return solve


def _newton(finger: Finger) -> Solve:
    """Newton's method with a dense Hessian, steps halved until the energy decreases."""
    network = SpringNetwork.of(finger)

    def solve(start: Array) -> Array:
        nodes = start
        for _ in range(MOST_STEPS):
            step = _newton_step(network, nodes)
            nodes = nodes + step
            if not np.abs(step).max() > SHORTEST_STEP:
                break
        return _balanced_or_nan(finger, network, nodes)

    return solve


def _newton_step(network: SpringNetwork, nodes: Array) -> Array:
    """Newton's step, (4 n,), shortened until the energy decreases enough; zero if uphill."""
    value, gradient = network.energy_and_gradient(nodes)
    try:
        step = np.asarray(np.linalg.solve(network.hessian(nodes), -gradient), float)
    except np.linalg.LinAlgError:
        return np.zeros_like(nodes)
    slope = float(gradient @ step)
    if slope > 0.0:
        return np.zeros_like(nodes)
    allowed = value + ENERGY_ROUNDING * abs(value)
    while network.energy(nodes + step) > allowed + SUFFICIENT_DECREASE * slope:
        step, slope = 0.5 * step, 0.5 * slope
    return step


def _springable(finger: Finger) -> Solve:
    """The package springable: BFGS with the gradient on an unloaded assembly.

    If it gives up, it prints so and leaves the starting shape.
    """
    from springable.mechanics.load import LoadStep
    from springable.mechanics.model import Model
    from springable.mechanics.static_solver import StaticSolver

    network, assembly = SpringNetwork.of(finger), springable_parts(finger).assembly
    solver = StaticSolver(Model(assembly, [LoadStep([], [], [], [])]))
    clamped = assembly.get_coordinates()[:4]

    def solve(start: Array) -> Array:
        assembly.set_coordinates(np.concatenate((clamped, start)))
        with redirect_stdout(StringIO()):
            solver.guide_spring_assembly_to_natural_configuration()
        return _balanced_or_nan(finger, network, assembly.get_coordinates()[4:])

    return solve


class SpringableParts(NamedTuple):
    """A finger in springable: its nodes in the order B_0, T_0, B_1, … and its elements."""

    base: list[Any]
    top: list[Any]
    elements: list[Any]

    @property
    def assembly(self) -> Any:
        """All of them together."""
        from springable.mechanics.assembly import Assembly

        return Assembly({*self.base, *self.top}, self.elements, auto_node_numbering=False)


def springable_parts(finger: Finger) -> SpringableParts:
    """A unit's chord, far strut, dome and two corners."""
    from springable.mechanics.element import Element
    from springable.mechanics.mechanical_behavior import LinearBehavior
    from springable.mechanics.node import Node
    from springable.mechanics.shape import Angle, SegmentLength

    values = by_unit(finger)
    height, bar = values["segment_height"][0], values["linear_stiffness"][0]
    along = np.concatenate(([0.0], np.cumsum(values["segment_length"])))
    base, top = (
        [Node(x, y, i == 0, i == 0, 2 * i + row) for i, x in enumerate(along)]
        for row, y in enumerate((0.0, height))
    )
    elements = []
    for i, dome in enumerate(_springable_domes(values)):
        corner = LinearBehavior(np.pi / 2.0, 2.0 * values["hinge_stiffness"][i])
        chord = LinearBehavior(values["segment_length"][i], bar)
        elements += [
            Element(SegmentLength(base[i], base[i + 1]), chord),
            Element(SegmentLength(base[i + 1], top[i + 1]), LinearBehavior(height, bar)),
            Element(SegmentLength(top[i], top[i + 1]), dome),
            Element(Angle(base[i + 1], base[i], top[i]), corner),
            Element(Angle(top[i + 1], base[i + 1], base[i]), corner),
        ]
    return SpringableParts(base, top, elements)


def _springable_domes(values: dict[str, Array]) -> list[Any]:
    """The bistable law as a behavior of springable, one for each unit.

    Its BezierBehavior can be the same cubic from x = 0 on, but not below, and is slower.
    """
    from springable.mechanics.mechanical_behavior import UnivariateBehavior

    class Bistable(UnivariateBehavior):  # type: ignore[misc]  # springable has no types
        def elastic_energy(self, alpha: float) -> float:
            k, x, u, softening = self._at(alpha)
            return 0.5 * k * x * x * (1.0 + softening * u * (u - 2.0))

        def gradient_energy(self, alpha: float) -> tuple[float]:
            k, x, u, softening = self._at(alpha)
            return (k * x * (1.0 + softening * u * (2.0 * u - 3.0)),)

        def hessian_energy(self, alpha: float) -> tuple[float]:
            k, _, u, softening = self._at(alpha)
            return (k * (1.0 + 6.0 * softening * u * (u - 1.0)),)

        def _at(self, length: float) -> tuple[float, float, float, float]:
            given, extension = self._parameters, length - self._natural_measure
            return given["k"], extension, extension / given["d"], given["softening"]

    names = ("segment_length", "bistable_stiffness", "force_linearity", "stroke")
    return [
        Bistable(length, k=stiffness, softening=1.0 - linearity, d=stroke)
        for length, stiffness, linearity, stroke in zip(*map(values.get, names), strict=True)
    ]


def _balanced_or_nan(finger: Finger, network: SpringNetwork, nodes: Array) -> Array:
    """The nodes, or NaN if the unbalanced force exceeds `LARGEST_IMBALANCE` of those in play."""
    _, gradient = network.energy_and_gradient(nodes)
    is_balanced = np.abs(gradient).max() <= LARGEST_IMBALANCE * finger.force_scale.max()
    return nodes if is_balanced else np.full_like(nodes, np.nan)
