"""Figures of grasps: bodies are drawn where they are."""

from pathlib import Path

import numpy as np
import pytest

import dpgcli as dpg
from dpgcli.design.bodies import Body, Jaws
from dpgcli.reports import grasp
from dpgcli.reports.outlines import Points, around_body

MECHANISM = "configs/objects/two_bar_mechanism.yaml"


def test_jaws_are_drawn_at_the_aperture_that_they_have(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: list[Body] = []

    def watched(body: Body) -> Points:
        drawn.append(body)
        return around_body(body)

    monkeypatch.setattr(grasp, "around_body", watched)
    told = dpg.grasp("configs/gripper.yaml", object=MECHANISM, at=(45.0, 0.0), patterns="00100")
    told.draw(tmp_path / "jaws.svg")
    gap = told.rows["jaw_gap_mm"][0]
    assert gap < 55.0, "they have given way"
    assert drawn and all(isinstance(body, Jaws) and body.gap == gap for body in drawn)
    assert np.ptp(around_body(drawn[0]).imag) == pytest.approx(gap)
