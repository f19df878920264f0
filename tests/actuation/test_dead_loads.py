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


LED_ON = ("finger.units=2", "loads.tip_moment_N_mm=-55", "pressure={}")
HIGHER = "finger.overrides.2.geometry.dome_height_mm=7.5"


def test_pulses_begin_where_loads_leave_the_finger() -> None:
    """Under this couple the first unit flips by itself: 10 is where the finger rests."""
    settings = [*LED_ON, HIGHER]
    states = dpg.predict(SPEC, settings=settings).to_pandas().set_index("pattern")
    assert states["status"].to_dict()["00"] == "another_pattern"
    assert states["reached_pattern"]["00"] == "10"
    found = dpg.transitions(SPEC, settings=settings)
    assert found.reachable == ("10", "11")
    assert found.graph.rest == 0b10
    assert "loads bring the finger at rest to 10" in found.summary
    assert dpg.pulses(SPEC, end="11", settings=settings).start == "10"
    assert dpg.lookup(SPEC, settings=settings).start == "10"
    assert dpg.actuate(SPEC, pressure="0:0.01", settings=settings).start == "10"


def buckled(tmp_path: Path, force: float) -> Path:
    """Three units between a force and the base: without inverted ones they are straight."""
    spec = tmp_path / "straight.yaml"
    text = SPEC.read_text().replace("units: 5", "units: 3\n  law: push_only")
    spec.write_text(f"{text}\npressure: {{}}\nloads: {{tip_force_x_N: {force}}}\n")
    return spec


@pytest.mark.parametrize(("force", "n_unknown"), [(0.0, 0), (-0.5, 1)])
def test_beyond_buckling_it_is_not_known_where_the_finger_rests(
    tmp_path: Path, force: float, n_unknown: int
) -> None:
    """000 is a saddle, and the two states beside it are not looked for: no bound may hold."""
    spec = buckled(tmp_path, force)
    found = dpg.transitions(spec)
    assert (found.graph.rest, found.graph.n_unknown > 0) == (-n_unknown, n_unknown > 0)
    is_said = any("000 is marginal" in line for line in found.summary)
    assert is_said is (n_unknown == 1)
    space = [{"key": "finger.geometry.unit_separation_mm", "values": [3.0]}]
    sweep = {"base": str(spec), "space": space}
    rules = ["n_stable <= 8", "reach_max_mm < 50", "n_reachable < 9"]
    result = dpg.sweep(sweep, executor="serial", require=rules)
    rows = result.designs
    assert rows["n_unknown_states"].tolist() == [n_unknown]
    assert rows["n_unknown_directions"].tolist() == [n_unknown]
    assert [verdict.is_met for verdict in result.verdicts] == [n_unknown == 0] * 3


def test_what_loads_lead_nowhere_is_not_said_to_be_no_state() -> None:
    """Under this force 10 folds onto itself on the way, and the chain has no stiff bars to mind."""
    settings = ("finger.units=2", "loads.tip_force_x_N=-6.5", "pressure.lines={A: 1-2}")
    reason = dpg.pulses(SPEC.with_name("eight_unit.yaml"), end="10", settings=settings).reasons[0]
    assert reason.startswith("no stable state of 10 is found: not_converged, ")
    assert reason.endswith("; or the state is lost, or folds onto itself, as loads grow")
    assert "node coordinates" not in reason
