"""The manual is current: it names everything, and its sessions are what the program prints."""

import inspect
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from _pytest.mark import ParameterSet
from typer.models import OptionInfo

import dpgcli as dpg
from dpgcli.benchmark.ablation import ABLATIONS
from dpgcli.cli import (
    actuate,
    bench,
    check,
    compare,
    design,
    explain,
    fe,
    grasp,
    help,
    init,
    landscape,
    merge,
    pick,
    predict,
    pulses,
    report,
    routine,
    schema,
    stress,
    sweep,
    transitions,
    validate,
)
from dpgcli.cli.exits import ExitCode
from dpgcli.cli.fit.bistable import bistable
from dpgcli.cli.fit.finger import finger
from dpgcli.cli.fit.grid import grid
from dpgcli.cli.fit.hinge import hinge
from dpgcli.cli.main import NAMES
from dpgcli.design.scatter import OF_FINGERS
from dpgcli.design.scene import Origin
from dpgcli.files.scene_file import json_schema, read_spec
from dpgcli.files.sweep_file import read_sweep
from dpgcli.hard_cases.families import FAMILIES, PATTERNS
from dpgcli.hard_cases.outcomes import Verdict
from dpgcli.states.certify import Status
from dpgcli.states.columns import Column, Group
from dpgcli.states.quantities import declared
from dpgcli.sweeps.evaluation import LEVEL_COLUMNS, DesignStatus
from dpgcli.sweeps.metrics import METRICS

ROOT = Path(__file__).parents[1]
COMMANDS = {
    **{
        module.__name__.rpartition(".")[2]: getattr(module, module.__name__.rpartition(".")[2])
        for module in (
            predict,
            explain,
            sweep,
            design,
            bench,
            compare,
            stress,
            actuate,
            transitions,
            pulses,
            merge,
            check,
            pick,
            report,
            validate,
            init,
            landscape,
            grasp,
            routine,
            schema,
            help,
        )
    },
    "fit bistable": bistable,
    "fit hinge": hinge,
    "fit finger": finger,
    "fit grid": grid,
    "fe dome": fe.dome,
    "fe hinge": fe.hinge,
    "fe unit": fe.unit,
    "fe finger": fe.finger,
}
PAGES = {"README": ROOT / "README.md"} | {
    path.stem: path for path in sorted((ROOT / "dpgcli" / "manual").glob("*.md"))
}
MANUAL = "\n".join(path.read_text(encoding="utf-8") for path in PAGES.values())
FENCED = re.compile(r"^```(\w+)(.*)\n((?:.*\n)*?)```$", re.MULTILINE)
LAST_DIGITS = re.compile(r"\d\.\de[-+]\d\d")  # rounding differs between processors
PROGRESS = re.compile(r"^.*, [\d,]+ s( left)?\n", re.MULTILINE)  # while one waits
TIMES = re.compile(r"[\d.,]+ (?=s\b|states/s|% of the workers|% in )")


@dataclass(frozen=True)
class Block:
    """A fenced block: its language, the words after it, what stands in it."""

    language: str
    words: tuple[str, ...]
    text: str


def text_of(page: str) -> str:
    return PAGES[page].read_text(encoding="utf-8")


def blocks(page: str) -> list[Block]:
    found = FENCED.findall(text_of(page))
    return [Block(language, tuple(words.split()), text) for language, words, text in found]


def stories() -> Iterator[ParameterSet]:
    """Every page, and those with slow sessions once more with these."""
    for page in PAGES:
        yield pytest.param(page, False, id=page)
        if any("slow" in block.words for block in blocks(page)):
            yield pytest.param(page, True, id=f"{page}, slow", marks=pytest.mark.slow)


@pytest.fixture
def scratch_copy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A folder with the examples, as the current one, and `dpg` on the PATH."""
    shutil.copytree(ROOT / "configs", tmp_path / "configs")
    monkeypatch.chdir(tmp_path)
    programs = Path(sys.executable).parent
    monkeypatch.setenv("PATH", os.pathsep.join((str(programs), os.environ["PATH"])))
    monkeypatch.setenv("NO_COLOR", "1")
    monkeypatch.delenv("COLUMNS", raising=False)


@pytest.mark.slow
@pytest.mark.parametrize(("page", "with_slow"), [*stories()])
@pytest.mark.usefixtures("scratch_copy")
def test_a_page_does_what_it_shows(
    page: str, with_slow: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its blocks one after the other, in a folder of their own with the examples.

    A `console` block is a session, a `python` block is run and a `text` block after it is what it
    prints, a block with a file's name is that file. What takes long is marked `slow`, what needs
    CalculiX `ccx`.
    """
    names: dict[str, object] = {}
    before = ""
    for block in blocks(page):
        if ("slow" in block.words and not with_slow) or ("ccx" in block.words and not CCX):
            continue
        if block.language == "console":
            run_session(block.text)
        elif block.language == "python":
            capsys.readouterr()
            exec(block.text, names)
        elif block.language == "text":
            assert before == "python", "what is printed stands below what prints it"
            printed = capsys.readouterr().out
            assert is_shown(printed, block.text), printed
        elif block.words:
            Path(block.words[0]).write_text(block.text, encoding="utf-8")
        before = block.language


