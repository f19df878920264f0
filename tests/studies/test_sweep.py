"""Parts, shards, resuming and joining: the same bytes on every way to them."""

import random
import shutil
from collections import namedtuple
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from dpgcli.errors import UsageError
from dpgcli.files.sweep_file import read_sweep
from dpgcli.studies import sweep as studies
from dpgcli.studies.run import run
from dpgcli.studies.sweep import Progress, Shard, Study, assemble, stores
from dpgcli.sweeps.executors import Backend, serial
from dpgcli.sweeps.extent import BYTES_PER_STATE
from dpgcli.sweeps.pool import processes

pytestmark = pytest.mark.slow

CONFIGS = Path(__file__).parents[2] / "configs"
AXES = (
    "{key: finger.geometry.dome_height_mm, linear: {from: 2.5, to: 7, count: 19}}",
    "{key: finger.units, values: [2, 4]}",
    "{key: finger.geometry.unit_separation_mm, values: [2, 3]}",
)


class StoppedError(Exception):
    """Stands for whatever interrupts a sweep."""


def bytes_of(folder: Path) -> dict[str, bytes]:
    return {n: (folder / n).read_bytes() for n in (studies.STATES, studies.DESIGNS)}


def quiet(_: Progress) -> None:
    """Watch nothing."""


def stopping_after(n_parts: int) -> Callable[[Progress], None]:
    left = [n_parts]

    def watch(_: Progress) -> None:
        left[0] -= 1
        if left[0] <= 0:
            raise StoppedError

    return watch


@pytest.fixture
def expected(study: Any) -> dict[str, bytes]:
    """The tables of an undisturbed serial run."""
    made = study(*AXES, folder="undisturbed")
    made.compute(serial(), quiet)
    made.assemble()
    return bytes_of(made.folder)


def finish(made: Study, workplace: Backend | None = None) -> dict[str, bytes]:
    made.compute(workplace or serial(), quiet)
    made.assemble()
    assert sorted(p.name for p in made.folder.iterdir()) == [studies.DESIGNS, studies.STATES]
    return bytes_of(made.folder)


@pytest.mark.parametrize("n_workers", [1, 3])
def test_processes_give_the_bytes_of_a_serial_run(
    study: Any, expected: dict[str, bytes], n_workers: int
) -> None:
    assert finish(study(*AXES), processes(n_workers)) == expected


@pytest.mark.parametrize(
    "seed", [0, 1, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (2, 3, 4))]
)
def test_a_sweep_that_is_stopped_again_and_again(
    study: Any, expected: dict[str, bytes], seed: int
) -> None:
    random_numbers = random.Random(seed)
    for _ in range(5):
        with pytest.raises(StoppedError):
            study(*AXES).compute(serial(), stopping_after(random_numbers.randint(1, 3)))
    assert finish(study(*AXES)) == expected


