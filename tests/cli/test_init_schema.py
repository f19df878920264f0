"""The spec to start from, and the schema for editors."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML

from dpgcli.errors import OutputError
from dpgcli.files import output

Call = Callable[..., Any]
ROOT = Path(__file__).parents[2]
CONFIGS = sorted((ROOT / "configs").glob("*.yaml"))
SHIPPED = sorted(
    [*(ROOT / "configs").rglob("*.yaml"), *(ROOT / "dpgcli" / "files").rglob("starter.yaml")]
)


def test_a_new_spec_is_sound_and_commented(call: Call, folder: Path) -> None:
    result = call("init")
    assert (result.exit_code, result.stdout) == (0, "")
    assert "finger.yaml" in result.stderr
    assert "#" in (folder / "finger.yaml").read_text(encoding="utf-8")
    assert call("validate", "finger.yaml").exit_code == 0
    assert call("predict", "-q", "finger.yaml").exit_code == 0


def test_standard_output_gets_the_same_text(call: Call, folder: Path) -> None:
    call("init", "mine.yaml")
    assert call("init", "-").stdout == (folder / "mine.yaml").read_text(encoding="utf-8")


def test_a_file_is_overwritten_only_by_force(call: Call, folder: Path) -> None:
    path = folder / "mine.yaml"
    path.write_text("mine", encoding="utf-8")
    refused = call("init", "mine.yaml")
    assert (refused.exit_code, path.read_text(encoding="utf-8")) == (2, "mine")
    assert "--force" in refused.stderr
    assert call("init", "mine.yaml", "--force").exit_code == 0
    assert path.read_text(encoding="utf-8") != "mine"


def test_a_link_to_nowhere_is_something_that_exists(call: Call, folder: Path) -> None:
    (folder / "link.yaml").symlink_to("nowhere.yaml")
    assert call("init", "link.yaml").exit_code == 2
    assert (folder / "link.yaml").is_symlink()


@pytest.mark.parametrize("arguments", [("folder",), ("folder", "--force"), ("missing/x.yaml",)])
def test_a_place_that_cannot_be_written(
    call: Call, folder: Path, arguments: tuple[str, ...]
) -> None:
    (folder / "folder").mkdir()
    result = call("init", *arguments)
    assert result.exit_code == 2
    assert "Traceback" not in result.output
    assert not list(folder.glob(".*.tmp"))


@pytest.mark.parametrize("options", [(), ("--gripper",)])
def test_a_new_sweep_comes_with_its_base_and_runs(
    call: Call, folder: Path, options: tuple[str, ...]
) -> None:
    base = "gripper.yaml" if options else "finger.yaml"
    (folder / "gripper.yaml").unlink()
    result = call("init", "--sweep", *options)
    assert (result.exit_code, result.stdout) == (0, "")
    assert f"wrote sweep.yaml, around {base}, written with it" in result.stderr
    assert call("validate", base, "sweep.yaml").exit_code == 0
    plan = json.loads(call("explain", "sweep.yaml", "--format", "json").stdout)
    assert (plan["base"], plan["n_invalid"]) == (base, 0)
    assert 0 < plan["n_excluded"] < plan["n_designs"]
    swept = call("sweep", "sweep.yaml", "-o", "out", "-q", "--executor", "serial")
    assert swept.exit_code == 0
    alone = call("init", "-", *options).stdout
    assert (folder / base).read_text(encoding="utf-8") == alone
    assert ("\ngripper:\n" in alone) == bool(options)


def test_a_new_gripper_differs_from_a_new_finger_by_its_section(call: Call, folder: Path) -> None:
    (folder / "gripper.yaml").unlink()
    assert "wrote gripper.yaml" in call("init", "--gripper").stderr
    finger = call("init", "-").stdout.splitlines()
    gripper = (folder / "gripper.yaml").read_text(encoding="utf-8").splitlines()
    changed = [(old, new) for old, new in zip(finger, gripper, strict=True) if old != new]
    assert changed == [
        ("# gripper:", "gripper:"),
        ("  # base_spacing_mm: 60", "  base_spacing_mm: 60"),
        ("  # mounting_angle_deg: 0", "  mounting_angle_deg: 0"),
    ]
    assert call("validate", "gripper.yaml").exit_code == 0
    assert "aperture_mm" in call("predict", "gripper.yaml", "--format", "csv").stdout


@pytest.mark.parametrize("force", [(), ("--force",)])
def test_the_base_of_a_new_sweep_is_never_replaced(
    call: Call, folder: Path, force: tuple[str, ...]
) -> None:
    (folder / "finger.yaml").write_text("mine", encoding="utf-8")
    result = call("init", "--sweep", "wide.yaml", *force)
    assert (result.exit_code, "as it was there" in result.stderr) == (0, True)
    assert (folder / "finger.yaml").read_text(encoding="utf-8") == "mine"


def test_a_sweep_that_is_there_is_kept_and_gets_no_base(call: Call, folder: Path) -> None:
    (folder / "sweep.yaml").write_text("mine", encoding="utf-8")
    result = call("init", "--sweep")
    assert (result.exit_code, "sweep.yaml exists" in result.stderr) == (2, True)
    assert (folder / "sweep.yaml").read_text(encoding="utf-8") == "mine"
    assert not (folder / "finger.yaml").exists()


@pytest.mark.parametrize("path", ["finger.yaml", "./finger.yaml", "link.yaml"])
@pytest.mark.parametrize("force", [(), ("--force",)])
def test_a_sweep_is_not_its_own_base(
    call: Call, folder: Path, path: str, force: tuple[str, ...]
) -> None:
    (folder / "link.yaml").symlink_to("finger.yaml")
    result = call("init", "--sweep", path, *force)
    assert (result.exit_code, "give the sweep another name" in result.stderr) == (2, True)
    assert not (folder / "finger.yaml").exists()


def test_half_of_a_new_sweep_is_none(
    call: Call, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where the disk is full once one of both is there."""
    whole, paths = output.whole_file, []

    def failing(path: Path, *others: Any) -> Any:
        paths.append(path)
        if len(paths) > 1:
            raise OutputError(f"{path}: No space left on device")
        return whole(path, *others)

    monkeypatch.setattr(output, "whole_file", failing)
    result = call("init", "--sweep", "s.yaml")
    assert result.exit_code != 0
    assert "No space left" in result.stderr
    assert len(paths) == 2
    assert not (folder / "s.yaml").exists() and not (folder / "finger.yaml").exists()