CCX = shutil.which("ccx")


def run_session(text: str) -> None:
    """Its commands, each with what it prints: standard output, or all with messages at the end."""
    for part in text.split("$ ")[1:]:
        command, _, shown = part.partition("\n")
        code = re.search(r"# exit code (\d)$", command)
        done = subprocess.run(command, shell=True, capture_output=True, text=True, check=False)
        assert done.returncode == (int(code[1]) if code else 0), done.stderr
        everything = done.stdout + PROGRESS.sub("", done.stderr)
        if not is_shown(done.stdout, shown) and not is_shown(everything, shown):
            assert everything == shown, command


def is_shown(printed: str, shown: str) -> bool:
    """Whether a page shows what is printed; a line of three dots stands for any lines.

    >>> is_shown("1\\n2\\n3\\n", "1\\n...\\n3\\n"), is_shown("1\\n2\\n3\\n", "1\\n3\\n")
    (True, False)
    """
    pattern, printed = (TIMES.sub("#", LAST_DIGITS.sub("#", text)) for text in (shown, printed))
    lines = (".*?" if line == "...\n" else re.escape(line) for line in pattern.splitlines(True))
    return re.fullmatch("".join(lines), printed, re.DOTALL) is not None


@pytest.mark.parametrize(
    ("printed", "is_the_same"),
    [
        ("a 1.5 mm\n4.1e-13\n0.2 s\n", True),
        ("a 1.5 mm\n4.5e-13\n0.31 s\n", True),
        ("a 1.6 mm\n4.1e-13\n0.2 s\n", False),
        ("a 1.5 mm\n4.1e-13\n0.2 s\nmore\n", False),
        ("", False),
    ],
)
def test_a_page_that_shows_another_number_is_wrong(printed: str, is_the_same: bool) -> None:
    assert is_shown(printed, "a 1.5 mm\n4.1e-13\n0.2 s\n") is is_the_same


def test_the_readme_fits_on_two_screens() -> None:
    assert len(text_of("README").splitlines()) <= 150


def examples() -> list[str]:
    """Those in the README's table of commands."""
    text = text_of("README")
    return re.findall(r"^\| `dpg [^|]*\|[^|]*\| `(dpg [^`]*)` \|$", text, re.MULTILINE)


def test_every_command_has_an_example() -> None:
    assert {example.split()[1] for example in examples()} == set(NAMES)


@pytest.mark.slow
@pytest.mark.usefixtures("scratch_copy")
def test_the_examples_of_commands_run() -> None:
    """One after the other; the shards that one of them merges are made before."""
    sweep_file = "configs/sweeps/height_separation.yaml"
    shards = [f"dpg sweep {sweep_file} --shard {k}/2 -o shard-{k}" for k in (1, 2)]
    for command in (*shards, *examples()):
        done = subprocess.run(command, shell=True, capture_output=True, text=True, check=False)
        assert done.returncode == 0, f"{command}: {done.stderr}"


def test_words_of_our_own_are_only_in_the_glossary() -> None:
    ours = re.compile(r"\brungs?\b|\blevers?\b|\b(held|hold|holds) \w* ?against\b")
    assert not ours.findall(MANUAL.replace(text_of("glossary"), ""))


@pytest.mark.parametrize("page", PAGES)
def test_links_lead_somewhere(page: str) -> None:
    text = FENCED.sub("", text_of(page))
    for target in re.findall(r"\]\(([^)]+)\)", text):
        name, _, heading = target.partition("#")
        path = PAGES[page].parent / name if name else PAGES[page]
        assert path.is_file(), target
        assert not heading or heading in headings(path), target


