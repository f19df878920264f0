"""`dpg grasp` with jaws, polygons and files of bodies: rows, refusals."""

import json
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from dpgcli.cli.exits import ExitCode

CONFIGS = Path(__file__).parents[2] / "configs"
RIGID = ("--set", "finger.linear_stiffness_N_per_mm=.inf")
WEDGE = "polygon: [[-20, -16], [20, -6], [20, 6], [-20, 16]]"


@pytest.fixture
def gripper(folder: Path) -> str:
    (folder / "gripper.yaml").write_bytes((CONFIGS / "gripper.yaml").read_bytes())
    return "gripper.yaml"


def rows_of(call: Any, *arguments: str) -> list[dict[str, Any]]:
    result = call("grasp", *arguments, *RIGID, "-q", "--format", "json")
    assert (result.exit_code, result.stderr) == (ExitCode.DONE, "")
    rows: list[dict[str, Any]] = json.loads(result.stdout)
    return rows


def with_object(folder: Path, gripper: str, said: str) -> str:
    text = (folder / gripper).read_text(encoding="utf-8")
    (folder / "own.yaml").write_text(f"{text}\nobject:\n{said}\n", encoding="utf-8")
    return "own.yaml"


def test_jaws_said_in_three_ways_are_the_same(call: Any, folder: Path, gripper: str) -> None:
    chosen = ("--pattern", "01010", "--pattern", "10000")
    rows = rows_of(call, gripper, "--object", "jaws:30x40", "--at", "40,0", *chosen)
    assert rows[0]["touching"] == "5" and rows[0]["squeeze_N"] > 0.1
    assert all(row["penetration_mm"] <= 1e-9 for row in rows)
    assert rows == rows_of(call, gripper, "--object", "jaws:30", "--at", "40,0", *chosen)
    spec = with_object(folder, gripper, "  jaws: {gap_mm: 30, height_mm: 40}\n  at_mm: [40, 0]")
    assert rows == rows_of(call, spec, *chosen)
    (folder / "jaws.yaml").write_text("jaws: {gap_mm: 30, height_mm: 40}\n", encoding="utf-8")
    assert rows == rows_of(call, gripper, "--object", "jaws.yaml", "--at", "40,0", *chosen)


@pytest.mark.parametrize("order", [1, -1])
def test_polygons_go_either_way_round(call: Any, folder: Path, gripper: str, order: int) -> None:
    """A rectangle is the block that jaws are."""
    corners = [[-20, -15], [20, -15], [20, 15], [-20, 15]][::order]
    spec = with_object(folder, gripper, f"  polygon: {corners}\n  at_mm: [40, 0]")
    (row,) = rows_of(call, spec, "--pattern", "01010")
    jaws = ("--object", "jaws:30", "--at", "40,0", "--pattern", "01010")
    (expected,) = rows_of(call, gripper, *jaws)
    assert row["squeeze_N"] == pytest.approx(expected["squeeze_N"], rel=1e-9)


def test_payloads_in_every_format(call: Any, folder: Path, gripper: str) -> None:
    said = "  disc: {diameter_mm: 40}\n  at_mm: [45, 0]\n  friction: 1.0\n  mass_g: 20"
    spec, chosen = with_object(folder, gripper, said), ("--pattern", "1110?")
    rows = rows_of(call, spec, *chosen)
    assert [row["fails_first"] for row in rows] == ["none", "slip"]
    assert rows[0]["payload_N"] > 0.196 > rows[1]["payload_N"] > 0.0
    result = call("grasp", spec, *chosen, *RIGID, "-o", "g.parquet")
    assert result.exit_code == ExitCode.DONE and "fails_first" in result.stdout
    assert "payload: pull along -x, where gravity acts to" in result.stderr
    assert "warning: 1 state not bearing the weight of 0.1961 N" in result.stderr
    written = pq.read_table(folder / "g.parquet")
    assert written.to_pylist()[0]["payload_N"] == rows[0]["payload_N"]
    assert b"published" in written.schema.field("payload_N").metadata[b"basis"]


def test_figures_have_plates(call: Any, folder: Path, gripper: str) -> None:
    for body, name in (("jaws:30", "j.svg"), (str(CONFIGS / "objects/wedge.yaml"), "w.svg")):
        arguments = ("--object", body, "--at", "40,0", "--pattern", "10000", "--plot", name, "-q")
        assert call("grasp", gripper, *arguments, *RIGID).exit_code == ExitCode.DONE
    assert "10000: 2 contacts" in (folder / "j.svg").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", ["can_66mm", "ball_40mm", "wedge"])
