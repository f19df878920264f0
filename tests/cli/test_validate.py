"""Checks of specs: all problems at once, in three formats."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

Call = Callable[..., Any]
MANY = "finger:\n  units: 0\n  linear_stiffness_N_per_mm: x\n" + "".join(
    f"  bogus_{i}: 1\n" for i in range(10)
)


def test_sound_specs_are_named(call: Call) -> None:
    result = call("validate", "three_unit.yaml", "gripper.yaml")
    assert result.exit_code == 0
    assert result.stdout == "three_unit.yaml: ok\ngripper.yaml: ok\n"


def test_all_problems_of_all_files_are_listed(call: Call, folder: Path) -> None:
    (folder / "many.yaml").write_text(MANY, encoding="utf-8")
    result = call("validate", "many.yaml", "three_unit.yaml", "missing.yaml", ".")
    assert result.exit_code == 2
    lines = result.stdout.splitlines()
    assert "three_unit.yaml: ok" in lines
    assert lines[-1] == "14 problems"
    problems = [line for line in lines if ": expected " in line]
    assert len(problems) == 14
    assert all(re.match(r"many\.yaml:\d+:\d+: finger\.", line) for line in problems[:12])
    assert problems[0].startswith("many.yaml:2:3: finger.units: ")
    assert "Traceback" not in result.output


def test_settings_apply_to_every_file(call: Call) -> None:
    result = call("validate", "three_unit.yaml", "gripper.yaml", "-s", "finger.units=0")
    assert result.exit_code == 2
    assert result.stdout.count("finger.units: expected") == 2


def test_json_is_one_array(call: Call, folder: Path) -> None:
    (folder / "many.yaml").write_text(MANY, encoding="utf-8")
    result = call("validate", "many.yaml", "three_unit.yaml", "--format", "json")
    assert result.exit_code == 2
    problems = json.loads(result.stdout)
    assert len(problems) == 12
    assert set(problems[0]) == {"file", "line", "column", "key", "expected", "found", "hint"}
    assert (problems[0]["file"], problems[0]["line"]) == ("many.yaml", 2)
    sound = call("validate", "three_unit.yaml", "--format", "json")
    assert (sound.exit_code, json.loads(sound.stdout)) == (0, [])


def test_github_shows_nine_and_how_many_more(call: Call, folder: Path) -> None:
    (folder / "many.yaml").write_text(MANY, encoding="utf-8")
    result = call("validate", "many.yaml", "--format", "github")
    assert result.exit_code == 2
    lines = result.stdout.splitlines()
    assert len(lines) == 10
    assert all(line.startswith("::error file=many.yaml,line=") for line in lines[:9])
    assert lines[9] == "::error ::and 3 more problems"


@pytest.mark.parametrize(
    ("name", "escaped"),
    [("a,b.yaml", "a%2Cb.yaml"), ("a:b.yaml", "a%3Ab.yaml"), ("50%.yaml", "50%25.yaml")],
)
def test_github_escapes_what_it_reads_as_its_own(
    call: Call, folder: Path, name: str, escaped: str
) -> None:
    (folder / name).write_text("finger: {50%: 1}\n", encoding="utf-8")
    lines = call("validate", name, "--format", "github").stdout.splitlines()
    assert lines
    for line in lines:
        assert line.startswith(f"::error file={escaped},line=1,col=")
        assert re.sub("%25|%0A|%0D", "", line.partition("col=")[2]).count("%") == 0


def test_a_message_is_one_line_whatever_the_file_says(call: Call, folder: Path) -> None:
    text = 'finger:\n  "a\\n::error ::b": "\\r\\n::warning ::c"\n'
    (folder / "bad.yaml").write_text(text, encoding="utf-8")
    for form in ("text", "github"):
        lines = call("validate", "bad.yaml", "--format", form).stdout.splitlines()
        assert lines
        for line in lines:
            assert not line.startswith(("::error ::b", "::warning"))


def test_the_same_spec_as_predict_reads(call: Call, folder: Path) -> None:
    (folder / "many.yaml").write_text(MANY, encoding="utf-8")
    checked = call("validate", "many.yaml").stdout.splitlines()
    refused = call("predict", "many.yaml").stderr.splitlines()
    assert checked[:-1] == refused[:-1]
