"""Specs that refer to calibration files: whose value counts, where, and every mistake."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from dpgcli.design import geometry
from dpgcli.design.scene import Origin
from dpgcli.errors import SpecError
from dpgcli.files.scene_file import canonical_json, json_schema, read_scene, read_spec, scene_of

FINGER = """\
finger:
  units: 4
  linear_stiffness_N_per_mm: 1.0e4
  calibration: CALIBRATION
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
HEAD = "calibration_version: 1\nmade_by: hand\nmethod: none\n"
STUDY = (
    "geometry: {dome_height_mm: 6.5, dome_thickness_mm: 0.75, unit_cell_mm: 22, "
    "channel_width_mm: 10, limiting_layer_thickness_mm: 1.5, unit_separation_mm: 3, "
    "elastic_modulus_MPa: 26}\n"
)
SPRING = "values:\n  bistable_stiffness_N_per_mm: {value: 20, standard_error: 0.5}\n"
HINGE = "values:\n  hinge_stiffness_N_mm_per_rad: {value: 30, standard_error: 2}\n"
STIFFNESS, HINGES = "bistable_stiffness_N_per_mm", "hinge_stiffness_N_mm_per_rad"

HEIGHTS, THICKNESSES = (5.0, 6.0, 7.0), (0.6, 0.8)
POINTS = [(h, t) for h in HEIGHTS for t in THICKNESSES]


def power_law(height, thickness):
    return 7.0 * thickness**2.5 * height**-0.4


def grid(method, quantity=STIFFNESS, value=power_law):
    lists = {
        "dome_height_mm": [h for h, _ in POINTS],
        "dome_thickness_mm": [t for _, t in POINTS],
        quantity: [value(h, t) for h, t in POINTS],
    }
    return (
        HEAD
        + "geometry: {elastic_modulus_MPa: 26}\n"
        + f"grid:\n  method: {method}\n  over: [dome_height_mm, dome_thickness_mm]\n"
        + f"  points: {json.dumps(lists)}\n"
    )


@pytest.fixture
def write(tmp_path, monkeypatch):
    """Writes files into the current folder."""
    monkeypatch.chdir(tmp_path)

    def to_file(name, text):
        Path(name).parent.mkdir(exist_ok=True)
        Path(name).write_text(text, encoding="utf-8")

    return to_file


@pytest.fixture
def scene(write):
    """The scene of a spec that calibrates by something."""

    def of(calibration, *changes, text=FINGER):
        write("x.yaml", text.replace("CALIBRATION", calibration))
        return scene_of(read_spec("x.yaml", changes))

    return of


@pytest.fixture
def problems(scene):
    def of(calibration, *changes, text=FINGER):
        with pytest.raises(SpecError) as caught:
            scene(calibration, *changes, text=text)
        return [str(problem) for problem in caught.value.problems]

    return of


def sources(scene, key):
    return [s for s in scene.sources if s.key == key]


def only(scene, key):
    (source,) = sources(scene, key)
    return source


@pytest.mark.parametrize("height", [3.0, 2.0])
def test_a_file_whose_geometry_has_no_stroke_is_not_scaled_by_it(write, scene, height):
    geometry = f"geometry: {{dome_height_mm: {height}, unit_separation_mm: 3}}\n"
    write("a.yaml", HEAD + geometry + "values: {stroke_mm: {value: 3.3}}\n")
    found = only(scene("[a.yaml, published]"), "stroke_mm")
    assert (found.value, found.origin) == (3.3, Origin.EXTRAPOLATED)
    assert found.rule == "from a.yaml, whose geometry has no such value to scale by"


@pytest.mark.parametrize(
    ("quantity", "value", "said"),
    [
        ("force_linearity", lambda h, t: 0.5 * t / 0.6 * h**4 / 625, "a value from 0 to 1, found"),
        (STIFFNESS, lambda h, t: 1e9 * (h / 5) ** 20, "a value from 1e-12 to 1e+12, found"),
    ],
)
def test_a_grid_that_ends_in_no_value_is_a_problem(write, problems, quantity, value, said):
    write("a.yaml", grid("interpolation", quantity, value))
    (found,) = problems("[a.yaml, published]", "finger.geometry.dome_height_mm=9")
    assert said in found
    assert "interpolated over dome_height_mm, dome_thickness_mm, a.yaml" in found


