"""Parts of a finger's energy: designs and units taken from a batch keep those of the batch."""

from collections.abc import Callable

import numpy as np
import pytest

from dpgcli.arrays import Array, Indices
from dpgcli.mechanics.finger import GRAVITY, OPTIONAL, STUDY, Finger, uniform_finger
from dpgcli.mechanics.terms import Formulate, chain_potential, lattice_potential

VALUES = dict.fromkeys(OPTIONAL, 0.01) | {"hinge_stiffness": 24.2, "hinge_coupling": 3.0}


def batch(name: str) -> Finger:
    """Two fingers of two units that differ in that the second lacks a part."""
    others = {key: np.array([[0.01]]) for key in ("unit_weight", *GRAVITY) if key != name}
    finger = uniform_finger(2, **STUDY, linear_stiffness=1e4)
    return finger.changed(**others, **{name: np.array([[VALUES[name], 0.0]])})


def shapes(size: int, n: int) -> Array:
    return 0.05 * np.random.default_rng(5).normal(size=(size, n))


@pytest.mark.parametrize("formulate", [chain_potential, lattice_potential])
@pytest.mark.parametrize("name", OPTIONAL)
def test_designs_that_lack_a_part_keep_the_layout(name: str, formulate: Formulate) -> None:
    both = batch(name)
    whole = formulate(both)
    at = shapes(whole.coordinates.size, 2)
    for index in ([1], [1, 1], [0]):
        taken = formulate(both.take_lanes(np.array(index)).with_domes(np.ones((2, 1), bool)))
        assert taken.kinds == whole.kinds
        assert taken.coordinates.size == whole.coordinates.size
        assert len(taken.terms) == len(whole.terms)
        energy = taken.evaluate(at[:, index]).energy
        assert energy == pytest.approx(whole.evaluate(at).energy[index], rel=1e-14)


@pytest.mark.parametrize("formulate", [chain_potential, lattice_potential])
def test_no_designs_at_all_keep_the_layout(formulate: Formulate) -> None:
    finger = uniform_finger(2, **STUDY).changed(
        linear_stiffness=np.array([[1e4, 2e4]]), wall_compliance=np.array([[0.1, 0.2]])
    )
    none = formulate(finger.take_lanes(np.arange(0)))
    assert none.coordinates.size == formulate(finger).coordinates.size == 10


@pytest.mark.parametrize("name", ["hinge_stiffness", "wall_compliance", "unit_weight"])
def test_units_that_lack_a_part_keep_the_layout(name: str) -> None:
    finger = batch(name).changed(**{name: np.array([[VALUES[name]], [0.0]])})
    own, whole = chain_potential(finger.section(1, 2)), chain_potential(finger)
    assert own.kinds == whole.kinds
    assert own.coordinates.size == whole.coordinates.size // 2


Removed = Callable[[Finger], Finger]


@pytest.mark.parametrize(
    ("name", "removed"),
    [
        ("wall_compliance", lambda finger: finger.changed(wall_compliance=np.zeros((1, 1)))),
        ("end_moment", lambda finger: finger.unloaded),
        ("linear_stiffness", lambda finger: finger.with_bars(np.inf)),
    ],
)
def test_what_is_taken_away_is_no_part(name: str, removed: Removed) -> None:
    one: Indices = np.array([1])
    finger = batch("wall_compliance").changed(end_moment=np.array([[1.0, 0.0]])).take_lanes(one)
    assert name in finger.parts
    assert finger.parts - removed(finger).parts >= {name}
