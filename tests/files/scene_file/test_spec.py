"""Specs: what they mean, and that every mistake is reported at its place."""

import json
import math
import pickle
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dpgcli.design.resolve import resolve
from dpgcli.design.scene import Gripper, Origin, Source
from dpgcli.errors import SpecError
from dpgcli.files.scene_file import (
    canonical_json,
    json_schema,
    models,
    read_spec,
    scene_of,
    starter,
)
from dpgcli.files.scene_file.models import Spec
from dpgcli.files.scene_file.problems import SECTIONS, checked
from dpgcli.files.yaml_file import Document

CONFIGS = Path(__file__).parents[3] / "configs"
GRADED = CONFIGS / "graded_five_unit.yaml"

FINGER = """\
finger:
  units: 5
  linear_stiffness_N_per_mm: 1.0e4
  calibration: published
  geometry:
    dome_height_mm: 6.5
    dome_thickness_mm: 0.75
    unit_cell_mm: 22
    chamber_length_mm: 9
    channel_width_mm: 10
    limiting_layer_thickness_mm: 1.5
    unit_separation_mm: 3
    elastic_modulus_MPa: 26
"""

LATTICE = """\
finger:
  units: 4
  linear_stiffness_N_per_mm: .inf
  lattice:
    segment_length_mm: 13.5
    segment_height_mm: 10.75
    stroke_mm: 3.5
    bistable_stiffness_N_per_mm: 12.84
    force_linearity: 0.043
    hinge_stiffness_N_mm_per_rad: 24.2
"""


@pytest.fixture
def read(tmp_path, monkeypatch):
    """Reads a spec from its text, in a file that messages call x.yaml."""
    monkeypatch.chdir(tmp_path)

    def from_text(text, *changes):
        Path("x.yaml").write_text(text, encoding="utf-8")
        return read_spec("x.yaml", changes)

    return from_text


@pytest.fixture
def problems(read):
    """The problems of a spec given by its text."""

    def from_text(text, *changes):
        with pytest.raises(SpecError) as caught:
            read(text, *changes)
        return caught.value.problems

    return from_text


def places(found):
    return [(p.file, p.line, p.column, p.key) for p in found]


def source_of(scene, key):
    return [(s.units, s.value, s.origin) for s in scene.sources if s.key == key]


def test_the_study_s_finger_has_the_published_lattice_exactly():
    finger = scene_of(read_spec(CONFIGS / "three_unit.yaml")).finger
    assert finger.n_units == 3 and finger.is_uniform
    values = {name: array.tolist() for name, array in finger.arrays().items()}
    assert values == {
        "segment_length": [[13.5]],
        "segment_height": [[10.75]],
        "stroke": [[3.5]],
        "bistable_stiffness": [[12.84]],
        "force_linearity": [[0.043]],
        "hinge_stiffness": [[24.2]],
        "linear_stiffness": [[1e4]],
        "dome_travel": [[0.0]],
        "wall_compliance": [[0.0]],
        "hinge_coupling": [[0.0]],
    }


def test_a_graded_finger_scales_the_spring_of_its_higher_domes():
    scene = scene_of(read_spec(GRADED))
    assert scene.finger.stroke.tolist() == [[3.5], [3.5], [3.5], [4.5], [4.5]]
    scaled = 12.84 * (7.5 / 6.5) ** -0.25
    expected = np.array([[12.84], [12.84], [12.84], [scaled], [scaled]])
    np.testing.assert_allclose(scene.finger.bistable_stiffness, expected, rtol=1e-15)
    assert scene.finger.force_linearity.shape == (1, 1)
    assert source_of(scene, "bistable_stiffness_N_per_mm") == [
        ("1-3", 12.84, Origin.CALIBRATED),
        ("4-5", pytest.approx(scaled), Origin.SCALED),
    ]
    assert source_of(scene, "force_linearity") == [
        ("1-3", 0.043, Origin.CALIBRATED),
        ("4-5", 0.043, Origin.SCALED),
    ]
    assert source_of(scene, "hinge_stiffness_N_mm_per_rad") == [("1-5", 24.2, Origin.CALIBRATED)]
    assert scene.layer_thickness == 1.5 and scene.gripper is None


