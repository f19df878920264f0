"""What is said of work that is done, and of work that another one stands in the way of."""

import json
from pathlib import Path

import pytest

from dpgcli.studies.run import run_summary
from dpgcli.studies.sweep import Progress, Shard
from dpgcli.sweeps.differences import differences


@pytest.mark.parametrize("part", [None, Shard(1, 2)])
def test_nothing_that_was_done_has_no_pace(part: Shard | None) -> None:
    said = run_summary(Path("out"), Progress(4, 4, 4, 1), part)
    assert said.startswith("out: no designs left, 4 were there")
    assert "states/s" not in said
    some = run_summary(Path("out"), Progress(4, 4, 3, 1, n_states=8, seconds=2.0), part)
    assert some.startswith("out: 1 design, 8 states in 2 s (4 states/s), 3 were there")


def test_a_calibration_that_was_fitted_again_is_one_difference() -> None:
    values = {f"value_{place}": {"value": 1.0, "standard_error": 0.1} for place in range(7)}
    fitted = {"file": "dome.yaml", "data": {"file": "a.csv", "sha256": "1"}, "values": values}
    new_values = {key: {"value": 2.0, "standard_error": 0.2} for key in values}
    again = {**fitted, "data": {"file": "b.csv", "sha256": "2"}, "values": new_values}
    old, new = (
        {"dpg.sweep": json.dumps({"base": json.dumps({"finger": {"calibration": [own, "x"]}})})}
        for own in (fitted, again)
    )
    assert differences(old, new) == ["sweep.base.finger.calibration.0 (dome.yaml: 16 keys)"]
    assert differences(old, old) == []
    one = {**fitted, "method": "by hand"}
    moved = {"dpg.base": json.dumps({"calibration": one})}
    before = {"dpg.base": json.dumps({"calibration": fitted})}
    assert differences(before, moved) == ["base.calibration.method"]
