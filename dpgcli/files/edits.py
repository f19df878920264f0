"""Specs say what they held when they were written, so that those that people edited are told."""

import hashlib
import re
from pathlib import Path

SEAL = re.compile(rb"\A[^\n]*\n# [^\n]* SHA-256 ([0-9a-f]{64})\n")
UNTIL = "# It may be replaced until it is edited: what follows has the SHA-256 "


def sealed(first: str, body: str) -> str:
    """A text of a first line and a body, with the SHA-256 of the body between them."""
    return f"{first}\n{UNTIL}{hashlib.sha256(body.encode()).hexdigest()}\n{body}"


def is_edited(path: Path) -> bool:
    """Whether a file is no more as `sealed` made it; one that is empty has nothing to lose."""
    content = path.read_bytes()
    said = SEAL.match(content)
    if said is None:
        return bool(content)
    return hashlib.sha256(content[said.end() :]).hexdigest().encode() != said[1]
