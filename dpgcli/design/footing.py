"""What the lattice values of a design rest on, key by key, and which designs differ in that."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field
from functools import cached_property

import numpy as np

from dpgcli.arrays import Array, Flags, Indices, distinct
from dpgcli.design.calibrations import Calibration
from dpgcli.design.dimensions import HINGE_COUPLING, WALL_COMPLIANCE, Design, agree, without_unit
from dpgcli.design.domes import Domes
from dpgcli.design.outputs import BASES, Basis, Output
from dpgcli.design.problems import of_design
from dpgcli.design.rules import BISTABLE_STIFFNESS, SEGMENT_HEIGHT, Value
from dpgcli.design.scene import ORIGINS, Origin
from dpgcli.mechanics.finger import KEYS, STUDY
from dpgcli.records import dataclass

ELSEWHERE = " (at the study's dimensions)"
MOVED = (Origin.SCALED, Origin.EXTRAPOLATED)
ValuesByKey = Mapping[str, Sequence[Value]]
"""By key, one for each group of units."""


@dataclass(frozen=True)
class Footing:
    """What a lattice value rests on: by which rule it came about, and the file behind it.

    The error is relative, None where none is known.
    """

    key: str
    basis: Basis
    origin: Origin
    rule: str
    error: float | None
    calibration: Calibration | None

    def __str__(self) -> str:
        return f"{self.name}: {self.rule}"

    @property
    def name(self) -> str:
        """The value in words."""
        return without_unit(self.key).replace("_", " ")


@dataclass(frozen=True)
class DesignCase:
    """One design, the `place`-th of a batch: its law and its values.

    `answers` are those of its domes to pressure, none where it has no pressure.
    """

    design: Design
    domes: Domes
    values: ValuesByKey
    place: int = 0
    answers: ValuesByKey = field(default_factory=dict)

    @cached_property
    def footings(self) -> dict[str, Footing]:
        """By key, of the units with the least trusted basis; of walls only if all give way."""
        found: dict[str, Footing] = {}
        for key, values in self.values.items():
            each = [self._footing(key, value) for value in values]
            found[key] = max(each, key=_gravity)
        if not self.has_walls:
            found.pop(WALL_COMPLIANCE, None)
        return found

    @property
    def answer(self) -> Footing | None:
        """The least trusted footing of areas or snap pressures, None where there are none."""
        each = (self._footing(key, value) for key, found in self.answers.items() for value in found)
        return max(each, key=_gravity, default=None)

    def _footing(self, key: str, value: Value) -> Footing:
        number = of_design(value.numbers, self.place)
        origin = ORIGINS[int(of_design(value.origin, self.place))]
        file = None if value.file is None else self.design.calibrations[value.file]
        error = value.standard_error
        relative = None if error is None or not number else of_design(error, self.place) / number
        return Footing(
            key,
            _basis(key, number, origin, is_of_file=value.file is not None),
            origin,
            value.rule_of(self.place),
            relative,
            file if isinstance(file, Calibration) else None,
        )

    def gravest(self, *keys: str) -> Footing:
        """The least trusted footing of some values, the first among equals."""
        return max((self.footings[key] for key in keys if key in self.footings), key=_gravity)

    @cached_property
    def has_walls(self) -> bool:
        """Whether the walls of all units give way."""
        walls = self.values.get(WALL_COMPLIANCE, ())
        return bool(walls) and all(of_design(w.numbers, self.place) > 0.0 for w in walls)

    @property
    def is_loaded(self) -> bool:
        """Whether it bears any dead load."""
        return self.design.loads is not None and self.design.loads.act(self.place)

    @property
    def is_pushed_by_curve(self) -> bool:
        """Whether domes only push, by a curve of their own."""
        return not self.pulls and self.domes.calibration is not None

    @property
    def pulls(self) -> bool:
        """Whether domes pull at rest."""
        return self.domes.law.pulling is self.domes.law

    @property
    def has_published_domes(self) -> bool:
        """Whether a dome's energy is that of the published springs, scaled perhaps."""
        spring = self.footings[BISTABLE_STIFFNESS.key]
        is_scaled = spring.basis is Basis.EXTRAPOLATED and spring.calibration is None
        return spring.basis is Basis.PUBLISHED or is_scaled

    @property
    def has_geometric_height(self) -> bool:
        """Whether the segment height is that of the geometry, or the study's."""
        height = self.footings[SEGMENT_HEIGHT.key]
        return height.origin is Origin.DERIVED or height.basis is Basis.PUBLISHED

    @property
    def has_fitted_walls(self) -> bool:
        """Whether it is a finger such as was compared: pushing domes of a curve, fitted walls.

        And the geometric segment height, or one that was fitted beside walls.
        """
        if not (self.is_pushed_by_curve and self.has_walls):
            return False
        walls = self.footings[WALL_COMPLIANCE]
        file = walls.calibration
        if walls.basis is not Basis.FITTED or file is None or not self.is_as_fitted(file):
            return False
        height = self.footings[SEGMENT_HEIGHT.key]
        is_beside = height.calibration is not None and height.calibration.has(WALL_COMPLIANCE)
        return self.has_geometric_height or (height.basis is Basis.FITTED and is_beside)

    def is_study_s(self, key: str) -> bool:
        """Whether the first value of a key is that of the study's finger."""
        number = of_design(self.values[key][0].numbers, self.place)
        return bool(_are_study_s(key, np.array([number]))[0])

    def elsewhere(self, *keys: str) -> str:
        """Where a known error was found, if one of the values was moved from there."""
        found = (self.footings[key].origin for key in keys if key in self.footings)
        return ELSEWHERE if any(origin in MOVED for origin in found) else ""

    def known_error(self, output: Output, *keys: str) -> str:
        """What the first file behind these values knows of an output's error; empty if none."""
        footings = (self.footings[key] for key in keys if key in self.footings)
        return next(filter(None, (self.known_by(output, footing) for footing in footings)), "")

    def known_by(self, output: Output, footing: Footing) -> str:
        """What the file behind one value knows of an output's error; empty if nothing.

        Such errors are those of domes that only push, by a curve.
        """
        file = footing.calibration
        if file is None or not self.is_pushed_by_curve or output.key not in file.known_errors:
            return ""
        if not self.is_as_fitted(file):
            return ""
        known = file.known_errors[output.key]
        elsewhere = ELSEWHERE if footing.origin in MOVED else ""
        return f"{known.text}, against {known.against}{elsewhere}"

    def is_as_fitted(self, file: Calibration) -> bool:
        """Whether this is a finger as a file knows errors of: with all of its values.

        And with those of the file whose curve its domes have; with walls only if the file has them,
        but where it is about a dome alone.
        """
        curve = self.domes.calibration or file
        if any(self._lacks(known, key) for known in (file, curve) for key in KEYS):
            return False
        return file.has(WALL_COMPLIANCE) or file.curve is not None or not self.gives_way

    def lacks_walls_of(self, file: Calibration) -> bool:
        """Whether a file's values were fitted beside walls that this finger does not take from it.

        A segment height, or a hinge, stands for something else then.
        """
        return self._lacks(file, WALL_COMPLIANCE)

    @cached_property
    def gives_way(self) -> bool:
        """Whether the walls of any unit do."""
        walls = self.values.get(WALL_COMPLIANCE, ())
        return any(of_design(w.numbers, self.place) > 0.0 for w in walls)

    def _lacks(self, file: Calibration, key: str) -> bool:
        """Whether a file has a key whose value is not from it here, nor derived from it."""
        if not file.has(key):
            return False
        own = self.footings.get(key)
        if own is None:
            return key in (WALL_COMPLIANCE, HINGE_COUPLING)
        if own.calibration is file or own.origin is Origin.DERIVED:
            return False
        numbers = [of_design(value.numbers, self.place) for value in self.values[key]]
        known = file.values.get(key)
        return known is None or not agree(np.array(numbers), np.array([known.value])).all()


