"""Dead loads in a spec: what the keys mean, and all mistakes at their places."""

import json
from typing import Any

import numpy as np
import pytest

from dpgcli.design.loads import GRAVITY
from dpgcli.design.resolve import resolve
from dpgcli.errors import SpecError
from dpgcli.files.scene_file import canonical_json, checked, json_schema, scene_of
from dpgcli.files.scene_file.problems import unknown_key
from dpgcli.files.yaml_file import parse_document
from dpgcli.mechanics.finger import Finger

SPEC = """\
finger:
  units: 3
  lattice: {segment_length_mm: 13.5, segment_height_mm: 10.75, stroke_mm: 3.5,
    force_linearity: 0.043, bistable_stiffness_N_per_mm: 12.84, hinge_stiffness_N_mm_per_rad: 24.2}
"""
GRIPPER = "gripper: {base_spacing_mm: 60, mounting_angle_deg: 30}\n"


def read(loads: str, more: str = "") -> Any:
    return checked(parse_document("x.yaml", f"{SPEC}{more}loads: {{{loads}}}\n"))


def finger_of(loads: str, more: str = "") -> Finger:
    return scene_of(read(loads, more)).finger


def problems(loads: str, more: str = "") -> list[str]:
    with pytest.raises(SpecError) as caught:
        read(loads, more)
    return [str(problem) for problem in caught.value.problems]


def vector(finger: Finger) -> list[float]:
    return [float(part[0, 0]) for part in (finger.gravity_x, finger.gravity_y)]


def test_loads_by_key() -> None:
    finger = finger_of("tip_force_N: [0.25, -0.1], tip_moment_N_mm: 2, unit_mass_g: 12")
    assert (finger.tip_force_x, finger.tip_force_y) == (np.array([[0.25]]), np.array([[-0.1]]))
    assert finger.end_moment.tolist() == [[-2.0]], (
        "it counts as the tip's angle, gaps the other way"
    )
    assert finger.unit_weight.tolist() == [[12.0 * GRAVITY]] == [[pytest.approx(0.1176798)]]
    assert vector(finger) == [-1.0, 0.0]


def test_parts_of_a_force_count_instead_of_those_of_the_whole() -> None:
    finger = finger_of("tip_force_N: [0.25, -0.1], tip_force_y_N: 0.5")
    assert (finger.tip_force_x.item(), finger.tip_force_y.item()) == (0.25, 0.5)
    assert finger_of("tip_force_x_N: 1").tip_force_x.item() == 1.0


def test_masses_by_unit() -> None:
    finger = finger_of("unit_mass_g: [12, 0, 6.5]")
    assert finger.unit_weight[:, 0] == pytest.approx(GRAVITY * np.array([12.0, 0.0, 6.5]), rel=0)


@pytest.mark.parametrize(
    ("said", "found"),
    [
        ("-x", (-1.0, 0.0)),
        ("x", (1.0, 0.0)),
        ("+x", (1.0, 0.0)),
        ("-y", (0.0, -1.0)),
        ("+y", (0.0, 1.0)),
        ("[3, -4]", (0.6, -0.8)),
        ("[0, 1.0e-9]", (0.0, 1.0)),
        ("null", (-1.0, 0.0)),
    ],
)
def test_directions(said: str, found: tuple[float, float]) -> None:
    finger = finger_of(f"unit_mass_g: 12, gravity_direction: {said}")
    assert vector(finger) == pytest.approx(list(found), abs=1e-15)


def test_the_fingers_of_a_gripper_are_tilted_under_gravity() -> None:
    """The upper one's own x is tilted by +30° in the gripper: −x of that is (−cos, +sin)."""
    finger = finger_of("unit_mass_g: 12, tip_force_N: [0.1, 0.2]", GRIPPER)
    assert vector(finger) == pytest.approx([-np.cos(np.pi / 6.0), 0.5])
    assert (finger.tip_force_x.item(), finger.tip_force_y.item()) == (0.1, 0.2)


@pytest.mark.parametrize("said", ["y", "-y", "[1, 0.01]", "[-1, -1]"])
def test_gravity_across_a_gripper_is_refused(said: str) -> None:
    (problem,) = problems(f"unit_mass_g: 12, gravity_direction: {said}", GRIPPER)
    assert problem.startswith("x.yaml:6:26: loads.gravity_direction: expected -x or x: along the")
    assert "leave out gripper: and predict each finger by itself" in problem


def test_what_does_not_act_is_not_refused() -> None:
    assert not finger_of("unit_mass_g: 0, gravity_direction: y", GRIPPER).is_loaded
    assert not finger_of("gravity_direction: y", GRIPPER).is_loaded
    rounded = finger_of("unit_mass_g: 1, gravity_direction: [1, 6.1e-17]", GRIPPER)
    assert vector(rounded) == pytest.approx([np.cos(np.pi / 6.0), -0.5])


@pytest.mark.parametrize("said", ["", "tip_force_N: [0, 0], unit_mass_g: 0, tip_moment_N_mm: 0"])
def test_no_loads_at_all(said: str) -> None:
    assert not finger_of(said).is_loaded


FORCE = "two numbers in N, along x and along y, such as [0, -0.1]"
MASS = "a mass >= 0 in g, or a list of one for each unit"
DIRECTION = (
    'gravity_direction: expected "-x", "x", "-y", "y", or two numbers that are not both zero, '
    "such as [0.6, -0.8]"
)


