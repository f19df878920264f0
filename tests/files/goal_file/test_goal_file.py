"""Goal files: what they say, and every mistake in them with its place."""

from collections.abc import Callable
from pathlib import Path

import pytest

from dpgcli.errors import SpecError
from dpgcli.files.goal_file import GoalFile, read_goal
from dpgcli.search.goal import Objective, Range, Target

CONFIGS = Path(__file__).parents[3] / "configs"
HEIGHT = "finger.geometry.dome_height_mm"
VARY = f"vary: {{{HEIGHT}: {{from: 4.5, to: 7.5}}}}"
TARGET = 'targets: [{pattern: "11*", quantity: tip, value: [40, -9], tolerance_mm: 0.5}]'
Read = Callable[..., GoalFile]


@pytest.fixture
def read(tmp_path: Path) -> Read:
    """Read a goal of these lines around a spec in configs."""

    def reading(*lines: str, base: str = "three_unit", settings: tuple[str, ...] = ()) -> GoalFile:
        path = tmp_path / "goal.yaml"
        head = f"base: {CONFIGS / base}.yaml"
        path.write_text("\n".join([head, *lines, ""]), encoding="utf-8")
        return read_goal(path, settings)

    return reading


def problems(read: Read, *lines: str, **more: str) -> list[str]:
    with pytest.raises(SpecError) as caught:
        read(*lines, **more)
    return [f"{p.line}:{p.column}: {p.statement}" for p in caught.value.problems]


def test_a_goal_says_what_it_says(read: Read) -> None:
    found = read(
        "vary:",
        "  finger.units: {from: 3, to: 5}",
        "  finger.linear_stiffness_N_per_mm: [1.0e+4, .inf]",
        f"  {HEIGHT}: {{from: 4.5, to: 7.5}}",
        TARGET,
        "constraints: [min_barrier_mJ > 1]",
        "minimize: [reach_min_mm]",
        "maximize: [dome_height_mm]",
    ).goal
    assert found.lists["finger.units"] == (3, 4, 5)
    assert found.lists["finger.linear_stiffness_N_per_mm"] == (1e4, float("inf"))
    assert found.ranges == (Range(HEIGHT, 4.5, 7.5),)
    assert found.targets == (Target("11*", "tip", (40.0, -9.0), 0.5),)
    assert [rule.text for rule in found.constraints] == ["min_barrier_mJ > 1"]
    assert found.objectives == (Objective("reach_min_mm"), Objective("dome_height_mm", True))
    assert len(list(found.choices())) == 6


def test_the_goal_that_ships_is_right() -> None:
    for path in (CONFIGS / "goals").glob("*.yaml"):
        assert read_goal(path).goal.keys


@pytest.mark.parametrize(
    ("line", "said"),
    [
        (
            "vary: {finger.geometry.dome_heigth_mm: {from: 4, to: 5}}",
            "did you mean dome_height_mm?",
        ),
        (f"vary: {{{HEIGHT}: {{from: 5, to: 4}}}}", "a range from less to more, found 5 to 4"),
        (f"vary: {{{HEIGHT}: {{from: 4, upto: 5}}}}", "found keys from, upto"),
        (f"vary: {{{HEIGHT}: {{from: 4, to: x}}}}", 'expected a number, found "x"'),
        (f"vary: {{{HEIGHT}: 4}}", "expected a list of numbers, or a range such as"),
        (f"vary: {{{HEIGHT}: []}}", "found no values"),
        (f"vary: {{{HEIGHT}: [4, true]}}", "found true"),
        (f"vary: {{{HEIGHT}: {{from: -4, to: 5}}}}", "values that the key can have, found -4"),
        ("vary: {finger.units: [2.5]}", "values that the key can have, found 2.5"),
        ("vary: {finger.units: {from: 2, to: 65}}", "values that the key can have, found 65"),
        ("vary: {gripper.base_spacing_mm: [40, 50]}", "the base has no gripper"),
        ("vary: {}", "expected a key or more, found none"),
        ("vary: {finger.geometry.dome_height_mm: [4], x: [1]}", "expected a known key, found x"),
    ],
)
def test_mistakes_in_what_varies(read: Read, line: str, said: str) -> None:
    found = problems(read, line, TARGET)
    assert any(said in problem for problem in found), found
    assert found[0].startswith("2:")


