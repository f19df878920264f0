"""`dpg report`: a finished sweep as Markdown and as a page."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

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


@pytest.fixture
def swept(call: Call, folder: Path) -> Path:
    """The folder of a finished sweep with known facts."""
    (folder / "sweep.yaml").write_text(SWEEP, encoding="utf-8")
    result = call("sweep", "sweep.yaml", "-o", "out", "-j", "1")
    assert result.exit_code == 0, result.stderr
    (folder / "out" / "run.json").write_text('{"seconds": 2.5}', encoding="utf-8")
    return folder / "out"


def test_markdown_goes_to_standard_output(call: Call, swept: Path) -> None:
    result = call("report", "out")
    assert (result.exit_code, result.stderr) == (0, "")
    lines = result.stdout.splitlines()
    assert lines[2] == (
        "6 designs over dome_height_mm (2.5 … 6.5 mm, 3 values), "
        "unit_separation_mm (2 … 3 mm, 2 values)."
    )
    assert "| stable | 5 | 1 | 3 | 1 | 0 |" in lines
    assert "| 3 mm | 2.5 mm | 4.5 mm | 6.5 mm | – |" in lines
    assert "| seconds | 2.5 s |" in lines
    areas = pq.read_table(swept / "designs.parquet")["workspace_area_mm2"].to_pylist()
    assert f"| workspace_area_mm2 | best | {areas[4]:.5g} mm² | 4 | 6.5 mm | 2 mm |" in lines


def test_the_kind_of_file_follows_from_its_name(call: Call, swept: Path, folder: Path) -> None:
    for name in ("report.md", "report.HTML"):
        result = call("report", "out", "-o", name)
        assert (result.exit_code, result.output) == (0, "")
    written = call("report", "out").stdout + "\n<!-- written by dpg -->\n"
    assert (folder / "report.md").read_text(encoding="utf-8") == written
    page = (folder / "report.HTML").read_text(encoding="utf-8")
    assert page.startswith("<!DOCTYPE html>")
    assert "<svg" in page
    assert "dome height (mm)" in page


def test_a_run_without_facts_has_a_report(call: Call, swept: Path) -> None:
    (swept / "run.json").unlink()
    result = call("report", "out")
    assert result.exit_code == 0
    assert "The run" not in result.stdout


@pytest.mark.parametrize("content", ["", "[1]", "{", json.dumps("x")])
def test_damaged_facts_are_2(call: Call, swept: Path, content: str) -> None:
    (swept / "run.json").write_text(content, encoding="utf-8")
    result = call("report", "out")
    assert (result.exit_code, result.stdout) == (ExitCode.USAGE, "")
    assert "out/run.json" in result.stderr


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
    assert (result.returncode, result.stderr) == (0, "")
    assert "mm\\xb2" in result.stdout