def test_bodies_that_are_there(call: Any, gripper: str, name: str) -> None:
    file = str(CONFIGS / "objects" / f"{name}.yaml")
    (row,) = rows_of(call, gripper, "--object", file, "--at", "60,0", "--pattern", "00000")
    assert row["status"] == "stable"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("jaws:-3",), "--object jaws:-3: expected disc and its diameter"),
        (("jaws:30x",), "--object jaws:30x: expected disc and its diameter"),
        (("jaws:30x40x2",), "--object jaws:30x40x2: expected disc"),
        (("disc:30x40",), "--object disc:30x40: expected disc"),
        (("can",), "--object can: expected disc"),
        (("none.yaml",), "none.yaml"),
        (("jaws:30",), "--at: expected the place of the body in mm, such as 40,0"),
        (("jaws:70", "--at", "10,0"), "jaws of 70 x 40 mm there begins in the base of a finger"),
    ],
)
def test_refusals(call: Any, gripper: str, arguments: tuple[str, ...], said: str) -> None:
    result = call("grasp", gripper, "--object", *arguments)
    assert result.exit_code == ExitCode.USAGE
    assert said in result.stderr and not result.stdout


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ("", "expected one of disc, jaws and polygon, found none of them"),
        (f"jaws: {{gap_mm: 3, height_mm: 4}}\n{WEDGE}", "found jaws and polygon"),
        ("polygon: [[0, 0], [9, 9], [9, 0], [0, 9]]", "found side 1-2 crosses side 3-4"),
        ("polygon: [[0, 0], [9, 0], [4, 0], [4, 5]]", "found side 1-2 crosses side 2-3"),
        ("polygon: [[0, 0], [9, 0], [9, 0], [0, 9]]", "found side 2-3 of 0 mm"),
        ("polygon: [[0, 0], [9, 0]]", "polygon: expected three to 64 corners in mm"),
        ("polygon: [[0, 0], [9], [9, 0]]", "polygon.1: expected a corner, two numbers in mm"),
        ("jaws: {gap_mm: 0, height_mm: 4}", "jaws.gap_mm: expected a length > 0 in mm, found 0"),
        ("jaws: {gap_mm: 3}", "jaws.height_mm: expected a length > 0 in mm, found nothing"),
        ("disc: {diameter_mm: 9}\nmass_g: 300", "mass_g: expected friction beside it"),
        ("disc: {diameter_mm: 9}\nfriction: -1", "friction: expected a coefficient >= 0"),
    ],
)
def test_wrong_files(call: Any, folder: Path, gripper: str, keys: str, said: str) -> None:
    (folder / "body.yaml").write_text(f"at_mm: [40, 0]\n{keys}\n", encoding="utf-8")
    result = call("grasp", gripper, "--object", "body.yaml")
    assert result.exit_code == ExitCode.USAGE
    assert "body.yaml:" in result.stderr and said in result.stderr
    indented = "\n".join(f"  {line}" for line in ("at_mm: [40, 0]", *keys.splitlines()))
    in_spec = call("grasp", with_object(folder, gripper, indented))
    assert in_spec.exit_code == ExitCode.USAGE and said in in_spec.stderr


def test_jaws_of_the_command_line_give_way_as_those_of_the_spec(call: Any, folder: Path) -> None:
    compliance = "compliance: {stiffness_N_per_mm: 0.1}"
    own = f"object: {{jaws: {{gap_mm: 56, height_mm: 40}}, at_mm: [45, 0], {compliance}}}"
    text = (CONFIGS / "gripper.yaml").read_text(encoding="utf-8")
    (folder / "own.yaml").write_text(f"{text}\n{own}\n", encoding="utf-8")
    asked = "--pattern", "00001", "-q", "--format", "csv"
    from_spec = call("grasp", "own.yaml", *asked)
    said = call("grasp", "own.yaml", "--object", "jaws:56x40", *asked)
    assert (from_spec.exit_code, said.stdout) == (ExitCode.DONE, from_spec.stdout)
    rigid = call(
        "grasp", str(CONFIGS / "gripper.yaml"), "--object", "jaws:56x40", "--at", "45,0", *asked
    )
    assert rigid.stdout != said.stdout


def test_a_file_may_have_the_parts_of_its_place(call: Any, folder: Path) -> None:
    (folder / "ball.yaml").write_text(
        "disc: {diameter_mm: 40}\nat_x_mm: 40\nat_y_mm: 0\n", encoding="utf-8"
    )
    gripper = str(CONFIGS / "gripper.yaml")
    asked = "--pattern", "00000", "-q"
    result = call("grasp", gripper, "--object", "ball.yaml", *asked)
    assert (
        result.stdout
        == call("grasp", gripper, "--object", "disc:40", "--at", "40,0", *asked).stdout
    )
    assert result.exit_code == ExitCode.DONE


