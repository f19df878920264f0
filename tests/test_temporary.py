"""Temporary files and folders: apart from each other, and gone with the next run at the latest."""

import os
from pathlib import Path
from typing import Any

import filelock
import pytest

from dpgcli.temporary import drop_orphans, temporary_file, temporary_folder


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_two_at_once_do_not_take_each_other_for_orphans(tmp_path: Path) -> None:
    path = tmp_path / "t.parquet"
    with temporary_file(path) as (first, _), temporary_folder(path) as second:
        drop_orphans(path)
        assert names(tmp_path) == [".t.parquet.dpg0.tmp", ".t.parquet.dpg1.tmp"]
        assert (first.is_file(), second.is_dir()) == (True, True)
    assert names(tmp_path) == []


def test_orphans_go_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "t.parquet"
    for name in (".t.parquet.dpg0.tmp", ".t.parquet.mine.tmp", ".u.parquet.dpg0.tmp", "kept"):
        (tmp_path / name).write_text("half")
    (tmp_path / ".t.parquet.dpg1.tmp").mkdir()
    (tmp_path / ".t.parquet.dpg1.tmp" / "inside").write_text("half")
    (tmp_path / ".t.parquet.dpg2.tmp").symlink_to(tmp_path / "kept")
    left = [f".t.parquet.dpg{number}.tmp" for number in (1, 2)]
    left += [".t.parquet.mine.tmp", ".u.parquet.dpg0.tmp", "kept"]
    with temporary_file(path) as (name, handle):
        assert name.name == ".t.parquet.dpg0.tmp"
        assert handle is not None
        assert os.fstat(handle).st_size == 0
    assert names(tmp_path) == left
    assert names(tmp_path / ".t.parquet.dpg1.tmp") == ["inside"], "nobody makes folders for it"
    (tmp_path / ".t.parquet.dpg0.tmp").write_text("somebody's")
    with temporary_folder(path) as folder:
        assert folder.name == ".t.parquet.dpg1.tmp"
        assert names(folder) == []
    left.remove(".t.parquet.dpg1.tmp")
    assert names(tmp_path) == [".t.parquet.dpg0.tmp", *left]


@pytest.mark.parametrize("kind", [temporary_file, temporary_folder])
def test_one_that_is_taken_before_it_is_locked_is_made_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: Any
) -> None:
    lock, taken = filelock.lock_descriptor, []

    def late(handle: int, *, blocking: bool) -> bool:
        if blocking and not taken:
            taken.append(tmp_path / ".t.dpg0.tmp")
            taken[0].rename(tmp_path / "away")
        return lock(handle, blocking=blocking)

    monkeypatch.setattr("filelock.lock_descriptor", late)
    with kind(tmp_path / "t"):
        assert names(tmp_path) == [".t.dpg1.tmp", "away"]
    assert taken
    assert names(tmp_path) == ["away"]


def test_a_file_system_without_locks_keeps_orphans_and_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def none(*_: object, **__: object) -> None:
        raise OSError(None, "no locks here")

    monkeypatch.setattr("filelock.lock_descriptor", none)
    (tmp_path / ".t.dpg0.tmp").write_text("somebody's")
    with temporary_file(tmp_path / "t") as (name, _):
        assert name.name == ".t.dpg1.tmp"
    assert (tmp_path / ".t.dpg0.tmp").read_text() == "somebody's"
