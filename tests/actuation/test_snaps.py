"""What fingers become where a unit has lost its place: shapes that can be, ties that are said."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import dpgcli as dpg
from dpgcli.actuation.directions import Directions, raised
from dpgcli.actuation.pressed import Halt, Pressed
from dpgcli.actuation.rest import at_rest
from dpgcli.actuation.staircase import driven
from dpgcli.actuation.travel import travel
from dpgcli.mechanics.finger import Finger

Study, Made = Callable[..., Finger], Callable[..., Pressed]
LATTICE = ("stroke_mm", "bistable_stiffness_N_per_mm", "force_linearity")
UNEQUAL: dict[str, Any] = {
    "units": 3,
    "law": "push_only",
    "lattice": {
        "segment_length_mm": 13.5,
        "segment_height_mm": 10.75,
        "stroke_mm": 4.225,
        "bistable_stiffness_N_per_mm": 12.0,
        "force_linearity": 0.0286,
        "hinge_stiffness_N_mm_per_rad": 24.2,
    },
    "overrides": {
        unit: {"lattice": dict(zip(LATTICE, values, strict=True))}
        for unit, values in {"2": (3.77, 10.6, 0.0665), "3": (3.39, 9.36, 0.0139)}.items()
    },
}


def test_no_way_leads_through_a_shape_that_crosses_itself(study: Study, pressed: Made) -> None:
    """All units at once: at rest 1^8 has room, under the pressure of the snap it has not."""
    finger = pressed(study(8).changed(stroke=np.array([[8.6]])))
    rest, settled = at_rest(finger, np.array([[False, True]]).repeat(8, axis=0))
    assert settled.status.tolist() == [0, 0], "both are states at rest"
    start = rest.take_lanes(np.array([0]))
    target = np.full((8, 1), 2.0)
    directions = Directions.of(np.zeros(1, int), np.zeros(1, np.uint64), 1)
    _, stairs, way = raised(finger, np.zeros(8, int), np.array([2.0]), directions)
    alone = travel(finger, start, target.T)
    assert (alone.reason, alone.events) == (Halt.FOLDED, ())
    assert alone.folded is not None and alone.folded.all(), "the shape beyond is what folds"
    assert driven(finger, start, target).reason.tolist() == [Halt.FOLDED]
    assert stairs == ()
    assert way.reason[0] == Halt.FOLDED


def test_commands_agree_on_a_snap_that_folds() -> None:
    lattice = {**UNEQUAL["lattice"], "stroke_mm": 8.6, "bistable_stiffness_N_per_mm": 12.84}
    finger = {"units": 8, "linear_stiffness_N_per_mm": 1e4, "lattice": lattice}
    spec = {"finger": finger, "pressure": {"effective_area_mm2": 30}}
    row = dpg.transitions(spec).to_pandas().query("pattern == '00000000' and direction == '+'")
    assert row["note"].str.startswith("folds onto itself").all()
    assert dpg.transitions(spec).reachable == ("00000000",)
    with pytest.raises(dpg.DpgError, match=r"snaps at .* to 11111111, which folds onto itself"):
        dpg.actuate(spec, pressure="0:2:0")


@pytest.mark.parametrize(
    "linear_stiffness", [30.0, *(pytest.param(k, marks=pytest.mark.slow) for k in (30.01, 100.0))]
)
def test_units_that_may_go_along_or_not_are_tied(linear_stiffness: float) -> None:
    """Unequal units that snap at one pressure: what goes after the first hangs on a breath."""
    spec = {
        "finger": {**UNEQUAL, "linear_stiffness_N_per_mm": linear_stiffness},
        "pressure": {"snap_pressure_MPa": 0.15},
    }
    found = dpg.transitions(spec).to_pandas()
    row = found[(found["pattern"] == "000") & (found["direction"] == "+")].iloc[0]
    assert row["tie"] != ""
    flipped = {str(i + 1) for i, digit in enumerate(row["reached_at_pressure"]) if digit == "1"}
    assert set(row["unit"].split(",")) == flipped