def test_the_first_file_that_has_a_value_gives_it(write, scene):
    write("a.yaml", HEAD + STUDY + SPRING)
    write("b.yaml", HEAD + STUDY + SPRING.replace("20", "25") + HINGE.replace("values:\n", ""))
    finger = scene("[a.yaml, b.yaml, published]").finger
    assert finger.bistable_stiffness.item() == 20.0
    assert finger.hinge_stiffness.item() == 30.0
    assert finger.force_linearity.item() == 0.043
    turned = scene("[b.yaml, a.yaml, published]").finger
    assert turned.bistable_stiffness.item() == 25.0
    first = scene("[published, a.yaml, b.yaml]").finger
    assert (first.bistable_stiffness.item(), first.hinge_stiffness.item()) == (12.84, 24.2)


def test_published_in_a_list_is_published_alone(scene):
    assert scene("[published]").sources == scene("published").sources


def test_a_file_alone_leaves_out_what_it_lacks(write, problems):
    write("a.yaml", HEAD + STUDY + SPRING)
    assert [problem.split(": ")[1] for problem in problems("a.yaml")] == [
        "finger.lattice.force_linearity",
        "finger.lattice.hinge_stiffness_N_mm_per_rad",
    ]


def test_names_are_relative_to_the_specs_folder(write):
    write("below/a.yaml", HEAD + STUDY + SPRING)
    write("below/x.yaml", FINGER.replace("CALIBRATION", "[a.yaml, published]"))
    document = read_scene("below/x.yaml")
    assert document.files == (Path("below/a.yaml"),)
    assert scene_of(read_spec("below/x.yaml")).finger.bistable_stiffness.item() == 20.0


def test_names_in_settings_are_relative_to_the_current_folder(write):
    write("below/x.yaml", FINGER.replace("CALIBRATION", "[none.yaml, published]"))
    write("a.yaml", HEAD + STUDY + SPRING)
    changed = read_spec("below/x.yaml", ["finger.calibration=[a.yaml, published]"])
    assert scene_of(changed).finger.bistable_stiffness.item() == 20.0


def test_lattice_values_win_over_files(write, scene):
    write("a.yaml", HEAD + STUDY + SPRING)
    found = scene("[a.yaml, published]", f"finger.lattice.{STIFFNESS}=11")
    source = only(found, STIFFNESS)
    assert (source.value, source.origin, source.standard_error) == (11.0, Origin.GIVEN, None)
    assert found.uncertainty is None


def test_a_files_own_geometry_keeps_its_value(write, scene):
    write("a.yaml", HEAD + STUDY + SPRING)
    source = only(scene("[a.yaml, published]"), STIFFNESS)
    assert (source.value, source.origin, source.standard_error) == (20.0, Origin.CALIBRATED, 0.5)
    assert source.rule == "from a.yaml"


@pytest.mark.parametrize(
    ("height", "thickness", "modulus", "origin"),
    [
        (7.5, 0.75, 26.0, Origin.SCALED),
        (6.5, 0.5, 13.0, Origin.SCALED),
        (7.6, 0.75, 26.0, Origin.EXTRAPOLATED),
        (6.5, 1.1, 26.0, Origin.EXTRAPOLATED),
    ],
)
def test_another_dome_scales_value_and_error_alike(
    write, scene, height, thickness, modulus, origin
):
    write("a.yaml", HEAD + STUDY + SPRING)
    source = only(
        scene(
            "[a.yaml, published]",
            f"finger.geometry.dome_height_mm={height}",
            f"finger.geometry.dome_thickness_mm={thickness}",
            f"finger.geometry.elastic_modulus_MPa={modulus}",
        ),
        STIFFNESS,
    )
    factor = geometry.bistable_stiffness(height, thickness, modulus) / 12.84
    assert source.value == pytest.approx(20.0 * factor, rel=1e-14)
    assert source.standard_error == pytest.approx(0.5 * factor, rel=1e-14)
    assert source.origin is origin
    assert "a.yaml, E t^2.8 h^-0.25" in source.rule


