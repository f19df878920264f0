"""Units that data come in: how many of ours one of them is."""

import math
import re
from collections.abc import Mapping

from dpgcli.errors import Field, Message, UsageError

MICRO = ("u", "\u00b5", "\u03bc")  # as people type it, the micro sign and the Greek letter
POUND_FORCE = 4.4482216152605  # N, by definition

OWN = {
    "travel": "mm",
    "force": "N",
    "energy": "mJ",
    "pressure": "MPa",
    "volume": "mm3",
    "time": "s",
    "moment": "N mm",
    "rotation": "rad",
}
FACTORS: Mapping[str, Mapping[str, float]] = {
    "travel": {"mm": 1, "m": 1e3, "cm": 10, "nm": 1e-6, "in": 25.4, "inch": 25.4}
    | {f"{u}m": 1e-3 for u in MICRO},
    "force": {"N": 1, "kN": 1e3, "mN": 1e-3, "MN": 1e6, "cN": 1e-2, "daN": 10}
    | {f"{u}N": 1e-6 for u in MICRO}
    | {"lbf": POUND_FORCE, "kgf": 9.80665, "gf": 9.80665e-3, "kp": 9.80665},
    "energy": {"mJ": 1, "J": 1e3, "kJ": 1e6, "Nmm": 1, "Nm": 1e3} | {f"{u}J": 1e-3 for u in MICRO},
    "pressure": {"MPa": 1, "kPa": 1e-3, "Pa": 1e-6, "GPa": 1e3, "hPa": 1e-4, "N/mm2": 1}
    | {"bar": 0.1, "mbar": 1e-4, "psi": POUND_FORCE / 25.4**2},
    "volume": {"mm3": 1, "cm3": 1e3, "m3": 1e9, "ml": 1e3, "mL": 1e3, "l": 1e6, "L": 1e6}
    | {f"{u}{litre}": 1 for u in MICRO for litre in "lL"},
    "time": {"s": 1, "sec": 1, "Sec": 1, "ms": 1e-3, "min": 60, "h": 3600},
    "moment": {"Nmm": 1, "Nm": 1e3, "mNm": 1, "kNmm": 1e3, "Ncm": 10},
    "rotation": {"rad": 1, "mrad": 1e-3, "deg": math.pi / 180, "\u00b0": math.pi / 180},
}
PAIRS = ("()", "[]", "<>", "{}", "\uff08\uff09", "\u3010\u3011")  # the last in East Asia
OPEN, CLOSE = (tuple(re.escape(pair[side]) for pair in PAIRS) for side in (0, 1))
BRACKETED = re.compile("|".join(f"{a}(.*){b}" for a, b in zip(OPEN, CLOSE, strict=True)))
IN_BRACKETS = "|".join(f"{a}([^{a}{b}]*){b}" for a, b in zip(OPEN, CLOSE, strict=True))
IN_NAME = re.compile(rf"(?P<name>.*\S)\s*(?:{IN_BRACKETS}|\s(?:/|in)\s*(?P<bare>\S+))")
KNOWN = frozenset(unit for units in FACTORS.values() for unit in units)
WORDS = "|".join([*sorted(filter(str.isidentifier, KNOWN)), "[cm]?m2"])
IN_KEY = re.compile(rf"(.+?)_((?:{WORDS})(?:_(?:per_)?(?:{WORDS}))*)")
SAID_BY_KEY = {"seconds": "s", "force_linearity": ""}  # keys whose unit does not end them
NO_UNIT = ("-", "1")


def factor_of(quantity: str, unit: str) -> float | None:
    """What a number in a unit is multiplied by to be in ours; None for a unit that is not known.

    >>> factor_of("force", "kN"), factor_of("moment", "N*m"), factor_of("force", "mm")
    (1000.0, 1000.0, None)
    """
    factor = FACTORS[quantity].get(plain_unit(unit))
    return None if factor is None else float(factor)


def is_unit(text: str) -> bool:
    """Whether a text is a unit: one that is known, a quotient of such, or what is in brackets.

    >>> is_unit("kN"), is_unit("N mm/rad"), is_unit("[V]"), is_unit("Load")
    (True, True, True, False)
    """
    plain = plain_unit(text)
    is_known = plain in KNOWN or KNOWN.issuperset(plain.split("/"))
    return is_known or BRACKETED.fullmatch(text) is not None


