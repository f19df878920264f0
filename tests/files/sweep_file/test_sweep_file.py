"""Sweep files: what they say, and every mistake in them with its place."""

import hashlib
import json
import os
import time
import tracemalloc
from collections.abc import Callable
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from dpgcli.errors import SpecError
from dpgcli.files.record_batches import record_batch, schema
from dpgcli.files.sections import UnitGeometry
from dpgcli.files.sweep_file import Sweep, read_sweep
from dpgcli.files.table_writer import write_table
from dpgcli.states.columns import Column, Group, Kind

CONFIGS = Path(__file__).parents[3] / "configs"
HEIGHT = "finger.geometry.dome_height_mm"
SEPARATION = "finger.geometry.unit_separation_mm"
OF_UNIT = "finger.overrides.{}.geometry.dome_height_mm: {{from: 5, to: 6}}"
SIXTY_FOUR = ", ".join(OF_UNIT.format(unit) for unit in range(1, 65))
PAIRS = [(first, last) for last in range(2, 25) for first in range(1, last)][:257]
Read = Callable[..., Sweep]


@pytest.fixture
def read(tmp_path: Path) -> Read:
    """Read a sweep of a three-unit finger whose space and constraints are these lines."""
    (tmp_path / "base.yaml").write_bytes((CONFIGS / "three_unit.yaml").read_bytes())

    def reading(*axes: str, constraints: str = "", head: str = "base: base.yaml") -> Sweep:
        lines = [head, "space:", *(f"  - {axis}" for axis in axes)]
        lines += [f"constraints: {constraints}"] if constraints else []
        (tmp_path / "sweep.yaml").write_text("\n".join(lines) + "\n", encoding="utf-8")
        return read_sweep(tmp_path / "sweep.yaml")

    return reading


def designs(sweep: Sweep) -> dict[str, list[float]]:
    """All values of the space by key."""
    columns = sweep.space.designs(0, sweep.space.size)
    return {key: column.tolist() for key, column in columns.items()}


def problems(read: Read, *axes: str, **options: str) -> list[str]:
    """The problems, each with line and column."""
    with pytest.raises(SpecError) as raised:
        read(*axes, **options)
    return [str(p).split("sweep.yaml:")[-1] for p in raised.value.problems]


@pytest.mark.parametrize(
    ("axis", "values"),
    [
        ("values: [6, 6.5]", [6, 6.5]),
        ("linear: {from: 5, to: 7, count: 5}", [5, 5.5, 6, 6.5, 7]),
        ("log: {from: 0.1, to: 10, count: 3}", [0.1, 1, 10]),
    ],
)
def test_an_axis_of_one_key(read: Read, axis: str, values: list[float]) -> None:
    assert designs(read(f"{{key: {HEIGHT}, {axis}}}"))[HEIGHT] == pytest.approx(values, rel=1e-15)


def test_axes_multiply_with_the_last_fastest(read: Read) -> None:
    found = designs(
        read(f"{{key: {HEIGHT}, values: [6, 7]}}", f"paired: {{{SEPARATION}: [2, 3, 4]}}")
    )
    assert found == {HEIGHT: [6, 6, 6, 7, 7, 7], SEPARATION: [2, 3, 4] * 2}


@pytest.mark.parametrize("key", ["finger.overrides.2.geometry.dome_height_mm"])
def test_a_key_of_one_unit(read: Read, key: str) -> None:
    assert designs(read(f"{{key: {key}, values: [6]}}")) == {key: [6]}


def test_samples(read: Read) -> None:
    ranges = f"{{{HEIGHT}: {{from: 5, to: 7}}, {SEPARATION}: {{from: 1, to: 4, scale: log}}}}"
    first = designs(read(f"sample: {{method: sobol, count: 9, seed: 3, ranges: {ranges}}}"))
    again = designs(read(f"sample: {{method: sobol, count: 9, seed: 3, ranges: {ranges}}}"))
    assert first == again
    assert len(first[HEIGHT]) == 9
    assert all(5 <= value <= 7 for value in first[HEIGHT])


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_a_table_gives_its_very_numbers(read: Read, tmp_path: Path, suffix: str) -> None:
    values = np.random.default_rng(1).uniform(4, 8, (500, 2))
    frame = pd.DataFrame(values, columns=[HEIGHT, SEPARATION])
    if suffix == "csv":
        text = "\n".join(",".join(map(repr, row)) for row in values.tolist())
        (tmp_path / "t.csv").write_text(f"{HEIGHT},{SEPARATION}\n{text}\n")
    else:
        frame.to_parquet(tmp_path / "t.parquet")
    sweep = read(f"table: t.{suffix}")
    assert designs(sweep) == {key: frame[key].tolist() for key in frame}
    assert tmp_path / f"t.{suffix}" in sweep.files


@pytest.mark.parametrize("kind", ["uint8", "int32", "float32"])
def test_a_table_of_any_numeric_type(read: Read, tmp_path: Path, kind: str) -> None:
    pd.DataFrame({HEIGHT: np.array([6, 7], kind)}).to_parquet(tmp_path / "t.parquet")
    assert designs(read("table: t.parquet")) == {HEIGHT: [6, 7]}


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_whole_numbers_beyond_63_bits_are_refused(read: Read, tmp_path: Path, suffix: str) -> None:
    """As a signed column they would be negative."""
    frame = pd.DataFrame({HEIGHT: np.array([6, 2**64 - 1], np.uint64)})
    if suffix == "csv":
        frame.to_csv(tmp_path / "t.csv", index=False)
    else:
        frame.to_parquet(tmp_path / "t.parquet")
    (problem,) = problems(read, f"table: t.{suffix}")
    assert problem == (
        f"3:5: space.0.table: expected whole numbers below 2^63 in column {HEIGHT}, "
        "found 18446744073709551615 in row 2"
    )
    whole = pd.DataFrame({HEIGHT: np.array([6, 2**63 - 1], np.uint64)})
    whole.to_parquet(tmp_path / "t.parquet")
    assert designs(read("table: t.parquet")) == {HEIGHT: [6, 2**63 - 1]}


