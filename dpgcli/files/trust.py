"""What a table's columns rest on, in its metadata: of each column, and of each kind of output."""

import json
from collections.abc import Mapping, Sequence
from typing import Any

from dpgcli.design.outputs import Output, Trust, gravest

TRUST, WARNINGS = "dpg.trust", "dpg.warnings"
OUTPUTS, BASIS = b"outputs", b"basis"
NAMES = frozenset(map(str, Output))


def trust_metadata(trusts: Sequence[Trust], warnings: Sequence[str]) -> dict[str, str]:
    """What outputs rest on, and the warnings of calibrations in use, as JSON by name."""
    records = [trust.record for trust in trusts]
    return {TRUST: json.dumps(records), WARNINGS: json.dumps([*warnings])}


def trusts_in(metadata: Mapping[str, str]) -> dict[Output, Trust]:
    """What outputs rest on, by output; none where the metadata do not say it.

    >>> trusts_in({TRUST: "[]"}), trusts_in({TRUST: "{"})
    ({}, {})
    """
    try:
        trusts = [Trust.of_record(record) for record in json.loads(metadata[TRUST])]
    except (KeyError, TypeError, ValueError, RecursionError):
        return {}
    return {trust.output: trust for trust in trusts}


def warnings_in(metadata: Mapping[str, str]) -> list[str]:
    """The warnings of calibrations that a table's metadata have."""
    try:
        found = json.loads(metadata[WARNINGS])
    except (KeyError, ValueError, RecursionError):
        return []
    return [text for text in found if isinstance(text, str)] if isinstance(found, list) else []


def with_bases(described: Any, metadata: Mapping[str, str]) -> Any:
    """A schema whose fields say the basis of their column, the least trusted of its outputs."""
    import pyarrow as pa

    known = trusts_in(metadata)
    fields = []
    for field in described:
        trusts = [known[output] for output in outputs_of(field) if output in known]
        said = {BASIS: gravest(trusts).basis.value.encode()} if trusts else {}
        fields.append(field.with_metadata({**(field.metadata or {}), **said}))
    return pa.schema(fields)


def outputs_of(field: Any) -> tuple[Output, ...]:
    """The kinds of outputs that a column shows, as its field says."""
    said = (field.metadata or {}).get(OUTPUTS, b"").decode(errors="replace")
    return tuple(Output(name) for name in said.split(", ") if name in NAMES)
