"""How a dome's travel stands for a unit's opening: a mapping that no curve tells."""

import re
from typing import Self

from dpgcli.calibration.choices import Rule
from dpgcli.errors import Field, UsageError
from dpgcli.records import dataclass


def parse_number(text: str) -> float | None:
    """A number from zero on, None for anything else.

    >>> parse_number("3.5"), parse_number("-1"), parse_number("3,5")
    (3.5, None, None)
    """
    if not re.fullmatch(r"\s*[0-9]*(?:\.[0-9]*)?(?:[eE][-+]?[0-9]+)?\s*", text):
        return None
    try:
        value = float(text)
    except ValueError:
        return None
    return value if value < float("inf") else None


@dataclass(frozen=True)
class OpeningRule:
    """x = factor u: `amount` is the factor, or the opening (mm) of the inverted well."""

    rule: Rule
    amount: float = 1.0

    @classmethod
    def of(cls, text: str) -> Self:
        """The mapping in a text: equal, proportional:FACTOR or stroke:MM.

        Raises UsageError for anything else.

        >>> OpeningRule.of("stroke:3.5").amount
        3.5
        """
        rule, _, amount = text.partition(":")
        size = parse_number(amount)
        if text == Rule.EQUAL:
            return cls(Rule.EQUAL)
        if rule in (Rule.PROPORTIONAL, Rule.STROKE) and size:
            return cls(Rule(rule), size)
        raise UsageError(
            Field("travel_to_opening"),
            f" {text}: expected equal, proportional:FACTOR or stroke:MM, with a number > 0",
        )
