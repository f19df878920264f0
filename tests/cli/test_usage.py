"""Help that says all and shows examples that work, the program's own options, misuse in a line."""

import inspect
import os
import re
import shutil
import subprocess
import sys
from collections import defaultdict
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.models import OptionInfo

from dpgcli.cli.examples import EXAMPLES
from dpgcli.cli.main import NAMES, Commands

Call = Callable[..., Any]
Run = Callable[..., "subprocess.CompletedProcess[str]"]

CONFIGS = Path(__file__).parents[2] / "configs"
PROGRAM = "from dpgcli.__main__ import main; main()"
SCRIPT = f"#!{sys.executable}\nif __name__ == '__main__':\n    {PROGRAM}\n"
PREPARED = {"check": "sweep", "report": "sweep", "merge": "sweep", "pick": "sweep"}
SLOW = (
    "bench",
    "check",
    "compare",
    "fe",
    "fit",
    "merge",
    "report",
    "stress",
    "sweep",
)  # their examples take long
HINGE = "moment_N_mm,rotation_rad\n0,0\n2.4,0.1\n4.8,0.2\n"


def commands() -> dict[str, Callable[..., None]]:
    """All functions that are commands, by their words."""
    found = {}
    for name in NAMES:
        module = import_module(f"dpgcli.cli.{name}")
        if not hasattr(module, "app"):
            found[name] = getattr(module, name)
            continue
        for each in module.app.registered_commands:
            assert each.callback is not None
            found[f"{name} {each.callback.__name__}"] = each.callback
    return found


COMMANDS = commands()


def test_every_command_has_examples_of_its_own() -> None:
    assert set(EXAMPLES) == set(COMMANDS)
    for name, lines in EXAMPLES.items():
        assert lines
        assert all(line.startswith(f"dpg {name}") for line in lines)


@pytest.mark.parametrize("name", COMMANDS)
@pytest.mark.parametrize("option", ["-h", "--help"])
def test_help_ends_with_the_examples(call: Call, name: str, option: str) -> None:
    result = call(*name.split(), option)
    assert result.exit_code == 0
    shown = result.stdout.partition("\nExamples:\n")[2].splitlines()
    assert [line.strip() for line in shown] == list(EXAMPLES[name])


@pytest.mark.parametrize("width", ["40", "80"])
@pytest.mark.parametrize("arguments", [("-h",), ("fit", "-h"), ("fe", "-h")])
def test_descriptions_are_whole(run: Run, arguments: tuple[str, ...], width: str) -> None:
    text = run(*arguments, env={"COLUMNS": width}).stdout
    assert not re.search(r"\.\.\.$|…", text.partition("\n")[2], re.MULTILINE)
    words = " ".join(text.split())
    group = "" if arguments[0] == "-h" else f"{arguments[0]} "
    own = [name for name in COMMANDS if name.startswith(group) and (group or " " not in name)]
    assert own
    for name in own:
        assert " ".join((COMMANDS[name].__doc__ or "?").split()) in words


@pytest.mark.parametrize("name", [name for name in EXAMPLES if name.split()[0] not in SLOW])
@pytest.mark.usefixtures("study")
@pytest.mark.slow
def test_the_examples_run(folder: Path, name: str) -> None:
    carry_out(folder, name)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in EXAMPLES if name.split()[0] in SLOW])
@pytest.mark.usefixtures("study")
def test_the_slow_examples_run(folder: Path, name: str) -> None:
    if name.startswith("fe") and shutil.which("ccx") is None:
        pytest.skip("CalculiX is not installed")
    carry_out(folder, name)