def test_sources_name_the_rule_and_join_units_that_are_apart(read):
    overrides = "  overrides:\n    3: {geometry: {dome_height_mm: 8}}\n"
    scene = scene_of(read(FINGER + overrides))
    assert source_of(scene, "stroke_mm") == [
        ("1-2,4-5", 3.5, Origin.DERIVED),
        ("3", 5.0, Origin.DERIVED),
    ]
    assert source_of(scene, "bistable_stiffness_N_per_mm")[1][2] is Origin.EXTRAPOLATED
    rule = "dome height - unit separation (published rule)"
    assert Source("stroke_mm", "3", 5.0, Origin.DERIVED, rule) in scene.sources
    assert scene.finger.stroke[:, 0].tolist() == [3.5, 3.5, 5.0, 3.5, 3.5]


def test_a_lattice_is_enough(read):
    scene = scene_of(read(LATTICE))
    assert scene.finger.is_rigid and scene.layer_thickness is None
    assert {source.origin for source in scene.sources} == {Origin.GIVEN}
    assert len(scene.sources) == 7


def test_given_values_win_over_the_calibration(read):
    scene = scene_of(read(FINGER, "finger.lattice.bistable_stiffness_N_per_mm=13"))
    assert source_of(scene, "bistable_stiffness_N_per_mm") == [("1-5", 13.0, Origin.GIVEN)]
    assert source_of(scene, "force_linearity") == [("1-5", 0.043, Origin.CALIBRATED)]


def test_the_gripper():
    scene = scene_of(read_spec(CONFIGS / "gripper.yaml", ["gripper.mounting_angle_deg=-90"]))
    assert scene.gripper == Gripper(60.0, -math.pi / 2)


@pytest.mark.parametrize("path", sorted(CONFIGS.glob("*.yaml")), ids=lambda path: path.stem)
def test_every_example_is_a_scene(path):
    units = {"three": 3, "five": 5, "graded": 5, "gripper": 5, "eight": 8, "twenty": 20}
    scene = scene_of(read_spec(path))
    assert scene.finger.n_units == units[path.stem.split("_")[0]]
    assert (scene.gripper is not None) == path.stem.startswith("gripper")


def test_reading_a_spec_resolves_it_once(monkeypatch):
    calls = []
    monkeypatch.setattr(models, "resolve", lambda design: calls.append(1) or resolve(design))
    spec = read_spec(CONFIGS / "graded_five_unit.yaml")
    assert scene_of(spec).finger.n_units == scene_of(spec).finger.n_units == 5
    assert calls == [1]


def test_a_resolved_spec_can_be_sent_and_compared():
    paths = (CONFIGS / "graded_five_unit.yaml", CONFIGS / "calibration" / "three_gap_finger.yaml")
    for path in paths:
        spec, again = read_spec(path), read_spec(path)
        sent = pickle.loads(pickle.dumps(spec))
        assert scene_of(sent).sources == scene_of(spec).sources
        assert sent == spec == again


def test_the_starter_means_the_three_unit_finger_and_names_every_key(read):
    assert read(starter()) == read_spec(CONFIGS / "three_unit.yaml")
    for section in SECTIONS.values():
        for key in section.model_fields:
            assert f"{key}:" in starter()


def test_the_starter_s_optional_lines_are_valid(read):
    lines = [line for line in starter().splitlines() if ":" in line]
    keys = {key for section in SECTIONS.values() for key in section.model_fields} | {"2-3"}
    text = [line.replace("# ", "", 1) for line in lines if line.strip("# ").split(":")[0] in keys]
    spec = read("\n".join(text).replace("dome_height_mm: 7.5", "channel_width_mm: 10"))
    assert spec.gripper is not None and spec.finger.lattice is not None
    assert list(spec.finger.overrides) == ["2-3"]


def test_wrong_values_are_all_reported_by_line(problems):
    text = FINGER.replace("5\n", "5.0\n", 1).replace("1.0e4", ".nan").replace("0.75", '"0.75"')
    text = text.replace(": 9", ": true").replace(": 26", ": -26").replace("unit_cell", "unit_sell")
    assert [str(problem) for problem in problems(text)] == [
        "x.yaml:2:3: finger.units: expected a whole number from 1 to 64, found 5.0 "
        "(a whole number without quotes or decimal point)",
        "x.yaml:3:3: finger.linear_stiffness_N_per_mm: expected a stiffness > 0 in N/mm, or .inf, "
        "found .nan (1.0e+4 is assumed where it is left out; .inf is rigid)",
        'x.yaml:7:5: finger.geometry.dome_thickness_mm: expected a length > 0 in mm, found "0.75" '
        "(a plain number such as 6.5 or 1.0e+4: no quotes, no unit)",
        "x.yaml:8:5: finger.geometry.unit_sell_mm: expected a known key, found unit_sell_mm "
        "(did you mean unit_cell_mm?)",
        "x.yaml:9:5: finger.geometry.chamber_length_mm: expected a length > 0 in mm, found true",
        "x.yaml:13:5: finger.geometry.elastic_modulus_MPa: expected a modulus > 0 in MPa, "
        "found -26",
    ]


