"""Dimensions and lattice values of a batch of designs, as their specs give them.

Lengths, moduli and stiffnesses lie within 1e-12 to 1e12, so that any power of them that the model
takes stays far from overflow; the linear stiffness, a stiff limit, may reach 1e18.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import field, replace
from typing import NamedTuple

import numpy as np

from dpgcli.arrays import Array, Flags
from dpgcli.design.bodies import FRICTION, PLACES, Body, Friction
from dpgcli.design.bodies import MASS as BODY_MASS
from dpgcli.design.calibrations import Calibration
from dpgcli.design.geometry import chamber_width
from dpgcli.design.loads import FORCES, MASS, MOMENT, GivenLoads
from dpgcli.design.problems import Issue, Problems, number, of_design
from dpgcli.design.scene import Held
from dpgcli.records import dataclass
from dpgcli.text import KeyPath, dotted

UNITS = "finger.units"
LINEAR_STIFFNESS = "linear_stiffness_N_per_mm"
WALL_COMPLIANCE = "wall_compliance_mm_per_N"
HINGE_COUPLING = "hinge_coupling_N_mm_per_rad"
SMALLEST, LARGEST, STIFFEST = 1e-12, 1e12, 1e18
MAX_UNITS = 64
AGREEMENT = 1e-6  # of a value given twice
UNIT_RANGE = re.compile(r"([0-9]{1,4})(?: *- *([0-9]{1,4}))?")
BOUNDS = {  # where they are not those of a length
    "units": (1.0, float(MAX_UNITS)),
    "force_linearity": (0.0, 1.0),
    "hinge_stiffness_N_mm_per_rad": (0.0, LARGEST),
    WALL_COMPLIANCE: (0.0, LARGEST),
    HINGE_COUPLING: (-LARGEST, LARGEST),
    "mounting_angle_deg": (-90.0, 90.0),
    **dict.fromkeys((*FORCES, MOMENT, *PLACES), (-LARGEST, LARGEST)),
    **dict.fromkeys((MASS, FRICTION), (0.0, LARGEST)),
}
SUFFIXES = {  # units in the names of keys
    "_N_mm_per_rad": "N mm/rad",
    "_N_per_mm": "N/mm",
    "_mm_per_N": "mm/N",
    "_N_mm": "N mm",
    "_mm2": "mm²",
    "_mm": "mm",
    "_MPa": "MPa",
    "_deg": "°",
    "_N": "N",
    "_g": "g",
}
Sizes = Mapping[str, Array]
LEAVE_ONE_OUT = "leave_one_out"  # instead of a model error: that of the calibration


class Tolerance(NamedTuple):
    """A standard uncertainty: in the unit of its key, or relative to its value."""

    size: float
    is_relative: bool

    def of(self, values: Array) -> Array:
        """The uncertainty of each value.

        >>> Tolerance(0.1, True).of(np.array([26.0])), Tolerance(0.1, False).of(np.array([6.5]))
        (array([2.6]), array([0.1]))
        """
        return self.size * np.real(values) if self.is_relative else np.full(values.shape, self.size)

    def text(self, key: str) -> str:
        """In words, for the key it is of."""
        unit, size = ("%", 100.0 * self.size) if self.is_relative else (unit_of(key), self.size)
        return f"{size:.6g} {unit}".rstrip()


@dataclass(frozen=True)
class GivenValues:
    """Dimensions and lattice values that are given of some units, by key; (design,) or (1,)."""

    geometry: Sizes = field(default_factory=dict)
    lattice: Sizes = field(default_factory=dict)


@dataclass(frozen=True)
class GivenPressure:
    """What a spec says of pressure: units by line, and values by key, of all units and of some.

    Without lines there is one, `A`, of all units. `history` has pressures (MPa) by line, and times
    (s) by `time_s`.
    """

    lines: Mapping[str, tuple[int, ...]] = field(default_factory=dict)
    values: Sizes = field(default_factory=dict)
    overrides: Mapping[str, Sizes] = field(default_factory=dict)
    history: Mapping[str, Sequence[float]] = field(default_factory=dict)

    def with_value(self, path: Sequence[str], column: Array) -> "GivenPressure":
        """With values of designs at a key: its parts after `pressure`."""
        *parents, key = path
        if not parents:
            return replace(self, values={**self.values, key: column})
        units = parents[-1]
        own = {**self.overrides.get(units, {}), key: column}
        return replace(self, overrides={**self.overrides, units: own})


@dataclass(frozen=True)
class Design:
    """A batch of designs that are given by the same keys, with arrays (design,), or (1,) for all.

    `overrides` are the sections of units as a spec names them ("4", "4-5"), `gripper` has its
    values by key, none without one. The calibrations are in the order in which they count.
    `tolerances` are by key; the model error is a share of the deflection, or `LEAVE_ONE_OUT`.
    `pressure`, `loads`, `body` and its `friction` are None where the spec says nothing of them; the
    body is `held` so.
    """

    units: int
    finger: GivenValues
    overrides: Mapping[str, GivenValues] = field(default_factory=dict)
    linear_stiffness: Array | None = None
    calibrations: tuple[str | Calibration, ...] = ()
    law: str | None = None
    gripper: Sizes = field(default_factory=dict)
    n_designs: int = 1
    tolerances: Mapping[str, Tolerance] = field(default_factory=dict)
    model_error: float | str | None = None
    pressure: GivenPressure | None = None
    hinge_coupling: Array | None = None
    loads: GivenLoads | None = None
    body: Body | None = None
    held: Held = Held.FIXED
    friction: Friction | None = None

    def with_values(self, columns: Sizes) -> "Design":
        """The designs with values (design,) at dotted keys of a spec, but its number of units.

        >>> length = {"finger.overrides.4-5.geometry.chamber_length_mm": np.array([9.0, 10.0])}
        >>> Design(5, GivenValues()).with_values(length).overrides["4-5"].geometry
        {'chamber_length_mm': array([ 9., 10.])}
        """
        design = self
        for key, column in columns.items():
            design = replace(design, n_designs=len(column))
            design = design._with_value(key.split("."), column * 1.0)
        return design

    def _with_value(self, path: list[str], column: Array) -> "Design":
        *parents, key = path
        if parents == ["gripper"]:
            return replace(self, gripper={**self.gripper, key: column})
        if parents[0] == "pressure":
            given = self.pressure or GivenPressure()
            return replace(self, pressure=given.with_value(path[1:], column))
        if parents == ["loads"]:
            return replace(self, loads=(self.loads or GivenLoads()).with_value(key, column))
        if path in (["object", FRICTION], ["object", BODY_MASS]):
            assert self.friction is not None, "keys of a base that has it"
            return replace(self, friction=self.friction.with_value(key, column))
        if parents[0] == "object":
            assert self.body is not None, "keys of a base that has one"
            return replace(self, body=self.body.with_value(".".join(path[1:]), column))
        if path == ["finger", LINEAR_STIFFNESS]:
            return replace(self, linear_stiffness=column)
        if path == ["finger", HINGE_COUPLING]:
            return replace(self, hinge_coupling=column)
        section = parents.pop() if key != WALL_COMPLIANCE else "lattice"
        if len(parents) == 1:
            return replace(self, finger=_changed(self.finger, section, key, column))
        units = parents[-1]
        own = _changed(self.overrides.get(units, GivenValues()), section, key, column)
        return replace(self, overrides={**self.overrides, units: own})


def _changed(part: GivenValues, section: str, key: str, column: Array) -> GivenValues:
    if section == "geometry":
        return replace(part, geometry={**part.geometry, key: column})
    return replace(part, lattice={**part.lattice, key: column})


def are_possible(key: str, values: Array) -> Flags:
    """Whether a key of a spec, by its last part, can have these values by themselves."""
    if key == LINEAR_STIFFNESS:
        return ((values >= SMALLEST) & (values <= STIFFEST)) | np.isposinf(values)
    low, high = BOUNDS.get(key, (SMALLEST, LARGEST))
    is_whole = (key != "units") | (values == np.rint(values))
    return np.asarray((values >= low) & (values <= high) & is_whole)


@dataclass(frozen=True)
class UnitGroup:
    """Units that share all values: what the spec gives them, and which of it an override gave."""

    units: tuple[int, ...]
    calibrations: tuple[str | Calibration, ...]
    geometry: Sizes
    lattice: Sizes
    override: str | None = None
    own_geometry: frozenset[str] = frozenset()
    own_lattice: frozenset[str] = frozenset()

    def path(self, section: str, key: str) -> KeyPath:
        """Where the spec sets, or would set, a value of these units."""
        own = self.own_geometry if section == "geometry" else self.own_lattice
        at = (key,) if key in (WALL_COMPLIANCE, HINGE_COUPLING) else (section, key)
        if self.override is not None and key in own:
            return ("finger", "overrides", self.override, *at)
        return ("finger", *at)


def groups_of(design: Design) -> list[UnitGroup]:
    """The units without an override, none perhaps, and those of each override."""
    taken = {unit for text in design.overrides for unit in unit_range(text)}
    units = tuple(unit for unit in range(1, design.units + 1) if unit not in taken)
    whole, sizes = design.finger, sizes_of(design.finger.geometry)
    return [
        UnitGroup(units, design.calibrations, sizes, whole.lattice),
        *(
            UnitGroup(
                unit_range(text),
                design.calibrations,
                {**sizes, **own.geometry},
                {**whole.lattice, **own.lattice},
                text,
                frozenset(own.geometry),
                frozenset(own.lattice),
            )
            for text, own in design.overrides.items()
        ),
    ]


def sizes_of(given: Sizes) -> dict[str, Array]:
    """The dimensions that are given, the chamber's width from the unit cell if need be."""
    sizes = dict(given)
    if "chamber_width_mm" not in sizes and "unit_cell_mm" in sizes:
        sizes["chamber_width_mm"] = chamber_width(sizes["unit_cell_mm"])
    return sizes


