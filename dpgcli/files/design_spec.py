"""A design as a spec of its own: a base with the design's values, complete in one file."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from dpgcli.errors import UsageError
from dpgcli.files.content import MAX_BYTES
from dpgcli.files.edits import sealed
from dpgcli.files.output import Mark, whole_file
from dpgcli.files.scene_file import Spec, canonical_json, checked, with_files
from dpgcli.files.scene_file.settings import changed
from dpgcli.files.yaml_file import MAX_NODES, Document, parse_document
from dpgcli.files.yaml_text import yaml_text
from dpgcli.text import printable

SWEEP = "dpg.sweep"
FIRST = "# Written by dpg: "  # its mark


def design_spec(base: Document, values: Mapping[str, float]) -> Spec:
    """The spec of a base, calibrations read, with values at dotted keys.

    Raises SpecError with all that is wrong with such a design.
    """
    return checked(changed(base, values))


def spec_text(spec: Spec, about: str) -> str:
    """A spec as a YAML file that needs no other, with what it is `about` in its first line.

    Raises UsageError where a spec's file has no room for its calibrations.
    """
    text = sealed(f"{FIRST}{printable(about)}", yaml_text(spec.model_dump(exclude_none=True)))
    n_bytes, n_values = len(text.encode()), _n_values(spec.model_dump(exclude_none=True))
    if n_bytes > MAX_BYTES or n_values > MAX_NODES:
        raise UsageError(
            f"{about}: with its calibrations the spec has {n_values:,} values in "
            f"{n_bytes // 1024:,} KiB, and a file has room for {MAX_NODES:,} in "
            f"{MAX_BYTES // 1024:,} KiB"
        )
    read = checked(with_files(parse_document("spec", text), Path()))
    assert canonical_json(read) == canonical_json(spec), "a file says what its spec says"
    return text


def write_spec(path: Path, spec: Spec, about: str, mark: Mark = Mark.SPEC) -> None:
    """Write a spec as `spec_text` has it, in the place of nothing but such a file as it was."""
    text = spec_text(spec, about)
    with whole_file(path, mark) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")


def swept_base(metadata: Mapping[str, str], name: str = "base") -> Document:
    """The base spec that a sweep's table keeps; `name` is what messages call it.

    Raises UsageError where it keeps none.
    """
    try:
        data = Spec.model_validate(base_of(metadata)).model_dump(exclude_none=True)
    except ValidationError:
        kept = "no base spec is kept in the table's metadata, where dpg sweep writes it"
        raise UsageError(f"{name}: {kept}") from None
    return with_files(Document(name, data, {}), Path())


def base_of(metadata: Mapping[str, str]) -> dict[str, Any]:
    """The data of the base spec; empty where they are not there or not to be read."""
    try:
        base: Any = json.loads(json.loads(metadata[SWEEP])["base"])
        return base if isinstance(base["finger"], dict) else {}
    except (KeyError, TypeError, ValueError, RecursionError):
        return {}


def _n_values(data: Any) -> int:
    """Values of plain data, sections and lists among them."""
    parts = data.values() if isinstance(data, dict) else data if isinstance(data, list) else ()
    return 1 + sum(map(_n_values, parts))
