"""Followers of paths to a snap: each finds it, as exactly as it can."""

from collections.abc import Callable

import numpy as np
import pytest

from dpgcli.actuation.pressed import Pressed
from dpgcli.benchmark.bench import Bench
from dpgcli.benchmark.network import SpringNetwork
from dpgcli.benchmark.thresholds import SnapCase
from dpgcli.design.pressure import Pressure
from dpgcli.design.scene import Scene
from dpgcli.mechanics.finger import STUDY, Finger, uniform_finger
from dpgcli.mechanics.pressure import DomeVolumes
from dpgcli.states.units import UnitSolutions

LARGEST = {"this": 1e-10, "SciPy": 1e-4, "springable,": 1e-3}


def finger(n_units: int = 2, linear_stiffness: float = 1e3, **changes: float) -> Finger:
    return uniform_finger(n_units, **{**STUDY, **changes}, linear_stiffness=linear_stiffness)


def case_of(own: Finger, area: float | list[float] = 31.61) -> SnapCase:
    areas = np.reshape(np.asarray(area, float), (-1, 1))
    return SnapCase.of(Pressed(UnitSolutions.of(own), DomeVolumes(areas)))


def test_every_follower_finds_the_snap() -> None:
    case = case_of(finger())
    assert case.threshold == pytest.approx(4.72618 / 31.61, rel=1e-3)
    followers = list(case.followers())
    assert [f.name.split()[0] for f in followers][:3] == ["this", "this", "SciPy"]
    for follower in followers:
        found = follower.run()
        assert found.shape == (follower.n_states,)
        error = np.abs(found / case.threshold - 1.0).max()
        assert error < LARGEST[follower.name.split()[0]], follower.name


@pytest.mark.parametrize(
    ("own", "names"),
    [
        (finger(linear_stiffness=np.inf), []),
        (finger().changed(wall_compliance=np.array([[0.1]])), []),
        (finger().changed(hinge_coupling=np.array([[1.0]])), []),
    ],
)
def test_third_parties_know_only_bars_that_give_way(own: Finger, names: list[str]) -> None:
    assert [f.name for f in case_of(own).followers()][2:] == names


def test_units_of_other_areas_are_not_for_springable() -> None:
    names = [follower.name for follower in case_of(finger(), [31.61, 20.0]).followers()]
    assert names[2:] == ["SciPy root, small steps"]


def test_a_finger_that_never_snaps_has_no_threshold() -> None:
    assert np.isnan(case_of(finger(force_linearity=0.5)).threshold)


def test_a_push_is_in_the_networks_energy_and_in_both_derivatives() -> None:
    plain = SpringNetwork.of(finger())
    pushed = plain.pushed(np.array([2.0, 3.0]))
    random = np.random.default_rng(1)
    nodes = np.array([13.5, 0.0, 13.9, 10.8, 27.0, -0.2, 27.8, 10.7])
    way = random.standard_normal(8)

    def rate(function: Callable[[np.ndarray], object], step: float = 1e-4) -> np.ndarray:
        ends = [np.asarray(function(nodes + s * step * way)) for s in (-2.0, -1.0, 1.0, 2.0)]
        return (ends[0] - 8.0 * ends[1] + 8.0 * ends[2] - ends[3]) / (12.0 * step)

    np.testing.assert_allclose(rate(pushed.energy), pushed.gradient(nodes) @ way, rtol=1e-7)
    np.testing.assert_allclose(rate(pushed.gradient), pushed.hessian(nodes) @ way, rtol=1e-6)
    work = plain.energy(nodes) - pushed.energy(nodes)
    openings = np.hypot(*(nodes[[2, 3]] - [0.0, 10.75])) - 13.5, np.hypot(13.9, 0.1) - 13.5
    assert work == pytest.approx(2.0 * openings[0] + 3.0 * openings[1], rel=1e-9)


def test_bench_measures_them_where_a_spec_has_pressure(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("dpgcli.benchmark.thresholds.BATCH", 2)
    pressure = Pressure(("A",), np.zeros(2, int), None, snap_pressure=np.array([[0.1495]]))
    scene = Scene(finger(linear_stiffness=np.inf), (), pressure=pressure)
    rows = list(Bench(scene, 1)._thresholds(pressure))
    assert [row["n_states"] for row in rows] == [1, 2]
    assert [row["n_missing"] for row in rows] == [0, 0]
    assert max(row["max_threshold_error"] for row in rows) < 1e-12
    assert rows[0]["times_as_long"] == 1.0
