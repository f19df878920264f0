"""Numbers of another version, or of changed code, are never taken for those of this one."""

import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from dpgcli.code import PACKAGE, sha256_of_code, versions_of_libraries
from dpgcli.errors import UsageError, WorkplaceError
from dpgcli.files import table_writer
from dpgcli.studies import sweep as studies
from dpgcli.sweeps.executors import Backend, SerialExecutor, serial
from dpgcli.sweeps.maker import HERE, NO_NUMBERS, WHO, check_workers, code_of
from dpgcli.sweeps.pool import processes

HEIGHTS = "{key: finger.geometry.dome_height_mm, values: [6.5, 7, 7.5]}"
OTHER = HERE._replace(code="f" * 64)
EVALUATING = """
import sys
from pathlib import Path
from dpgcli.sweeps.executors import serial
from dpgcli.files.sweep_file import read_sweep
from dpgcli.studies.sweep import Study
Study(read_sweep(Path(sys.argv[1])), Path(sys.argv[2])).compute(serial(), lambda _: None)
print(" ".join(name for name in sys.modules if name.startswith("dpgcli.")))
"""


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A copy of the package."""
    ignored = shutil.ignore_patterns("__pycache__")
    return Path(shutil.copytree(PACKAGE, tmp_path / "dpgcli", ignore=ignored))


def test_a_copy_has_the_same_code(package: Path) -> None:
    assert code_of(package) == HERE.code


@pytest.mark.parametrize("name", ["states/settle.py", "mechanics/laws.py", "__init__.py"])
def test_any_change_of_what_makes_numbers_is_other_code(package: Path, name: str) -> None:
    path = package / name
    path.write_text(path.read_text() + "\n")
    assert code_of(package) != HERE.code


def test_a_module_under_another_name_is_other_code(package: Path) -> None:
    (package / "states/settle.py").rename(package / "states/settled.py")
    assert code_of(package) != HERE.code


def test_work_on_what_is_printed_leaves_the_code_as_it_is(package: Path) -> None:
    for name in ("cli/sweep.py", "reports/summary.py", "hard_cases/verdicts.py"):
        (package / name).write_text("changed = True\n")
    assert code_of(package) == HERE.code


def test_a_calibration_that_ships_is_part_of_the_version(package: Path) -> None:
    """A sweep knows it by its content, a Makefile by the version."""
    path = package / "finite_elements" / "domes.yaml"
    path.write_text(path.read_text() + "\n")
    assert code_of(package) == HERE.code
    assert sha256_of_code(package) != sha256_of_code(PACKAGE)


def test_no_module_that_evaluates_designs_is_left_out(study: Any, tmp_path: Path) -> None:
    study(HEIGHTS)
    command = [sys.executable, "-c", EVALUATING, str(tmp_path / "out.yaml"), str(tmp_path / "out")]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    loaded = {name.split(".")[1] for name in done.stdout.split()}
    assert {"mechanics", "equilibrium", "states", "files", "studies"} <= loaded
    assert not loaded & set(NO_NUMBERS)


def test_parts_of_other_code_are_refused_by_that_name(
    study: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    study(HEIGHTS).compute(serial(), lambda _: None)
    monkeypatch.setattr(studies, "HERE", OTHER)
    with pytest.raises(UsageError, match=r"differs in code: "):
        study(HEIGHTS).check_unfinished()
    assert study(HEIGHTS).store.parts() == []


@pytest.mark.parametrize("library", ["numpy", "scipy", "shapely"])
def test_parts_of_another_library_are_refused_by_its_name(
    study: Any, monkeypatch: pytest.MonkeyPatch, library: str
) -> None:
    """Samples come from SciPy, curves too, and areas from Shapely."""
    study(HEIGHTS).compute(serial(), lambda _: None)
    others = {**versions_of_libraries(), library: "0.1"}
    monkeypatch.setattr(table_writer, "versions_of_libraries", lambda: others)
    with pytest.raises(UsageError, match=rf"differs in versions.{library}: "):
        study(HEIGHTS).check_unfinished()


def test_tables_of_other_code_are_not_up_to_date(
    study: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = study(HEIGHTS)
    made.compute(serial(), lambda _: None)
    made.assemble()
    assert made.is_up_to_date
    monkeypatch.setattr(studies, "HERE", OTHER)
    assert not replace(made).is_up_to_date


@pytest.mark.parametrize("workplace", [serial(), processes(2)])
def test_a_worker_of_other_code_evaluates_nothing(
    study: Any, monkeypatch: pytest.MonkeyPatch, workplace: Backend
) -> None:
    """As one that joins a cluster later: both are named."""
    monkeypatch.setattr(studies, "HERE", OTHER)
    with pytest.raises(WorkplaceError) as refused:
        study(HEIGHTS).compute(workplace, lambda _: None)
    assert f"code {HERE.code[:8]}, but this sweep is of" in str(refused.value)
    assert "code ffffffff:" in str(refused.value)
    assert study(HEIGHTS).store.parts() == []


@pytest.mark.parametrize(
    ("answer", "named"),
    [
        (HERE._replace(dpg="0.0.1"), "has dpg 0.0.1, NumPy"),
        (HERE._replace(numpy="1.0"), "NumPy 1.0, SciPy"),
        (HERE._replace(scipy="1.0"), "SciPy 1.0, Shapely"),
        (HERE._replace(shapely="1.0"), "Shapely 1.0, code"),
        (OTHER, "code ffffffff, but"),
        (ModuleNotFoundError("No module named 'dpgcli'"), "No module named"),
    ],
)
def test_a_mixed_cluster_is_refused_before_the_work(answer: Any, named: str) -> None:
    answers = {"tcp://a": HERE, "tcp://b": answer}
    mixed = Backend("the cluster", lambda _: pytest.fail("used"), 2, ask=lambda _: answers)
    with pytest.raises(WorkplaceError, match="worker tcp://b of the cluster") as refused:
        check_workers(mixed)
    assert named in str(refused.value)
    assert str(HERE) in str(refused.value)


class GoneError(OSError):
    """As Dask's CommClosedError."""