def test_rigid_bars_among_values_are_strict_json(read: Read) -> None:
    def said(value: str) -> str:
        key = "finger.linear_stiffness_N_per_mm"
        return read(f"{{key: {key}, values: [1000, {value}]}}").canonical_json()

    def refused(constant: str) -> None:
        raise AssertionError(f"{constant} is not JSON")

    space = json.loads(said(".inf"), parse_constant=refused)["space"]
    assert space["space"][0]["values"] == [1000, ".inf"]
    assert len({said(".inf"), said("-.inf"), said("1e300")}) == 3


@pytest.mark.parametrize("row", ["6.5,3,9", "6.5"])
def test_rows_that_do_not_fit_the_header_are_refused(read: Read, tmp_path: Path, row: str) -> None:
    """pandas would take the first column for row names and shift the others."""
    (tmp_path / "t.csv").write_text(f"{HEIGHT},{SEPARATION}\n{row}\n")
    assert problems(read, "table: t.csv")[0].startswith("3:5: space.0.table: expected ")


UNKNOWN = [
    ("finger.geometry.dome_hight_mm", "dome_height_mm"),
    ("finger.geometri.dome_height_mm", "finger.geometry.dome_height_mm"),
    ("dome_height_mm", "finger.geometry.dome_height_mm"),
    ("finger.unit", "units"),
    ("finger.overrides.2.geometry.unit_sep_mm", "unit_separation_mm"),
    ("finger.overrides.2.geometri.dome_height_mm", "geometry"),
    ("finger.overides.2.geometry.dome_height_mm", "overrides"),
    ("finger.overrides.2.lattice.segment_height_mm", "segment height is shared"),
    ("griper.base_spacing_mm", "gripper"),
]


@pytest.mark.parametrize(("key", "hint"), UNKNOWN)
def test_an_unknown_key_names_the_nearest(read: Read, key: str, hint: str) -> None:
    (problem,) = problems(read, f"{{key: {key}, values: [1]}}")
    assert problem.startswith("3:6: space.0.key: expected ")
    assert hint in problem


@pytest.mark.parametrize("key", ["finger.geometry", "finger", "finger.calibration"])
def test_keys_that_hold_no_number_are_refused(read: Read, key: str) -> None:
    assert problems(read, f"{{key: {key}, values: [1]}}")[0].startswith("3:6: space.0.key: ")


@pytest.mark.parametrize("units", ["foo", "3-2", "0"])
def test_keys_of_units_that_no_finger_has_are_refused(read: Read, units: str) -> None:
    key = f"finger.overrides.{units}.geometry.dome_height_mm"
    assert problems(read, f"{{key: {key}, values: [1]}}")[0].startswith("3:6: space.0.key: ")


def test_gripper_keys_need_a_gripper(read: Read) -> None:
    """Else every design would be a gripper without an aperture."""
    found = problems(read, "{key: gripper.base_spacing_mm, values: [60]}")
    assert "gripper" in found[0]


PRESSURES = ("effective_area_mm2", "snap_pressure_MPa", "overrides.2.snap_pressure_MPa")


@pytest.mark.parametrize("key", PRESSURES)
def test_pressure_keys_need_pressure(read: Read, tmp_path: Path, key: str) -> None:
    axis = f"{{key: pressure.{key}, values: [1, 2]}}"
    (problem,) = problems(read, axis)
    assert problem.endswith("(the base has no pressure)")
    with (tmp_path / "base.yaml").open("a", encoding="utf-8") as base:
        base.write("pressure: {}\n")
    assert designs(read(axis)) == {f"pressure.{key}": [1, 2]}


@pytest.mark.parametrize("key", ["lines", "lines.A", "history", "history.A", "overrides.2"])
def test_lines_and_histories_are_no_numbers(read: Read, tmp_path: Path, key: str) -> None:
    with (tmp_path / "base.yaml").open("a", encoding="utf-8") as base:
        base.write("pressure: {lines: {A: 1-3}, history: {A: 0:1}}\n")
    (problem,) = problems(read, f"{{key: pressure.{key}, values: [1, 2]}}")
    assert problem.startswith("3:6: space.0.key: expected ")


ZERO_LOG = "{from: 0, to: 1, scale: log}"
WRONG_AXES = [
    (f"{{key: {HEIGHT}}}", "3:5: space.0: expected exactly one of values, linear, log, paired"),
    (f"{{key: {HEIGHT}, vales: [1]}}", f"3:{len(HEIGHT) + 13}: space.0.vales: expected a known"),
    (f"{{key: {HEIGHT}, values: [1], table: t.csv}}", "found values, table"),
    ("{values: [1]}", "a key beside values"),
    (f"{{key: {HEIGHT}, table: t.csv}}", "no key beside table"),
    (f"{{key: {HEIGHT}, values: []}}", "a list of numbers"),
    (f"{{key: {HEIGHT}, values: 3}}", "a list of numbers, found 3"),
    (f"{{key: {HEIGHT}, values: [a]}}", 'found "a"'),
    (f"{{key: {HEIGHT}, values: [true]}}", "found true"),
    (f"{{key: {HEIGHT}, values: [.nan]}}", "found .nan"),
    (
        f"{{key: {HEIGHT}, linear: {{from: 1, to: 2, count: 0}}}}",
        "a whole number from 2 to 10,000,000, found 0",
    ),
    (
        f"{{key: {HEIGHT}, log: {{from: 1, to: 2, count: 10000001}}}}",
        "10,000,000, found 10000001",
    ),
    (
        f"sample: {{method: sobol, count: 20000000, ranges: {{{HEIGHT}: {{from: 1, to: 2}}}}}}",
        "a whole number from 1 to 10,000,000, found 20000000",
    ),
    (
        f"{{key: {HEIGHT}, linear: {{from: 1, to: 2, count: 1.5}}}}",
        "whole number from 2 to 10,000,000, found 1",
    ),
    (f"{{key: {HEIGHT}, linear: {{from: 1, to: 2}}}}", "count: expected how many values"),
    (f"{{key: {HEIGHT}, linear: {{from: 1, too: 2, count: 3}}}}", "did you mean to?"),
    (f"{{key: {HEIGHT}, log: {{from: 0, to: 2, count: 3}}}}", "bounds above zero, found 0 and 2"),
    (f"{{key: {HEIGHT}, log: {{from: 1, to: -2, count: 3}}}}", "bounds above zero"),
    (f"paired: {{{HEIGHT}: [1, 2], {SEPARATION}: [1]}}", "lists of one length, found 2, 1"),
    ("paired: {}", "space.0.paired: expected lists of numbers by key"),
    ("paired: {a.b: [1]}", "space.0.paired: expected a known key, found a.b"),
    ("sample: {method: halton, count: 3, ranges: {}}", "sobol or latin_hypercube"),
    (
        f"sample: {{method: sobol, count: 3, ranges: {{{HEIGHT}: {ZERO_LOG}}}}}",
        "bounds above zero",
    ),
    ("table: missing.csv", "3:5: space.0.table: expected a CSV or Parquet file of designs"),
    ("table: base.yaml", "3:5: space.0.table: expected "),
    ("table: .", "3:5: space.0.table: expected a CSV or Parquet file of designs"),
    ("3", "3:5: space.0: expected "),
]


