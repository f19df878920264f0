"""Sketches of braille: dots where the finger is, within their lines."""

from pathlib import Path

import numpy as np
import pytest

import dpgcli as dpg
from dpgcli.reports.sketch import BLANK, braille

CONFIGS = Path(__file__).parents[2] / "configs"


def n_dots(text: str) -> int:
    return sum((ord(letter) - BLANK).bit_count() for letter in text if ord(letter) >= BLANK)


def sketch(name: str, *patterns: str, width: int = 80) -> str:
    return dpg.predict(CONFIGS / f"{name}.yaml", patterns=patterns).sketch(width)


def test_every_dot_has_its_place() -> None:
    """Bits of Unicode's braille patterns: columns of three dots, then the lowest row."""
    numbers = [[1, 4], [2, 5], [3, 6], [7, 8]]
    for row, column in np.ndindex(4, 2):
        dots = np.zeros((4, 2), bool)
        dots[row, column] = True
        assert braille(dots) == [chr(BLANK + 2 ** (numbers[row][column] - 1))]
    assert braille(np.zeros((8, 4), bool)) == ["  ", "  "]


def test_a_straight_finger_is_flat_and_a_curled_one_goes_down() -> None:
    straight, curled = (sketch("three_unit", pattern).splitlines() for pattern in ("000", "111"))
    assert (straight[0], curled[0]) == ("000", "111")
    assert len(curled) > len(straight)
    assert n_dots(straight[-1]) > 20  # the layer and the floors


def test_inverted_units_are_filled() -> None:
    """At one scale: each fills some forty dots more than its outline has."""
    blocks = sketch("three_unit", width=18).split("\n\n")
    assert [block[:3] for block in blocks[:2]] == ["000", "001"]
    counts = {block[:3]: n_dots(block) for block in blocks}
    by_inverted = [np.mean([counts[p] for p in counts if p.count("1") == n]) for n in range(4)]
    assert np.diff(by_inverted).min() > 20


@pytest.mark.parametrize("width", [1, 5, 17, 40, 80, 200])
@pytest.mark.parametrize("name", ["three_unit", "gripper"])
def test_lines_are_no_longer_than_asked_for(name: str, width: int) -> None:
    lines = sketch(name, "1*1", width=width).splitlines()
    longest = max(5 if name == "gripper" else 3, width)  # a pattern is not cut
    assert max(map(len, lines)) <= longest
    assert n_dots("".join(lines)) > 4
    assert not any(line != line.rstrip() for line in lines)


def test_more_room_has_more_sketches_beside_each_other() -> None:
    heads = [sketch("three_unit", width=width).splitlines()[0].split() for width in (20, 40, 80)]
    assert heads == [["000"], ["000", "001"], ["000", "001", "010", "100"]]


def test_a_state_that_is_not_stable_is_a_word() -> None:
    settings = {"finger.geometry.dome_height_mm": 4.2, "finger.geometry.dome_thickness_mm": 0.4}
    spec = CONFIGS / "three_unit.yaml"
    both = dpg.predict(spec, settings=settings, patterns=("000", "111")).sketch()
    assert both.splitlines()[1].endswith(" not_bistable")
    assert n_dots(both) > 50
    lost = dpg.predict(spec, settings=settings, patterns="111")
    assert lost.sketch() == "111\nnot_bistable"
