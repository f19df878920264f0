"""Paths that the system refuses: folders that one may not enter, long names, links in a circle."""

import ctypes
import os
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import dpgcli as dpg
from dpgcli.cli.exits import ExitCode

CONFIGS = Path(__file__).parents[2] / "configs"
Call = Callable[..., Any]
SWEEP = "base: three_unit.yaml\nspace:\n  - {key: finger.units, values: [1, 2]}\n"
RUN = ("sweep", "sweep.yaml", "--executor", "serial", "-q")
REQUIRE = ("--require", "n_stable > 0")
CAPABILITIES = 0x20080522  # linux/capability.h: version 3, two sets of 32
OVERRIDE = 0b110  # CAP_DAC_OVERRIDE and CAP_DAC_READ_SEARCH: root reads and writes everything
WRITES: list[tuple[str, ...]] = [
    ("predict", "three_unit.yaml", "-o", "{}"),
    ("predict", "three_unit.yaml", "--plot", "{}"),
    (*RUN, "-o", "{}"),
    ("sweep", "sweep.yaml", "-q", "-j", "2", "-o", "{}"),
    (*RUN, "-o", "new", "--depfile", "{}"),
    (*RUN, "-o", "new", "--summary-file", "{}"),
    ("check", "out/designs.parquet", *REQUIRE, "--summary-file", "{}"),
    ("report", "out", "-o", "{}"),
    ("merge", "part", "-o", "{}"),
    ("compare", "study.yaml", "tips.csv", "--plot", "{}"),
    ("fit", "finger", "study.yaml", "tips.csv", "-o", "{}"),
    ("fe", "dome", "three_unit.yaml", "-o", "{}"),
    ("bench", "three_unit.yaml", "--repeats", "1", "--json", "{}"),
    ("stress", "--only", "mirror", "-o", "{}"),
    ("init", "{}"),
    ("init", "--sweep", "{}"),
]
READS: list[tuple[str, ...]] = [
    ("predict", "{}"),
    ("validate", "{}"),
    ("explain", "{}"),
    ("sweep", "{}", "-o", "new"),
    ("check", "{}", *REQUIRE),
    ("report", "{}"),
    ("merge", "{}", "-o", "new"),
    ("compare", "study.yaml", "{}"),
    ("compare", "{}", "tips.csv"),
    ("compare", "study.yaml", "tips.csv", "--calibration", "{}"),
    ("fit", "bistable", "{}"),
    ("fit", "hinge", "{}"),
    ("fit", "unit", "{}"),
    ("fit", "finger", "{}", "tips.csv"),
    ("fit", "finger", "study.yaml", "{}"),
    ("fit", "grid", "{}"),
    ("fe", "dome", "{}", "-o", "new"),
    ("bench", "three_unit.yaml", "--compare", "{}"),
    ("stress", "{}"),
    ("predict", "three_unit.yaml", "--set", "finger.calibration={}"),
]