@pytest.mark.parametrize(("axis", "said"), WRONG_AXES)
def test_a_wrong_axis_is_said_with_its_place(read: Read, axis: str, said: str) -> None:
    found = problems(read, axis)
    assert any(said in problem for problem in found), found
    assert all(problem.startswith("3:") for problem in found)


@pytest.mark.parametrize(
    ("content", "what"),
    [
        ("abc\n", "text"),
        ("\n", "gap"),
        ("", "no rows"),
        ("inf\n", "infinity"),
        ("6.5\nsix\n", "text"),
        ("true\n", "truth"),
    ],
)
def test_a_table_needs_numbers(read: Read, tmp_path: Path, content: str, what: str) -> None:
    (tmp_path / "t.csv").write_text(f"{HEIGHT},{SEPARATION}\n" + content.replace("\n", ",3\n"))
    assert problems(read, "table: t.csv")[0].startswith("3:5: space.0.table: expected "), what


@pytest.mark.parametrize("content", [b"", b"PAR1", b"\xff\xfe\x00"])
@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_a_table_that_cannot_be_read(
    read: Read, tmp_path: Path, content: bytes, suffix: str
) -> None:
    (tmp_path / f"t.{suffix}").write_bytes(content)
    assert problems(read, f"table: t.{suffix}")[0].startswith("3:5: space.0.table: expected ")


def test_a_key_stands_on_one_axis(read: Read) -> None:
    (problem,) = problems(read, f"{{key: {HEIGHT}, values: [1]}}", f"paired: {{{HEIGHT}: [2]}}")
    assert problem == f"4:5: space.1.paired: expected each key on one axis, found {HEIGHT} again"


WRONG_RULES = [
    "1 +",
    "import os",
    "__import__('os')",
    "finger.units.real > 2",
    "dome_hight_mm > 3",
    "calibration > 3",
    "finger > 3",
    "sqrt(units, 2) > 1",
    "-" * 490 + "units > 1",
]


@pytest.mark.parametrize("rule", WRONG_RULES)
def test_a_wrong_constraint_is_said_with_its_place(read: Read, rule: str) -> None:
    (problem,) = problems(read, f"{{key: {HEIGHT}, values: [6]}}", constraints=f'["{rule}"]')
    assert problem.startswith("4:15: constraints.0: expected ")


def test_a_misspelled_name_in_a_constraint_names_the_nearest(read: Read) -> None:
    (problem,) = problems(
        read, f"{{key: {HEIGHT}, values: [6]}}", constraints="[dome_hight_mm > 3]"
    )
    assert problem.endswith("(did you mean dome_height_mm?)")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (f"{HEIGHT}\n6\n\n", None),
        (f"{HEIGHT},finger.units\n6,3\n,4\n", f'column {HEIGHT}, found "nan" in row 2'),
        (f"{HEIGHT}\n6\ntall\n", f'column {HEIGHT}, found "tall" in row 2'),
        (f"{HEIGHT}\ntrue\n", f'column {HEIGHT}, found "True" in row 1'),
        (f"{HEIGHT}\n", "expected rows of finite numbers, found no rows"),
    ],
)
def test_a_table_says_where_it_has_no_number(
    read: Read, tmp_path: Path, text: str, said: str | None
) -> None:
    (tmp_path / "t.csv").write_text(text)
    if said is None:
        assert designs(read("table: t.csv"))[HEIGHT] == [6]
        return
    (problem,) = problems(read, "table: t.csv")
    assert said in problem


def test_a_short_name_of_two_keys_is_ambiguous(read: Read) -> None:
    keys = [f"finger.overrides.{unit}.geometry.dome_height_mm" for unit in (1, 2)]
    axes = [f"{{key: {key}, values: [6, 6.5]}}" for key in keys]
    assert problems(read, *axes, constraints="[dome_height_mm > 6.2]")


def test_a_constraint_can_name_the_key_of_a_unit(read: Read) -> None:
    key = "finger.overrides.2.geometry.dome_height_mm"
    sweep = read(f"{{key: {key}, values: [6, 6.5]}}", constraints=f"[{key} > 6.2]")
    assert sweep.constraints[0].names == {key}


def test_all_problems_are_said_at_once(read: Read) -> None:
    found = problems(
        read,
        f"{{key: {HEIGHT}, log: {{from: 0, to: 1, count: 2}}}}",
        "{key: finger.unit, values: [1]}",
        "table: missing.csv",
        constraints="[1 +, 2 +]",
    )
    assert [problem.split(":")[0] for problem in found] == ["3", "4", "5", "6", "6"]


@pytest.mark.parametrize(
    ("head", "said"),
    [
        ("# nothing", "1:1: base: expected the path of a spec"),
        ("base: 3", "1:1: base: expected the path of a spec, from this file's folder, found 3"),
        ("base: base.yaml\nbse: 3", "2:1: bse: expected a known key"),
        ("base: base.yaml\nbase: base.yaml", "2:1: base: expected each key once"),
    ],
)
def test_a_wrong_head(read: Read, head: str, said: str) -> None:
    found = problems(read, f"{{key: {HEIGHT}, values: [6]}}", head=head)
    assert any(problem.startswith(said) or said[3:] in problem for problem in found), found