class LostExecutor(SerialExecutor):
    """Of a client that has lost its scheduler."""

    def submit(self, *_: Any, **__: Any) -> Any:
        raise GoneError("closed")


def test_a_scheduler_that_goes_is_no_worker_of_another_kind(study: Any) -> None:
    """Whether it answers for its workers that they are gone, or not at all."""

    def silent(_: Any) -> dict[str, Any]:
        raise GoneError("in broadcast: stream is closed")

    def executor(_: int) -> LostExecutor:
        return LostExecutor()

    gone = {"tcp://a": GoneError("stream is closed")}
    for ask in (silent, lambda _: gone):
        lost = Backend("the cluster", executor, 2, lost=(GoneError,), ask=ask)
        with pytest.raises(WorkplaceError, match=r"^the cluster is lost\. "):
            study(HEIGHTS).compute(lost, lambda _: None)
    mixed = Backend(
        "the cluster", executor, 2, lost=(GoneError,), ask=lambda _: gone | {"b": OTHER}
    )
    with pytest.raises(WorkplaceError, match="worker b of the cluster has"):
        check_workers(mixed)


def test_all_workers_are_asked_before_a_sweep_is_begun(study: Any) -> None:
    mixed = Backend("the cluster", lambda _: pytest.fail("used"), 2, ask=lambda _: {"a": OTHER})
    with pytest.raises(WorkplaceError, match="worker a of the cluster has"):
        study(HEIGHTS).compute(mixed, lambda _: None)
    assert not study(HEIGHTS).store.folder.exists()


def test_a_cluster_of_one_kind_passes() -> None:
    asked: list[Any] = []

    def ask(function: Any) -> dict[str, Any]:
        asked.append(function)
        return {"tcp://a": function(), "tcp://b": function()}

    check_workers(Backend("the cluster", lambda _: pytest.fail("used"), 2, ask=ask))
    assert asked == [WHO]
