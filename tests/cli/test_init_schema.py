"""The spec to start from, and the schema for editors."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML

Call = Callable[..., Any]
CONFIGS = sorted((Path(__file__).parents[2] / "configs").glob("*.yaml"))


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
        wrong += [f"{key} is missing" for key in schema.get("required", []) if key not in value]
        for key, item in value.items():
            if key in known:
                wrong += faults(item, known[key], root)
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
