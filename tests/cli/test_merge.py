"""`dpg merge`: shards into the tables of one run, or a plain refusal."""

import json
from pathlib import Path
from typing import Any

import pytest

from dpgcli.cli.exits import ExitCode
from dpgcli.files.parts import fingerprint
from dpgcli.studies import sweep as studies

SWEEP = """base: three_unit.yaml
space:
  - {key: finger.geometry.dome_height_mm, linear: {from: 2.5, to: 7, count: 23}}
"""


@pytest.fixture
def shard(call: Any, folder: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Compute some shards of three into folders named by their numbers."""
    monkeypatch.setattr(studies, "STATES_PER_CHUNK", 32)
    (folder / "sweep.yaml").write_text(SWEEP)

    def computed(*numbers: int, prefix: str = "s", options: tuple[str, ...] = ()) -> list[str]:
        for number in numbers:
            to = ("-o", f"{prefix}{number}", "--executor", "serial", "--shard", f"{number}/3")
            assert call("sweep", "sweep.yaml", *to, *options).exit_code == ExitCode.DONE
        return [f"{prefix}{number}" for number in numbers]

    return computed


def tables(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.glob("*.parquet")}


def test_shards_in_any_order_are_one_run(call: Any, folder: Path, shard: Any) -> None:
    result = call("merge", *shard(3, 1, 2), "-o", "all")
    assert result.exit_code == ExitCode.DONE
    assert result.stdout.startswith(
        "all: 23 designs: 20 stable, 3 invalid; more in all/report.md\n"
    )
    one = call("sweep", "sweep.yaml", "--executor", "serial", "-o", "one")
    assert one.exit_code == 0
    assert one.stdout == result.stdout.replace("all: ", "one: ").replace("all/", "one/")
    reports = [(folder / name / "report.md").read_text() for name in ("all", "one")]
    assert reports[0] == reports[1]
    assert reports[0].startswith("# Design space")
    assert tables(folder / "all") == tables(folder / "one")
    assert len(tables(folder / "all")) == 2
    again = call("sweep", "sweep.yaml", "--executor", "serial", "-o", "all")
    assert again.stderr == "all: up to date\n"


def test_a_gap(call: Any, folder: Path, shard: Any) -> None:
    result = call("merge", *shard(1, 3), "-o", "all")
    assert result.exit_code == ExitCode.USAGE
    assert "lack designs 4 to 7" in result.stderr
    assert not tables(folder / "all")


def test_a_part_under_the_name_of_other_designs(call: Any, folder: Path, shard: Any) -> None:
    shards = shard(1, 2, 3)
    first = next((folder / "s1").glob(".parts/*/0000000000-*.part"))
    first.rename(first.with_name(first.name.replace("0000000000-", "0000000001-")))
    result = call("merge", *shards, "-o", "all")
    assert result.exit_code == ExitCode.USAGE
    assert "part is damaged, or of another sweep" in result.stderr
    assert not tables(folder / "all")


def test_a_description_without_its_designs(call: Any, folder: Path, shard: Any) -> None:
    (shard_folder,) = shard(1)
    (path,) = (folder / shard_folder).glob(".parts/*/sweep.json")
    said = json.loads(path.read_text())
    del said["dpg.designs"]
    said["dpg.fingerprint"] = fingerprint(said)
    path.write_text(json.dumps(said))
    path.parent.rename(path.parent.with_name(said["dpg.fingerprint"][:16]))
    result = call("merge", shard_folder, "-o", "all")
    assert result.exit_code == ExitCode.USAGE
    assert "sweep.json is damaged: run its sweep again" in result.stderr


def test_an_overlap(call: Any, folder: Path, shard: Any) -> None:
    shards = shard(1, 2, 3)
    for again in (shards[1], *shard(2, prefix="again")):
        result = call("merge", *shards, again, "-o", "all")
        assert result.exit_code == ExitCode.USAGE
        assert "share designs 4 to 7" in result.stderr
    assert not tables(folder / "all")


def test_mixed_sweeps_name_the_key(call: Any, folder: Path, shard: Any) -> None:
    other = shard(2, prefix="other", options=("-s", "finger.units=2"))
    result = call("merge", *shard(1, 3), *other, "-o", "all")
    assert result.exit_code == ExitCode.USAGE
    assert "other2 differs in sweep.base.finger.units" in result.stderr
    assert not tables(folder / "all")


def test_a_part_of_another_sweep_is_not_taken(call: Any, folder: Path, shard: Any) -> None:
    """Neither merged nor gone on from, though its range and its own bytes are right."""
    shards = shard(1, 2, 3)
    (other,) = shard(2, prefix="other", options=("-s", "finger.linear_stiffness_N_per_mm=2e4"))
    own_part, *_ = sorted((folder / shards[1]).rglob("*.part"))
    foreign, *_ = sorted((folder / other).rglob("*.part"))
    own_bytes = own_part.read_bytes()
    own_part.unlink()
    exchanged = own_part.parent / foreign.name
    exchanged.write_bytes(foreign.read_bytes())
    result = call("merge", *shards, "-o", "all")
    assert result.exit_code == ExitCode.USAGE
    assert "is damaged, or of another sweep: run its sweep again" in result.stderr
    assert not tables(folder / "all")
    assert shard(2) == [shards[1]]
    assert own_part.read_bytes() == own_bytes
    assert call("merge", *shards, "-o", "all").exit_code == ExitCode.DONE


def test_a_description_of_another_sweep_is_not_taken(call: Any, folder: Path, shard: Any) -> None:
    shards = shard(1, 2, 3)
    (other,) = shard(2, prefix="other", options=("-s", "finger.linear_stiffness_N_per_mm=2e4"))
    (own,) = (folder / shards[1]).rglob("sweep.json")
    (foreign,) = (folder / other).rglob("sweep.json")
    own.write_bytes(foreign.read_bytes())
    result = call("merge", shards[1], "-o", "all")
    assert result.exit_code == ExitCode.USAGE
    assert "sweep.json is damaged" in result.stderr


@pytest.mark.parametrize("what", ["nothing", "a file", "a finished sweep"])
def test_what_is_no_shard(call: Any, folder: Path, shard: Any, what: str) -> None:
    shards = shard(1, 2, 3)
    if what == "a file":
        (folder / "other").write_text("text")
    if what == "a finished sweep":
        call("sweep", "sweep.yaml", "--executor", "serial", "-o", "other")
    result = call("merge", *shards, "other", "-o", "all")
    assert result.exit_code == ExitCode.USAGE
    assert result.stderr.startswith("dpg: other: expected the output of one dpg sweep --shard")


@pytest.mark.parametrize("output", ["file", "file/all"])
def test_an_output_that_cannot_be_a_folder(
    call: Any, folder: Path, shard: Any, output: str
) -> None:
    (folder / "file").write_text("old")
    result = call("merge", *shard(1, 2, 3), "-o", output)
    assert result.exit_code == ExitCode.USAGE
    assert "Traceback" not in result.stderr
    assert (folder / "file").read_text() == "old"


@pytest.mark.parametrize("place", [0.0, 0.2, 0.5, 0.8, 0.99])
def test_a_damaged_shard_is_named(call: Any, folder: Path, shard: Any, place: float) -> None:
    shards = shard(1, 2, 3)
    part = next(iter(sorted((folder / "s2").rglob("*.part"))))
    content = bytearray(part.read_bytes())
    content[int(place * len(content))] ^= 16
    part.write_bytes(content)
    result = call("merge", *shards, "-o", "all")
    assert result.exit_code == ExitCode.USAGE
    assert "s2" in result.stderr
    assert "Traceback" not in result.stderr
    assert not tables(folder / "all")


def test_the_shards_stay_as_they_are(call: Any, folder: Path, shard: Any) -> None:
    shards = shard(1, 2, 3)
    before = {p: p.read_bytes() for s in shards for p in (folder / s).rglob("*") if p.is_file()}
    call("merge", *shards, "-o", "all")
    after = {p: p.read_bytes() for s in shards for p in (folder / s).rglob("*") if p.is_file()}
    assert after == before


def test_shards_stay_until_all_is_written(
    call: Any, folder: Path, shard: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    shards = shard(1, 2, 3)
    with monkeypatch.context() as patch:
        patch.setattr("dpgcli.api.report.page", _stop)
        assert call("merge", *shards, "-o", "all").exit_code != ExitCode.DONE
    assert call("merge", *shards, "-o", "all").exit_code == ExitCode.DONE


@pytest.mark.parametrize("output", ["s1", "s2/all"])
def test_a_shard_is_no_place_for_the_whole(
    call: Any, folder: Path, shard: Any, output: str
) -> None:
    """Its parts were removed: what is read is never replaced."""
    shards = shard(1, 2, 3)
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    result = call("merge", *shards, "-o", output)
    assert result.exit_code == ExitCode.USAGE
    assert "would lie in a folder that is read: give another name" in result.stderr
    assert {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()} == before


def _stop(*_: Any) -> None:
    raise KeyboardInterrupt
