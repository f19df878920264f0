"""Tables of forces that a spec's jaws have: files, lists, and what is wrong with them."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dpgcli.design.bodies import Jaws
from dpgcli.errors import SpecError
from dpgcli.files.scene_file import canonical_json, checked, read_scene, read_spec, scene_of
from dpgcli.files.scene_file.forces import read_forces
from dpgcli.files.scene_file.objects import told_of

CONFIGS = Path(__file__).parents[3] / "configs"
TABLE = "object.compliance.table"


@pytest.fixture
def spec(tmp_path: Path) -> Path:
    text = (CONFIGS / "gripper.yaml").read_text(encoding="utf-8")
    own = "  jaws: {gap_mm: 30, height_mm: 40}\n  at_mm: [40, 0]\n  compliance: {table: f.csv}\n"
    path = tmp_path / "spec.yaml"
    path.write_text(f"{text}\nobject:\n{own}", encoding="utf-8")
    return path


def jaws_of(path: Path, *settings: str) -> Jaws:
    body = scene_of(read_spec(path, settings)).body
    assert isinstance(body, Jaws)
    return body


def wrong(path: Path, *settings: str) -> list[str]:
    with pytest.raises(SpecError) as caught:
        read_spec(path, settings)
    return [str(problem).replace(str(path.parent), ".") for problem in caught.value.problems]


@pytest.mark.parametrize(
    "text",
    [
        "jaw_gap_mm,force_N\n20,1\n30,0.25\n",
        "force_N;jaw_gap_mm;x\n0,25;30;a\n1;20;b\n",
        "jaw_gap (cm),force (mN)\n2,1000\n3,250\n",
        "jaw_gap,force\nm,kN\n0.02,0.001\n0.03,0.00025\n",
    ],
)
def test_columns_in_any_order_and_unit(spec: Path, text: str) -> None:
    (spec.parent / "f.csv").write_text(text, encoding="utf-8")
    curve = jaws_of(spec).curve
    assert curve is not None and jaws_of(spec).stiffness is None
    assert curve.gap == pytest.approx([20.0, 30.0]) and curve.force == pytest.approx([1.0, 0.25])


def test_what_the_file_holds_stands_in_the_spec(spec: Path) -> None:
    """So that tables keep it, and a sweep that goes on knows other numbers for what they are."""
    (spec.parent / "f.csv").write_text("jaw_gap_mm,force_N\n20,1\n30,0\n", encoding="utf-8")
    document = read_scene(spec)
    assert document.files == (spec.parent / "f.csv",)
    kept = json.loads(canonical_json(checked(document)))["object"]["compliance"]
    assert kept == {"table": {"jaw_gap_mm": [20.0, 30.0], "force_N": [1.0, 0.0]}}
    assert told_of(jaws_of(spec), "fixed")["compliance"] == kept
    inline = jaws_of(spec, f"{TABLE}={json.dumps(kept['table'])}").curve
    assert inline is not None and inline.gap.tolist() == [20.0, 30.0]


def test_names_in_settings_are_from_where_one_is(
    spec: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (spec.parent / "f.csv").write_text("jaw_gap_mm,force_N\n20,1\n30,0\n", encoding="utf-8")
    other = tmp_path / "other"
    other.mkdir()
    (other / "f.csv").write_text("jaw_gap_mm,force_N\n20,7\n30,0\n", encoding="utf-8")
    monkeypatch.chdir(other)
    curves = [jaws_of(spec, *own).curve for own in ((), (f"{TABLE}=f.csv",))]
    assert [curve.force[0] for curve in curves if curve is not None] == [1.0, 7.0]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("jaw_gap_mm\n20\n30\n", "header: expected a column force_N, found something else"),
        ("jaw_gap_mm,force_N\n20,secret\n30,0\n", "2: force_N: expected a number, found something"),
        ("jaw_gap_mm,force_N\n20,\n30,0\n", '2: force_N: expected a number, found ""'),
        ("jaw_gap_mm,force_N\n20,1\n", "file: expected 2 to 10,000 rows, found 1"),
        (
            "jaw_gap_mm,force_N\n20,1\n30,0\n30,0\n",
            "4: jaw_gap_mm: expected an aperture above 30 mm, found 30",
        ),
        ("jaw_gap_mm,force_N\n30,1\n20,0\n21,0\n", "4: jaw_gap_mm: expected an aperture below 20"),
        ("jaw_gap_mm (cm),force_N\n2,1\n3,0\n", "jaw_gap_mm: expected mm, as the name has it"),
        ("jaw_gap (V),force_N\n2,1\n3,0\n", "jaw_gap_mm: expected a unit of travel: mm, m"),
        ("jaw_gap,jaw_gap_mm,force_N\n2,2,1\n3,3,0\n", "header: expected one column jaw_gap_mm"),
    ],
)
def test_files_that_are_none(spec: Path, text: str, said: str) -> None:
    (spec.parent / "f.csv").write_text(text, encoding="utf-8")
    (problem,) = wrong(spec)
    assert problem.startswith("./f.csv:") and said in problem
    assert "secret" not in problem


def test_a_file_that_is_not_there(spec: Path) -> None:
    (problem,) = wrong(spec)
    assert problem.startswith("./f.csv: file: expected a readable file, found no such file")


@pytest.mark.parametrize(
    ("setting", "said"),
    [
        (f"{TABLE}=5", "table: expected the name of a CSV file with the columns jaw_gap_mm and"),
        (f"{TABLE}=", "compliance: expected one of stiffness_N_per_mm and table, found none"),
        ("object.compliance.stiffness_N_per_mm=1", "found stiffness_N_per_mm and table"),
        (
            f"{TABLE}={{jaw_gap_mm: [20, 31], force_N: [1]}}",
            "force_N: expected 2 to 10,000 forces in N, found [1]",
        ),
        (
            f"{TABLE}={{jaw_gap_mm: [20, 31, 32], force_N: [1, 0]}}",
            "table.force_N: expected 3 forces, as apertures, found 2",
        ),
        (
            f"{TABLE}={{jaw_gap_mm: [20, 10], force_N: [1, 0]}}",
            "table.jaw_gap_mm.1: expected an aperture above 20 mm, found 10",
        ),
        (
            f"{TABLE}={{jaw_gap_mm: [-2, 31], force_N: [1, 0]}}",
            "table.jaw_gap_mm.0: expected an aperture >= 0 in mm, found -2",
        ),
        (
            f"{TABLE}={{jaw_gap_mm: [20, a], force_N: [1, 0]}}",
            'table.jaw_gap_mm.1: expected an aperture in mm, found "a"',
        ),
        (
            f"{TABLE}={{jaw_gap_mm: [10, 20], force_N: [1, 0]}}",
            "table: expected the gap of the jaws, 30 mm, within the table, found 10 to 20 mm",
        ),
    ],
)
def test_tables_that_are_none(spec: Path, setting: str, said: str) -> None:
    (spec.parent / "f.csv").write_text("jaw_gap_mm,force_N\n20,1\n30,0\n", encoding="utf-8")
    (problem,) = wrong(spec, setting)
    assert said in problem


def test_columns_as_values() -> None:
    table: dict[str, Any] = {"jaw_gap_mm": np.array([3.0, 2.0]), "force (kN)": [0.0, 1e-3]}
    assert read_forces(table)["force_N"].tolist() == [1.0, 0.0]


CORNERS = (
    "polygon: expected three to 64 corners in mm, such as [[0, -10], [20, 0], [0, 10]], "
    "found a list of "
)


@pytest.mark.parametrize(
    ("polygon", "said"),
    [
        ("[[0, 0], [9], [9, 0]]", "polygon.1: expected a corner, two numbers in mm such as [20"),
        ("[[0, 0], 7, [9, 0]]", "polygon.1: expected a corner, two numbers in mm such as [20, 0]"),
        ("[[0, 0], [9, 0], [a, 3]]", 'polygon.2.0: expected a number in mm, found "a"'),
        ("[[0, 0], [9, 0]]", f"{CORNERS}2"),
        (f"[{', '.join(65 * ['[0, 1]'])}]", f"{CORNERS}65"),
        ("[[0, 0], [0, 0], [3, 4]]", "polygon.0: expected sides with a length, found side 1-2 of"),
    ],
)
def test_wrong_corners_are_named(spec: Path, polygon: str, said: str) -> None:
    gone = ("object.jaws=", "object.compliance=")
    (problem,) = wrong(spec, *gone, f"object.polygon={polygon}")
    assert f"object.{said}" in problem
