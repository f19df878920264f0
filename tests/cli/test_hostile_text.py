"""Names and texts of others in terminals and reports: shown, and never obeyed."""

import unicodedata
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from dpgcli.cli.exits import ExitCode

HOSTILE = "\x1b[2J\x9b31m\u202ed\u2066n\r\n::error::no\n\u2028\x07$x^{$<b>|`[bold]"
CALIBRATION = """\
calibration_version: 1
made_by: "dpg\\e[2J"
method: "\\u202Eleast squares\\n::error::x"
values:
  hinge_stiffness_N_mm_per_rad: {value: 24.2}
warnings: ["\\e]0;a title\\a", "two\\nlines"]
"""


def obeyed(text: str) -> set[str]:
    """Characters in a text that do something to a terminal, its lines' ends aside."""
    return {c for c in text if c != "\n" and unicodedata.category(c) in ("Cc", "Cf", "Zl", "Zp")}


@pytest.fixture
def tables(folder: Path) -> str:
    """A folder with a table of designs in which every name and text is hostile."""
    (folder / "out").mkdir()
    columns = {
        "design": [0, 1, 2],
        HOSTILE: [1.0, 2.0, 3.0],
        "calibration": ["given"] * 3,
        "status": ["stable", "stable", HOSTILE],
        "reason": ["", "", HOSTILE],
        "n_stable": [2, 2, 0],
        "n_states": [2, 2, 2],
        "workspace_area_mm2": [1.0, 2.0, float("nan")],
    }
    swept = pa.field(HOSTILE, pa.float64(), metadata={"unit": HOSTILE})
    table = pa.table(columns)
    schema = table.schema.set(1, swept)
    pq.write_table(table.cast(schema), folder / "out" / "designs.parquet")
    return "out"


@pytest.mark.parametrize("form", ["text", "github", "json"])
def test_a_check_of_a_hostile_table(call: Any, folder: Path, tables: str, form: str) -> None:
    options = ("--require", "workspace_area_mm2 > 0", "--format", form, "--summary-file", "s.md")
    result = call("check", f"{tables}/designs.parquet", *options)
    assert result.exit_code == ExitCode.REQUIREMENT
    for text in (result.stdout, result.stderr, (folder / "s.md").read_text()):
        assert not obeyed(text)
    lines = result.stdout.splitlines()
    assert not any(line.startswith("::") for line in lines) or form == "github"
    assert len(lines) == {"text": 2, "github": 1}.get(form, len(lines))


def test_a_report_of_a_hostile_table(call: Any, folder: Path, tables: str) -> None:
    """Warnings are errors here: Matplotlib warns of what no font has. Statuses are refused."""
    result = call("report", tables)
    assert result.exit_code == ExitCode.USAGE
    assert not obeyed(result.stderr)
    path = folder / tables / "designs.parquet"
    table = pq.read_table(path)
    status = pa.array(["stable", "stable", "invalid"])
    pq.write_table(table.set_column(table.column_names.index("status"), "status", status), path)
    result = call("report", tables)
    assert result.exit_code == ExitCode.DONE
    assert not obeyed(result.stdout)
    assert not any(line.startswith("::") for line in result.stdout.splitlines())
    result = call("report", tables, "-o", "page.html")
    assert result.exit_code == ExitCode.DONE, result.exception
    page = (folder / "page.html").read_text(encoding="utf-8")
    assert not obeyed(page)
    before, _, rest = page.partition("<script>")  # Bokeh's script has markup of its own
    assert "<b>" not in before + rest.partition("</script>")[2]
    assert "<svg" in page


