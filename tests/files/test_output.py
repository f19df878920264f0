"""Files appear whole or not at all."""

import errno
import os
import stat
from pathlib import Path

import pytest

from dpgcli.errors import OutputError, UsageError
from dpgcli.files.output import (
    ENDS,
    Mark,
    check_apart,
    check_appendable,
    check_outputs,
    check_writable,
    is_own,
    whole_file,
)


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


@pytest.mark.parametrize("mode", [0o600, 0o640, 0o664, 0o755])
def test_a_file_that_is_replaced_keeps_its_mode(tmp_path: Path, mode: int) -> None:
    path = tmp_path / "table.txt"
    path.write_bytes(b"old")
    path.chmod(mode)
    with whole_file(path, Mark.ANY) as temporary:
        assert stat.S_IMODE(temporary.stat().st_mode) == mode, "from the beginning"
        temporary.write_text("new", encoding="utf-8")
    assert path.read_text(encoding="utf-8") == "new"
    assert stat.S_IMODE(path.stat().st_mode) == mode


def test_another_group_sees_nothing_that_was_for_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where a file's group cannot be given to the next one, its rights are not either."""
    path = tmp_path / "table.txt"
    path.write_bytes(b"old")
    path.chmod(0o664)
    try:
        os.chown(path, -1, path.stat().st_gid + 1)
    except PermissionError:
        pytest.skip("only root gives files away")

    def refused(*_: object) -> None:
        raise PermissionError

    monkeypatch.setattr("os.fchown", refused)
    with whole_file(path, Mark.ANY):
        pass
    assert stat.S_IMODE(path.stat().st_mode) == 0o604


