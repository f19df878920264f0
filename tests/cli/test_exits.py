"""Every way to end: the exit code, the message, and no traceback."""

import errno
import os
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from dpgcli.cli.exits import ExitCode
from dpgcli.cli.options import seconds
from dpgcli.code import sha256_of_code
from dpgcli.errors import UsageError

Call = Callable[..., Any]
COMMANDS = {
    "predict": "--output --format --pattern --set --columns --nodes --formulation --tolerance "
    "--target-error --plot --quiet",
    "explain": "--format --pattern --set --columns --nodes --formulation --tolerance "
    "--target-error",
    "sweep": "--output --jobs --executor --scheduler --wait --shard --set --tolerance "
    "--target-error --restart --force "
    "--depfile --require --max-failed --summary-file --quiet",
    "bench": "--set --repeats --target-error --keep --against --first-station --tip-offset "
    "--format --output --plot --json "
    "--compare --quiet",
    "compare": "--set --first-station --tip-offset --format --plot --quiet",
    "stress": "--only --set --format --output --quiet",
    "merge": "--output --max-failed --quiet",
    "check": "--require --format --summary-file",
    "report": "--output",
    "validate": "--format --set",
    "init": "--force",
    "schema": "",
}


def test_the_codes_are_the_published_ones() -> None:
    assert {code.name: int(code) for code in ExitCode} == {
        "DONE": 0,
        "REQUIREMENT": 1,
        "USAGE": 2,
        "INTERNAL": 3,
        "FAILED_CASES": 4,
        "NOTHING_SELECTED": 5,
        "INTERRUPTED": 130,
        "TERMINATED": 143,
    }


@pytest.mark.parametrize(("name", "options"), COMMANDS.items())
def test_help_lists_every_option(call: Call, name: str, options: str) -> None:
    result = call(name, "--help")
    assert result.exit_code == 0
    assert [o for o in [*options.split(), "--help"] if o not in result.stdout] == []


def test_help_names_all_commands_and_exit_codes(call: Call) -> None:
    text = call("--help").stdout
    assert all(name in text for name in COMMANDS)
    assert all(str(int(code)) in text for code in ExitCode)


def test_the_version_goes_to_standard_output(call: Call) -> None:
    result = call("--version")
    assert (result.exit_code, result.stderr) == (0, "")
    assert result.stdout.startswith("dpg ")
    assert result.stdout.splitlines()[1].startswith(f"package {sha256_of_code()[:16]}, numpy ")


@pytest.mark.parametrize(
    "arguments",
    [
        (),
        ("nope",),
        ("predict",),
        ("predict", "three_unit.yaml", "--nope"),
        ("predict", "three_unit.yaml", "--format", "xml"),
        ("predict", "three_unit.yaml", "--tolerance", "small"),
        ("predict", "three_unit.yaml", "--formulation", "other"),
        ("predict", "missing.yaml"),
        ("predict", "."),
        ("predict", ""),
        ("explain", "missing.yaml"),
        ("validate",),
        ("validate", "missing.yaml"),
        ("init", "missing/finger.yaml"),
        ("sweep", "three_unit.yaml", "-o", "out", "-j", "0"),
        ("sweep", "three_unit.yaml", "-o", "out", "-j", "9" * 20),
        ("sweep", "three_unit.yaml", "-o", "out", "--shard", "1/" + "9" * 20),
        ("fe", "dome", "three_unit.yaml", "--output", "out", "--threads", "9" * 20),
    ],
)
def test_misuse_is_2_without_output_of_data(call: Call, arguments: tuple[str, ...]) -> None:
    result = call(*arguments)
    assert result.exit_code == ExitCode.USAGE
    assert "Traceback" not in result.output
    assert len(result.output) > 10


@pytest.mark.parametrize("tolerance", ["0", "-1", "nan", "inf", "1", "1e-15"])
def test_an_impossible_tolerance_is_2(call: Call, tolerance: str) -> None:
    result = call("predict", "three_unit.yaml", "--tolerance", tolerance)
    assert (result.exit_code, result.stdout) == (ExitCode.USAGE, "")
    assert "--tolerance" in result.stderr


@pytest.mark.parametrize("command", ["predict", "explain"])
def test_a_pattern_that_matches_nothing_is_5(call: Call, command: str) -> None:
    result = call(command, "three_unit.yaml", "--pattern", "0000")
    assert (result.exit_code, result.stdout) == (ExitCode.NOTHING_SELECTED, "")
    assert "0000" in result.stderr


@pytest.mark.parametrize("pattern", ["", "222", "1a1"])
def test_a_pattern_that_is_none_is_2(call: Call, pattern: str) -> None:
    assert call("predict", "three_unit.yaml", "--pattern", pattern).exit_code == ExitCode.USAGE


