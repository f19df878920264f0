"""Known states from CSV: every column, every message, and shapes by their points."""

import time
from pathlib import Path

import numpy as np
import pytest

from dpgcli.errors import SpecError
from dpgcli.files.known_states import read_states
from dpgcli.files.plausible_states import check_scale, states_of
from dpgcli.mechanics.finger import STUDY, uniform_finger

WHOLE = """\
# by finite elements
push2_N,pattern,tip_x_mm,tip_y_mm,chamber2_angle_rad,chamber3_angle_rad,opening1_mm,opening2_mm,push1_N,seconds
0,00,27.5,0.1,-0.001,-0.002,0.01,0.02,0,22
1.1,01,27,-3,-0.002,-0.26,0.03,3.4,0.1,23.5
0.2,10,26,-6,-0.25,-0.27,3.5,0.04,1.2,
"""
HEAD = "pattern,x_mm,y_mm\n"
SHAPES = """\
pattern,x_mm,y_mm
10,0,0
01,0,0.5
10,9,-1
10,20,-5
01,25,-2
"""


@pytest.fixture
def write(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def to_file(text, name="states.csv"):
        path = Path(name)
        if isinstance(text, bytes):
            path.write_bytes(text)
        else:
            path.write_text(text, encoding="utf-8")
        return path

    return to_file


@pytest.fixture
def problems(write):
    """The problems of a file of states, and of one of shapes."""

    def of(text, shapes=None, n_units=2):
        with pytest.raises(SpecError) as caught:
            read_states(write(text), n_units, shapes and write(shapes, "shapes.csv"))
        return [str(problem) for problem in caught.value.problems]

    return of


def test_every_column_whatever_their_order(write):
    known = read_states(write(WHOLE), 2)
    assert known.patterns.tolist() == [[False, False, True], [False, True, False]]
    assert known.tip.tolist() == [[27.5, 27, 26], [0.1, -3, -6]]
    assert known.angles.tolist() == [[-0.001, -0.002, -0.25], [-0.002, -0.26, -0.27]]
    assert known.openings.tolist() == [[0.01, 0.03, 3.5], [0.02, 3.4, 0.04]]
    assert known.pushes.tolist() == [[0, 0.1, 1.2], [0, 1.1, 0.2]]
    assert known.seconds[:2].tolist() == [22, 23.5] and np.isnan(known.seconds[2])
    assert known.shapes == ()


def test_what_is_not_there_is_not_known(write):
    known = read_states(write("pattern,tip_x_mm,tip_y_mm\n10,26,-6\n"), 2)
    assert known.tip.tolist() == [[26], [-6]]
    for unknown in (known.angles, known.openings, known.pushes, known.seconds):
        assert np.isnan(unknown).all()
    assert known.angles.shape == known.openings.shape == known.pushes.shape == (2, 1)


def test_a_gap_in_a_column_is_not_known(write):
    known = read_states(write("pattern,tip_x_mm,tip_y_mm,push1_N\n10,26,,\n01,,-3,0.5\n"), 2)
    assert np.isnan(known.tip).tolist() == [[False, True], [True, False]]
    assert np.isnan(known.pushes).tolist() == [[True, False], [True, True]]


@pytest.mark.parametrize("n_units", [1, 2])
def test_the_tips_angle_is_that_of_the_last_phalanx(write, n_units):
    pattern = "1" * n_units
    last = f"chamber{n_units + 1}_angle_rad"
    alone = read_states(write(f"pattern,tip_angle_rad\n{pattern},-0.5\n"), n_units)
    assert alone.angles[-1].tolist() == [-0.5]
    named = read_states(write(f"pattern,{last}\n{pattern},-0.4\n"), n_units)
    assert named.angles[-1].tolist() == [-0.4]
    both = f"pattern,{last},tip_angle_rad\n{pattern},-0.4,-0.5\n{'0' * n_units},-0.1,\n"
    assert read_states(write(both), n_units).angles[-1].tolist() == [-0.5, -0.1]


def test_one_coordinate_of_tips_is_said_not_to_be_used(write):
    known = read_states(write("pattern,tip_y_mm,tip_angle_rad\n10,-6,-0.3\n"), 2)
    assert known.unused == ("tip_y_mm",)


def test_files_as_spreadsheets_write_them(write):
    text = "\ufeffpattern, tip_x_mm, tip_y_mm\r\n\r\n10, 26, -6\r\n"
    assert read_states(write(text), 2).tip.tolist() == [[26], [-6]]


def test_shapes_are_sorted_to_their_states(write):
    known = read_states(write(WHOLE), 2, write(SHAPES, "shapes.csv"))
    assert [shape.tolist() for shape in known.shapes] == [
        [[], []],
        [[0, 25], [0.5, -2]],
        [[0, 9, 20], [0, -1, -5]],
    ]
    chosen = known.chosen(np.array([2, 1]))
    assert [shape.shape for shape in chosen.shapes] == [(2, 3), (2, 2)]
    assert chosen.tip.tolist() == [[26, 27], [-6, -3]]


HEAD = "pattern,tip_x_mm,tip_y_mm\n"
TIPS = "tip_x_mm and tip_y_mm, or tip_angle_rad"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", ["file: expected a header and rows, found nothing"]),
        ("# nothing\n\n", ["file: expected a header and rows, found nothing"]),
        (HEAD, ["1: file: expected rows below the header, found none"]),
        (
            b"pattern\xff",
            ["1:8: file: expected text in UTF-8, found byte 0xff (save the file as UTF-8)"],
        ),
        (
            "patern,tip_x_mm,tip_y_mm\n10,1,2\n",
            ["header: expected a column pattern, found patern, tip_x_mm, tip_y_mm (is it patern?)"],
        ),
        (
            "pattern;tip_x_mm;tip_y_mm\n10;1.5;2\n01;1,5;2\n",
            ['3: tip_x_mm: expected a number, found "1,5" (write a decimal point)'],
        ),
        ("pattern\n10\n", [f"header: expected a column {TIPS}, found pattern"]),
        (
            "pattern,tip_x_mm\n10,3\n",
            [f"header: expected a column {TIPS}, found pattern, tip_x_mm"],
        ),
        (
            "pattern,pattern,tip_angle_rad\n10,10,1\n",
            ['1: header: expected each column once, found "pattern" again'],
        ),
        (HEAD + "10,1\n", ["2: row: expected 3 cells, found 2"]),
        (
            HEAD + "10,1,2\n10,1,2\n",
            [
                "3: pattern: expected each pattern once, or once for each moment_N_mm, "
                "found 10 for the second time"
            ],
        ),
        (
            HEAD + "1,1,2\n101,1,2\n12,1,2\n,1,2\n10,1,2\n",
            [
                "2: pattern: expected 2 digits 0 and 1, found '1'",
                "3: pattern: expected 2 digits 0 and 1, found '101'",
                "4: pattern: expected 2 digits 0 and 1, found '12'",
                "5: pattern: expected 2 digits 0 and 1, found ''",
            ],
        ),
        (
            HEAD + "10,left,nan\n01,1e300,inf\n",
            [
                '2: tip_x_mm: expected a number, found "left"',
                '2: tip_y_mm: expected a number, found "nan"',
                '3: tip_x_mm: expected a number from -1e+12 to 1e+12, found "1e300" '
                "(is the unit another one?)",
                '3: tip_y_mm: expected a number, found "inf"',
            ],
        ),
        (
            WHOLE.replace("22", "fast").replace("3.4", "far").replace("1.2", "1,2"),
            ["5: row: expected 10 cells, found 11"],
        ),
        (
            WHOLE.replace("22", "fast").replace("3.4", "far").replace("-0.25", "-90°"),
            [
                '3: seconds: expected a number, found "fast"',
                '4: opening2_mm: expected a number, found "far"',
                '5: chamber2_angle_rad: expected a number, found "-90°"',
            ],
        ),
    ],
)
def test_what_is_wrong_with_states(problems, text, said):
    found = problems(text)
    assert [problem.removeprefix("states.csv:").strip() for problem in found] == said