def unit_range(text: str) -> tuple[int, ...]:
    """The units that the key of an override names, empty if it names none.

    >>> unit_range("4"), unit_range("4-6"), unit_range("6-4")
    ((4,), (4, 5, 6), ())
    """
    match = UNIT_RANGE.fullmatch(text)
    if match is None:
        return ()
    first = int(match[1])
    return tuple(range(first, int(match[2] or first) + 1))


def unit_text(units: Iterable[int]) -> str:
    """Units as a spec writes them.

    >>> unit_text([1, 2, 3]), unit_text([5]), unit_text([5, 1, 2, 3])
    ('1-3', '5', '1-3,5')
    """
    runs: list[list[int]] = []
    for unit in sorted(units):
        if runs and unit == runs[-1][-1] + 1:
            runs[-1][1:] = [unit]
        else:
            runs.append([unit])
    return ",".join("-".join(map(str, run)) for run in runs)


def range_issues(
    n_units: int, overrides: Iterable[str], section: KeyPath = ("finger",)
) -> list[Issue]:
    """Malformed, foreign or overlapping unit ranges of a section's overrides."""
    found: list[Issue] = []
    taken: dict[int, str] = {}
    for text in overrides:
        path = (*section, "overrides", text)
        units = unit_range(text)
        if not units or units[0] < 1 or units[-1] > n_units:
            hint = 'write "4" or "4-5"'
            found.append(Issue(path, f"units within 1-{n_units}", dotted((text,)), hint))
        elif overlap := [taken[unit] for unit in units if unit in taken]:
            expected = "each unit in one override"
            found.append(Issue(path, expected, f"units also in {dotted((overlap[0],))}"))
        else:
            taken.update(dict.fromkeys(units, text))
    return found


