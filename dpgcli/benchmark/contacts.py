"""Fingers against a body beside each other: this package and SciPy's constrained minimizers.

All have the same energy and the same gaps, with all derivatives that they take, and begin at the
free states. This package lets the body grow and so knows which state the finger comes to; others
look for a minimum with the body there in full, and one elsewhere is another state's.
"""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from dpgcli.arrays import Array, Flags
from dpgcli.benchmark.methods import BenchmarkMethod, BenchmarkResult
from dpgcli.design.bodies import Disc, gives_way
from dpgcli.design.scene import Scene
from dpgcli.grasping.frames import FingerFrame, begins_in_base, frames
from dpgcli.grasping.grasp import described, placed
from dpgcli.grasping.grasped import Grasped, Placed
from dpgcli.hard_cases.verdicts import dense
from dpgcli.mechanics.face import Face
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.gaps import FaceGaps
from dpgcli.mechanics.obstacle import Obstacle
from dpgcli.mechanics.terms import chain_potential
from dpgcli.records import dataclass
from dpgcli.reference.bodies import Body as ExactBody
from dpgcli.reference.bodies import RoundBody, StraightBody
from dpgcli.reference.contact import ExtendedContact, extended_contact
from dpgcli.reference.equilibria import ExtendedStates
from dpgcli.states.accuracy import DEFAULT_TOLERANCE
from dpgcli.states.certify import Status
from dpgcli.states.patterns import codes_of, inverted_units
from dpgcli.states.settle import settle
from dpgcli.states.units import UnitSolutions

BATCH = 256  # states in a call
ELSEWHERE = 0.1  # of a stroke: a tip so far from the state is another's
SLSQP: Any = {"ftol": 1e-13, "maxiter": 400}
TRUST_CONSTR: Any = {"gtol": 1e-9, "xtol": 1e-12, "maxiter": 600}


def meets_body(scene: Scene) -> bool:
    """Whether a scene has a body that fingers can meet, and that the reference knows: a convex one.

    It stays where it is, and jaws that give way do not.
    """
    body = scene.body
    if body is None or gives_way(body) or scene.layer_thickness is None:
        return False
    is_known = isinstance(body, Disc) or not Obstacle.polygon(body.corners).is_reentrant.any()
    return bool(is_known) and not begins_in_base(scene, body).any()


