"""What only POSIX has is not needed: every module, and the main jobs, without it."""

import os
import subprocess
import sys
from pathlib import Path

import pyarrow.parquet as pq
import pytest

pytestmark = pytest.mark.slow

CONFIGS = Path(__file__).parents[2] / "configs"
ALL_MODULES = """
import importlib, pkgutil, signal, dpgcli
assert not hasattr(signal, "SIGHUP")
names = [module.name for module in pkgutil.walk_packages(dpgcli.__path__, "dpgcli.")]
assert len(names) > 100
for name in names:
    importlib.import_module(name)
try:
    import fcntl
except ImportError:
    print(len(names))
"""
SWEEP = """base: three_unit.yaml
space:
  - paired: {finger.units: [10]}
  - {key: finger.geometry.dome_height_mm, linear: {from: 6, to: 7, count: 40}}
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "three_unit.yaml").write_bytes((CONFIGS / "three_unit.yaml").read_bytes())
    (tmp_path / "sweep.yaml").write_text(SWEEP)
    return tmp_path


def python(folder: Path, *arguments: str, hidden: bool = True) -> str:
    """Standard output of a Python that must end well, with what only POSIX has hidden or not."""
    paths = [os.fspath(Path(__file__).parent)] if hidden else []
    paths += filter(None, [os.environ.get("PYTHONPATH")])
    done = subprocess.run(
        [sys.executable, *arguments],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def dpg(folder: Path, *arguments: str, hidden: bool = True) -> str:
    return python(folder, "-m", "dpgcli", *arguments, hidden=hidden)


def test_every_module_can_be_imported(folder: Path) -> None:
    assert int(python(folder, "-c", ALL_MODULES)) > 100


def test_predicting(folder: Path) -> None:
    """Twice, since the second time something is replaced."""
    for _ in range(2):
        text = dpg(folder, "predict", "three_unit.yaml", "-o", "states.parquet")
    assert text == dpg(folder, "predict", "three_unit.yaml", hidden=False)
    assert pq.read_table(folder / "states.parquet").num_rows == 8
    assert not list(folder.glob(".*.tmp"))


def test_a_sweep_by_spawned_workers_and_what_is_made_of_it(folder: Path) -> None:
    sweep = ("sweep", "sweep.yaml", "-q", "-j", "2", "-o")
    dpg(folder, *sweep, "out")
    dpg(folder, *sweep, "usual", "--executor", "serial", hidden=False)
    for name in ("states.parquet", "designs.parquet"):
        assert (folder / "out" / name).read_bytes() == (folder / "usual" / name).read_bytes()
    assert not (folder / "out" / ".parts").exists()
    dpg(folder, "sweep", "sweep.yaml", "-o", "out", "-j", "2")
    dpg(folder, "report", "out", "-o", "page.html")
    assert "<h1>Design space</h1>" in (folder / "page.html").read_text(encoding="utf-8")
    assert dpg(folder, "check", "out/designs.parquet", "--require", "n_stable > 0").startswith(
        "met"
    )


def test_the_small_commands(folder: Path) -> None:
    dpg(folder, "validate", "three_unit.yaml")
    dpg(folder, "init", "new.yaml")
    assert "calibrated" in dpg(folder, "explain", "new.yaml")
    assert dpg(folder, "fe", "hinge", "three_unit.yaml", "--output", "deck") == "deck/hinge.inp\n"