def carry_out(folder: Path, name: str) -> None:
    """Run a command's examples in a shell, in a folder with the files that they name."""
    program = folder / "bin" / "dpg"
    program.parent.mkdir()
    program.write_text(SCRIPT)
    program.chmod(0o755)
    data = CONFIGS / "calibration"
    (folder / "three_unit.yaml").rename(folder / "finger.yaml")
    (folder / "hinge.csv").write_text(HINGE)
    shutil.copy(data / "dome_path_h6.5_t0.75.csv", folder / "dome.csv")
    shutil.copy(data / "dome_grid.csv", folder / "domes.csv")
    shutil.copy(data / "unit_moment.csv", folder / "unit.csv")
    (folder / "sweep.yaml").write_text(
        "base: finger.yaml\n"
        "space: [{key: finger.geometry.unit_separation_mm, values: [2.5, 3.0]}]\n"
    )
    (folder / "goal.yaml").write_text(
        "base: finger.yaml\n"
        "vary: {finger.geometry.unit_separation_mm: {from: 2.5, to: 3.0}}\n"
        "maximize: [workspace_area_mm2]\n"
    )
    lines = [*EXAMPLES.get(PREPARED.get(name, ""), ()), *EXAMPLES[name]]
    if name == "init":
        for path in folder.glob("*.yaml"):
            path.unlink()
    if name == "merge":
        lines.insert(0, EXAMPLES["sweep"][1].replace("part1", "part2").replace("1/2", "2/2"))
    if name == "stress":  # one family for all or for a longer one: minutes less
        lines = [line.replace("crossed", "mirror") for line in lines]
        lines = [line if "--only" in line else f"{line} --only mirror" for line in lines]
    search = f"{program.parent}{os.pathsep}{os.environ['PATH']}"
    for line in lines:
        done = subprocess.run(
            line,
            shell=True,
            cwd=folder,
            env={**os.environ, "NO_COLOR": "1", "PATH": search},
            capture_output=True,
            text=True,
            check=False,
            timeout=300,
        )
        assert done.returncode == 0, (line, done.stderr)


def test_an_option_is_spelled_the_same_everywhere() -> None:
    names: dict[str, set[Any]] = defaultdict(set)
    for function in COMMANDS.values():
        for parameter in inspect.signature(function).parameters.values():
            for option in getattr(parameter.annotation, "__metadata__", ()):
                if isinstance(option, OptionInfo):
                    said = (option.default, *(option.param_decls or ()))
                    spelled = tuple(text for text in said if str(text)[:1] == "-")
                    metavar = str(option.metavar).replace("FOLDER", "FILE")
                    names[spelled[-1] if spelled else parameter.name].add((spelled, metavar))
    assert len(names) > 40
    assert {name: found for name, found in names.items() if len(found) > 1} == {}
    assert all(spelled == ("-o", "--output") for spelled, _ in names["--output"])


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("predict",), "SPEC is missing (see dpg predict --help)"),
        (("merge", "a"), "--output is missing (see dpg merge --help)"),
        (("nope",), "no such command 'nope' (see dpg --help)"),
        (("fit", "bistabel"), "no such command 'bistabel'. Did you mean 'bistable'?"),
        (("predict", "x", "--output=a", "b"), "got unexpected extra argument(s) (b)"),
        (("predict", "x", "--colums"), "no such option: --colums; did you mean --columns?"),
        (
            ("predict", "x", "--calibration", "finite_elements"),
            "no such option: --calibration; a key of the spec: --set finger.calibration=VALUE",
        ),
        (
            ("fit", "finger", "x", "y", "--law=push_only"),
            "no such option: --law; a key of the spec: --set finger.law=",
        ),
        (("report", "x", "--law", "push_only"), "no such option: --law (see dpg report --help)"),
        (("predict", "x", "--format", "xml"), "--format xml: expected one of 'table', 'json'"),
        (("predict", "x", "--tolerance", "small"), "--tolerance small: expected a valid number"),
        (("sweep", "x", "-o", "o", "-j", "0"), "--jobs 0: expected a number greater than or equ"),
        (("sweep", "x", "-o", "o", "-j", "two"), "--jobs two: expected a valid integer (see"),
        (("predict", "x", "--columns"), "option '--columns' requires an argument"),
        (("init", "--force=1"), "option '--force' does not take a value"),
        (("-v",), "missing command (see dpg --help)"),
        (("sweep", "x", "-o", ""), "--output is empty: expected a value (see dpg sweep --help)"),
        (("fe", "hinge", "x", "--output="), "--output is empty: expected a value (see dpg fe"),
        (("predict", "x", "--set", "a=1", "--set", ""), "--set is empty: expected a value"),
        (("merge", "a", "", "-o", "b"), "FOLDER... is empty: expected a value"),
        (("-v", "schema"), "--verbose goes with --version (see dpg --help)"),
    ],
)
def test_misuse_is_said_in_one_line(run: Run, arguments: tuple[str, ...], said: str) -> None:
    done = run(*arguments, before="import sys; sys.argv[0] = 'dpg'")
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert done.stderr.startswith(f"dpg: {said}")