def test_another_hinge_scales_by_its_own_rule(write, scene):
    write("a.yaml", HEAD + STUDY + HINGE)
    found = scene("[a.yaml, published]", "finger.geometry.channel_width_mm=8")
    source = only(found, HINGES)
    assert source.value == pytest.approx(30.0 * geometry.hinge_stiffness(26, 8, 1.5, 3) / 24.2)
    assert (source.standard_error, source.origin) == (pytest.approx(1.6), Origin.SCALED)
    assert only(found, STIFFNESS).origin is Origin.CALIBRATED, "the dome is the same"


def test_a_fitted_lever_moves_with_the_chamber_by_the_inferred_rule(write, scene):
    write("a.yaml", HEAD + STUDY + "values:\n  segment_height_mm: {value: 12.33}\n")
    assert scene("[a.yaml, published]").finger.segment_height.item() == 12.33
    wider = scene("[a.yaml, published]", "finger.geometry.unit_cell_mm=24")
    ratio = geometry.segment_height(22, 1.5) / geometry.segment_height(20, 1.5)
    assert wider.finger.segment_height.item() == pytest.approx(12.33 * ratio, rel=1e-14)
    assert only(wider, "segment_height_mm").origin is Origin.SCALED


def test_a_file_without_geometry_is_extrapolated_with_its_value(write, scene):
    write("a.yaml", HEAD + SPRING)
    source = only(scene("[a.yaml, published]", "finger.geometry.dome_height_mm=7"), STIFFNESS)
    assert (source.value, source.origin) == (20.0, Origin.EXTRAPOLATED)
    assert "does not state its dome_height_mm, dome_thickness_mm" in source.rule


def test_a_lattice_alone_takes_a_value_as_it_is(write):
    """Where the spec has no geometry there is nothing to differ in."""
    lattice = "segment_length_mm: 13.5, segment_height_mm: 10.75, stroke_mm: 3.5"
    write("a.yaml", HEAD + STUDY + SPRING + HINGE.replace("values:\n", ""))
    write(
        "x.yaml",
        "finger: {units: 2, linear_stiffness_N_per_mm: 1.0e4, calibration: a.yaml, "
        f"lattice: {{{lattice}, force_linearity: 0.043}}}}\n",
    )
    found = scene_of(read_spec("x.yaml"))
    assert only(found, STIFFNESS).value == 20.0
    assert only(found, STIFFNESS).origin is Origin.CALIBRATED


def test_graded_units_scale_one_by_one(write, scene):
    write("a.yaml", HEAD + STUDY + SPRING)
    graded = FINGER + "  overrides:\n    3-4: {geometry: {dome_height_mm: 7.5}}\n"
    found = scene("[a.yaml, published]", text=graded)
    higher = 20.0 * (7.5 / 6.5) ** -0.25
    np.testing.assert_allclose(
        found.finger.bistable_stiffness[:, 0], [20, 20, higher, higher], rtol=1e-14
    )
    first, second = sources(found, STIFFNESS)
    assert (first.units, first.origin, first.standard_error) == ("1-2", Origin.CALIBRATED, 0.5)
    assert (second.units, second.origin) == ("3-4", Origin.SCALED)
    assert second.standard_error == pytest.approx(0.5 * higher / 20.0, rel=1e-14)
    assert found.uncertainty is not None
    (step,) = found.uncertainty.steps
    direction = step.finger
    errors = np.broadcast_to(direction["bistable_stiffness"], (4, 1))[:, 0]
    np.testing.assert_allclose(errors, 0.5 * np.array([1, 1, higher / 20, higher / 20]))


