"""Every method to the states, against extended precision."""

import numpy as np
import pytest

from dpgcli.benchmark.methods import package_methods, third_party_methods
from dpgcli.benchmark.timing import measured, numpy_kernel, peak_bytes
from dpgcli.mechanics.finger import STUDY, Finger, uniform_finger
from dpgcli.reference.equilibria import extended_states
from dpgcli.states.patterns import inverted_units

PATTERNS = inverted_units(np.arange(8, dtype=np.uint64), 3)
WORST = {  # mm
    "rigid bars, unit by unit": 1e-3,
    "units looked up, poses composed": 1e-7,
    "chain, rigid bars, 1e-12": 1e-3,
    "chain, 0.001": 1e-7,
    "chain, 1e-06": 1e-7,
    "chain, 1e-09": 1e-12,
    "chain, 1e-12": 1e-12,
    "lattice, 1e-12": 1e-11,
}


def finger(linear_stiffness: float, force_linearity: float = 0.043) -> Finger:
    values = {**STUDY, "force_linearity": force_linearity}
    return uniform_finger(3, **values, linear_stiffness=linear_stiffness)


def test_errors_of_the_ladder() -> None:
    reference = extended_states(finger(1e4), PATTERNS)
    seen = {}
    for method in package_methods(finger(1e4), PATTERNS):
        found = method.run()
        error = np.hypot(*(found.pose[:2] - reference.pose[:2]))
        energy = np.abs(found.energy - reference.energy)
        assert error.max() <= WORST[method.name], method.name
        assert energy.max() <= 1e3 * WORST[method.name], method.name
        seen[method.name] = float(error.max())
    assert list(seen) == list(WORST)
    assert seen["rigid bars, unit by unit"] > 1e-4, "dropping the bars must be seen"
    assert seen["units looked up, poses composed"] > 1e-10, "and what is of second order"


def test_units_looked_up_are_first_guesses_where_hinges_turn_each_other() -> None:
    """The energy is that of their shape, neighbors and all: off by the square of what is missed."""
    missed = {}
    for coupling in (1.0, 0.1):
        coupled = finger(1e4).changed(hinge_coupling=np.array([[coupling]]))
        reference = extended_states(coupled, PATTERNS)
        found = next(m for m in package_methods(coupled, PATTERNS) if "looked up" in m.name).run()
        missed[coupling] = np.abs(found.energy - reference.energy).max()
    assert missed[1.0] < 3e-3
    assert missed[0.1] < 0.02 * missed[1.0]


def test_rigid_bars_have_fewer_ways() -> None:
    names = [method.name for method in package_methods(finger(np.inf), PATTERNS)]
    assert names == ["rigid bars, unit by unit", *(n for n in WORST if n.startswith("chain, ")
                                                   and "rigid" not in n)]  # fmt: skip


def test_a_pattern_without_a_state_is_missing_from_every_way() -> None:
    impossible = finger(1e4, force_linearity=0.5)
    every = list(package_methods(impossible, PATTERNS))
    assert [method.name for method in every] == list(WORST)
    for method in every:
        found = method.run()
        assert np.isfinite(found.pose[:, 0]).all(), method.name
        assert np.isnan(found.pose[:, 1:]).all(), method.name
        assert np.isnan(found.energy[1:]).all(), method.name


def test_others_find_the_same_states() -> None:
    few = PATTERNS[:, [3, 5]]
    reference = extended_states(finger(1e4), few)
    others = list(third_party_methods(finger(1e4), few))
    assert len(others) >= 3
    for method in others:
        found = method.run()
        assert np.hypot(*(found.pose[:2] - reference.pose[:2])).max() < 1e-3, method.name
        assert np.abs(found.pose[2] - reference.pose[2]).max() < 1e-4, method.name
        assert np.abs(found.energy - reference.energy).max() < 1e-6, method.name


def test_times_are_ordered_and_of_one_call() -> None:
    calls = []
    times = measured(lambda: calls.append(sum(range(20_000))), 3)
    assert 0.0 < times.wall_min <= times.wall <= times.wall_max
    assert len(calls) >= 3 + 2
    assert times.wall < 0.1, "a call, not a round of calls"


def test_a_long_call_is_timed_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("dpgcli.benchmark.timing.LONGEST_REPEATED", 0.0)
    calls = []
    times = measured(lambda: calls.append(1), 9)
    assert (len(calls), times.wall_min) == (1, times.wall_max)


def test_the_kernel_is_fixed_work() -> None:
    assert numpy_kernel()() == pytest.approx(numpy_kernel()())


def test_peak_memory_counts_arrays() -> None:
    assert peak_bytes(lambda: np.ones(2**20)) == pytest.approx(8 * 2**20, rel=0.01)