@pytest.mark.parametrize(
    "arguments",
    [
        ("validate", "a\u202eb.yaml"),
        ("explain", "a\u202eb.yaml"),
        ("predict", "a\u202eb.yaml"),
        ("predict", "a\u202eb.yaml", "--set", "finger.units=\x1b[2J"),
        ("validate", "no\x1b[2J.yaml"),
        ("validate", "c\u202ed.yaml", "--format", "github"),
        ("validate", "calibrated.yaml", "--format", "github", "-s", "finger.calibration=e\u202e"),
        ("predict", "a\u202eb.yaml", "-o", "no\u202e/t.parquet"),
        ("sweep", "no\u2028.yaml", "-o", "out"),
        ("report", "no\x1b[2J"),
        ("check", "no\x1b[2J", "--require", "x > 1"),
        ("fit", "hinge", "no\x1b[2J"),
        ("fit", "grid", "grid.csv"),
        ("fit", "hinge", "hinge.csv"),
        ("compare", "a\u202eb.yaml", "tips.csv"),
        ("explain", "calibrated.yaml", "--set", "finger.lattice.stroke_mm=3.5"),
        ("fe", "hinge", "a\u202eb.yaml", "--output", "deck\u202e"),
    ],
)
def test_names_of_files_and_columns(
    call: Any, folder: Path, study: tuple[str, str], arguments: tuple[str, ...]
) -> None:
    spec = (folder / study[0]).read_text()
    (folder / "a\u202eb.yaml").write_text(spec)
    (folder / "calibrated.yaml").write_text(
        spec.replace("  units: 3", '  units: 3\n  calibration: "c\u202ed.yaml"').replace(
            "    hinge_stiffness_N_mm_per_rad: 24.2\n", ""
        )
    )
    (folder / "e\u202e").write_text("x: 1")
    (folder / "c\u202ed.yaml").write_text(CALIBRATION)
    (folder / "tips.csv").write_text("pattern,tip_x_mm,tip_y_mm,\x1b[2J\n100,51,-10,1\n")
    head = "dome_height_mm,bistable_stiffness_N_per_mm,\x1b[2Jx,[bold]y"
    (folder / "grid.csv").write_text(f"{head}\n5,1,2,3\n6,2,3,4\n7,3,4,5\n")
    moments = "\n".join(f"{0.01 * i},{0.2 * i},1" for i in range(1, 9))
    (folder / "hinge.csv").write_text(f"rotation_rad,moment_N_mm,\u202ex\n{moments}\n")
    result = call(*arguments)
    assert result.exit_code in (ExitCode.DONE, ExitCode.USAGE), result.exception
    assert not obeyed(result.stdout) | obeyed(result.stderr)
    assert result.stdout + result.stderr


def test_a_grid_prints_what_looks_like_markup_as_it_is(call: Any, folder: Path) -> None:
    head = "dome_height_mm,[bold]y[/bold],:smile:"
    (folder / "grid.csv").write_text(f"{head}\n5,1,2\n6,2,3\n7,3,4\n")
    result = call("fit", "grid", "grid.csv")
    assert result.exit_code == ExitCode.DONE, result.stderr
    assert "[bold]y[/bold]" in result.stdout and ":smile:" in result.stdout


@pytest.mark.parametrize("name", ["a\nb", "a\x1bb", "a\x9bb", "a\tb"])
@pytest.mark.parametrize(
    "kind", ["spec", "base", "calibration", "curve", "table", "output", "out", "summary"]
)
def test_names_with_control_characters_are_refused(
    call: Any, folder: Path, kind: str, name: str
) -> None:
    (folder / name).write_bytes((folder / "three_unit.yaml").read_bytes())
    quoted = ascii(name).strip("'").join('""')
    said = {
        "base": f"base: {quoted}\nspace: [{{key: finger.units, values: [2]}}]\n",
        "table": f"base: three_unit.yaml\nspace: [{{table: {quoted}}}]\n",
    }
    (folder / "sweep.yaml").write_text(said.get(kind, said["base"]))
    arguments = {
        "spec": ("validate", name),
        "base": ("sweep", "sweep.yaml", "-o", "out"),
        "table": ("sweep", "sweep.yaml", "-o", "out"),
        "calibration": ("validate", "three_unit.yaml", "-s", f"finger.calibration={quoted}"),
        "curve": ("fit", "hinge", name),
        "output": ("predict", "three_unit.yaml", "-o", f"{name}.parquet"),
        "out": ("sweep", "configs.yaml", "-o", f"{name}.out", "--executor", "serial"),
        "summary": ("sweep", "configs.yaml", "-o", "o", "--summary-file", f"{name}.out"),
    }[kind]
    config = "base: three_unit.yaml\nspace: [{key: finger.units, values: [2]}]\n"
    (folder / "configs.yaml").write_text(config)
    result = call(*arguments)
    assert result.exit_code == ExitCode.USAGE
    control = ascii(next(c for c in name if not c.isalpha()))[1:-1]
    assert f"{control} in it" in result.output
    assert not obeyed(result.output)
    assert not [path for path in folder.iterdir() if path.suffix in (".parquet", ".out")]
