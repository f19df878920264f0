"""`import dpgcli as dpg`: its names, loaded when asked for; errors that name fields."""

import ast
import importlib
import inspect
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import dpgcli as dpg
from dpgcli.api.tables import TableResult
from dpgcli.cli.spelling import option_of, with_options
from dpgcli.errors import DpgError, Field, Message, UsageError, respelled

PACKAGE = Path(dpg.__file__).parent
MANUAL = "".join(p.read_text(encoding="utf-8") for p in (PACKAGE / "manual").glob("*.md"))
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


def test_every_result_with_a_table_is_for_pandas_and_arrow() -> None:
    """Whatever a function returns: a table alone is of no use to those who know pandas."""
    back = [str(inspect.signature(getattr(dpg, name)).return_annotation) for name in FUNCTIONS]
    named = {name for text in back for name in re.findall(r"\w+Result", text)}
    homes = [
        importlib.import_module(f"dpgcli.api.{p.stem}") for p in (PACKAGE / "api").glob("*.py")
    ]
    homes.append(importlib.import_module("dpgcli.api.fits.result"))
    results = {n: c for home in homes for n, c in inspect.getmembers(home, inspect.isclass)}
    tables = {name for name in named if hasattr(results[name], "table")}
    assert len(tables) > 12
    assert {n for n in tables if not issubclass(results[n], TableResult)} == set()


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
    assert re.search(rf"`?{option_of(field)}\b", MANUAL)


def test_lower_floors_name_no_option() -> None:
    """But in what they say of the shell's own commands."""
    option = re.compile(r"(?<![-\w])--[a-z][a-z-]+")
    commands = ("dpg bench --json", "--set")
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


SPEC = {
    "finger": {
        "units": 2,
        "linear_stiffness_N_per_mm": 1.0e4,
        "lattice": {
            "segment_length_mm": 13.5,
            "segment_height_mm": 10.75,
            "stroke_mm": 3.5,
            "bistable_stiffness_N_per_mm": 12.84,
            "force_linearity": 0.043,
            "hinge_stiffness_N_mm_per_rad": 24.2,
        },
    }
}
KNOWN = {"pattern": ["11"], "tip_x_mm": [26.0], "tip_y_mm": [-4.0]}
SPACE = [{"key": "finger.lattice.stroke_mm", "values": [3.0, 3.5]}]
CURVE = {"travel_mm": [0.0, 0.5, 1.0, 1.5, 2.0, 2.5], "energy_mJ": [0, 0.14, 0.25, 0.14, 0, 0.39]}


@pytest.mark.parametrize(
    ("call", "field"),
    [
        (lambda: dpg.compare(SPEC, KNOWN, first_station=(float("nan"), 0.0)), "first_station"),
        (lambda: dpg.compare(SPEC, KNOWN, tip_offset=(1.0,)), "tip_offset"),
        (lambda: dpg.compare(SPEC, KNOWN, first_station="1,2"), "first_station"),
        (lambda: dpg.predict(SPEC).draw("states.pdf"), "path"),
        (lambda: dpg.merge([], "whole"), "shards"),
        (lambda: dpg.sweep({"base": SPEC, "space": SPACE}, jobs=-1), "jobs"),
        (lambda: dpg.sweep({"base": SPEC, "space": SPACE}, jobs=0, executor="serial"), "jobs"),
        (lambda: dpg.fit_bistable(CURVE, travel_to_opening="equal", bootstrap=-1), "bootstrap"),
        (lambda: dpg.fit_bistable(CURVE, travel_to_opening="equal", seed=-1), "seed"),
        (
            lambda: dpg.fit_bistable(CURVE, travel_to_opening="equal", fix={"stroke_mm": "x"}),
            "fix",
        ),
        (lambda: dpg.fit_finger(SPEC, KNOWN, free=()), "free"),
        (lambda: dpg.stress(only="foo"), "only foo"),
    ],
)
def test_functions_refuse_what_commands_refuse(call: Callable[[], object], field: str) -> None:
    with pytest.raises(UsageError, match=rf"^{field}\b"):
        call()


def test_a_text_alone_is_no_sequence_of_letters() -> None:
    table = dpg.predict(SPEC, settings="finger.units=3", patterns="1*1").table
    assert list(table["pattern"]) == ["101", "111"]
    with pytest.raises(UsageError, match="nowhere: expected the output"):
        dpg.merge("nowhere", "whole")


def test_arrays_and_ranges_are_lists_of_values() -> None:
    numbers = np.array([3.0, 3.5])
    space = [{"key": "finger.lattice.stroke_mm", "values": numbers}]
    found = dpg.sweep({"base": SPEC, "space": space}, executor="serial").designs
    assert list(found["stroke_mm"]) == [3.0, 3.5]
    space = [{"key": "finger.units", "values": range(1, 3)}]
    found = dpg.sweep({"base": SPEC, "space": space}, executor="serial").designs
    assert list(found["n_units"]) == [1, 2]
