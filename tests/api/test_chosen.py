"""What was chosen beside the spec is in the files: no two results have the same metadata."""

import json
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

import dpgcli as dpg
from dpgcli.files.scene_file.objects import ObjectSpec, told_of

LATTICE = {
    "segment_length_mm": 13.5,
    "segment_height_mm": 10.75,
    "stroke_mm": 3.5,
    "bistable_stiffness_N_per_mm": 12.84,
    "force_linearity": 0.043,
    "hinge_stiffness_N_mm_per_rad": 24.2,
}
FINGER = {
    "units": 2,
    "linear_stiffness_N_per_mm": float("inf"),
    "lattice": LATTICE,
    "geometry": {"limiting_layer_thickness_mm": 1.5},
}
SPEC = {"finger": FINGER, "gripper": {"base_spacing_mm": 30.0, "mounting_angle_deg": 0.0}}


def chosen(result: Any, folder: Path) -> dict[str, str]:
    result.save(folder / "t.parquet")
    found = pq.read_schema(folder / "t.parquet").metadata
    return {key.decode().removeprefix("dpg."): value.decode() for key, value in found.items()}


def test_grasps_tell_the_body_as_it_was(tmp_path: Path) -> None:
    spec = {**SPEC, "object": {"disc": {"diameter_mm": 10.0}, "at_mm": [22.0, 0.0]}}
    found = dpg.grasp(spec, object="disc:12", at=(20.0, 1.0), patterns="00", approach="insert")
    said = chosen(found, tmp_path)
    assert json.loads(said["object"]) == {
        "disc": {"diameter_mm": 12.0},
        "at_mm": [20.0, 1.0],
        "held": "fixed",
    }
    assert said["approach"] == "insert"
    assert json.loads(said["spec"])["object"]["disc"] == {"diameter_mm": 10.0}


@pytest.mark.slow
def test_jaws_tell_their_apertures(tmp_path: Path) -> None:
    said = chosen(dpg.jaws(SPEC, gaps=(20.0, 24.0), at=(20.0, 0.0), patterns="00"), tmp_path)
    assert json.loads(said["gaps_mm"]) == [20.0, 24.0]
    assert json.loads(said["object"])["jaws"] == {"gap_mm": 24.0, "height_mm": 40.0}
    assert json.loads(said["object"])["at_mm"] == [20.0, 0.0]


def test_paths_tell_their_pressures(tmp_path: Path) -> None:
    spec = {"finger": FINGER, "pressure": {"lines": {"A": 1, "B": 2}, "effective_area_mm2": 31.6}}
    pressure = {"A": [0.0, 0.1], "B": [0.0, 0.0]}
    said = chosen(dpg.actuate(spec, pressure=pressure, start="01", cycles=2), tmp_path)
    assert json.loads(said["history_MPa"]) == pressure
    assert (said["start"], said["cycles"]) == ("01", "2")
    other = chosen(dpg.actuate(spec, pressure=pressure), tmp_path)
    assert (other["start"], other["cycles"]) == ("00", "1")


def test_landscapes_tell_their_states(tmp_path: Path) -> None:
    said = chosen(dpg.landscape({"finger": FINGER}, start="00", end="11", via="01"), tmp_path)
    assert (said["from"], said["to"], json.loads(said["via"])) == ("00", "11", ["01"])


@pytest.mark.parametrize(
    "said",
    [
        {"disc": {"diameter_mm": 12.0}, "at_mm": [1.0, 2.0], "held": "free"},
        {"polygon": [[0.0, 1.0], [2.0, 3.0], [-1.0, 5.0]], "at_mm": [1.0, 2.0], "held": "guided"},
        {"jaws": {"gap_mm": 3.0, "height_mm": 4.0}, "at_mm": [1.0, 0.0], "held": "fixed"},
        {
            "jaws": {"gap_mm": 3.0, "height_mm": 4.0},
            "compliance": {"stiffness_N_per_mm": 0.5},
            "at_mm": [1.0, 0.0],
            "held": "fixed",
        },
    ],
)
def test_a_body_is_told_as_specs_say_it(said: dict[str, Any]) -> None:
    spec = ObjectSpec.model_validate(said)
    assert told_of(spec.known, spec.held) == said
