"""Unstable branches: equilibria of index one from a fold to where the finger is stable again."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from dpgcli.actuation.pressed import Pressed
from dpgcli.actuation.readings import Readings
from dpgcli.actuation.rest import at_rest
from dpgcli.actuation.travel import Travel, travel
from dpgcli.actuation.unstable import branches
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.laws import PUBLISHED, PushOnly
from dpgcli.states.solved import ALONE

Study = Callable[..., Finger]
Made = Callable[..., Pressed]
STEP = 0.05
AREA = 4.7261788958 / 0.1495


def way_of(pressed: Pressed, *pressures: float, cycles: int = 1) -> Travel:
    n = pressed.finger.n_units
    shapes, _ = at_rest(pressed, np.zeros((n, 1), bool))
    history = np.array(pressures)[:, None] * np.ones(n)
    return travel(pressed, shapes, history, cycles, STEP)


def test_the_branch_of_one_unit_is_its_force_by_its_opening(study: Study, pressed: Made) -> None:
    """p A = e'(x) in closed form; the load falls from the snap, and ends at the reset."""
    finger = pressed(study(1, np.inf))
    branch = branches(finger, way_of(finger, 0.3))[1]
    x, pressure = finger.extensions(branch.shapes.coordinates)[0], branch.shapes.pressure[0]
    u = x / 3.5
    turn = 2.0 * np.arcsin(x / 21.5)
    force = 12.84 * x * (1.0 + 0.957 * (2.0 * u * u - 3.0 * u))
    force = force + 24.2 * turn / (10.75 * np.cos(turn / 2.0))
    np.testing.assert_allclose(pressure * AREA, force, atol=1e-9)
    assert (np.diff(pressure) < 0.0).all()
    assert (np.diff(x) > 0.0).all()
    assert len(x) > 10
    assert pressure[0] == pytest.approx(0.1495, rel=0.02)
    assert pressure[-1] == pytest.approx(-0.0649945, rel=1e-3)


def test_without_pressure_it_is_at_the_top_of_the_barrier(study: Study, pressed: Made) -> None:
    """x = 2.0041742418 mm, e = 6.0382332675 mJ: the reference's numbers."""
    finger = pressed(study(1, np.inf))
    branch = branches(finger, way_of(finger, 0.3))[1]
    readings = Readings(finger, branch.shapes, ALONE)
    (opening,) = CubicSpline(readings.openings[0], branch.shapes.pressure[0]).roots(
        extrapolate=False
    )
    energy = CubicSpline(readings.openings[0], readings.energy)(opening)
    assert opening == pytest.approx(2.0041742418, abs=1e-4)
    assert energy == pytest.approx(6.0382332675, abs=1e-4)


@pytest.mark.parametrize(
    ("strokes", "expected"),
    # of equal units those go last that were nearly lost before: no point is before their fold
    [((3.5, 3.4, 3.7), [1, 2, 3, 4, 5, 6]), ((3.5, 3.5, 3.5), [1, 2])],
)
@pytest.mark.parametrize("pushes", [False, True])
def test_points_of_branches_are_saddles(
    study: Study, pressed: Made, strokes: tuple[float, ...], expected: list[int], pushes: bool
) -> None:
    made = study(3, 1e3).changed(stroke=np.array(strokes)[:, None])
    if pushes:
        made = type(made)(**{**vars(made), "law": PushOnly(PUBLISHED)})
    finger = pressed(made)
    way = way_of(finger, 0.3, -0.3)
    found = branches(finger, way)
    assert [*found] == expected
    for number, branch in found.items():
        balance = Readings(finger, branch.shapes, ALONE).balance
        assert float(balance.relative_residual.max()) < 1e-9
        assert ((balance.factorization.pivots < 0.0).sum(axis=0) == 1).all()
        event = way.events[number - 1]
        opening = finger.extensions(branch.shapes.coordinates)[event.units[0]]
        assert np.ptp(opening) > 0.5
        assert (branch.step == way.points.step[event.before]).all()


def test_each_fold_has_one_branch_whatever_the_cycles(study: Study, pressed: Made) -> None:
    finger = pressed(study(2).changed(stroke=np.array([[3.5], [3.7]])))
    way = way_of(finger, 0.3, -0.3, cycles=5)
    assert len(way.events) == 20
    assert len(branches(finger, way)) < 13  # the first cycle, and one that all others repeat


def test_domes_that_meet_their_neighbors_have_no_branch(study: Study, pressed: Made) -> None:
    made = study(2)
    finger = pressed(type(made)(**{**vars(made), "law": PushOnly(PUBLISHED)}))
    way = way_of(finger, -0.3, 0.1)
    assert len(way.events) == 1
    assert not branches(finger, way)
