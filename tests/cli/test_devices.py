"""Devices and pipes in the place of files: refused by name, not read without end."""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import dpgcli as dpg
from dpgcli.cli.exits import ExitCode
from dpgcli.errors import UsageError
from dpgcli.files import table_reader
from dpgcli.files.parts import SAID, PartStore
from dpgcli.files.table_reader import read_record, read_undamaged
from dpgcli.files.table_writer import read_metadata

pytestmark = pytest.mark.slow

Call = Callable[..., Any]
CONFIGS = Path(__file__).parents[2] / "configs"
SWEEP = "base: three_unit.yaml\nspace:\n  - {key: finger.units, values: [1, 2]}\n"
RUN = ("sweep", "sweep.yaml", "--executor", "serial", "-q", "-o", "out")
REQUIRE = ("--require", "n_stable > 0")
SPECIAL = "is a device or pipe, not a file"
EITHER = pytest.mark.parametrize("kind", ["pipe", pytest.param("device", marks=pytest.mark.slow)])
LIMITED = "import resource; resource.setrlimit(resource.RLIMIT_AS, (2**33, 2**33))"


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a finished sweep, for copies."""
    folder = tmp_path_factory.mktemp("finished")
    (folder / "three_unit.yaml").write_bytes((CONFIGS / "three_unit.yaml").read_bytes())
    (folder / "sweep.yaml").write_text(SWEEP)
    return dpg.sweep(folder / "sweep.yaml", folder / "out", executor="serial").folder


@pytest.fixture
def out(finished: Path, folder: Path) -> Path:
    """The folder of a finished sweep."""
    (folder / "sweep.yaml").write_text(SWEEP)
    return Path(shutil.copytree(finished, folder / "out"))


def put(path: Path, kind: str) -> Path:
    """A pipe without a writer, or a device without an end."""
    path.unlink(missing_ok=True)
    if kind == "pipe":
        os.mkfifo(path)
    else:
        path.symlink_to("/dev/zero")
    return path


@EITHER
@pytest.mark.parametrize(
    ("command", "name"),
    [
        (("check", "t.parquet", *REQUIRE), "t.parquet"),
        (("report", "out"), "out/designs.parquet"),
        (("bench", "three_unit.yaml", "--compare", "b.json"), "b.json"),
    ],
)
def test_it_is_refused_by_its_name(
    run: Any, out: Path, folder: Path, command: tuple[str, ...], name: str, kind: str
) -> None:
    assert out.exists()
    (folder / name).parent.mkdir(parents=True, exist_ok=True)
    put(folder / name, kind)
    result = run(*command, before=LIMITED, timeout=30)
    assert result.returncode == ExitCode.USAGE
    assert result.stderr == f"dpg: cannot read {name}: {SPECIAL}\n"


@EITHER
def test_parts_of_somebody_else_are_left_alone(
    run: Any, out: Path, folder: Path, kind: str
) -> None:
    """What stands in the place of a sweep's description is not read, and not in the way."""
    assert out.exists()
    for name in ("out", "new"):
        parts = folder / name / ".parts" / ("0" * 16)
        parts.mkdir(parents=True)
        put(parts / SAID, kind)
    merged = run("merge", "out", "-o", "all", before=LIMITED, timeout=30)
    assert (merged.returncode, "found no shard" in merged.stderr) == (ExitCode.USAGE, True)
    swept = run(*RUN[:-1], "new", before=LIMITED, timeout=30)
    assert (swept.returncode, swept.stderr) == (ExitCode.DONE, "")
    assert (folder / "new" / ".parts" / ("0" * 16) / SAID).exists() or kind == "pipe"


def test_a_summary_is_not_appended_to_a_pipe(run: Any, out: Path, folder: Path) -> None:
    put(folder / "s.md", "pipe")
    for command in (("check", str(out / "designs.parquet"), *REQUIRE), RUN):
        result = run(*command, "--summary-file", "s.md", timeout=30)
        assert (result.returncode, result.stdout) == (ExitCode.USAGE, "")
        assert result.stderr == f"dpg: cannot write s.md: {SPECIAL}\n"


@EITHER
def test_facts_that_are_no_file_are_not_read(run: Any, out: Path, kind: str) -> None:
    put(out / "run.json", kind)
    for command in (("report", "out"), RUN):
        result = run(*command, before=LIMITED, timeout=30)
        assert result.returncode == ExitCode.DONE
        assert all(line.startswith("warning: ranking: ") for line in result.stderr.splitlines())


