"""Fingers that fold on the way to a margin."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dpgcli as dpg
from dpgcli.arrays import Flags
from dpgcli.grasping.contact import Obstructed
from dpgcli.grasping.shapes import ContactShapes

GRIPPER = Path(__file__).parents[2] / "configs" / "gripper.yaml"
SMALL = {"finger.units": 2, "gripper.base_spacing_mm": 30.0}


def about_disc(diameter: float) -> Any:
    body = {"disc": {"diameter_mm": diameter}, "at_mm": [15, 0]}
    return dpg.grasp(GRIPPER, patterns="01", settings={**SMALL, "object": body}).table


def folding(own: Obstructed, shapes: ContactShapes) -> Flags:
    return np.ones(shapes.coordinates.shape[1], bool)


def test_a_margin_is_of_shapes_that_fingers_can_take(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the finger is folded at the reset it is not known; the state itself stays stable."""
    known = about_disc(30.0)
    assert known["margin"][0] == pytest.approx(0.3793, abs=1e-4)
    monkeypatch.setattr(Obstructed, "are_folded", folding)
    found = about_disc(30.0)
    assert found["status"].tolist() == known["status"].tolist()
    assert np.isnan(found["margin"]).all()


@pytest.mark.slow
@pytest.mark.parametrize(("gap", "is_state"), [(91.0, True), (100.0, False)])
def test_what_margins_lead_over_are_grasps(gap: float, is_state: bool) -> None:
    """Of larger jaws there is none, so that nothing is told of a reset at 110 mm."""
    body = {"jaws": {"gap_mm": gap, "height_mm": 40}, "at_mm": [30, 0]}
    found = dpg.grasp(GRIPPER, patterns="00100", settings={"object": body}).table
    assert (found["status"][0] == "stable") == is_state
    assert np.isnan(found["margin"]).all()