def test_owner_and_group_stay(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "table.txt"
    path.write_bytes(b"old")
    given: list[tuple[int, int]] = []
    monkeypatch.setattr("os.fchown", lambda _, owner, group: given.append((owner, group)))
    with whole_file(path, Mark.ANY):
        pass
    assert given == [(path.stat().st_uid, -1), (-1, path.stat().st_gid)]


def test_a_write_protected_file_stays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "table.txt"
    path.write_bytes(b"old")
    monkeypatch.setattr("os.access", lambda name, mode: mode != os.W_OK or Path(name) != path)
    with pytest.raises(OutputError, match="it is write-protected"):
        check_writable(path, Mark.ANY)
    with pytest.raises(OutputError, match="it is write-protected"), whole_file(path, Mark.ANY):
        pass
    assert path.read_bytes() == b"old"
    assert names(tmp_path) == ["table.txt"]


LONG = b"0" * 10**6
KNOWN = {
    Mark.TABLE: [
        b"PAR1" + LONG + b"..dpg.file_sha256\x18@..PAR1",
        b"PAR1..dpg.content_sha256\x18@..PAR1",
    ],
    Mark.FACTS: [b'{\n  "written_by": "dpg 0.1.0",' + LONG],
    Mark.REPORT: [b"# Design space\n" + LONG + b"\n<!-- written by dpg -->\n"],
    Mark.FIGURE: [
        b"<?xml version='1.0'?>\n<svg>\n<dc:title>drawn by dpg</dc:title>" + LONG,
        b"\x89PNG\r\n\x1a\n....IHDR....tEXtSoftware\x00drawn by dpg" + LONG,
    ],
    Mark.GRAPH: [
        b"<?xml version='1.0' encoding='utf-8'?>\n<!-- written by dpg -->\n<graphml " + LONG,
    ],
    Mark.CALIBRATION: [b"calibration_version: 1\nmade_by: dpg 0.1.0, numpy 2" + LONG],
    Mark.DEPFILE: [b"# dpg sweep: what\na/states.parquet a/designs.parquet: b.yaml\n"],
    Mark.SPEC: [b"# Written by dpg: design 3 of the sweep around a.yaml\nfinger:\n" + LONG],
    Mark.FOUND: [b"# Written by dpg: design 3 of best.parquet\nfinger:\n" + LONG],
    Mark.DECK: [b"** dpg fe hinge" + LONG],
    Mark.CURVE: [b"# dpg fe hinge: a simulation"],
    Mark.CONTROLLER: [b"# dpg routine: pressures of lines by time\ntime_s,A_MPa\n"],
    Mark.LOG: [b"# dpg fe, hinge.inp: words of ccx\n"],
    Mark.DISPLACEMENTS: [b"# dpg fe, hinge.inp: printed by ccx\n\n displacements" + LONG],
    Mark.PARTS: [b'{\n  "dpg.sweep": "' + LONG],
    Mark.ANY: [b"anything"],
    Mark.NONE: [],
}
STRANGE = [
    b"mine",
    LONG,
    LONG + b"dpg.file_sha256" + LONG,
    b"note: made_by: dpg fit, later by hand\n",
    b"all: a/states.parquet a/designs.parquet\na/states.parquet a/designs.parquet: b.yaml\n",
    b"\n** dpg fe hinge",
    b"see # dpg fe, and # dpg fe hinge",
    b"the displacements (vx,vy,vz) for set ALL",
    b"\n displacements (vx,vy,vz) for set ALL and time  0.1E+01\n" + LONG,
    b"out/states.parquet out/designs.parquet: sweep.yaml\n\tdpg sweep sweep.yaml -o out\n",
    b'{"runs": [{"written_by": "dpg 0.1.0"}], "mine": 1}',
    b'[{"written_by": "dpg 0.1.0"}]',
    b"# Notes\n\n<!-- written by dpg -->\n\nand what I think of it\n",
    b"see <!-- written by dpg -->\n",
    b"<!-- written by dpg -->\n" + LONG,
    b"PAR1..dpg.file_sha256 of the other table..PAR1",
    b"the key dpg.file_sha256\x18@",
    b"<?xml version='1.0'?><svg><text>drawn by dpg</text></svg>",
    b"how a figure is drawn by dpg",
    b"note: |\n  calibration_version: 1\nmade_by: dpg fit, then by hand\n",
    b'{"mine": {"dpg.sweep": "a"}}',
]


@pytest.mark.parametrize("mark", Mark)
def test_files_are_known_by_their_marks(tmp_path: Path, mark: Mark) -> None:
    path = tmp_path / "file"
    for kind, contents in KNOWN.items():
        for content in contents:
            path.write_bytes(content)
            is_one = mark in (kind, Mark.ANY) or (mark, kind) == (Mark.SPEC, Mark.FOUND)
            assert is_own(path, mark) == is_one, content[:40]
    for content in STRANGE:
        path.write_bytes(content)
        assert is_own(path, mark) == (mark is Mark.ANY), content[:40]
    path.write_bytes(b"")
    assert is_own(path, mark), "nothing can be lost"


@pytest.mark.parametrize("kind", [mark for mark in Mark if KNOWN[mark] and mark is not Mark.ANY])
def test_nothing_is_appended_to_what_is_known_by_a_mark(tmp_path: Path, kind: Mark) -> None:
    path = tmp_path / "file"
    for content in KNOWN[kind]:
        path.write_bytes(content)
        with pytest.raises(OutputError, match="dpg made it"):
            check_appendable(path, ())
        assert path.read_bytes() == content


@pytest.mark.parametrize("content", [b"\xff", LONG + b"\xc3", b"a\0b", LONG + b"\0"])
def test_nothing_is_appended_to_what_is_no_text(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "file"
    path.write_bytes(content)
    with pytest.raises(OutputError, match="it is no text"):
        check_appendable(path, ())
    path.write_bytes(b"0" * (ENDS - 1) + "é\n".encode())
    check_appendable(path, ())


@pytest.mark.parametrize("name", ["t.parquet", "T.CSV", "s.yaml", "s.yml", "p.png", "p.svg"])
def test_nothing_is_appended_to_a_name_that_promises_a_table(tmp_path: Path, name: str) -> None:
    with pytest.raises(OutputError, match="Markdown is no"):
        check_appendable(tmp_path / name, ())
    assert names(tmp_path) == []


def test_a_file_that_came_while_the_new_one_was_made_stays(tmp_path: Path) -> None:
    path = tmp_path / "table.txt"
    with pytest.raises(OutputError, match="not of dpg"), whole_file(path, Mark.TABLE) as temporary:
        temporary.write_bytes(b"ours")
        path.write_bytes(b"theirs")
    assert path.read_bytes() == b"theirs"
    assert names(tmp_path) == ["table.txt"]


def test_what_is_not_on_the_disk_gets_no_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The content is synced before the name moves to it, and the folder after that."""
    path = tmp_path / "table.txt"
    synced: list[tuple[bool, bytes, bool]] = []

    def fsync(handle: int) -> None:
        is_folder = stat.S_ISDIR(os.fstat(handle).st_mode)
        content = b"" if is_folder else os.pread(handle, 10, 0)
        synced.append((is_folder, content, path.exists()))

    monkeypatch.setattr("os.fsync", fsync)
    with whole_file(path) as temporary:
        temporary.write_bytes(b"new")
    assert synced == [(False, b"new", False), (True, b"", True)]


def test_names_are_told_apart_by_more_than_capitals(tmp_path: Path) -> None:
    one, other = tmp_path / "a.svg", tmp_path / "A.svg"
    for pair in ((one, other), (one, tmp_path / "x" / ".." / "a.svg"), (one, one)):
        with pytest.raises(UsageError, match="expected names that differ"):
            check_apart(pair)
    check_apart((one, tmp_path / "b.svg"))
    one.touch()
    os.link(one, tmp_path / "hard")
    (tmp_path / "soft").symlink_to(one)
    for name in ("hard", "soft"):
        with pytest.raises(UsageError, match="expected names that differ"):
            check_apart((one, tmp_path / name))


def test_outputs_have_names_of_their_own(tmp_path: Path) -> None:
    table, plot = tmp_path / "a.svg", tmp_path / "A.svg"
    with pytest.raises(UsageError, match="expected names that differ"):
        check_outputs((), (table, Mark.TABLE), (None, Mark.FACTS), (plot, Mark.FIGURE))
    check_outputs((), (table, Mark.TABLE), (None, Mark.FACTS), (None, Mark.FIGURE))
    assert names(tmp_path) == []


@pytest.mark.parametrize("code", [errno.EPERM, errno.EINVAL, errno.ENOSYS, errno.ENOTSUP])
@pytest.mark.parametrize("name", ["fchmod", "fchown", "fsync"])
@pytest.mark.parametrize("old", [b"", None], ids=["replaced", "new"])
def test_what_a_file_system_cannot_do_is_done_without(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, code: int, old: bytes | None
) -> None:
    """Windows drives in WSL have no permissions; some network drives no answer to fsync."""
    called = []

    def refused(*_: object) -> None:
        called.append(name)
        raise OSError(code, os.strerror(code))

    path = tmp_path / "table.txt"
    if old is not None:
        path.write_bytes(old)
    monkeypatch.setattr(os, name, refused)
    check_writable(path)
    with whole_file(path) as temporary:
        temporary.write_text("new", encoding="utf-8")
    assert path.read_text(encoding="utf-8") == "new"
    assert called or (name == "fchown" and old is None)


@pytest.mark.parametrize("code", [errno.EIO, errno.ENOSPC, errno.EDQUOT])
def test_what_may_be_lost_is_no_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, code: int
) -> None:
    def lost(_: int) -> None:
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(os, "fsync", lost)
    with pytest.raises(OutputError), whole_file(tmp_path / "table.txt") as temporary:
        temporary.write_text("new", encoding="utf-8")
    assert names(tmp_path) == []


def test_a_folder_that_cannot_be_listed_takes_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened = os.open

    def refused(path: Path, flags: int, *mode: int) -> int:
        if Path(path) == tmp_path:
            raise PermissionError(errno.EACCES, "no")
        return opened(path, flags, *mode)

    monkeypatch.setattr(os, "open", refused)
    with whole_file(tmp_path / "table.txt") as temporary:
        temporary.write_text("new", encoding="utf-8")
    assert names(tmp_path) == ["table.txt"]


@pytest.mark.skipif(not Path("/dev/fd").is_dir(), reason="no such names here")
def test_a_pipe_that_is_open_is_a_pipe() -> None:
    """As /dev/stdout where a reader follows: it leads to no name."""
    ends = os.pipe()
    try:
        with pytest.raises(OutputError, match=r"is a device or pipe, not a file"):
            check_writable(Path(f"/dev/fd/{ends[1]}"))
    finally:
        for end in ends:
            os.close(end)