@EITHER
def test_a_report_that_is_no_file_stays(run: Any, out: Path, kind: str) -> None:
    path = put(out / "report.md", kind)
    assert run(*RUN, before=LIMITED, timeout=30).returncode == ExitCode.DONE
    assert not path.is_file()


@pytest.mark.parametrize(
    "command",
    [
        ("validate", "p"),
        ("sweep", "of_pipe.yaml", "-o", "new"),
        ("fit", "hinge", "p"),
        pytest.param(("predict", "p"), marks=pytest.mark.slow),
        pytest.param(("sweep", "p", "-o", "new"), marks=pytest.mark.slow),
        pytest.param(("compare", "three_unit.yaml", "p"), marks=pytest.mark.slow),
    ],
)
def test_a_pipe_that_nobody_writes_to_is_not_waited_for(
    run: Any, folder: Path, command: tuple[str, ...]
) -> None:
    put(folder / "p", "pipe")
    (folder / "of_pipe.yaml").write_text(SWEEP.replace("three_unit.yaml", "p"))
    result = run(*command, timeout=30)
    assert result.returncode == ExitCode.USAGE
    said = result.stdout + result.stderr
    assert "expected a readable file, found a pipe that nobody writes to" in said


def test_a_pipe_with_a_writer_is_read(run: Any, call: Call, folder: Path) -> None:
    """However late the writer is, as in `dpg predict <(slow)`."""
    for pause in (0.0, 1.0):
        script = "import sys, time; time.sleep(float(sys.argv[1])); print(open(sys.argv[2]).read())"
        slow = [sys.executable, "-c", script, str(pause), str(folder / "three_unit.yaml")]
        with subprocess.Popen(slow, stdout=subprocess.PIPE) as writer:
            assert writer.stdout is not None
            number = writer.stdout.fileno()
            result = run("predict", f"/dev/fd/{number}", "-q", pass_fds=(number,))
        assert result.returncode == ExitCode.DONE, result.stderr
        assert result.stdout == call("predict", "three_unit.yaml", "-q").stdout


def test_a_part_that_is_no_file_is_damaged(run: Any, call: Call, out: Path, folder: Path) -> None:
    assert out.exists()
    assert call(*RUN[:-1], "s", "--shard", "1/1").exit_code == ExitCode.DONE
    (part,) = (folder / "s").rglob("*.part")
    put(part, "pipe")
    result = run("merge", "s", "-o", "all", timeout=30)
    assert result.returncode == ExitCode.USAGE
    wrong = "is damaged, or of another sweep: run its sweep again"
    assert result.stderr == f"dpg: {part.relative_to(folder)} {wrong}\n"


def test_a_substituted_process_is_named_a_pipe(out: Path, run: Any) -> None:
    """As by `dpg check <(cat designs.parquet)`."""
    with subprocess.Popen(["cat", out / "designs.parquet"], stdout=subprocess.PIPE) as cat:
        assert cat.stdout is not None
        name = f"/dev/fd/{cat.stdout.fileno()}"
        result = run("check", name, *REQUIRE, pass_fds=(cat.stdout.fileno(),))
    assert result.returncode == ExitCode.USAGE
    assert result.stderr == f"dpg: cannot read {name}: {SPECIAL}\n"


@pytest.mark.parametrize("reader", [read_undamaged, read_record, read_metadata])
def test_a_folder_is_no_file_either(tmp_path: Path, reader: Callable[[Path], Any]) -> None:
    if reader is read_metadata:
        assert reader(tmp_path) == {}
        return
    with pytest.raises(UsageError, match="directory"):
        reader(tmp_path)


def test_facts_have_a_bound(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "run.json"
    path.write_text('{"rows": []}')
    monkeypatch.setattr(table_reader, "MOST_FACTS", 12)
    assert read_record(path) == {"rows": []}
    monkeypatch.setattr(table_reader, "MOST_FACTS", 11)
    with pytest.raises(UsageError, match="larger than"):
        read_record(path)


def test_what_a_sweep_is_about_cannot_be_a_folder(tmp_path: Path) -> None:
    assert PartStore(tmp_path).said() == {}
    (tmp_path / SAID).mkdir()
    with pytest.raises(UsageError, match=f"cannot read .*{SAID}: Is a directory"):
        PartStore(tmp_path).said()
