"""Plain data as the text of a YAML file."""

import io
from typing import Any

from ruamel.yaml import YAML


def yaml_text(data: dict[str, Any]) -> str:
    """Data as YAML, keys in their order: the same data give the same text.

    >>> print(yaml_text({"finger": {"units": 3, "lattice": {"stroke_mm": 3.5}}}), end="")
    finger:
      units: 3
      lattice: {stroke_mm: 3.5}
    """
    yaml = YAML(typ="safe", pure=True)
    yaml.default_flow_style = None  # leaves on one line, sections on several
    yaml.sort_base_mapping_type_on_output = False  # type: ignore[assignment]  # typed None
    yaml.width = 110
    yaml.allow_unicode = True
    text = io.StringIO()
    yaml.dump(data, text)
    return text.getvalue()
