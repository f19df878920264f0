"""`import dpgcli as dpg`: its names, loaded when asked for; errors that name fields."""

import ast
import importlib
import inspect
import re
import subprocess
import sys
from pathlib import Path

import pytest

import dpgcli as dpg
from dpgcli.cli.spelling import option_of, with_options
from dpgcli.errors import DpgError, Field, Message, respelled

PACKAGE = Path(dpg.__file__).parent
README = (PACKAGE.parent / "README.md").read_text(encoding="utf-8")
FUNCTIONS = [name for name in dpg.__all__ if inspect.isfunction(getattr(dpg, name))]
HEAVY = {"numpy", "scipy", "pandas", "pyarrow", "pydantic", "matplotlib"}


def fields() -> set[str]:
    """The names of all fields in messages of the package; those of groups of columns aside."""
    found = set()
    for path in PACKAGE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                first = node.args[0] if node.args else None
                if node.func.id == "Field" and isinstance(first, ast.Constant):
                    found.add(first.value)
    return found


def test_there_are_functions() -> None:
    assert {"predict", "sweep", "fit_bistable", "compare", "bench", "stress"} <= set(FUNCTIONS)


@pytest.mark.parametrize("name", dpg.__all__)
def test_every_public_name_is_there(name: str) -> None:
    assert name in dir(dpg)
    assert getattr(dpg, name) is not None


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_function_has_an_example(name: str) -> None:
    assert ">>> " in (inspect.getdoc(getattr(dpg, name)) or "")


def test_other_names_are_not_there() -> None:
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = dpg.nothing


def test_no_room_hides_a_function() -> None:
    """A module of the package becomes its attribute once it is imported."""
    rooms = {path.stem for path in PACKAGE.iterdir()}
    assert not rooms & set(dpg.__all__)


def test_importing_the_package_loads_nothing_heavy() -> None:
    said = "import sys, dpgcli; print(*{name.partition('.')[0] for name in sys.modules})"
    done = subprocess.run([sys.executable, "-c", said], capture_output=True, text=True, check=True)
    assert not HEAVY & set(done.stdout.split())


def test_messages_name_fields_of_functions() -> None:
    parameters = {p for name in FUNCTIONS for p in inspect.signature(getattr(dpg, name)).parameters}
    known = parameters | {"setting", "uncertainty", "plot", "time_limit"}  # of commands alone
    assert fields()
    assert fields() <= known


@pytest.mark.parametrize("field", sorted(fields()))
def test_the_command_line_has_an_option_for_each_field(field: str) -> None:
    assert re.search(rf"`?{option_of(field)}\b", README)


def test_lower_floors_name_no_option() -> None:
    """But in what they say of the shell's own commands."""
    option = re.compile(r"(?<![-\w])--[a-z][a-z-]+")
    commands = ("dpg bench --json", "--set", "--text", "--page", "--line")  # CSS's own
    for path in PACKAGE.rglob("*.py"):
        if path.relative_to(PACKAGE).parts[0] in ("cli", "errors.py"):
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                text = node.value
                for command in commands:
                    text = text.replace(command, "")
                assert not option.search(text) or "`" in text, f"{path}: {node.value}"


def test_a_message_is_its_text() -> None:
    message = Message("drop ", Field("target_error"), Message(" or ", Field("patterns")))
    assert message == "drop target_error or patterns"
    assert with_options(message) == "drop --target-error or --pattern"
    assert with_options("drop target_error") == "drop target_error"
    assert respelled(message, str.upper) == "drop TARGET_ERROR or PATTERNS"


@pytest.mark.parametrize(
    "name",
    ["UsageError", "FitError", "NothingSelectedError", "OutputError", "SolverError"],
)
def test_an_error_keeps_its_fields(name: str) -> None:
    kind = getattr(importlib.import_module("dpgcli.errors"), name)
    error = kind(Field("tolerance"), " 1: too large")
    assert isinstance(error, DpgError)
    assert str(error) == "tolerance 1: too large"
    assert with_options(error.message) == "--tolerance 1: too large"
