"""Newton–Raphson, batched: damped, it walks downhill to a minimum; undamped, to a saddle, too.

A damped step solves L|D|Lᵀ p = −g, which is Newton's where the Hessian is positive definite and
goes downhill elsewhere; it is capped, and halved until the energy falls (Armijo; Nocedal and
Wright, Numerical Optimization, 2nd ed., 2006, sections 3.1 and 3.4). Lanes do not touch each
other: a lane's result is the same, bit for bit, in any batch.
"""

from dataclasses import fields
from typing import Any

import numpy as np

from dpgcli.arrays import Array, Flags, Indices, total
from dpgcli.equilibrium.banded import Factorization, backward, factorize, forward, in_lanes
from dpgcli.equilibrium.contracts import Coordinates
from dpgcli.equilibrium.potential import Evaluation, Potential
from dpgcli.records import dataclass

SUFFICIENT_DECREASE = 1e-4  # Nocedal and Wright (2006), page 33
SMALLEST_FRACTION = 2.0**-40  # of a step; below it a lane has stalled
SETTLED_STEP = 1e-6  # of the step cap; Newton squares it: the next step would be rounding
COMPACTING_SHARE = 0.25  # of finished lanes: from it on, dropping them pays for the copy
PIVOT_ROUNDING = 32 * np.finfo(float).eps  # of the diagonal it came from
ROUNDING = 64 * np.finfo(float).eps  # of the energies added up


@dataclass(frozen=True)
class Equilibrium:
    """The points at which the lanes stopped, with energy, gradient and factorization there.

    `residual` is the max-norm of the gradient as a force, N; `relative_residual` the same
    over the forces in play; `curvature` the smallest pivot over the stiffness it is measured
    by, positive where the Hessian is positive definite and no pivot's sign in doubt. `energies`
    are by kind, `iterations` counts steps. Shapes (batch,) but for `coordinates` and `gradient`,
    (size, batch).
    """

    coordinates: Array
    gradient: Array
    energies: dict[str, Array]
    factorization: Factorization
    residual: Array
    relative_residual: Array
    curvature: Array
    iterations: Indices

    @property
    def energy(self) -> Array:
        """All kinds of energy together."""
        first, *rest = self.energies.values()
        return sum(rest, start=first)

    def with_lanes(self, lanes: Indices, others: "Equilibrium", taken: Indices) -> "Equilibrium":
        """The equilibria with `lanes` replaced by those at `taken` of others of this potential."""

        def put(own: Any, other: Any) -> Any:
            if isinstance(own, dict):
                return {key: put(own[key], other[key]) for key in own}
            if isinstance(own, Factorization):
                pair = put(own.lower, other.lower), put(own.pivots, other.pivots)
                return Factorization(*pair, own.column_depths)
            changed = own.copy()
            changed[..., lanes] = other[..., taken]
            return changed

        parts = ((getattr(self, f.name), getattr(others, f.name)) for f in fields(self))
        return Equilibrium(*(put(own, other) for own, other in parts))


@in_lanes
def minimize(
    potential: Potential[Coordinates],
    guess: Array,
    tolerance: float,
    max_iterations: int = 200,
    largest_step: float = 1.0,
) -> Equilibrium:
    """Walk from `guess`, shape (size, batch), until each lane's relative residual is small.

    No step is larger than `largest_step` of the step cap: one that is small follows the valley.

    The last step must have been small as well: where stiff directions settle before soft
    ones, the residual alone stops too early. A lane that has not converged after
    `max_iterations` evaluations is returned where the walk was; its `relative_residual` tells.

    >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
    >>> from dpgcli.mechanics.terms import chain_potential
    >>> potential = chain_potential(uniform_finger(1, **STUDY))
    >>> found = minimize(potential, np.array([[0.05], [0.02]]), 1e-12)  # corners, rad
    >>> bool(np.abs(found.coordinates).max() < 1e-12), bool(found.curvature[0] > 0.0)  # straight
    (True, True)
    """
    n_lanes = guess.shape[1]
    final = np.ascontiguousarray(guess)
    iterations = np.full(n_lanes, max_iterations)
    lanes = np.arange(n_lanes)
    walk = _Walk.at(potential, final)
    final = final.copy()
    for count in range(max_iterations):
        evaluation = walk.potential.evaluate(walk.trial)
        newly = walk.look(evaluation, tolerance)
        iterations[lanes[newly]] = count
        if walk.finished.all():
            if len(lanes) == n_lanes and walk.accepted.all():
                return _equilibrium(potential, walk.here, evaluation, iterations)
            break
        if walk.finished.mean() > COMPACTING_SHARE:
            final[:, lanes] = walk.here
            keep = np.flatnonzero(~walk.finished)
            lanes = lanes[keep]
            walk, evaluation = walk.only(keep), _only(evaluation, keep)
        walk.step_from(evaluation, largest_step)
    final[:, lanes] = walk.here
    return _equilibrium(potential, final, potential.evaluate(final), iterations)


