"""Text from outside made fit to print: nothing in it moves a cursor or ends a line."""

import re
from collections.abc import Sequence
from math import isfinite
from numbers import Real
from typing import TypeGuard

KeyPath = tuple[str | int, ...]

MAX_SHOWN = 60
LONGEST, GAP = 2000, " [..] "  # characters of a line of a message, of which the middle is cut
NUMBER = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")
COMMAND = re.compile(r"(^\s*):(?=:)|(#)#(?=\w*\[)")


def printable(text: str) -> str:
    """Text in one line, escaped where a terminal would obey it rather than show it.

    Control characters, line ends and marks of writing direction are spelled out.

    >>> printable("a\\x1b[2Jb\\n\\u202ec é")
    'a\\\\x1b[2Jb\\\\n\\\\u202ec é'
    """
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


def inert(line: str) -> str:
    """A line that the runner of a workflow shows, where it would take a name for a command.

    GitHub's obeys a line that begins with `::name`, blanks aside, and like that of Azure
    `##[name]` or `##vso[name]` anywhere in it.

    >>> inert("::stop-commands::x.yaml: ok"), inert("a##[add-mask]b"), inert("# a::b")
    ('\\\\x3a:stop-commands::x.yaml: ok', 'a#\\\\x23[add-mask]b', '# a::b')
    """
    if "::" not in line and "##" not in line:  # as nearly all, of a million rows
        return line
    return COMMAND.sub(
        lambda found: rf"{found[1] or ''}\x3a" if found[2] is None else r"#\x23", line
    )


def control_character(name: str) -> str:
    """The first control character in a name, spelled out; empty if there is none.

    >>> control_character("a\\tb"), control_character("größe 1.csv")
    ('\\\\t', '')
    """
    return next((ascii(c)[1:-1] for c in name if c < " " or "\x7f" <= c < "\xa0"), "")


def number_in(text: str) -> float:
    """The number that people read in a text, NaN where there is none: float takes 1_0 for 10.

    >>> number_in(" -0.75"), number_in("1_0"), number_in("１０")
    (-0.75, nan, nan)
    """
    return float(text) if NUMBER.fullmatch(text.strip()) else float("nan")


def is_number(value: object) -> TypeGuard[float]:
    """Whether a value is a number, and not beyond those with a decimal point.

    >>> is_number(2), is_number(True), is_number("2"), is_number(10**400)
    (True, False, False, False)
    """
    if not isinstance(value, Real) or isinstance(value, bool):
        return False
    try:
        float(value)
    except OverflowError:  # whole numbers, and fractions of them
        return False
    return True


def is_finite(value: object) -> TypeGuard[float]:
    """Whether a value is a number as `is_number` has it, and neither infinite nor NaN."""
    return is_number(value) and isfinite(value)


def quoted(value: object) -> str:
    """Whatever somebody handed in, as Python writes it, cut; its type where Python cannot.

    >>> quoted("a"), quoted(10**5000)
    ("'a'", 'an int that cannot be written')
    """
    try:
        return shortened(repr(value))
    except Exception:  # of more than 4,300 digits, too deep, or what somebody's class raises
        kind = type(value).__name__
        return f"a{'n' * (kind[:1].lower() in 'aeiou')} {kind} that cannot be written"


def dotted(path: KeyPath) -> str:
    """A key path as people write it: `finger.overrides.4-5`."""
    return ".".join(shortened(str(part)) for part in path) or "document"


def shortened(text: str, limit: int = MAX_SHOWN) -> str:
    """Text fit for one line of a message: printable, and cut where it is long.

    >>> shortened("a" * 100, 10)
    'aaaaaaa...'
    """
    head = printable(text[: limit + 1])
    return head if len(head) <= limit else head[: limit - 3] + "..."


def legible(text: str) -> str:
    """Lines fit to print, each printable and without its middle where it is long.

    >>> legible("a\\x1b[2J\\nb"), len(legible("a" * 500_000))
    ('a\\\\x1b[2J\\nb', 2000)
    """
    return "\n".join(map(_legible, text.split("\n")))


def _legible(line: str) -> str:
    half = (LONGEST - len(GAP)) // 2
    if len(line) > 2 * LONGEST:  # which is not made longer first
        line = f"{line[:LONGEST]}{line[-LONGEST:]}"
    line = printable(line)
    return line if len(line) <= LONGEST else f"{line[:half]}{GAP}{line[-half:]}"


def enumerated(words: Sequence[str]) -> str:
    """Words as a sentence has them.

    >>> enumerated(["a"]), enumerated(["a", "b", "c"])
    ('a', 'a, b and c')
    """
    return " and ".join(part for part in (", ".join(words[:-1]), words[-1]) if part)


def counted(number: int, what: str) -> str:
    """A number of things.

    >>> counted(1, "design"), counted(2500, "design")
    ('1 design', '2,500 designs')
    """
    return f"{number:,} {what}{'s' * (number != 1)}"
