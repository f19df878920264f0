"""Batches without a lane: a search that finds nothing still asks what it found for its shapes."""

from dataclasses import replace

import numpy as np
import pytest

from dpgcli.actuation.pressed import Pressed
from dpgcli.actuation.rest import at_rest, is_certified
from dpgcli.mechanics.finger import STUDY, Finger, uniform_finger
from dpgcli.mechanics.lattice import Lattice
from dpgcli.mechanics.laws import PUBLISHED, PushOnly
from dpgcli.mechanics.pressure import DomeVolumes
from dpgcli.mechanics.walls import Walled, with_walls, without_walls
from dpgcli.states.units import UnitSolutions

NONE = np.zeros(0, np.int64)


def made(bars: float, walls: float, coupling: float, *, pushes: bool) -> Finger:
    finger = uniform_finger(3, **STUDY, linear_stiffness=bars).changed(
        wall_compliance=np.array([[walls]]), hinge_coupling=np.array([[coupling]])
    )
    return replace(finger, law=PushOnly(PUBLISHED)) if pushes else finger


@pytest.mark.parametrize("pushes", [False, True])
@pytest.mark.parametrize("coupling", [0.0, 3.0])
@pytest.mark.parametrize("walls", [0.0, 0.3])
@pytest.mark.parametrize("bars", [1e3, np.inf])
def test_nothing_at_rest_is_nothing(
    bars: float, walls: float, coupling: float, *, pushes: bool
) -> None:
    finger = made(bars, walls, coupling, pushes=pushes)
    pressed = Pressed(UnitSolutions.of(finger), DomeVolumes(np.array([[30.0]])))
    none = np.zeros((3, 0), bool)
    for own in (pressed, pressed.take_lanes(NONE)):
        shapes, settled = at_rest(own, none)
        assert shapes.coordinates.shape == (own.coordinates.size, 0)
        assert settled.status.shape == (0,)
        assert is_certified(own, shapes).shape == (0,)


def test_rows_of_no_lane_take_walls_and_lose_them() -> None:
    others = np.zeros((6, 0))
    among = with_walls(np.zeros((3, 0)), others, 2)
    assert among.shape == (9, 0)
    assert without_walls(among, 2).shape == (6, 0)


@pytest.mark.parametrize("walls", [0.0, 0.3])
def test_a_lattice_of_no_lane(walls: float) -> None:
    lattice = Lattice(made(1e3, walls, 0.0, pushes=False))
    among = Walled(lattice) if walls else lattice
    there = np.zeros((among.size, 0))
    assert among.corner_moments(there, there).shape[-1] == 0
    assert all(part.shape[-1] == 0 for part in among.stations(there))
    assert all(measure(there).value.shape == (3, 0) for measure in among.corners)