def test_a_bug_is_3_and_keeps_its_traceback(call: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object) -> None:
        raise ZeroDivisionError("oh")

    monkeypatch.setattr("dpgcli.api.inputs.read_document", broken)
    result = call("predict", "three_unit.yaml")
    assert result.exit_code == ExitCode.INTERNAL
    assert "ZeroDivisionError: oh" in result.stderr
    assert "report" in result.stderr


@pytest.mark.parametrize("name", [b"caf\xe9.csv", b"a$b$_^.csv"])
def test_a_figure_of_a_file_with_an_odd_name(call: Call, folder: Path, name: bytes) -> None:
    file = os.fsdecode(name)
    try:
        (folder / file).write_text("moment_N_mm,rotation_rad\n0,0\n2.4,0.1\n4.8,0.2\n")
    except OSError:
        pytest.skip("no such names on this file system")
    result = call("fit", "hinge", file, "--plot", "h.svg", "-q")
    assert (result.exit_code, result.stderr) == (0, "")


def test_rigid_bars_have_no_node_coordinates(call: Call) -> None:
    rigid = "finger.linear_stiffness_N_per_mm=.inf"
    result = call("predict", "three_unit.yaml", "--formulation", "lattice", "-s", rigid)
    assert result.exit_code == ExitCode.USAGE
    assert "linear_stiffness_N_per_mm" in result.stderr


def test_a_problem_is_one_line_with_place_expected_and_found(call: Call, folder: Path) -> None:
    (folder / "bad.yaml").write_text("finger:\n  units: 0\n  colour: red\n", encoding="utf-8")
    result = call("predict", "bad.yaml")
    assert result.exit_code == ExitCode.USAGE
    first = result.stderr.splitlines()[0]
    assert first.startswith("bad.yaml:")
    assert ": expected " in first
    assert ", found " in first
    assert result.stderr.splitlines()[-1] == "dpg: 2 problems"


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"\x00\x01\x02",
        b"\xff\xfe\x00",
        b"[1, 2",
        b"finger: {units: 3, units: 4}",
        b"finger: !!python/object/apply:os.system [ls]",
        b"a: &a [x, x, x, x, x, x, x, x, x]\nb: &b [*a, *a, *a, *a, *a, *a, *a, *a, *a]\n"
        b"c: &c [*b, *b, *b, *b, *b, *b, *b, *b, *b]\nd: &d [*c, *c, *c, *c, *c, *c, *c]\n"
        b"e: [*d, *d, *d, *d, *d, *d, *d, *d]\n",
        b"a: &a [*a]",
        b"[" * 5000,
        b"finger: {units: 99999999999999999999, linear_stiffness_N_per_mm: .nan}",
        b"x" * 3_000_000,
    ],
    ids=lambda content: repr(content[:20]),
)
@pytest.mark.parametrize("command", ["predict", "validate"])
def test_no_content_of_a_file_gives_a_traceback(
    call: Call, folder: Path, command: str, content: bytes
) -> None:
    (folder / "bad.yaml").write_bytes(content)
    result = call(command, "bad.yaml")
    assert result.exit_code == ExitCode.USAGE
    assert "Traceback" not in result.output
    assert "bad.yaml" in result.output
    assert "problem" in result.output


@pytest.mark.parametrize("name", ["a b.yaml", "ö.yaml", "100%.yaml", "[bold]x.yaml", "-x.yaml"])
def test_any_name_of_a_spec_will_do(call: Call, folder: Path, name: str) -> None:
    (folder / "three_unit.yaml").rename(folder / name)
    result = call("predict", "-q", "--pattern", "111", "-o", f"{name}.parquet", "--", name)
    assert (result.exit_code, result.stderr) == (0, "")
    assert (folder / f"{name}.parquet").is_file()


def test_a_name_that_is_not_text_will_do(run: Any, folder: Path) -> None:
    name = os.fsdecode(b"b\xff.parquet")
    result = run("predict", "-q", "three_unit.yaml", "-o", name)
    assert (result.returncode, result.stderr) == (0, "")
    assert (folder / name).is_file()


def test_a_spec_comes_from_standard_input(call: Call, folder: Path) -> None:
    text = (folder / "three_unit.yaml").read_text(encoding="utf-8")
    given = call("predict", "-q", "-", text=text)
    assert given.stdout == call("predict", "-q", "three_unit.yaml").stdout
    assert "<stdin>" in call("predict", "-", text="finger: 1").stderr


def test_closed_standard_input_is_a_missing_file(run: Any) -> None:
    result = run("predict", "-", preexec_fn=lambda: os.close(0))
    assert result.returncode == ExitCode.USAGE
    assert "Traceback" not in result.stderr


