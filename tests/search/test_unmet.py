"""What is said of goals that are not met: bounds in the way, and wishes that contradict."""

import re
from collections.abc import Callable
from dataclasses import replace

import pytest

from dpgcli.search.goal import Goal, Range
from dpgcli.search.search import search
from dpgcli.search.unmet import Standing

Make = Callable[..., Goal]
HEIGHT, SEPARATION = "finger.geometry.dome_height_mm", "finger.geometry.unit_separation_mm"
FAR = "targets: [{pattern: '11100', quantity: tip, value: [40, -45], tolerance_mm: 0.5}]\n"
TWO = f"vary: {{{HEIGHT}: {{from: 4.5, to: 6.5}}, {SEPARATION}: {{from: 2.5, to: 4}}}}\n"


def standing(made: Goal) -> Standing:
    return Standing(made, search(made).best, ["mm"] * len(made.targets))


def test_the_bound_in_the_way_is_named_with_what_would_relax_it(goal: Make) -> None:
    """A search with that bound moved misses about as much as was said."""
    made = goal(TWO + FAR)
    here = standing(made)
    lines = list(here.lines())
    assert lines[0].startswith("target 1 (tip of 11100) is missed by ")
    said = re.search(
        r"in the way: (\w+) [<>]= [\d.]+; with ([\d.]+) .* about ([\d.]+) mm", lines[1]
    )
    assert said is not None
    name, end, about = said[1], float(said[2]), float(said[3])
    assert name in here.active
    ranges = [
        Range(r.key, min(r.low, end), max(r.high, end)) if r.key.endswith(name) else r
        for r in made.ranges
    ]
    moved = search(replace(made, ranges=tuple(ranges))).best
    less = moved.misses(made)[0, 0] * 0.5
    before = here.design.misses(made)[0, 0] * 0.5
    assert less < before
    assert about == pytest.approx(less, abs=0.3 * (before - less))


def test_targets_that_contradict_are_both_named(goal: Make) -> None:
    two = (
        "targets:\n"
        "  - {pattern: '111', quantity: tip_y_mm, value: -10, tolerance_mm: 0.5}\n"
        "  - {pattern: '110', quantity: tip_y_mm, value: -20, tolerance_mm: 0.5}\n"
    )
    lines = list(standing(goal(TWO + two, base="three_unit")).lines())
    pair = "target 1 (tip_y_mm of 111) and target 2 (tip_y_mm of 110)"
    assert any(line.startswith(f"{pair} pull against each other") for line in lines)


def test_constraints_that_contradict_are_both_named(goal: Make) -> None:
    lines = "constraints: [min_barrier_mJ > 2.5, reach_min_mm > 75]\n"
    here = standing(goal(TWO + lines))
    said = list(here.lines())
    assert any(" does not hold: it lacks " in line for line in said)
    assert any("min_barrier_mJ > 2.5 and reach_min_mm > 75" in line or
               "reach_min_mm > 75 and min_barrier_mJ > 2.5" in line for line in said)  # fmt: skip


def test_nothing_is_said_where_all_is_met(goal: Make) -> None:
    near = "targets: [{pattern: '11100', quantity: tip, value: [55, -36], tolerance_mm: 9}]\n"
    here = standing(goal(TWO + near))
    assert list(here.lines()) == []


def test_active_constraints_are_named(goal: Make) -> None:
    made = goal(TWO + "constraints: [min_barrier_mJ > 1]\nminimize: [dome_height_mm]")
    assert standing(made).active == "unit_separation_mm >= 2.5, min_barrier_mJ > 1"


def test_what_constraints_lack_has_their_unit(goal: Make) -> None:
    lines = (
        "constraints: [min_barrier_mJ > 100, dome_height_mm - unit_separation_mm > 40, "
        "reach_min_mm * dome_height_mm > 1.0e+6]\n"
    )
    said = "\n".join(standing(goal(TWO + lines)).lines())
    assert re.search(r"min_barrier_mJ > 100 does not hold: it lacks [\d.]+ mJ$", said, re.M)
    assert re.search(r"unit_separation_mm > 40 does not hold: it lacks [\d.]+ mm$", said, re.M)
    assert re.search(r"1000000.0 does not hold: it lacks [\d.e+]+$|6 does not hold: it lacks", said)


def test_a_constraint_at_zero_is_active_at_its_limit(goal: Make) -> None:
    """Where what it is about is as good as nothing, its own size says nothing."""
    rule = "aperture_min_mm >= 0"
    lines = TWO + f"constraints: [{rule}]\nminimize: [aperture_min_mm]"
    assert standing(goal(lines, "finger.units=4", base="gripper")).active == rule