def looked_at(potential: Potential[Coordinates], coordinates: Array) -> Equilibrium:
    """What there is at coordinates, (size, batch), wherever they are: no step is taken.

    >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
    >>> from dpgcli.mechanics.terms import chain_potential
    >>> bent = looked_at(chain_potential(uniform_finger(1, **STUDY)), np.array([[0.2], [0.0]]))
    >>> bool(bent.residual[0] > 1.0), bent.iterations.tolist()
    (True, [0])
    """
    evaluation = potential.evaluate(coordinates)
    return _equilibrium(potential, coordinates, evaluation, np.zeros(coordinates.shape[1], int))


@in_lanes
def stationary(
    potential: Potential[Coordinates], guess: Array, tolerance: float, max_iterations: int = 40
) -> Equilibrium:
    """Walk by Newton's own steps, capped only, to where the gradient is small: maybe a saddle.

    What it is, is for the signs of the pivots to say. It has to begin near: `guess` (size, batch).

    >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
    >>> from dpgcli.mechanics.terms import chain_potential
    >>> potential = chain_potential(uniform_finger(1, **STUDY))
    >>> top = stationary(potential, np.array([[0.09], [0.09]]), 1e-12)  # corners, rad
    >>> print(sum(top.energies.values()).round(6), top.factorization.n_negative)  # mJ
    [6.038233] [1]
    """
    here, n_lanes = guess.copy(), guess.shape[1]
    iterations = np.full(n_lanes, max_iterations)
    settled, finished = np.zeros(n_lanes, bool), np.zeros(n_lanes, bool)
    for count in range(max_iterations):
        evaluation = potential.evaluate(here)
        newly = (_relative_residual(potential, evaluation.gradient) <= tolerance) & settled
        iterations[newly & ~finished] = count
        finished |= newly
        if finished.all():
            break
        factorization = factorize(evaluation.hessian, potential.column_depths)
        step = forward(factorization, -evaluation.gradient)
        step /= factorization.pivots
        step = backward(factorization, step)
        length = _largest(step, potential.coordinates.step_cap)
        step /= np.maximum(1.0, length)
        here = np.where(finished, here, potential.coordinates.moved(here, step))
        settled = length <= SETTLED_STEP
    return _equilibrium(potential, here, potential.evaluate(here), iterations)


