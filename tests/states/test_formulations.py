"""Two formulations of one finger find the same shapes."""

from collections.abc import Callable

import numpy as np
import pytest

from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.terms import chain_potential, lattice_potential
from dpgcli.states.certify import Status, certify
from dpgcli.states.patterns import inverted_units
from dpgcli.states.settle import settle
from dpgcli.states.units import UnitSolutions

TOLERANCE = 1e-12


@pytest.mark.parametrize("n_units", range(1, 7))
@pytest.mark.parametrize("linear_stiffness", [1e3, 1e4, 1e6])
def test_chain_and_lattice_agree_on_every_node_of_every_state(
    reference_finger: Callable[..., Finger], n_units: int, linear_stiffness: float
) -> None:
    units = UnitSolutions.of(reference_finger(n_units, linear_stiffness))
    inverted = inverted_units(np.arange(2**n_units, dtype=np.uint64), n_units)
    nodes = []
    for formulate in (chain_potential, lattice_potential):
        batch = settle(units, formulate, inverted, TOLERANCE)
        assert (certify(batch, units, TOLERANCE) == Status.STABLE).all()
        nodes.append(np.stack(batch.potential.coordinates.stations(batch.equilibrium.coordinates)))
    assert np.abs(nodes[0] - nodes[1]).max() < 1e-9  # mm


def test_designs_side_by_side_are_solved_as_each_alone(
    reference_finger: Callable[..., Finger],
) -> None:
    fingers = [reference_finger(3, 1e4, stroke=stroke) for stroke in (3.0, 3.5, 4.0)]
    arrays = {
        name: np.concatenate([finger.arrays()[name] for finger in fingers], axis=1)
        for name in fingers[0].arrays()
    }
    patterns = inverted_units(np.arange(8, dtype=np.uint64), 3)
    together = settle(
        UnitSolutions.of(Finger(3, **arrays)).take_lanes(np.repeat(np.arange(3), 8)),
        chain_potential,
        np.tile(patterns, 3),
        TOLERANCE,
    )
    alone = [
        settle(UnitSolutions.of(finger), chain_potential, patterns, TOLERANCE) for finger in fingers
    ]
    expected = np.concatenate([batch.equilibrium.coordinates for batch in alone], axis=1)
    np.testing.assert_allclose(together.equilibrium.coordinates, expected, rtol=1e-13, atol=1e-16)