def privileged(*, by: int) -> None:
    """Give this thread the privileges of `by` among those that it may have."""
    libc = ctypes.CDLL(None, use_errno=True)
    head = (ctypes.c_uint32 * 2)(CAPABILITIES, 0)
    sets = (ctypes.c_uint32 * 6)()  # effective, permitted, inheritable; and again, higher ones
    assert libc.capget(head, sets) == 0
    sets[0] = sets[1] & by
    assert libc.capset(head, sets) == 0


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished sweep, and all parts of one that is not joined yet."""
    folder = tmp_path_factory.mktemp("finished")
    (folder / "three_unit.yaml").write_bytes((CONFIGS / "three_unit.yaml").read_bytes())
    (folder / "sweep.yaml").write_text(SWEEP)
    dpg.sweep(folder / "sweep.yaml", folder / "out", executor="serial")
    dpg.sweep(folder / "sweep.yaml", folder / "part", executor="serial", shard="1/1")
    return folder


@pytest.fixture
def here(call: Call, folder: Path, study: tuple[str, str], finished: Path) -> Path:
    """The working folder, with files of all kinds."""
    assert call
    assert study
    shutil.copytree(finished, folder, dirs_exist_ok=True)
    return folder


@pytest.fixture
def unprivileged() -> Iterator[None]:
    """Permissions count, whoever runs the tests."""
    is_root = hasattr(os, "geteuid") and os.geteuid() == 0
    if is_root and not hasattr(ctypes.CDLL(None), "capset"):
        pytest.skip("root may enter every folder")
    if is_root:
        privileged(by=~OVERRIDE & 0xFFFFFFFF)
    yield
    if is_root:
        privileged(by=0xFFFFFFFF)


@pytest.fixture
def closed(here: Path, unprivileged: None) -> Iterator[Path]:
    """A folder that one may not enter."""
    place = here / "closed"
    place.mkdir(mode=0)
    yield place
    place.chmod(0o700)


@pytest.fixture(params=["x" * 300, "loop", "loop/x"], ids=["long", "loop", "within"])
def odd(request: pytest.FixtureRequest, here: Path) -> str:
    """A name that is too long, or of links in a circle."""
    (here / "loop").symlink_to("pool")
    (here / "pool").symlink_to("loop")
    name: str = request.param
    return name


def refused(call: Call, folder: Path, command: tuple[str, ...], name: str) -> str:
    """What a command says that is refused for a path, having written nothing."""
    before = sorted(folder.iterdir())
    done = call(*(word.format(name) for word in command))
    said: str = done.stdout + done.stderr
    assert done.exit_code == ExitCode.USAGE, (done.exception, said)
    shutil.rmtree(folder / "new", ignore_errors=True)
    assert sorted(folder.iterdir()) == before
    assert "the system refuses" not in said, "it is asked where one knows what for"
    return said.lower()


@pytest.mark.parametrize("command", WRITES, ids=" ".join)
def test_nothing_is_written_where_one_may_not_enter(
    call: Call, here: Path, closed: Path, command: tuple[str, ...]
) -> None:
    suffix = ".svg" if "--plot" in command else ".yaml" if "fit" in command else ".md"
    said = refused(call, here, command, f"closed/x{suffix}")
    assert "cannot write closed/" in said
    assert "permission denied" in said


@pytest.mark.parametrize("command", READS, ids=" ".join)
def test_nothing_is_read_where_one_may_not_enter(
    call: Call, here: Path, closed: Path, command: tuple[str, ...]
) -> None:
    said = refused(call, here, command, "closed/x")
    assert "permission denied" in said or "no such file" in said
    assert "closed/x" in said


@pytest.mark.parametrize("command", WRITES, ids=" ".join)
def test_nothing_is_written_under_a_name_that_is_none(
    call: Call, here: Path, odd: str, command: tuple[str, ...]
) -> None:
    name = f"{odd}.svg" if "--plot" in command and odd != "loop" else odd
    said = refused(call, here, command, name)
    assert "cannot write" in said or "expected" in said or "exists" in said
    assert (here / "loop").is_symlink()


@pytest.mark.parametrize("command", READS, ids=" ".join)
def test_nothing_is_read_under_a_name_that_is_none(
    call: Call, here: Path, odd: str, command: tuple[str, ...]
) -> None:
    assert odd[:40] in refused(call, here, command, odd)


@pytest.mark.parametrize("name", [".parts", ".parts/{}", ".parts/{}/sweep.json", ".parts/{}/{}"])
def test_parts_that_one_may_not_read_are_not_taken_for_none(
    call: Call, here: Path, unprivileged: None, name: str
) -> None:
    (store,) = (here / "part" / ".parts").iterdir()
    (part,) = store.glob("*.part")
    place = here / "part" / name.format(store.name, part.name)
    mode = place.stat().st_mode
    place.chmod(0)
    for command in (("merge", "part", "-o", "new"), (*RUN, "-o", "part")):
        said = refused(call, here, command, "")
        assert f"part/{name.format(store.name, part.name)}" in said
        assert "permission denied" in said
    place.chmod(mode)
    assert call("merge", "part", "-o", "new").exit_code == ExitCode.DONE


@pytest.mark.parametrize("name", ["closed/x", "x" * 300, "loop"])
def test_python_names_the_path(here: Path, closed: Path, name: str) -> None:
    (here / "loop").symlink_to("loop")
    calls: list[Callable[[], Any]] = [
        lambda: dpg.predict(name),
        lambda: dpg.explain(name),
        lambda: dpg.check(name, "n_stable > 0"),
        lambda: dpg.report(name),
        lambda: dpg.merge(name, "new"),
        lambda: dpg.sweep("sweep.yaml", name, executor="serial"),
        lambda: dpg.sweep(name, "new", executor="serial"),
        lambda: dpg.compare("study.yaml", "tips.csv", calibration=name),
        lambda: dpg.compare("study.yaml", name),
        lambda: dpg.fit_hinge(name),
    ]
    for ask in calls:
        with pytest.raises(dpg.DpgError, match=name[:8]):
            ask()
    assert (here / "loop").is_symlink()


def test_a_folder_of_a_thousand_levels_is_refused(call: Call, here: Path) -> None:
    refused(call, here, (*RUN, "-o", "{}"), "/".join("a" * 1500))