@dataclass
class _Walk:
    """The lanes of a search: the present point of each, its energy, and the next trial point.

    `fraction` of `step` is what is tried; `settled` says that the last accepted step was small.
    """

    potential: Potential[Coordinates]
    here: Array
    trial: Array
    energy: Array
    step: Array
    slope: Array
    fraction: Array
    settled: Flags
    accepted: Flags
    finished: Flags

    @classmethod
    def at(cls, potential: Potential[Coordinates], guess: Array) -> "_Walk":
        """Lanes at their guesses, before the first evaluation."""
        n = guess.shape[1]
        yes, no = np.ones(n, bool), np.zeros(n, bool)
        infinite, zero, one = np.full(n, np.inf), np.zeros(n), np.ones(n)
        return cls(potential, guess, guess, infinite, guess, zero, one, yes, yes, no)

    def look(self, evaluation: Evaluation, tolerance: float) -> Flags:
        """Accept trials whose energy fell; return the lanes that this finishes."""
        accepted = self.finished | _falls(evaluation, self.energy, self.slope * self.fraction)
        if accepted.all():
            self.here, self.energy = self.trial, evaluation.energy
        else:
            self.here = np.where(accepted, self.trial, self.here)
            self.energy = np.where(accepted, evaluation.energy, self.energy)
        self.accepted = accepted
        converged = _relative_residual(self.potential, evaluation.gradient) <= tolerance
        stalled = ~accepted & (self.fraction < SMALLEST_FRACTION)
        newly = ((accepted & converged & self.settled) | stalled) & ~self.finished
        self.finished = self.finished | newly
        return newly

    def step_from(self, evaluation: Evaluation, largest: float) -> None:
        """Choose the next trial: a new step after an accepted one, else half of the last."""
        step, slope, length = _downhill(self.potential, evaluation, largest)
        if self.accepted.all():
            self.step, self.slope = step, slope
            self.fraction, self.settled = np.ones(len(slope)), length <= SETTLED_STEP
        else:
            self.step = np.where(self.accepted, step, self.step)
            self.slope = np.where(self.accepted, slope, self.slope)
            self.fraction = np.where(self.accepted, 1.0, 0.5 * self.fraction)
            self.settled = self.accepted & (length <= SETTLED_STEP)
        self.trial = self.potential.coordinates.moved(self.here, self.fraction * self.step)
        if self.finished.any():
            self.trial = np.where(self.finished, self.here, self.trial)

    def only(self, keep: Indices) -> "_Walk":
        """The walk of some lanes, the batch index still innermost in memory."""
        arrays = [np.take(getattr(self, f.name), keep, axis=-1) for f in fields(self)[1:]]
        return _Walk(self.potential.take_lanes(keep), *arrays)


def _falls(evaluation: Evaluation, energy: Array, expected: Array) -> Flags:
    """Whether the energy fell enough, given that it is known up to rounding only."""
    magnitude = sum(np.abs(part) for part in evaluation.energies)
    allowed = energy + SUFFICIENT_DECREASE * expected + ROUNDING * magnitude
    return np.asarray(evaluation.energy <= allowed)


def _downhill(
    potential: Potential[Coordinates], evaluation: Evaluation, largest: float
) -> tuple[Array, Array, Array]:
    """The step, the slope of the energy along it and its length over the cap; uses the Hessian."""
    factorization = factorize(evaluation.hessian, potential.column_depths)
    stiffness = np.maximum(np.abs(factorization.pivots), np.finfo(float).tiny)
    step = forward(factorization, -evaluation.gradient)
    step /= stiffness
    step = backward(factorization, step)
    length = _largest(step, potential.coordinates.step_cap)
    step /= np.maximum(1.0, length / largest)
    return step, total(evaluation.gradient * step), length


def _relative_residual(potential: Potential[Coordinates], gradient: Array) -> Array:
    return _largest(gradient, potential.coordinates.gradient_scale)


def _largest(values: Array, scale: Array) -> Array:
    """Max-norm over the coordinates of values / scale, shape (batch,)."""
    ratio = values / scale
    largest = np.maximum(ratio.max(axis=0), -ratio.min(axis=0))
    return np.asarray(np.abs(largest))  # no negative zero


def _only(evaluation: Evaluation, keep: Indices) -> Evaluation:
    return Evaluation(
        tuple(part[keep] for part in evaluation.energies),
        np.take(evaluation.gradient, keep, axis=-1),
        np.take(evaluation.hessian, keep, axis=-1),
    )


def _equilibrium(
    potential: Potential[Coordinates],
    coordinates: Array,
    evaluation: Evaluation,
    iterations: Indices,
) -> Equilibrium:
    diagonal = evaluation.hessian[0].copy()
    factorization = factorize(evaluation.hessian, potential.column_depths)
    gradient = evaluation.gradient
    return Equilibrium(
        coordinates,
        gradient,
        potential.by_kind(evaluation.energies),
        factorization,
        residual=_largest(gradient, potential.coordinates.force_unit),
        relative_residual=_relative_residual(potential, gradient),
        curvature=_curvature(factorization.pivots, diagonal, potential.coordinates.stiffness_scale),
        iterations=iterations,
    )


def _curvature(pivots: Array, diagonal: Array, scale: Array) -> Array:
    """Smallest pivot over its scale, (batch,); at most zero if a pivot may be rounding."""
    certain = pivots > PIVOT_ROUNDING * np.abs(diagonal)
    curvature = np.min(pivots / scale, axis=0)
    return np.asarray(np.where(certain.all(axis=0), curvature, np.minimum(curvature, 0.0)))
