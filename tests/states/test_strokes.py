"""Newton from poor guesses: every inverted unit opened by some fraction of its stroke."""

from collections.abc import Callable

import numpy as np
import pytest

from dpgcli.arrays import Flags
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.terms import chain_potential, lattice_potential
from dpgcli.states.certify import Status, certify
from dpgcli.states.guess import stroke_guess
from dpgcli.states.settle import settle
from dpgcli.states.units import UnitSolutions

Fingers = Callable[..., Finger]
Patterns = Callable[[int], Flags]


@pytest.mark.parametrize("strokes", [0.6, 0.7, 0.8, 1.0, 1.2, 1.5, 2.0])
@pytest.mark.parametrize("linear_stiffness", [1e2, 1e4, 1e6, np.inf])
def test_the_chain_finds_every_pattern_of_its_own(
    reference_finger: Fingers, all_patterns: Patterns, strokes: float, linear_stiffness: float
) -> None:
    units = UnitSolutions.of(reference_finger(5, linear_stiffness))
    batch = settle(
        units,
        chain_potential,
        all_patterns(5),
        1e-12,
        start=stroke_guess(units.finger, all_patterns(5), strokes),
    )
    assert (certify(batch, units, 1e-12) == Status.STABLE).all()
    assert (batch.reached == batch.inverted).all()


@pytest.mark.parametrize("strokes", [0.8, 1.0, 1.2, 1.5])
def test_the_lattice_finds_every_pattern_from_nearby(
    reference_finger: Fingers, all_patterns: Patterns, strokes: float
) -> None:
    units = UnitSolutions.of(reference_finger(5, 1e4))
    batch = settle(
        units,
        lattice_potential,
        all_patterns(5),
        1e-12,
        start=stroke_guess(units.finger, all_patterns(5), strokes),
    )
    assert (certify(batch, units, 1e-12) == Status.STABLE).all()


@pytest.mark.parametrize("strokes", [0.65, 2.0, 3.0])
def test_from_afar_the_lattice_says_which_pattern_it_fell_into(
    reference_finger: Fingers, all_patterns: Patterns, strokes: float
) -> None:
    units = UnitSolutions.of(reference_finger(5, 1e4))
    own = settle(units, lattice_potential, all_patterns(5), 1e-12).equilibrium.coordinates
    batch = settle(
        units,
        lattice_potential,
        all_patterns(5),
        1e-12,
        start=stroke_guess(units.finger, all_patterns(5), strokes),
    )
    status = certify(batch, units, 1e-12)
    assert {Status.STABLE, Status.ANOTHER_PATTERN} == set(status)
    code = (batch.reached * 2 ** np.arange(4, -1, -1)[:, None]).sum(axis=0)
    np.testing.assert_allclose(batch.equilibrium.coordinates, own[:, code], rtol=0, atol=1e-7)
    assert ((code == np.arange(32)) == (status == Status.STABLE)).all()


def test_below_the_barrier_every_pattern_relaxes_to_the_ground_state(
    reference_finger: Fingers, all_patterns: Patterns
) -> None:
    units = UnitSolutions.of(reference_finger(5, 1e4))
    batch = settle(
        units,
        chain_potential,
        all_patterns(5),
        1e-12,
        start=stroke_guess(units.finger, all_patterns(5), 0.5),
    )
    status = certify(batch, units, 1e-12)
    assert status.tolist() == [Status.STABLE] + 31 * [Status.ANOTHER_PATTERN]
    assert not batch.reached.any()