def kinds(values: ValuesByKey, designs: Indices) -> list[tuple[int, int]]:
    """Designs that differ in what their values rest on: one of each kind, and how many there are.

    >>> one = Value(np.array([3.0, 3.5, 4.0]), np.array([2, 4, 4]), ("", ""), np.array([0, 1, 1]))
    >>> kinds({"stroke_mm": [one]}, np.arange(3))
    [(0, 1), (1, 2)]
    """
    codes = np.zeros(len(designs), np.int64)
    for key, each in values.items():
        for part in (part for value in each for part in _parts(key, value)):
            if part.min() < part.max():
                codes = codes * (1 + part.max()) + part[designs]
                codes = np.searchsorted(distinct(codes), codes)
    found = (codes == kind for kind in range(codes.max(initial=-1) + 1))
    return [(int(designs[alike.argmax()]), int(alike.sum())) for alike in found]


def _parts(key: str, value: Value) -> Iterator[Indices]:
    """All of a value that decides what outputs rest on, as whole numbers (design,) or (1,)."""
    yield value.origin
    yield value.rule
    if key == WALL_COMPLIANCE:
        yield (np.real(value.numbers) > 0.0).astype(np.int64)
    if key == SEGMENT_HEIGHT.key or (value.origin == ORIGINS.index(Origin.GIVEN)).any():
        yield _are_study_s(key, value.numbers).astype(np.int64)


def _are_study_s(key: str, numbers: Array) -> Flags:
    """Whether values are those of the study's finger."""
    return agree(numbers, np.array([STUDY.get(KEYS.get(key, key), np.nan)]))


def _basis(key: str, number: float, origin: Origin, *, is_of_file: bool) -> Basis:
    """The basis of a value; one that is given, and is the study's, is published all the same."""
    if origin is Origin.GIVEN:
        return Basis.PUBLISHED if _are_study_s(key, np.array([number]))[0] else Basis.GIVEN
    if origin in (Origin.EXTRAPOLATED, Origin.ASSUMED):
        return Basis(origin.value)
    return Basis.FITTED if is_of_file else Basis.PUBLISHED


def _gravity(footing: Footing) -> int:
    return BASES.index(footing.basis)