def test_a_missing_or_wrong_base_is_named(read: Read, tmp_path: Path) -> None:
    axis = f"{{key: {HEIGHT}, values: [6]}}"
    with pytest.raises(SpecError, match=r"missing\.yaml: file: expected a readable file"):
        read(axis, head="base: missing.yaml")
    (tmp_path / "wrong.yaml").write_text("finger: {unts: 3}\n")
    with pytest.raises(SpecError, match=r"wrong\.yaml:1:\d+: finger\.unts"):
        read(axis, head="base: wrong.yaml")


@pytest.mark.parametrize(
    "wrong",
    ["{key: finger.geometry.dome_hight_mm, values: [6]}", f"{{key: {HEIGHT}, valuse: [6]}}"],
    ids=["content", "form"],
)
def test_mistakes_of_sweep_and_base_are_said_together(
    read: Read, tmp_path: Path, wrong: str
) -> None:
    (tmp_path / "wrong.yaml").write_text("finger: {unts: 3}\n")
    found = problems(read, wrong, head="base: wrong.yaml")
    assert any("wrong.yaml" in problem and "unts" in problem for problem in found), found
    assert any("hight" in problem or "valuse" in problem for problem in found), found


@pytest.mark.parametrize(
    "number", [10**30, 10**400, 2**63, -(2**64)], ids=["1e30", "1e400", "2^63", "-2^64"]
)
def test_huge_whole_numbers_are_numbers_or_refused(read: Read, number: int) -> None:
    try:
        column = read(f"{{key: {HEIGHT}, values: [6, {number}]}}").space.designs(0, 2)[HEIGHT]
    except SpecError:
        return
    assert column.dtype.kind == "f"


def test_rigid_bars_are_a_value(read: Read) -> None:
    """`.inf` is a value of this key in a spec, so it is one in a space."""
    key = "finger.linear_stiffness_N_per_mm"
    assert designs(read(f"{{key: {key}, values: [1.0e4, .inf]}}"))[key] == [1e4, np.inf]


@pytest.mark.parametrize(
    "axis",
    [
        "{key: finger.units, linear: {from: 2, to: 4, count: 3}}",
        "{key: finger.units, values: [2, 3.0, 4]}",
    ],
)
def test_whole_numbers_of_units_count_as_whole(read: Read, axis: str) -> None:
    column = read(axis).space.designs(0, 3)["finger.units"]
    assert (column.dtype.kind, column.tolist()) == ("i", [2, 3, 4])


@pytest.mark.parametrize(
    ("axis", "found"),
    [
        ("{key: finger.units, linear: {from: 2, to: 5, count: 3}}", "3.5"),
        ("{key: finger.units, log: {from: 2, to: 5, count: 3}}", "3.16228"),
        ("sample: {method: sobol, count: 2, ranges: {finger.units: {from: 2, to: 3}}}", "2.40995"),
    ],
)
def test_steps_of_units_that_are_not_whole_are_refused(read: Read, axis: str, found: str) -> None:
    """Else every such design were an invalid row."""
    (problem,) = problems(read, axis)
    said = f"expected steps that are whole numbers of finger.units, found {found}"
    assert problem.endswith(f"{said} (list them under values)")


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_units_of_a_table_are_whole_though_it_writes_them_with_a_point(
    read: Read, tmp_path: Path, suffix: str
) -> None:
    frame = pd.DataFrame({"finger.units": [3.0, 4.0]})
    if suffix == "csv":
        frame.to_csv(tmp_path / "t.csv", index=False)
    else:
        frame.to_parquet(tmp_path / "t.parquet")
    column = read(f"table: t.{suffix}").space.designs(0, 2)["finger.units"]
    assert (column.dtype.kind, column.tolist()) == ("i", [3, 4])


INDICES = {
    "values": pd.Index([6.0, 7.0], name=HEIGHT),
    "range": pd.RangeIndex(6, 8, name=HEIGHT),
    "levels": pd.MultiIndex.from_arrays([[6, 7], [2, 3]], names=[HEIGHT, SEPARATION]),
}


@pytest.mark.parametrize("kind", INDICES)
def test_an_index_with_a_name_is_a_column(read: Read, tmp_path: Path, kind: str) -> None:
    pd.DataFrame({"finger.units": [3, 4]}, INDICES[kind]).to_parquet(tmp_path / "t.parquet")
    found = designs(read("table: t.parquet"))
    levels = {SEPARATION: [2, 3]} if kind == "levels" else {}
    assert found == {HEIGHT: [6, 7], **levels, "finger.units": [3, 4]}


def test_an_index_without_a_name_is_none_in_parquet_and_refused_in_csv(
    read: Read, tmp_path: Path
) -> None:
    """A data frame that was filtered has one; of a CSV nobody knows that it is one."""
    frame = pd.DataFrame({HEIGHT: [6, 7, 8]}).loc[[0, 2]]
    frame.to_parquet(tmp_path / "t.parquet")
    assert designs(read("table: t.parquet")) == {HEIGHT: [6, 8]}
    frame.to_csv(tmp_path / "t.csv")
    (problem,) = problems(read, "table: t.csv")
    assert problem.endswith("found Unnamed: 0 (pandas writes no index where index=False)")


def test_nullable_numbers_are_numbers_and_their_gaps_are_said(read: Read, tmp_path: Path) -> None:
    pd.DataFrame({"finger.units": pd.array([3, 4], "Int64")}).to_parquet(tmp_path / "t.parquet")
    assert designs(read("table: t.parquet")) == {"finger.units": [3, 4]}
    pd.DataFrame({"finger.units": pd.array([3, None], "Int64")}).to_parquet(tmp_path / "t.parquet")
    assert 'found "<NA>" in row 2' in problems(read, "table: t.parquet")[0]


def test_categories_of_numbers_are_numbers(read: Read, tmp_path: Path) -> None:
    frame = pd.DataFrame({"finger.units": pd.Categorical([4, 3, 4])})
    frame.to_parquet(tmp_path / "t.parquet")
    assert designs(read("table: t.parquet")) == {"finger.units": [4, 3, 4]}


@pytest.mark.parametrize(
    "column",
    [[[1.0], [2.0]], [{"a": 1}, {"a": 2}], [b"1", b"2"], ["1", "2"], pd.to_datetime([1, 2])],
)
def test_what_is_no_number_in_parquet_is_refused(
    read: Read, tmp_path: Path, column: list[Any]
) -> None:
    pd.DataFrame({HEIGHT: column}).to_parquet(tmp_path / "t.parquet")
    assert f"expected finite numbers in column {HEIGHT}" in problems(read, "table: t.parquet")[0]


