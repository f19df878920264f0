"""Arguments of a wrong type are the user's mistake: they are named, with what was expected."""

import inspect
import math
from collections.abc import Callable, Iterator
from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest

import dpgcli as dpg
from dpgcli.api.arguments import point
from dpgcli.api.given import sweep_input
from dpgcli.api.inputs import scene_input
from dpgcli.api.recalibration import recalibrated_scene
from dpgcli.files.scene_file import scene_of
from dpgcli.mechanics.finger import STUDY, uniform_finger

FINGER = uniform_finger(2, **STUDY)
LATTICE = {f"{name}_{unit}": STUDY[name] for name, unit in (
    ("segment_length", "mm"),
    ("segment_height", "mm"),
    ("stroke", "mm"),
    ("bistable_stiffness", "N_per_mm"),
    ("hinge_stiffness", "N_mm_per_rad"),
)} | {"force_linearity": 0.043}  # fmt: skip
BASE = {"finger": {"units": 2, "linear_stiffness_N_per_mm": 1e4, "lattice": LATTICE}}
PRESSED = {**BASE, "pressure": {"effective_area_mm2": 31.61}}
STROKES = {"finger.lattice.stroke_mm": [2.5, 3.5], "finger.units": [1, 2]}
SWEEP = {"base": BASE, "space": [{"paired": STROKES}]}
DOME = {"travel_mm": [0.0, 1.0, 2.0], "energy_mJ": [0.0, 1.0, 0.5]}
DESIGNS = {"design": [0], "calibration": ["given"], "status": ["stable"], "reason": [""]}


GRID = {"dome_height_mm": [1.0, 2.0, 4.0], "stroke_mm": [0.5, 2.0, 8.0]}
GRIPPER = {
    "finger": BASE["finger"] | {"geometry": {"limiting_layer_thickness_mm": 1.5}},
    "gripper": {"base_spacing_mm": 30.0, "mounting_angle_deg": 0.0},
}
TIPS = {"pattern": ["00"], "tip_x_mm": [27.0], "tip_y_mm": [1.0]}


def itself() -> dict[str, Any]:
    """Data that hold themselves."""
    data: dict[str, Any] = {}
    data["finger"] = data
    return data


