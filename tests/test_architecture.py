"""The plan of the house, kept: modules import their own floor or a lower one."""

import ast
from pathlib import Path

import pytest

import dpgcli

PACKAGE = Path(dpgcli.__file__).parent
FLOORS = {
    "errors": 0,
    "records": 0,
    "arrays": 0,
    "code": 0,
    "cores": 0,
    "signals": 0,
    "temporary": 0,
    "text": 0,
    "equilibrium": 1,
    "mechanics": 2,
    "design": 2,
    "states": 3,
    "actuation": 4,
    "grasping": 4,
    "calibration": 4,
    "reference": 4,
    "benchmark": 5,
    "hard_cases": 5,
    "search": 5,
    "sweeps": 5,
    "files": 6,
    "reports": 6,
    "api": 7,
    "studies": 7,
    "cli": 8,
    "__main__": 9,
}
MODULES = sorted(path for path in PACKAGE.rglob("*.py") if path != PACKAGE / "__init__.py")


def floor(module: str) -> int:
    """Floor of a dotted module name of the package; the package itself is the ground."""
    parts = module.split(".")
    return FLOORS[parts[1]] if len(parts) > 1 else 0


def imported(path: Path) -> list[str]:
    """Every module of the package that a file imports, lazy imports included."""
    names: list[str] = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            is_package = (PACKAGE.parent / node.module.replace(".", "/")).is_dir()
            names += [f"{node.module}.{a.name}" if is_package else node.module for a in node.names]
    return [name for name in names if name.split(".")[0] == "dpgcli" and "__version__" not in name]


@pytest.mark.parametrize("path", MODULES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_imports_go_down(path: Path) -> None:
    own = floor(".".join(("dpgcli", *path.relative_to(PACKAGE).with_suffix("").parts)))
    above = [name for name in imported(path) if floor(name) > own]
    assert not above


def test_the_solver_knows_no_finger() -> None:
    known = {name for path in (PACKAGE / "equilibrium").rglob("*.py") for name in imported(path)}
    assert {name.split(".")[1] for name in known} <= {"arrays", "equilibrium", "records"}


def test_the_room_for_designs_knows_no_files_and_no_specs() -> None:
    paths = list((PACKAGE / "design").rglob("*.py"))
    words = [word for path in paths for word in path.read_text(encoding="utf-8").split()]
    assert len(paths) > 5
    assert not {"pydantic", "pathlib", "yaml"} & set(words)


@pytest.mark.parametrize(
    "folder", ["mechanics", "design", "equilibrium", "states", "grasping", "calibration"]
)
def test_physics_neither_prints_nor_exits_nor_reads_files(folder: str) -> None:
    paths = list((PACKAGE / folder).rglob("*.py"))
    assert len(paths) > 1
    for path in paths:
        tree = ast.parse(path.read_text(encoding="utf-8"))
        called = {
            node.func.id
            for node in ast.walk(tree)
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)
        }
        assert not called & {"print", "open", "exit", "input"}, path


def test_no_function_is_longer_than_sixty_lines() -> None:
    assert len(MODULES) > 100
    for path in MODULES:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef):
                assert node.end_lineno is not None
                assert node.end_lineno - node.lineno < 60, f"{path}: {node.name}"


def test_text_is_written_with_the_same_line_ends_everywhere() -> None:
    """Python would write those of Windows there, and marks and hashes would differ."""
    written = []
    for path in MODULES:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Attribute):
                continue
            modes = [arg.value for arg in node.args[:1] if isinstance(arg, ast.Constant)]
            if node.func.attr == "write_text" or (node.func.attr == "open" and modes == ["w"]):
                ends = [word.value for word in node.keywords if word.arg == "newline"]
                assert [ast.literal_eval(end) for end in ends] == ["\n"], path
                written.append(path)
    assert len(written) >= 5


@pytest.mark.parametrize("path", MODULES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_temporary_files_are_those_that_the_next_run_removes(path: Path) -> None:
    """What `tempfile` makes stays for good after a process that was killed."""
    makers = ("TemporaryDirectory", "TemporaryFile", "mkdtemp", "mkstemp", "mktemp")
    text = path.read_text(encoding="utf-8")
    assert not [maker for maker in makers if maker in text]
