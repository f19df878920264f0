"""Scripts that lie in the working folder are the user's: nothing of the program imports them."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

Run = Callable[..., "subprocess.CompletedProcess[str]"]

NAMES = ("random", "tempfile", "logging", "queue", "selectors", "socket", "numpy", "filelock")
RUN = "from dpgcli.__main__ import main; main()"
SCRIPT, MODULE = ("-P", "-c", RUN), ("-m", "dpgcli")
SWEEP = "base: three_unit.yaml\nspace: [{key: finger.geometry.dome_height_mm, values: [6, 6.5]}]\n"


@pytest.fixture
def scripts(folder: Path) -> Path:
    """Scripts with the names of libraries; each leaves a word if it runs."""
    for name in NAMES:
        script = f"open({str(folder / 'ran.txt')!r}, 'a').write('{name} ')\nraise SystemExit(7)\n"
        (folder / f"{name}.py").write_text(script)
    (folder / "sweep.yaml").write_text(SWEEP)
    return folder


@pytest.mark.parametrize(
    ("start", "path", "method"),
    [
        (SCRIPT, None, "forkserver"),
        pytest.param(SCRIPT, "", "forkserver", marks=pytest.mark.slow),
        (SCRIPT, f"nowhere{os.pathsep}.", "forkserver"),
        (MODULE, None, "forkserver"),
        pytest.param(SCRIPT, None, "spawn", marks=pytest.mark.slow),
        (MODULE, None, "spawn"),
    ],
)
def test_workers_import_nothing_from_it(
    scripts: Path, start: tuple[str, ...], path: str | None, method: str
) -> None:
    environment = {name: text for name, text in os.environ.items() if name[:6] != "PYTHON"}
    if path is not None:
        environment["PYTHONPATH"] = path
    if method == "spawn":  # as on Windows
        (scripts / "spawned").mkdir()
        (scripts / "spawned" / "sitecustomize.py").write_text(
            "import multiprocessing as m\nm.get_all_start_methods = lambda: ['spawn']\n"
        )
        environment["PYTHONPATH"] = "spawned"
    done = subprocess.run(
        [sys.executable, *start, "sweep", "sweep.yaml", "-o", "out", "-j", "2"],
        cwd=scripts,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert not (scripts / "ran.txt").exists(), (scripts / "ran.txt").read_text()
    assert (done.returncode, "Traceback" in done.stderr) == (0, False), done.stderr
    assert (scripts / "out" / "designs.parquet").exists()


@pytest.mark.parametrize("start", [MODULE, ("-c", RUN)])
def test_neither_does_a_command(scripts: Path, start: tuple[str, ...]) -> None:
    done = subprocess.run(
        [sys.executable, *start, "predict", "three_unit.yaml", "-o", "states.parquet"],
        cwd=scripts,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, "111" in done.stdout) == (0, True), done.stderr
    assert not (scripts / "ran.txt").exists()