def test_errors_of_one_file_are_correlated_as_it_says_those_of_two_are_not(write, scene):
    both = SPRING + "  force_linearity: {value: 0.05, standard_error: 0.01}\n"
    both += "correlation:\n- [1.0, -0.6]\n- [-0.6, 1.0]\n"
    write("a.yaml", HEAD + STUDY + both)
    write("b.yaml", HEAD + STUDY + HINGE)
    found = scene("[a.yaml, b.yaml]").uncertainty
    assert found is not None
    order = [next(iter(step.finger)) for step in found.steps]
    places = [order.index(n) for n in ("bistable_stiffness", "force_linearity", "hinge_stiffness")]
    expected = [[1, -0.6, 0], [-0.6, 1, 0], [0, 0, 1]]
    assert found.covariance[np.ix_(places, places)].tolist() == expected


def test_bars_may_be_fitted_and_are_assumed_else(write, scene):
    soft = FINGER.replace("  linear_stiffness_N_per_mm: 1.0e4\n", "")
    write("a.yaml", HEAD + STUDY + "values:\n  linear_stiffness_N_per_mm: {value: 123}\n")
    found = scene("[published, a.yaml]", text=soft)
    source = only(found, "linear_stiffness_N_per_mm")
    assert (source.value, source.units, source.origin) == (123.0, "1-4", Origin.CALIBRATED)
    assert source.rule == "from a.yaml"
    assert scene("[published, a.yaml]").finger.linear_stiffness.item() == 1e4
    assumed = only(scene("published", text=soft), "linear_stiffness_N_per_mm")
    assert (assumed.value, assumed.units, assumed.origin) == (1e4, "1-4", Origin.ASSUMED)


@pytest.mark.parametrize("calibration", ["rigid.yaml", "[rigid.yaml, published]"])
def test_rigid_bars_of_a_file_can_be_said_in_json(write, calibration):
    lattice = "".join(f"  {k}: {{value: {v}}}\n" for k, v in (("force_linearity", 0.043),))
    text = HEAD + STUDY + SPRING + lattice + HINGE.replace("values:\n", "")
    write("rigid.yaml", text + "  linear_stiffness_N_per_mm: {value: .inf}\n")
    soft = FINGER.replace("  linear_stiffness_N_per_mm: 1.0e4\n", "")
    write("x.yaml", soft.replace("CALIBRATION", calibration))
    spec = read_spec("x.yaml")
    assert scene_of(spec).finger.is_rigid
    assert '"linear_stiffness_N_per_mm":{"value":".inf"}' in canonical_json(spec)


@pytest.mark.parametrize(
    ("method", "origin"), [("scaling", Origin.SCALED), ("interpolation", Origin.INTERPOLATED)]
)
@pytest.mark.parametrize(
    ("height", "thickness", "is_inside"),
    [(6.4, 0.7, True), (7.0, 0.8, True), (7.3, 0.7, False), (6.0, 0.59, False)],
)
def test_a_grid_of_a_power_law_is_that_law(
    write, scene, method, origin, height, thickness, is_inside
):
    """Both ways are exact for products of powers; outside the points they say so."""
    write("g.yaml", grid(method))
    found = scene(
        "[g.yaml, published]",
        f"finger.geometry.dome_height_mm={height}",
        f"finger.geometry.dome_thickness_mm={thickness}",
    )
    source = only(found, STIFFNESS)
    assert source.value == pytest.approx(power_law(height, thickness), rel=1e-9)
    assert source.origin is (origin if is_inside else Origin.EXTRAPOLATED)
    assert "over dome_height_mm, dome_thickness_mm, g.yaml" in source.rule


def test_a_grid_is_scaled_by_what_it_is_not_over(write, scene):
    """E is not among its points: k_b is proportional to it."""
    write("g.yaml", grid("interpolation"))
    found = scene(
        "[g.yaml, published]",
        "finger.geometry.elastic_modulus_MPa=52",
        "finger.geometry.dome_height_mm=6",
        "finger.geometry.dome_thickness_mm=0.7",
    )
    source = only(found, STIFFNESS)
    assert source.value == pytest.approx(2.0 * power_law(6.0, 0.7), rel=1e-9)
    assert source.origin is Origin.SCALED
    assert source.rule.endswith("g.yaml, E t^2.8 h^-0.25 (finite-element scaling)")


