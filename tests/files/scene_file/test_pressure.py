"""Pressure in a spec: lines, areas, snap pressures, histories; all mistakes, at their places."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dpgcli.design.scene import Origin
from dpgcli.errors import SpecError
from dpgcli.files.histories import read_history
from dpgcli.files.scene_file import (
    canonical_json,
    checked,
    json_schema,
    read_keys,
    read_scene,
    read_spec,
    scene_of,
)
from dpgcli.files.scene_file.problems import unknown_key
from dpgcli.files.yaml_file import parse_document

SPEC = """\
finger:
  units: 5
  calibration: published
  geometry: {dome_height_mm: 6.5, dome_thickness_mm: 0.75, unit_cell_mm: 22, chamber_length_mm: 9,
    channel_width_mm: 10, limiting_layer_thickness_mm: 1.5, unit_separation_mm: 3,
    elastic_modulus_MPa: 26}
  overrides: {4-5: {geometry: {dome_height_mm: 7.5}}}
"""
LATTICE = """\
finger:
  units: 2
  lattice: {segment_length_mm: 13.5, segment_height_mm: 10.75, stroke_mm: 3.5,
    force_linearity: 0.043, bistable_stiffness_N_per_mm: 12.84, hinge_stiffness_N_mm_per_rad: 24.2}