def test_a_negative_stroke_says_what_stroke_is(problems):
    (problem,) = problems(LATTICE.replace("3.5\n    bi", "-3.5\n    bi"))
    assert str(problem) == (
        "x.yaml:7:5: finger.lattice.stroke_mm: expected a length > 0 in mm, found -3.5 "
        "(stroke is dome height minus unit separation)"
    )


def test_problems_of_form_and_of_content_come_together(problems):
    text = FINGER + "  units: 3\n  overrides:\n    4-6: {}\n    x: !!set {a}\ngrip: 3\n"
    assert places(problems(text, "finger.calibration=mine")) == [
        ("x.yaml", 14, 3, "finger.units"),
        ("x.yaml", 16, 5, "finger.overrides.4-6"),
        ("x.yaml", 17, 5, "finger.overrides.x"),
        ("x.yaml", 17, 5, "finger.overrides.x"),
        ("x.yaml", 18, 1, "grip"),
        ("settings", None, None, "finger.calibration"),
    ]


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("finger.geometry.dome_height_mm", "0"),
        ("finger.geometry.dome_height_mm", "1e-13"),
        ("finger.geometry.dome_height_mm", "1e13"),
        ("finger.geometry.dome_height_mm", ".inf"),
        ("finger.geometry.dome_height_mm", "[1]"),
        ("finger.lattice.force_linearity", "1.01"),
        ("finger.lattice.hinge_stiffness_N_mm_per_rad", "-1"),
        ("finger.linear_stiffness_N_per_mm", "1.1e18"),
        ("finger.linear_stiffness_N_per_mm", "-.inf"),
        ("finger.units", "0"),
        ("finger.units", "0x" + "f" * 5000),
        ("finger.units", "65"),
        ("finger.units", "true"),
        ("gripper", "{base_spacing_mm: 0}"),
        ("gripper", "{base_spacing_mm: 1, mounting_angle_deg: 91}"),
        ("finger.geometry", "3"),
        ("finger.overrides", "[1]"),
        ("gripper", "{}"),
    ],
)
def test_values_out_of_range_are_refused(problems, key, value):
    (problem,) = problems(FINGER, f"{key}={value}")
    assert (problem.file, problem.line) == ("settings", None)
    assert problem.key.startswith(key)


@pytest.mark.parametrize(
    "change",
    [
        "finger.lattice.force_linearity=0",
        "finger.lattice.force_linearity=1",
        "finger.lattice.hinge_stiffness_N_mm_per_rad=0",
        "finger.linear_stiffness_N_per_mm=1e18",
        "finger.linear_stiffness_N_per_mm=.inf",
        "finger.units=64",
        "finger.geometry.chamber_width_mm=20.00001",
        "finger.lattice.stroke_mm=3.5000001",
        "finger.lattice=null",
    ],
)
def test_limits_are_allowed(read, change):
    scene_of(read(FINGER, change))


def test_settings_change_the_file_and_the_last_one_wins(read):
    changes = ["finger.units=7", "finger.overrides.2.geometry.dome_height_mm=7", "finger.units=6"]
    spec = read(FINGER, *changes)
    assert spec.finger.units == 6
    assert scene_of(spec).finger.stroke[:, 0].tolist() == [3.5, 4.0, 3.5, 3.5, 3.5, 3.5]


def test_settings_reach_overrides_written_as_numbers(read):
    text = FINGER + "  overrides:\n    4: {geometry: {dome_height_mm: 7}}\n"
    spec = read(text, "finger.overrides.4.geometry.dome_height_mm=7.25")
    assert scene_of(spec).finger.stroke[3, 0] == 4.25


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("units", 'settings: setting: expected key.path=value, found "units"'),
        ("=3", 'settings: setting: expected key.path=value, found "=3"'),
        ("finger..units=3", 'settings: setting: expected key.path=value, found "finger..units=3"'),
        (
            "finger.units.a=3",
            "settings: finger.units.a: expected a key of a section, found 5 at finger.units",
        ),
        (
            "finger.unit=3",
            "settings: finger.unit: expected a known key, found unit (did you mean units?)",
        ),
        (
            "stroke_mm=3",
            "settings: stroke_mm: expected a known key, found stroke_mm "
            "(did you mean finger.lattice.stroke_mm?)",
        ),
        (
            "zzz=3",
            "settings: zzz: expected a known key, found zzz "
            "(known here: finger, gripper, pressure, loads, object, uncertainty, model_error, "
            "data)",
        ),
    ],
)
def test_wrong_settings(problems, change, message):
    assert [str(problem) for problem in problems(FINGER, change)] == [message]


