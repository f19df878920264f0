"""What to trust is said where it is used: explain, predict, tables, requirements, rankings."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import dpgcli as dpg
from dpgcli.cli.exits import ExitCode
from dpgcli.design.outputs import Output
from dpgcli.files.table_writer import read_metadata
from dpgcli.files.trust import trusts_in, warnings_in

Call = Callable[..., Any]
SERIAL = ("-o", "out", "--executor", "serial")
HEAD = "calibration_version: 1\nmade_by: hand\nmethod: none\n"
GEOMETRY = (
    "geometry: {dome_height_mm: 6.5, dome_thickness_mm: 0.75, chamber_length_mm: 9, "
    "channel_width_mm: 10, unit_separation_mm: 3, elastic_modulus_MPa: 26, "
    "chamber_width_mm: 20, limiting_layer_thickness_mm: 1.5}\n"
)
TRAVEL = np.linspace(0.0, 16.0, 65)
ENERGY = 0.02 * TRAVEL**2 * (TRAVEL - 13.2) ** 2 + 0.1 * TRAVEL**2
PUSH = ("-s", "finger.law=push_only")
BARS = ("-s", "finger.linear_stiffness_N_per_mm=2e4")
WALL = ("-s", "finger.wall_compliance_mm_per_N=0.7")
DOME = (*PUSH, "-s", "finger.calibration=[dome.yaml,published]")
GAP = (*PUSH, "-s", "finger.calibration=[gap.yaml,published]")
REQUIRED = {
    "reach_max_mm": "shapes",
    "n_stable": "shapes",
    "min_barrier_mJ": "barriers",
    "stiffness_min_N_per_mm": "ground stiffness",
    "stiffness_max_N_per_mm": "stiffness along the bars",
}


def curve(*, gap: bool, warnings: str = "[]") -> str:
    kept = (TRAVEL <= 2.0) | (TRAVEL - 8.0 >= 0.0) if gap else TRAVEL >= 0.0
    values = "values: {bistable_stiffness_N_per_mm: {value: 100}, stroke_mm: {value: 3.5}}\n"
    points = f"  travel_mm: {TRAVEL[kept].tolist()}\n  energy_mJ: {ENERGY[kept].tolist()}\n"
    unsampled = "  unsampled_mm: [[2, 8]]\n" if gap else ""
    said = f"curve:\n{points}  opening_per_travel: 0.35\n{unsampled}warnings: {warnings}\n"
    return HEAD + values + GEOMETRY + said


@pytest.fixture
def domes(folder: Path) -> Path:
    """A sweep around the study's finger, of two heights, and curves with a gap and without."""
    (folder / "dome.yaml").write_text(curve(gap=False))
    (folder / "gap.yaml").write_text(curve(gap=True, warnings="[nothing is sampled between]"))
    axis = "{key: finger.geometry.unit_separation_mm, values: [3, 3.2]}"
    (folder / "sweep.yaml").write_text(f"base: three_unit.yaml\nspace: [{axis}]\n")
    return folder


def warned(text: str) -> list[str]:
    return [line for line in text.splitlines() if line.startswith("warning: ")]


SPACES = [
    pytest.param(
        (), {"min_barrier_mJ", "stiffness_min_N_per_mm", "stiffness_max_N_per_mm"}, id="published"
    ),
    pytest.param((*DOME, *WALL, *BARS), set(), id="curve, walls, bars"),
    pytest.param((*GAP, *WALL, *BARS), {"min_barrier_mJ"}, id="a gap"),
    pytest.param(
        (*DOME, *BARS), {"stiffness_min_N_per_mm", "stiffness_max_N_per_mm"}, id="rigid walls"
    ),
    pytest.param((*DOME, *WALL), {"stiffness_max_N_per_mm"}, id="assumed bars"),
    pytest.param(
        (*PUSH, *BARS),
        {"min_barrier_mJ", "stiffness_min_N_per_mm", "stiffness_max_N_per_mm"},
        id="pushing",
    ),
    pytest.param(
        ("-s", "finger.geometry.dome_height_mm=8", *BARS), set(REQUIRED), id="extrapolated"
    ),
]


