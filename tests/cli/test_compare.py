"""`dpg compare`: errors, messages and a figure, on the finite-element finger of the examples."""

import json
import math
from pathlib import Path
from typing import Any

import pytest

from dpgcli.cli.exits import ExitCode

pytestmark = pytest.mark.slow

EXAMPLES = Path(__file__).parents[2] / "configs" / "calibration"
NAMES = ("three_gap_finger.yaml", "three_gap_finger.csv", "push_3.5mm.yaml")
FRAME = ("--first-station", "5.375,0.75", "--tip-offset", "5.375,-0.75")


@pytest.fixture
def arguments(folder: Path) -> tuple[str, ...]:
    for name in NAMES:
        (folder / name).write_bytes((EXAMPLES / name).read_bytes())
    return ("compare", *NAMES[:2], *FRAME)


def rows(text: str) -> dict[str, dict[str, Any]]:
    return {row["pattern"]: row for row in json.loads(text)}


def test_the_published_lever_curls_the_finite_element_finger_too_far(
    call: Any, arguments: tuple[str, ...]
) -> None:
    result = call(*arguments, "--format", "json")
    assert result.exit_code == ExitCode.DONE
    found = rows(result.stdout)
    assert found["000"]["error_mm"] < 0.01
    assert found["000"]["error_percent"] is None
    assert 23.0 < found["110"]["error_percent"] < 25.0
    assert found["110"]["tip_y_mm"] < found["110"]["known_y_mm"], "it curls further"
    assert "5 states, errors of the model (push-only law" in result.stderr
    assert "tips 4.06 mm at worst" in result.stderr
    assert "23.8 % at worst" in result.stderr
    assert "22.5 s a state in the data" in result.stderr


def test_each_opened_gap_turns_by_a_quarter_too_much(call: Any, arguments: tuple[str, ...]) -> None:
    """2 asin(3.485/21.5) = 0.326 rad in the lattice where finite elements have 0.264."""
    found = rows(call(*arguments, "--format", "json", "-q").stdout)
    assert found["100"]["angle_error_rad"] == pytest.approx(0.3257 - 0.2638, abs=5e-4)
    assert found["110"]["angle_error_rad"] == pytest.approx(0.6513 - 0.5242, abs=5e-4)


def test_another_lever_is_nearer(call: Any, arguments: tuple[str, ...]) -> None:
    def worst(*settings: str) -> float:
        found = rows(call(*arguments, "--format", "json", "-q", *settings).stdout)
        return max(row["angle_error_rad"] for row in found.values())

    lever = ("-s", "finger.geometry=null", "-s", "finger.lattice.segment_height_mm=13.2")
    assert worst(*lever) < 0.25 * worst()


def test_a_table_for_people(call: Any, arguments: tuple[str, ...]) -> None:
    result = call(*arguments, "-q")
    assert result.stderr == ""
    head, *lines = result.stdout.splitlines()
    assert head.split()[:3] == ["pattern", "status", "tip_x_mm"]
    assert [line.split()[0] for line in lines] == ["000", "001", "010", "100", "110"]
    assert " - " in lines[0], "no percentage of no deflection"


def test_a_figure(call: Any, arguments: tuple[str, ...], folder: Path) -> None:
    assert call(*arguments, "--plot", "c.svg", "-q").exit_code == ExitCode.DONE
    figure = (folder / "c.svg").read_text()
    for text in ("x (mm)", "y (mm)", "known tip", "110"):
        assert text in figure


def test_states_that_do_not_exist_are_said(call: Any, arguments: tuple[str, ...]) -> None:
    published = ("law=published", "calibration=null", "lattice.bistable_stiffness_N_per_mm=12.84")
    settings = [f"finger.{text}" for text in (*published, "lattice.force_linearity=0.9")]
    result = call(*arguments, *(word for text in settings for word in ("-s", text)))
    assert result.exit_code == ExitCode.DONE
    assert "4 states of the data do not exist in the lattice" in result.stderr
    assert "not_bistable" in result.stdout


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--tip-offset", "5"), "--tip-offset 5: expected two numbers in mm"),
        (("--first-station", "a,b"), "--first-station a,b: expected two numbers in mm"),
        (("--first-station", "1_0,0"), "--first-station 1_0,0: expected two numbers in mm"),
        (("--tip-offset", "１,0"), "--tip-offset １,0: expected two numbers in mm"),
        (("--first-station", "nan,0"), "--first-station nan,0: expected two numbers in mm"),
        (("--plot", "c.pdf"), "expected a name that ends in .svg or .png"),
        (("--plot", "none/c.svg"), "cannot write none/c.svg"),
        (("-s", "finger.units=2"), "three_gap_finger.csv:11: pattern: expected 2 digits 0 and 1"),
    ],
)
def test_what_makes_no_sense(
    call: Any, arguments: tuple[str, ...], options: tuple[str, ...], said: str
) -> None:
    result = call(*arguments, *options)
    assert result.exit_code == ExitCode.USAGE
    assert said in result.stderr
    assert result.stdout == ""


