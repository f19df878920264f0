"""Parts of a sweep: whole or not there, whatever happens to who writes them."""

from pathlib import Path

import pytest

from dpgcli.files.parts import PartStore


def test_what_a_killed_worker_left_of_a_part_goes_when_the_part_is_made(tmp_path: Path) -> None:
    (tmp_path / ".0000000000-0000000004.dpg0.tmp").write_bytes(b"half")
    with PartStore(tmp_path).part(0, 4) as file:
        file.write(b"whole")
    (part,) = tmp_path.iterdir()
    assert (part.suffix, part.read_bytes()) == (".part", b"whole")
    assert PartStore(tmp_path).damaged() == []


def test_a_part_that_is_interrupted_is_none(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt), PartStore(tmp_path).part(0, 4) as file:
        file.write(b"half")
        raise KeyboardInterrupt
    assert list(tmp_path.iterdir()) == []


def test_a_part_that_is_there_is_made_again(tmp_path: Path) -> None:
    """As after a worker that was killed between its last byte and its answer."""
    for _ in range(2):
        with PartStore(tmp_path).part(0, 4) as file:
            file.write(b"whole")
    (part,) = tmp_path.iterdir()
    assert part.read_bytes() == b"whole"
