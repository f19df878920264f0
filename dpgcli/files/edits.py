"""Specs say what they held when they were written, so that those that people edited are told."""

import hashlib
import re
from pathlib import Path

UNTIL = "# It may be replaced until it is edited: all but this line has the SHA-256 "
SEAL = re.compile(rb"\A([^\n]*\n)" + re.escape(UNTIL.encode()) + rb"([0-9a-f]{64})\n")


def sealed(first: str, body: str) -> str:
    """A text of a first line and a body, with the SHA-256 of both between them."""
    seal = hashlib.sha256(f"{first}\n{body}".encode()).hexdigest()
    return f"{first}\n{UNTIL}{seal}\n{body}"


def is_edited(path: Path) -> bool:
    """Whether a file is no more as `sealed` made it; one that is empty has nothing to lose."""
    content = path.read_bytes()
    said = SEAL.match(content)
    if said is None:
        return bool(content)
    return hashlib.sha256(said[1] + content[said.end() :]).hexdigest().encode() != said[2]
