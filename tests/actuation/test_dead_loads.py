"""Pressure on fingers under dead loads: domes that a load leaves behind, units by themselves."""

from pathlib import Path

import numpy as np
import pytest

import dpgcli as dpg
from dpgcli.actuation.alone import thresholds_alone
from dpgcli.actuation.domes import limits
from dpgcli.actuation.pressed import Pressed
from dpgcli.actuation.rest import at_rest
from dpgcli.files.scene_file import read_spec, scene_of
from dpgcli.states.certify import Status
from dpgcli.states.units import UnitSolutions

SPEC = Path(__file__).parents[2] / "configs" / "five_unit.yaml"
PUSHING = ("finger.units=2", "finger.calibration=finite_elements")


def pressed(*settings: str) -> Pressed:
    scene = scene_of(read_spec(SPEC, [*settings, "pressure={}"]))
    assert scene.pressure is not None
    return Pressed.of(UnitSolutions.of(scene.finger), scene.pressure)


@pytest.mark.parametrize(("couple", "is_in_touch"), [(0.0, True), (-20.0, False)])
def test_a_couple_opens_a_gap_further_than_its_dome_reaches(
    couple: float, is_in_touch: bool
) -> None:
    """From there on the dome resets as one by itself does."""
    loaded = pressed(*PUSHING, f"loads.tip_moment_N_mm={couple}")
    shapes, settled = at_rest(loaded, np.array([[True], [False]]))
    assert settled.status.tolist() == [Status.STABLE]
    assert shapes.touching is not None
    assert shapes.touching[:, 0].tolist() == [is_in_touch, False]
    history = "pressure.history.A=[0, 0.2, -0.15, 0]"
    settings = [*PUSHING, f"loads.tip_moment_N_mm={couple}", history]
    events = dpg.actuate(SPEC, settings=settings).table.to_pandas()
    assert events["kind"].tolist() == ["snap", "reset"]
    own = float(limits(loaded.finger, loaded.volumes).reset_pressure.ravel()[0])
    alike = events["pressure_MPa"][1] == pytest.approx(own, rel=1e-6)
    assert alike is not is_in_touch


def test_units_by_themselves_bear_no_loads() -> None:
    bare, loaded = pressed(), pressed("loads.tip_force_y_N=0.3", "loads.unit_mass_g=12")
    first, second = thresholds_alone(bare), thresholds_alone(loaded)
    assert loaded.finger.is_loaded
    assert first.snap.tobytes() == second.snap.tobytes()
    assert first.reset.tobytes() == second.reset.tobytes()


def test_transitions_are_under_the_loads() -> None:
    """A force that uncurls raises snap pressures, the more the longer its lever: tip first."""
    settings = ["loads.tip_force_y_N=0.2", "pressure={}", "finger.units=3"]
    rows = dpg.transitions(SPEC, settings=settings).to_pandas().set_index(["pattern", "direction"])
    steps = [rows.loc[(pattern, "+")] for pattern in ("000", "001", "011")]
    assert [step["reached_at_pressure"] for step in steps] == ["001", "011", "111"]
    pressures = [float(step["pressure_MPa"]) for step in steps]
    assert 0.1495 < pressures[0] < pressures[1] < pressures[2]