def fit(**given: Any) -> Any:
    """A fit with a wrong argument."""
    return dpg.fit_bistable(DOME, travel_to_opening="equal", **given)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: dpg.predict(None), "spec None: expected a path"),
        (lambda: dpg.predict([BASE]), r"spec \[.*: expected a path"),
        (lambda: dpg.predict(FINGER, tolerance="1e-9"), "tolerance '1e-9': expected a number"),
        (lambda: dpg.predict(FINGER, target_error="1um"), "target_error '1um': expected a number"),
        (lambda: dpg.predict(FINGER, patterns=[11]), r"patterns \[11\]: expected a text"),
        (lambda: dpg.predict(FINGER, columns=None), "columns None: expected a text"),
        (lambda: dpg.predict(BASE, settings=3), "settings 3: expected a text"),
        (lambda: dpg.predict({"finger": pd.DataFrame()}), "a spec has no DataFrame: expected"),
        (lambda: dpg.predict(FINGER).save(3), "path 3: expected a path"),
        (lambda: dpg.predict(FINGER).draw(None), "path None: expected a path"),
        (lambda: dpg.sweep(None), "sweep None: expected a path"),
        (lambda: dpg.sweep(SWEEP, 3), "output 3: expected a path"),
        (lambda: dpg.sweep(SWEEP, jobs=1.5), "jobs 1.5: expected a whole number"),
        (lambda: dpg.sweep(SWEEP, wait="5m"), "wait '5m': expected a number"),
        (lambda: dpg.sweep({**SWEEP, "base": FINGER}), "base: a finger's values have no keys"),
        (lambda: dpg.merge(3, "x"), "shards 3: expected a path"),
        (lambda: dpg.check({**DESIGNS, "n_stable": [4]}, 3), "require 3: expected a text"),
        (lambda: dpg.report(None), "folder None: expected a path"),
        (lambda: dpg.stress(only=3), "only 3: expected a text"),
        (lambda: dpg.bench(FINGER, repeats="5"), "repeats '5': expected a whole number"),
        (lambda: dpg.fit_bistable(DOME, travel_to_opening=2.0), "travel_to_opening 2.0: expected"),
        (
            lambda: dpg.fit_bistable(DOME, travel_to_opening="equal", geometry=[6.5]),
            r"geometry \[6.5\]: expected a text",
        ),
        (
            lambda: dpg.fit_bistable(DOME, travel_to_opening="equal", bootstrap=True),
            "bootstrap True: expected a whole number",
        ),
        (lambda: dpg.predict(itself()), "a spec is nested too deeply, or holds itself"),
        (lambda: dpg.predict(BASE, settings=np.array(3)), r"settings array\(3\): expected a text"),
        (
            lambda: dpg.predict(FINGER, formulation=["chain"]),
            r"formulation \['chain'\]: expected",
        ),
        (
            lambda: dpg.predict(FINGER, target_error=10**400),
            "target_error 1000*[.]{3}: expected a",
        ),
        (
            lambda: dpg.predict(FINGER).sketch(width="a"),
            "width 'a': expected a whole number",
        ),
        (lambda: dpg.predict(FINGER).sketch(width=0), "width 0: expected a whole number from 1"),
        (lambda: dpg.sweep(SWEEP, shard=(1, 2)), r"shard \(1, 2\): expected a text"),
        (lambda: dpg.sweep(SWEEP, executor=["serial"]), r"executor \['serial'\]: expected a text"),
        (lambda: dpg.sweep(SWEEP, restart=pd.NA), "restart <NA>: expected True or False"),
        (lambda: dpg.sweep(SWEEP, force="no"), "force 'no': expected True or False"),
        (lambda: dpg.merge(np.array(3), "x"), r"shards array\(3\): expected a path"),
        (
            lambda: dpg.compare(BASE, TIPS, calibration={"a": 1}),
            "calibration {'a': 1}: expected",
        ),
        (
            lambda: dpg.compare(BASE, TIPS, first_station=(10**400, 0)),
            "first_station .* expected",
        ),
        (lambda: fit(fix=3.5), "fix 3.5: expected values by key"),
        (lambda: fit(fix="stroke_mm=3.5"), "fix 'stroke_mm=3.5': expected values by key"),
        (lambda: fit(fix={"stroke_mm": 10**400}), "fix stroke_mm=1000*[.]{3}: expected a number"),
        (lambda: fit(fix={"force_linearity": True}), "fix force_linearity=True: expected a number"),
        (lambda: dpg.fit_finger(BASE, TIPS, error="tips=1_0"), "error 'tips=1_0': expected a num"),
        (lambda: dpg.actuate(BASE, pressure=memoryview(b"ab")), "pressure <memory .* expected two"),
        (lambda: dpg.actuate(BASE, pressure=b"ab"), "pressure b'ab': expected two numbers"),
        (lambda: dpg.actuate(BASE, pressure=bytearray(b"ab")), "pressure bytearray.*expected two"),
        (lambda: dpg.predict(FINGER, patterns=b"11"), "patterns b'11': expected a text"),
        (lambda: dpg.pulses(PRESSED, end=""), "end : expected 2 digits, 0 or 1"),
        (lambda: dpg.pulses(PRESSED, end=None), "end None: expected 2 digits, 0 or 1"),
        (lambda: dpg.pulses(PRESSED, end=0), "end 0: expected a text"),
        (lambda: dpg.landscape(FINGER, start="", end="11"), "start : expected 2 digits"),
        (lambda: dpg.sweep(SWEEP, ""), "output '': expected a path"),
        (lambda: dpg.merge([""], "x"), "shards '': expected a path"),
        (lambda: dpg.merge(["x"], ""), "output '': expected a path"),
        (lambda: dpg.report(""), "folder '': expected a path"),
        (lambda: dpg.predict(""), "spec '': expected a path"),
        (lambda: dpg.predict(FINGER).save(""), "path '': expected a path"),
        (lambda: fit(fix={1: 2}), "fix 1: no value of the law"),
        (lambda: fit(bootstrap=None), "bootstrap None: expected a whole number from 0 on"),
        (
            lambda: fit(geometry=np.array([6.5, 7.5])),
            "geometry array.*: expected a text",
        ),
        (
            lambda: dpg.fit_grid(GRID, geometry=pd.Series([6.5])),
            r"geometry 0 +6.5\\n.*: expected a text",
        ),
        (lambda: dpg.check(pa.array([1]), "a > 1"), "the table is no table of designs"),
        (lambda: dpg.check({}, "a > 1", strict=pd.NA), "strict <NA>: expected True or False"),
        (lambda: dpg.check({}, "a > 1", strict=""), "strict '': expected True or False"),
        (lambda: dpg.report("x", strict=np.array([0])), r"strict array\(\[0\]\): expected True"),
        (lambda: dpg.report("x", format=pd.NA), "format <NA>: expected md or html"),
        (lambda: dpg.predict(FINGER).draw("x.svg", overlay="no"), "overlay 'no': expected True"),
        (lambda: dpg.bench(FINGER, repeats=None), "repeats None: expected from 1 to"),
        (lambda: dpg.actuate(BASE, pressure="0:0.1", cycles=None), "cycles None: expected 1 to"),
        (lambda: dpg.read_calibration(None), "path None: expected a path"),
        (lambda: dpg.read_calibration(5), "path 5: expected a path"),
        (lambda: dpg.read_calibration([]), r"path \[\]: expected a path"),
        (lambda: dpg.read_calibration({}), "path {}: expected a path"),
        (lambda: dpg.read_calibration(b"\xff"), r"path b'\\xff': expected a path"),
        (lambda: dpg.predict(FINGER, settings=pd.NA), "settings <NA>: expected a text"),
        (lambda: dpg.stress(settings=pd.NA), "settings <NA>: expected a text"),
        (lambda: dpg.landscape(FINGER, start=None, end="11"), "start None: expected 2 digits"),
        (lambda: dpg.check(memoryview(b"ab"), "a > 1"), "expected a table, columns of one length"),
    ],
)
def test_what_it_cannot_be_is_named(call: Callable[[], Any], said: str) -> None:
    with pytest.raises(dpg.UsageError, match=f"^{said}"):
        call()