PHALANGES = """\
pattern,tip_x_mm,tip_y_mm,chamber2_angle_rad,chamber3_angle_rad,chamber4_angle_rad,\
opening1_mm,opening2_mm,opening3_mm,push1_N,push2_N,push3_N
000,51.99976,-0.00817,-0.000108,-0.000218,-0.000297,0.00106,0.00108,0.00078,0,0,0
100,50.46532,-10.33568,-0.254171,-0.263880,-0.263758,3.47723,0.07211,-0.00072,1.1384,0,0
110,47.71870,-16.52155,-0.261822,-0.515066,-0.524182,3.47767,3.47778,0.06827,1.1163,1.1110,0
"""
LEVER = """\
calibration_version: 1
made_by: hand
method: none
values: {segment_height_mm: {value: 12.33}}
"""


@pytest.fixture
def published(study: tuple[str, str]) -> tuple[str, ...]:
    """The same finger with the study's springs, of which tips are known."""
    return ("compare", *study, *FRAME)


@pytest.fixture
def lever(folder: Path) -> str:
    (folder / "lever.yaml").write_text(LEVER)
    return "lever.yaml"


@pytest.fixture
def phalanges(published: tuple[str, ...], folder: Path) -> tuple[str, ...]:
    """The comparison with a file that has angles, openings and pushes, too."""
    (folder / "phalanges.csv").write_text(PHALANGES)
    return (*published[:2], "phalanges.csv", *published[3:])


def test_angles_openings_and_pushes_are_held_against_the_lattices(
    call: Any, phalanges: tuple[str, ...]
) -> None:
    """By one unit of the study with a rigid frame: x = 3.2450 mm, turn 0.3030 rad, where the
    hinge's moment over the lever H cos(turn/2) is the push."""
    result = call(*phalanges, "--format", "json")
    found = rows(result.stdout)["100"]
    assert found["max_opening_error_mm"] == pytest.approx(3.47723 - 3.2450, abs=2e-3)
    assert found["max_angle_error_rad"] == pytest.approx(0.3030 - 0.254171, abs=1e-3)
    push = 24.2 * 0.3030 / (10.75 * math.cos(0.1515))
    assert found["max_push_error_N"] == pytest.approx(abs(1.1384 - push), abs=0.01)
    assert "openings " in result.stderr and "pushes " in result.stderr
    assert "times as long" not in result.stderr, "these data say no times"
    assert "max_shape_error_mm" not in found


def test_data_without_them_have_no_such_columns(call: Any, published: tuple[str, ...]) -> None:
    found = rows(call(*published, "--format", "json", "-q").stdout)["100"]
    assert [name for name in found if "error" in name] == [
        "error_mm",
        "error_percent",
        "angle_error_rad",
    ]


def test_both_errors_with_a_calibration(call: Any, published: tuple[str, ...], lever: str) -> None:
    result = call(*published, "--calibration", lever, "--format", "json")
    found = rows(result.stdout)
    plain = rows(call(*published, "--format", "json", "-q").stdout)
    other = ("-s", "finger.lattice.segment_height_mm=12.33")
    better = rows(call(*published, *other, "--format", "json", "-q").stdout)
    assert found and found.keys() == better.keys()
    for pattern, row in found.items():
        for name in ("error_mm", "error_percent", "angle_error_rad"):
            assert row[name] == plain[pattern][name]
            assert row[f"calibrated_{name}"] == better[pattern][name]
    assert max(row["calibrated_error_percent"] or 0.0 for row in found.values()) < 8.0
    assert "(as in the spec, published law, pushing and pulling)" in result.stderr
    assert "(calibrated, published law, pushing and pulling)" in result.stderr


