"""The study's numbers, to the digits that two earlier formulations agree on."""

from collections.abc import Callable

import numpy as np
import pytest

from dpgcli.arrays import Array, Flags
from dpgcli.design.scene import Scene
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.terms import chain_potential
from dpgcli.states.plan import Request
from dpgcli.states.predict import predict
from dpgcli.states.wells import inverted_wells

STATES = {
    "111": (35.28310873, -17.24079693, -43.40343683, 13.08400032),
    "101": (38.35981703, -11.99285355, -26.04208016, 8.72266851),
    "11111": (44.65422600, -42.23246372, -78.12616759, 21.80666611),
}


@pytest.mark.parametrize("formulation", ["chain", "lattice"])
@pytest.mark.parametrize("pattern", STATES)
def test_tip_chord_and_energy_are_the_published_ones(
    reference_finger: Callable[..., Finger], pattern: str, formulation: str
) -> None:
    n = len(pattern)
    request = Request((pattern,), ("all",), formulation)
    rows = predict(Scene(reference_finger(n, 1e4), ()), request).arrays()
    x, y, chord_angle, energy = STATES[pattern]
    along = rows[f"B{n}_x_mm"] - rows[f"B{n - 1}_x_mm"]
    across = rows[f"B{n}_y_mm"] - rows[f"B{n - 1}_y_mm"]
    assert rows["status"].tolist() == ["stable"]
    assert rows["reached_pattern"].tolist() == [pattern]
    assert rows["tip_x_mm"] == pytest.approx(x, abs=5e-9)
    assert rows["tip_y_mm"] == pytest.approx(y, abs=5e-9)
    assert np.degrees(np.arctan2(across, along)) == pytest.approx(chord_angle, abs=5e-9)
    assert rows["energy_mJ"] == pytest.approx(energy, abs=1e-8)
    assert rows["numerical_error_mm"] < 1e-9


def test_a_rigid_unit_rests_where_the_closed_form_says(
    reference_finger: Callable[..., Finger],
) -> None:
    rows = predict(Scene(reference_finger(1), ()), Request(("1",))).arrays()
    assert rows["opening_1_mm"] == pytest.approx(3.2450151985, abs=5e-11)
    assert np.degrees(rows["tip_angle_rad"]) == pytest.approx(-17.36175941, abs=5e-9)
    assert rows["energy_mJ"] == pytest.approx(4.3613588754, abs=5e-11)


def _single_unit(finger: Finger, extension: Array) -> tuple[Array, Array]:
    """Energy and force on x of a symmetric rigid unit, through the chain's own terms."""
    half = np.arcsin(extension / (2.0 * 10.75))
    at = chain_potential(finger).evaluate(np.stack((half, half)))
    return at.energy, at.gradient.sum(axis=0) / (2.0 * 10.75 * np.cos(half))


def test_a_rigid_unit_turns_over_at_the_published_barrier(
    reference_finger: Callable[..., Finger],
) -> None:
    finger = reference_finger(1)
    wells = inverted_wells(finger)
    energy, force = _single_unit(finger, wells.barrier[0])
    assert wells.barrier == pytest.approx(2.0041742418, abs=5e-11)
    assert energy == pytest.approx(6.0382332675, abs=5e-11)
    assert force == pytest.approx(0.0, abs=1e-13)


def test_snap_and_reset_forces_are_the_published_ones(
    reference_finger: Callable[..., Finger],
) -> None:
    finger = reference_finger(1)
    well = inverted_wells(finger)
    _, force = _single_unit(finger, np.linspace(0.0, float(well.extension[0, 0]), 20_001))
    assert force.max() == pytest.approx(4.72618, abs=5e-6)
    assert force.min() == pytest.approx(-2.05467, abs=1e-5)


@pytest.mark.parametrize("linear_stiffness", [1e2, 1e4, 1e6])
def test_both_formulations_give_the_same_states(
    graded_finger: Callable[..., Finger],
    all_patterns: Callable[[int], Flags],
    linear_stiffness: float,
) -> None:
    scene = Scene(graded_finger(4, 7, linear_stiffness), ())
    chain, lattice = (
        predict(scene, Request(formulation=name)).arrays() for name in ("chain", "lattice")
    )
    assert (chain["status"] == "stable").all() and (lattice["status"] == "stable").all()
    for name in ("tip_x_mm", "tip_y_mm", "tip_angle_rad"):
        error = chain["numerical_error_mm"] + lattice["numerical_error_mm"]
        assert (np.abs(chain[name] - lattice[name]) <= error).all()
    np.testing.assert_allclose(lattice["energy_mJ"], chain["energy_mJ"], rtol=0, atol=1e-10)
    np.testing.assert_allclose(
        lattice["min_eigenvalue_N_per_mm"], chain["min_eigenvalue_N_per_mm"], rtol=1e-6
    )