def check_widths(sizes: Sizes, problems: Problems) -> None:
    """Note where the widths of the unit cell and of the chamber disagree."""
    if "unit_cell_mm" not in sizes:
        return
    cell = sizes["unit_cell_mm"]
    derived = chamber_width(cell)
    given = sizes.get("chamber_width_mm", derived)
    rule = "chamber width = unit cell - 2 mm (two walls of 1 mm)"

    def too_narrow(design: int) -> Issue:
        path = ("finger", "geometry", "unit_cell_mm")
        return Issue(path, "a length > 2 mm", number(of_design(cell, design)), rule)

    def another(design: int) -> Issue:
        expected = f"{number(of_design(derived, design))} as unit_cell_mm has it"
        path = ("finger", "geometry", "chamber_width_mm")
        return Issue(path, expected, number(of_design(given, design)), rule)

    is_narrow = np.real(derived) <= 0.0
    problems.add(is_narrow, too_narrow)
    problems.add(~is_narrow & ~agree(given, derived), another)


def agree(given: Array, derived: Array) -> Flags:
    """Whether a given value is the derived one, but for rounding by people."""
    first, second = np.real(given), np.real(derived)
    largest = np.maximum(np.abs(first), np.abs(second))
    return np.asarray(np.abs(first - second) <= AGREEMENT * largest)


def without_unit(key: str) -> str:
    """A key's name without its unit.

    >>> without_unit("elastic_modulus_MPa"), without_unit("force_linearity")
    ('elastic_modulus', 'force_linearity')
    """
    return next((key.removesuffix(suffix) for suffix in SUFFIXES if key.endswith(suffix)), key)


def unit_of(key: str) -> str:
    """The unit in a key's name, none where it has none.

    >>> unit_of("finger.lattice.segment_height_mm")
    'mm'
    """
    return next((unit for suffix, unit in SUFFIXES.items() if key.endswith(suffix)), "")
