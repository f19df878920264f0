"""Nothing heavy is loaded before it is needed."""

import subprocess
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest

CONFIGS = Path(__file__).parents[2] / "configs"
SCRIPT = """
import atexit, sys
from pathlib import Path
from dpgcli.cli.main import main
report = Path(sys.argv.pop(1))
atexit.register(lambda: report.write_text(" ".join(sys.modules)))
main()
"""
AT_START = {"numpy", "scipy", "pandas", "pyarrow", "matplotlib", "pydantic", "numba"}
PREDICTING = {"scipy", "pandas", "pyarrow", "matplotlib", "numba", "rich", "shapely", "filelock"}


Loaded = Callable[..., set[str]]


@pytest.fixture(scope="module")
def loaded(tmp_path_factory: pytest.TempPathFactory) -> Loaded:
    """Names of the modules that a run has loaded; the same run is not done twice."""
    report = tmp_path_factory.mktemp("loaded") / "modules.txt"

    @cache
    def modules(*arguments: str) -> set[str]:
        command = [sys.executable, "-c", SCRIPT, str(report), *arguments]
        subprocess.run(command, capture_output=True, check=True)
        return set(report.read_text(encoding="utf-8").split())

    return modules


@pytest.mark.parametrize("option", ["--help", "--version"])
def test_the_start_loads_nothing_heavy(loaded: Loaded, option: str) -> None:
    # the version waits for --verbose, which typer checks by pydantic
    assert loaded(option) & AT_START <= ({"pydantic"} if option == "--version" else set())


@pytest.mark.parametrize("arguments", [(), ("columns",)])
def test_the_manual_loads_no_numerics(loaded: Loaded, arguments: tuple[str, ...]) -> None:
    assert loaded("help", *arguments) & (AT_START - {"pydantic"}) == set()


@pytest.mark.parametrize("name", ["predict", "validate", "init", "transitions"])
def test_help_of_a_command_loads_no_numerics(loaded: Loaded, name: str) -> None:
    assert loaded(name, "--help") & (AT_START - {"pydantic"}) == set()


@pytest.mark.parametrize("name", ["bistable", "hinge", "grid"])
def test_help_of_a_fit_loads_no_numerics(loaded: Loaded, name: str) -> None:
    assert loaded("fit", name, "--help") & (AT_START - {"pydantic"}) == set()


@pytest.mark.parametrize(
    "arguments",
    [
        ("predict", str(CONFIGS / "three_unit.yaml")),
        ("predict", str(CONFIGS / "three_unit.yaml"), "--format", "json", "--columns", "all"),
        ("predict", str(CONFIGS / "gripper.yaml"), "--format", "csv"),
        ("explain", str(CONFIGS / "twenty_unit.yaml")),
        ("validate", str(CONFIGS / "three_unit.yaml")),
    ],
)
def test_predicting_loads_neither_tables_nor_figures(
    loaded: Loaded, arguments: tuple[str, ...]
) -> None:
    assert loaded(*arguments) & PREDICTING == set()


def test_a_spec_that_names_no_file_loads_no_reader_of_one(loaded: Loaded) -> None:
    found = loaded("predict", str(CONFIGS / "three_unit.yaml"))
    assert not {"dpgcli.files.csv_file", "dpgcli.files.units", "dpgcli.files.calibration"} & found


def test_transitions_load_neither_tables_nor_figures_nor_graphs(loaded: Loaded) -> None:
    found = loaded("transitions", str(CONFIGS / "three_unit.yaml"), "--format", "csv")
    assert found & (PREDICTING | {"networkx"}) == set()


@pytest.fixture(scope="module")
def swept(loaded: Loaded, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, set[str]]:
    """The folder of a sweep, and what it loaded."""
    output = tmp_path_factory.mktemp("swept") / "out"
    sweep = str(CONFIGS / "sweeps" / "height_separation.yaml")
    return output, loaded("sweep", sweep, "-o", str(output), "-j", "1", "--require", "n_stable > 0")


def test_without_pressure_nothing_of_it_is_loaded(
    loaded: Loaded, swept: tuple[Path, set[str]]
) -> None:
    found = swept[1] | loaded("predict", str(CONFIGS / "three_unit.yaml"))
    assert not [name for name in found if name.startswith("dpgcli.actuation")]


def test_comparing_loads_no_scipy(loaded: Loaded, tmp_path: Path) -> None:
    tips = tmp_path / "tips.csv"
    tips.write_text("pattern,tip_x_mm,tip_y_mm\n000,51,0\n")
    assert loaded("compare", str(CONFIGS / "three_unit.yaml"), str(tips)) & PREDICTING == set()


def test_writing_a_table_loads_no_pandas(loaded: Loaded, tmp_path: Path) -> None:
    table = str(tmp_path / "states.parquet")
    assert "pandas" not in loaded("predict", str(CONFIGS / "three_unit.yaml"), "-o", table)


def test_a_sweep_with_its_report_loads_nothing_that_it_can_do_without(
    loaded: Loaded, swept: tuple[Path, set[str]]
) -> None:
    output, found = swept
    heavy = {"scipy", "pandas", "pyarrow.compute", "numpy.ma", "matplotlib", "markdown_it"}
    assert found & heavy == set()
    assert loaded("report", str(output)) & heavy == set()
    chosen = ("--minimize", "reach_min_mm", "--maximize", "reach_max_mm", "--top", "2")
    assert loaded("pick", str(output), *chosen) & heavy == set()


def test_workers_load_no_reader_of_specs() -> None:
    """Nor anything else that only the program which starts them needs."""
    program = "import sys, dpgcli.studies.work; print(*sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    unneeded = {"pydantic", "ruamel.yaml", "typer", "pandas", "scipy", "pyarrow.parquet"}
    unneeded |= {f"dpgcli.states.{name}" for name in ("barriers", "uncertainty", "pairs.halves")}
    assert set(done.stdout.split()) & unneeded == set()


@pytest.mark.parametrize(("own", "expected"), [(None, "system"), ("mimalloc", "mimalloc")])
def test_arrow_takes_its_memory_from_the_system_unless_it_is_told(
    monkeypatch: pytest.MonkeyPatch, own: str | None, expected: str
) -> None:
    monkeypatch.delenv("ARROW_DEFAULT_MEMORY_POOL", raising=False)
    if own is not None:
        monkeypatch.setenv("ARROW_DEFAULT_MEMORY_POOL", own)
    program = "import dpgcli.cli.main, pyarrow; print(pyarrow.default_memory_pool().backend_name)"
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == expected


def test_a_command_loads_no_other_than_those_it_shares_with(loaded: Loaded) -> None:
    found = loaded("predict", str(CONFIGS / "three_unit.yaml"))
    others = {
        "bench",
        "check",
        "compare",
        "fe",
        "fit",
        "init",
        "merge",
        "pick",
        "report",
        "stress",
        "sweep",
    }
    assert "dpgcli.cli.predict" in found
    assert not {f"dpgcli.cli.{name}" for name in others} & found
