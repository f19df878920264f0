"""All 2^n states of a long finger from two tables of half-fingers.

Cells feel each other only through the strut they share, and that less by a factor of about
k_b/k_L per cell. So each half is solved once for all its own patterns and those of the few
nearest units of the other half (its context), and a state of the whole is a pair of table
rows: poses compose as planar rigid motions, energies add. What the pair lacks to equilibrium
is known exactly at the shared strut, and every state is certified by it (our derivation):

- residual: of the halves, of the strut, and what the halves' disagreement Δs about the
  strut's extension puts on the outer half's first cell, to first order in Δs
- curvature: the Hessian is positive definite if both halves are with the strut held, and
  the sum of their stiffnesses at the strut (Schur complements) is positive
- wells: those of the halves
"""

from collections.abc import Iterator
from dataclasses import fields, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dpgcli.arrays import Array, Flags, total
from dpgcli.equilibrium.banded import backward, factorize, forward, in_lanes
from dpgcli.equilibrium.potential import Evaluation
from dpgcli.mechanics.coordinates import FingerCoordinates, FingerPotential
from dpgcli.mechanics.terms import chain_potential
from dpgcli.records import dataclass
from dpgcli.states.certify import Settled
from dpgcli.states.crossing import Outline, outline
from dpgcli.states.patterns import chunks, inverted_units
from dpgcli.states.settle import lanes_at_once, settle
from dpgcli.states.tip import tip
from dpgcli.states.units import UnitSolutions


@dataclass(frozen=True)
class Joint:
    """A half's force and stiffness at the shared strut, arrays of shape (entry,), mm and N.

    `extension` s of the strut in the half's own solution, `force` the half's force on it
    (∂E/∂s), `stiffness` the derivative of that force and `tip_motion` the motion of the finger's
    tip (mm per mm), both with the half following.
    """

    extension: Array
    force: Array
    stiffness: Array
    tip_motion: Array


@dataclass(frozen=True)
class ClampedHalf:
    """Forces per change of s on an outer half that does not follow, (entry,), N/mm.

    `strut_stiffness` on the strut, `cell_stiffness` the largest on the half's first cell, and
    `relative_stiffness` the largest over the forces in play, 1/mm.
    """

    strut_stiffness: Array
    cell_stiffness: Array
    relative_stiffness: Array


@dataclass(frozen=True)
class Half:
    """A table of half-fingers: all states of some units, each in every context.

    Entries count through the patterns of all units solved, context included. `pose` is that
    of the half's last station seen from its first. Rigid bars share nothing: no joint. `around`
    is the half's outline, where the finger may run into itself.
    """

    status: NDArray[np.uint8]
    reached: Flags
    pose: Array
    energies: dict[str, Array]
    residual: Array
    relative_residual: Array
    tip_error: Array
    joint: Joint | None = None
    clamped: ClampedHalf | None = None
    around: Outline | None = None


@dataclass(frozen=True)
class Split:
    """A finger cut after `n_inner` units; each half is solved with `context` units of the other."""

    units: UnitSolutions
    n_inner: int
    context: int
    tolerance: float

    @property
    def n_units(self) -> int:
        return self.units.finger.n_units

    @property
    def n_outer(self) -> int:
        return self.n_units - self.n_inner

    @property
    def weakest(self) -> float:
        """The smallest holding force of a unit in either well, N; see `certify`."""
        wells = self.units.wells
        return float(np.minimum(np.abs(wells.reset_force), wells.snap_force).min())

    @cached_property
    def strut_force(self) -> float:
        """The forces in play at the shared strut in the ground state, the smallest, N."""
        ground = np.zeros((self.n_units, 1), bool)
        chain = chain_potential(self.units.finger.with_domes(ground)).coordinates
        strut = self.n_inner * chain.size // self.n_units - 1
        return float(chain.gradient_scale[strut, 0])

    @property
    def n_solves(self) -> int:
        """Half-fingers solved for both tables."""
        return (1 << self.n_inner + self.context) + (1 << self.n_outer + self.context)

    def inner(self) -> Half:
        """Units 1 … n_inner, with context beyond them."""
        settled = self._settled(0, self.n_inner + self.context, own=slice(0, self.n_inner))
        return _joined([self._inner(states) for states in settled])

    def outer(self) -> Half:
        """Units n_inner + 1 … n, with context before them."""
        first = self.n_inner - self.context
        settled = self._settled(first, self.n_units, own=slice(self.context, None))
        return _joined([self._outer(states) for states in settled])

    def _settled(self, first: int, stop: int, own: slice) -> Iterator[Settled]:
        units = self.units.section(first, stop)
        for codes in chunks(2 ** (stop - first), lanes_at_once(stop - first)):
            inverted = inverted_units(codes, stop - first)
            yield settle(units, chain_potential, inverted, self.tolerance, own=own)

    def _inner(self, settled: Settled) -> Half:
        potential = chain_potential(settled.finger.section(0, self.n_inner))
        chain = potential.coordinates
        own = settled.equilibrium.coordinates[: chain.size]
        at_own = potential.evaluate(own)
        pose, jacobian = chain.tip(own)
        joint = None
        if not chain.finger.is_rigid:
            beyond = self.units.finger.section(self.n_inner, self.n_units).straight_length[0]
            joint = _inner_joint(potential, own, at_own, jacobian, beyond)
        # an error of the angle moves all that is beyond
        lever = self.units.finger.straight_length[0]
        energies = potential.by_kind(at_own.energies)
        half = self._half(settled, slice(0, self.n_inner), pose, energies, lever, joint)
        return self._with_outline(half, chain, own)

    def _outer(self, settled: Settled) -> Half:
        finger = settled.finger
        chain = chain_potential(finger.section(self.context, finger.n_units)).coordinates
        coordinates = settled.equilibrium.coordinates
        pose, jacobian = chain.tip(coordinates[-chain.size :])
        energies, joint, clamped = settled.equilibrium.energies, None, None
        if not chain.finger.is_rigid:
            context = chain_potential(finger.section(0, self.context))
            at_context = context.evaluate(coordinates[: context.coordinates.size])
            of_context = context.by_kind(at_context.energies)
            energies = {kind: e - of_context.get(kind, 0.0) for kind, e in energies.items()}
            clamped = _clamped(settled, at_context)
            joint = _outer_joint(settled, context, at_context, jacobian)
        own = slice(self.context, None)
        half = self._half(settled, own, pose, energies, 0.0, joint, clamped)
        return self._with_outline(half, chain, coordinates[-chain.size :])

    def _with_outline(self, half: Half, chain: FingerCoordinates, own: Array) -> Half:
        """The half with its outline, as if its first strut were upright, if that is needed."""
        if self.units.shortest_loop is None:
            return half
        around = outline(chain.stations(own), chain.finger.segment_height)
        return replace(half, around=around)

    def _half(
        self,
        settled: Settled,
        own: slice,
        pose: Array,
        energies: dict[str, Array],
        lever: float,
        joint: Joint | None,
        clamped: ClampedHalf | None = None,
    ) -> Half:
        at_tip = tip(settled, with_compliance=False)
        return Half(
            settled.status,
            settled.reached[own],
            pose,
            energies,
            settled.equilibrium.residual,
            settled.equilibrium.relative_residual,
            at_tip.error + lever * at_tip.angle_error,
            joint,
            clamped,
        )