def test_a_sweep_in_a_folder_has_its_base_there(call: Call, folder: Path) -> None:
    (folder / "studies").mkdir()
    assert call("init", "--sweep", "studies/wide.yaml").exit_code == 0
    assert {path.name for path in (folder / "studies").iterdir()} == {"wide.yaml", "finger.yaml"}
    assert call("validate", "studies/wide.yaml").exit_code == 0


def test_a_sweep_on_standard_output_is_alone(call: Call, folder: Path) -> None:
    printed = call("init", "--sweep", "-").stdout
    assert not (folder / "finger.yaml").exists()
    call("init", "--sweep")
    assert (folder / "sweep.yaml").read_text(encoding="utf-8") == printed


def test_every_axis_in_the_comments_of_a_new_sweep_is_right(call: Call, folder: Path) -> None:
    call("init", "--sweep")
    path = folder / "sweep.yaml"
    text = path.read_text(encoding="utf-8")
    (folder / "designs.csv").write_text("finger.geometry.limiting_layer_thickness_mm\n1.5\n2\n")
    whole = re.sub(r"^  # (?=- (?:key|paired|sample|table):|  +\w+[:.])", "  ", text, flags=re.M)
    path.write_text(whole, encoding="utf-8")
    assert call("validate", "sweep.yaml").output == "sweep.yaml: ok\n"
    plan = json.loads(call("explain", "sweep.yaml", "--format", "json").stdout)
    assert [axis["n_values"] for axis in plan["axes"]] == [5, 3, 3, 2, 2, 16, 2]
    assert 0 < plan["n_invalid"] + plan["n_excluded"] < plan["n_designs"]


def faults(value: Any, schema: dict[str, Any], root: dict[str, Any]) -> list[str]:
    """What is wrong with a value: the part of JSON Schema that the schema uses."""
    if "$ref" in schema:
        schema = root["$defs"][schema["$ref"].rpartition("/")[2]]
    if "anyOf" in schema:
        found = [faults(value, option, root) for option in schema["anyOf"]]
        if [] not in found:
            return found[0]
    kinds: dict[str, Any] = {
        "object": dict,
        "array": list,
        "integer": int,
        "number": (int, float),
        "string": str,
        "null": type(None),
    }
    if "type" in schema and not isinstance(value, kinds[schema["type"]]):
        return [f"{value!r} is not of type {schema['type']}"]
    wrong = []
    if isinstance(value, dict):
        known = schema.get("properties", {})
        others = schema.get("additionalProperties", True)
        patterns = schema.get("patternProperties", {})
        wrong += [f"{key} is missing" for key in schema.get("required", []) if key not in value]
        for key, item in value.items():
            if key in known:
                wrong += faults(item, known[key], root)
            elif free := [part for pattern, part in patterns.items() if re.search(pattern, key)]:
                wrong += faults(item, free[0], root)
            elif isinstance(others, dict):
                wrong += faults(item, others, root)
            elif not others:
                wrong.append(f"{key} is unknown")
    if isinstance(value, int | float):
        wrong += [
            f"{value} is out of bounds"
            for bound, is_wrong in (
                ("minimum", lambda low: value < low),
                ("maximum", lambda high: value > high),
            )
            if bound in schema and is_wrong(schema[bound])
        ]
    if "const" in schema and value != schema["const"]:
        wrong.append(f"{value} is not {schema['const']}")
    if "enum" in schema and value not in schema["enum"]:
        wrong.append(f"{value} is none of {schema['enum']}")
    return wrong


@pytest.mark.parametrize("path", CONFIGS, ids=lambda path: path.stem)
def test_the_schema_accepts_every_example(call: Call, path: Path) -> None:
    schema = json.loads(call("schema").stdout)
    spec = YAML(typ="safe", pure=True).load(path.read_text(encoding="utf-8"))
    assert faults(spec, schema, schema) == []