def test_columns_of_one_name_are_refused(read: Read, tmp_path: Path) -> None:
    pq.write_table(pa.table([[6], [7]], names=[HEIGHT, HEIGHT]), tmp_path / "t.parquet")
    assert "expected each column once" in problems(read, "table: t.parquet")[0]


def test_quotes_in_the_midst_of_a_cell_are_refused(read: Read, tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text(f'{HEIGHT}\n"3"4\n')
    assert "expected a CSV or Parquet file" in problems(read, "table: t.csv")[0]
    (tmp_path / "t.csv").write_text(f'"{HEIGHT}"\n"6.5"\n')
    assert designs(read("table: t.csv")) == {HEIGHT: [6.5]}


def test_comments_in_a_table_of_designs(read: Read, tmp_path: Path) -> None:
    top = "# of the lab\n\n#heights, as cut\n"
    rows = f"{HEIGHT},{SEPARATION}\n6,3\n# 7,3\n#\n8,4\n"
    for text in (
        top + rows,
        "\ufeff" + top + rows,
        (top + rows).replace("\n", "\r\n"),
        (top + rows).replace("\n", "\r"),
    ):
        (tmp_path / "t.csv").write_bytes(text.encode())
        assert designs(read("table: t.csv")) == {HEIGHT: [6, 8], SEPARATION: [3, 4]}
    (tmp_path / "t.csv").write_bytes(f"{HEIGHT},{SEPARATION}\n6,3\n# note\r6.1,3\r7,3\n".encode())
    assert designs(read("table: t.csv"))[HEIGHT] == [6, 6.1, 7], "CR alone ends a line"
    for row in ("#7,3", "#DIV/0!,3"):
        (tmp_path / "t.csv").write_text(f"{top}{rows}{row}\n")
        assert f'"{row[:-2]}" in row 3' in problems(read, "table: t.csv")[0]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (f"{HEIGHT},{SEPARATION}\n6,3\n7,3,1\n", "found 3 cells in line 3 (the header has 2)"),
        (f"# a\n{HEIGHT},{SEPARATION}\n6,3,1\n", "found 3 cells in line 3 (the header has 2)"),
        (f"{HEIGHT};{SEPARATION}\n6,5;3,0\n7;3;1\n", "3 cells in line 3 (the header has 2)"),
        (f"{HEIGHT};{SEPARATION}\n1,234;1,500\n", '"1,234" (write decimal points'),
        (f"{HEIGHT};{SEPARATION}\n1.234,5;1\n", "thousands grouped by ."),
        (f"{HEIGHT};{SEPARATION}\n6,5;3\n6.5;4\n", '"6,5" in row 1'),
        (f"{HEIGHT},{SEPARATION}\n6,5,\n", "3 cells in line 2 (the header has 2)"),
        (f"{HEIGHT},{SEPARATION}\n6,3,\n7,3\n", "3 cells in line 2 (the header has 2)"),
        (f"{HEIGHT}\n6,5\n7,5\n", "2 cells in line 2 (the header has 1)"),
    ],
)
def test_what_is_wrong_with_a_csv_is_said_in_words(
    read: Read, tmp_path: Path, text: str, said: str
) -> None:
    (tmp_path / "t.csv").write_text(text)
    (problem,) = problems(read, "table: t.csv")
    assert said in problem


@pytest.mark.parametrize(
    "text",
    [
        f"{HEIGHT};{SEPARATION}\n6,5;3\n7;3,5\n",
        f"\ufeff{HEIGHT};{SEPARATION};\r\n6,5;3;\r\n7;3,5;\r\n",
        f"{HEIGHT}\t{SEPARATION}\n6.5\t3\n7\t3.5\n",
        f"{HEIGHT} {SEPARATION}\n6.5 3\n7 3.5\n",
        f"  {HEIGHT}    {SEPARATION}\n   6.5   3\n   7     3.5\n",
        f"{HEIGHT},{SEPARATION},\n6.5,3,\n7,3.5,\n",
        f"{HEIGHT},{SEPARATION}\n6.5,3,\n7,3.5,\n",
        f'"{HEIGHT}";"{SEPARATION}"\n"6,5";"3"\n7;3,5\n',
        f"# of the lab\n{HEIGHT};{SEPARATION}\n6,5;3\n# more\n7;3,5\n",
        f"{HEIGHT};{SEPARATION}\n6,500;3\n7;3,5\n",
    ],
)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_a_table_as_any_spreadsheet_writes_it(
    read: Read, tmp_path: Path, text: str, encoding: str
) -> None:
    (tmp_path / "t.csv").write_bytes(text.encode(encoding))
    assert designs(read("table: t.csv")) == {HEIGHT: [6.5, 7], SEPARATION: [3, 3.5]}


