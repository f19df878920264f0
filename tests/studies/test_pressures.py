"""Pressure in sweeps: columns of designs, those of each design alone, asked for or not at all."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import dpgcli as dpg
from dpgcli.errors import UsageError
from dpgcli.files.sweep_file import read_sweep
from dpgcli.sweeps import metrics, pressures
from dpgcli.sweeps.metrics import UNDER_PRESSURE

pytestmark = pytest.mark.slow

CONFIGS = Path(__file__).parents[2] / "configs"
NAMES = [
    *("n_reachable", "reachable_patterns", "n_unknown_directions"),
    *("snap_pressure_min_MPa", "snap_pressure_max_MPa"),
    *("reset_pressure_min_MPa", "reset_pressure_max_MPa", "smallest_threshold_gap_MPa"),
]
FIRST = "finger.geometry.dome_height_mm"
LAST = "finger.overrides.3.geometry.dome_height_mm"
HEIGHTS = f"{{key: {FIRST}, values: [6.5, 2.5, 7.0]}}"
LASTS = f"{{key: {LAST}, values: [6.5, 7.4]}}"
Pressed = Callable[..., Any]


@pytest.fixture
def pressed(study: Any, tmp_path: Path) -> Pressed:
    """A study around three units with a section on pressure."""

    def made(*axes: str, section: str = "{}", folder: str = "out") -> Any:
        base = (CONFIGS / "three_unit.yaml").read_text(encoding="utf-8")
        (tmp_path / "base.yaml").write_text(f"{base}\npressure: {section}\n", encoding="utf-8")
        return study(*axes, base=str(tmp_path / "base"), folder=folder)

    return made


def alone(tmp_path: Path, row: pd.Series) -> Any:
    """The transitions of one design, by itself."""
    heights = {
        FIRST: row[FIRST],
        "finger.overrides": {"3": {"geometry": {"dome_height_mm": row[LAST]}}},
    }
    return dpg.transitions(tmp_path / "base.yaml", settings=heights)


def test_columns_are_those_of_the_registry() -> None:
    assert [metric.name for metric in UNDER_PRESSURE] == NAMES


@pytest.mark.parametrize("section", ["{}", "{lines: {A: 1-2, B: 3}}", "{snap_pressure_MPa: 0.1}"])
def test_each_design_has_what_it_has_alone(
    pressed: Pressed, tables: Any, tmp_path: Path, section: str
) -> None:
    _, designs = tables(pressed(HEIGHTS, LASTS, section=section))
    stable = designs[designs["status"] == "stable"]
    assert len(stable) == 4
    for _, row in stable.iterrows():
        found = alone(tmp_path, row)
        assert row["n_reachable"] == len(found.reachable)
        assert row["reachable_patterns"] == ",".join(found.reachable)
        pressure = found.to_pandas().set_index(["pattern", "direction"])["pressure_MPa"]
        snaps = [np.nanmin(pressure.loc[(pattern, "+")]) for pattern in ("011", "101", "110")]
        resets = [np.nanmax(pressure.loc[(pattern, "-")]) for pattern in ("100", "010", "001")]
        assert row["snap_pressure_min_MPa"] == pytest.approx(min(snaps), rel=1e-6)
        assert row["snap_pressure_max_MPa"] == pytest.approx(max(snaps), rel=1e-6)
        assert row["reset_pressure_min_MPa"] == pytest.approx(min(resets), rel=1e-6)
        assert row["reset_pressure_max_MPa"] == pytest.approx(max(resets), rel=1e-6)
        has_gap = row[FIRST] != row[LAST] and "B" not in section and "snap" not in section
        gaps = [abs(values[2] - values[0]) for values in (snaps, resets)]
        if has_gap:
            assert row["smallest_threshold_gap_MPa"] == pytest.approx(min(gaps), rel=1e-5)
        elif "snap" not in section:
            assert np.isnan(row["smallest_threshold_gap_MPa"])


def test_designs_that_cannot_be_have_none(pressed: Pressed, tables: Any) -> None:
    _, designs = tables(pressed(HEIGHTS, LASTS))
    invalid = designs[designs["status"] == "invalid"]
    assert len(invalid) == 2
    assert (invalid["n_reachable"] == 0).all()
    assert (invalid["reachable_patterns"] == "").all()
    assert invalid[NAMES[3:]].isna().all(axis=None)


def test_without_pressure_nothing_of_it_is_computed(
    study: Any, pressed: Pressed, tables: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []
    found = pressures.thresholds_alone
    monkeypatch.setattr(pressures, "thresholds_alone", lambda one: asked.append(1) or found(one))
    _, designs = tables(study(HEIGHTS, base="three_unit"))
    assert not asked
    assert not set(NAMES) & set(designs)
    _, designs = tables(pressed(HEIGHTS, folder="pressed"))
    assert asked == [1]  # one batch
    assert set(NAMES) < set(designs)


def test_the_other_columns_do_not_change(study: Any, pressed: Pressed, tables: Any) -> None:
    states, designs = tables(study(HEIGHTS, LASTS, base="three_unit"))
    more, pressed_designs = tables(pressed(HEIGHTS, LASTS, folder="pressed"))
    pd.testing.assert_frame_equal(states, more)
    pd.testing.assert_frame_equal(designs, pressed_designs[[*designs]])


def test_the_size_of_chunks_changes_no_bit(
    pressed: Pressed, tables: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    from dpgcli.studies import sweep as studies

    _, whole = tables(pressed(HEIGHTS, LASTS))
    monkeypatch.setattr(studies, "designs_at_once", lambda n_units: 2)
    _, parts = tables(pressed(HEIGHTS, LASTS, folder="parts"))
    pd.testing.assert_frame_equal(whole, parts, check_exact=True)


def test_areas_and_snap_pressures_may_vary(pressed: Pressed, tables: Any) -> None:
    """The finger is the same in all designs, its pressures are not."""
    axis = "{key: pressure.effective_area_mm2, values: [30, 15]}"
    _, designs = tables(pressed(axis, section="{effective_area_mm2: 31}"))
    whole, half = (designs.loc[k] for k in (0, 1))
    for name in NAMES[3:7]:
        assert half[name] == pytest.approx(2.0 * whole[name], rel=1e-9)
    assert whole["n_reachable"] == half["n_reachable"] == 2


def test_designs_are_held_against_pressures(pressed: Pressed, tables: Any) -> None:
    made = pressed(HEIGHTS, LASTS, section="{snap_pressure_MPa: 0.1495}")
    tables(made)
    table = made.folder / "designs.parquet"
    found = dpg.check(table, require=["snap_pressure_max_MPa < 0.15", "n_reachable > 2"])
    assert [len(verdict.rows) for verdict in found] == [2, 3]
    with pytest.raises(UsageError, match="reachable_patterns"):
        dpg.check(table, require=["reachable_patterns > 2"])


def test_what_is_assumed_is_warned_of(pressed: Pressed, tables: Any) -> None:
    made = pressed(HEIGHTS)
    tables(made)
    found = dpg.check(made.folder / "designs.parquet", require=["snap_pressure_max_MPa < 1"])
    (warning,) = found[0].warnings
    assert "pressures (assumed" in str(warning)


def test_long_fingers_under_pressure_are_refused_before_the_work(pressed: Pressed) -> None:
    units = "{key: finger.units, values: [3, 13]}"
    made = pressed(units)
    with pytest.raises(UsageError, match="13 units under pressure: expected at most 12"):
        made.extent.check(made.chunk_size, is_sent=False)


def test_pressure_is_in_the_plan(study: Any, pressed: Pressed) -> None:
    bare, under = study(HEIGHTS, LASTS), pressed(HEIGHTS, LASTS, folder="pressed")
    assert under.extent.seconds > bare.extent.seconds + 1e-3
    assert read_sweep(under.sweep.base_path.parent / "pressed.yaml").base.design.pressure


def test_a_batch_of_metrics_needs_pressure_for_its_columns() -> None:
    assert all(metric.needs_pressure for metric in UNDER_PRESSURE)
    others = {m.name for m in metrics.METRICS} - set(NAMES)
    assert not any(m.needs_pressure for m in metrics.METRICS if m.name in others)


@pytest.mark.parametrize("linearity", [0.1, 0.2])
def test_units_that_hold_but_one_state_leave_no_numbers_for_all(
    pressed: Pressed, tables: Any, linearity: float
) -> None:
    """With 0.1 a unit still snaps, but holds no shape without pressure; with 0.2 it does not."""
    axis = f"{{key: finger.overrides.1.lattice.force_linearity, values: [0.02, {linearity}]}}"
    _, designs = tables(pressed(axis))
    bistable, other = designs[NAMES[3:7]].to_numpy(float)
    assert np.isfinite(bistable).all()
    assert np.isnan(other).all()