@pytest.mark.parametrize(
    ("loads", "problem"),
    [
        ("tip_force_N: 0.1", f"tip_force_N: expected {FORCE}, found 0.1"),
        ("tip_force_N: [0.1]", f"tip_force_N: expected {FORCE}, found [0.1]"),
        ("tip_force_N: [0.1, .nan]", f"tip_force_N: expected {FORCE}, found [0.1, .nan]"),
        ("tip_force_N: [0.1, 0, 0]", f"tip_force_N: expected {FORCE}, found [0.1, 0, 0]"),
        ("tip_force_N: [0, 0.1 N]", f'tip_force_N: expected {FORCE}, found [0, "0.1 N"]'),
        ("tip_force_N: [0, true]", f"tip_force_N: expected {FORCE}, found [0, true]"),
        ("tip_force_x_N: .inf", "tip_force_x_N: expected a number in N, found .inf"),
        (
            "tip_moment_N_mm: 1e13",
            "tip_moment_N_mm: expected a number in N mm, found 10000000000000.0",
        ),
        ("unit_mass_g: -1", f"unit_mass_g: expected {MASS}, found -1"),
        ("unit_mass_g: .nan", f"unit_mass_g: expected {MASS}, found .nan"),
        ("unit_mass_g: [12, -1, 3]", f"unit_mass_g: expected {MASS}, found [12, -1, 3]"),
        ("unit_mass_g: [12, .nan, 3]", f"unit_mass_g: expected {MASS}, found [12, .nan, 3]"),
        ("unit_mass_g: []", f"unit_mass_g: expected {MASS}, found []"),
        ("unit_mass_g: true", f"unit_mass_g: expected {MASS}, found true"),
        ("unit_mass_g: {1: 12}", f"unit_mass_g: expected {MASS}, found a section"),
        (
            "unit_mass_g: [12, 13]",
            "unit_mass_g: expected one mass in g, or 3: one for each unit, found 2 masses",
        ),
        ("gravity_direction: [0, 0]", f"{DIRECTION}, found [0, 0]"),
        ("gravity_direction: z", f'{DIRECTION}, found "z"'),
        (
            "gravity_direction: [1, .inf]",
            f"{DIRECTION}, found [1, .inf]",
        ),
        (
            "gravity_direction: [1, 0, 0]",
            f"{DIRECTION}, found [1, 0, 0]",
        ),
        ("gravity_direction: 3", f"{DIRECTION}, found 3"),
        ("tip_force_mN: 3", "tip_force_mN: expected a known key, found tip_force_mN"),
    ],
)
def test_mistakes(loads: str, problem: str) -> None:
    (found,) = problems(loads)
    assert found.startswith(f"x.yaml:5:9: loads.{problem}")


def test_a_number_with_a_unit() -> None:
    (found,) = problems('tip_moment_N_mm: "2 N mm"')
    assert found.endswith("(a plain number such as 6.5 or 1.0e+4: no quotes, no unit)")


def test_all_mistakes_at_once() -> None:
    found = problems("tip_force_N: 1, tip_moment_N_mm: x, unit_mass_g: -3, gravity_direction: up")
    assert len(found) == 4


@pytest.mark.parametrize("said", ["3", "[1, 2]", "up"])
def test_no_section(said: str) -> None:
    with pytest.raises(SpecError) as caught:
        checked(parse_document("x.yaml", f"{SPEC}loads: {said}\n"))
    (problem,) = caught.value.problems
    assert problem.expected == "a section of keys"


def test_designs_may_differ_in_numbers_only() -> None:
    for key in ("tip_force_x_N", "tip_force_y_N", "tip_moment_N_mm", "unit_mass_g"):
        assert unknown_key(("loads", key)) is None
    for key in ("tip_force_N", "gravity_direction"):
        found = unknown_key(("loads", key))
        assert found is not None
        assert found[0] == "the key of a number"


def test_canonical_json_reads_back() -> None:
    spec = read("tip_force_N: [0, 0.1], unit_mass_g: [1, 2, 3], gravity_direction: [0.6, 0.8]")
    again = checked(parse_document("x.yaml", canonical_json(spec)))
    assert again == spec


def test_the_schema_knows_the_keys() -> None:
    schema = json_schema()
    text = json.dumps(schema)
    for key in ("tip_force_N", "tip_moment_N_mm", "unit_mass_g", "gravity_direction"):
        assert f'"{key}"' in text


def test_designs_with_and_without_loads_are_no_batch() -> None:
    """So that those without are solved, to the last bit, as if there were no loads at all."""
    key = "loads.tip_force_y_N"
    design = read("").design.with_values({key: np.array([0.0, 0.1, 0.0, -0.2])})
    parts = resolve(design).alike(np.arange(4))
    assert [part.tolist() for part in parts] == [[0, 2], [1, 3]]
    weighed = read("unit_mass_g: [0, 1, 0]").design.with_values({key: np.array([0.0, 0.1])})
    assert [part.tolist() for part in resolve(weighed).alike(np.arange(2))] == [[0, 1]]
    again = weighed.with_values({"loads.unit_mass_g": np.array([0.0, 3.0])})
    assert resolve(again).batch(np.arange(2)).finger.unit_weight[:, 1] == pytest.approx(3 * GRAVITY)