@pytest.mark.parametrize(
    "place",
    [
        *("40", "40,0", b"40", bytearray(b"40"), memoryview(b"40"), iter("40")),
        *(("1_0", "0"), ("40", "0"), {40, 0}, {40: 1, 0: 1}, (True, False), (1j, 0)),
        *((40,), (40, 0, 0), (40, np.nan), (np.nan, 40), (10**400, 0)),
        *(pd.DataFrame([[40, 0]]), np.array([[40, 0]]), np.array(["4", "0"])),
    ],
)
@pytest.mark.parametrize("field", ["at", "first_station", "tip_offset"])
def test_a_place_is_two_numbers(field: str, place: Any) -> None:
    with pytest.raises(dpg.UsageError, match=f"(?s)^{field} .*: expected two numbers in mm"):
        if field == "at":
            dpg.grasp(GRIPPER, object="disc:20", at=place)
        else:
            dpg.compare(BASE, TIPS, **{field: place})


@pytest.mark.parametrize(
    "place", [(30, 0), [30.0, 0.0], np.array([30, 0]), pd.Series([30.0, 0.0]), range(30, -1, -30)]
)
def test_a_place_may_be_any_two_numbers_in_an_order(place: Any) -> None:
    assert point("at", place) == (30.0, 0.0)


@pytest.mark.parametrize("text", ["disc:4_0", "disc:４０", "disc:nan", "disc:"])
def test_a_diameter_is_a_number(text: str) -> None:
    with pytest.raises(dpg.UsageError, match=f"^object {text}: expected disc and its diameter"):
        dpg.grasp(GRIPPER, object=text, at=(40, 0))


def test_without_a_start_all_units_are_at_rest() -> None:
    for start in ("", None, "00"):
        assert dpg.lookup(PRESSED, start=start).start == "00"  # type: ignore[arg-type]


ITSELF: list[Any] = []
ITSELF.append(ITSELF)
DEEP: list[Any] = []
for _ in range(20_000):
    DEEP = [DEEP]