"""
LINES = "lines: {A: 1-3, B: 4-5}"


def read(pressure: str, finger: str = SPEC) -> Any:
    return checked(parse_document("x.yaml", f"{finger}pressure: {{{pressure}}}\n"))


def pressure_of(pressure: str, finger: str = SPEC) -> Any:
    return scene_of(read(pressure, finger)).pressure


def problems(pressure: str, finger: str = SPEC) -> list[str]:
    with pytest.raises(SpecError) as caught:
        read(pressure, finger)
    return [str(problem).partition("pressure.")[2] for problem in caught.value.problems]


def sources(spec: Any) -> list[tuple[str, str, float, Origin]]:
    found = scene_of(spec).sources
    keys = ("effective_area_mm2", "snap_pressure_MPa")
    return [(s.key, s.units, round(s.value, 6), s.origin) for s in found if s.key in keys]


def test_without_pressure_there_is_none() -> None:
    spec = checked(parse_document("x.yaml", SPEC))
    assert (scene_of(spec).pressure, sources(spec)) == (None, [])
    assert "pressure" not in canonical_json(spec)


def test_one_line_has_all_units() -> None:
    found = pressure_of("")
    assert found.lines == ("A",)
    assert found.line_of.tolist() == [0] * 5
    assert (found.effective_area, found.shape, found.history) == (None, None, None)


@pytest.mark.parametrize(
    "lines", ["{A: 1-3, B: 4-5}", "{A: '1-2,3', B: [4, 5]}", "{A: [1-2, 3], B: '5, 4'}"]
)
def test_units_of_lines(lines: str) -> None:
    found = pressure_of(f"lines: {lines}")
    assert found.lines == ("A", "B")
    assert found.line_of.tolist() == [0, 0, 0, 1, 1]
    assert found.units_by_line == {"A": [1, 2, 3], "B": [4, 5]}


def test_a_line_of_one_unit() -> None:
    assert pressure_of("lines: {A: 1, left: 2-5}").line_of.tolist() == [0, 1, 1, 1, 1]


def test_an_area_is_given() -> None:
    spec = read("effective_area_mm2: 31.6")
    assert sources(spec) == [("effective_area_mm2", "1-5", 31.6, Origin.GIVEN)]
    found = scene_of(spec).pressure
    assert found.effective_area.tolist() == [[31.6]]
    assert found.snap_pressure is None


def test_a_snap_pressure_is_given_to_all_and_to_some() -> None:
    given = "snap_pressure_MPa: 0.15, overrides: {2-4: {snap_pressure_MPa: 0.18}}"
    assert sources(read(given)) == [
        ("snap_pressure_MPa", "1,5", 0.15, Origin.GIVEN),
        ("snap_pressure_MPa", "2-4", 0.18, Origin.GIVEN),
    ]
    found = pressure_of(given).snap_pressure
    assert found.ravel().tolist() == [0.15, 0.18, 0.18, 0.18, 0.15]


def test_a_snap_pressure_is_given_to_some_and_assumed_of_the_others() -> None:
    assert sources(read("overrides: {'5': {snap_pressure_MPa: 0.2}}")) == [
        ("snap_pressure_MPa", "1-3", 0.1495, Origin.ASSUMED),
        ("snap_pressure_MPa", "4", 0.177508, Origin.ASSUMED),
        ("snap_pressure_MPa", "5", 0.2, Origin.GIVEN),
    ]


def test_an_override_that_says_nothing_changes_nothing() -> None:
    given = "snap_pressure_MPa: 0.15, overrides: {2: {}, 3: null}"
    assert pressure_of(given).snap_pressure.tolist() == [[0.15]]


def test_areas_may_differ() -> None:
    given = "effective_area_mm2: 30, overrides: {1: {effective_area_mm2: 40}}"
    assert pressure_of(given).effective_area.ravel().tolist() == [40.0, 30.0, 30.0, 30.0, 30.0]


def test_it_is_assumed_by_geometry_or_that_of_the_study() -> None:
    by_geometry = 0.1495 * (7.5 / 6.5) ** 1.2
    assert pressure_of("").snap_pressure.ravel() == pytest.approx([0.1495] * 3 + [by_geometry] * 2)
    spec = read("", LATTICE)
    assert sources(spec) == [("snap_pressure_MPa", "1-2", 0.1495, Origin.ASSUMED)]


def test_what_is_assumed_beyond_the_grid_says_so() -> None:
    finger = SPEC.replace("dome_height_mm: 7.5", "dome_height_mm: 9")
    rules = [s.rule for s in scene_of(read("", finger)).sources if s.key == "snap_pressure_MPa"]
    assert ["beyond its range" in rule for rule in rules] == [False, True]


def test_histories() -> None:
    lists = pressure_of(f"{LINES}, history: {{A: 0:0.15:0, B: [0, -1.0e-1, 0]}}").history
    assert lists.pressure.tolist() == [[0.0, 0.0], [0.15, -0.1], [0.0, 0.0]]
    assert lists.time is None
    timed = pressure_of(f"{LINES}, history: {{time_s: [0, 2, 2], A: 0:0:0, B: 0:.1:+0}}").history
    assert timed.pressure.tolist() == [[0.0, 0.0], [0.0, 0.1], [0.0, 0.0]]
    assert timed.time.tolist() == [0.0, 2.0, 2.0]


def test_what_says_the_same_is_the_same() -> None:
    one = read("lines: {A: 1-3, B: '4, 5'}, history: {A: 0:0.1, B: 0:0}")
    other = read("lines: {A: ' 1 - 3', B: [4, 5]}, history: {A: [0, 0.1], B: [0, 0.0]}")
    assert canonical_json(one) == canonical_json(other)
    again = checked(parse_document("x.yaml", canonical_json(one)))
    assert again == one


@pytest.mark.parametrize(
    ("pressure", "said"),
    [
        ("lines: {A: 1-3, B: 3-5}", "lines.B: expected units on no other line, found unit 3"),
        ("lines: {A: 1-3}", "lines: expected every unit on a line, found none for unit 4"),
        ("lines: {A: 1-6}", "lines.A: expected units within 1-5, found 6"),
        ("lines: {A: 0-5}", "lines.A: expected units within 1-5, found 0"),
        ("lines: {A: 5-1}", 'lines.A: expected units such as 1-3, 4 or 1,3, found "5-1"'),
        ("lines: {A: 1-9999}", 'lines.A: expected units such as 1-3, 4 or 1,3, found "1-9999"'),
        ("lines: {A: true}", "lines.A: expected units such as"),
        ("lines: {A: 1.5}", "lines.A: expected units such as"),
        ("lines: {A: []}", "lines.A: expected units such as"),
        ("lines: {A: }", "lines.A: expected units such as"),
        ("lines: {A: 1-3, 1: 4-5}", "lines.1: expected a name such as A or left"),
        ("lines: {a=b: 1-5}", "lines.a=b: expected a name such as A or left"),
        ("lines: {time_s: 1-5}", "lines.time_s: expected a name such as A or left"),
        ("lines: 1-5", "lines: expected units by line, such as"),
        ("effective_area_mm2: 0", "effective_area_mm2: expected an area > 0 in mm2, found 0"),
        ("effective_area_mm2: -3", "effective_area_mm2: expected an area > 0 in mm2, found -3"),
        ("effective_area_mm2: .nan", "effective_area_mm2: expected an area > 0 in mm2, found .nan"),
        ("snap_pressure_MPa: .inf", "snap_pressure_MPa: expected a pressure > 0 in MPa"),
        ("snap_pressure_MPa: 1 bar", "snap_pressure_MPa: expected a pressure > 0 in MPa"),
        (
            "effective_area_mm2: 30, snap_pressure_MPa: 0.1",
            "snap_pressure_MPa: expected effective_area_mm2 or snap_pressure_MPa, not both",
        ),
        (
            "effective_area_mm2: 30, overrides: {2: {snap_pressure_MPa: 0.1}}",
            "overrides.2.snap_pressure_MPa: expected effective_area_mm2 or snap_pressure_MPa, not",
        ),
        (
            "overrides: {2-5: {effective_area_mm2: 30}}",
            "effective_area_mm2: expected an area of every unit, found none of unit 1",
        ),
        ("overrides: {6: {snap_pressure_MPa: 3}}", "overrides.6: expected units within 1-5"),
        ("overrides: {2-3: {}, 3: {}}", "overrides.3: expected each unit in one override"),
        ("overrides: {2: {lines: 3}}", "overrides.2.lines: expected a known key, found lines"),
        ("effective_area: 3", "effective_area: expected a known key, found effective_area (did"),
        ("history: {A: 0::0}", "history.A: expected pressures in MPa such as 0:0.15:0, or a list"),
        ("history: {A: 0:nan}", "history.A: expected pressures in MPa such as 0:0.15:0"),
        ("history: {A: [0]}", "history.A: expected pressures in MPa such as 0:0.15:0"),
        ("history: {A: 0.15}", "history.A: expected pressures in MPa such as 0:0.15:0"),
        ("history: {A: [0, .nan]}", "history.A.1: expected a pressure in MPa, found .nan"),
        ("history: {A: [0, .inf]}", "history.A.1: expected a pressure in MPa, found .inf"),
        ("history: {A: [0, null, 0]}", "history.A.1: expected a pressure in MPa, found nothing"),
        ("history: {A: [0, x]}", 'history.A.1: expected a pressure in MPa, found "x"'),
        (
            "history: {A: [0, -1.1e+16]}",
            "history.A.1: expected a pressure in MPa, found -1.1e+16 (at most 1e+12 in size)",
        ),
        (
            "history: {A: 0:2e12}",
            "history.A.1: expected a pressure in MPa, found 2000000000000.0 (at",
        ),
        (
            "history: {time_s: [0, 1e13], A: 0:1}",
            "history.time_s.1: expected a time in s, found 10000000000000.0 (at most 1e+12 in",
        ),
        ("history: {C: 0:1}", "history.C: expected a line: A, found C"),
        (
            "history: {time_s: [0, 1]}",
            "history: expected pressures for each line: A, found none for A",
        ),
        (
            "lines: {A: 1-3, B: 4-5}, history: {A: 0:0.1:0}",
            "history: expected pressures for each line: A, B, found none for B (B: 0:0:0 keeps",
        ),
        (
            "history: {time_s: [0, 2, 1], A: 0:1:0}",
            "history.time_s.2: expected a time from 2 s on, found 1",
        ),
        (
            "history: {time_s: [0, .nan], A: 0:1}",
            "history.time_s.1: expected a time in s, found .nan",
        ),
        (
            "history: {time_s: 3, A: 0:1}",
            "history.time_s: expected times in s, a list of 2 or more",
        ),
        ("history: 3", "history: expected pressures by line, such as {A: 0:0.15:0}, or the name"),
        (
            f"{LINES}, history: {{A: 0:1:0, B: 0:1}}",
            "history.B: expected 3 numbers, as A, found 2",
        ),
    ],
)
def test_each_mistake_alone(pressure: str, said: str) -> None:
    (found,) = problems(pressure)
    assert found.startswith(said)


def test_all_mistakes_at_once() -> None:
    wrong = "lines: {A: 1-3, B: 3-5}, effective_area_mm2: 0, history: {A: [0, .nan], C: 0:1}"
    found = problems(wrong)
    assert [text.partition(":")[0] for text in found] == [
        "lines.B",
        "effective_area_mm2",
        "history.A.1",
    ]
    found = problems("lines: {A: 1-3, B: 3-5}, effective_area_mm2: 0, history: {A: 0:1, C: 0:1}")
    assert [text.partition(":")[0] for text in found] == [
        "lines.B",
        "effective_area_mm2",
        "history.C",
    ]


def test_a_mistake_has_its_place(tmp_path: Path) -> None:
    path = tmp_path / "x.yaml"
    path.write_text(SPEC + "pressure:\n  lines:\n    A: 1-3\n    B: 3-5\n", encoding="utf-8")
    with pytest.raises(SpecError) as caught:
        read_spec(path)
    (problem,) = caught.value.problems
    assert (problem.line, problem.column) == (11, 5)


def test_settings(tmp_path: Path) -> None:
    path = tmp_path / "x.yaml"
    path.write_text(SPEC, encoding="utf-8")
    spec = read_spec(path, ["pressure.lines.A=1-5", "pressure.effective_area_mm2=30"])
    assert scene_of(spec).pressure.effective_area.tolist() == [[30.0]]
    spec = read_spec(path, ["pressure.overrides.4-5.snap_pressure_MPa=0.2"])
    assert scene_of(spec).pressure.snap_pressure[-1, 0] == 0.2


@pytest.mark.parametrize(
    ("key", "is_number"),
    [
        ("pressure.effective_area_mm2", True),
        ("pressure.snap_pressure_MPa", True),
        ("pressure.overrides.4-5.snap_pressure_MPa", True),
        ("pressure.overrides.0.snap_pressure_MPa", False),
        ("pressure.overrides.4-5", False),
        ("pressure.lines", False),
        ("pressure.lines.A", False),
        ("pressure.history", False),
        ("pressure", False),
        ("pressure.snap_MPa", False),
    ],
)
def test_keys_that_sweeps_may_vary(key: str, is_number: bool) -> None:
    assert (unknown_key(tuple(key.split("."))) is None) is is_number


def test_the_schema_has_every_way_of_saying_it() -> None:
    schema = json.dumps(json_schema())
    for key in ("lines", "effective_area_mm2", "snap_pressure_MPa", "history"):
        assert f'"{key}"' in schema
    history = json_schema()["$defs"]["PressureSpec"]["properties"]["history"]
    assert {"type": "string"} in history["anyOf"]


CSV = "time_s,A (kPa),B_MPa\n0,0,0\n1.5,150,-0.1\n3,0,0\n"


def spec_beside(folder: Path, csv: str, lines: str = LINES) -> Path:
    (folder / "ramp.csv").write_text(csv, encoding="utf-8")
    path = folder / "x.yaml"
    text = f"{SPEC}pressure: {{{lines}, history: ramp.csv}}\n"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_history_from_a_file_beside_the_spec(tmp_path: Path) -> None:
    path = spec_beside(tmp_path, CSV)
    found = scene_of(read_spec(path)).pressure.history
    assert found.pressure == pytest.approx(np.array([[0.0, 0.0], [0.15, -0.1], [0.0, 0.0]]))
    assert found.time.tolist() == [0.0, 1.5, 3.0]
    assert read_scene(path).files == (tmp_path / "ramp.csv",)
    again = checked(parse_document("x.yaml", canonical_json(read_spec(path))))
    assert scene_of(again).pressure.history.pressure.tolist() == found.pressure.tolist()


def test_a_file_beside_a_calibration_is_counted_too(tmp_path: Path) -> None:
    path = spec_beside(tmp_path, CSV)
    other = read_scene(path, ["finger.calibration=configs/calibration/push_3.5mm.yaml"]).files
    assert [file.name for file in other] == ["push_3.5mm.yaml", "ramp.csv"]


def test_who_needs_no_pressure_needs_no_file(tmp_path: Path) -> None:
    path = tmp_path / "x.yaml"
    path.write_text(f"{SPEC}pressure: {{history: none.csv}}\n", encoding="utf-8")
    assert read_keys(path).finger.units == 5


@pytest.mark.parametrize(
    ("csv", "said"),
    [
        ("time_s,A\n0,0\n1,\n", ['ramp.csv:3: A: expected a number, found ""']),
        ("time_s,A\n0,0\n1,nan\n", ["ramp.csv:3: A: expected a number, found something else"]),
        (
            "time_s,A\n0,0\n2,1\n1,0\n0,1\n",
            [
                "ramp.csv:4: time_s: expected a time from 2 s on, found something else",
                "ramp.csv:5: time_s: expected a time from 1 s on, found something else",
            ],
        ),
        (
            "time_s,A,C\n0,0,1\n1,0,1\n",
            ["ramp.csv: header: expected a line: A, B; or time_s, found something else"],
        ),
        (
            "secret,word\n0,0\n1,0\n",
            ["ramp.csv: header: expected a column for a line: A, B, found"],
        ),
        (
            "A,A_MPa\n0,0\n1,0\n",
            ["ramp.csv: header: expected each line once, found something else"],
        ),
        ("A\n0\n", ["ramp.csv: file: expected 2 rows or more, found 1"]),
        ("A (kN)\n0\n1\n", ["ramp.csv: header: expected a unit of pressure"]),
        ("A_MPa (kPa)\n0\n1\n", ["ramp.csv: header: expected MPa, as the name has it"]),
    ],
)
def test_mistakes_in_a_file(tmp_path: Path, csv: str, said: list[str]) -> None:
    with pytest.raises(SpecError) as caught:
        read_spec(spec_beside(tmp_path, csv))
    found = [str(problem).removeprefix(f"{tmp_path}/") for problem in caught.value.problems]
    assert len(found) == len(said)
    assert all(text.startswith(start) for text, start in zip(found, said, strict=True))


def test_no_file(tmp_path: Path) -> None:
    path = spec_beside(tmp_path, CSV)
    (tmp_path / "ramp.csv").unlink()
    with pytest.raises(SpecError, match="expected a readable file, found no such file"):
        read_spec(path)


def test_more_than_a_spec_holds(tmp_path: Path) -> None:
    rows = "".join(f"{row},0\n" for row in range(4501))
    with pytest.raises(SpecError, match=r"history: expected at most 9,000 numbers.*9,002 in ramp"):
        read_spec(spec_beside(tmp_path, f"time_s,A\n{rows}"))


def test_a_table_of_pressures() -> None:
    found = read_history({"time": [0, 1], "A": [0, 0.15], "left (bar)": [0, 1]}, ["A", "left"])
    assert {key: values.tolist() for key, values in found.items()} == {
        "time_s": [0.0, 1.0],
        "A": [0.0, 0.15],
        "left": [0.0, 0.1],
    }


@pytest.mark.parametrize(
    "csv",
    [
        "User name,B,A\nme,hunter2,hunter3\n",
        "A,hunter2,hunter2\n0,1,1\n1,0,0\n",
        "A\thunter2\n0\thunter3\n",
        "A,A (hunter2)\n0,hunter3\n1,1\n",
        "A\n'hunter2\n\"hunter3\n",
        "time_s,A\nhunter2,0\n1,1\n",
    ],
)
def test_nothing_of_a_file_that_a_spec_names_is_shown(tmp_path: Path, csv: str) -> None:
    """Who writes a spec chooses the file, and what its columns may be called."""
    with pytest.raises(SpecError) as caught:
        read_spec(spec_beside(tmp_path, csv))
    assert "hunter" not in str(caught.value)
