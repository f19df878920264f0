"""Differences between the metadata of two runs."""

import json
import re
from typing import Any

CALIBRATION = re.compile(r"\bcalibration(\.\d+)?\Z")


def differences(old: dict[str, str], new: dict[str, str]) -> list[str]:
    """Dotted keys in which two sweeps' metadata differ; JSON texts are looked into.

    Of a calibration that differs in several it is its name and their number.

    >>> fitted = {"calibration": {"file": "dome.yaml", "method": "fit", "values": {"stroke_mm": 3}}}
    >>> again = {"calibration": {"file": "dome.yaml", "method": "fix", "values": {"stroke_mm": 4}}}
    >>> differences({"dpg.base": json.dumps(fitted)}, {"dpg.base": json.dumps(again)})
    ['base.calibration (dome.yaml: 2 keys)']
    """
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
        found = [
            change
            for key in sorted({*old, *new})
            for change in _changes(old.get(key), new.get(key), f"{path}.{key}".lstrip("."))
        ]
        is_one = CALIBRATION.search(path) is not None and "file" in new
        return [f"{path} ({new['file']}: {len(found)} keys)"] if is_one and found[1:] else found
    return [] if old == new else [path]