@pytest.mark.parametrize(
    "spec",
    [
        {},
        {"finger": {"linear_stiffness_N_per_mm": 1e4}},
        {"finger": {"units": 0, "linear_stiffness_N_per_mm": 1e4}},
        {"finger": {"units": 3, "linear_stiffness_N_per_mm": "1e4"}},
        {"finger": {"units": 3, "linear_stiffness_N_per_mm": 1e4, "bogus": 1}},
    ],
)
def test_the_schema_refuses_what_the_program_refuses(
    call: Call, folder: Path, spec: dict[str, Any]
) -> None:
    schema = json.loads(call("schema").stdout)
    assert faults(spec, schema, schema)
    (folder / "bad.yaml").write_text(json.dumps(spec), encoding="utf-8")
    assert call("validate", "bad.yaml").exit_code == 2


def test_every_key_of_the_schema_is_described(call: Call) -> None:
    schema = json.loads(call("schema").stdout)
    assert schema["$schema"].startswith("https://json-schema.org/")
    sections = [schema, *schema["$defs"].values()]
    bare = [
        key
        for section in sections
        for key, value in section.get("properties", {}).items()
        if "description" not in value
    ]
    assert bare == []


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_other_readers_of_yaml_find_the_same(path: Path) -> None:
    """By the rules of YAML 1.1, 1e4 and 1.0e4 are text: editors would then refuse our own specs."""
    yaml = pytest.importorskip("yaml")
    text = path.read_text(encoding="utf-8")
    theirs = yaml.safe_load(text)
    assert plain(theirs) == plain(YAML(typ="safe", pure=True).load(text))


def plain(value: Any) -> Any:
    """Data with keys as text, each value with its type."""
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list):
        return [plain(item) for item in value]
    return type(value).__name__, value


def test_other_readers_find_the_same_in_the_manual_and_in_calibrations(
    call: Call, folder: Path
) -> None:
    yaml = pytest.importorskip("yaml")
    pages = [*(ROOT / "dpgcli" / "manual").glob("*.md"), ROOT / "README.md"]
    texts = [page.read_text(encoding="utf-8") for page in pages]
    blocks = [b for text in texts for b in re.findall(r"^```yaml\n(.*?)^```$", text, re.M | re.S)]
    assert len(blocks) > 1
    (folder / "hinge.csv").write_text("moment_N_mm,rotation_rad\n0,0\n2.4,0.1\n4.800001,0.2\n")
    assert call("fit", "hinge", "hinge.csv", "-o", "hinge.yaml").exit_code == 0
    made = (folder / "hinge.yaml").read_text(encoding="utf-8")
    assert "e-0" in made
    for text in (*blocks, made):
        assert plain(yaml.safe_load(text)) == plain(YAML(typ="safe", pure=True).load(text))


@pytest.mark.parametrize("number", ["1e4", "1.0e4", "1.0e+4", "1E+4", "10000"])
def test_all_forms_of_a_number_are_read(call: Call, folder: Path, number: str) -> None:
    text = (folder / "three_unit.yaml").read_text()
    said = f"finger:\n  linear_stiffness_N_per_mm: {number}\n"
    (folder / "other.yaml").write_text(text.replace("finger:\n", said, 1))
    assert number in (folder / "other.yaml").read_text()
    assert call("predict", "other.yaml").stdout == call("predict", "three_unit.yaml").stdout


SHARED = """\
x-soft: &soft {dome_height_mm: 6.5, dome_thickness_mm: 0.75}
x-anything: [1, {2: 3}]
"""


def test_keys_of_the_user_hold_anchors(call: Call, folder: Path) -> None:
    text = (folder / "three_unit.yaml").read_text()
    shared = re.sub("    dome_height_mm: .*\n    dome_thickness_mm: .*\n", "    <<: *soft\n", text)
    assert "<<" in shared
    (folder / "three.yaml").write_text(SHARED + shared)
    assert call("predict", "three.yaml").stdout == call("predict", "three_unit.yaml").stdout
    schema = json.loads(call("schema").stdout)
    assert faults(YAML(typ="safe", pure=True).load(SHARED + shared), schema, schema) == []
    (folder / "sweep.yaml").write_text(
        "x-heights: &heights [6.0, 6.5]\nbase: three.yaml\n"
        "space: [{key: finger.geometry.dome_height_mm, values: *heights}]\n"
    )
    swept = call("sweep", "sweep.yaml", "-o", "out", "--executor", "serial")
    assert (swept.exit_code, "2 designs" in swept.stderr) == (0, True)


def test_only_the_top_level_has_keys_of_the_user(call: Call, folder: Path) -> None:
    text = (folder / "three_unit.yaml").read_text()
    (folder / "three.yaml").write_text(text.replace("finger:", "finger:\n  x-soft: 1", 1))
    refused = call("predict", "three.yaml")
    assert (refused.exit_code, "x-soft" in refused.stderr) == (2, True)
