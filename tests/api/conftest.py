"""A folder with examples, the commands, and a watch on what is printed."""

import copy
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from dpgcli.cli.main import app

STUDY: dict[str, Any] = {
    "finger": {
        "units": 3,
        "linear_stiffness_N_per_mm": 1.0e4,
        "lattice": {
            "segment_length_mm": 13.75,
            "segment_height_mm": 10.75,
            "stroke_mm": 3.5,
            "bistable_stiffness_N_per_mm": 12.84,
            "force_linearity": 0.043,
            "hinge_stiffness_N_mm_per_rad": 24.2,
        },
    }
}
TIPS = """\
pattern,tip_x_mm,tip_y_mm,tip_angle_rad,seconds
000,51.99976,-0.00817,-0.000297,22.5
001,51.36669,-3.44429,-0.266250,22.5
010,50.85420,-7.16644,-0.274989,22.5
100,50.46532,-10.33568,-0.263758,22.5
110,47.71870,-16.52155,-0.524182,22.5
"""

Rows = Callable[..., list[dict[str, Any]]]


@pytest.fixture
def study() -> dict[str, Any]:
    """The data of a spec."""
    return copy.deepcopy(STUDY)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder to work in, with a spec as YAML (which JSON is) and the tips of a finger."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "study.yaml").write_text(json.dumps(STUDY))
    (tmp_path / "tips.csv").write_text(TIPS)
    return tmp_path


@pytest.fixture
def printed(folder: Path) -> Rows:
    """The rows that a command prints."""

    def rows(*arguments: str) -> list[dict[str, Any]]:
        result = CliRunner().invoke(app, [*arguments, "--format", "json"])
        assert result.exit_code == 0, result.stderr
        found: list[dict[str, Any]] = json.loads(result.stdout)
        return found

    return rows


@pytest.fixture(autouse=True)
def silent(capfd: pytest.CaptureFixture[str]) -> Iterator[None]:
    """Functions print nothing; what commands print is caught by their runner."""
    yield
    said = capfd.readouterr()
    assert (said.out, said.err) == ("", "")