def test_a_spec_that_refers_to_the_file_is_as_good(
    call: Any, published: tuple[str, ...], lever: str
) -> None:
    beside = rows(call(*published, "--calibration", lever, "--format", "json", "-q").stdout)
    within = ("-s", f"finger.calibration={lever}", "-s", "finger.lattice.segment_height_mm=null")
    found = rows(call(*published, *within, "--format", "json", "-q").stdout)
    assert {p: row["error_mm"] for p, row in found.items()} == {
        p: row["calibrated_error_mm"] for p, row in beside.items()
    }


def test_shapes_are_held_against_the_layer(
    call: Any, published: tuple[str, ...], folder: Path
) -> None:
    """The straight finger's layer is 0.75 mm below its stations; its points are off by 0.2 mm."""
    (folder / "shapes.csv").write_text(
        "pattern,x_mm,y_mm\n000,0,0\n000,20,0.2\n000,40,-0.2\n000,51,0\n"
    )
    result = call(*published, "--shapes", "shapes.csv", "--format", "json")
    found = rows(result.stdout)
    assert found["000"]["max_shape_error_mm"] == pytest.approx(0.2, abs=1e-9)
    rms = math.sqrt(2 * 0.2**2 / 4)
    assert found["000"]["rms_shape_error_mm"] == pytest.approx(rms, abs=1e-9)
    assert found["110"]["max_shape_error_mm"] is None
    assert "shapes 0.2 mm at worst" in result.stderr


def test_a_figure_of_both(call: Any, published: tuple[str, ...], lever: str, folder: Path) -> None:
    names = ("one.svg", "both.svg", "again.svg")
    with_file = ("--calibration", lever)
    for name, options in zip(names, ((), with_file, with_file), strict=True):
        assert call(*published, *options, "--plot", name, "-q").exit_code == ExitCode.DONE
    one, both, again = ((folder / name).read_bytes() for name in names)
    assert both == again
    assert len(both) > len(one)
    assert b"calibrated" in both and b"calibrated" not in one


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (
            None,
            '--calibration cal.yaml: expected "published", "finite_elements" or the name of a '
            "calibration file, found no such file",
        ),
        ("", "cal.yaml:1:1: document: expected a mapping of keys to values, found nothing"),
        (LEVER.replace("12.33", "-12"), "cal.yaml:4:30: values.segment_height_mm.value: expected"),
        (
            LEVER.split("values")[0]
            + "grid: {method: interpolation, over: [dome_height_mm], "
            + "points: {dome_height_mm: [5, 6], stroke_mm: [2, 3]}}\n",
            "finger.lattice.stroke_mm: expected a value, or geometry with dome_height_mm",
        ),
    ],
)
def test_a_calibration_that_cannot_be_used(
    call: Any, published: tuple[str, ...], folder: Path, content: str | None, said: str
) -> None:
    if content is not None:
        (folder / "cal.yaml").write_text(content)
    result = call(*published, "--calibration", "cal.yaml")
    assert result.exit_code == ExitCode.USAGE
    assert said in result.stderr
    assert result.stdout == ""


def dome(height: float, stiffness: float) -> str:
    """A calibration with a curve, of a dome of this height (mm)."""
    travel = [0.1 * place for place in range(150)]
    energy = [stiffness * u**2 * (0.02 + (1.0 - u / 13.5) ** 2) for u in travel]
    data = {
        "calibration_version": 1,
        "made_by": "hand",
        "method": "none",
        "values": {
            "bistable_stiffness_N_per_mm": {"value": 2.0 * stiffness},
            "stroke_mm": {"value": 13.5},
        },
        "geometry": {
            "dome_height_mm": height,
            "dome_thickness_mm": 0.75,
            "unit_separation_mm": 3.0,
            "elastic_modulus_MPa": 26.0,
        },
        "curve": {"travel_mm": travel, "energy_mJ": energy, "opening_per_travel": 1.0},
    }
    return json.dumps(data)