@pytest.mark.parametrize(("settings", "doubted"), SPACES)
def test_each_doubt_is_one_line_and_alone(
    call: Call, domes: Path, settings: tuple[str, ...], doubted: set[str]
) -> None:
    """By `sweep` before the work, and by `check` from the table alone; `--strict` refuses it."""
    rules = {name: f"{name} > -1" for name in REQUIRED}
    options = [word for rule in rules.values() for word in ("--require", rule)]
    done = call("sweep", "sweep.yaml", *SERIAL, *settings, *options)
    assert done.exit_code == ExitCode.DONE
    required = [line for line in warned(done.stderr) if "--require" in line]
    beginnings = {
        name: f"warning: --require '{rules[name]}': {name} rests on " for name in REQUIRED
    }
    assert len(required) == len(doubted)
    for name in doubted:
        assert sum(line.startswith(beginnings[name]) for line in required) == 1
    for name, rule in rules.items():
        checked = call("check", "out/designs.parquet", "--require", rule)
        assert checked.exit_code == ExitCode.DONE
        lines = warned(checked.stderr)
        assert lines == [line for line in required if line.startswith(beginnings[name])]
        strict = call("check", "out/designs.parquet", "--require", rule, "--strict")
        assert strict.exit_code == (ExitCode.USAGE if name in doubted else ExitCode.DONE)
        assert (strict.stdout == "") is (name in doubted)


NO_REQUIREMENT = "dpg: --strict allows no requirement on what is doubted:"
NO_RANKING = "dpg: --strict allows no ranking by what is doubted:"
UNSEEN = {"stiffness_max_N_per_mm"}  # whether designs are ranked by it is known by their states


@pytest.mark.parametrize("rule", ["n_states > 0", "min_barrier_mJ > 0.1"])
@pytest.mark.parametrize("of", [(), ("--shard", "1/2")])
@pytest.mark.parametrize(("settings", "doubted"), SPACES)
def test_strict_is_an_error_before_the_work(
    call: Call,
    domes: Path,
    settings: tuple[str, ...],
    doubted: set[str],
    of: tuple[str, ...],
    rule: str,
) -> None:
    """Of requirements and of rankings, in the words of `report`; of a shard there is no table."""
    required = () if of else ("--require", rule)
    done = call("sweep", "sweep.yaml", *SERIAL, *settings, *required, *of, "--strict")
    is_refused = bool(doubted - UNSEEN)
    assert done.exit_code == (ExitCode.USAGE if is_refused else ExitCode.DONE)
    assert (domes / "out").exists() is not is_refused
    lines = done.stderr.splitlines() if is_refused else []
    if required and "min_barrier_mJ" in doubted and rule.startswith("min_barrier_mJ"):
        assert lines[0] == NO_REQUIREMENT
        assert lines[1].startswith(f"dpg: --require '{rule}': min_barrier_mJ rests on barriers (")
        lines = lines[2:]
    if is_refused:
        call("sweep", "sweep.yaml", *SERIAL, *settings, "-q")
        assert lines == call("report", "out", "--strict").stderr.splitlines()
        assert lines[0] == NO_RANKING
        words = " ".join(line.split(" rests on ")[0].split(" rest on ")[0] for line in lines)
        assert all(name in words for name in doubted - UNSEEN - {"n_stable"})


