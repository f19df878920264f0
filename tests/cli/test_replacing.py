"""Nothing is replaced that the program did not write, and no input by an output."""

import os
import stat
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from dpgcli.cli.exits import ExitCode
from dpgcli.files.parts import PartStore
from dpgcli.studies import sweep as studies

Call = Callable[..., Any]
HEIGHT = "finger.geometry.dome_height_mm"
SWEEP = f"""base: three_unit.yaml
space:
  - {{key: {HEIGHT}, values: [2.5, 6, 6.5]}}
"""
CURVE = "moment_N_mm,rotation_rad\n0,0\n1,0.04\n2,0.08\n3,0.12\n"
THEIRS = b"measured with care\n"
RUN = ("sweep", "sweep.yaml", "--executor", "serial", "-q", "-o", "out")
FIT = ("fit", "hinge", "curve.csv", "-q")
FOREIGN = [
    (("predict", "three_unit.yaml", "-q", "-o", "t.parquet"), "t.parquet"),
    (("predict", "three_unit.yaml", "-q", "-o", "t.parquet"), "t.run.json"),
    (("predict", "three_unit.yaml", "-q", "--plot", "t.svg"), "t.svg"),
    (("predict", "three_unit.yaml", "-q", "--plot", "t.png"), "t.png"),
    ((*FIT, "-o", "t.yaml"), "t.yaml"),
    ((*FIT, "--plot", "t.svg"), "t.svg"),
    (("report", "done", "-o", "t.md"), "t.md"),
    (("report", "done", "-o", "t.html"), "t.html"),
    ((*RUN, "--depfile", "t.d"), "t.d"),
    (RUN, "out/states.parquet"),
    (RUN, "out/designs.parquet"),
    (RUN, "out/run.json"),
    (RUN, "out/report.md"),
    (("stress", "--only", "mirror", "-q", "-o", "t.parquet"), "t.parquet"),
    (("compare", "study.yaml", "tips.csv", "-q", "--plot", "t.svg"), "t.svg"),
]
NEVER_DONE = [  # what would take long is refused before
    (("bench", "three_unit.yaml", "-o", "t.parquet"), "t.parquet"),
    (("bench", "three_unit.yaml", "--json", "t.json"), "t.json"),
    (("bench", "three_unit.yaml", "--plot", "t.svg"), "t.svg"),
]


@pytest.fixture
def inputs(call: Call, folder: Path, study: tuple[str, str]) -> Path:
    """A sweep, a curve, and the folder of a sweep that is done."""
    assert study
    (folder / "sweep.yaml").write_text(SWEEP)
    (folder / "curve.csv").write_text(CURVE)
    assert call(*RUN[:-1], "done").exit_code == ExitCode.DONE
    (folder / "out").mkdir()
    return folder