def test_decimals_of_a_database_are_numbers(read: Read, tmp_path: Path) -> None:
    heights = pa.array([Decimal("6.50"), Decimal("7.00")], pa.decimal128(10, 2))
    counts = pa.array([Decimal(3), Decimal(5)], pa.decimal256(40, 0))
    table = pa.table({HEIGHT: heights, "finger.units": counts})
    pq.write_table(table, tmp_path / "t.parquet")
    found = read("table: t.parquet").space.designs(0, 2)
    assert found[HEIGHT].tolist() == [6.5, 7.0]
    assert found["finger.units"].dtype == np.int64
    assert found["finger.units"].tolist() == [3, 5]
    gap = pa.table({HEIGHT: pa.array([Decimal("6.5"), None], pa.decimal128(10, 2))})
    pq.write_table(gap, tmp_path / "t.parquet")
    assert "finite numbers in column" in problems(read, "table: t.parquet")[0]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A table of two parts, as Spark writes it, beside what is no part."""
    folder = tmp_path / "d.parquet"
    folder.mkdir()
    for name, height in (("part-1.parquet", 7.0), ("part-0.snappy.parquet", 6.5)):
        pq.write_table(pa.table({HEIGHT: [height], SEPARATION: [3.0]}), folder / name)
    for name in ("_SUCCESS", "._SUCCESS.crc", ".part-0.parquet.crc", "_metadata.parquet"):
        (folder / name).write_text("")
    return folder


def test_a_folder_is_the_table_of_its_parts(read: Read, folder: Path) -> None:
    sweep = read("table: d.parquet")
    assert designs(sweep) == {HEIGHT: [6.5, 7], SEPARATION: [3, 3]}
    assert {path.name for path in sweep.files} >= {folder.name, "part-1.parquet"}
    pq.write_table(pa.table({HEIGHT: [8.0], SEPARATION: [3.0]}), folder / "part-2.parquet")
    more = read("table: d.parquet")
    assert designs(more)[HEIGHT] == [6.5, 7, 8]
    assert more.digests != sweep.digests


def test_no_part_of_a_folder_is_lost_by_its_name(read: Read, tmp_path: Path) -> None:
    parts = tmp_path / "d"
    (parts / "e").mkdir(parents=True)
    for name, height in (("p1.csv", 6.0), ("p2.CSV", 6.5), ("e/p3.Csv", 7.0)):
        (parts / name).write_text(f"{HEIGHT}\n{height}\n")
    assert designs(read("table: d")) == {HEIGHT: [7, 6, 6.5]}
    for name in ("e/p4.csv.gz", "p4.tsv", "p4", "p4.parquet.tmp"):
        (parts / name).write_text(f"{HEIGHT}\n8\n")
        (problem,) = problems(read, "table: d")
        assert f'found "{name}" beside its parts (take out what is no part)' in problem
        (parts / name).unlink()
    (parts / "p5.PARQUET").write_text("")
    assert "keep one kind of them" in problems(read, "table: d")[0]


def test_values_in_the_names_of_folders_are_columns(read: Read, tmp_path: Path) -> None:
    for height in (6.5, 7.0):
        part = tmp_path / "d" / f"{HEIGHT}={height}" / "finger.units=3"
        part.mkdir(parents=True)
        pq.write_table(pa.table({SEPARATION: [3.0, 3.5]}), part / "p.parquet")
    found = read("table: d").space.designs(0, 4)
    assert found[HEIGHT].tolist() == [6.5, 6.5, 7, 7]
    assert found["finger.units"].tolist() == [3] * 4


def test_every_folder_that_was_looked_into_is_one_of_the_files(read: Read, tmp_path: Path) -> None:
    """A part that is new in one of them changes the table: Make looks at the folder's time."""
    for inner in ("a/b", "empty", "_left/out"):
        (tmp_path / "d" / inner).mkdir(parents=True)
    (tmp_path / "d" / "a" / "b" / "p.csv").write_text(f"{HEIGHT}\n6\n")
    sweep = read("table: d")
    found = [path.relative_to(tmp_path).as_posix() for path in sweep.files if "d" in path.parts]
    assert sorted(found) == ["d", "d/a", "d/a/b", "d/a/b/p.csv", "d/empty"]
    (tmp_path / "d" / "empty").rmdir()
    assert read("table: d").digests == sweep.digests, "the designs are the same"