@pytest.mark.parametrize(
    ("shapes", "said"),
    [
        (
            "pattern,x_mm\n10,1\n",
            ["header: expected a column y_mm, found pattern, x_mm (is it x_mm?)"],
        ),
        (
            SHAPES + "11,0,0\n11,1,1\n",
            ["7: pattern: expected a pattern of the known states, found '11'"],
        ),
        (SHAPES + "00,0,0\n", ["7: pattern: expected 2 points or more of it, found one"]),
        (SHAPES.replace("9,-1", "9,"), ['4: y_mm: expected a number, found ""']),
        (
            SHAPES + "1,0,0\n",
            [
                "7: pattern: expected 2 digits 0 and 1, found '1'",
            ],
        ),
    ],
)
def test_what_is_wrong_with_shapes(problems, shapes, said):
    found = problems(WHOLE, shapes)
    assert [problem.removeprefix("shapes.csv:").strip() for problem in found] == said


def test_a_file_that_is_not_there_or_no_file(tmp_path):
    for path, said in (
        (tmp_path / "no.csv", "expected a readable file, found no such file"),
        (tmp_path, "expected a file, found a directory"),
    ):
        with pytest.raises(SpecError, match=said):
            read_states(path, 2)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("pattern,tip_x_mm,tip_y_mm\n11,0.026,-0.006\n", "the farthest at 0.0267"),
        ("pattern,tip_x_mm,tip_y_mm\n11,0.026,-0.006\n", "(meters?)"),
        ("pattern,tip_x_mm,tip_y_mm\n11,26000,-6000\n", "(micrometers?)"),
        ("pattern,tip_angle_rad\n11,-34.7\n", "units in rad, found 34.7 (degrees?)"),
    ],
)
def test_other_units_are_recognized(write, text, said):
    path = write(text)
    with pytest.raises(SpecError) as error:
        check_scale(path, read_states(path, 2), 27.0)
    assert said in str(error.value)