@pytest.mark.parametrize(
    ("target", "said"),
    [
        ("quantity: tipp, value: [4, 5], tolerance_mm: 1", 'found "tipp" (the nearest is tip;'),
        ("quantity: aperture_mm, value: 4, tolerance_mm: 1", "expected tip, or a column of states"),
        ("quantity: residual_N, value: 4, tolerance_N: 1", "expected tip, or a column of states"),
        ("quantity: tip, value: [4, 5]", "tolerance_mm: expected a number > 0, found nothing"),
        ("quantity: tip, value: [4, 5], tolerance_mm: 0", "tolerance_mm: expected a number > 0"),
        ("quantity: energy_mJ, value: 4, tolerance_mm: 1", "did you mean tolerance_mJ?"),
        ("quantity: tip, value: 4, tolerance_mm: 1", "expected two numbers in mm"),
        (
            "quantity: tip, value: [4, 5, 6], tolerance_mm: 1",
            "[45, -30], found a list of 3",
        ),
        ("quantity: tip, value: [], tolerance_mm: 1", "[45, -30], found an empty list"),
        ("quantity: tip_x_mm, value: [4], tolerance_mm: 1", "value: expected a number"),
        ("quantity: tip_x_mm, value: .nan, tolerance_mm: 1", "value: expected a number"),
    ],
)
def test_mistakes_in_targets(read: Read, target: str, said: str) -> None:
    found = problems(read, VARY, f'targets: [{{pattern: "11*", {target}}}]')
    assert any(said in problem for problem in found), found


BIG = "1" + 400 * "0"


@pytest.mark.parametrize(
    ("vary", "target", "said"),
    [
        (f"{HEIGHT}: {{from: 4.5, to: {BIG}}}", "", f"vary.{HEIGHT}.to: expected a number"),
        (f"{HEIGHT}: [{BIG}, 6.5]", "", f"vary.{HEIGHT}: expected a list of numbers"),
        (f"finger.units: [{BIG}, 4]", "", "vary.finger.units: expected a list of numbers"),
        (f"finger.units: {{from: 2, to: {BIG}}}", "", "vary.finger.units.to: expected a number"),
        ("", f"quantity: tip, value: [{BIG}, -9], tolerance_mm: 1", "value: expected two numbers"),
        ("", f"quantity: tip_x_mm, value: {BIG}, tolerance_mm: 1", "value: expected a number"),
        ("", f"quantity: tip_x_mm, value: 4, tolerance_mm: {BIG}", "_mm: expected a number > 0"),
    ],
)
def test_whole_numbers_beyond_double_precision_are_none(
    read: Read, vary: str, target: str, said: str
) -> None:
    target = target or "quantity: tip_x_mm, value: 4, tolerance_mm: 1"
    line = f"vary: {{{vary}}}" if vary else VARY
    (found,) = problems(read, line, f'targets: [{{pattern: "11*", {target}}}]')
    assert said in found
    assert ", found a list of 2" in found or ", found a number of more than 60 digits" in found


@pytest.mark.parametrize(
    ("pattern", "said"),
    [
        ('"1111"', 'expected a pattern of 3 units, found "1111"'),
        ("111", "found 111 (a pattern without * in quotes)"),
        ('"1x"', "expected a pattern such as 111*"),
        ('""', "expected a pattern such as 111*"),
    ],
)
def test_mistakes_in_patterns(read: Read, pattern: str, said: str) -> None:
    rest = "quantity: tip_x_mm, value: 4, tolerance_mm: 1"
    found = problems(read, VARY, f"targets: [{{pattern: {pattern}, {rest}}}]")
    assert any(said in problem for problem in found), found


def test_a_pattern_that_too_many_states_match(read: Read) -> None:
    line = 'targets: [{pattern: "*", quantity: tip_x_mm, value: 4, tolerance_mm: 1}]'
    found = problems(read, VARY, line, base="twenty_unit")
    assert "a pattern that at most 4,096 states match" in found[0]


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("constraints: [min_barier_mJ > 1]", "the nearest is min_barrier_mJ"),
        ("constraints: [n_reachable > 1]", "the base has no pressure"),
        ("constraints: [aperture_min_mm > 1]", "the base has no gripper"),
        ("constraints: [squeeze_max_N > 1]", "the base has no object"),
        ("constraints: [reach_max_mm]", "a comparison, such as min_barrier_mJ > 1"),
        ("constraints: [reach_max_mm > ]", "expected a comparison"),
        ("constraints: [3]", "a comparison, such as"),
        ("minimize: [mass_g]", 'a column of designs, or a key, found "mass_g" (the nearest is '),
        ("minimize: [reach_min_mm]\nmaximize: [reach_min_mm]", "each objective once"),
        ("minimize: [[1]]", "expected a column of designs, or a key, found a list of 1"),
        ("minimise: [reach_min_mm]", "did you mean minimize?"),
        ("targets: []", "one or more of targets, constraints, minimize, maximize, found none"),
        ("targets: 3", "expected a list of targets, found 3"),
    ],
)
def test_mistakes_in_what_is_asked_of_maps(read: Read, line: str, said: str) -> None:
    found = problems(read, VARY, line)
    assert any(said in problem for problem in found), found