@pytest.mark.slow
def test_a_folder_however_deep_is_walked(
    read: Read, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folders = [tmp_path / "d" / "/".join("e" * depth) for depth in range(1500)]
    for folder in folders:  # pathlib goes down by itself no further than Python calls
        folder.mkdir()
    part = folders[-1] / "p.csv"
    part.write_text(f"{HEIGHT}\n6\n")
    assert designs(read("table: d")) == {HEIGHT: [6]}
    monkeypatch.setattr("dpgcli.files.sweep_file.folders.MOST_PARTS", 1000)
    assert "a folder of more than 1,000 files" in problems(read, "table: d")[0]
    part.unlink()
    for folder in reversed(folders):
        folder.rmdir()


def test_what_is_wrong_with_a_folder(read: Read, folder: Path, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    assert "a folder without any .parquet or .csv file" in problems(read, "table: empty")[0]
    pq.write_table(pa.table({HEIGHT: [8.0]}), folder / "part-2.parquet")
    assert "other columns in part-2.parquet" in problems(read, "table: d.parquet")[0]
    (folder / "part-2.parquet").unlink()
    (folder / "part-3.parquet").symlink_to("part-1.parquet")
    assert "links in it" in problems(read, "table: d.parquet")[0], "no part is left out in silence"
    (folder / "part-3.parquet").unlink()
    (folder / "a.csv").write_text(f"{HEIGHT}\n6\n")
    assert "keep one kind of them" in problems(read, "table: d.parquet")[0]
    (folder / "a.csv").unlink()
    (folder / "part-1.parquet").write_bytes(b"PAR1 cut off")
    assert len(problems(read, "table: d.parquet")) == 1


def test_a_column_has_one_source(read: Read, tmp_path: Path) -> None:
    """The name of a folder does not replace the column of a file, nor another folder's."""
    inner = tmp_path / "d" / f"{HEIGHT}=2.5"
    inner.mkdir(parents=True)
    (inner / "a.csv").write_text(f"{HEIGHT}\n4\n")
    assert f"{HEIGHT} twice, for a.csv" in problems(read, "table: d")[0]
    (inner / "a.csv").unlink()
    twice = inner / f"{HEIGHT}=3"
    twice.mkdir()
    (twice / "b.csv").write_text(f"{SEPARATION}\n3\n")
    assert f"{HEIGHT} twice, for b.csv" in problems(read, "table: d")[0]


def test_parts_have_the_types_of_the_first(read: Read, folder: Path) -> None:
    wrong = pa.table({HEIGHT: [True], SEPARATION: [3.0]})
    pq.write_table(wrong, folder / "part-2.parquet")
    assert "other types in part-2.parquet" in problems(read, "table: d.parquet")[0]
    pq.write_table(wrong.slice(0, 0), folder / "part-2.parquet")
    assert designs(read("table: d.parquet"))[HEIGHT] == [6.5, 7], "an empty part has none"


def test_the_parts_of_a_folder_have_room_together(
    read: Read, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("dpgcli.files.sweep_file.space.MOST_NUMBERS", 3)
    assert "found 4 numbers of 2 keys" in problems(read, "table: d.parquet")[0]
    monkeypatch.setattr("dpgcli.files.sweep_file.space.MOST_NUMBERS", 4)
    monkeypatch.setattr("dpgcli.files.sweep_file.space.MOST_KEYS", 2)
    assert read("table: d.parquet").space.size == 2


def test_a_header_without_end_is_refused_before_the_rest_is_read(
    read: Read, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    keys = ",".join(f"k{place}" for place in range(300))
    (tmp_path / "t.csv").write_text(f"# many\n{keys}\n{'1,' * 299}1\n", encoding="utf-8")
    monkeypatch.setattr(pd, "read_csv", None)
    assert "found 300 numbers of 300 keys" in problems(read, "table: t.csv")[0]


def test_a_table_is_a_file_and_nothing_else(read: Read, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "t.csv")
    assert "found a device or pipe" in problems(read, "table: t.csv")[0]
    assert "found a device or pipe" in problems(read, "table: /dev/zero")[0]


def test_nothing_is_quoted_of_a_file_that_is_no_table_of_designs(
    read: Read, tmp_path: Path
) -> None:
    (tmp_path / "secret").write_text("token,owner\nhunter2,root\n")
    (problem,) = problems(read, "table: secret")
    assert problem.endswith(
        "columns that are keys of the spec, such as finger.units, found none in 2"
    )


@pytest.mark.parametrize(
    "secret",
    [
        "hunter2",
        "hunter2: 1",
        "- [hunter2",
        "hunter2: {a: 1}}",
        "hunter2 base finger",
        "hunter2\n  finger: 1\nbase: x\n",
        "hunter2 finger: x: y",
    ],
)
def test_nothing_is_quoted_of_a_base_that_is_no_spec(
    read: Read, tmp_path: Path, secret: str
) -> None:
    (tmp_path / "secret").write_text(secret)
    (problem,) = problems(read, f"{{key: {HEIGHT}, values: [6]}}", head="base: secret")
    assert problem.endswith("expected a spec, with a section finger, found something else")


@pytest.mark.parametrize("spec", ["finger: [\n", "# mine\n'finger': 3: 4\n", '{\n"finger": ]'])
def test_a_base_that_is_a_broken_spec_is_quoted(read: Read, tmp_path: Path, spec: str) -> None:
    (tmp_path / "broken.yaml").write_text(spec)
    (problem,) = problems(read, f"{{key: {HEIGHT}, values: [6]}}", head="base: broken.yaml")
    assert "syntax: expected valid YAML" in problem


def test_more_designs_than_can_be_counted_are_counted_exactly(read: Read) -> None:
    axes = [
        f"{{key: finger.geometry.{key}, linear: {{from: 1, to: 2, count: 1000}}}}"
        for key in sorted(UnitGeometry.model_fields)
    ]
    more = "{key: finger.linear_stiffness_N_per_mm, linear: {from: 1, to: 2, count: 10}}"
    (problem,) = problems(read, *axes, more)
    limit, found = "9,999,999,999", "10,000,000,000,000,000,000"
    assert problem.startswith(f"2:1: space: expected at most {limit} designs, found {found}")


def test_more_designs_than_parts_can_name_are_refused(read: Read) -> None:
    """The names of parts have ten digits for the number of a design."""

    def axes(*counts: int) -> list[str]:
        keys = zip((HEIGHT, SEPARATION), counts, strict=True)
        return [f"{{key: {key}, linear: {{from: 1, to: 2, count: {n}}}}}" for key, n in keys]

    assert read(*axes(99_999, 100_001)).space.size == 9_999_999_999
    (problem,) = problems(read, *axes(100_000, 100_000))
    assert "at most 9,999,999,999 designs, found 10,000,000,000" in problem


def test_the_hash_is_of_the_bytes_that_were_read(read: Read, tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text(f"{HEIGHT}\n6\n")
    digest = hashlib.sha256((tmp_path / "t.csv").read_bytes()).hexdigest()
    assert read("table: t.csv").digests == (digest,)


def test_sweeps_that_say_the_same_are_the_same(read: Read) -> None:
    axis = f"{{key: {HEIGHT}, values: [6]}}"
    said = read(axis).canonical_json()
    assert said == read(axis + "  # a comment").canonical_json()
    assert said != read(axis.replace("6", "7")).canonical_json()
    assert said != read(axis, constraints="[units < 4]").canonical_json()


def test_a_changed_table_is_another_sweep(read: Read, tmp_path: Path) -> None:
    said = []
    for number in (6, 7):
        (tmp_path / "t.csv").write_text(f"{HEIGHT}\n{number}\n")
        said.append(read("table: t.csv").canonical_json())
    assert said[0] != said[1]


def test_ranges_beyond_every_key_are_refused_and_all_others_are_finite(read: Read) -> None:
    assert problems(read, f"{{key: {HEIGHT}, linear: {{from: -1.0e+308, to: 1.0e+308, count: 3}}}}")
    read(f"{{key: {HEIGHT}, log: {{from: 1.0e-300, to: 1.0e+18, count: 3}}}}")
    ranges = f"{{{HEIGHT}: {{from: -1.0e+18, to: 1.0e+18}}}}"
    sweep = read(f"sample: {{method: sobol, count: 4, ranges: {ranges}}}")
    assert np.isfinite(designs(sweep)[HEIGHT]).all()


def test_a_text_among_numbers_is_one_problem(read: Read) -> None:
    (said,) = problems(read, f"{{key: {HEIGHT}, values: [6, tall]}}")
    assert "space.0.values.1: expected a list of numbers" in said


def peak(work: Callable[[], object]) -> int:
    """Bytes that are allocated at once while the work is done."""
    tracemalloc.start()
    work()
    (_, most) = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    return most


@pytest.mark.parametrize(
    ("axes", "found"),
    [
        (
            (f"sample: {{method: sobol, count: 10000000, ranges: {{{SIXTY_FOUR}}}}}",),
            "640,000,000 numbers of 64 keys",
        ),
        (
            (f"sample: {{method: latin_hypercube, count: 10000000, ranges: {{{SIXTY_FOUR}}}}}",),
            "640,000,000 numbers of 64 keys",
        ),
        ((f"{{key: {HEIGHT}, linear: {{from: 1, to: 2, count: 9000000}}}}",) * 3, "27,000,000"),
        ((f"{{key: {HEIGHT}, log: {{from: 1, to: 2, count: 9000000}}}}",) * 3, "27,000,000"),
    ],
)
def test_axes_of_too_many_numbers_are_refused_before_they_are_made(
    read: Read, axes: tuple[str, ...], found: str
) -> None:
    def reading() -> None:
        (*_, last) = problems(read, *axes)
        assert "at most 25,000,000 numbers" in last
        assert found in last

    assert peak(reading) < 4 * 8 * 9_000_000


def test_a_large_axis_takes_the_memory_of_its_numbers(read: Read) -> None:
    axis = f"{{key: {HEIGHT}, linear: {{from: 1, to: 2, count: 1000000}}}}"
    assert peak(lambda: read(axis)) < 3 * 8_000_000


def test_many_keys_are_refused(read: Read) -> None:
    columns = ", ".join(f"finger.overrides.{i}-{j}.geometry.dome_height_mm: [5]" for i, j in PAIRS)
    assert "257 keys up to here" in problems(read, f"paired: {{{columns}}}")[0]


def test_many_axes_are_refused(read: Read) -> None:
    (problem,) = problems(read, *[f"{{key: {HEIGHT}, values: [5]}}"] * 65)
    assert "a list of 1 to 64 axes" in problem


@pytest.mark.parametrize("name", ["wide.csv", "wide.parquet"])
def test_a_table_of_many_columns_is_one_problem(read: Read, tmp_path: Path, name: str) -> None:
    frame = pd.DataFrame(np.ones((2, 5000)), columns=[f"column{i}" for i in range(5000)])
    if name.endswith("csv"):
        frame.to_csv(tmp_path / name, index=False)
    else:
        frame.to_parquet(tmp_path / name)
    began = time.process_time()
    (problem,) = problems(read, f"table: {name}")
    assert "5,000 keys up to here" in problem
    assert time.process_time() - began < 5


def test_a_parquet_table_of_too_many_numbers_is_not_read(
    read: Read, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    values = pa.DictionaryArray.from_arrays(
        pa.array(np.zeros(26_000_000, np.int8)), pa.array([6.5])
    )
    pq.write_table(pa.table({HEIGHT: values}), tmp_path / "long.parquet")
    monkeypatch.setattr(pq.ParquetFile, "read", lambda _: pytest.fail("read"))
    assert "26,000,000 numbers of 1 keys" in problems(read, "table: long.parquet")[0]


def test_of_a_table_with_text_no_more_is_read_than_is_shown(read: Read, tmp_path: Path) -> None:
    """4 GB of it in a file of 100 KB; an index without a name is no column."""
    n_rows = 4_000_000
    text = pa.DictionaryArray.from_arrays(
        pa.array(np.zeros(n_rows, np.int8)), pa.array(["x" * 1000])
    )
    table = pa.table({HEIGHT: np.full(n_rows, 6.5), "note": text})
    pq.write_table(table, tmp_path / "t.parquet", store_schema=False)
    pool = pa.default_memory_pool()
    before = pool.max_memory()
    (problem, *_) = problems(read, "table: t.parquet")
    assert pool.max_memory() - before < 1e9
    assert 'found "xxx' in problem or "expected a known key" in problem
    frame = pd.DataFrame({HEIGHT: np.arange(1.0, 5001.0)}, index=[f"a{i}" for i in range(5000)])
    frame.to_parquet(tmp_path / "t.parquet")
    assert len(designs(read("table: t.parquet"))[HEIGHT]) == 5000


def test_a_key_without_a_value_is_not_absent(read: Read) -> None:
    """As where a file was cut off: without its constraints a sweep has other designs."""
    axis = f"{{key: {HEIGHT}, values: [6], table: }}"
    rules, table = problems(read, axis, head="constraints:\nbase: base.yaml")
    assert rules.startswith("1:1: constraints: expected ")
    assert table.startswith("4:") and "space.0.table: expected " in table
    assert rules.endswith("found nothing") and table.endswith("found nothing")


def test_a_csv_table_of_too_many_bytes_is_not_read(
    read: Read, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with (tmp_path / "long.csv").open("wb") as file:
        file.truncate(2**29 + 2**20)
    monkeypatch.setattr(pd, "read_csv", lambda *_, **__: pytest.fail("read"))
    (problem,) = problems(read, "table: long.csv")
    assert "at most 512 MiB of CSV or Parquet, found 513 MiB" in problem


def test_a_damaged_table_is_refused(read: Read, tmp_path: Path) -> None:
    """One that dpg wrote, and so has its SHA-256 in it."""
    columns = (Column(HEIGHT, "mm", "", Group.STATES, Kind.NUMBER),)
    batch = record_batch(columns, {HEIGHT: np.array([6.0, 7.0])})
    write_table(tmp_path / "t.parquet", schema(columns), [batch], {})
    assert designs(read("table: t.parquet")) == {HEIGHT: [6, 7]}
    content = bytearray((tmp_path / "t.parquet").read_bytes())
    content[50] ^= 1
    (tmp_path / "t.parquet").write_bytes(content)
    assert 'found "damaged: its bytes are not those' in problems(read, "table: t.parquet")[0]


def test_what_says_how_exact_a_key_is_cannot_be_meant(read: Read, tmp_path: Path) -> None:
    base = tmp_path / "base.yaml"
    text = base.read_text(encoding="utf-8")
    base.write_text(
        f"{text}uncertainty: {{stroke_mm: 0.1, dome_height_mm: 0.1}}\n", encoding="utf-8"
    )
    axis = f"{{key: {HEIGHT}, values: [6, 6.5]}}"
    assert read(axis, constraints="[dome_height_mm > 1]").constraints
    assert problems(read, axis, constraints="[stroke_mm > 1]")


@pytest.mark.parametrize("gap", ["", " ", "\t"])
def test_an_empty_line_among_rows_of_one_cell_is_an_empty_cell(
    read: Read, tmp_path: Path, gap: str
) -> None:
    table, head = tmp_path / "t.csv", f"# note\n\n{HEIGHT}\n6\n"
    table.write_text(f"{head}{gap}\n6.5\n", encoding="utf-8")
    (problem,) = problems(read, "table: t.csv")
    assert "found an empty cell in line 5 (no text, no gaps)" in problem
    table.write_text(f"{head}# note\n6.5\n\n\n", encoding="utf-8")
    assert read("table: t.csv").space.size == 2