def test_a_ranking_that_is_known_by_its_states_is_refused_after_them(
    call: Call, domes: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The largest stiffness shows more than the bars only where a hinge is as stiff as they are."""
    axis = "{key: finger.lattice.hinge_stiffness_N_mm_per_rad, values: [24, 1e7]}"
    (domes / "sweep.yaml").write_text(f"base: three_unit.yaml\nspace: [{axis}]\n")
    done = call("sweep", "sweep.yaml", *SERIAL, *DOME, *WALL, "--strict")
    assert (done.exit_code, done.stdout) == (ExitCode.USAGE, "")
    assert {path.name for path in (domes / "out").iterdir()} >= {"designs.parquet", "report.md"}
    head, *lines = [line for line in done.stderr.splitlines() if line.startswith("dpg: ")]
    assert head == NO_RANKING
    assert [line.split(" rests on ")[0] for line in lines] == [
        "dpg: ranking: stiffness_max_N_per_mm"
    ]
    again = call("sweep", "sweep.yaml", *SERIAL, *DOME, *WALL, "--strict")
    assert again.exit_code == ExitCode.USAGE, "also where there is nothing left to do"
    assert call("sweep", "sweep.yaml", *SERIAL, *DOME, *WALL).exit_code == ExitCode.DONE
    monkeypatch.chdir(domes)
    settings = [text for text in (*DOME, *WALL) if text != "-s"]
    with pytest.raises(dpg.UsageError, match=r"^strict allows no ranking.*\n.*stiffness_max_N"):
        dpg.sweep("sweep.yaml", executor="serial", settings=settings, strict=True)


def test_where_nothing_can_be_judged_nothing_is_refused(call: Call, domes: Path) -> None:
    """A table of designs that constraints exclude does not say what it rests on."""
    text = (domes / "sweep.yaml").read_text()
    (domes / "sweep.yaml").write_text(text + "constraints: [unit_separation_mm > 9]\n")
    assert call("sweep", "sweep.yaml", *SERIAL, "--strict").exit_code == ExitCode.DONE
    assert call("report", "out", "--strict").exit_code == ExitCode.DONE
    checked = call("check", "out/designs.parquet", "--require", "n_stable > 0", "--strict")
    assert checked.exit_code == ExitCode.NOTHING_SELECTED


def test_a_doubt_names_the_basis_and_what_to_do(call: Call, domes: Path) -> None:
    done = call(
        "sweep", "sweep.yaml", *SERIAL, *GAP, *WALL, *BARS, "--require", "min_barrier_mJ > 1"
    )
    assert warned(done.stderr)[0] == (
        "warning: --require 'min_barrier_mJ > 1': min_barrier_mJ rests on barriers (assumed: "
        "nothing is sampled in gap.yaml from 2 to 8 mm of the dome's travel: bridged by a "
        "polynomial; sample the dome's curve between rest and its inverted well)"
    )


def test_a_doubt_says_of_how_many_designs(call: Call, domes: Path) -> None:
    axis = "{key: finger.geometry.dome_height_mm, values: [2.5, 6.5, 7.5, 8.5]}"
    rules = "constraints: [dome_height_mm < 9]\n"
    (domes / "sweep.yaml").write_text(f"base: three_unit.yaml\nspace: [{axis}]\n{rules}")
    done = call("sweep", "sweep.yaml", *SERIAL, "--require", "reach_max_mm > 1")
    assert "reach_max_mm rests on shapes (extrapolated in 1 of 3 designs: " in done.stderr
    (domes / "sweep.yaml").write_text(
        f"base: three_unit.yaml\nspace: [{axis}]\nconstraints: [dome_height_mm < 8]\n"
    )
    again = call("sweep", "sweep.yaml", *SERIAL, "--require", "reach_max_mm > 1")
    assert "reach_max_mm" not in again.stderr, "what is excluded does not count"


@pytest.mark.parametrize(("most", "share"), [(10**6, "2 of 4"), (2, "1 of 2")])
def test_designs_are_asked_a_chunk_at_a_time(
    call: Call, domes: Path, monkeypatch: pytest.MonkeyPatch, most: int, share: str
) -> None:
    """Of many, some that are spread evenly."""
    monkeypatch.setattr("dpgcli.studies.sweep.ASKED_AT_ONCE", 1)
    monkeypatch.setattr("dpgcli.studies.sweep.MOST_ASKED", most)
    axis = "{key: finger.geometry.dome_height_mm, values: [6.5, 7.5, 8.5, 9.5]}"
    (domes / "sweep.yaml").write_text(f"base: three_unit.yaml\nspace: [{axis}]\n")
    facts = json.loads(call("explain", "sweep.yaml", "--format", "json").stdout)
    assert facts["trust"][0]["share"] == f"{share} designs"


def test_a_ranking_is_warned_of_and_refused(call: Call, domes: Path) -> None:
    done = call("sweep", "sweep.yaml", *SERIAL)
    beginnings = [
        f"warning: ranking: {name} rests on "
        for name in ("stiffness_min_N_per_mm", "min_barrier_mJ")
    ]
    lines = warned(done.stderr)
    assert [line.startswith(b) for line, b in zip(lines, beginnings, strict=True)] == [True, True]
    shown = call("report", "out")
    assert warned(shown.stderr) == lines
    for line in lines:
        assert f"Warning: {line.removeprefix('warning: ')}." in shown.stdout
    strict = call("report", "out", "--strict", "-o", "page.html")
    assert (strict.exit_code, strict.stdout) == (ExitCode.USAGE, "")
    assert not (domes / "page.html").exists()
    first, *others = strict.stderr.splitlines()
    assert first == NO_RANKING
    assert [f"warning: {line.removeprefix('dpg: ')}" for line in others] == lines
    assert call("sweep", "sweep.yaml", *SERIAL, "-q", "--restart").stderr == ""


def test_a_ranking_without_a_doubt(call: Call, domes: Path) -> None:
    done = call("sweep", "sweep.yaml", *SERIAL, *DOME, *WALL)
    assert warned(done.stderr) == [], "bars alone are not ranked"
    strict = call("report", "out", "--strict")
    assert (strict.exit_code, strict.stderr) == (ExitCode.DONE, "")


def test_merged_shards_say_the_same(call: Call, domes: Path) -> None:
    assert call("sweep", "sweep.yaml", *SERIAL).exit_code == ExitCode.DONE
    for number in (1, 2):
        part = ("--shard", f"{number}/2", "-o", f"part{number}", "--executor", "serial")
        assert call("sweep", "sweep.yaml", *part).exit_code == ExitCode.DONE
    done = call("merge", "part1", "part2", "-o", "whole")
    assert len(warned(done.stderr)) == 2
    for name in ("designs.parquet", "states.parquet"):
        assert (domes / "whole" / name).read_bytes() == (domes / "out" / name).read_bytes()


def section(text: str, title: str) -> list[str]:
    lines = text.splitlines()
    start = lines.index(title) + 1
    return [line.strip() for line in lines[start : lines.index("", start)]]


def test_explain_has_the_table(call: Call, domes: Path) -> None:
    head, *rows, doubted, warning = section(
        call("explain", "three_unit.yaml", *GAP).stdout, "What to trust"
    )
    assert head.split("  ")[0] == "output"
    names = [row.split("  ")[0] for row in rows]
    assert names == [
        "shapes",
        "energies and barriers",
        "of these, barriers",
        "ground stiffness",
        "inverted stiffness",
        "stiffness along the bars",
        "pressures",
        "forces",
    ]
    places = [head.index(word) for word in ("output", "basis", "known error", "from")]
    for row in rows:
        assert all(row[place - 2 : place].isspace() for place in places[1:])
        assert all(not row[place].isspace() for place in places)
    assert doubted == (
        "choose no design by these without more: barriers, inverted stiffness, stiffness along "
        "the bars, forces (dpg help trust)"
    )
    assert warning == "warning: gap.yaml: nothing is sampled between"


def test_barriers_like_energies_have_no_row_of_their_own(call: Call, domes: Path) -> None:
    for settings in ((), (*DOME, *WALL)):
        _, *rows, _ = section(call("explain", "three_unit.yaml", *settings).stdout, "What to trust")
        assert [row.split("  ")[0] for row in rows][:3] == [
            "shapes",
            "energies and barriers",
            "ground stiffness",
        ]


def test_where_nothing_is_doubted_nothing_is_said(call: Call, domes: Path) -> None:
    found = section(call("explain", "three_unit.yaml", *DOME, *WALL, *BARS).stdout, "What to trust")
    assert len(found) == 8
    assert "choose no design" not in "".join(found)


@pytest.mark.parametrize("name", ["three_unit.yaml", "sweep.yaml"])
def test_explain_for_programs(call: Call, domes: Path, name: str) -> None:
    facts = json.loads(call("explain", name, *GAP, "--format", "json").stdout)
    assert [row["output"] for row in facts["trust"]] == [*Output]
    assert facts["trust"][2]["basis"] == "assumed"
    assert facts["warnings"] == ["gap.yaml: nothing is sampled between"]
    lines = section(call("explain", name, *GAP).stdout, "What to trust")
    assert all(any(row["known_error"] in line for line in lines) for row in facts["trust"])


def test_explain_of_a_space_without_a_design(call: Call, domes: Path) -> None:
    text = (domes / "sweep.yaml").read_text()
    (domes / "sweep.yaml").write_text(text + "constraints: [unit_separation_mm > 9]\n")
    found = section(call("explain", "sweep.yaml").stdout, "What to trust")
    assert found == ["nothing: there is no design to solve"]
    for strict in ((), ("--strict",)):
        done = call("sweep", "sweep.yaml", *SERIAL, "--require", "n_stable > 0", *strict)
        assert done.exit_code == ExitCode.NOTHING_SELECTED


def test_the_summary_of_predict_has_the_warnings(call: Call, domes: Path) -> None:
    lines = call("predict", "three_unit.yaml", *GAP).stderr.splitlines()
    assert lines[-2] == "warning: gap.yaml: nothing is sampled between"
    assert lines[-1].startswith("the model's own error: shapes curl 13–24 % too far")
    assert warned(call("predict", "three_unit.yaml", *DOME).stderr) == []


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        ((*DOME, *WALL), "unknown for these walls; fitted ones bring shapes within 1–6 % of the"),
        (
            (*PUSH, "-s", "finger.calibration=[walls.yaml,dome.yaml,published]"),
            "shapes within 1–6 %",
        ),
    ],
)
def test_the_last_word_knows_walls(
    call: Call, domes: Path, settings: tuple[str, ...], sentence: str
) -> None:
    values = "values: {wall_compliance_mm_per_N: {value: 0.7}}\n"
    (domes / "walls.yaml").write_text(HEAD + values + GEOMETRY)
    last = call("predict", "three_unit.yaml", *settings).stderr.splitlines()[-1]
    assert last.startswith(f"the model's own error: {sentence}")
    assert "pushes within about 10 %" in last
    assert "stiffness within 30 %" in last


def test_tables_of_states_say_the_basis_of_each_column(call: Call, domes: Path) -> None:
    columns = ("--columns", "all")
    call("predict", "three_unit.yaml", *GAP, *columns, "-o", "states.parquet", "-q")
    schema = pq.read_schema(domes / "states.parquet")
    bases = {f.name: f.metadata.get(b"basis", b"").decode() for f in schema}
    assert {name for name, basis in bases.items() if not basis} == {
        "pattern",
        "residual_N",
        "numerical_error_mm",
        "reached_pattern",
    }
    assert bases["tip_x_mm"] == bases["B3_y_mm"] == bases["opening_1_mm"] == "published"
    assert bases["energy_mJ"] == bases["hinge_energy_mJ"] == "fitted"
    assert bases["tip_stiffness_min_N_per_mm"] == bases["bar_energy_mJ"] == "assumed"
    metadata = read_metadata(domes / "states.parquet")
    assert trusts_in(metadata)[Output.ENERGIES].source.startswith("curve of gap.yaml")
    assert warnings_in(metadata) == ["gap.yaml: nothing is sampled between"]


def test_tables_of_designs_do_so_too(call: Call, domes: Path) -> None:
    call("sweep", "sweep.yaml", *SERIAL, *GAP, "-q")
    schema = pq.read_schema(domes / "out" / "designs.parquet")
    bases = {f.name: f.metadata.get(b"basis", b"").decode() for f in schema}
    assert {name for name, basis in bases.items() if not basis} == {
        "design",
        "unit_separation_mm",
        "calibration",
        "status",
        "reason",
        "n_units",
        "n_states",
        "n_unknown_states",
        "max_residual_N",
        "max_numerical_error_mm",
    }
    assert bases["min_barrier_mJ"] == bases["stiffness_max_N_per_mm"] == "assumed"
    assert bases["workspace_area_mm2"] == bases["n_stable"] == "published"
    outputs = schema.field("stiffness_max_N_per_mm").metadata[b"outputs"].decode()
    assert outputs == "stiffness along the bars, ground stiffness, inverted stiffness"
    report = (domes / "out" / "report.md").read_text()
    assert "## What to trust" in report
    assert (
        "| barriers | assumed | unknown | nothing is sampled in gap.yaml from 2 to 8 mm" in report
    )
    assert "Warning: gap.yaml: nothing is sampled between." in report


def test_a_table_that_does_not_say_it_is_taken_but_not_strictly(call: Call, domes: Path) -> None:
    """Such as one that pandas has written."""
    call("sweep", "sweep.yaml", *SERIAL, "-q")
    pd.read_parquet(domes / "out" / "designs.parquet").to_parquet(domes / "own.parquet")
    rule = ("own.parquet", "--require", "min_barrier_mJ > 0")
    done = call("check", *rule)
    assert (done.exit_code, done.stderr) == (ExitCode.DONE, "")
    (domes / "own").mkdir()
    shutil.copy(domes / "own.parquet", domes / "own" / "designs.parquet")
    assert call("report", "own").exit_code == ExitCode.DONE
    for strict in (call("check", *rule, "--strict"), call("report", "own", "--strict")):
        assert strict.exit_code == ExitCode.USAGE
        assert strict.stderr == (
            "dpg: --strict needs a table that says what its columns rest on, "
            "as dpg sweep writes it\n"
        )


def test_json_of_check_has_the_warnings(call: Call, domes: Path) -> None:
    call("sweep", "sweep.yaml", *SERIAL, "-q")
    rules = ("--require", "min_barrier_mJ > 0", "--require", "reach_max_mm > 0")
    first, second = json.loads(
        call("check", "out/designs.parquet", *rules, "--format", "json").stdout
    )
    assert first["warnings"][0].startswith("--require 'min_barrier_mJ > 0': min_barrier_mJ rests")
    assert second["warnings"] == []
    call("check", "out/designs.parquet", *rules, "--summary-file", "summary.md")
    _, met, warning, *rest = (domes / "summary.md").read_text().split("\n\n")
    assert met.startswith("met: min_barrier_mJ")
    assert warning.startswith("Warning: require 'min_barrier_mJ \\> 0': min_barrier_mJ rests on")
    assert len(rest) == 1


def test_from_python(domes: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(domes)
    settings = {"finger.law": "push_only", "finger.calibration": ["gap.yaml", "published"]}
    rule = "min_barrier_mJ > 1"
    result = dpg.sweep("sweep.yaml", executor="serial", settings=settings, require=rule)
    (verdict,) = result.verdicts
    assert verdict.is_met
    assert verdict.warnings[0].startswith(f"require {rule!r}: min_barrier_mJ rests on barriers")
    assert result.warnings == (
        "gap.yaml: nothing is sampled between",
        *verdict.warnings,
        *(line for line in result.warnings if line.startswith("ranking: ")),
    )
    assert len(result.warnings) == 4
    (again,) = dpg.check(result.designs, rule)
    assert again.warnings == verdict.warnings
    for strict in (
        lambda: dpg.check(result.designs, rule, strict=True),
        lambda: dpg.sweep("sweep.yaml", "no", settings=settings, require=rule, strict=True),
    ):
        with pytest.raises(dpg.UsageError, match="strict allows no requirement"):
            strict()
    with pytest.raises(dpg.UsageError, match=r"^strict allows no ranking by what is doubted:\n"):
        dpg.sweep("sweep.yaml", "no", settings=settings, strict=True)
    with pytest.raises(dpg.UsageError, match=r"^require needs the whole table"):
        dpg.sweep("sweep.yaml", "no", require=rule, shard="1/2")
    assert not Path("no").exists()
    dpg.sweep("sweep.yaml", "out", executor="serial", settings=settings)
    assert "## What to trust" in dpg.report("out")
    with pytest.raises(dpg.UsageError, match="strict allows no ranking"):
        dpg.report("out", strict=True)
    states = dpg.predict("three_unit.yaml", settings=settings)
    assert states.warnings == ("gap.yaml: nothing is sampled between",)
    assert [trust.output for trust in states.trusts] == [*Output]
    for name in ("sweep.yaml", "three_unit.yaml"):
        plan = dpg.explain(name, settings=settings)
        assert plan.warnings == states.warnings
        assert [trust.basis for trust in plan.trusts] == [t.basis for t in states.trusts]


def test_values_without_a_spec_rest_on_nothing_that_is_known() -> None:
    from dpgcli.mechanics.finger import STUDY, uniform_finger

    found = dpg.predict(uniform_finger(2, **STUDY))
    assert (found.trusts, found.warnings) == ((), ())
    assert b"basis" not in (found.to_arrow().schema.field("tip_x_mm").metadata or {})


@pytest.mark.parametrize(
    "text", ["{", "[]", '{"a": 1}', '[{"output": "shapes"}]', "[3]", "[" * 9999]
)
def test_metadata_that_say_nothing(domes: Path, text: str) -> None:
    assert trusts_in({"dpg.trust": text}) == {}
    assert warnings_in({"dpg.warnings": text}) == []
    facts = {"design": [0], "calibration": [""], "status": ["stable"], "n_unknown_states": [0]}
    table = pa.table(facts)
    rest = table.append_column("reason", pa.array([""])).append_column("n_stable", pa.array([4]))
    said = rest.replace_schema_metadata({"dpg.trust": text})
    (verdict,) = dpg.check(said, "n_stable > 0")
    assert verdict.warnings == ()
