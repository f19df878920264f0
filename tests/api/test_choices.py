"""Choices of the Python face, one by one: flags, counts, names, numbers that can be none."""

import inspect
from collections.abc import Callable
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest

import dpgcli as dpg
from dpgcli.design.scene import Gripper, Scene
from dpgcli.mechanics.finger import STUDY, uniform_finger

FINGER = uniform_finger(2, **STUDY)
DESIGNS = {
    "design": [0, 1],
    "height_mm": [5.5, 6.5],
    "calibration": ["given"] * 2,
    "status": ["stable"] * 2,
    "reason": [""] * 2,
    "n_stable": [8, 8],
}
TURNS = {"unit": ["ground"] * 2, "moment_N_mm": [2.42, -2.42], "chamber2_angle_rad": [-0.1, 0.1]}
HINGE = {"rotation_rad": [-0.1, 0.1], "moment_N_mm": [-2.42, 2.42]}
CURVE = {"opening_mm": [0.0, 1.0, 2.0, 3.0, 4.0], "force_N": [0.0, 1.0, 0.5, -0.3, 1.0]}
GRID = {"dome_height_mm": [6.0, 6.5], "bistable_stiffness_N_per_mm": [12.0, 13.0]}
TIPS = {"pattern": ["00"], "tip_x_mm": [27.0], "tip_y_mm": [1.0]}
SPEC = {
    "finger": {
        "units": 1,
        "linear_stiffness_N_per_mm": 1e4,
        "lattice": {
            "segment_length_mm": 13.5,
            "segment_height_mm": 10.75,
            "stroke_mm": 3.5,
            "bistable_stiffness_N_per_mm": 12.84,
            "force_linearity": 0.043,
            "hinge_stiffness_N_mm_per_rad": 24.2,
        },
    }
}
SWEEP = {"base": SPEC, "space": [{"key": "finger.units", "values": [1]}]}
GOAL = {
    "base": SPEC,
    "vary": {"finger.lattice.stroke_mm": [3.0, 3.5]},
    "targets": [{"pattern": "1", "quantity": "tip", "value": [13.0, -1.0], "tolerance_mm": 1.0}],
}
TOUCHING = Scene(FINGER, (), None, 1.5)
GRIPPING = Scene(FINGER, (), Gripper(base_spacing=40.0, mounting_angle=0.0), 1.5)
FACE: dict[str, dict[str, Any]] = {
    "actuate": {"spec": FINGER, "pressure": "0..0.1"},
    "bench": {"spec": FINGER, "repeats": -1},  # refused in the end
    "check": {"designs": DESIGNS, "require": "n_stable > 1"},
    "compare": {"spec": FINGER, "data": TIPS},
    "explain": {"spec": FINGER},
    "fit_bistable": {"curve": CURVE, "travel_to_opening": "stroke:3.5"},
    "fit_finger": {"spec": FINGER, "states": TIPS},
    "fit_grid": {"table": GRID},
    "fit_hinge": {"curve": HINGE},
    "fit_unit": {"curve": TURNS},
    "grasp": {"spec": TOUCHING, "object": "disc:10", "at": (20.0, -10.0)},
    "inverse_design": {"goal": GOAL},
    "jaws": {"spec": GRIPPING, "gaps": (10.0, 12.0), "at": (20.0, 0.0), "patterns": "00"},
    "landscape": {"spec": FINGER, "start": "0x", "end": "11"},
    "lookup": {"spec": FINGER},
    "merge": {"shards": ["nowhere"], "output": "new"},
    "pick": {"designs": DESIGNS, "where": "n_stable > 1"},
    "predict": {"spec": FINGER},
    "pulses": {"spec": FINGER, "end": "11"},
    "report": {"folder": "nowhere"},
    "routine": {"spec": SPEC, "approach_from": (90.0, 0.0), "object": "disc:9", "closed": "x"},
    "stress": {"spec": None, "only": "none"},
    "sweep": {"sweep": SWEEP, "executor": "serial"},
    "transitions": {"spec": FINGER},
    "validate": {"specs": [SPEC]},
}
NONE: tuple[Any, ...] = (
    None, pd.NA, pd.NaT, "", "no", (), [], {}, b"x", 1.5, -1, 0, True, float("nan"), 10**30, 1j,
    date(2020, 1, 1), object(), np.array([]), np.array([0]), np.array([1.0, 2.0]), np.array(1),
    np.bool_(True), pd.Series([1]), pd.DataFrame(), pd.DataFrame({"a": [1]}), pa.array([1]),
    pa.table({"a": [1]}), [None], [[1]], {1: 2}, Path("x" * 300),
    "x" * 100_000, "\x1b[2J", ["\0"], {"\x1b[2J": "y" * 100_000}, "\u202e,\ud800",
)  # fmt: skip
SLOW = pytest.mark.slow
CHOICES = [
    pytest.param(name, argument, marks=SLOW if name in ("sweep", "jaws") else ())
    for name, given in FACE.items()
    for argument in (
        inspect.signature(getattr(dpg, name)).parameters if name != "validate" else ("settings",)
    )
    if argument != "watch" and (name, argument) != ("stress", "only")  # which would be all of it
]


def test_the_whole_face_is_here() -> None:
    others = {"read_calibration", "uniform_finger", "import_module"}
    functions = {name for name in dir(dpg) if inspect.isfunction(getattr(dpg, name))}
    assert {name for name in functions if not name.startswith("_")} - others == {*FACE}


@pytest.mark.parametrize(("name", "argument"), CHOICES)
def test_any_value_is_taken_or_refused_by_us(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, argument: str
) -> None:
    """Nothing of NumPy, pandas or Python itself comes through."""
    monkeypatch.chdir(tmp_path)
    call: Callable[..., Any] = getattr(dpg, name)
    for value in NONE:
        try:
            if name == "validate":
                call(*FACE[name]["specs"], settings=value)
            else:
                call(**{**FACE[name], argument: value})
        except dpg.DpgError as error:
            lines = str(error).split("\n")
            assert all(line.isprintable() and len(line) < 2500 for line in lines)
