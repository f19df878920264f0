"""Units as people write them into titles: anywhere, in words, in capitals, behind underscores."""

import re
import unicodedata
from collections.abc import Iterable, Iterator

from dpgcli.files.units import (
    KNOWN,
    NO_UNIT,
    are_alike,
    is_same,
    is_unit,
    name_and_unit,
    plain_unit,
)

WEIGHTS = ("g", "kg", "mg", "lb", "lbs", "oz", "ozf", "dyn")
FOREIGN = frozenset((*WEIGHTS, "ft", "mil", "thou", "gon", "%", "V", "mV"))  # none of ours
FOLDED = frozenset(unit.casefold() for unit in KNOWN | FOREIGN)
KINDS = (
    "newton|kilopond|dyne|pascal|bar|joule|liter|litre|litro|volt|percent|prozent",
    "gram|gramm|gramme|gramo|pound|pfund|ounce|unze|libra|livre|lb",
    "meter|metre|metro|micron|inch|inche|zoll|pouce|pulgada|pollice|foot|feet",
    "second|sekunde|seconde|segundo|secondo|minute|minuto|hour|stunde|heure|hora|ora",
    "radian|radiant|degree|grad|grado|degre",
)
PREFIX = "giga|mega|kilo|he[ck]to|de[ck]a|de[cz]i|[cz]enti|mill?i|mi[ck]ro|nano"
ONE = f"(?:{PREFIX})?(?:{'|'.join(KINDS)})(?:s|e?n)?"
BETWEEN = "(?:per|pro|por|par|square|cubic|quadrat|kubik|force|weight)"
WORDS = re.compile(
    rf"(?:{BETWEEN}[ -]?)?{ONE}(?:[ /-]?(?:{BETWEEN}[ -]?)*{ONE})*(?:[ -]?(?:force|weight))?"
)
TOKEN = re.compile(r"[^\W_]+|[°%]")
SYMBOLS = frozenset("shlLgV")  # of a travel, a height, a volume: alone they are a name
PREPOSITION = "in"  # but at the end
LONGEST, MOST_WORDS = 60, 6  # letters of a unit, and its words


def names_unit(text: str) -> bool:
    """Whether a text is a unit, be it in words, in capitals or one that is none of ours.

    >>> names_unit("kN"), names_unit("Newtonmeter"), names_unit("MM"), names_unit("Load")
    (True, True, True, False)
    """
    if is_unit(text):
        return True
    letters = unicodedata.normalize("NFKD", text[: LONGEST + 1].casefold())
    without_accents = "".join(c for c in letters if not unicodedata.combining(c))
    is_other = text in FOREIGN or (len(text) > 1 and text.casefold() in FOLDED)
    return is_other or (len(text) <= LONGEST and WORDS.fullmatch(without_accents) is not None)


def are_units(cells: Iterable[str]) -> bool:
    """Whether the cells of a row are units, or say that there is none: one of them at least is one.

    >>> are_units(["N m", "1", ""]), are_units(["", "centimeters"]), are_units(["1", "-"])
    (True, True, False)
    >>> are_units(["Gauge length", "1", "mm"])
    False
    """
    said = [cell for cell in cells if cell and cell not in NO_UNIT]
    return bool(said) and all(map(names_unit, said))


def unit_in(title: str) -> str:
    """What a title says of its column's unit: behind its name, else anywhere; all that differ.

    What is said twice, and not alike, is no unit that is known: it will be asked about.

    >>> unit_in("Moment_Nm"), unit_in("M [Nm] x"), unit_in("loadkN"), unit_in("Load 1")
    ('Nm', 'Nm', 'kN', '')
    >>> unit_in("Load_kN (N)"), unit_in("Load min [N]")
    ('N and kN', 'N')
    """
    name, behind = name_and_unit(title)
    within = _units_in(name, may_end_in=not behind)
    if not behind:
        return together(within)
    return together([behind, *(unit for unit in within if are_alike(unit, behind))])


def together(units: Iterable[str]) -> str:
    """Units that are said of one column, each once.

    >>> together(["mm", "", "mm"]), together(["Nm", "N m"]), together(["cm", "mm"])
    ('mm', 'Nm', 'cm and mm')
    """
    kept: list[str] = []
    for unit in filter(None, units):
        if not any(plain_unit(unit) == plain_unit(other) or is_same(unit, other) for other in kept):
            kept.append(unit)
    return " and ".join(kept)


def _units_in(title: str, *, may_end_in: bool) -> Iterator[str]:
    """The longest runs of words in a title that are units."""
    words = [place for match in TOKEN.finditer(title) for place in _humps(*match.span(), title)]
    begin = 0
    while begin < len(words):
        for end in range(min(begin + MOST_WORDS, len(words)), begin, -1):
            text = title[words[begin][0] : words[end - 1][1]]
            text = text.replace("_per_", "/").replace("_", " ")
            if _counts(text, title, is_last=may_end_in and end == len(words)):
                yield text
                begin = end - 1
                break
        begin += 1


def _counts(text: str, title: str, *, is_last: bool) -> bool:
    """Whether a part of a title is a unit there: of M N m only the N m."""
    if text == title and text in SYMBOLS:
        return False
    is_one = names_unit(text) and names_unit(text.partition(" ")[0])
    return is_one and (is_last or text.casefold() != PREPOSITION)


def _humps(begin: int, end: int, title: str) -> Iterator[tuple[int, int]]:
    """The places of a word, cut before a unit that begins within it, as in forceN."""
    word = title[begin:end]
    cuts = (
        begin + n
        for n in range(max(1, len(word) - LONGEST), len(word))
        if word[n - 1].islower() and not word[n:].islower() and names_unit(word[n:])
    )
    cut = begin if names_unit(word) else next(cuts, begin)
    if cut > begin:
        yield begin, cut
    yield cut, end
