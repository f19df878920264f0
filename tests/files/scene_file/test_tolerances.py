"""Uncertainties in a spec: every key of a value, numbers or percentages, all mistakes at once."""

import json
from typing import Any

import pytest

from dpgcli.design.dimensions import Tolerance
from dpgcli.errors import SpecError
from dpgcli.files.scene_file import canonical_json, checked, json_schema, scene_of
from dpgcli.files.scene_file.models import GripperSpec
from dpgcli.files.scene_file.problems import unknown_key
from dpgcli.files.scene_file.tolerances import Tolerances
from dpgcli.files.sections import Geometry, Lattice
from dpgcli.files.yaml_file import parse_document

SPEC = """\
finger:
  units: 2
  calibration: published
  geometry: {dome_height_mm: 6.5, dome_thickness_mm: 0.75, unit_cell_mm: 22, chamber_length_mm: 9,
    channel_width_mm: 10, limiting_layer_thickness_mm: 1.5, unit_separation_mm: 3,
    elastic_modulus_MPa: 26}
"""
GRIPPER = "gripper: {base_spacing_mm: 60}\n"


def read(more: str) -> Any:
    return checked(parse_document("x.yaml", SPEC + more))


OF_THE_FINGER = ("linear_stiffness_N_per_mm", "hinge_coupling_N_mm_per_rad")


def problems(more: str) -> list[str]:
    with pytest.raises(SpecError) as caught:
        read(more)
    return [str(problem) for problem in caught.value.problems]


def test_every_key_of_a_value_can_have_one() -> None:
    keys = {*Geometry.model_fields, *Lattice.model_fields, *GripperSpec.model_fields}
    beside = {*OF_THE_FINGER, "wall_compliance_mm_per_N"}
    assert set(Tolerances.model_fields) == keys | beside


def test_numbers_and_percentages() -> None:
    spec = read("uncertainty: {dome_height_mm: 0.1, elastic_modulus_MPa: 10%, stroke_mm: 2.5 %}\n")
    assert spec.design.tolerances == {
        "dome_height_mm": Tolerance(0.1, False),
        "elastic_modulus_MPa": Tolerance(0.1, True),
        "stroke_mm": Tolerance(0.025, True),
    }
    assert scene_of(spec).uncertainty.covers.startswith("tolerances of dome_height_mm, ")


@pytest.mark.parametrize(("text", "value"), [("5%", 0.05), ('"12.5 %"', 0.125), ("null", None)])
def test_the_model_s_error(text: str, value: float | None) -> None:
    assert read(f"model_error: {text}\n").design.model_error == value


def test_a_spec_that_a_table_keeps_means_the_same() -> None:
    spec = read("uncertainty: {dome_height_mm: 0.1, elastic_modulus_MPa: 10%}\nmodel_error: 5%\n")
    again = checked(parse_document("again", canonical_json(spec)))
    assert again == spec


WRONG = [
    ("dome_height_mm", "-0.1", "-0.1"),
    ("dome_height_mm", "0.1mm", '"0.1mm"'),
    ("dome_height_mm", "101%", '"101%" (at most 100%)'),
    ("dome_height_mm", ".nan", ".nan"),
    ("dome_height_mm", ".inf", ".inf"),
    ("dome_height_mm", "true", "true"),
    ("dome_height_mm", "[1]", "a list of 1"),
    ("dome_height_mm", "1e13", "10000000000000.0 (at most 1e+12 in size)"),
]


@pytest.mark.parametrize(("key", "value", "found"), WRONG)
def test_what_is_no_uncertainty(key: str, value: str, found: str) -> None:
    (problem,) = problems(f"uncertainty: {{{key}: {value}}}\n")
    assert problem.startswith(
        f"x.yaml:7:15: uncertainty.{key}: expected a standard uncertainty >= 0 in mm, "
        "or one such as 10%, found "
    )
    assert found in problem


@pytest.mark.parametrize("value", ["0.05", "5", "0%", "often", "-5%", "101%"])
def test_what_is_no_model_error(value: str) -> None:
    (problem,) = problems(f"model_error: {value}\n")
    assert "model_error: expected a percentage such as 5%, or leave_one_out, found " in problem
    assert "(above 0% and at most 100%)" in problem


def test_mistakes_between_keys_all_at_once() -> None:
    assert problems(
        "uncertainty:\n"
        "  chamber_width_mm: 0.1\n"
        "  base_spacing_mm: 1\n"
        "  dome_height_mm: 65\n"
        "  linear_stiffness_N_per_mm: 10%\n"
    ) == [
        "x.yaml:8:3: uncertainty.chamber_width_mm: expected a key that has a value here, found "
        "chamber_width_mm (finger.geometry does not give it)",
        "x.yaml:9:3: uncertainty.base_spacing_mm: expected a key that has a value here, found "
        "base_spacing_mm (there is no gripper)",
        "x.yaml:10:3: uncertainty.dome_height_mm: expected less than 6.5, the value, found 65 mm",
    ]


def test_a_percentage_of_nothing() -> None:
    (problem,) = problems(GRIPPER + "uncertainty: {mounting_angle_deg: 10%}\n")
    assert "expected a number in °, found 10 % (mounting_angle_deg is 0)" in problem
    assert read(GRIPPER + "uncertainty: {mounting_angle_deg: 1}\n").design.tolerances


@pytest.mark.parametrize("rigid", ["10%", "100"])
def test_rigid_bars_have_none(rigid: str) -> None:
    with pytest.raises(SpecError, match="no tolerance of rigid bars"):
        document = parse_document(
            "x.yaml",
            SPEC.replace("units: 2", "units: 2\n  linear_stiffness_N_per_mm: .inf")
            + f"uncertainty: {{linear_stiffness_N_per_mm: {rigid}}}",
        )
        checked(document)


def test_an_unknown_key_is_named_with_its_neighbor() -> None:
    (problem,) = problems("uncertainty: {dome_heigth_mm: 0.1}\n")
    assert problem.endswith("found dome_heigth_mm (did you mean dome_height_mm?)")


@pytest.mark.parametrize("key", ["uncertainty.dome_height_mm", "uncertainty", "model_error"])
def test_designs_do_not_differ_in_it(key: str) -> None:
    assert unknown_key(tuple(key.split("."))) is not None


def test_a_mistyped_geometry_is_still_led_to_the_geometry() -> None:
    with pytest.raises(SpecError, match=r"did you mean finger\.geometry\.dome_height_mm"):
        read("dome_height_mm: 6.5\n")


def test_the_schema_knows_both_forms() -> None:
    definitions = json_schema()["$defs"]["Tolerances"]["properties"]
    kinds = definitions["dome_height_mm"]["anyOf"]
    assert [kind["type"] for kind in kinds] == ["number", "string", "null"]
    assert json.dumps(definitions).count("10%") == len(definitions)