HUGE = 10**5000
UNWRITABLE = [HUGE, [HUGE, 1], {"a": HUGE}, {HUGE: 1}, {"A": [HUGE, 1]}, Fraction(10**400)]
UNWRITABLE += [Decimal("sNaN"), {"a": [Decimal("sNaN"), 1]}, {"a": Fraction(10**400)}]
UNWRITABLE += [{"finger": {"units": value}} for value in (HUGE, Fraction(10**400))]
UNWRITABLE += [DEEP, {"a": DEEP}, {"a": [DEEP, 1.0]}, {"a": [{"b": DEEP}]}, ITSELF, {"a": ITSELF}]
NEEDED: dict[Callable[..., Any], dict[str, Any]] = {
    dpg.actuate: {"spec": BASE, "pressure": "0:0.1"},
    dpg.bench: {"spec": "none"},
    dpg.check: {"designs": {**DESIGNS, "n_stable": [4]}, "require": "n_stable > 1"},
    dpg.compare: {"spec": BASE, "data": TIPS},
    dpg.explain: {"spec": BASE},
    dpg.fit_bistable: {"curve": DOME, "travel_to_opening": "equal"},
    dpg.fit_finger: {"spec": FINGER, "states": TIPS},
    dpg.fit_grid: {"table": GRID},
    dpg.fit_hinge: {"curve": {"moment_N_mm": [1.0, 2.0], "rotation_rad": [0.1, 0.2]}},
    dpg.fit_unit: {
        "curve": {"unit": ["ground"], "moment_N_mm": [1.0], "chamber2_angle_rad": [-0.1]}
    },
    dpg.landscape: {"spec": FINGER, "start": "00", "end": "01"},
    dpg.merge: {"shards": ["none"], "output": "none"},
    dpg.predict: {"spec": BASE},
    dpg.pulses: {"spec": BASE, "end": "11"},
    dpg.read_calibration: {"path": "none"},
    dpg.report: {"folder": "none"},
    dpg.routine: {"spec": BASE, "approach_from": (90.0, 0.0)},
    dpg.stress: {"only": "none"},
    dpg.sweep: {"sweep": SWEEP, "executor": "serial"},
    dpg.transitions: {"spec": BASE},
    dpg.validate: {},
}


