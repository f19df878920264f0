"""Cores that one may not use do not count: affinity, and quotas of control groups."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from dpgcli.api.place import Place
from dpgcli.cores import Cores, cores

GROUPS_1 = "12:cpuset:/\n4:cpu,cpuacct:{0}\n1:name=systemd:/init\n"
GROUPS_2 = "0::{0}\n"


def system(root: Path, groups: str, **files: str) -> Path:
    """A folder that looks like the root of a system with these files below `/sys/fs/cgroup`."""
    own = root / "proc" / "self" / "cgroup"
    own.parent.mkdir(parents=True)
    own.write_text(groups)
    for name, text in files.items():
        path = root / "sys/fs/cgroup" / name.replace("__", "/")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return root


@pytest.mark.parametrize(
    ("own", "files", "quota"),
    [
        ("/", {"cpu.max": "150000 100000\n"}, 1.5),
        ("/", {"cpu.max": "max 100000\n"}, None),
        ("/a/b", {"a/b/cpu.max": "50000 100000\n"}, 0.5),
        ("/a/b", {"a/b/cpu.max": "max 100000\n", "a/cpu.max": "200000 100000\n"}, 2.0),
        ("/a/b", {"a/b/cpu.max": "300000 100000\n", "a/cpu.max": "200000 100000\n"}, 2.0),
        ("/docker/of-the-host", {"cpu.max": "100000 50000\n"}, 2.0),
        ("/", {"cpu.max": "nonsense"}, None),
        ("/", {}, None),
    ],
)
def test_a_quota_of_version_2(
    tmp_path: Path, own: str, files: dict[str, str], quota: float | None
) -> None:
    assert cores(system(tmp_path, GROUPS_2.format(own), **files)).quota == quota


@pytest.mark.parametrize(
    ("own", "files", "quota"),
    [
        ("/", {"cfs_quota_us": "150000\n", "cfs_period_us": "100000\n"}, 1.5),
        ("/", {"cfs_quota_us": "-1\n", "cfs_period_us": "100000\n"}, None),
        ("/slurm/job", {"cfs_quota_us": "400000\n", "cfs_period_us": "100000\n"}, 4.0),
        ("/slurm/job", {"cfs_quota_us": "400000\n"}, None),
    ],
)
def test_a_quota_of_version_1(
    tmp_path: Path, own: str, files: dict[str, str], quota: float | None
) -> None:
    placed = {f"cpu,cpuacct{own.rstrip('/')}/cpu.{name}": text for name, text in files.items()}
    assert cores(system(tmp_path, GROUPS_1.format(own), **placed)).quota == quota


def test_another_group_s_quota_is_not_this_one_s(tmp_path: Path) -> None:
    files = {"other/cpu.max": "50000 100000\n", "cpuset/cpu.cfs_quota_us": "5\n"}
    assert cores(system(tmp_path, GROUPS_2.format("/mine"), **files)).quota is None


def test_without_such_files_there_is_no_quota(tmp_path: Path) -> None:
    assert cores(tmp_path).quota is None


def test_the_least_of_all_is_what_one_may_use() -> None:
    assert Cores(64, 64, None).usable == 64
    assert Cores(64, 2, 8.0).usable == 2
    assert Cores(64, 8, 1.2).usable == 2
    assert Cores(64, 8, 0.1).usable == 1


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="no affinity to set")
def test_affinity_counts() -> None:
    first = min(os.sched_getaffinity(0))
    words = "from dpgcli.__main__ import main; import os; os.sched_setaffinity(0, {%d}); main()"
    done = subprocess.run(
        [sys.executable, "-c", words % first, "-V", "-v"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert re.search(r"cores: \d+ in all, 1 by affinity, .*starts 1 worker$", done.stdout, re.M)


@pytest.mark.parametrize(("usable", "name"), [(1, "this process"), (3, "the pool of processes")])
def test_a_sweep_takes_the_cores_that_it_may_use(
    monkeypatch: pytest.MonkeyPatch, usable: int, name: str
) -> None:
    monkeypatch.setattr("dpgcli.api.place.cores", lambda: Cores(64, 64, float(usable)))
    with Place().workplace(lambda _: None) as found:
        assert (found.name, found.n_workers) == (name, usable)
    with Place(jobs=2).workplace(lambda _: None) as found:
        assert found.n_workers == 2, "what is asked for is given"
