"""Numbers as NumPy has them are numbers: what is written is the same, byte by byte."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dpgcli as dpg
from dpgcli.api.arguments import number, whole
from dpgcli.api.place import Place
from dpgcli.mechanics.finger import STUDY, uniform_finger
from tests.api.test_choices import DESIGNS, GOAL, HINGE, SPEC, SWEEP

FINGER = uniform_finger(2, **STUDY)
PRESSED = {**SPEC, "pressure": {"history": {"A": "0:0.05"}}}
DOME = {
    "travel_mm": [0.0, 0.5, 1.0, 1.5, 2.0, 2.5],
    "energy_mJ": [0.0, 0.28, 0.51, 0.29, 0.0, 0.8],
}
CALLS: dict[str, tuple[Callable[..., Any], dict[str, Any]]] = {
    "actuate": (lambda **given: dpg.actuate(PRESSED, **given), {"cycles": 2}),
    "fit_bistable": (
        lambda **given: dpg.fit_bistable(DOME, travel_to_opening="equal", **given),
        {"bootstrap": 3, "seed": 2, "loss": "huber", "loss_scale": 0.5},
    ),
    "fit_hinge": (
        lambda **given: dpg.fit_hinge(HINGE, **given),
        {"bootstrap": 3, "seed": 2, "loss": "huber", "loss_scale": 0.5},
    ),
    "inverse_design": (
        lambda **given: dpg.inverse_design(GOAL, **given),
        {"seed": 2, "evaluations": 64},
    ),
    "pick": (lambda **given: dpg.pick(DESIGNS, **given), {"top": 1, "design": 1}),
    "predict": (lambda **given: dpg.predict(FINGER, **given), {"tolerance": 0.5**30}),
    "predict less": (lambda **given: dpg.predict(FINGER, **given), {"target_error": 0.5**6}),
    "transitions": (
        lambda **given: dpg.transitions(SPEC, scatter="stroke_mm=1%", **given),
        {"draws": 3, "seed": 2},
    ),
}


def saved(result: Any, place: Path) -> list[bytes]:
    """The bytes of all that a result writes."""
    result.save(place)
    files = sorted(place.iterdir()) if place.is_dir() else [place]
    return [path.read_bytes() for path in files]


@pytest.mark.parametrize("name", CALLS)
def test_all_that_is_written_is_the_same(tmp_path: Path, name: str) -> None:
    call, given = CALLS[name]
    theirs = {
        key: (np.int32 if isinstance(value, int) else np.float32)(value)
        for key, value in given.items()
        if not isinstance(value, str)
    }
    own = saved(call(**given), tmp_path / "own")
    assert saved(call(**{**given, **theirs}), tmp_path / "theirs") == own


@pytest.mark.parametrize("exact", [{"tolerance": 0.5**30}, {"target_error": 0.5**6}])
def test_a_sweep_goes_on_with_them(tmp_path: Path, exact: dict[str, float]) -> None:
    own = dpg.sweep(SWEEP, tmp_path, executor="serial", **exact)
    theirs = {key: np.float64(value) for key, value in exact.items()}
    again = dpg.sweep(SWEEP, tmp_path, jobs=np.int64(1), **theirs)
    assert again.fingerprint == own.fingerprint


def test_places_and_arguments_are_plain() -> None:
    with Place(jobs=np.int64(2)).workplace(print) as workplace:  # which starts none before its work
        n_workers = workplace.n_workers
    assert json.dumps([n_workers, whole("top", np.int8(3)), number("area", np.float32(0.5))])
    assert whole("top", None) is number("area", None) is None
