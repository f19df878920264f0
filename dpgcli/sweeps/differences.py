"""Differences between the metadata of two runs."""

import json
from typing import Any


def differences(old: dict[str, str], new: dict[str, str]) -> list[str]:
    """Dotted keys in which two sweeps' metadata differ; JSON texts are looked into."""
    plain = [
        {key: _parsed(text) for key, text in said.items() if key != "dpg.fingerprint"}
        for said in (old, new)
    ]
    return [path.removeprefix("dpg.") for path in _changes(plain[0], plain[1])]


def _parsed(text: str) -> Any:
    """A JSON text as data, JSON texts within it too; other text as it is."""
    try:
        data = json.loads(text)
    except ValueError:
        return text
    if isinstance(data, dict):
        return {k: _parsed(v) if isinstance(v, str) else v for k, v in data.items()}
    return data


def _changes(old: Any, new: Any, path: str = "") -> list[str]:
    if isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        old, new = (dict(enumerate(part)) for part in (old, new))
    if isinstance(old, dict) and isinstance(new, dict):
        return [
            change
            for key in sorted({*old, *new})
            for change in _changes(old.get(key), new.get(key), f"{path}.{key}".lstrip("."))
        ]
    return [] if old == new else [path]
