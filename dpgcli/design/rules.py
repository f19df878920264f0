"""The lattice values of designs: by which rule each follows, for which of them, in what words.

Rules that the geometry yields are the study's, ours or from finite elements; see `geometry`.
"""

from collections.abc import Callable, Sequence

import numpy as np

from dpgcli.arrays import Array, Flags, Indices
from dpgcli.design import geometry
from dpgcli.design.calibrations import Calibration
from dpgcli.design.dimensions import (
    HINGE_COUPLING,
    LARGEST,
    SMALLEST,
    WALL_COMPLIANCE,
    UnitGroup,
)
from dpgcli.design.problems import Issue, Problems, number, of_design
from dpgcli.design.scene import ORIGINS, Origin
from dpgcli.records import dataclass


@dataclass(frozen=True)
class Value:
    """A lattice value of some units in a batch of designs, and how it came about in each.

    `numbers` and their standard errors, if any are known, are (design,) or (1,); `origin` has
    places in `ORIGINS` and `rule` places in `rules`, of the same shapes. `file` is the place of
    the calibration that it comes from, in the list of them.
    """

    numbers: Array
    origin: Indices
    rules: tuple[str, ...]
    rule: Indices
    standard_error: Array | None = None
    file: int | None = None

    def rule_of(self, design: int) -> str:
        """The rule behind the value of one design."""
        return self.rules[int(of_design(self.rule, design))]


def all_by(numbers: Array, origin: Origin, rule: str) -> Value:
    """Values that came about in one way."""
    return Value(numbers, np.array([ORIGINS.index(origin)]), (rule,), np.zeros(1, np.int64))


@dataclass(frozen=True)
class Derivation:
    """How geometry yields one lattice value; `origin` only where a calibration is behind it.

    Calibration files may give the value instead, but for those `not_from`: there the key means
    something else.
    """

    key: str
    needs: tuple[str, ...]
    value: Callable[..., Array]
    rule: str
    origin: Callable[..., Indices] | None = None
    not_from: tuple[Calibration, ...] = ()
    bounds: tuple[float, float] = (SMALLEST, LARGEST)

    def allows(self, values: Array) -> Flags:
        """Where a finger can have these values."""
        low, high = self.bounds
        return np.asarray((low <= np.real(values)) & (np.real(values) <= high))

    def of(self, group: UnitGroup) -> Array:
        """The value that the rule yields for a group of units whose geometry is known."""
        with np.errstate(all="ignore"):  # what is impossible is found among the values
            return self.value(*(group.geometry[need] for need in self.needs))


def _kept_linearity(dome_height: Array, dome_thickness: Array) -> Array:
    return np.array([geometry.FORCE_LINEARITY])


SEGMENT_LENGTH = Derivation(
    "segment_length_mm",
    ("chamber_length_mm", "dome_thickness_mm", "unit_separation_mm"),
    geometry.segment_length,
    "chamber length + 2 dome thickness + unit separation (inferred rule)",
)
SEGMENT_HEIGHT = Derivation(
    "segment_height_mm",
    ("chamber_width_mm", "limiting_layer_thickness_mm"),
    geometry.segment_height,
    "chamber width / 2 + limiting layer thickness / 2 (inferred rule)",
)
STROKE = Derivation(
    "stroke_mm",
    ("dome_height_mm", "unit_separation_mm"),
    geometry.stroke,
    "dome height - unit separation (published rule)",
)
BISTABLE_STIFFNESS = Derivation(
    "bistable_stiffness_N_per_mm",
    ("dome_height_mm", "dome_thickness_mm", "elastic_modulus_MPa"),
    geometry.bistable_stiffness,
    "E t^2.8 h^-0.25 (finite-element scaling)",
    geometry.dome_origin,
)
FORCE_LINEARITY = Derivation(
    "force_linearity",
    ("dome_height_mm", "dome_thickness_mm"),
    _kept_linearity,
    "kept constant (finite-element scaling)",
    geometry.dome_origin,
    bounds=(0.0, 1.0),
)
HINGE_STIFFNESS = Derivation(
    "hinge_stiffness_N_mm_per_rad",
    (
        "elastic_modulus_MPa",
        "channel_width_mm",
        "limiting_layer_thickness_mm",
        "unit_separation_mm",
    ),
    geometry.hinge_stiffness,
    "E W_ch t_L^3 / s (inferred scaling)",
    geometry.hinge_origin,
    bounds=(0.0, LARGEST),
)
WALLS = Derivation(  # rigid unless given or calibrated: geometry alone yields none
    WALL_COMPLIANCE,
    ("elastic_modulus_MPa",),
    geometry.softness,
    "1 / E (elasticity)",
    bounds=(0.0, LARGEST),
)
COUPLING = Derivation(  # none unless given or calibrated; elsewhere as large a part of the hinge
    HINGE_COUPLING,
    HINGE_STIFFNESS.needs,
    geometry.hinge_stiffness,
    HINGE_STIFFNESS.rule,
    bounds=(-LARGEST, LARGEST),
)
DERIVATIONS = (
    SEGMENT_LENGTH,
    SEGMENT_HEIGHT,
    STROKE,
    BISTABLE_STIFFNESS,
    FORCE_LINEARITY,
    HINGE_STIFFNESS,
)


def missing_from(
    derivation: Derivation, group: UnitGroup, missing: Sequence[str], why: str | None = None
) -> Issue:
    """A value that the geometry should yield, but does not state enough for."""
    return Issue(
        group.path("lattice", derivation.key),
        f"a value, or geometry with {listed(missing if why else derivation.needs)}",
        f"no {listed(missing)}",
        why or derivation.rule,
    )


def check_possible(
    derivation: Derivation, group: UnitGroup, value: Value, problems: Problems
) -> Flags:
    """Note where no finger can have a value that a rule gives; where it can, (design,) or (1,)."""
    needs = [need for need in derivation.needs if need in group.own_geometry]
    path = group.path("geometry", (needs or derivation.needs)[0])
    low, high = derivation.bounds

    def issue(design: int) -> Issue:
        size = of_design(value.numbers, design)
        found = f"{derivation.key} = {number(size)}"
        if derivation is STROKE and size <= 0:
            hint = "the dome never reaches its neighbor"
            return Issue(path, "a dome height > the unit separation", found, hint)
        return Issue(path, f"a value from {low:g} to {high:g}", found, value.rule_of(design))

    is_possible = derivation.allows(value.numbers)
    problems.add(~is_possible, issue)
    return is_possible


def listed(keys: Sequence[str]) -> str:
    """Keys of the geometry section as messages list them."""
    named = ["chamber_width_mm or unit_cell_mm" if k == "chamber_width_mm" else k for k in keys]
    return ", ".join(named)
