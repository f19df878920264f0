"""Landscapes: the energy between states and saddles is that of a dome held on its way."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from dpgcli.mechanics.curve import spline
from dpgcli.mechanics.finger import STUDY, Finger, uniform_finger
from dpgcli.mechanics.laws import PUBLISHED, DomeLaw, PushOnly, Tabulated
from dpgcli.mechanics.terms import chain_potential
from dpgcli.states.landscape import BarrierGraph, Landscape
from dpgcli.states.landscape_table import COLUMNS, landscape_rows
from dpgcli.states.units import UnitSolutions

TRAVEL = np.linspace(0.0, 1.2, 241)
CURVE = spline(tuple(TRAVEL), tuple(0.5 * TRAVEL**2 * (0.03 + 0.97 * (1.0 - TRAVEL) ** 2)))
LAWS: tuple[DomeLaw, ...] = (
    PUBLISHED,
    Tabulated(CURVE),
    PushOnly(PUBLISHED),
    PushOnly(Tabulated(CURVE)),
)


def landscape_of(finger: Finger, start: int, units: list[int]) -> Landscape:
    return BarrierGraph.of(UnitSolutions.of(finger), chain_potential, 1e-12).along(start, units)


def test_one_unit_between_rigid_bars_has_its_own_energy_all_the_way() -> None:
    """E(x) + ½ k_θ φ², x = 2H sin(φ/2), from one well to the other, both ways."""
    finger = uniform_finger(1, **STUDY)
    there, back = (landscape_of(finger, start, [0]).stretches()[0] for start in (0, 1))
    x, turn = there.travel, 2.0 * np.arcsin(there.travel / 21.5)
    u = x / 3.5
    expected = 0.5 * 12.84 * x * x * (1.0 + 0.957 * (u * u - 2.0 * u)) + 12.1 * turn * turn
    np.testing.assert_allclose(there.energy, expected, atol=1e-11)
    assert there.travel[-1] == pytest.approx(3.2450151985, abs=1e-9)
    np.testing.assert_allclose(back.energy, there.energy[::-1], atol=1e-12)
    np.testing.assert_allclose(back.travel, there.travel[-1] - there.travel[::-1], atol=1e-12)


@pytest.mark.parametrize(
    ("law", "travel"),
    [*((law, 0.0) for law in LAWS), (LAWS[3], 12.0)],
    ids=lambda law: getattr(law, "description", law),
)
def test_the_way_goes_from_state_to_state_and_is_nowhere_above_the_saddle(
    graded_finger: Callable[..., Finger], law: DomeLaw, travel: float
) -> None:
    """Also of a dome that is apart; up and down again, and without a jump between."""
    finger = replace(graded_finger(3, 4, 100.0), law=law)
    if travel:
        finger = finger.changed(dome_travel=np.full((3, 1), travel))
    units = [1, 0, 2, 1, 2]
    found = landscape_of(finger, 0b000, units)
    assert len(found.barrier) == 5
    assert found.saddles.is_apart.all() == (travel > 0.0)
    for place, stretch in enumerate(found.stretches()):
        ends = found.energy[place], found.energy[place + 1]
        assert (stretch.energy[0], stretch.energy[-1]) == pytest.approx(ends, abs=1e-7)
        assert stretch.energy.max() == pytest.approx(found.saddles.energy[place], rel=1e-10)
        assert stretch.travel[0] == 0.0
        rising = np.diff(stretch.energy) > -1e-9 * stretch.energy.max()
        top = int(stretch.energy.argmax())
        assert rising[:top].all()
        assert not (np.diff(stretch.energy)[top:] > 1e-9 * stretch.energy.max()).any()
        assert np.abs(np.diff(stretch.energy)).max() < 0.2 * np.ptp(stretch.energy)


def test_the_way_of_a_dome_that_is_apart_is_its_own_curve() -> None:
    """Up to contact, at c = D − d: k_b D² ê(u/D), whatever the finger."""
    finger = replace(uniform_finger(2, **STUDY, linear_stiffness=1e3), law=LAWS[3])
    finger = finger.changed(dome_travel=np.array([[13.0]]))
    stretch = landscape_of(finger, 0b01, [0]).stretches()[0]
    alone = stretch.travel < 9.5
    assert alone.sum() > 20
    u = stretch.travel[alone] / 13.0
    own = 12.84 * 13.0**2 * 0.5 * u**2 * (0.03 + 0.97 * (1.0 - u) ** 2)
    np.testing.assert_allclose(stretch.energy[alone] - stretch.energy[0], own, atol=1e-4)
    top = minimize_scalar(
        lambda u: -(u**2) * (0.03 + 0.97 * (1.0 - u) ** 2), bounds=(0.3, 0.7), method="bounded"
    )
    highest = stretch.travel[stretch.energy.argmax()]
    assert highest == pytest.approx(13.0 * top.x, abs=1e-3)


def test_rows_alternate_between_states_and_saddles() -> None:
    finger = uniform_finger(2, **STUDY, linear_stiffness=1e4)
    rows = landscape_rows(landscape_of(finger, 0b10, [1, 0]))
    assert list(rows) == [column.name for column in COLUMNS]
    assert rows["step"].tolist() == [0, 1, 1, 2, 2]
    assert rows["pattern"].tolist() == ["10", "1?", "11", "?1", "01"]
    assert rows["kind"].tolist() == ["state", "saddle", "state", "saddle", "state"]
    assert rows["unit"].tolist() == [0, 2, 2, 1, 1]
    assert rows["status"].tolist() == ["stable", "certified", "stable", "certified", "stable"]
    barrier = rows["energy_mJ"][1::2] - rows["energy_mJ"][:-1:2]
    assert rows["barrier_mJ"][1::2].tolist() == barrier.tolist()
    assert np.isnan(rows["barrier_mJ"][0::2]).all()
    middle = 0.5 * (rows["tip_x_mm"][0::2][:-1] + rows["tip_x_mm"][0::2][1:])
    np.testing.assert_allclose(rows["tip_x_mm"][1::2], middle, atol=1.0)  # between its states


def test_a_way_of_no_flips_is_its_state() -> None:
    rows = landscape_rows(landscape_of(uniform_finger(2, **STUDY), 0b10, []))
    assert rows["pattern"].tolist() == ["10"]
    assert rows["energy_mJ"][0] == pytest.approx(4.3613588754, abs=1e-9)