def headings(path: Path) -> set[str]:
    """Headings of a page as a forge's links name them."""
    text = FENCED.sub("", path.read_text(encoding="utf-8"))
    titles = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    return {re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-") for title in titles}


def test_the_picture_is_what_the_command_draws(tmp_path: Path) -> None:
    """To a pixel: other versions of Matplotlib may write the same in other words."""
    (named,) = re.findall(r"!\[[^]]+\]\((\S+\.svg)\)", text_of("README"))
    spec = ROOT / "configs" / "three_unit.yaml"
    plot = str(tmp_path / "states.svg")
    dpg.predict(spec).draw(plot)
    shown, drawn = (_drawing(Path(path)) for path in (ROOT / named, plot))
    assert shown[0] == drawn[0]
    np.testing.assert_allclose(shown[1], drawn[1], atol=1.0)


def _drawing(path: Path) -> tuple[list[str], np.ndarray]:
    """The texts of a picture and the coordinates of its lines."""
    elements = list(ElementTree.parse(path).iter())
    texts = [element.text for element in elements if (element.text or "").strip()]
    lines = " ".join(element.get("d", "") for element in elements)
    return texts, np.array(re.findall(r"-?[0-9.]+", lines), float)


def test_the_spec_shown_is_valid(tmp_path: Path) -> None:
    path = tmp_path / "spec.yaml"
    path.write_text(unnamed_yaml("spec"), encoding="utf-8")
    assert read_spec(path).finger.units == 5


def test_the_sweep_shown_is_valid(tmp_path: Path) -> None:
    (tmp_path / "sweeps").mkdir()
    shutil.copy(ROOT / "configs" / "five_unit.yaml", tmp_path)
    path = tmp_path / "sweeps" / "sweep.yaml"
    path.write_text(unnamed_yaml("sweeps"), encoding="utf-8")
    assert read_sweep(path).space.size == 13 * 3 * 3 * 2 * 64


def unnamed_yaml(page: str) -> str:
    return next(b.text for b in blocks(page) if b.language == "yaml" and not b.words)


def test_every_function_is_named() -> None:
    functions = [name for name in dpg.__all__ if inspect.isfunction(getattr(dpg, name))]
    named = {name for name in functions if re.search(rf"(`|dpg\.){name}\b", MANUAL)}
    assert set(functions) - named <= {"read_calibration", "uniform_finger"}


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_and_option_is_named(name: str) -> None:
    assert f"`dpg {name}" in MANUAL
    options = set()
    for parameter in inspect.signature(COMMANDS[name]).parameters.values():
        for metadata in getattr(parameter.annotation, "__metadata__", ()):
            if isinstance(metadata, OptionInfo):
                said = (metadata.default, *(metadata.param_decls or ()))
                named = {text for text in said if isinstance(text, str) and text[:1] == "-"}
                options |= named or {f"--{parameter.name.replace('_', '-')}"}
    assert not {option for option in options if option not in MANUAL}


def test_every_key_of_the_spec_is_on_its_page() -> None:
    definitions = json_schema()["$defs"].values()
    keys = {key for part in definitions for key in part.get("properties", {})}
    assert not {key for key in keys if f"{key}" not in text_of("spec")}
    assert not {origin for origin in Origin if f"`{origin}`" not in text_of("spec")}


def named_in(page: str) -> set[str]:
    """What a page has in backticks."""
    return set(re.findall(r"`([^`\n]+)`", text_of(page)))


def is_by_unit(column: Column) -> bool:
    """Whether there is one for each unit or station: then the first stands for all."""
    return column.group in (Group.NODES, Group.OPENINGS) or column.name.startswith("barrier_")


def test_every_column_group_and_status_is_on_its_page() -> None:
    columns = declared(3, ("bistable", "hinge", "bar"), True)
    names = {c.name for c in columns if not is_by_unit(c)}
    names |= {"opening_1_mm", "barrier_1_mJ", *(g.value for g in Group), *(s.text for s in Status)}
    assert not names - named_in("columns")
    assert not {c.name for c in (*METRICS, *LEVEL_COLUMNS)} - named_in("sweeps")
    assert not {*DesignStatus} - named_in("sweeps")


def test_what_is_one_draw_for_the_whole_finger_is_named() -> None:
    named = text_of("pressure").split("What is one value of the whole finger")[1].split(". ")[0]
    assert set(re.findall(r"`(\w+)`", named)) == set(OF_FINGERS)


def test_every_verdict_family_and_ablation_is_on_its_page() -> None:
    assert not {*Verdict, PATTERNS.name, *(f.name for f in FAMILIES)} - named_in("stress")
    assert not {*ABLATIONS} - named_in("accuracy")


def test_every_exit_code_is_on_its_page() -> None:
    page = text_of("files")
    assert not {code for code in ExitCode if not re.search(rf"^\|.*\b{code}\b.*\|", page, re.M)}