@pytest.mark.slow
@pytest.mark.parametrize("function", NEEDED)
def test_what_cannot_be_written_is_no_crash(
    function: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whole numbers of thousands of digits, numbers that signal, lists without end."""
    monkeypatch.chdir(tmp_path)
    for name in inspect.signature(function).parameters:
        for value in UNWRITABLE if name != "watch" else ():
            given = (value,) if name == "specs" else ()
            named = {**NEEDED[function], **({} if given else {name: value})}
            try:
                function(*given, **named)
            except dpg.DpgError as error:
                assert len(str(error)) < 20_000


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: dpg.predict(FINGER, tolerance=HUGE), "tolerance an int that cannot be written:"),
        (lambda: dpg.sweep(SWEEP, jobs=HUGE), "jobs an int that cannot be written: expected"),
        (lambda: dpg.predict(BASE, patterns=[HUGE]), "patterns a list that cannot be written"),
        (lambda: dpg.validate(BASE, settings={"finger.units": HUGE}), "a spec has no such number"),
        (lambda: dpg.predict({"finger": {"units": Fraction(10**400)}}), "a spec has no such"),
        (lambda: dpg.predict({"finger": {"units": Decimal("sNaN")}}), "a spec has no such"),
        (lambda: dpg.predict({"finger": {HUGE: 1}}), "spec: an int that cannot be written is no"),
        (lambda: dpg.check({"a": DEEP}, "a > 1"), "expected a table of numbers and texts, found"),
        (lambda: dpg.check({"a": [ITSELF, 1]}, "a > 1"), "expected a table of numbers and texts"),
        (lambda: dpg.compare(BASE, {**TIPS, HUGE: [1]}), "expected a table, found a column an int"),
        (lambda: dpg.fit_hinge({"a": [HUGE]}), "expected a table of numbers and texts, found in"),
        (
            lambda: dpg.predict({"finger": {"overrides": {2: {}, "2": {}}}}),
            "spec: 2 is there twice, as '2' as well",
        ),
        (lambda: dpg.actuate(BASE, pressure={1: "0:1", "1": "0:2"}), "pressure: 1 is there twice"),
    ],
)
def test_what_cannot_be_written_or_is_lost_is_named(call: Callable[[], Any], said: str) -> None:
    with pytest.raises(dpg.UsageError, match=f"^{said}"):
        call()


def test_a_list_in_a_cell_is_no_list_without_end() -> None:
    frame = pd.DataFrame({**DESIGNS, "n_stable": [4], "mine": [[1, 2]]})
    (verdict,) = dpg.check(frame, "n_stable > 3")
    assert verdict.is_met


@pytest.mark.parametrize(
    "value", [pd.NA, pd.NaT, pd.Timestamp("2020-01-01"), np.datetime64("2020-01-01"), "\ud800"]
)
@pytest.mark.parametrize("is_listed", [False, True])
def test_what_no_spec_holds_is_a_problem_of_the_spec(value: Any, is_listed: bool) -> None:
    value = pd.Series([value], dtype=object) if is_listed else value
    for data in ({**BASE["finger"], "calibration": value}, value):
        with pytest.raises(dpg.DpgError):
            dpg.predict({"finger": data})
    for axis in ({"paired": {"finger.units": value}}, {"key": "finger.units", "values": value}):
        with pytest.raises(dpg.DpgError):
            dpg.sweep({"base": BASE, "space": [axis]}, jobs=1)
    with pytest.raises(dpg.DpgError):
        dpg.sweep({"base": BASE, "space": value}, jobs=1)


def test_numbers_of_numpy_are_numbers() -> None:
    tolerance = np.float32(1e-9)
    assert dpg.predict(FINGER, tolerance=tolerance).plan.request.tolerance == tolerance


def test_patterns_of_a_series(tmp_path: Path) -> None:
    chosen = pd.Series(["01", "10"])
    assert dpg.predict(FINGER, patterns=chosen).table["pattern"].tolist() == ["01", "10"]


def test_settings_that_can_be_read_once_change_all_that_they_are_for() -> None:
    soft, wrong = "finger.lattice.hinge_stiffness_N_mm_per_rad=30", "finger.lattice.hinges=30"
    found = dpg.sweep(SWEEP, settings=iter([soft]), jobs=1).designs
    changed = dpg.sweep(SWEEP, settings=[soft], jobs=1).designs
    pd.testing.assert_frame_equal(found.to_pandas(), changed.to_pandas())
    with pytest.raises(dpg.SpecError, match="hinges"):
        dpg.explain(SWEEP, settings=iter([wrong]))
    problems = dpg.validate(SWEEP, BASE, SWEEP, settings=iter([wrong]))
    assert [problem.key for problem in problems] == ["finger.lattice.hinges"] * 3


def test_dimensions_that_can_be_read_once_are_kept() -> None:
    fitted = dpg.fit_grid(GRID, geometry=iter(["dome_thickness_mm=0.75"])).calibration
    assert fitted.geometry is not None and fitted.geometry.dome_thickness_mm == 0.75
    with pytest.raises(dpg.UsageError, match="the table has a column dome_height_mm"):
        dpg.fit_grid(GRID, geometry=iter(["dome_height_mm=2"]))


def test_a_data_frame_is_an_axis() -> None:
    frame = dpg.sweep({"base": BASE, "space": [{"table": pd.DataFrame(STROKES)}]}, jobs=1)
    paired = dpg.sweep(SWEEP, jobs=1)
    pd.testing.assert_frame_equal(frame.designs.to_pandas(), paired.designs.to_pandas())
    decimals = {key: [Decimal(str(value)) for value in values] for key, values in STROKES.items()}
    for table in (pa.table(decimals), pd.DataFrame(decimals)):  # of a database
        found = dpg.sweep({"base": BASE, "space": [{"table": table}]}, jobs=1)
        pd.testing.assert_frame_equal(found.designs.to_pandas(), paired.designs.to_pandas())
    assert frame.designs["n_states"].tolist() == [2, 4]


WRONG = [None, "3", b"1", np.nan, -1.0, [3.0], np.array([3.0, 4.0]), 1j, pd.NA, 10**400, -math.inf]


@pytest.mark.parametrize("value", WRONG, ids=lambda value: str(value)[:20])
@pytest.mark.parametrize("name", ["n_units", *STUDY, "linear_stiffness"])
def test_no_finger_has_such_a_value(name: str, value: Any) -> None:
    with pytest.raises(dpg.UsageError, match=f"^{name} .*: expected a (whole )?number"):
        dpg.uniform_finger(**{"n_units": 2, **STUDY, name: value})


@pytest.mark.parametrize(
    ("name", "value"),
    [("n_units", value) for value in (0, 65, 2.5, 3.0, True, 10**6, Decimal(3))]
    + [(name, math.inf) for name in STUDY]
    + [(name, value) for name in (*STUDY, "linear_stiffness") for value in (1e300, True)]
    + [(name, 0.0) for name in STUDY if name not in ("force_linearity", "hinge_stiffness")]
    + [("linear_stiffness", 0.0), ("linear_stiffness", 2e18), ("force_linearity", 1.1)],
)
def test_no_finger_is_beyond_what_a_spec_can_have(name: str, value: Any) -> None:
    with pytest.raises(dpg.UsageError, match=f"^{name} .*: expected a (whole )?number"):
        dpg.uniform_finger(**{"n_units": 2, **STUDY, name: value})


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *(("n_units", np.int64(64)), ("stroke", np.float32(2)), ("linear_stiffness", math.inf)),
        *(("hinge_stiffness", 0), ("force_linearity", 1), ("linear_stiffness", 1e18)),
    ],
)
def test_numbers_of_any_kind_are_values_of_a_finger(name: str, value: Any) -> None:
    finger = dpg.uniform_finger(**{"n_units": 2, **STUDY, name: value})
    found = finger.n_units if name == "n_units" else getattr(finger, name).item()
    assert found == value


def test_a_finger_that_is_handed_in_has_no_more_units_than_a_spec() -> None:
    with pytest.raises(dpg.UsageError, match=r"^spec of 65 units: expected at most 64"):
        dpg.predict(uniform_finger(65, **STUDY), patterns="1*")


def test_a_calibration_is_a_name_a_path_or_a_value() -> None:
    """A Path is never the name of one that is built in."""
    spec, bent = study("published"), {"pattern": ["11"], "tip_x_mm": [26.0], "tip_y_mm": [-4.0]}
    errors = {
        name: dpg.compare(spec, bent, calibration=name).table["calibrated_error_mm"]
        for name in ("published", "finite_elements")
    }
    plain, shipped = (dpg.compare(study(name), bent).table["error_mm"] for name in errors)
    np.testing.assert_array_equal(errors["published"], plain)
    np.testing.assert_array_equal(errors["finite_elements"], shipped)
    assert np.abs(plain - shipped).max() > 0.1
    with pytest.raises(dpg.UsageError, match=r"^calibration published: expected .* no such file"):
        dpg.compare(spec, bent, calibration=Path("published"))
    with pytest.raises(dpg.UsageError, match="changes a spec, not a finger's values"):
        dpg.compare(FINGER, bent, calibration="published")
    with pytest.raises(dpg.SpecError, match=r"dome_height_mm.*; with calibration published\)"):
        dpg.compare(BASE, bent, calibration="published")


def test_pressures_in_a_file_that_data_name_are_read(tmp_path: Path) -> None:
    """As in a spec; also beside another calibration, and in the base of a sweep."""
    (tmp_path / "steps.csv").write_text("A_MPa\n0\n0.15\n")
    data = {**study("published"), "pressure": {"history": str(tmp_path / "steps.csv")}}
    given = scene_input(data)
    assert given.files == (tmp_path / "steps.csv",)
    sweep = sweep_input({"base": data, "space": SWEEP["space"]})
    for pressure in (
        given.scene.pressure,
        recalibrated_scene(given, "finite_elements").pressure,
        scene_of(sweep.base).pressure,
    ):
        assert pressure is not None and pressure.history is not None
        assert pressure.history.pressure.tolist() == [[0.0], [0.15]]


def study(calibration: str) -> dict[str, Any]:
    """A finger of the study's dimensions."""
    geometry = {"dome_height_mm": 6.5, "dome_thickness_mm": 0.75, "unit_cell_mm": 22}
    geometry |= {"chamber_length_mm": 9, "channel_width_mm": 10, "unit_separation_mm": 3}
    geometry |= {"limiting_layer_thickness_mm": 1.5, "elastic_modulus_MPa": 26}
    return {"finger": {"units": 2, "calibration": calibration, "geometry": geometry}}


def _without_end() -> Iterator[str]:
    while True:
        yield "0"


@pytest.mark.parametrize(
    "call",
    [
        lambda: dpg.grasp(BASE, object="disc:20", at=(22, 0), patterns=range(10**9)),
        lambda: dpg.predict(BASE, patterns=_without_end()),
        lambda: dpg.stress(only=_without_end()),
    ],
)
def test_sequences_that_are_too_long_are_refused_at_once(call: Callable[[], Any]) -> None:
    with pytest.raises(dpg.UsageError, match=r"expected at most 1,000,000 items"):
        call()


@pytest.mark.parametrize(
    "call",
    [
        lambda: dpg.stress(only=["scale"], watch=3),
        lambda: dpg.bench(BASE, watch="print"),
        lambda: dpg.sweep({"base": BASE, "space": []}, watch=None),
    ],
)
def test_who_watches_is_a_function(call: Callable[[], Any]) -> None:
    with pytest.raises(dpg.UsageError, match=r"^watch .*: expected a function"):
        call()


def test_what_masked_arrays_mask_is_missing() -> None:
    spec = {**BASE, "pressure": {"effective_area_mm2": 31.6}}
    masked = np.ma.array([0.0, 0.2, 0.0], mask=[False, True, False])
    for pressure in (masked, {"A": masked}):
        with pytest.raises(dpg.SpecError, match=r"A: expected a number, found"):
            dpg.actuate(spec, pressure=pressure)