def test_a_grid_that_does_not_state_its_modulus_is_extrapolated(write, scene):
    write("g.yaml", grid("scaling").replace("geometry: {elastic_modulus_MPa: 26}\n", ""))
    source = only(scene("[g.yaml, published]"), STIFFNESS)
    assert source.origin is Origin.EXTRAPOLATED
    assert source.rule.endswith("which does not state its elastic_modulus_MPa")


def test_graded_units_have_their_own_places_in_a_grid(write, scene):
    write("g.yaml", grid("scaling"))
    graded = FINGER + "  overrides:\n    1: {geometry: {dome_height_mm: 7.5}}\n"
    found = scene("[g.yaml, published]", text=graded)
    first, rest = sources(found, STIFFNESS)
    assert (first.units, first.origin) == ("1", Origin.EXTRAPOLATED)
    assert (rest.units, rest.origin) == ("2-4", Origin.SCALED)
    assert first.value == pytest.approx(power_law(7.5, 0.75), rel=1e-9)


def test_a_grid_over_a_dimension_that_the_spec_lacks(write, problems):
    write("g.yaml", grid("scaling"))
    without = FINGER.replace("    dome_height_mm: 6.5\n", "")
    found = problems(
        "[g.yaml, published]",
        "finger.lattice.stroke_mm=3.5",
        "finger.lattice.force_linearity=0.043",
        text=without,
    )
    assert found == [
        f"settings: finger.lattice.{STIFFNESS}: expected a value, or geometry with "
        "dome_height_mm, found no dome_height_mm "
        "(g.yaml is over dome_height_mm, dome_thickness_mm)"
    ]


def test_a_value_wins_over_a_grid_of_the_same_file(write, scene):
    write("g.yaml", grid("scaling") + SPRING)
    assert only(scene("[g.yaml, published]"), STIFFNESS).value == pytest.approx(20.0, rel=1e-12)


def test_a_table_keeps_all_that_makes_the_scene_again(write, scene):
    write("a.yaml", HEAD + STUDY + SPRING)
    write("g.yaml", grid("interpolation", HINGES))
    found = scene("[a.yaml, g.yaml, published]", "finger.geometry.dome_height_mm=6")
    kept = canonical_json(read_spec("x.yaml", ["finger.geometry.dome_height_mm=6"]))
    for name in ("a.yaml", "g.yaml", "x.yaml"):
        Path(name).unlink()
    write("kept.json", kept)
    again = read_spec("kept.json")
    assert canonical_json(again) == kept
    assert scene_of(again).sources == found.sources
    before, after = (s.finger.arrays() for s in (found, scene_of(again)))
    assert all(np.array_equal(before[name], after[name]) for name in before)


def test_a_file_by_another_name_is_another_text_for_the_same_numbers(write, scene):
    write("a.yaml", HEAD + STUDY + SPRING)
    write("b.yaml", HEAD + STUDY + SPRING)
    first, second = (scene(f"[{name}, published]").finger for name in ("a.yaml", "b.yaml"))
    assert first.bistable_stiffness.item() == second.bistable_stiffness.item()


@pytest.mark.parametrize("listed", [True, False])
def test_what_a_table_keeps_is_checked_as_a_file_is(write, scene, problems, listed):
    write("a.yaml", HEAD + STUDY + SPRING)
    scene("[a.yaml, published]")
    kept = json.loads(canonical_json(read_spec("x.yaml")))
    (calibration, _) = kept["finger"]["calibration"]
    calibration["curve"] = {
        "travel_mm": [0, 3, 2, 4],
        "energy_mJ": [0, 1, 2, 0],
        "opening_per_travel": 1.0,
    }
    kept["finger"]["calibration"] = [calibration, "published"] if listed else calibration
    where = "finger.calibration.0" if listed else "finger.calibration"
    (problem,) = problems("", text=json.dumps(kept))
    assert f": {where}.curve.travel_mm.2: expected more than 3, found 2" in problem


EXPECTED = 'expected "published", "finite_elements" or the name of a calibration file'