def bare(unit: str) -> str:
    """A unit without its brackets.

    >>> bare("(kN)"), bare("mm")
    ('kN', 'mm')
    """
    match = BRACKETED.fullmatch(unit)
    return unit if match is None else next(part for part in match.groups() if part is not None)


def name_and_unit(title: str) -> tuple[str, str]:
    """A column's title as its name and the unit behind it, if there is one.

    >>> name_and_unit("Load (kN)"), name_and_unit("Kraft in N"), name_and_unit("Load")
    (('Load', 'kN'), ('Kraft', 'N'), ('Load', ''))
    """
    match = IN_NAME.fullmatch(title)
    if match is None:
        return title, ""
    _, *units = match.groups()
    unit = next(unit for unit in units if unit is not None).strip()
    if match["bare"] is not None and not is_unit(unit):  # no unit, but words
        return title, ""
    return match["name"], unit


def stem_and_unit(key: str) -> tuple[str, str | None]:
    """A key without its unit, and the unit as it is written; None where the key says none.

    >>> stem_and_unit("moment_N_mm"), stem_and_unit("hinge_stiffness_N_mm_per_rad")
    (('moment', 'N mm'), ('hinge_stiffness', 'N mm/rad'))
    >>> stem_and_unit("force_linearity"), stem_and_unit("pattern")
    (('force_linearity', ''), ('pattern', None))
    """
    match = IN_KEY.fullmatch(key)
    if match is None:
        return key, SAID_BY_KEY.get(key)
    return match[1], match[2].replace("_per_", "/").replace("_", " ")


def is_same(unit: str, own: str) -> bool:
    """Whether a number is the same in both units; where there is none, of what has none.

    >>> is_same("mN m", "N mm"), is_same("N cm", "N mm"), is_same("-", ""), is_same("%", "")
    (True, False, True, False)
    """
    if not own:
        return unit in NO_UNIT
    factors = (
        (units.get(plain_unit(unit)), units.get(plain_unit(own))) for units in FACTORS.values()
    )
    return plain_unit(unit) == plain_unit(own) or any(a is not None and a == b for a, b in factors)


def are_alike(unit: str, other: str) -> bool:
    """Whether both are units of one quantity, or of none that is known.

    >>> are_alike("cm", "mm"), are_alike("N/m", "N/mm"), are_alike("min", "mm")
    (True, True, False)
    """
    ours, theirs = (
        {quantity for quantity, units in FACTORS.items() if plain_unit(text) in units}
        for text in (unit, other)
    )
    return bool(ours & theirs) or not ours | theirs


def units_in(texts: Mapping[str, str], quantities: Mapping[str, str]) -> dict[str, float]:
    """Factors by quantity, of the units that somebody gave; `quantities` are those of the columns.

    Raises UsageError for what is no such quantity, or no unit of it.
    """
    known = tuple(dict.fromkeys(quantities.values()))
    for quantity, unit in texts.items():
        if quantity not in known:
            expected = f"expected one of {', '.join(known)} before the ="
            raise UsageError(Field("units"), f" {quantity}={unit}: {expected}")
        if factor_of(quantity, unit) is None:
            raise UsageError(Field("units"), f" {quantity}={unit}: expected {listed(quantity)}")
    return {quantity: factor_of(quantity, unit) or 0.0 for quantity, unit in texts.items()}


def listed(quantity: str) -> str:
    """The units of a quantity in words.

    >>> listed("rotation")
    'a unit of rotation: rad, mrad, deg or °'
    """
    *most, last = (unit for unit in FACTORS[quantity] if not unit.startswith(MICRO[1:]))
    return f"a unit of {quantity}: {', '.join(most)} or {last}"


def plain_unit(unit: str) -> str:
    """A unit without brackets and what stands between its parts.

    >>> plain_unit("[N·mm]"), plain_unit("N/mm^2"), plain_unit("mm³")
    ('Nmm', 'N/mm2', 'mm3')
    """
    text = bare(unit.strip()).translate(str.maketrans("\u00b2\u00b3", "23", "^*\u00b7 ."))
    return re.sub(r"(?<=N)-(?=[cm]?m)", "", text)


def asked_for(quantity: str) -> Message:
    """What answers the question for a quantity's unit."""
    said = f"{quantity}={OWN[quantity]}"
    return Message(Field("units"), f" '{said}'" if " " in said else f" {said}")