def test_what_is_there_is_not_computed_again(study: Any) -> None:
    with pytest.raises(StoppedError):
        study(*AXES).compute(serial(), stopping_after(7))
    seen: list[Progress] = []
    progress = study(*AXES).compute(serial(), seen.append)
    size = study(*AXES).chunk_size
    assert progress.n_resumed >= 7 * size
    assert len(seen) == -(-76 // size) - progress.n_resumed // size
    assert (progress.n_done, progress.n_designs) == (76, 76)


DAMAGES: dict[str, Callable[[bytes], bytes]] = {
    "cut": lambda content: content[: len(content) // 2],
    "empty": lambda _: b"",
    "one bit": lambda content: bytes([content[0] ^ 1]) + content[1:],
    "last bit": lambda content: content[:-1] + bytes([content[-1] ^ 128]),
    "longer": lambda content: content + b"\0",
    "zeros": lambda content: bytes(len(content)),
}


@pytest.mark.parametrize(
    "damage",
    [
        *("cut", "last bit", "longer"),
        *(pytest.param(d, marks=pytest.mark.slow) for d in ("empty", "one bit", "zeros")),
    ],
)
def test_damaged_parts_are_computed_again(
    study: Any, expected: dict[str, bytes], damage: str
) -> None:
    with pytest.raises(StoppedError):
        study(*AXES).compute(serial(), stopping_after(6))
    for part in random.Random(3).sample(study(*AXES).store.parts(), 3):
        part.path.write_bytes(DAMAGES[damage](part.path.read_bytes()))
    assert finish(study(*AXES)) == expected


def test_foreign_files_among_the_parts_do_not_matter(
    study: Any, expected: dict[str, bytes]
) -> None:
    with pytest.raises(StoppedError):
        study(*AXES).compute(serial(), stopping_after(6))
    folder = study(*AXES).store.folder
    foreign = {"0000000000-0000000004.part", "notes.txt", "x.part"}
    for name in (".x.part.abc.tmp", *foreign):
        (folder / name).write_bytes(b"half-writ")
    made = study(*AXES)
    made.compute(serial(), quiet)
    made.assemble()
    assert bytes_of(made.folder) == expected
    assert {path.name for path in folder.iterdir()} == foreign, "and they stay"


@pytest.mark.parametrize("name", [studies.STATES, studies.DESIGNS])
def test_a_damaged_table_is_not_up_to_date(
    study: Any, expected: dict[str, bytes], name: str
) -> None:
    made = study(*AXES)
    assert finish(made) == expected
    assert made.is_up_to_date
    content = bytearray(expected[name])
    content[len(content) // 2] ^= 4
    (made.folder / name).write_bytes(content)
    assert not made.is_up_to_date
    assert made.damaged == [made.folder / name]
    assert finish(made) == expected
    assert made.is_up_to_date
    assert made.damaged == []


def test_a_damaged_description_is_not_believed(study: Any) -> None:
    """Not one bit of it: a sweep of other content would follow."""
    made = study(*AXES)
    made.compute(serial(), quiet)
    path = made.store.folder / "sweep.json"
    content = path.read_bytes()
    assert made.store.said() == made.metadata
    for bit in random.Random(2).sample(range(8 * len(content)), 300):
        damaged = bytearray(content)
        damaged[bit // 8] ^= 1 << bit % 8
        path.write_bytes(damaged)
        assert made.store.said() in ({}, made.metadata)
    path.write_bytes(content.replace(b'"76"', b'"75"'))
    with pytest.raises(UsageError, match=r"sweep\.json is damaged: run its sweep again"):
        assemble([made.store], made.folder)
    with pytest.raises(UsageError, match=r"unfinished work whose sweep\.json is damaged"):
        study(AXES[0]).check_unfinished()
    path.write_bytes(b"[" * 100_000)
    assert made.store.said() == {}


@pytest.mark.parametrize(
    "content", [b"[]", b"\xff", *(pytest.param(c, marks=pytest.mark.slow) for c in (b"", b"{"))]
)
def test_a_damaged_description_is_written_again(
    study: Any, expected: dict[str, bytes], content: bytes
) -> None:
    with pytest.raises(StoppedError):
        study(*AXES).compute(serial(), stopping_after(6))
    (study(*AXES).store.folder / "sweep.json").write_bytes(content)
    made = study(*AXES)
    made.check_unfinished()
    assert finish(made) == expected


def test_a_lost_part_is_computed_again(study: Any, expected: dict[str, bytes]) -> None:
    study(*AXES).compute(serial(), quiet)
    for part in study(*AXES).store.parts()[2:5]:
        part.path.unlink()
    assert finish(study(*AXES)) == expected


@pytest.mark.parametrize("count", [1, 2, 3, 7, 50])
def test_shards_cover_every_design_once(study: Any, count: int) -> None:
    made = study(*AXES)
    ranges = sorted(r for k in range(1, count + 1) for r in made.ranges(Shard(k, count)))
    assert [d for start, stop in ranges for d in range(start, stop)] == list(range(76))


@pytest.mark.parametrize("count", [2, 3, pytest.param(50, marks=pytest.mark.slow)])
def test_shards_join_to_the_bytes_of_one_run(
    study: Any, expected: dict[str, bytes], tmp_path: Path, count: int
) -> None:
    found = []
    for number in random.Random(count).sample(range(1, count + 1), count):
        made = study(*AXES, folder=f"shard{number}")
        made.compute(serial(), quiet, Shard(number, count))
        found += stores(made.folder)
    (tmp_path / "all").mkdir()
    assemble(found, tmp_path / "all")
    assert bytes_of(tmp_path / "all") == expected


def test_shards_into_one_folder_are_finished_by_the_whole_sweep(
    study: Any, expected: dict[str, bytes]
) -> None:
    for number in (1, 2):
        study(*AXES).compute(serial(), quiet, Shard(number, 3))
    assert finish(study(*AXES)) == expected


def test_even_a_small_sweep_is_shared_between_shards(
    study: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Shards stride by design or by chunks small enough that each shard has work."""
    monkeypatch.setattr(studies, "STATES_PER_CHUNK", 2**15)
    made = study(*AXES)
    loads = [sum(b - a for a, b in made.ranges(Shard(k, 4))) for k in (1, 2, 3, 4)]
    assert min(loads) > 0


def shards(study: Any, *numbers: int, folder: str = "shard") -> list[Any]:
    found = []
    for number in numbers:
        made = study(*AXES, folder=f"{folder}{number}")
        made.compute(serial(), quiet, Shard(number, 3))
        found += stores(made.folder)
    return found


def test_a_gap_is_refused(study: Any, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="lack designs 8 to 11"):
        assemble(shards(study, 1, 2), tmp_path)


def test_an_overlap_is_refused(study: Any, tmp_path: Path) -> None:
    found = shards(study, 1, 2, 3)
    with pytest.raises(UsageError, match="share designs 4 to 7"):
        assemble([*found, *shards(study, 2, folder="again")], tmp_path)
    assert not (tmp_path / studies.STATES).exists()


def test_damaged_shards_are_refused_or_named(study: Any, tmp_path: Path) -> None:
    found = shards(study, 1, 2, 3)
    part = found[1].parts()[0]
    part.path.write_bytes(part.path.read_bytes()[:-40] + bytes(40))
    with pytest.raises(UsageError, match="shard2"):
        assemble(found, tmp_path)
    assert not list(tmp_path.glob("*.parquet"))


@pytest.mark.parametrize(
    ("change", "key"),
    [
        ({"base": "five_unit"}, "finger.units"),
        ({"rules": "[units < 9]"}, "constraints"),
        ({"tolerance": 1e-9}, "tolerance"),
    ],
)
def test_a_changed_sweep_is_refused_by_the_key_that_changed(
    study: Any, change: dict[str, Any], key: str
) -> None:
    with pytest.raises(StoppedError):
        study(*AXES).compute(serial(), stopping_after(2))
    tolerance = change.pop("tolerance", studies.DEFAULT_TOLERANCE)
    other = study(*AXES, **change)
    other = Study(other.sweep, other.folder, tolerance)
    with pytest.raises(UsageError, match=key):
        other.check_unfinished()
    other.drop_unfinished()
    other.check_unfinished()


def test_changed_values_name_the_key_whose_values_changed(study: Any) -> None:
    with pytest.raises(StoppedError):
        study(*AXES).compute(serial(), stopping_after(2))
    changed = study(*AXES[:2], AXES[2].replace("2, 3", "2, 2.5"))
    with pytest.raises(UsageError, match=r"unit_separation_mm|space\.2"):
        changed.check_unfinished()


Usage = namedtuple("Usage", "total used free")


def test_a_space_that_the_disk_cannot_hold_is_refused(
    study: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = study("{key: finger.geometry.dome_height_mm, linear: {from: 5, to: 7, count: 9000000}}")
    monkeypatch.setattr(shutil, "disk_usage", lambda _: Usage(0, 0, 5 * 2**30))
    with pytest.raises(
        UsageError, match=r"9,000,000 designs .* 72,000,000 states.*16 GiB.*with force"
    ):
        made.check_memory()
        made.check_disk()
    monkeypatch.setattr(shutil, "disk_usage", lambda _: Usage(0, 0, 50 * 2**30))
    made.check_memory()
    made.check_disk()


def test_sizes_below_a_gibibyte_are_said(study: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    made = study("{key: finger.geometry.dome_height_mm, linear: {from: 5, to: 7, count: 9000}}")
    monkeypatch.setattr(shutil, "disk_usage", lambda _: Usage(0, 0, 10_000_000))
    with pytest.raises(UsageError) as refused:
        made.check_memory()
        made.check_disk()
    assert " 0 GiB" not in str(refused.value)


def test_what_is_done_needs_no_room_again(study: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """A sweep stopped by a full disk must not be refused for room it has used already."""
    with pytest.raises(StoppedError):
        study(*AXES).compute(serial(), stopping_after(18))
    needed = 2 * 76 * 16 * BYTES_PER_STATE
    monkeypatch.setattr(shutil, "disk_usage", lambda _: Usage(0, 0, int(0.6 * needed)))
    made = study(*AXES)
    made.check_memory()
    made.check_disk()


def test_the_room_that_is_asked_for_is_enough_and_not_ten_times_too_much(
    study: Any, tables: Any
) -> None:
    made = study("{key: finger.geometry.dome_height_mm, linear: {from: 5, to: 7, count: 300}}")
    made.compute(serial(), quiet)
    parts = sum(part.path.stat().st_size for part in made.store.parts())
    made.assemble()
    written = sum(map(len, bytes_of(made.folder).values()))
    asked = 2 * 300 * 8 * BYTES_PER_STATE
    assert parts + written < 10 * asked


def test_a_vast_space_is_refused_at_once(study: Any) -> None:
    axes = [
        f"{{key: finger.geometry.{key}, linear: {{from: 1, to: 2, count: 2000}}}}"
        for key in ("dome_height_mm", "unit_separation_mm", "dome_thickness_mm")
    ]
    made = study(*axes)
    with pytest.raises(UsageError, match="with force"):
        made.check_memory()
        made.check_disk()
    assert not made.is_up_to_date
    made.check_unfinished()


def test_up_to_date_means_both_tables_of_just_this(study: Any, expected: dict[str, bytes]) -> None:
    made = study(*AXES)
    assert not made.is_up_to_date
    assert finish(made) == expected
    assert made.is_up_to_date
    assert not study(*AXES, rules="[units < 9]").is_up_to_date
    (made.folder / studies.DESIGNS).unlink()
    assert not made.is_up_to_date
    assert finish(made) == expected


def test_nothing_half_written_is_left_by_workers_that_a_signal_ends(tmp_path: Path) -> None:
    """As when all processes of a terminal's group get it: the parent cleans up behind them."""
    path = tmp_path / "s.yaml"
    (tmp_path / "base.yaml").write_bytes((CONFIGS / "three_unit.yaml").read_bytes())
    path.write_text("base: base.yaml\nspace: [{key: finger.units, values: [1]}]\n")
    study = Study(read_sweep(path), tmp_path)

    def compute() -> Progress:
        study.store.folder.mkdir(parents=True)
        (study.store.folder / ".0000000000-0000000001.dpg0.tmp").touch()
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(study, None, compute, warn=print, tell=print)
    assert not list(study.store.folder.iterdir())
