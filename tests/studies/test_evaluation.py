"""Rows of a sweep: each design's states as `dpg predict` gives them, metrics as they follow."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from dpgcli.files.scene_file import read_spec, reason_against, scene_of
from dpgcli.states.plan import Request
from dpgcli.states.predict import predict

CONFIGS = Path(__file__).parents[2] / "configs"
HEIGHT = "finger.geometry.dome_height_mm"
SEPARATION = "finger.geometry.unit_separation_mm"
SECOND = "finger.overrides.2.geometry.dome_height_mm"
HEIGHTS = f"{{key: {HEIGHT}, values: [2.5, 6.5, 4.25, 7.1]}}"
SEPARATIONS = f"{{key: {SEPARATION}, values: [3, 2.2]}}"
UNITS = "{key: finger.units, values: [3, 1, 2, 5]}"
TRIPLE = list[tuple[float, float]]


def hull_area(points: TRIPLE) -> float:
    """Monotone chain and shoelace formula."""
    ordered = sorted(set(points))
    chains: list[TRIPLE] = []
    for walk in (ordered, ordered[::-1]):
        chain: TRIPLE = []
        for p in walk:
            while len(chain) > 1 and turn(chain[-2], chain[-1], p) <= 0:
                chain.pop()
            chain.append(p)
        chains.append(chain[:-1])
    ring = chains[0] + chains[1]
    return (
        sum(a[0] * b[1] - a[1] * b[0] for a, b in zip(ring, ring[1:] + ring[:1], strict=True)) / 2
    )


def turn(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


@pytest.mark.parametrize("base", ["three_unit", "gripper"])
def test_metrics_follow_from_the_states(study: Any, tables: Any, base: str) -> None:
    states, designs = tables(study(HEIGHTS, SEPARATIONS, base=base))
    metrics = designs.set_index("design")
    assert set(states["design"]) == set(metrics.index[metrics["status"] == "stable"])
    assert len(states)
    for number, rows in states[states["status"] == "stable"].groupby("design"):
        row = metrics.loc[number]
        length = rows["tip_x_mm"][rows["pattern"].str.count("1") == 0].item()
        tips = list(zip(rows["tip_x_mm"], rows["tip_y_mm"], strict=True))
        reach = [float(np.hypot(x, y)) for x, y in tips]
        expected = {
            "n_units": len(rows["pattern"].iloc[0]),
            "n_states": 2 ** row["n_units"],
            "n_stable": len(rows),
            "n_distinct_tips": len(
                {(round(x / length * 1e4), round(y / length * 1e4)) for x, y in tips}
            ),
            "reach_min_mm": min(reach),
            "reach_max_mm": max(reach),
            "stiffness_min_N_per_mm": min(rows["tip_stiffness_min_N_per_mm"]),
            "stiffness_max_N_per_mm": max(rows["tip_stiffness_max_N_per_mm"]),
            "max_residual_N": max(rows["residual_N"]),
            "max_numerical_error_mm": max(rows["numerical_error_mm"]),
        }
        if base == "gripper":
            expected["aperture_min_mm"] = min(rows["aperture_mm"])
            expected["aperture_max_mm"] = max(rows["aperture_mm"])
        assert row[list(expected)].to_dict() == expected
        assert row["workspace_area_mm2"] == pytest.approx(hull_area(tips), rel=1e-9)
    rest = metrics[metrics["status"] == "invalid"]
    assert len(rest) == 1
    assert (
        rest.filter(regex="_mm$|_mm2$|_mJ$|_N$|per_mm$")
        .drop(columns=["dome_height_mm", "unit_separation_mm"])
        .isna()
        .all(axis=None)
    )


def test_the_smallest_barrier_of_the_reference_unit(study: Any, tables: Any) -> None:
    """Top 6.0382332675 mJ, well 4.3613588754 mJ: the way back is the smaller one."""
    _, designs = tables(study(f"{{key: {HEIGHT}, values: [6.5]}}"))
    assert designs["min_barrier_mJ"].tolist() == pytest.approx([1.6768743921], abs=1e-9)


def test_the_weakest_unit_sets_the_smallest_barrier(study: Any, tables: Any) -> None:
    _, designs = tables(study(f"{{key: {SECOND}, values: [5.5, 6.5, 7]}}"))
    low, same, high = designs["min_barrier_mJ"]
    assert low < same
    assert high == same


@pytest.mark.parametrize(
    ("base", "changes"),
    [
        ("three_unit", {HEIGHT: 6.1, SEPARATION: 2.5}),
        ("three_unit", {SECOND: 6.1}),
        ("three_unit", {"finger.units": 5}),
        ("five_unit", {HEIGHT: 6.1}),
        ("eight_unit", {HEIGHT: 6.1}),
        ("graded_five_unit", {"finger.linear_stiffness_N_per_mm": 100.0}),
        ("gripper", {"gripper.mounting_angle_deg": 12.5}),
        ("gripper", {"gripper.base_spacing_mm": 40}),
    ],
)
def test_rows_of_a_design_are_those_of_predict(
    study: Any, tables: Any, base: str, changes: dict[str, float]
) -> None:
    axes = [f"{{key: {key}, values: [{value}]}}" for key, value in changes.items()]
    states, _ = tables(study(*axes, base=base))
    settings = [f"{key}={value}" for key, value in changes.items()]
    scene = scene_of(read_spec(CONFIGS / f"{base}.yaml", settings))
    prediction = predict(scene, Request(columns=("default", "stiffness")))
    blocks = list(prediction.blocks())
    compared = 0
    for column in prediction.plan.columns:
        if column.name in states and column.name not in ("status", "pattern", "reached_pattern"):
            expected = np.concatenate([block[column.name] for block in blocks])
            np.testing.assert_array_equal(states[column.name], expected, column.name)
            compared += 1
    patterns = np.concatenate([block["pattern"] for block in blocks])
    assert states["pattern"].tolist() == [pattern.decode() for pattern in patterns]
    assert compared > 10


def test_every_design_has_a_row_whatever_it_is(study: Any, tables: Any) -> None:
    states, designs = tables(
        study(HEIGHTS, SEPARATIONS, UNITS, rules="[units != 2, dome_height_mm < 7]")
    )
    assert designs["design"].tolist() == list(range(32))
    heights = np.repeat([2.5, 6.5, 4.25, 7.1], 8)
    units = np.tile([3, 1, 2, 5], 8)
    assert designs["dome_height_mm"].tolist() == heights.tolist()
    assert designs["units"].tolist() == units.tolist()
    excluded = (units == 2) | (heights >= 7)
    assert (designs["status"] == "excluded").tolist() == excluded.tolist()
    impossible = (heights == 2.5) & (np.tile(np.repeat([3, 2.2], 4), 4) == 3) & ~excluded
    assert (designs["status"] == "invalid").tolist() == impossible.tolist()
    assert (designs["reason"] != "").tolist() == impossible.tolist()
    assert designs["n_states"].tolist() == np.where(excluded | impossible, 0, 2**units).tolist()
    counts = states.groupby("design").size()
    assert [counts.get(d, 0) for d in range(32)] == designs["n_states"].tolist()
    assert states["design"].is_monotonic_increasing
    for _, rows in states.groupby("design"):
        assert rows["pattern"].is_monotonic_increasing


@pytest.mark.parametrize(
    "axis",
    [
        f"{{key: {HEIGHT}, values: [0, -1, 1.0e+15, 3, 6.5]}}",
        "{key: finger.units, values: [0, -2, 100, 65, 3]}",
        "{key: finger.units, values: [3.5, 2.5, 1.5, 0.5, 3]}",
        "{key: finger.overrides.4.geometry.dome_height_mm, values: [6, 6, 6, 6, 6]}",
        "{key: finger.linear_stiffness_N_per_mm, values: [0, -1, 1.0e+30, 0, 100]}",
    ],
)
def test_invalid_designs_are_rows_with_a_reason(study: Any, tables: Any, axis: str) -> None:
    _, designs = tables(study(axis))
    assert designs["status"].tolist()[:4] == ["invalid"] * 4
    assert designs["reason"].str.contains("expected").tolist()[:4] == [True] * 4


@pytest.mark.parametrize(
    ("base", "axes"),
    [
        ("three_unit", [HEIGHTS, SEPARATIONS, "{key: finger.units, values: [3, 99]}"]),
        ("three_unit", ["{key: finger.geometry.unit_cell_mm, values: [1.5, 2, 22]}", HEIGHTS]),
        ("three_unit", ["{key: finger.lattice.stroke_mm, values: [3.5, 3.4]}", HEIGHTS]),
        ("graded_five_unit", ["{key: finger.units, values: [3, 4, 5, 6]}", SEPARATIONS]),
        ("graded_five_unit", ["{key: finger.lattice.bistable_stiffness_N_per_mm, values: [9]}"]),
        ("gripper", ["{key: gripper.mounting_angle_deg, values: [91, 0]}", HEIGHTS]),
    ],
)
def test_a_reason_is_what_the_spec_alone_would_say(
    study: Any, tables: Any, base: str, axes: list[str]
) -> None:
    made = study(*axes, base=base)
    _, designs = tables(made)
    values = made.sweep.space.designs(0, len(designs))
    invalid = designs[designs["status"] == "invalid"]
    for place in invalid["design"]:
        changes = {key: column[place].item() for key, column in values.items()}
        assert designs["reason"][place] == reason_against(made.sweep.base_data, changes)
    assert len(invalid) > 0


def test_whole_units_beside_fractions_are_designs(study: Any, tables: Any) -> None:
    _, designs = tables(study("{key: finger.units, values: [3.5, 3.0, 2]}"))
    assert designs["status"].tolist() == ["invalid", "stable", "stable"]


def test_equal_numbers_of_units_are_designs_each(study: Any, tables: Any) -> None:
    states, designs = tables(study("{key: finger.units, values: [2, 3, 2]}"))
    assert designs["n_states"].tolist() == [4, 8, 4]
    assert (designs["calibration"] == "calibrated").all()
    assert len(states) == 16


@pytest.mark.parametrize("value", ["100000", "1000000000"])
def test_an_absurd_number_of_units_is_an_invalid_design(
    study: Any, tables: Any, value: str
) -> None:
    made = study(f"{{key: finger.units, values: [3, {value}]}}")
    made.check_memory()
    made.check_disk()
    _, designs = tables(made)
    assert designs["status"].tolist() == ["stable", "invalid"]


def test_a_unit_with_one_well_only_is_a_row_not_a_stop(study: Any, tables: Any) -> None:
    states, designs = tables(study("{key: finger.lattice.force_linearity, values: [0.5, 0.9]}"))
    assert designs["status"].tolist() == ["partly_stable"] * 2
    assert designs["min_barrier_mJ"].tolist() == [0, 0]
    assert designs["n_stable"].tolist() == [1, 1]
    assert len(states) == 16
    assert (states["status"] == "not bistable").sum() + (states["status"] == "stable").sum() <= 16


def test_a_constraint_that_has_no_value_is_not_met(study: Any, tables: Any) -> None:
    _, designs = tables(study(HEIGHTS, rules='["log(dome_height_mm - 6) > -9"]'))
    assert designs["status"].tolist() == ["excluded", "stable", "excluded", "stable"]


def test_a_design_is_the_same_in_any_company(study: Any, tables: Any) -> None:
    together, _ = tables(study(HEIGHTS, SEPARATIONS, UNITS))
    alone, _ = tables(
        study(
            f"{{key: {HEIGHT}, values: [4.25]}}",
            f"{{key: {SEPARATION}, values: [2.2]}}",
            "{key: finger.units, values: [5]}",
            folder="alone",
        )
    )
    here = together[together["design"] == 2 * 8 + 4 + 3].reset_index(drop=True)
    pd.testing.assert_frame_equal(
        here.drop(columns=["design", "unit_separation_mm"]),
        alone.drop(columns=["design", "unit_separation_mm"]),
        check_exact=True,
    )
