"""`pulses` with scatter under loads against single fingers that `actuate` follows from rest."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dpgcli as dpg
from dpgcli.actuation import scatter as module
from dpgcli.actuation.pressed import Pressed
from dpgcli.api.pressure import pressed_input
from dpgcli.api.scatter import drawn_by
from dpgcli.arrays import Codes, Flags

LATTICE = {
    "segment_length_mm": 13.5,
    "segment_height_mm": 10.75,
    "stroke_mm": 3.5,
    "bistable_stiffness_N_per_mm": 12.84,
    "force_linearity": 0.043,
    "hinge_stiffness_N_mm_per_rad": 24.2,
}
KEY = "bistable_stiffness_N_per_mm"
DEVIATION = 0.03
N = 60


def loaded(couple: float, first: float = 12.84, second: float = 20.0) -> dict[str, Any]:
    """Two units whose first one snaps by itself under a couple of about -50.6 N mm."""
    return {
        "finger": {
            "units": 2,
            "linear_stiffness_N_per_mm": float("inf"),
            "lattice": {**LATTICE, KEY: first},
            "overrides": {"2": {"lattice": {KEY: second}}},
        },
        "pressure": {"lines": {"A": 1, "B": 2}, "effective_area_mm2": 31.61},
        "loads": {"tip_moment_N_mm": couple},
    }


def stiffnesses(couple: float) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """Those of the draws that the program makes, (unit, draw)."""
    drawn = drawn_by(pressed_input(loaded(couple), ()), {KEY: f"{DEVIATION:.0%}"}, N, 1)
    assert drawn is not None
    ((_, pressed),) = drawn.batches()
    return np.asarray(pressed.finger.bistable_stiffness)


def followed(couple: float, table: Any) -> tuple[list[str], list[str]]:
    """Where each draw rests before the pulses of a table, and where after: one by one."""
    peaks: dict[str, list[float]] = {"A": [0.0, 0.0], "B": [0.0, 0.0]}
    for line, peak in zip(table["line"], table["peak_pressure_MPa"], strict=True):
        for name, history in peaks.items():
            history += [float(peak) if name == str(line) else 0.0, 0.0]
    ways = [
        dpg.actuate(loaded(couple, float(first), float(second)), pressure=peaks)
        for first, second in stiffnesses(couple).T
    ]
    return [way.start for way in ways], [way.pattern for way in ways]


@pytest.mark.slow
@pytest.mark.parametrize(("couple", "end"), [(-50.9, "11"), (-50.4, "10"), (-50.4, "11")])
def test_draws_end_where_actuate_leads_each(couple: float, end: str) -> None:
    """The same stiffnesses, as specs of their own; drawn as they should be, by their spread."""
    found = dpg.pulses(loaded(couple), end=end, scatter=f"{KEY}=3%", draws=N)
    starts, ends = followed(couple, found.table)
    assert found.scattered is not None
    assert 0 < starts.count(found.start) < N
    assert found.scattered.found.n_begun == starts.count(found.start)
    assert found.scattered.found.n_done == ends.count(end)
    assert found.scattered.probability == ends.count(end) / N
    said = f"{starts.count(found.start)} draws of {N} rest in {found.start}"
    assert said in found.summary


def test_the_spread_of_draws_is_the_one_asked_for() -> None:
    ratios = stiffnesses(-50.9) / [[12.84], [20.0]] - 1.0
    assert np.abs(ratios.mean(axis=1)).max() < 3.0 * DEVIATION / np.sqrt(N)
    np.testing.assert_allclose(ratios.std(axis=1), DEVIATION, rtol=0.3)


@pytest.mark.slow
def test_without_pulses_draws_rest_where_they_do() -> None:
    found = dpg.pulses(loaded(-50.9), end="10", scatter=f"{KEY}=3%", draws=N)
    assert found.exists
    assert len(found.table) == 0
    assert "probability" in found.table.names
    assert found.scattered is not None
    starts, _ = followed(-50.9, found.table)
    assert found.scattered.probability == starts.count("10") / N
    share = f"{starts.count('10') / N:.1%} of draws rest in 10 (95% confidence: "
    assert any(line.startswith(share) for line in found.summary)


def test_a_given_start_is_that_of_all_draws_that_have_it() -> None:
    scatter = {"scatter": f"{KEY}=3%", "draws": N}
    found = dpg.pulses(loaded(-50.4), end="10", start="00", **scatter)
    own = dpg.pulses(loaded(-50.4), end="10", **scatter)
    assert found.scattered is not None
    assert own.scattered is not None
    n_without = N - own.scattered.found.n_begun
    assert found.scattered.found.n_unknown == n_without > 0
    said = f"{n_without} draws with no certified state 00: counted as failures"
    assert said in found.summary
    assert own.scattered.found.n_unknown == 0
    assert found.scattered.probability < own.scattered.probability
    some = dpg.pulses(loaded(-50.9), end="10", start="10", **scatter)
    assert some.scattered is not None
    assert some.scattered.probability == 1.0
    assert any(line.startswith("100.0% of draws begin in 10") for line in some.summary)


def test_draws_of_unknown_rest_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    """As if one of those that rest in 10 rested in no certified state."""
    rests, scatter = module.rests, {"scatter": f"{KEY}=3%", "draws": N}

    def doubtful(pressed: Pressed, n_designs: int) -> tuple[Codes, Flags]:
        codes, _ = rests(pressed, n_designs)
        return codes, np.arange(n_designs) != np.argmax(codes == 0b10)

    whole = dpg.pulses(loaded(-50.9), end="10", **scatter)
    monkeypatch.setattr(module, "rests", doubtful)
    found = dpg.pulses(loaded(-50.9), end="10", **scatter)
    assert "1 draw unknown: at rest in no certified state; counted as failures" in found.summary
    assert whole.scattered is not None
    assert found.scattered is not None
    assert found.scattered.found.n_done == whole.scattered.found.n_done - 1


def test_where_no_pulses_lead_scatter_is_not_followed() -> None:
    spec = Path(__file__).parents[2] / "configs" / "three_unit.yaml"
    found = dpg.pulses(spec, end="101", scatter="stroke_mm=1%", draws=5)
    assert not found.exists
    assert found.summary[-2] == "scatter: without pulses no draws are followed"