@pytest.mark.parametrize("law", ["published", "tabulated", "push_only"])
@pytest.mark.parametrize(
    "changes",
    [
        (),
        ("finger.geometry.dome_height_mm=7",),
        ("finger.overrides.2.geometry.dome_height_mm=7",),
        ("finger.overrides.2.lattice.bistable_stiffness_N_per_mm=9",),
    ],
    ids=str,
)
def test_calibrated_is_what_a_spec_with_that_calibration_predicts(
    call: Any, folder: Path, changes: tuple[str, ...], law: str
) -> None:
    """Scaled to the geometry, unit by unit, with the file's own curve."""
    (folder / "tips.csv").write_text("pattern,tip_x_mm,tip_y_mm\n110,36,-15\n011,38,-8\n")
    (folder / "old.yaml").write_text(dome(6.5, 3.0))
    (folder / "new.yaml").write_text(dome(6.5, 2.0))
    calibrations = ("old.yaml, published", "new.yaml, old.yaml, published")
    settings = [("-s", f"finger.law={law}", *(w for c in changes for w in ("-s", c)))] * 2
    spec, plain = (
        (*words, "-s", f"finger.calibration=[{names}]")
        for words, names in zip(settings, calibrations, strict=True)
    )
    command = ("compare", "three_unit.yaml", "tips.csv", "--format", "json", "-q")
    result = call(*command, *spec, "--calibration", "new.yaml")
    if "bistable" in str(changes):
        plain = (*plain, "-s", "finger.overrides.2.lattice.bistable_stiffness_N_per_mm=null")
    expected = rows(call(*command, *plain).stdout)
    assert all(row["error_mm"] is not None for row in expected.values())
    found = rows(result.stdout)
    assert found and found.keys() == expected.keys()
    for pattern, row in found.items():
        assert row["calibrated_error_mm"] == expected[pattern]["error_mm"]
        assert row["calibrated_error_percent"] == expected[pattern]["error_percent"]


OWN = {  # what a spec says itself
    "finger.wall_compliance_mm_per_N": "0.2",
    "finger.lattice.segment_height_mm": "10.75",
    "finger.lattice.bistable_stiffness_N_per_mm": "9",
    "finger.lattice.hinge_stiffness_N_mm_per_rad": "20",
}
GIVEN = {"published": [*OWN][2:], "finite_elements": [*OWN]}  # of these, what a calibration has
KEPT = {"finger.geometry.chamber_length_mm": "null", "finger.lattice.segment_length_mm": "13.75"}
ALONE = {"finger.lattice.force_linearity": "0.1"}  # beside no calibration
BEFORE = ("", "published", "lever.yaml,published", "finite_elements")


def set_to(values: dict[str, str]) -> list[str]:
    return [word for key, value in values.items() for word in ("-s", f"{key}={value}")]


@pytest.mark.parametrize("law", ["", "published", "push_only"])
@pytest.mark.parametrize("before", BEFORE)
@pytest.mark.parametrize("name", ["published", "finite_elements"])
def test_names_that_are_built_in_are_what_a_spec_with_them_predicts(
    call: Any, folder: Path, lever: str, name: str, before: str, law: str
) -> None:
    """The law, too, where the spec has none; lattice values that the calibration has go."""
    assert lever == "lever.yaml"
    (folder / "tips.csv").write_text("pattern,tip_x_mm,tip_y_mm\n110,36,-15\n011,38,-8\n")
    own = OWN | KEPT | ({"finger.calibration": f"[{before}]"} if before else ALONE)
    said = own | ({"finger.law": law} if law else {})
    listed = f"[{name},{before}]" if before and name != "published" else name
    given = dict.fromkeys([*GIVEN[name], *ALONE], "null")
    other = said | given | {"finger.calibration": listed}
    without = ("-s", "finger.calibration=null")
    command = ("compare", "three_unit.yaml", "tips.csv", "--format", "json", *without)
    expected = call(*command, *set_to(other))
    result = call(*command, *set_to(said), "--calibration", name)
    found, wanted = rows(result.stdout), rows(expected.stdout)
    assert found.keys() == wanted.keys() == {"110", "011"}
    for pattern, row in found.items():
        assert row["calibrated_error_mm"] == wanted[pattern]["error_mm"] != row["error_mm"]
    words = expected.stderr.partition("errors of the model (")[2].partition(")")[0]
    assert f"(calibrated, {words})" in result.stderr