def test_a_setting_that_is_no_yaml_is_named(problems):
    (problem,) = problems(FINGER, "finger.units=[1")
    assert (problem.file, problem.key, problem.expected) == (
        "settings",
        "finger.units",
        "valid YAML",
    )


def test_geometry_and_lattice_must_agree(problems):
    text = FINGER + "    chamber_width_mm: 21\n  lattice:\n    stroke_mm: 3.6\n"
    text += "    segment_length_mm: 13\n    segment_height_mm: 11\n"
    found = problems(text)
    assert [str(problem) for problem in found] == [
        "x.yaml:14:5: finger.geometry.chamber_width_mm: expected 20 as unit_cell_mm has it, "
        "found 21 (chamber width = unit cell - 2 mm (two walls of 1 mm))",
        "x.yaml:16:5: finger.lattice.stroke_mm: expected 3.5 as the geometry has it, "
        "found stroke_mm = 3.6 (dome height - unit separation (published rule))",
        "x.yaml:17:5: finger.lattice.segment_length_mm: expected 13.5 as the geometry has it, "
        "found segment_length_mm = 13 "
        "(chamber length + 2 dome thickness + unit separation (inferred rule))",
        "x.yaml:18:5: finger.lattice.segment_height_mm: expected 11.25 as the geometry has it, "
        "found segment_height_mm = 11 "
        "(chamber width / 2 + limiting layer thickness / 2 (inferred rule))",
    ]


def test_an_override_that_changes_the_dome_contradicts_a_given_stroke(problems):
    text = (
        FINGER
        + "  lattice: {stroke_mm: 3.5}\n  overrides:\n    2: {geometry: {dome_height_mm: 7}}\n"
    )
    (problem,) = problems(text)
    assert places([problem]) == [("x.yaml", 16, 20, "finger.overrides.2.geometry.dome_height_mm")]
    assert (problem.expected, problem.found) == ("4 as the geometry has it", "stroke_mm = 3.5")


def test_a_dome_lower_than_the_gap_is_refused_with_the_reason(problems):
    (problem,) = problems(FINGER.replace("6.5", "3"))
    assert places([problem]) == [("x.yaml", 6, 5, "finger.geometry.dome_height_mm")]
    assert (problem.found, problem.hint) == ("stroke_mm = 0", "the dome never reaches its neighbor")


def test_a_unit_cell_that_is_all_wall_is_refused(problems):
    (problem,) = problems(FINGER.replace("22", "2"))
    assert problem.expected == "a length > 2 mm" and problem.line == 8


def test_missing_values_are_named_once(problems):
    text = FINGER.replace("    dome_thickness_mm: 0.75\n", "").replace("    unit_cell_mm: 22\n", "")
    text += "  overrides: {4-5: {geometry: {dome_height_mm: 7}}}\n"
    found = {problem.key: problem.found for problem in problems(text)}
    assert found == {
        "finger.lattice.segment_length_mm": "no dome_thickness_mm",
        "finger.lattice.segment_height_mm": "no chamber_width_mm or unit_cell_mm",
        "finger.lattice.bistable_stiffness_N_per_mm": "no dome_thickness_mm",
        "finger.lattice.force_linearity": "no dome_thickness_mm",
    }
    assert len(problems(text)) == 4


def test_springs_without_a_calibration_are_asked_for(problems):
    found = problems(FINGER.replace("  calibration: published\n", ""))
    assert places(found) == [
        ("x.yaml", 1, 1, "finger.lattice.bistable_stiffness_N_per_mm"),
        ("x.yaml", 1, 1, "finger.lattice.force_linearity"),
        ("x.yaml", 1, 1, "finger.lattice.hinge_stiffness_N_mm_per_rad"),
    ]
    assert "set calibration: published with dome_height_mm" in found[0].hint