@pytest.mark.parametrize("name", COMMANDS)
def test_an_empty_text_is_no_value_and_no_folder(name: str) -> None:
    """As of a variable that is not set: `-o "$OUT"` would fill the current folder."""
    first, _, second = name.partition(" ")
    command = Commands()[first].commands[second] if second else Commands()[first]
    arguments = [p for p in command.params if p.param_type_name == "argument"]
    words = {argument: ["x"] * place + [""] for place, argument in enumerate(arguments)}
    options = [p for p in command.params if p not in words and not p.is_flag]
    words |= {option: [f"{option.opts[-1]}="] for option in options}
    for parameter, said in words.items():
        with pytest.raises(typer.BadParameter, match=r"^is empty: expected a value") as met:
            command.make_context(name, said)
        assert met.value.param is parameter


@pytest.mark.parametrize("arguments", [(), ("fit",), ("fe",)])
def test_no_arguments_get_the_help(run: Run, arguments: tuple[str, ...]) -> None:
    done = run(*arguments)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == run(*arguments, "-h").stdout


@pytest.mark.parametrize("arguments", [("-V", "-v"), ("-v", "-V"), ("--version", "--verbose")])
def test_the_version_says_what_was_found(call: Call, arguments: tuple[str, ...]) -> None:
    short, long = call("-V").stdout, call(*arguments).stdout
    assert short == call("--version").stdout
    assert long.startswith(short)
    lines = dict(line.partition(": ")[::2] for line in long.splitlines()[2:])
    assert set(lines) >= {"python", "package", "cores", "temporary files"}
    assert re.fullmatch(
        r"\d+ in all, \d+ by affinity, .*: dpg sweep starts \d+ workers?", lines["cores"]
    )
    assert "matplotlib " in lines["extra plot"]
    assert not any("pytest" in line for line in lines.values())


@pytest.mark.parametrize(
    ("words", "offered"),
    [
        ("dpg re", ["report"]),
        ("dpg fit h", ["hinge"]),
        ("dpg predict --form", ["--format", "--formulation"]),
        ("dpg predict --format ", ["table", "json", "csv"]),
    ],
)
def test_the_shell_completes(run: Run, words: str, offered: list[str]) -> None:
    place = str(words.count(" "))
    asked = {"_DPG_COMPLETE": "complete_bash", "COMP_WORDS": words, "COMP_CWORD": place}
    # the program's name stands in the name of the variable
    done = run(env=asked, before="import sys; sys.argv[0] = 'dpg'")
    assert done.stdout.split() == offered


@pytest.mark.skipif(shutil.which("bash") is None, reason="needs bash")
def test_completion_is_installed_or_refused(folder: Path) -> None:
    line = f"{sys.executable} -c \"import sys; sys.argv[0] = 'dpg'; {PROGRAM}\" "
    line += "--install-completion; exit $?"  # else bash gives its place to the program

    def install(home: Path) -> "subprocess.CompletedProcess[str]":
        return subprocess.run(
            ["bash", "-c", line],
            env={**os.environ, "HOME": str(home)},
            capture_output=True,
            text=True,
            check=False,
        )

    done = install(folder)
    assert (done.returncode, done.stderr) == (0, "")
    assert "bash completion installed" in done.stdout
    assert ".bash_completions" in (folder / ".bashrc").read_text()
    refused = install(folder / "three_unit.yaml")
    assert refused.returncode == 2
    assert "cannot install completion" in refused.stderr
    assert "Traceback" not in refused.stderr