def _inner_joint(
    potential: FingerPotential, own: Array, at_own: Evaluation, jacobian: Array, beyond: float
) -> Joint:
    """The strut is the last unknown: its pivot is the stiffness left once the rest follows."""
    factorization = factorize(at_own.hessian, potential.column_depths)
    following = np.zeros_like(own)
    following[-1] = 1.0
    moved = total(jacobian * backward(factorization, following)[:, None])
    tip_motion = np.hypot(moved[0], moved[1]) + np.abs(moved[2]) * beyond
    return Joint(own[-1], at_own.gradient[-1], factorization.pivots[-1], tip_motion)


@in_lanes
def _outer_joint(
    settled: Settled, context: FingerPotential, at_context: Evaluation, jacobian: Array
) -> Joint:
    """The outer half's joint: a unit force on the strut moves both; the context's part is known.

    Uses up the context's Hessian.
    """
    strut = context.coordinates.size - 1
    equilibrium = settled.equilibrium
    answer = np.zeros_like(equilibrium.coordinates)
    answer[strut] = 1.0
    forward(equilibrium.factorization, answer)
    answer /= equilibrium.factorization.pivots
    backward(equilibrium.factorization, answer)
    of_context = factorize(at_context.hessian, context.column_depths).pivots[strut]
    moved = total(jacobian * (answer[strut + 1 :] / answer[strut])[:, None])
    return Joint(
        equilibrium.coordinates[strut],
        equilibrium.gradient[strut] - at_context.gradient[strut],
        1.0 / answer[strut] - of_context,
        np.hypot(moved[0], moved[1]),
    )


def _clamped(settled: Settled, at_context: Evaluation) -> ClampedHalf:
    """The strut's column of the Hessian, without what the context adds on the diagonal."""
    strut = len(at_context.gradient) - 1
    column = settled.potential.evaluate(settled.equilibrium.coordinates).hessian[:, strut]
    chain = settled.potential.coordinates
    on_strut = column[0] - at_context.hessian[0, strut]
    near = slice(strut + 1, strut + len(column))
    return ClampedHalf(
        on_strut,
        _largest(column[1:], chain.force_unit[near]),
        _largest(column[1:], chain.gradient_scale[near]),
    )


def _largest(forces: Array, scale: Array) -> Array:
    return np.asarray(np.max(np.abs(forces) / scale, axis=0))


def _joined(parts: list[Half]) -> Half:
    """One table from consecutive chunks of it."""
    half: Half = _concatenated(parts)
    return half


def _concatenated(parts: list[Any]) -> Any:
    """Arrays end to end; records, dictionaries and nothing field by field."""
    first = parts[0]
    if first is None:
        return None
    if isinstance(first, np.ndarray):
        return np.concatenate(parts, axis=-1)
    if isinstance(first, dict):
        return {key: _concatenated([part[key] for part in parts]) for key in first}
    names = [field.name for field in fields(first)]
    return type(first)(*(_concatenated([getattr(part, name) for part in parts]) for name in names))