@pytest.mark.parametrize(
    ("given", "changed", "refused"),
    [
        ("bistable_stiffness_N_per_mm", "{dome_height_mm: 7}", True),
        ("bistable_stiffness_N_per_mm", "{elastic_modulus_MPa: 30}", True),
        ("bistable_stiffness_N_per_mm", "{channel_width_mm: 11}", False),
        ("bistable_stiffness_N_per_mm", "{dome_height_mm: 6.5}", False),
        ("hinge_stiffness_N_mm_per_rad", "{unit_separation_mm: 2}", True),
        ("hinge_stiffness_N_mm_per_rad", "{channel_width_mm: 11}", True),
        ("hinge_stiffness_N_mm_per_rad", "{dome_height_mm: 7}", False),
        ("force_linearity", "{dome_height_mm: 7}", False),
    ],
)
def test_a_calibrated_value_never_moves_to_another_geometry(read, given, changed, refused):
    text = FINGER + f"  lattice: {{{given}: 0.5}}\n  overrides:\n    2: {{geometry: {changed}}}\n"
    if not refused:
        scene_of(read(text))
        return
    with pytest.raises(SpecError) as caught:
        read(text)
    assert places(caught.value.problems) == [
        ("x.yaml", 16, 5, f"finger.overrides.2.lattice.{given}")
    ]


def test_a_value_of_its_own_mends_that(read):
    text = FINGER + "  lattice: {bistable_stiffness_N_per_mm: 12}\n  overrides:\n"
    text += "    2: {geometry: {dome_height_mm: 7}, lattice: {bistable_stiffness_N_per_mm: 11}}\n"
    stiffness = scene_of(read(text)).finger.bistable_stiffness
    assert stiffness[:, 0].tolist() == [12, 11, 12, 12, 12]


def test_a_given_stroke_never_moves_to_another_dome(problems):
    text = LATTICE + "  overrides:\n    2: {geometry: {dome_height_mm: 7}}\n"
    assert [problem.key for problem in problems(text)] == [
        "finger.overrides.2.lattice.stroke_mm",
        "finger.overrides.2.lattice.bistable_stiffness_N_per_mm",
    ]


def test_overrides_keep_to_the_finger_and_do_not_overlap(problems):
    text = FINGER + "  overrides: {0: {}, 2-3: {}, 3: {}, 5-4: {}, 5-6: {}, a: {}, 4 - 5: }\n"
    assert [(p.key, p.found) for p in problems(text)] == [
        ("finger.overrides.0", "0"),
        ("finger.overrides.3", "units also in 2-3"),
        ("finger.overrides.5-4", "5-4"),
        ("finger.overrides.5-6", "5-6"),
        ("finger.overrides.a", "a"),
    ]


@pytest.mark.parametrize(
    "change",
    [
        "geometry.unit_cell_mm",
        "geometry.chamber_width_mm",
        "geometry.limiting_layer_thickness_mm",
        "lattice.segment_height_mm",
    ],
)
def test_overrides_cannot_change_the_segment_height(problems, change):
    (problem,) = problems(FINGER, f"finger.overrides.2.{change}=3")
    assert "shared by neighboring units" in problem.hint


def test_a_finger_whose_units_are_all_overridden(read):
    text = FINGER.replace("    dome_height_mm: 6.5\n", "")
    text += "  overrides: {1-5: {geometry: {dome_height_mm: 6.5}}}\n"
    scene = scene_of(read(text))
    assert source_of(scene, "stroke_mm") == [("1-5", 3.5, Origin.DERIVED)]
    assert scene.finger.is_uniform


def test_derived_values_stay_within_the_limits(problems):
    text = FINGER.replace("26", "1e12").replace("0.75", "1e12")
    keys = {problem.key for problem in problems(text)}
    assert "finger.geometry.dome_height_mm" in keys  # k_b, named by the first of its dimensions


def test_a_design_that_is_not_bistable_is_no_mistake(read):
    assert (
        scene_of(read(FINGER, "finger.lattice.force_linearity=0.5")).finger.force_linearity == 0.5
    )


def test_the_schema_describes_every_key():
    schema = json_schema()
    assert schema["$schema"].startswith("https://json-schema.org/")
    assert schema["title"] == "dpg spec"
    assert schema["additionalProperties"] is False
    assert schema["$defs"]
    for definition in schema["$defs"].values():
        assert definition["properties"]
        for key, value in definition["properties"].items():
            assert value["description"], key
    json.dumps(schema, allow_nan=False)


