"""Benchmark methods: this package at each accuracy level, and third-party minimizers.

Every method starts from the finger's parameters, or from one common shape if it searches, and
gives tips and energies of given patterns, NaN for those without a state.
"""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from dpgcli.arrays import Array, Flags, total
from dpgcli.benchmark.network import SpringNetwork
from dpgcli.benchmark.peers import peers, tip_pose
from dpgcli.mechanics.chain import Chain
from dpgcli.mechanics.coordinates import Internal
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.lattice import Lattice
from dpgcli.mechanics.terms import Formulate, chain_potential, lattice_potential
from dpgcli.states.accuracy import ACCURACY_LEVELS, DEFAULT_TOLERANCE
from dpgcli.states.certify import Status
from dpgcli.states.guess import geometric_guess, stroke_guess
from dpgcli.states.settle import settle
from dpgcli.states.tip import tip
from dpgcli.states.units import UnitSolutions

PEER_START_STROKES = 1.0  # opening of inverted units in the peers' starting shape


class BenchmarkResult(NamedTuple):
    """Tips x, y (mm) and angle (rad), (3, state), energies (mJ), (state,), NaN if missing."""

    pose: Array
    energy: Array


class BenchmarkMethod(NamedTuple):
    """One method; `run` solves `n_states` states and returns tips and energies."""

    name: str
    group: str
    run: Callable[[], BenchmarkResult]
    n_states: int
    certifies: bool = False


def package_methods(finger: Finger, inverted: Flags) -> Iterator[BenchmarkMethod]:
    """The package's methods for these patterns, (unit, state), of one finger."""
    n_states = inverted.shape[1]

    def method(
        name: str, run: Callable[[], BenchmarkResult], *, certifies: bool = True
    ) -> BenchmarkMethod:
        return BenchmarkMethod(name, "ladder", run, n_states, certifies)

    rigid = finger.with_bars(np.inf)
    yield method("rigid bars, unit by unit", lambda: _looked_up(rigid, inverted), certifies=False)
    if not finger.is_rigid:
        name = "units looked up, poses composed"
        yield method(name, lambda: _looked_up(finger, inverted), certifies=False)
    for level in ACCURACY_LEVELS:
        if level.drops_bars and finger.is_rigid:
            continue
        used, name = (rigid, "chain, rigid bars") if level.drops_bars else (finger, "chain")
        tolerance = level.tolerance
        yield method(f"{name}, {tolerance:g}", _solver(used, inverted, chain_potential, tolerance))
    if not finger.is_rigid:
        lattice = _solver(finger, inverted, lattice_potential, DEFAULT_TOLERANCE)
        yield method(f"lattice, {DEFAULT_TOLERANCE:g}", lattice)


def third_party_methods(finger: Finger, inverted: Flags) -> Iterator[BenchmarkMethod]:
    """Third-party minimizers, one state at a time, each prepared for the finger."""
    lattice, network = Lattice(finger), SpringNetwork.of(finger)
    starts = lattice.of_shape(stroke_guess(finger, inverted, PEER_START_STROKES))
    for peer in peers():
        solve_one = peer.prepare(finger)

        def run(solve_one: Callable[[Array], Array] = solve_one) -> BenchmarkResult:
            nodes = np.stack([solve_one(start) for start in starts.T], axis=1)
            return BenchmarkResult(
                tip_pose(nodes), np.array([network.energy(shape) for shape in nodes.T])
            )

        yield BenchmarkMethod(peer.name, "peer", run, inverted.shape[1])


def _looked_up(finger: Finger, inverted: Flags) -> BenchmarkResult:
    """Each unit's own well, with its bars' answer to first order, put together: no solve."""
    units = UnitSolutions.of(finger)
    chain = Chain(finger)
    shape = geometric_guess(finger, inverted, units.first_order)
    coordinates = chain.of_shape(shape)
    pose, _ = chain.tip(coordinates)
    openings = chain.openings(coordinates)
    energy = _energy(finger, shape, openings)
    in_wells = (openings + shape.wall > units.wells.barrier) == inverted
    is_there = (in_wells & (units.wells.exists | ~inverted)).all(axis=0)
    return BenchmarkResult(np.where(is_there, pose, np.nan), np.where(is_there, energy, np.nan))


def _energy(finger: Finger, shape: Internal, openings: Array) -> Array:
    """Energy of a shape, mJ, (state,)."""
    domes = finger.springs(openings + shape.wall)
    corners = finger.hinge_stiffness * (shape.near_angle**2 + shape.far_angle**2)
    energy = total(domes.energy + corners)
    if finger.has_walls:
        yielding = np.where(finger.wall_compliance > 0.0, finger.wall_compliance, 1.0)
        energy = energy + total(0.5 * shape.wall**2 / yielding)
    if finger.is_coupled:
        turn = shape.near_angle + shape.far_angle
        energy = energy - total(finger.hinge_coupling * turn[:-1] * turn[1:])
    if finger.is_rigid:
        return energy
    bars = 0.5 * finger.linear_stiffness * (shape.chord**2 + shape.strut**2)
    return energy + total(bars)


def _solver(
    finger: Finger, inverted: Flags, formulate: Formulate, tolerance: float
) -> Callable[[], BenchmarkResult]:
    def run() -> BenchmarkResult:
        settled = settle(UnitSolutions.of(finger), formulate, inverted, tolerance)
        is_stable = settled.status == Status.STABLE
        pose = tip(settled, with_compliance=False).pose
        energy = np.asarray(sum(settled.equilibrium.energies.values()))
        return BenchmarkResult(
            np.where(is_stable, pose, np.nan), np.where(is_stable, energy, np.nan)
        )

    return run
