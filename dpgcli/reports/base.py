"""What a table of designs was made from, as its metadata say: base spec, law, calibration."""

import math
from collections.abc import Iterator, Mapping
from typing import Any

from dpgcli.design.calibrations import PUBLISHED
from dpgcli.design.dimensions import LINEAR_STIFFNESS
from dpgcli.design.resolve import NEARLY_RIGID
from dpgcli.files.design_spec import base_of
from dpgcli.files.parts import BASE

LAW = "dpg.law"


def base_lines(metadata: Mapping[str, str]) -> Iterator[str]:
    """Base spec, law and calibration in words; none of a table without such metadata.

    >>> import json
    >>> base = json.dumps({"finger": {"units": 3}})
    >>> said = {"dpg.sweep": json.dumps({"base": base}), BASE: "a.yaml", LAW: "published law"}
    >>> list(base_lines(said))
    ['Base spec: a.yaml (units 3).', 'Law: published law. Calibration: none.']
    """
    base = base_of(metadata)
    if not base:
        return
    values = ", ".join(
        f"{key.removeprefix('finger.').removeprefix('geometry.')} {value}"
        for key, value in _numbers(base)
    )
    yield f"Base spec: {metadata.get(BASE, 'unnamed')} ({values})."
    names = ", ".join(_names(base)) or "none"
    yield f"Law: {metadata.get(LAW, 'unknown')}. Calibration: {names}."


def bar_stiffness(metadata: Mapping[str, str]) -> float:
    """The stiffness of the base's bars, N/mm; NaN where nothing says what the base is."""
    base = base_of(metadata)
    if not base:
        return math.nan
    finger = base["finger"]
    said = finger.get(LINEAR_STIFFNESS)
    for part in _calibrations(base):
        if said is None and isinstance(part, dict):
            said = (part.get("values") or {}).get(LINEAR_STIFFNESS, {}).get("value")
    return float(str(NEARLY_RIGID if said is None else said).replace(".inf", "inf"))


def _calibrations(base: Mapping[str, Any]) -> list[Any]:
    said = base["finger"].get("calibration")
    return said if isinstance(said, list) else [said]


def _names(base: Mapping[str, Any]) -> Iterator[str]:
    for part in _calibrations(base):
        if part == PUBLISHED:
            yield PUBLISHED
        elif isinstance(part, dict):
            yield str(part.get("file") or "unnamed")


def _numbers(section: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, str]]:
    """Numbers by dotted key, as text, and short lists of them; calibrations left out."""
    for key, value in section.items():
        if isinstance(value, dict) and key != "calibration":
            yield from _numbers(value, f"{prefix}{key}.")
        elif isinstance(value, int | float):
            yield f"{prefix}{key}", f"{value:g}"
        elif isinstance(value, list) and all(isinstance(part, int | float) for part in value):
            yield f"{prefix}{key}", "/".join(f"{part:g}" for part in value)