@pytest.mark.parametrize(
    ("rules", "are_contradictory"),
    [
        ("reach_max_mm > 60, reach_max_mm < 50", True),
        ("60 < reach_max_mm, 50 >= reach_max_mm", True),
        ("reach_max_mm > 60, reach_max_mm < 60", True),
        ("reach_max_mm >= 60, reach_max_mm <= 60", False),
        ("reach_max_mm > 60, reach_min_mm < 50", False),
        ("reach_max_mm > 40, reach_max_mm < 50", False),
    ],
)
def test_constraints_that_contradict_are_both_named(
    read: Read, rules: str, are_contradictory: bool
) -> None:
    line = f"constraints: [{rules}]"
    if not are_contradictory:
        assert len(read(VARY, line).goal.constraints) == 2
        return
    first, second = rules.split(", ")
    assert f"found {second} beside {first}" in problems(read, VARY, line)[0]


def test_mistakes_of_goal_and_base_come_together(read: Read, tmp_path: Path) -> None:
    (tmp_path / "bad.yaml").write_text("finger: {units: 0}\n")
    path = tmp_path / "goal.yaml"
    path.write_text(f"base: bad.yaml\n{VARY}\ntarget: []\n")
    with pytest.raises(SpecError) as caught:
        read_goal(path)
    keys = [problem.key for problem in caught.value.problems]
    assert {"target", "finger.units"} <= {*keys}


def test_specs_and_sweeps_are_told_apart() -> None:
    with pytest.raises(SpecError, match=r"found a spec \(dpg predict takes it\)"):
        read_goal(CONFIGS / "three_unit.yaml")
    with pytest.raises(SpecError, match=r"found a sweep \(dpg sweep takes it\)"):
        read_goal(CONFIGS / "sweeps" / "height_separation.yaml")


def test_settings_change_the_base_but_not_what_varies(read: Read) -> None:
    assert read(VARY, TARGET, settings=("finger.units=4",)).goal.base.units == 4
    with pytest.raises(SpecError, match="a key that the space leaves alone"):
        read(VARY, TARGET, settings=(f"{HEIGHT}=5",))


def test_combinations_may_be_more_than_can_be_tried(read: Read) -> None:
    keys = ("dome_height_mm", "unit_separation_mm", "chamber_length_mm")
    values = ", ".join(f"{4 + k / 100}" for k in range(11))
    lines = [f"  finger.geometry.{key}: [{values}]" for key in keys]
    assert read("vary:", *lines, TARGET).goal.n_choices == 1331


@pytest.mark.parametrize(
    ("rules", "said"),
    [
        ("reach_min_mm > 60, reach_max_mm < 50", "found reach_max_mm < 50 beside reach_min_mm > 6"),
        ("reach_max_mm < 50, reach_min_mm >= 50", "found reach_min_mm >= 50 beside reach_max_mm"),
        ("n_distinct_tips > 8, n_stable <= 8", "found n_stable <= 8 beside n_distinct_tips > 8"),
        ("dome_height_mm > 8", "a constraint that can hold: dome_height_mm is from 4.5 to 7.5"),
        ("4 > dome_height_mm", "a constraint that can hold: dome_height_mm is from 4.5 to 7.5"),
        ("n_stable < 0", "a constraint that can hold: n_stable is 0 or more"),
        ("5 < reach_min_mm < 4", "a constraint that can hold"),
    ],
)
def test_what_no_design_can_meet_is_refused(read: Read, rules: str, said: str) -> None:
    (problem,) = problems(read, VARY, f"constraints: [{', '.join(rules.split(', '))}]")
    assert said in problem


@pytest.mark.parametrize(
    "rules",
    [
        "reach_min_mm < 30, min_barrier_mJ > 1000",  # who knows
        "reach_min_mm > 50, reach_max_mm > 50",
        "reach_min_mm >= 50, reach_max_mm <= 50",
        "dome_height_mm >= 7.5",
        "dome_height_mm > 7 or dome_height_mm < 5, dome_height_mm < 6",
        "reach_min_mm * reach_min_mm < 0",
        "n_stable <= 0",
    ],
)
def test_what_some_design_may_meet_is_not(read: Read, rules: str) -> None:
    assert read(VARY, f"constraints: [{rules}]").goal.constraints
