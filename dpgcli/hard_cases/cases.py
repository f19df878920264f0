"""Stiff and extreme cases: the families of `families` around a finger, each case a state to find.

A family pushes one thing away from a base finger of few units and asks for a few patterns of
each variant, by both formulations where bars are elastic.
"""

from collections.abc import Iterator, Sequence
from itertools import product

import numpy as np

from dpgcli.arrays import Flags
from dpgcli.errors import Field, UsageError
from dpgcli.hard_cases.families import FAMILIES, PATTERNS
from dpgcli.hard_cases.variants import Family, Start, Variant, few_patterns
from dpgcli.mechanics.finger import STUDY, Finger, uniform_finger
from dpgcli.mechanics.laws import Published
from dpgcli.records import dataclass
from dpgcli.states.plan import FORMULATIONS

BUILT_IN, GIVEN = "built-in", "spec"


def check_law(finger: Finger) -> None:
    """Raise UsageError for domes of another law than the energy in extended precision has."""
    if not isinstance(finger.law, Published):
        raise UsageError(
            f"the reference in extended precision has the published law only, not the "
            f"{finger.law.description}: take ",
            Field("setting"),
            " finger.law=published",
        )


@dataclass(frozen=True)
class Case:
    """A state to find: the pattern of a variant by one formulation.

    `subject` names the base finger: the built-in one or the spec's.
    """

    subject: str
    family: str
    variant: Variant
    pattern: str
    formulation: str

    @property
    def inverted(self) -> Flags:
        """The pattern as flags, (unit, 1); of two fingers those of the upper one first."""
        return np.array([[digit == "1"] for digit in self.pattern.replace("/", "")])

    @property
    def has_own_guess(self) -> bool:
        """Whether the search starts at the solver's own guess."""
        return self.variant.start == Start()


def study_finger() -> Finger:
    """The study's finger of three units with bars of 1e4 N/mm."""
    return uniform_finger(3, **STUDY, linear_stiffness=1e4)


def all_cases(finger: Finger | None = None, only: Sequence[str] = ()) -> list[Case]:
    """The cases of a finger, if there is one, then the built-in ones; `only` names families.

    Raises UsageError for a finger of another law than the published one.
    """
    if finger is not None:
        check_law(finger)
    own = [] if finger is None else cases_of(finger, only)
    return [*own, *built_in_cases(only)]


def built_in_cases(only: Sequence[str] = ()) -> Iterator[Case]:
    """Every family around the study's finger; `only` names families.

    >>> case = next(built_in_cases())
    >>> case.family, case.variant.label, case.pattern, case.formulation
    ('stiffness', 'k_L/k_b = 1e0', '111', 'chain')
    """
    for family in _with_names(FAMILIES, only):
        yield from _cases(BUILT_IN, family, study_finger())


def cases_of(finger: Finger, only: Sequence[str] = ()) -> Iterator[Case]:
    """States of a finger, then every family around its first, middle and last unit."""
    n = finger.n_units
    few = finger.with_units(sorted({0, n // 2, n - 1}))
    for family in _with_names((PATTERNS, *FAMILIES), only):
        yield from _cases(GIVEN, family, finger if family is PATTERNS else few)


def check_families(names: Sequence[str]) -> None:
    """Raise UsageError for names that no family has."""
    known = [family.name for family in (PATTERNS, *FAMILIES)]
    unknown = [name for name in names if name not in known]
    if unknown:
        raise UsageError(
            Field("only"), f" {', '.join(unknown)}: expected some of {', '.join(known)}"
        )


def _with_names(families: Sequence[Family], only: Sequence[str]) -> Iterator[Family]:
    return (family for family in families if not only or family.name in only)


def _cases(subject: str, family: Family, base: Finger) -> Iterator[Case]:
    for variant in family.variants(base):
        patterns = variant.patterns or few_patterns(variant.finger.n_units)
        names = [n for n in FORMULATIONS if n == "chain" or not _by_chain_alone(variant)]
        for pattern, formulation in product(patterns, names):
            yield Case(subject, family.name, variant, pattern, formulation)


def _by_chain_alone(variant: Variant) -> bool:
    """Whether bars do not give way, or there is pressure or a body."""
    has_contact = variant.body is not None or variant.grip is not None
    return variant.finger.is_rigid or bool(variant.pressure) or has_contact
