"""Damped Newton–Raphson, batched: each lane walks downhill on its own to a minimum.

A step solves L|D|Lᵀ p = −g, which is Newton's where the Hessian is positive definite and
goes downhill elsewhere; it is capped, and halved until the energy falls (Armijo; Nocedal and
Wright, Numerical Optimization, 2nd ed., 2006, sections 3.1 and 3.4). Lanes do not touch each
other: a lane's result is the same, bit for bit, in any batch.
"""

from dataclasses import dataclass

import numpy as np

from dpgcli.arrays import Array, Flags, Indices, total
from dpgcli.equilibrium.banded import Factorization, backward, factorize, forward
from dpgcli.mechanics.terms import Evaluation, Potential, evaluate

SUFFICIENT_DECREASE = 1e-4
SMALLEST_FRACTION = 2.0**-40  # of a step; below it a lane has stalled
ROUNDING = 64 * np.finfo(float).eps  # of the energies added up


@dataclass(frozen=True)
class Equilibrium:
    """Where each lane stopped, evaluated and factorized there.

    `residual` is the max-norm of the gradient as a force, N; `relative_residual` the same
    over the forces in play; `curvature` the smallest pivot over its own diagonal entry,
    positive where the Hessian is positive definite. Shapes (batch,) but for
    `coordinates` and `gradient`, (size, batch).
    """

    coordinates: Array
    gradient: Array
    energies: dict[str, Array]
    factorization: Factorization
    residual: Array
    relative_residual: Array
    curvature: Array
    iterations: Indices


def minimize(
    potential: Potential, guess: Array, tolerance: float, max_iterations: int = 200
) -> Equilibrium:
    """Walk from `guess`, shape (size, batch), until each lane's relative residual is small.

    A lane that has not converged after `max_iterations` evaluations stays where it is;
    whoever asked sees so from its `relative_residual`.
    """
    n_lanes = guess.shape[1]
    final, iterations = guess.copy(), np.zeros(n_lanes, np.int64)
    lanes = np.arange(n_lanes)
    here, trial = guess, guess
    energy = np.full(n_lanes, np.inf)
    step, slope, fraction = np.zeros_like(guess), np.zeros(n_lanes), np.ones(n_lanes)
    local = potential
    for count in range(max_iterations):
        evaluation = evaluate(local, trial)
        done = _relative_residual(local, evaluation.gradient) <= tolerance
        done |= fraction < SMALLEST_FRACTION
        if count == max_iterations - 1:
            done[:] = True
        iterations[lanes[done]] = count
        if done.all():
            final[:, lanes] = trial
            if len(lanes) == n_lanes:
                return _equilibrium(potential, final, evaluation, iterations)
            break
        if done.mean() > 0.25:  # leave finished lanes behind
            final[:, lanes[done]] = trial[:, done]
            keep = np.flatnonzero(~done)
            lanes, done = lanes[keep], done[keep]
            local = local.designs(keep)
            evaluation = _lanes_of(evaluation, keep)
            here, trial, step = here[:, keep], trial[:, keep], step[:, keep]
            energy, slope, fraction = energy[keep], slope[keep], fraction[keep]
        accepted = _falls(evaluation, energy, slope * fraction) | done
        new_step, new_slope = _downhill(local, evaluation)
        if accepted.all():
            here, energy, step, slope = trial, evaluation.energy, new_step, new_slope
            fraction = np.ones(len(lanes))
        else:
            here, step = np.where(accepted, trial, here), np.where(accepted, new_step, step)
            energy = np.where(accepted, evaluation.energy, energy)
            slope = np.where(accepted, new_slope, slope)
            fraction = np.where(accepted, 1.0, 0.5 * fraction)
        trial = here + np.where(done, 0.0, fraction) * step
    return _equilibrium(potential, final, evaluate(potential, final), iterations)


def _falls(evaluation: Evaluation, energy: Array, expected: Array) -> Flags:
    """Whether the energy fell enough, given that it is known up to rounding only."""
    total = sum(np.abs(part) for part in evaluation.energies.values())
    allowed = energy + SUFFICIENT_DECREASE * expected + ROUNDING * total
    return np.asarray(evaluation.energy <= allowed)


def _downhill(potential: Potential, evaluation: Evaluation) -> tuple[Array, Array]:
    """The step and the slope of the energy along it; uses up the Hessian."""
    factorization = factorize(evaluation.hessian, potential.reach)
    stiffness = np.maximum(np.abs(factorization.pivots), np.finfo(float).tiny)
    step = forward(factorization, -evaluation.gradient)
    step /= stiffness
    step = backward(factorization, step)
    step /= np.maximum(1.0, _largest(step, potential.step_cap))
    return step, total(evaluation.gradient * step)


def _relative_residual(potential: Potential, gradient: Array) -> Array:
    return _largest(gradient, potential.gradient_scale)


def _largest(values: Array, scale: Array) -> Array:
    """Max-norm over the coordinates of values / scale, shape (batch,)."""
    ratio = values / scale
    return np.asarray(np.maximum(ratio.max(axis=0), -ratio.min(axis=0)))


def _lanes_of(evaluation: Evaluation, keep: Indices) -> Evaluation:
    return Evaluation(
        {kind: part[keep] for kind, part in evaluation.energies.items()},
        evaluation.gradient[:, keep],
        evaluation.hessian[:, :, keep],
    )


def _equilibrium(
    potential: Potential, coordinates: Array, evaluation: Evaluation, iterations: Indices
) -> Equilibrium:
    diagonal = evaluation.hessian[0].copy()
    factorization = factorize(evaluation.hessian, potential.reach)
    gradient = evaluation.gradient
    return Equilibrium(
        coordinates,
        gradient,
        evaluation.energies,
        factorization,
        residual=_largest(gradient, potential.force_unit),
        relative_residual=_relative_residual(potential, gradient),
        curvature=np.min(factorization.pivots / np.abs(diagonal), axis=0),
        iterations=iterations,
    )
