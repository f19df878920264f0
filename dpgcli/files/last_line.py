"""The SHA-256 of a text in its own last line, a comment: what was cut off or edited shows.

Text has no end of its own: a YAML or CSV file that lacks its second half is one as well.
"""

import hashlib
import re

from dpgcli.files.seal import KEY

LINE = re.compile(rf"^# {re.escape(KEY)}: ([0-9a-f]{{64}})\s*\Z", re.MULTILINE)


def sealed(text: str) -> str:
    """The text with a last line that says its SHA-256.

    >>> sealed("a: 1\\n").splitlines()[-1][:28]
    '# dpg.file_sha256: 37b128c59'
    """
    return f"{text}# {KEY}: {_sha256(text)}\n"


def is_whole_text(text: str) -> bool | None:
    """Whether a text is as it was sealed, however its lines end; None without a last line.

    >>> whole = sealed("a: 1\\n")
    >>> is_whole_text(whole), is_whole_text("b" + whole), is_whole_text(whole[:-9])
    (True, False, None)
    """
    found = LINE.search(text)
    return None if found is None else found[1] == _sha256(text[: found.start()])


def _sha256(text: str) -> str:
    return hashlib.sha256(text.replace("\r\n", "\n").encode()).hexdigest()