def everything(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


@pytest.mark.parametrize(("command", "name"), FOREIGN + NEVER_DONE)
def test_files_of_somebody_else_stay(
    call: Call, inputs: Path, command: tuple[str, ...], name: str
) -> None:
    (inputs / name).write_bytes(THEIRS)
    before = everything(inputs)
    result = call(*command)
    assert (result.exit_code, result.stdout) == (ExitCode.USAGE, "")
    assert f"cannot write {name}: it is there and not of dpg; move it away" in result.stderr
    assert everything(inputs) == before


@pytest.mark.slow
@pytest.mark.parametrize(("command", "name"), FOREIGN)
def test_own_files_are_replaced_and_keep_their_mode(
    call: Call, inputs: Path, command: tuple[str, ...], name: str
) -> None:
    """An empty file counts as nothing: so has `mktemp` made it."""
    (inputs / name).touch()
    (inputs / name).chmod(0o600)
    contents = []
    for height in ("6.5", "6.4"):
        (inputs / "sweep.yaml").write_text(SWEEP.replace("6.5", height))
        assert call(*command).exit_code == ExitCode.DONE
        contents.append((inputs / name).read_bytes())
        assert stat.S_IMODE((inputs / name).stat().st_mode) == 0o600
    assert all(contents)


@pytest.mark.parametrize("own", ["t.yaml", "t.svg", "done/report.md", "done/run.json"])
def test_a_file_of_another_kind_is_not_replaced(call: Call, inputs: Path, own: str) -> None:
    for command in ((*FIT, "-o", "t.yaml"), (*FIT, "--plot", "t.svg")):
        assert call(*command).exit_code == ExitCode.DONE
    before = everything(inputs)
    result = call(*RUN, "--depfile", own)
    assert result.exit_code == ExitCode.USAGE
    assert f"cannot write {own}: it is there and of dpg, but another kind of file" in result.stderr
    assert everything(inputs) == before


@pytest.mark.parametrize("name", ["designs.parquet", "states.parquet"])
@pytest.mark.parametrize("shard", [(), ("--shard", "1/2")])
def test_a_table_that_is_swept_is_not_replaced(
    call: Call, inputs: Path, name: str, shard: tuple[str, ...]
) -> None:
    pd.DataFrame({HEIGHT: [6.0, 6.5]}).to_parquet(inputs / name)
    (inputs / "sweep.yaml").write_text(
        f"base: three_unit.yaml\nspace:\n  - table: {name}\n", encoding="utf-8"
    )
    before = everything(inputs)
    result = call(*RUN[:-1], ".", *shard)
    assert result.exit_code == ExitCode.USAGE
    assert f"{name} is the spec or data that is read: give another name" in result.stderr
    assert everything(inputs) == before


@pytest.mark.parametrize("link", ["none", "hard", "soft"])
@pytest.mark.parametrize("name", ["report.md", "run.json", "states.parquet"])
def test_a_base_is_not_replaced_whatever_its_name(
    call: Call, inputs: Path, name: str, link: str
) -> None:
    base = inputs / "three_unit.yaml"
    if link == "hard":
        os.link(base, inputs / "out" / name)
    elif link == "soft":
        (inputs / "out" / name).symlink_to(base)
    else:
        base.rename(inputs / "out" / name)
        (inputs / "sweep.yaml").write_text(SWEEP.replace("three_unit.yaml", f"out/{name}"))
    before = everything(inputs)
    result = call(*RUN)
    assert result.exit_code == ExitCode.USAGE
    assert f"out/{name} is the spec or data that is read" in result.stderr
    assert everything(inputs) == before


@pytest.mark.parametrize("option", ["--summary-file", "--depfile"])
@pytest.mark.parametrize("name", ["designs.parquet", "run.json", "report.md", "Report.MD"])
def test_what_a_sweep_writes_has_names_of_its_own(
    call: Call, inputs: Path, option: str, name: str
) -> None:
    """Before any of them is there; capitals do not tell files apart everywhere."""
    result = call(*RUN, option, f"out/{name}")
    assert (result.exit_code, result.stdout) == (ExitCode.USAGE, "")
    assert "expected names that differ" in result.stderr
    assert not list((inputs / "out").iterdir())


@pytest.mark.parametrize("option", ["--summary-file", "--depfile"])
@pytest.mark.parametrize("name", [".parts", ".parts/sweep.d", "../out/.parts"])
def test_nothing_else_is_written_where_parts_are_kept(
    call: Call, inputs: Path, option: str, name: str
) -> None:
    result = call(*RUN, option, f"out/{name}")
    assert (result.exit_code, result.stdout) == (ExitCode.USAGE, "")
    assert f"out/{name}: expected a name outside of .parts, where parts are kept" in result.stderr
    assert not list((inputs / "out").iterdir())


def test_a_summary_is_not_appended_to_a_table_of_two_names(call: Call, inputs: Path) -> None:
    os.link(inputs / "done" / "designs.parquet", inputs / "summary.md")
    result = call(*RUN[:-1], "done", "--summary-file", "summary.md")
    assert result.exit_code == ExitCode.USAGE
    assert "expected names that differ" in result.stderr


def test_one_link_is_broken_and_the_other_name_keeps_its_content(call: Call, inputs: Path) -> None:
    os.link(inputs / "done" / "report.md", inputs / "kept.md")
    before = (inputs / "kept.md").read_bytes()
    (inputs / "sweep.yaml").write_text(SWEEP.replace("2.5", "4.5"))
    assert call(*RUN[:-1], "done").exit_code == ExitCode.DONE
    assert (inputs / "done" / "report.md").read_bytes() != before
    assert (inputs / "kept.md").read_bytes() == before


def test_a_link_to_a_file_of_somebody_else_is_not_followed(call: Call, inputs: Path) -> None:
    (inputs / "notes.md").write_bytes(THEIRS)
    (inputs / "out" / "report.md").symlink_to("../notes.md")
    assert call(*RUN).exit_code == ExitCode.USAGE
    assert (inputs / "notes.md").read_bytes() == THEIRS


def test_notes_that_a_summary_was_appended_to_stay(call: Call, inputs: Path) -> None:
    (inputs / "notes.md").write_bytes(THEIRS)
    for _ in range(2):
        assert call(*RUN, "--summary-file", "notes.md").exit_code == ExitCode.DONE
    notes = (inputs / "notes.md").read_bytes()
    assert notes.startswith(THEIRS) and notes.count(b"\n# ") == 2
    result = call("report", "done", "-o", "notes.md")
    assert result.exit_code == ExitCode.USAGE
    assert "notes.md: it is there and not of dpg" in result.stderr
    assert (inputs / "notes.md").read_bytes() == notes


def test_what_report_prints_is_not_taken_for_its_file(call: Call, inputs: Path) -> None:
    printed = call("report", "done").stdout
    (inputs / "notes.md").write_text(printed)
    assert (inputs / "done" / "report.md").read_text() == f"{printed}\n<!-- written by dpg -->\n"
    assert call("report", "done", "-o", "notes.md").exit_code == ExitCode.USAGE
    assert (inputs / "notes.md").read_text() == printed


@pytest.mark.parametrize("name", ["states.parquet", "run.json", "report.md", "photo.png", "a.yaml"])
def test_a_summary_is_appended_to_text_only(call: Call, inputs: Path, name: str) -> None:
    path = inputs / "done" / name
    if not path.exists():
        path.write_bytes(THEIRS)
    before = everything(inputs)
    designs = "done/designs.parquet"
    result = call("check", designs, "--require", "n_stable > 0", "--summary-file", f"done/{name}")
    assert result.exit_code == ExitCode.USAGE
    assert f"cannot append to done/{name}: " in result.stderr
    assert call(*RUN, "--summary-file", f"done/{name}").exit_code == ExitCode.USAGE
    assert everything(inputs) == before


def test_a_makefile_is_no_depfile(call: Call, inputs: Path) -> None:
    rule = b"out/states.parquet out/designs.parquet: sweep.yaml\n\tdpg sweep sweep.yaml -o out\n"
    (inputs / "Makefile").write_bytes(rule)
    result = call(*RUN, "--depfile", "Makefile")
    assert result.exit_code == ExitCode.USAGE
    assert "cannot write Makefile: it is there and not of dpg" in result.stderr
    assert (inputs / "Makefile").read_bytes() == rule


@pytest.mark.parametrize("flag", [(), ("--restart",)])
@pytest.mark.parametrize("linked", [".parts", f".parts/{'a' * 16}"])
def test_links_among_the_parts_are_not_followed(
    call: Call, inputs: Path, flag: tuple[str, ...], linked: str
) -> None:
    theirs = inputs / "elsewhere" / ("b" * 16)
    PartStore(theirs).say({"dpg.designs": "3"})
    (theirs / "0000000000-0000000004-0123456789abcdef.part").write_bytes(THEIRS)
    target = theirs if "/" in linked else theirs.parent
    (inputs / "out" / linked).parent.mkdir(exist_ok=True)
    (inputs / "out" / linked).symlink_to(target)
    before = everything(inputs / "elsewhere")
    result = call(*RUN, *flag)
    assert result.exit_code == (ExitCode.DONE if "/" in linked else ExitCode.USAGE)
    assert ("cannot write out/.parts: a link" in result.stderr) == ("/" not in linked)
    assert everything(inputs / "elsewhere") == before
    assert (inputs / "out" / linked).is_symlink()


@pytest.mark.parametrize("flag", [(), ("--restart",)])
def test_a_description_that_is_not_of_dpg_stays(
    call: Call, inputs: Path, flag: tuple[str, ...]
) -> None:
    theirs = inputs / "out" / ".parts" / ("0" * 16)
    theirs.mkdir(parents=True)
    (theirs / "sweep.json").write_bytes(THEIRS)
    (theirs / "0000000000-0000000004-0123456789abcdef.part").write_bytes(THEIRS)
    before = everything(theirs)
    assert call(*RUN, *flag).exit_code == ExitCode.DONE
    assert everything(theirs) == before


@pytest.mark.parametrize("flag", [(), ("--restart",)])
def test_what_stands_among_the_parts_stays(call: Call, inputs: Path, flag: tuple[str, ...]) -> None:
    theirs = ["sweep.json", "mine/sweep.json", "mine/0000000000-0000000004-0123456789abcdef.part"]
    (inputs / "out" / ".parts" / "mine").mkdir(parents=True)
    for name in theirs:
        (inputs / "out" / ".parts" / name).write_bytes(THEIRS)
    assert call(*RUN, *flag).exit_code == ExitCode.DONE
    found = everything(inputs / "out" / ".parts")
    assert {name: found.get(name) for name in theirs} == dict.fromkeys(theirs, THEIRS)


def test_a_file_in_the_place_of_the_parts(call: Call, inputs: Path) -> None:
    (inputs / "out" / ".parts").write_bytes(THEIRS)
    result = call(*RUN)
    assert (result.exit_code, "Traceback" in result.stderr) == (ExitCode.USAGE, False)
    assert (inputs / "out" / ".parts").read_bytes() == THEIRS


def test_shards_are_joined_beside_an_unfinished_sweep(
    call: Call, inputs: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its parts stay."""
    monkeypatch.setattr(studies, "STATES_PER_CHUNK", 8)
    other = PartStore(inputs / "out" / ".parts" / ("0" * 16))
    other.say({"dpg.designs": "3"})
    assert call(*RUN[:-1], "one", "--shard", "1/2").exit_code == ExitCode.DONE
    assert call(*RUN[:-1], "two", "--shard", "2/2").exit_code == ExitCode.DONE
    assert call("merge", "one", "two", "-q", "-o", "out").exit_code == ExitCode.DONE
    assert [path.name for path in other.folder.iterdir()] == ["sweep.json"]


@pytest.mark.parametrize("name", ["states.parquet", "designs.parquet", "report.md"])
def test_shards_are_not_joined_over_files_of_somebody_else(
    call: Call, inputs: Path, name: str
) -> None:
    assert call(*RUN[:-1], "one", "--shard", "1/1").exit_code == ExitCode.DONE
    (inputs / "out" / name).write_bytes(THEIRS)
    before = everything(inputs)
    assert call("merge", "one", "-q", "-o", "out").exit_code == ExitCode.USAGE
    assert everything(inputs) == before
