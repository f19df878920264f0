"""Files appear whole or not at all."""

import os
import stat
from pathlib import Path

import pytest

from dpgcli.errors import OutputError
from dpgcli.files.output import check_writable, whole_file


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_a_file_is_there_when_it_is_whole(tmp_path: Path) -> None:
    path = tmp_path / "table.txt"
    with whole_file(path) as temporary:
        temporary.write_text("new", encoding="utf-8")
        assert not path.exists()
        assert temporary.parent == tmp_path
    assert path.read_text(encoding="utf-8") == "new"
    assert names(tmp_path) == ["table.txt"]


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt, SystemExit, GeneratorExit])
def test_whatever_interrupts_leaves_the_old_file(
    tmp_path: Path, error: type[BaseException]
) -> None:
    path = tmp_path / "table.txt"
    path.write_text("old", encoding="utf-8")
    with pytest.raises(error), whole_file(path) as temporary:
        temporary.write_text("half", encoding="utf-8")
        raise error
    assert path.read_text(encoding="utf-8") == "old"
    assert names(tmp_path) == ["table.txt"]


def test_a_name_without_folder_is_in_this_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    check_writable(Path("table.txt"))
    assert names(tmp_path) == []
    with whole_file(Path("table.txt")) as temporary:
        temporary.write_text("new", encoding="utf-8")
    assert names(tmp_path) == ["table.txt"]


@pytest.mark.parametrize("target", ["missing/table.txt", "file/table.txt", "folder"])
def test_a_place_that_cannot_be_written(tmp_path: Path, target: str) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").write_text("", encoding="utf-8")
    before = names(tmp_path)
    with pytest.raises(OutputError, match="cannot write"):
        check_writable(tmp_path / target)
    with pytest.raises(OutputError, match="cannot write"), whole_file(tmp_path / target):
        pass
    assert names(tmp_path) == before


def test_the_longest_name_will_do(tmp_path: Path) -> None:
    path = tmp_path / ("a" * 255)
    check_writable(path)
    with whole_file(path) as temporary:
        temporary.write_text("new", encoding="utf-8")
    assert names(tmp_path) == [path.name]


@pytest.mark.parametrize("mask", [0o077, 0o022, 0o002])
def test_the_mask_decides_on_permissions(tmp_path: Path, mask: int) -> None:
    path = tmp_path / "table.txt"
    before = os.umask(mask)
    try:
        with whole_file(path):
            pass
        assert os.umask(mask) == mask
    finally:
        os.umask(before)
    assert stat.S_IMODE(path.stat().st_mode) == 0o666 & ~mask


def test_what_is_no_plain_file_is_never_replaced(tmp_path: Path) -> None:
    """As a rename over /dev/null would, for the whole machine."""
    path = tmp_path / "pipe"
    os.mkfifo(path)
    with pytest.raises(OutputError, match="pipe"):
        check_writable(path)
    with pytest.raises(OutputError, match="pipe"), whole_file(path):
        pass
    assert stat.S_ISFIFO(path.stat().st_mode)
    assert names(tmp_path) == ["pipe"]


def test_an_interrupt_while_the_file_is_made_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("os.fchmod", interrupted)
    with pytest.raises(KeyboardInterrupt), whole_file(tmp_path / "table.txt"):
        pass
    assert names(tmp_path) == []
