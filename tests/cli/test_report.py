"""`dpg report`: a finished sweep as Markdown and as a page."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from dpgcli.cli.exits import ExitCode

Call = Callable[..., Any]
SWEEP = """
base: three_unit.yaml
space:
  - {key: finger.geometry.dome_height_mm, values: [2.5, 4.5, 6.5]}
  - {key: finger.geometry.unit_separation_mm, values: [2.0, 3.0]}
"""
AGAIN = ("sweep", "sweep.yaml", "-o", "out", "-j", "1")


@pytest.fixture
def swept(call: Call, folder: Path) -> Path:
    """The folder of a finished sweep."""
    (folder / "sweep.yaml").write_text(SWEEP, encoding="utf-8")
    result = call("sweep", "sweep.yaml", "-o", "out", "-j", "1")
    assert result.exit_code == 0, result.stderr
    return folder / "out"


def test_markdown_goes_to_standard_output(call: Call, swept: Path) -> None:
    result = call("report", "out")
    assert result.exit_code == 0
    assert all(line.startswith("warning: ranking: ") for line in result.stderr.splitlines())
    lines = result.stdout.splitlines()
    assert lines[2] == (
        "6 designs over dome_height_mm (2.5 … 6.5 mm, 3 values), "
        "unit_separation_mm (2 … 3 mm, 2 values)."
    )
    assert "| stable | 5 | 1 | 3 | 1 | 0 |" in lines
    assert "| 3 mm | 2.5 mm | 4.5 mm | 6.5 mm | – |" in lines
    areas = pq.read_table(swept / "designs.parquet")["workspace_area_mm2"].to_pylist()
    assert f"| workspace_area_mm2 | best | {areas[4]:.5g} mm² | 4 | 6.5 mm | 2 mm |" in lines


@pytest.mark.slow
def test_the_kind_of_file_follows_from_its_name(call: Call, swept: Path, folder: Path) -> None:
    for name in ("report.md", "report.HTML"):
        result = call("report", "out", "-o", name)
        assert (result.exit_code, result.stdout) == (0, "")
    written = call("report", "out").stdout + "\n<!-- written by dpg -->\n"
    assert (folder / "report.md").read_text(encoding="utf-8") == written
    page = (folder / "report.HTML").read_text(encoding="utf-8")
    assert page.startswith("<!DOCTYPE html>")
    assert "<svg" in page
    assert "dome height (mm)" in page


@pytest.mark.slow
def test_without_bokeh_the_page_has_no_explorer(
    call: Call, swept: Path, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("dpgcli.reports.explorer.find_spec", lambda name: None)
    said = "No explorer: it needs Bokeh, pip install bokeh."
    result = call("report", "out", "-o", "page.html")
    assert (result.exit_code, result.stdout) == (0, "")
    assert result.stderr.splitlines()[-1] == f"warning: {said}"
    assert f"<p>{said}</p>" in (folder / "page.html").read_text(encoding="utf-8")
    assert "Bokeh" not in call("report", "out", "-o", "page.md").stderr


@pytest.mark.slow
def test_what_differs_between_runs_is_in_no_report(call: Call, swept: Path, folder: Path) -> None:
    """The same tables give the same bytes, as Markdown and as a page, whatever run.json says."""

    def page(name: str) -> bytes:
        assert call("report", "out", "-o", name).exit_code == 0
        return (folder / name).read_bytes()

    before = [page(name) for name in ("a.md", "a.html")]
    said = b"".join(before).split(b"<script>")  # of which Bokeh's has its own words
    said[1] = said[1].partition(b"</script>")[2]
    assert not [part for part in said if b"seconds" in part or b"dpg sweep" in part]
    for said in ("", "[1]", "{", json.dumps({"seconds": 2.5})):
        (swept / "run.json").write_text(said, encoding="utf-8")
        assert page("a.md") == before[0]
    assert page("a.html") == before[1]
    (swept / "run.json").unlink()
    assert page("a.md") == before[0]


def test_another_run_has_the_same_report(call: Call, swept: Path, folder: Path) -> None:
    again = call("sweep", "sweep.yaml", "-o", "again", "-j", "2", "-q")
    assert again.exit_code == 0
    assert (folder / "again/report.md").read_bytes() == (swept / "report.md").read_bytes()
    assert json.loads((folder / "again/run.json").read_text())["command"]


def test_the_base_is_named_and_changes_nothing(call: Call, swept: Path, folder: Path) -> None:
    (folder / "other.yaml").write_bytes((folder / "three_unit.yaml").read_bytes())
    renamed = SWEEP.replace("three_unit", "other")
    (folder / "sweep.yaml").write_text(renamed, encoding="utf-8")
    assert call(*AGAIN).stderr == "out: up to date\n"
    assert "Base spec: three_unit.yaml (" in call("report", "out").stdout
    assert "Law: published law, pushing and pulling. Calibration: published." in (
        call("report", "out").stdout
    )


def test_a_table_of_unknown_metadata_has_a_report(call: Call, swept: Path) -> None:
    table = pq.read_table(swept / "designs.parquet")
    pq.write_table(table.replace_schema_metadata({b"\xff": b"\xff"}), swept / "designs.parquet")
    result = call("report", "out")
    assert (result.exit_code, "Base spec" in result.stdout) == (0, False)


def change(folder: Path) -> None:
    text = (folder / "sweep.yaml").read_text(encoding="utf-8")
    (folder / "sweep.yaml").write_text(text.replace("2.5", "2.25"), encoding="utf-8")


def test_a_page_of_designs_between_rigid_bars(call: Call, swept: Path) -> None:
    """An infinity of the base spec is no number of JSON."""
    rigid = ("-s", "finger.linear_stiffness_N_per_mm=.inf")
    assert call("sweep", "sweep.yaml", "-o", "rigid", "-j", "1", *rigid).exit_code == 0
    assert call("report", "rigid", "-o", "rigid.html").exit_code == 0


def test_statuses_of_somebody_else_are_refused(call: Call, swept: Path, folder: Path) -> None:
    """They were counted nowhere, and every design was said to be stable."""
    table = pq.read_table(swept / "designs.parquet")
    place = table.column_names.index("status")
    crashed = pa.array(["crashed"] * table.num_rows)
    (folder / "s").mkdir()
    foreign = table.set_column(place, "status", crashed).replace_schema_metadata({})
    pq.write_table(foreign, folder / "s" / "designs.parquet")
    result = call("report", "s")
    assert result.exit_code == ExitCode.USAGE
    said = "status: expected stable, partly_stable, invalid, excluded, failed, found 'crashed'"
    assert said in result.stderr


def test_the_report_of_former_tables_is_made_anew(
    call: Call, swept: Path, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As after a kill between the tables and the report; once, since Make looks at its age."""
    change(folder)
    with monkeypatch.context() as patch:
        patch.setattr("dpgcli.api.report.summarize", stop)
        assert call(*AGAIN).exit_code != 0
    assert "2.5 … 6.5 mm" in (swept / "report.md").read_text(encoding="utf-8")
    assert call(*AGAIN).stderr == "out: up to date\n"
    written = (swept / "report.md").read_text(encoding="utf-8")
    assert written == call("report", "out").stdout + "\n<!-- written by dpg -->\n"
    assert "2.25 … 6.5 mm" in call("report", "out").stdout
    made = (swept / "report.md").stat()
    assert call(*AGAIN).exit_code == 0
    assert (swept / "report.md").stat() == made


