"""Where work is done, seen from processes that are workers themselves."""

import os
import subprocess
import sys
from multiprocessing import current_process
from pathlib import Path

import pytest

import dpgcli as dpg
from dpgcli.sweeps.guard import OF_POOL
from tests.api.test_choices import GOAL, SWEEP

UNGUARDED = f"""import dpgcli as dpg
dpg.sweep({SWEEP!r}, "out", jobs=2)
"""


def test_daemons_are_told_to_work_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(vars(current_process())["_config"], "daemon", True)
    for work in (lambda **at: dpg.sweep(SWEEP, **at), lambda **at: dpg.inverse_design(GOAL, **at)):
        with pytest.raises(dpg.UsageError, match=r"executor processes: .* a daemon.* take serial"):
            work(output=tmp_path / "out", jobs=2)
        assert not list(tmp_path.iterdir())
    assert len(dpg.sweep(SWEEP, jobs=2, executor="serial").designs) == 1


@pytest.mark.parametrize("jobs", [1, 2])
def test_a_worker_that_imports_the_work_does_none(
    monkeypatch: pytest.MonkeyPatch, jobs: int
) -> None:
    """One of ours leaves the message to the process that waits; others get an error."""
    monkeypatch.setattr(current_process(), "_inheriting", True, raising=False)
    monkeypatch.delenv(OF_POOL, raising=False)
    with pytest.raises(dpg.UsageError, match="still importing its program: put what starts"):
        dpg.sweep(SWEEP, jobs=jobs)
    monkeypatch.setenv(OF_POOL, "1")
    with pytest.raises(SystemExit):
        dpg.sweep(SWEEP, jobs=jobs)


@pytest.mark.slow
def test_a_program_without_a_guard_is_told_once(tmp_path: Path) -> None:
    (tmp_path / "program.py").write_text(UNGUARDED, encoding="utf-8")
    ran = subprocess.run(
        [sys.executable, "program.py"], cwd=tmp_path, capture_output=True, text=True,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
    )  # fmt: skip
    assert ran.returncode == 1
    assert ran.stderr.count("errors.WorkplaceError") == 1
    assert 'put what starts its work under if __name__ == "__main__"' in ran.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["program.py"]
