"""Names of files that are no text, and ~ in the names that files hold, in every command."""

import os
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from dpgcli.cli.exits import ExitCode

CONFIGS = Path(__file__).parents[2] / "configs"
ODD = os.fsdecode(b"caf\xe9")
SWEEP = "base: three_unit.yaml\nspace:\n  - {table: t.csv}\nconstraints: [dome_height_mm < 6.4]\n"
DESIGNS = (
    "finger.geometry.dome_height_mm,finger.geometry.unit_separation_mm\n6,3\n2,3\n6.5,3\n6,-1\n"
)


@pytest.fixture
def odd(folder: Path, monkeypatch: pytest.MonkeyPatch, call: Any) -> Path:
    """A folder whose name is no text, with files of such names in it."""
    place = folder / ODD
    try:
        place.mkdir()
    except OSError:
        pytest.skip("no such names on this file system")
    calibration = CONFIGS / "calibration"
    copies = {
        f"{ODD}.yaml": CONFIGS / "three_unit.yaml",
        "three_unit.yaml": CONFIGS / "three_unit.yaml",
        f"{ODD}-curve.csv": calibration / "dome_path_h6.5_t0.75.csv",
        f"{ODD}-hinge.csv": calibration / "hinge_moment.csv",
        f"{ODD}-grid.csv": calibration / "dome_grid.csv",
        f"{ODD}-tips.csv": calibration / "three_gap_finger.csv",
        f"{ODD}-finger.yaml": calibration / "three_gap_finger.yaml",
        "push_3.5mm.yaml": calibration / "push_3.5mm.yaml",
    }
    for name, source in copies.items():
        (place / name).write_bytes(source.read_bytes())
    (place / f"{ODD}-sweep.yaml").write_text(SWEEP)
    (place / "t.csv").write_text(DESIGNS)
    monkeypatch.chdir(place)
    return place


SWEEPING = "sweep @-sweep.yaml -o @-out -j 2 --depfile @.d --summary-file @.md"
COMMANDS = [  # an @ stands for the odd name
    "predict @.yaml -o @.parquet --plot @.svg",
    "explain @.yaml",
    "validate @.yaml",
    f"{SWEEPING}; {SWEEPING}; report @-out -o @.html; report @-out -o @-r.md",
    f"{SWEEPING}; check @-out/designs.parquet --require n_states>0 --format github",
    "sweep ../@/@-sweep.yaml -o @1 -j 1 --shard 1/2; "
    "sweep ../@/@-sweep.yaml -o @2 -j 1 --shard 2/2; merge @1 @2 -o @-merged",
    "fit bistable @-curve.csv --travel-to-opening equal -o @-dome.yaml --plot @-b.svg",
    "fit hinge @-hinge.csv -o @-h.yaml --plot @-h.png",
    "fit grid @-grid.csv -o @-g.yaml",
    "fit finger @-finger.yaml @-tips.csv -o @-lever.yaml --plot @-f.svg; "
    "compare @-finger.yaml @-tips.csv --calibration @-lever.yaml --plot @-c.svg",
    "init @-new.yaml",
    "fe hinge @.yaml --output @-deck; fe dome @.yaml --output @-deck; "
    "fe unit @.yaml --output @-deck; fe finger @.yaml --output @-deck",
    "stress @.yaml --only patterns -o @-stress.parquet",
]


@pytest.mark.slow
@pytest.mark.parametrize("commands", COMMANDS, ids=lambda text: text.split(" @")[0])
def test_names_that_are_no_text_will_do(call: Any, odd: Path, commands: str) -> None:
    for command in commands.replace("@", ODD).split("; "):
        words = command.split(" ")
        result = call(*words)
        is_unmet = words[0] == "check"  # invalid designs meet nothing
        assert result.exit_code == (ExitCode.REQUIREMENT if is_unmet else 0), result.output
        written = [word for before, word in pairwise(words) if before == "-o"]
        assert all((odd / name).exists() for name in written)


def test_a_setting_that_is_no_text_is_refused_before_the_work(call: Any, odd: Path) -> None:
    result = call("predict", "three_unit.yaml", "-s", f"finger.calibration={ODD}.yaml", "-o", "x")
    assert result.exit_code == ExitCode.USAGE
    assert not (odd / "x").exists()


@pytest.fixture
def home(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The user's own folder, apart from the current one."""
    home = folder / "home"
    home.mkdir()
    monkeypatch.setenv("HOME", str(home))
    return home


def test_the_users_own_folder_may_be_named(call: Any, folder: Path, home: Path) -> None:
    (home / "base.yaml").write_bytes((folder / "three_unit.yaml").read_bytes())
    (home / "t.csv").write_text(DESIGNS)
    (home / "lever.yaml").write_text(
        "calibration_version: 1\nmade_by: hand\nmethod: none\n"
        "values: {bistable_stiffness_N_per_mm: {value: 20}}\n"
    )
    (folder / "s.yaml").write_text("base: ~/base.yaml\nspace:\n  - {table: ~/t.csv}\n")
    assert call("sweep", "s.yaml", "-o", "out", "-j", "1", "-q").exit_code == ExitCode.DONE
    named = "finger.calibration=[~/lever.yaml, published]"
    set_so = call("predict", "three_unit.yaml", "-s", named, "--format", "csv")
    assert set_so.exit_code == ExitCode.DONE, set_so.stderr
    text = (folder / "three_unit.yaml").read_text()
    assert "calibration: published" in text
    spec = text.replace("calibration: published", "calibration: [~/lever.yaml, published]")
    (folder / "other.yaml").write_text(spec)
    assert call("predict", "other.yaml", "--format", "csv").stdout == set_so.stdout
    assert set_so.stdout != call("predict", "three_unit.yaml", "--format", "csv").stdout


def test_what_is_not_in_the_users_folder_is_named_in_full(
    call: Any, folder: Path, home: Path
) -> None:
    (folder / "s.yaml").write_text("base: ~/none.yaml\nspace:\n  - {table: ~/t.csv}\n")
    result = call("sweep", "s.yaml", "-o", "out")
    assert result.exit_code == ExitCode.USAGE
    assert f"{home}/none.yaml: file: expected a readable file" in result.stderr
