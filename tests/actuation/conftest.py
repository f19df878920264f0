"""Fingers under pressure, as the tests of this folder take them."""

from collections.abc import Callable

import numpy as np
import pytest

from dpgcli.actuation.pressed import Pressed
from dpgcli.mechanics.finger import STUDY, Finger, uniform_finger
from dpgcli.mechanics.pressure import DomeVolumes
from dpgcli.states.units import UnitSolutions

AREA = 4.7261788958 / 0.1495  # mm², of the study's springs


@pytest.fixture
def study() -> Callable[..., Finger]:
    """The study's finger, of n units and with bars of some stiffness."""

    def made(n_units: int, linear_stiffness: float = 1e4) -> Finger:
        return uniform_finger(n_units, **STUDY, linear_stiffness=linear_stiffness)

    return made


@pytest.fixture
def pressed() -> Callable[..., Pressed]:
    """A finger under pressure, by its effective area, mm²."""

    def made(finger: Finger, area: float = AREA) -> Pressed:
        return Pressed(UnitSolutions.of(finger), DomeVolumes(np.array([[area]])))

    return made