def test_names_in_the_spec_stay_relative_to_it(
    call: Any, folder: Path, published: tuple[str, ...], lever: str
) -> None:
    command, spec, *others = published
    text = (folder / spec).read_text().replace("finger:", f"finger:\n  calibration: {lever}", 1)
    (folder / "own").mkdir()
    (folder / lever).rename(folder / "own" / lever)
    (folder / "own" / spec).write_text(text)
    (folder / "new.yaml").write_text(dome(6.5, 2.0))
    result = call(command, f"own/{spec}", *others, "--calibration", "new.yaml")
    assert result.exit_code == ExitCode.DONE


def test_what_exists_by_the_calibration_alone_is_shown(call: Any, folder: Path) -> None:
    (folder / "tips.csv").write_text("pattern,tip_x_mm,tip_y_mm\n110,36,-15\n")
    soft = set_to({"finger.lattice.hinge_stiffness_N_mm_per_rad": "1e4"})
    command = ("compare", "three_unit.yaml", "tips.csv", "--format", "json")
    (row,) = rows(call(*command, *soft, "--calibration", "published").stdout).values()
    assert row["error_mm"] is None
    (plain,) = rows(call(*command).stdout).values()
    assert row["calibrated_error_mm"] == plain["error_mm"] > 0.0


def test_published_springs_have_no_curve(call: Any, folder: Path) -> None:
    (folder / "tips.csv").write_text("pattern,tip_x_mm,tip_y_mm\n110,36,-15\n")
    shipped = {"finger.calibration": "finite_elements", "finger.law": "tabulated"}
    command = ("compare", "three_unit.yaml", "tips.csv", *set_to(shipped))
    assert call(*command).exit_code == ExitCode.DONE
    result = call(*command, "--calibration", "published")
    assert result.exit_code == ExitCode.USAGE
    assert "finger.law: expected a calibration with a curve" in result.stderr
    assert "with --calibration published)" in result.stderr


def test_a_name_that_is_built_in_is_no_file(
    call: Any, folder: Path, published: tuple[str, ...], lever: str
) -> None:
    """As in a spec; a path that is spelled out is one."""
    (folder / "published").write_bytes((folder / lever).read_bytes())
    own, file = (
        rows(call(*published, "--calibration", name, "--format", "json", "-q").stdout)
        for name in ("./published", lever)
    )
    assert own == file
    result = call(*published, "--calibration", "published")
    assert result.exit_code == ExitCode.USAGE
    problems = result.stderr.splitlines()[:-1]
    assert all("with --calibration published)" in line for line in problems)
    assert any(
        "finger.lattice.bistable_stiffness_N_per_mm: expected a value, or geometry with dome_height"
        in line
        for line in problems
    )


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--tip-offset", "5,nan"), "--tip-offset 5,nan: expected two numbers in mm"),
        (("--tip-offset", "0,inf"), "--tip-offset 0,inf: expected two numbers in mm"),
        (("--tip-offset", "1e300,0"), "--tip-offset 1e300,0: expected two numbers in mm"),
        (("--tip-offset", "1,2,3"), "--tip-offset 1,2,3: expected two numbers in mm"),
        (("--shapes", "none.csv"), "none.csv: file: expected a readable file"),
        (("--shapes", "tips.csv"), "header: expected a column x_mm"),
        (("-s", "finger.law=tabulated"), "finger.law: expected a calibration with a curve"),
    ],
)
def test_what_else_makes_no_sense(
    call: Any, published: tuple[str, ...], options: tuple[str, ...], said: str
) -> None:
    result = call(*published, *options)
    assert result.exit_code == ExitCode.USAGE
    assert said in result.stderr
    assert result.stdout == ""


@pytest.mark.parametrize("law", ["published", "push_only"])
def test_the_law_is_named(call: Any, published: tuple[str, ...], law: str) -> None:
    result = call(*published, "-s", f"finger.law={law}")
    description = {"published": "published law", "push_only": "push-only law"}[law]
    assert f"errors of the model ({description}" in result.stderr


@pytest.fixture
def bare(folder: Path, arguments: tuple[str, ...]) -> Path:
    """The data of the examples without the frame in their header."""
    path = folder / NAMES[1]
    lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
    path.write_text("".join(line for line in lines if "_mm:" not in line), encoding="utf-8")
    return path