def test_a_stiffness_has_its_unit(call: Any, folder: Path) -> None:
    own = "object.compliance.stiffness_N_per_mm=-0.05"
    result = call("grasp", str(CONFIGS / "gripper.yaml"), "--set", own)
    assert "a stiffness > 0 in N/mm, found -0.05" in result.stderr


@pytest.mark.parametrize(
    ("parts", "is_whole"), [("at_x_mm: 25\n  at_y_mm: 0", True), ("at_x_mm: 25", False)]
)
def test_both_parts_of_a_place_stand_for_it(
    call: Any, folder: Path, gripper: str, parts: str, is_whole: bool
) -> None:
    spec = with_object(folder, gripper, f"  disc: {{diameter_mm: 9}}\n  {parts}")
    result = call("validate", spec)
    assert result.exit_code == (ExitCode.DONE if is_whole else ExitCode.USAGE)
    said = "object.at_mm: expected two numbers in mm, such as [40, 0], found nothing"
    assert (said in result.stdout + result.stderr) is not is_whole


@pytest.mark.slow
def test_settings_are_those_of_the_body_that_is_said(call: Any, folder: Path, gripper: str) -> None:
    """Whether the spec has an object or not, and the place may be one of them."""
    chosen = ("--pattern", "11100", "--object", "disc:40")
    friction = ("--set", "object.friction=0.5", "--set", "object.held=guided")
    (row,) = rows_of(call, gripper, *chosen, "--at", "45,0", *friction)
    assert row["status"] == "not_held" and "payload_N" in row
    spec = with_object(folder, gripper, "  jaws: {gap_mm: 3, height_mm: 4}\n  at_mm: [45, 0]")
    assert rows_of(call, spec, *chosen, *friction) == [row]
    assert rows_of(call, gripper, *chosen, *friction, "--set", "object.at_mm=[45, 0]") == [row]
    said = "  disc: {diameter_mm: 40}\n  at_mm: [45, 0]\n  friction: 0.5\n  held: guided"
    assert rows_of(call, with_object(folder, gripper, said), "--pattern", "11100") == [row]
    assert rows_of(call, with_object(folder, gripper, said), *chosen, "--at", "45,0") == [row]


def test_wrong_settings_of_the_body_that_is_said(call: Any, gripper: str) -> None:
    said = ("--object", "disc:40", "--at", "45,0", "--set")
    for setting, wrong in (
        ("object.held=loose", '--set: object.held: expected "fixed", "guided"'),
        ("object.mass_g=4", "--set: object.mass_g: expected friction beside it"),
        ("object.jaws.gap_mm=4", "--set: object.jaws.height_mm: expected a length > 0 in mm"),
        ("object.compliance.stiffness_N_per_mm=4", "object.compliance: expected jaws, which only"),
    ):
        result = call("grasp", gripper, *said, setting)
        assert result.exit_code == ExitCode.USAGE and wrong in result.stderr, result.stderr


@pytest.mark.slow
def test_jaws_of_a_file_have_their_forces_beside_it(call: Any, folder: Path, gripper: str) -> None:
    (folder / "bodies").mkdir()
    own = folder / "bodies" / "own.yaml"
    own.write_text("jaws: {gap_mm: 55, height_mm: 40}\ncompliance: {table: f.csv}\n")
    table = own.with_name("f.csv")
    table.write_text("jaw_gap_mm,force (mN)\n55,0\n45,500\n35,1000\n")
    chosen = ("--object", str(own), "--at", "45,0", "--pattern", "01100")
    (row,) = rows_of(call, gripper, *chosen)
    stiff = ("--set", "object.compliance={stiffness_N_per_mm: 0.05}")
    (other,) = rows_of(call, gripper, *chosen, *stiff)
    assert row["squeeze_N"] == pytest.approx(other["squeeze_N"], rel=1e-9) and row["squeeze_N"] > 0
    result = call("grasp", gripper, *chosen, *RIGID, "-o", str(table))
    assert result.exit_code == ExitCode.USAGE and table.read_text().startswith("jaw_gap_mm")
    table.write_text("jaw_gap_mm,force_N\n35,1\n40,0.1\n45,0.4\n54,0.39\n55,0\n")
    result = call("grasp", gripper, *chosen, *RIGID, "-o", "g.parquet")
    assert "warning: the forces of the jaws do not fall from 40 to 45 mm: one" in result.stderr
    kept = pq.read_schema(folder / "g.parquet").metadata[b"dpg.object"]
    assert json.loads(kept)["compliance"]["table"]["force_N"] == [1.0, 0.1, 0.4, 0.39, 0.0]
