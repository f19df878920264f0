"""Names and texts of others at the beginning of a line: no runner takes them for its commands.

GitHub's takes a line that begins with `::name`, blanks aside, on either stream, and one that has
`##[name]` anywhere; Azure's `##vso[name]`.
"""

import ast
import csv
import io
import json
import re
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from dpgcli.cli import exits
from dpgcli.cli.exits import ExitCode
from dpgcli.text import inert

COMMANDS = [
    "::stop-commands::x",
    "::error ::x",
    " ::add-mask::x",
    "a##[add-mask]x",
    "##vso[task.x]y",
]
OBEYED = re.compile(r"^\s*::|##\w*\[", re.MULTILINE)
CLI = Path(exits.__file__).parent


@pytest.mark.parametrize("command", COMMANDS)
def test_a_line_is_broken_where_it_would_be_obeyed(command: str) -> None:
    assert OBEYED.search(command)
    assert not OBEYED.search(inert(command))
    assert inert(command).replace(r"\x3a", ":").replace(r"\x23", "#") == command


@pytest.mark.parametrize(
    "line", ["# Design space", "## Best and worst [designs]", "a::b", "a: b :: c"]
)
def test_other_lines_stay(line: str) -> None:
    assert inert(line) == line


SPEC = "{name}.yaml"


@pytest.mark.parametrize("name", COMMANDS)
@pytest.mark.parametrize(
    "arguments",
    [
        ("validate", "{name}"),
        ("validate", SPEC),
        ("validate", "bad-{name}.yaml", "{name}"),
        ("explain", "{name}"),
        ("explain", SPEC),
        ("predict", "{name}"),
        ("predict", SPEC, "-o", "{name}/t.parquet"),
        ("predict", SPEC, "--pattern", "{name}"),
        ("predict", SPEC, "--set", "{name}=1"),
        ("init", "{name}.new"),
        ("init", SPEC),
        ("sweep", "{name}", "-o", "out"),
        ("sweep", "based.yaml", "-o", "out"),
        ("sweep", "good.yaml", "-o", "{name}.out", "--executor", "serial"),
        ("sweep", "good.yaml", "-o", "out", "--executor", "serial", "--require", "{name}"),
        ("merge", "{name}", "-o", "out"),
        ("check", "{name}", "--require", "n_stable > 1"),
        ("check", "designs.parquet", "--require", "{name}"),
        ("check", "designs.parquet", "--require", "n_stable > 9"),
        ("check", "designs.parquet", "--require", "n_stable > 9", "--format", "json"),
        ("report", "{name}"),
        ("report", "tables"),
        ("fit", "hinge", "{name}"),
        ("fit", "hinge", "hinge.csv", "-o", "{name}-2.yaml"),
        ("fit", "grid", "grid.csv"),
        ("fit", "grid", "grid.csv", "--format", "csv"),
        ("fit", "grid", "grid.csv", "--format", "json"),
        ("fit", "bistable", "{name}", "--travel-to-opening", "{name}"),
        ("fit", "finger", SPEC, "{name}"),
        ("compare", SPEC, "{name}"),
        ("compare", SPEC, "tips.csv"),
        ("fe", "hinge", SPEC, "--output", "{name}"),
        ("bench", "{name}"),
        ("stress", "{name}"),
        ("stress", "--only", "{name}"),
        ("help", "{name}"),
    ],
    ids=" ".join,
)
def test_no_line_is_a_command(
    call: Any, folder: Path, study: tuple[str, str], arguments: tuple[str, ...], name: str
) -> None:
    spec = (folder / study[0]).read_text()
    (folder / f"{name}.yaml").write_text(spec)
    (folder / f"bad-{name}.yaml").write_text("finger: {units: 0}\n")
    space = "\nspace: [{key: finger.units, values: [2]}]\n"
    (folder / "based.yaml").write_text(f'base: "{name}"{space}')
    (folder / "good.yaml").write_text(f'base: "{name}.yaml"{space}')
    (folder / "tips.csv").write_text(f"pattern,tip_x_mm,tip_y_mm,{name}\n100,51,-10,1\n")
    head = f"dome_height_mm,bistable_stiffness_N_per_mm,{name},b{name}"
    (folder / "grid.csv").write_text(f"{head}\n5,1,2,3\n6,2,3,4\n7,3,4,5\n")
    moments = "\n".join(f"{0.01 * i},{0.2 * i},1" for i in range(1, 9))
    (folder / "hinge.csv").write_text(f"rotation_rad,moment_N_mm,{name}\n{moments}\n")
    designs = {
        "design": [0, 1],
        name: [1.0, 2.0],
        "calibration": ["given"] * 2,
        "status": ["stable", name],
        "reason": ["", name],
        "n_stable": [2, 0],
    }
    (folder / "tables").mkdir()
    for path in ("designs.parquet", "tables/designs.parquet"):
        pq.write_table(pa.table(designs), folder / path)
    result = call(*(argument.format(name=name) for argument in arguments))
    assert result.exit_code in set(ExitCode) - {ExitCode.INTERNAL}, result.exception
    assert not OBEYED.search(result.stdout)
    assert not OBEYED.search(result.stderr)
    if "json" in arguments:
        assert name.strip() in json.dumps(json.loads(result.stdout))


@pytest.mark.parametrize("name", [COMMANDS[0], COMMANDS[3]])
@pytest.mark.parametrize(
    "arguments", [("{name}",), ("predict", "--{name}"), ("bench", "x", "--repeats", "{name}"), ()]
)
def test_nor_of_what_typer_refuses(run: Any, arguments: tuple[str, ...], name: str) -> None:
    result = run(*(argument.format(name=name) for argument in arguments))
    assert result.returncode == ExitCode.USAGE
    assert not OBEYED.search(result.stdout + result.stderr)
    assert result.stderr


@pytest.mark.parametrize("name", ["::error ::x", "\x1b[2Jx"])
def test_names_in_csv_are_spelled_as_in_the_table(call: Any, folder: Path, name: str) -> None:
    (folder / "grid.csv").write_text(f"dome_height_mm,{name}\n5,1\n6,2\n7,3\n")
    result = call("fit", "grid", "grid.csv", "--format", "csv")
    assert result.exit_code == ExitCode.DONE, result.stderr
    (row,) = csv.DictReader(io.StringIO(result.stdout))
    spelled = {"::error ::x": r"\x3a:error ::x", "\x1b[2Jx": r"\x1b[2Jx"}[name]
    assert row["quantity"] == spelled
    assert spelled in call("fit", "grid", "grid.csv").stdout


def test_a_traceback_is_shown_and_not_obeyed(
    call: Any, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: Any, **__: Any) -> None:
        raise RuntimeError("x\n::stop-commands::y\n\x1b[2J")

    monkeypatch.setattr("dpgcli.api.inputs.scene_input", broken)
    result = call("predict", "three_unit.yaml")
    assert result.exit_code == ExitCode.INTERNAL
    assert "RuntimeError: x\n\\x3a:stop-commands::y\n\\x1b[2J\ndpg: this is a bug" in result.stderr


@pytest.mark.parametrize("path", sorted(CLI.rglob("*.py")), ids=lambda p: p.name)
def test_one_place_prints(path: Path) -> None:
    """So that none forgets what is here: progress prints numbers and names of its own."""
    calls = [node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.Call)]
    names = {node.func.id for node in calls if isinstance(node.func, ast.Name)}
    assert "print" not in names or path.name in ("streams.py", "progress.py", "bench.py")