def test_a_frame_that_does_not_fit_is_said_with_what_would(call: Any, bare: Path) -> None:
    result = call("compare", *NAMES[:2])
    said = "warning: the frame does not fit: the straight state is off by 10.75 mm; --first-station"
    assert f"{said} 10.75,-0.00817 would bring that to zero, as would --tip-offset" in result.stderr
    mended = call("compare", *NAMES[:2], "--first-station", "10.75,-0.00817", "--format", "json")
    assert "does not fit" not in mended.stderr
    assert rows(mended.stdout)["000"]["error_mm"] < 1e-3
    part = call("compare", *NAMES[:2], "--first-station", "5,0", "--tip-offset", "2,0")
    assert "--first-station 8.75,-0.00817 would" in part.stderr
    assert "--tip-offset 5.75,-0.00817" in part.stderr


def test_tips_that_are_all_off_in_one_way_tell_of_the_frame(call: Any, bare: Path) -> None:
    lines = bare.read_text(encoding="utf-8").splitlines(keepends=True)
    bare.write_text("".join(line for line in lines if line[:3] != "000"), encoding="utf-8")
    result = call("compare", *NAMES[:2])
    assert "the frame does not fit: all tips are off in the same way, by 10.68 mm" in result.stderr
    assert "does not fit" not in call("compare", *NAMES[:2], *FRAME).stderr


def test_a_curl_that_is_wrong_is_not_blamed_on_the_frame(
    call: Any, arguments: tuple[str, ...]
) -> None:
    assert "does not fit" not in call(*arguments).stderr
    stroke = ("-s", "finger.lattice.stroke_mm=2")
    assert "does not fit" not in call(*arguments, *stroke).stderr


def test_the_frame_stands_in_the_header_of_the_data(
    call: Any, arguments: tuple[str, ...], folder: Path
) -> None:
    given, read = call(*arguments), call("compare", *NAMES[:2])
    assert read.stdout == given.stdout
    assert "first station 5.375,0.75 mm (from the data's header)" in read.stderr
    assert "first station 5.375,0.75 mm (as given)" in given.stderr
    other = call("compare", *NAMES[:2], "--first-station", "1,2")
    assert "first station 1,2 mm (as given), tip offset 5.375,-0.75 mm (from the" in other.stderr


def test_the_frame_stands_in_the_spec(call: Any, arguments: tuple[str, ...], bare: Path) -> None:
    spec = bare.parent / NAMES[0]
    frame = "data:\n  first_station_mm: [5.375, 0.75]\n  tip_offset_mm: [5.375, -0.75]\n"
    given = call(*arguments)
    spec.write_text(spec.read_text(encoding="utf-8") + frame, encoding="utf-8")
    read = call("compare", *NAMES[:2])
    assert read.stdout == given.stdout
    assert "tip offset 5.375,-0.75 mm (from the spec)" in read.stderr
    text = bare.read_text(encoding="utf-8")
    bare.write_text(f"# first_station_mm: 5, 1\n{text}", encoding="utf-8")
    assert "first station 5,1 mm (from the data's header)" in call("compare", *NAMES[:2]).stderr
    fit = ("fit", "finger", *NAMES[:2], "--format", "csv")
    assert call(*fit, *FRAME).stdout == call(*fit, "--first-station", "5.375,0.75").stdout


@pytest.mark.parametrize("said", ["5.375", "5.375, up", "5,3,1", "", "[5.375; 0.75]"])
def test_a_frame_that_is_none(call: Any, bare: Path, said: str) -> None:
    text = bare.read_text(encoding="utf-8")
    bare.write_text(f"# first_station_mm: {said}\n{text}", encoding="utf-8")
    result = call("compare", *NAMES[:2])
    assert result.exit_code == ExitCode.USAGE
    place = f"{bare.name}:1: first_station_mm: expected two numbers in mm, such as 5.375, -0.75"
    assert place in result.stderr


def test_a_fit_in_a_wrong_frame_says_so(call: Any, bare: Path) -> None:
    result = call("fit", "finger", *NAMES[:2])
    assert "warning: the frame does not fit: the straight state is off by 10.75 mm" in result.stderr
    assert "does not fit" not in call("fit", "finger", *NAMES[:2], *FRAME).stderr