@pytest.mark.parametrize(
    ("calibration", "said"),
    [
        ("none.yaml", [f'finger.calibration: {EXPECTED}, found "none.yaml": no such file']),
        (".", [f'finger.calibration: {EXPECTED}, found ".": no such file']),
        ("x" * 300, [f'finger.calibration: {EXPECTED}, found "{"x" * 56}...: no such file']),
        ("''", [f'finger.calibration: {EXPECTED}, found "": no such file']),
        ("3", [f"finger.calibration: {EXPECTED}, found 3"]),
        ("true", [f"finger.calibration: {EXPECTED}, found true"]),
        ("[]", [f"finger.calibration: {EXPECTED}, found an empty list"]),
        ("[null]", [f"finger.calibration.0: {EXPECTED}, found nothing"]),
        ("[published, 3]", [f"finger.calibration.1: {EXPECTED}, found 3"]),
        ("[[published]]", [f"finger.calibration.0: {EXPECTED}, found a list of 1"]),
        (
            "[a.yaml, published, b.yaml, .nan]",
            [
                f'finger.calibration.0: {EXPECTED}, found "a.yaml": no such file',
                f'finger.calibration.2: {EXPECTED}, found "b.yaml": no such file',
                f"finger.calibration.3: {EXPECTED}, found .nan",
            ],
        ),
    ],
)
def test_what_is_no_calibration(problems, calibration, said):
    found = problems(calibration)
    assert [problem.split(": ", 1)[1] for problem in found] == said
    assert all(problem.startswith("x.yaml:4:") for problem in found)


def test_a_place_in_the_list_is_the_place_of_the_problem(problems):
    (problem,) = problems("[published, none.yaml]")
    assert problem.startswith("x.yaml:4:28: finger.calibration.1: ")


def test_wrong_files_have_their_own_places_all_at_once(write, problems):
    write("a.yaml", HEAD + STUDY + SPRING.replace("20", "-20"))
    write("b.yaml", HEAD + STUDY + SPRING.replace("20", "-30") + "grid: 3\n")
    write("c.yaml", "")
    wrong = FINGER.replace("units: 4", "units: 0")
    found = problems("[a.yaml, b.yaml, c.yaml, d.yaml]", text=wrong)
    assert [problem.partition(": expected")[0] for problem in found] == [
        "x.yaml:2:3: finger.units",
        "x.yaml:4:41: finger.calibration.3",
        f"a.yaml:6:33: values.{STIFFNESS}.value",
        f"b.yaml:6:33: values.{STIFFNESS}.value",
        "b.yaml:7:1: grid",
        "c.yaml:1:1: document",
    ]


SECRETS = [
    "root:$6$hunter2:19000:0:99999:7:::\n",
    "-----BEGIN OPENSSH PRIVATE KEY-----\nhunter2\n-----END OPENSSH PRIVATE KEY-----\n",
    "hunter2: hunter2\n",
    "values: {hunter2: 1}\nmade_by: [hunter2]\n",
    "TOKEN=hunter2\n",
    "- hunter2\n",
    "*hunter2\n",
    "%hunter2 1\n---\n",
    "a: !hunter2 1\n",
    "a: 1\na: hunter2: 2\n",
    "hunter2\x01\n",
    "\x00\xffhunter2",
]


@pytest.mark.parametrize("secret", SECRETS)
def test_nothing_is_quoted_of_a_file_that_is_no_calibration(write, problems, secret):
    """Whoever names a file in a spec need not be allowed to read it."""
    write("secret", secret)
    found = problems("secret")
    assert found == ["secret: file: expected a calibration file of dpg fit, found something else"]


def test_the_schema_knows_names_of_files_only():
    schema = json_schema()
    (finger,) = (d for d in schema["$defs"].values() if "calibration" in d["properties"])
    kinds = finger["properties"]["calibration"]["anyOf"]
    assert kinds == [
        {"type": "string"},
        {"items": {"type": "string"}, "type": "array"},
        {"type": "null"},
    ]
    assert not {"Calibration", "Grid", "Curve"} & set(schema["$defs"])
    assert math.isfinite(len(json.dumps(schema, allow_nan=False)))