@pytest.mark.slow
@pytest.mark.parametrize("command", ["explain", "validate"])
def test_a_name_that_the_output_cannot_spell_is_escaped(
    run: Any, folder: Path, command: str
) -> None:
    (folder / "three_unit.yaml").rename(folder / "ö.yaml")
    env = {"PYTHONIOENCODING": "ascii", "LC_ALL": "C.UTF-8"}
    result = run(command, "ö.yaml", env=env)
    assert (result.returncode, result.stderr) == (0, "")


@pytest.mark.slow
@pytest.mark.parametrize(
    "arguments",
    [
        ("predict", "three_unit.yaml"),
        ("predict", "three_unit.yaml", "--tolerance", "1"),
        ("explain", "three_unit.yaml", "-s", "finger.linear_stiffness_N_per_mm=.inf"),
        ("init", "-"),
    ],
)
def test_ascii_output_does_no_harm(run: Any, arguments: tuple[str, ...]) -> None:
    env = {"PYTHONIOENCODING": "ascii", "LC_ALL": "C", "PYTHONUTF8": "0"}
    result: subprocess.CompletedProcess[str] = run(*arguments, env=env)
    assert result.returncode == (ExitCode.USAGE if "--tolerance" in arguments else 0)
    assert "Traceback" not in result.stderr


@pytest.mark.parametrize(
    ("text", "expected"), [("5m", 300.0), ("1.5h", 5400.0), ("30s", 30.0), ("12", 12.0)]
)
def test_times(text: str, expected: float) -> None:
    assert seconds("--wait", text) == expected


@pytest.mark.parametrize("text", ["", "m", "-5m", "5 d", "inf", "nan", "1e9", "5mm"])
def test_what_is_no_time(text: str) -> None:
    with pytest.raises(UsageError, match="expected a time in s, m or h: 5m"):
        seconds("--wait", text)


@pytest.mark.slow
def test_warnings_of_libraries_reach_only_those_who_ask(run: Callable[..., Any]) -> None:
    before = (
        "import warnings, dpgcli.api.inputs as inputs; read = inputs.read_document\n"
        "def warned(*given): warnings.warn('of a library', RuntimeWarning); return read(*given)\n"
        "inputs.read_document = warned"
    )
    usual = run("predict", "three_unit.yaml", "-q", env={"PYTHONWARNINGS": ""}, before=before)
    assert (usual.returncode, usual.stderr) == (0, "")
    asked = run("predict", "three_unit.yaml", env={"PYTHONWARNINGS": "default"}, before=before)
    assert "RuntimeWarning: of a library" in asked.stderr
    strict = run("predict", "three_unit.yaml", before=before)
    assert strict.returncode == ExitCode.INTERNAL, "tests take it for an error"


GONE = "import os; os.mkdir('gone'); os.chdir('gone'); os.rmdir('../gone')"


@pytest.mark.parametrize(
    "arguments",
    [
        ("predict", "{0}/three_unit.yaml", "-o", "states.parquet"),
        ("sweep", "{0}/sweep.yaml", "-o", "{0}/out", "-j", "2"),
        ("init",),
    ],
)
def test_a_working_folder_that_was_deleted_is_named(
    run: Callable[..., Any], folder: Path, arguments: tuple[str, ...]
) -> None:
    (folder / "sweep.yaml").write_text(
        "base: three_unit.yaml\nspace: [{key: finger.units, values: [2, 3]}]\n"
    )
    done = run(*(text.format(folder) for text in arguments), before=GONE)
    assert done.returncode == ExitCode.USAGE
    assert "the working folder was deleted" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    "code", [errno.EMFILE, errno.ENOSPC, errno.EROFS, errno.ENOMEM, errno.EACCES, errno.ELOOP]
)
def test_a_system_that_has_no_more_is_no_bug(
    call: Call, monkeypatch: pytest.MonkeyPatch, code: int
) -> None:
    def refused(*_: object) -> None:
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr("dpgcli.api.inputs.read_document", refused)
    result = call("predict", "three_unit.yaml")
    assert (result.exit_code, result.stdout) == (ExitCode.USAGE, "")
    assert result.stderr == f"dpg: the system refuses: [Errno {code}] {os.strerror(code)}\n"


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (MemoryError(), "the system refuses more memory: there is no more"),
        (MemoryError("Unable to allocate 1 GiB"), "more memory: Unable to allocate 1 GiB"),
        (ImportError("a.so: failed to map segment from shared object"), "refuses: a.so: failed to"),
        (RuntimeError("can't start new thread"), "the system refuses: can't start new thread"),
    ],
)
def test_a_system_without_memory_is_no_bug(
    call: Call, monkeypatch: pytest.MonkeyPatch, error: Exception, said: str
) -> None:
    def refused(*_: object) -> None:
        raise error

    monkeypatch.setattr("dpgcli.api.inputs.read_document", refused)
    result = call("predict", "three_unit.yaml")
    assert (result.exit_code, result.stdout) == (ExitCode.USAGE, "")
    assert result.stderr.startswith("dpg: the system refuses")
    assert said in result.stderr