def test_canonical_json_is_the_same_for_the_same_meaning(read):
    one = read(LATTICE + "  geometry: null\n")
    other = read(LATTICE.replace("3.5\n    bi", "35e-1\n    bi"))
    assert canonical_json(one) == canonical_json(other)
    assert json.loads(canonical_json(one)) == {
        "finger": {
            "units": 4,
            "linear_stiffness_N_per_mm": ".inf",
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
    assert canonical_json(one) != canonical_json(read(LATTICE, "finger.units=5"))


@pytest.mark.parametrize("path", sorted(CONFIGS.glob("*.yaml")), ids=lambda path: path.stem)
@pytest.mark.parametrize("changes", [(), ("finger.linear_stiffness_N_per_mm=.inf",)])
def test_what_tables_keep_of_a_spec_is_a_spec(path, changes, read):
    kept = canonical_json(read_spec(path, changes))
    assert canonical_json(read(kept)) == kept


def test_scene_of_a_spec_made_in_python_checks_it_too():
    data = {"finger": {"units": 2, "linear_stiffness_N_per_mm": 1e4}}
    with pytest.raises(SpecError) as caught:
        scene_of(Spec.model_validate(data))
    assert len(caught.value.problems) == 6
    assert caught.value.problems[0].file == "spec"


KEYS = sorted({key for section in SECTIONS.values() for key in section.model_fields})
SCALARS = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.just(10**100),
    st.floats(),
    st.sampled_from([1e-12, 1e12, 1e18, 0.75, 26.0, 3, 5, "published", "4-5", "\ud800"]),
    st.text(max_size=5),
)
NAMES = st.one_of(st.sampled_from([*KEYS, "1", "2-3"]), st.text(max_size=5))
DATA = st.recursive(
    SCALARS,
    lambda inner: st.lists(inner, max_size=2) | st.dictionaries(NAMES, inner, max_size=5),
    max_leaves=12,
)
POSITIVE = st.floats(1e-12, 1e12)


def spec_or_problems(data):
    try:
        scene_of(checked(Document("x.yaml", data, {})))
    except SpecError as error:
        assert error.problems
        str(error)


@pytest.mark.slow
@settings(max_examples=200, deadline=None)
@given(st.dictionaries(NAMES, DATA, max_size=3))
def test_any_data_is_a_spec_or_has_problems(data):
    spec_or_problems(data)


def section(model, values):
    return st.fixed_dictionaries({}, optional=dict.fromkeys(model.model_fields, values))


def finger(values):
    override = st.fixed_dictionaries(
        {},
        optional={
            "geometry": section(SECTIONS["finger", "overrides", "*", "geometry"], values),
            "lattice": section(SECTIONS["finger", "overrides", "*", "lattice"], values),
        },
    )
    return st.fixed_dictionaries(
        {"units": st.integers(1, 6), "linear_stiffness_N_per_mm": POSITIVE},
        optional={
            "calibration": st.just("published"),
            "geometry": section(SECTIONS["finger", "geometry"], values),
            "lattice": section(SECTIONS["finger", "lattice"], values),
            "overrides": st.dictionaries(st.sampled_from(["1", "2-3", "4-6"]), override),
        },
    )


@settings(max_examples=200, deadline=None)
@given(finger(POSITIVE | st.floats(0.01, 20) | st.none()))
def test_any_well_typed_finger_is_a_scene_or_has_problems(data):
    spec_or_problems({"finger": data})


@settings(max_examples=100, deadline=None)
@given(st.text(max_size=20), st.sampled_from(["", "finger", "finger.units", "finger.overrides.4"]))
def test_any_setting_is_applied_or_refused(text, key):
    try:
        read_spec(GRADED, [key + text, f"{key}={text}"])
    except SpecError as error:
        assert error.problems
        str(error).encode()


@pytest.mark.parametrize("pair", ["[5.375]", "5.375", "[5, x]", "[1, 2, 3]", "[.inf, 0]", "up"])
def test_a_place_in_some_data_is_two_numbers(problems, pair):
    text = FINGER + f"data:\n  first_station_mm: {pair}\n"
    (problem,) = problems(text)
    assert problem.key == "data.first_station_mm"
    assert problem.expected == "two numbers in mm, such as [5.375, -0.75]"


def test_a_key_of_the_data_that_is_not_known(problems):
    (problem,) = problems(FINGER + "data: {first_station: [1, 2]}\n")
    assert problem.hint == "did you mean first_station_mm?"
