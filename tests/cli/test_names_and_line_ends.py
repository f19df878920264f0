"""Files as they come from anywhere: Windows' line ends, spaces, $ and letters of any language."""

import json
import os
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
from typer.testing import Result

from dpgcli.cli.exits import ExitCode

CONFIGS = Path(__file__).parents[2] / "configs"
STRANGE = "a $HOME b é 名"
SWEEP = """base: '{base}'
space:
  - table: '{table}'
constraints:
  - dome_height_mm > 6
"""
HEIGHTS = "# heights\nfinger.geometry.dome_height_mm\n6\n6.5\n7\n"
CURVE = "calibration/dome_path_h6.5_t0.75.csv"


def crlf(text: str) -> bytes:
    """A text as Windows' editors save it."""
    return b"\xef\xbb\xbf" + text.replace("\n", "\r\n").encode()


@pytest.fixture
def place(folder: Path, monkeypatch: pytest.MonkeyPatch, call: Any) -> Path:
    """The current folder, of a strange name, with files of strange names and line ends."""
    place = folder / STRANGE
    place.mkdir()
    spec = (CONFIGS / "three_unit.yaml").read_text(encoding="utf-8")
    (place / f"{STRANGE}.yaml").write_bytes(crlf(spec))
    (place / f"{STRANGE}.csv").write_bytes(crlf(HEIGHTS))
    sweep = SWEEP.format(base=f"{STRANGE}.yaml", table=f"{STRANGE}.csv")
    (place / f"{STRANGE} sweep.yaml").write_bytes(crlf(sweep))
    (place / f"{STRANGE} curve.csv").write_bytes(crlf((CONFIGS / CURVE).read_text("utf-8")))
    monkeypatch.chdir(place)
    return place


def done(result: Result) -> str:
    """Standard output of a command that must have ended well."""
    assert result.exit_code == ExitCode.DONE, result.output
    return result.stdout


def test_predicting(place: Path, call: Any) -> None:
    spec, table, plot = f"{STRANGE}.yaml", f"{STRANGE}.parquet", f"{STRANGE}.svg"
    done(call("predict", spec, "-o", table, "--plot", plot))
    done(call("predict", "../three_unit.yaml", "-o", "plain.parquet"))
    assert (place / table).read_bytes() == (place / "plain.parquet").read_bytes()
    assert json.loads((place / f"{STRANGE}.run.json").read_text())["table"] == table
    assert (place / plot).exists()


def test_problems_are_where_they_are(place: Path, call: Any) -> None:
    spec = place / f"{STRANGE}.yaml"
    spec.write_bytes(spec.read_bytes().replace(b"units: 3", b"units: '3'"))
    result = call("validate", spec.name)
    assert result.exit_code == ExitCode.USAGE
    lines = spec.read_bytes().split(b"\r\n")
    (line,) = (n for n, text in enumerate(lines, start=1) if b"units: '3'" in text)
    assert f"{spec.name}:{line}:" in result.output


def test_fitting(place: Path, call: Any) -> None:
    curve, file = f"{STRANGE} curve.csv", f"{STRANGE} fit.yaml"
    travel = ("--travel-to-opening", "stroke:3.5")
    found = done(call("fit", "bistable", curve, *travel, "--spec", f"{STRANGE}.yaml", "-o", file))
    assert found == done(call("fit", "bistable", str(CONFIGS / CURVE), *travel))
    spec = place / f"{STRANGE}.yaml"
    assert "calibrated" in done(
        call("explain", spec.name, "-s", f"finger.calibration=['{file}', published]")
    )


def test_sweeping_and_reporting(place: Path, call: Any) -> None:
    out, page = f"{STRANGE} out", f"{STRANGE}.html"
    sweep = ("sweep", f"{STRANGE} sweep.yaml", "-o", out, "--executor", "serial")
    assert "3 designs" in done(call(*sweep))
    assert "up to date" in call(*sweep).stderr
    done(call("report", out, "-o", page))
    assert "Design space" in (place / page).read_text(encoding="utf-8")
    done(call("check", f"{out}/designs.parquet", "--require", "n_stable > 0"))


@pytest.mark.skipif(shutil.which("make") is None, reason="needs make")
def test_make_knows_the_names(place: Path, call: Any) -> None:
    out = f"{STRANGE} out"
    sweep = ("sweep", f"{STRANGE} sweep.yaml", "-o", out, "--executor", "serial")
    done(call(*sweep, "--depfile", f"{STRANGE}.d"))
    assert b"\r" not in (place / f"{STRANGE}.d").read_bytes()
    shutil.copy(place / f"{STRANGE}.d", place / "deps.mk")
    target = f"{STRANGE} out/states.parquet"
    spelled = target.replace("$", "$$").replace(" ", "\\ ")
    (place / "Makefile").write_text(f"{spelled}:\n\t@echo again\n\ninclude deps.mk\n")
    assert "up to date" in made(place, target)
    newer = (place / target).stat().st_mtime + 5
    os.utime(place / f"{STRANGE}.csv", (newer, newer))
    assert made(place, target) == "again\n"


def made(place: Path, target: str) -> str:
    """What GNU Make says."""
    command = ["make", "--no-print-directory", target]
    ended = subprocess.run(command, cwd=place, capture_output=True, text=True, check=True)
    return ended.stdout