def test_tips_of_a_finger_pass_in_any_frame(write):
    path = write("pattern,tip_x_mm,tip_y_mm,tip_angle_rad\n11,126,-6,-0.6\n00,,,\n")
    check_scale(path, read_states(path, 2), 27.0)


def test_columns_that_are_not_used_are_named(write):
    text = "pattern,tip_x_mm,openning1_mm,tip_y_mm,opening3_mm\n11,26,3,-6,3\n"
    assert read_states(write(text), 2).unused == ("openning1_mm", "opening3_mm")


def test_wrong_patterns_do_not_hide_wrong_numbers(problems):
    found = problems("pattern,tip_x_mm,tip_y_mm\n12,1,2\n10,left,3\n")
    assert [said.split(":")[1] for said in found] == ["2", "3"]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("pattern,tip_x_mm,tip_y_mm\n10,,\n", "expected something known of a state, found empty"),
        (
            "pattern,tip_x_mm,tip_y_mm,seconds\n10,20,-3,0\n",
            ":2: seconds: expected a time > 0, found 0",
        ),
    ],
)
def test_data_that_say_nothing(problems, text, said):
    (found,) = problems(text)
    assert said in found


def test_shapes_in_another_unit(write):
    tips = write("pattern,tip_x_mm,tip_y_mm\n10,26,-3\n")
    shapes = write("pattern,x_mm,y_mm\n10,0,0\n10,0.026,-0.003\n", "shapes.csv")
    with pytest.raises(SpecError, match=r"x_mm: expected shapes of a finger .* \(meters\?\)"):
        check_scale(tips, read_states(tips, 2, shapes), 27.0)


def test_more_states_than_can_be_solved_at_once_are_refused(problems, monkeypatch):
    monkeypatch.setattr("dpgcli.files.known_states.MOST_UNITS", 4)
    (problem,) = problems(WHOLE)
    assert problem.endswith("expected at most 2 states of 2 units, found 3 (a part at a time)")


def test_many_states_and_many_points_are_read_in_time(write):
    """Each row once, not once for each other."""
    patterns = [f"{code:014b}" for code in range(0, 2**14, 2)]
    states = "".join(f"{pattern},1,2\n" for pattern in patterns)
    points = "".join(f"{pattern},{x},0\n" for x in range(4) for pattern in patterns)
    files = (
        write(f"pattern,tip_x_mm,tip_y_mm\n{states}"),
        write(f"pattern,x_mm,y_mm\n{points}", "s.csv"),
    )
    began = time.process_time()
    known = read_states(files[0], 14, files[1])
    assert time.process_time() - began < 5
    assert [shape.tolist() for shape in known.shapes] == [[[0, 1, 2, 3], [0] * 4]] * 2**13


def test_shapes_are_those_of_states_without_a_moment(write):
    states = "pattern,moment_N_mm,tip_x_mm,tip_y_mm\n00,0,27,0\n00,5,,\n"
    known = read_states(write(states), 2, write("pattern,x_mm,y_mm\n00,0,0\n00,27,0\n", "s.csv"))
    assert [shape.shape for shape in known.shapes] == [(2, 2), (2, 0)]


CENTIMETERS = pytest.mark.parametrize("factor", [0.1, 10.0])
STATES = {"pattern": ["00", "11"], "tip_x_mm": [27.0, 22.0], "tip_y_mm": [0.0, -9.0]}


@CENTIMETERS
def test_openings_in_centimeters(factor):
    finger = uniform_finger(2, **STUDY)
    opened = {"opening1_mm": [0.0, 3.4 * factor], "opening2_mm": [0.0, 3.5 * factor]}
    with pytest.raises(SpecError, match=r"opening1_mm: expected openings .* about 3.5, found"):
        states_of(finger, STATES | opened)
    under = {"moment_N_mm": [0.0, 1.0]}  # which opens it as far as it may be
    assert states_of(finger, STATES | opened | under).openings.max() == 3.5 * factor


@CENTIMETERS
def test_shapes_in_centimeters(factor):
    points = {"x_mm": [0.0, 13 * factor, 27 * factor], "y_mm": [0.0, 0.1, 0.2]}
    shapes = {"pattern": ["00"] * 3} | points
    with pytest.raises(SpecError, match=r"x_mm: expected layers .* about 27, found"):
        states_of(uniform_finger(2, **STUDY), STATES, shapes)


@pytest.mark.parametrize("factor", [0.25, 1.0, 4.0])
def test_openings_and_shapes_of_other_fingers_pass(factor):
    opened = {"opening1_mm": [0.0, 3.4 * factor]}
    points = {"x_mm": [0.0, 27 * factor], "y_mm": [0.0, 0.1]}
    states_of(uniform_finger(2, **STUDY), STATES | opened, {"pattern": ["00"] * 2} | points)