@dataclass(frozen=True)
class ContactCase:
    """Patterns (unit, state) of the upper finger against the scene's body, and what is true."""

    scene: Scene
    patterns: Flags
    truth: ExtendedStates

    @classmethod
    def of(cls, scene: Scene, patterns: Flags) -> "ContactCase":
        """The case with its truth: the states to which this package comes, in full precision."""
        own, found = _grasped(scene, patterns)
        states = [_extended(scene, own, found, state) for state in range(patterns.shape[1])]
        return cls(scene, patterns, _as_states(states, len(patterns)))

    def methods(self) -> Iterator[BenchmarkMethod]:
        """This package, the states alone and many at once; SciPy's minimizers."""
        n = self.patterns.shape[1]
        many = np.tile(self.patterns, (1, max(1, BATCH // n)))
        for patterns in (self.patterns, many):
            name = f"this package, {patterns.shape[1]} states at once"
            run = partial(_result, self.scene, patterns)
            yield BenchmarkMethod(name, "contact", run, patterns.shape[1], certifies=True)
        for name, solve in (("SciPy SLSQP", _slsqp), ("SciPy trust-constr", _trust_constr)):
            yield BenchmarkMethod(name, "contact", partial(self._by_peer, solve), n)

    def _by_peer(self, solve: Callable[["Problem", Array], Array]) -> BenchmarkResult:
        """States one by one; those that are elsewhere are NaN."""
        problem, starts = Problem.of(self.scene), _free(self.scene.finger, self.patterns)
        found = np.stack([solve(problem, start) for start in starts.T], axis=1)
        pose, _ = problem.coordinates.tip(found)
        energy = problem.potential.evaluate(found).energy
        away = np.hypot(*(pose - self.truth.pose)[:2].astype(float))
        is_there = away < ELSEWHERE * float(self.scene.finger.stroke.min())
        return BenchmarkResult(np.where(is_there, pose, np.nan), np.where(is_there, energy, np.nan))


def _upper(scene: Scene) -> FingerFrame:
    return frames(scene.gripper)[0]


def _grasped(scene: Scene, patterns: Flags) -> tuple[Placed, Grasped]:
    assert scene.body is not None, "a scene with a body"
    own = placed(scene, chain_potential, scene.body, _upper(scene), codes_of(patterns))
    (found,) = described(own.own, [own.codes], own.grown, own.status, with_margins=False)
    return own, found


def _result(scene: Scene, patterns: Flags) -> BenchmarkResult:
    own, found = _grasped(scene, patterns)
    potential = chain_potential(scene.finger)
    at = own.grown.shapes.coordinates
    pose, _ = potential.coordinates.tip(at)
    energy = potential.evaluate(at).energy
    is_there = found.status == Status.STABLE
    return BenchmarkResult(np.where(is_there, pose, np.nan), np.where(is_there, energy, np.nan))


def _extended(scene: Scene, own: Placed, found: Grasped, state: int) -> ExtendedContact | None:
    """The state in extended precision next to what was found, None where nothing was."""
    if found.status[state] != Status.STABLE:
        return None
    at = own.grown.shapes.coordinates[:, [state]]
    coordinates = chain_potential(scene.finger).coordinates
    nodes = np.stack(coordinates.stations(at), axis=1).reshape(-1)
    walls = (coordinates.springs(at).extension - coordinates.openings(at))[:, 0]
    after = inverted_units(found.after[[state]], scene.finger.n_units)[:, 0]
    return extended_contact(scene.finger, after, _exact(scene), nodes, walls)


def _exact(scene: Scene) -> ExactBody:
    """The body in the upper finger's frame, that of the reference."""
    body, frame = scene.body, _upper(scene)
    assert body is not None and scene.layer_thickness is not None, "a body to meet"
    thickness = float(np.ravel(scene.layer_thickness)[0])
    if isinstance(body, Disc):
        x, y = frame.inside(body.center).tolist()
        return RoundBody((x, y), float(body.radius), thickness)
    around = frame.obstacle(body).points[..., 0]  # the body to the left of its sides
    return StraightBody(tuple((float(x), float(y)) for x, y in around.T), thickness)


def _as_states(states: list[ExtendedContact | None], n_units: int) -> ExtendedStates:
    unknown = np.longdouble(np.nan)
    poses = [np.full(3, unknown) if s is None else s.pose for s in states]
    n = len(states)
    return ExtendedStates(
        pose=np.stack(poses, axis=1),
        energy=np.array([unknown if s is None else s.energy for s in states]),
        openings=np.full((n_units, n), unknown),
        min_eigenvalue=np.full(n, np.nan),
        condition=np.full(n, np.nan),
        is_minimum=np.array([s is not None and s.is_minimum for s in states]),
        in_pattern=np.array([s is not None and s.in_pattern for s in states]),
    )


def _free(finger: Finger, patterns: Flags) -> Array:
    """Coordinates of the free states, (size, state)."""
    free = settle(UnitSolutions.of(finger), chain_potential, patterns, DEFAULT_TOLERANCE)
    return free.equilibrium.coordinates


class Problem(NamedTuple):
    """Minimize an energy with gaps that are not negative, by z = q f in mm, f the force units."""

    potential: Any
    gaps: FaceGaps
    unit: Array

    @classmethod
    def of(cls, scene: Scene) -> "Problem":
        """That of the upper finger and the body."""
        potential = chain_potential(scene.finger)
        assert scene.body is not None and scene.layer_thickness is not None, "a body to meet"
        face = Face.of(potential.coordinates, np.reshape(scene.layer_thickness, (1, 1)))
        unit = np.broadcast_to(potential.coordinates.force_unit, (potential.coordinates.size, 1))
        gaps = FaceGaps(face, _upper(scene).obstacle(scene.body))
        return cls(potential, gaps, unit[:, 0])

    @property
    def coordinates(self) -> Any:
        """Those of the energy."""
        return self.potential.coordinates

    def _at(self, z: Array) -> Array:
        return np.asarray((z / self.unit)[:, None])

    def energy(self, z: Array) -> float:
        """E, N mm."""
        return float(self.potential.evaluate(self._at(z)).energy[0])

    def slope(self, z: Array) -> Array:
        """∂E/∂z, N."""
        return np.asarray(self.potential.evaluate(self._at(z)).gradient[:, 0] / self.unit)

    def bend(self, z: Array) -> Array:
        """∂²E/∂z², N/mm."""
        return self._scaled(dense(self.potential.evaluate(self._at(z)).hessian))

    def gap(self, z: Array) -> Array:
        """The gap of each side, mm."""
        return self.gaps(self._at(z)).value[:, 0]

    def gap_slope(self, z: Array) -> Array:
        """∂g/∂z, (side, size)."""
        rates = np.zeros((len(z), self.gaps.n_cells))
        rates[self.gaps.face.places] = self.gaps(self._at(z)).gradient[..., 0]
        return np.asarray((rates / self.unit[:, None]).T)

    def gap_bend(self, z: Array, push: Array) -> Array:
        """Σ μ ∂²g/∂z²."""
        places = self.gaps.face.places
        whole = np.zeros((len(z), len(z)))
        whole[np.ix_(places, places)] = self.gaps(self._at(z)).bent(push[:, None])[..., 0]
        return self._scaled(whole)

    def _scaled(self, matrix: Array) -> Array:
        return np.asarray(matrix / self.unit / self.unit[:, None])


def _slsqp(problem: Problem, start: Array) -> Array:
    from scipy.optimize import minimize

    gaps: Any = {"type": "ineq", "fun": problem.gap, "jac": problem.gap_slope}
    found = minimize(
        problem.energy,
        start * problem.unit,
        jac=problem.slope,
        constraints=gaps,
        method="SLSQP",
        options=SLSQP,
    )
    return np.asarray(found.x / problem.unit)


def _trust_constr(problem: Problem, start: Array) -> Array:
    from scipy.optimize import NonlinearConstraint, minimize

    bend: Any = problem.gap_bend
    gaps = NonlinearConstraint(problem.gap, 0.0, np.inf, jac=problem.gap_slope, hess=bend)
    found = minimize(
        problem.energy,
        start * problem.unit,
        jac=problem.slope,
        hess=problem.bend,
        constraints=gaps,
        method="trust-constr",
        options=TRUST_CONSTR,
    )
    return np.asarray(found.x / problem.unit)