def test_a_report_of_somebody_else_beside_finished_tables_stays(call: Call, swept: Path) -> None:
    (swept / "report.md").write_text("# Notes\n", encoding="utf-8")
    assert call(*AGAIN).exit_code == 0
    assert (swept / "report.md").read_text(encoding="utf-8") == "# Notes\n"


def test_facts_are_not_those_of_the_tables_before(
    call: Call, swept: Path, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As after a kill between the facts of a run and its tables."""
    change(folder)
    monkeypatch.setattr("dpgcli.studies.sweep.assemble", stop)
    assert call(*AGAIN).exit_code != 0
    assert json.loads((swept / "run.json").read_text(encoding="utf-8"))["designs"] == 6
    result = call("report", "out")
    assert result.exit_code == 0
    assert "2.5 … 6.5 mm" in result.stdout


def stop(*_: Any, **__: Any) -> None:
    raise KeyboardInterrupt


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("missing",), "cannot read missing/designs.parquet: No such file"),
        ((".",), "cannot read designs.parquet: No such file"),
        (("out", "-o", "report.pdf"), "expected a name that ends in .md or .html"),
        (("out", "-o", "missing/report.md"), "cannot write missing/report.md"),
    ],
)
def test_misuse_is_2(call: Call, swept: Path, arguments: tuple[str, ...], said: str) -> None:
    result = call("report", *arguments)
    assert (result.exit_code, result.stdout) == (ExitCode.USAGE, "")
    assert said in result.stderr


def test_a_page_can_be_read_without_its_characters(run: Any, swept: Path) -> None:
    result = run("report", "out", env={"PYTHONIOENCODING": "ascii", "LC_ALL": "C.UTF-8"})
    assert result.returncode == 0
    assert all(line.startswith("warning: ranking: ") for line in result.stderr.splitlines())
    assert "mm\\xb2" in result.stdout
