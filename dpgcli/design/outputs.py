"""What a finger's outputs rest on, as values: the basis of each, its known error, what is doubted.

`trust` decides them; tables, summaries and requirements only read them.
"""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, replace
from enum import StrEnum
from typing import Any

from dpgcli.records import dataclass
from dpgcli.text import enumerated


class Output(StrEnum):
    """The kinds of outputs, whatever columns have them."""

    SHAPES = "shapes"
    ENERGIES = "energies and barriers"
    BARRIERS = "barriers"
    GROUND = "ground stiffness"
    INVERTED = "inverted stiffness"
    AXIAL = "stiffness along the bars"
    PRESSURES = "pressures"
    FORCES = "forces"

    @property
    def key(self) -> str:
        """As calibration files name it.

        >>> Output.ENERGIES.key
        'energies_and_barriers'
        """
        return self.value.replace(" ", "_")


class Basis(StrEnum):
    """What an output rests on, from the most to the least trusted."""

    FITTED = "fitted"
    GIVEN = "given"
    PUBLISHED = "published"
    EXTRAPOLATED = "extrapolated"
    ASSUMED = "assumed"


BASES = tuple(Basis)
STIFFNESS = (Output.GROUND, Output.INVERTED)


@dataclass(frozen=True)
class Trust:
    """What one output rests on.

    `known_error` is what is known of its error, `source` where its values are from. `doubt` says
    why no design should be accepted, rejected or ranked by it, empty where nothing speaks against
    that; `instead` is what to do. `share` is said where it is not so for all designs of a space.
    """

    output: Output
    basis: Basis
    known_error: str
    source: str
    doubt: str = ""
    instead: str = ""
    share: str = ""

    @property
    def basis_text(self) -> str:
        """The basis, and of how many designs of a space it is."""
        return f"{self.basis} in {self.share}" if self.share else self.basis.value

    def __str__(self) -> str:
        """The output, its basis and the doubt.

        >>> str(Trust(Output.AXIAL, Basis.ASSUMED, "unknown", "", "of 1e4 N/mm", "give it"))
        'stiffness along the bars (assumed: of 1e4 N/mm; give it)'
        """
        instead = f"; {self.instead}" if self.instead else ""
        return f"{self.output} ({self.basis_text}: {self.doubt}{instead})"

    @property
    def record(self) -> dict[str, str]:
        """Its texts by name, for metadata and programs."""
        said = {name: str(text) for name, text in asdict(self).items()}
        return {"from" if name == "source" else name: text for name, text in said.items()}

    @classmethod
    def of_record(cls, record: Mapping[str, Any]) -> "Trust":
        """The value of a record. Raises KeyError, TypeError or ValueError for what is none."""
        texts = {name: record["from" if name == "source" else name] for name in FIELDS}
        if not all(isinstance(text, str) for text in texts.values()):
            raise TypeError("a record of trust holds texts")
        output, basis = Output(texts.pop("output")), Basis(texts.pop("basis"))
        return cls(output, basis, **texts)


FIELDS = tuple(Trust.__dataclass_fields__)


def gravest(trusts: Iterable[Trust]) -> Trust:
    """The one to be most careful with: one that is doubted, else the least trusted basis.

    >>> good = Trust(Output.SHAPES, Basis.PUBLISHED, "13–24 %", "")
    >>> gravest([good, replace(good, basis=Basis.FITTED)]).basis.value
    'published'
    """
    return max(trusts, key=lambda trust: (bool(trust.doubt), BASES.index(trust.basis)))


def doubts_about(columns: Mapping[str, Sequence[Trust]]) -> list[str]:
    """Why no design should be accepted, rejected or ranked by columns, in a line for each reason.

    The columns come with what the outputs that they show rest on; those that one may go by are
    left out.

    >>> bad = Trust(Output.SHAPES, Basis.ASSUMED, "", "", "a guess", "measure")
    >>> doubts_about({"reach_max_mm": [bad], "n_stable": [bad]})
    ['reach_max_mm and n_stable rest on shapes (assumed: a guess; measure)']
    """
    reasons: dict[str, list[str]] = {}
    for column, trusts in columns.items():
        doubted = " and ".join(str(trust) for trust in trusts if trust.doubt)
        reasons.setdefault(doubted, []).append(column)
    return [
        f"{enumerated(names)} rest{'s' * (len(names) == 1)} on {doubted}"
        for doubted, names in reasons.items()
        if doubted
    ]


def of_space(kinds: Sequence[tuple[tuple[Trust, ...], int]]) -> tuple[Trust, ...]:
    """What outputs of a space rest on, at worst, from what some numbers of designs have each.

    >>> good = Trust(Output.SHAPES, Basis.FITTED, "", "")
    >>> bad = replace(good, basis=Basis.EXTRAPOLATED, doubt="beyond its range")
    >>> str(of_space([((good,), 10), ((bad,), 3)])[0])
    'shapes (extrapolated in 3 of 13 designs: beyond its range)'
    """
    n_designs = sum(count for _, count in kinds)
    found: dict[Output, list[tuple[Trust, int]]] = {}
    for trusts, count in kinds:
        for trust in trusts:
            found.setdefault(trust.output, []).append((trust, count))
    return tuple(_at_worst(parts, n_designs) for parts in found.values())


def _at_worst(parts: Sequence[tuple[Trust, int]], n_designs: int) -> Trust:
    """The least trusted, in the words of most of them."""
    worst = gravest(trust for trust, _ in parts)
    alike: Counter[Trust] = Counter()
    for trust, count in parts:
        if (bool(trust.doubt), trust.basis) == (bool(worst.doubt), worst.basis):
            alike[trust] += count
    n_alike = alike.total()
    share = "" if n_alike == n_designs else f"{n_alike:,} of {n_designs:,} designs"
    return replace(alike.most_common(1)[0][0], share=share)
