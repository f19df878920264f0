"""The lattice values of a spec: by which rule each follows, for which units, and in what words.

Rules that the geometry yields are the study's, ours or from finite elements; see
`mechanics.geometry`.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from dpgcli.files.calibration.models import Calibration
from dpgcli.files.places import KeyPath
from dpgcli.files.sections import AGREEMENT, LARGEST, SMALLEST, Geometry
from dpgcli.mechanics import geometry
from dpgcli.mechanics.scene import Origin

PUBLISHED = "published"
LINEAR_STIFFNESS = "linear_stiffness_N_per_mm"


class Issue(NamedTuple):
    """A mistake between keys: the key to look at, and the words of a problem."""

    path: KeyPath
    expected: str
    found: str
    hint: str = ""


class Value(NamedTuple):
    """A lattice value of some units, how it came about, and its standard error if one is known.

    `file` is the place of the calibration file that it comes from, in the spec's list of them.
    """

    value: float
    origin: Origin
    rule: str
    standard_error: float | None = None
    file: int | None = None


@dataclass(frozen=True)
class Derivation:
    """How geometry yields one lattice value; `origin` only where a calibration is behind it.

    Calibration files may give the value instead, but for `not_from`: there the key means something
    else.
    """

    key: str
    needs: tuple[str, ...]
    value: Callable[..., float]
    rule: str
    origin: Callable[..., Origin] | None = None
    not_from: Calibration | None = None
    bounds: tuple[float, float] = (SMALLEST, LARGEST)


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
    lambda dome_height, dome_thickness: geometry.FORCE_LINEARITY,
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
DERIVATIONS = (
    SEGMENT_LENGTH,
    SEGMENT_HEIGHT,
    STROKE,
    BISTABLE_STIFFNESS,
    FORCE_LINEARITY,
    HINGE_STIFFNESS,
)


@dataclass(frozen=True)
class Group:
    """Units that share all values: what the spec gives them, and which of it an override gave."""

    units: tuple[int, ...]
    calibrations: tuple[str | Calibration, ...]
    geometry: Mapping[str, float]
    lattice: Mapping[str, float]
    override: str | None = None
    own_geometry: frozenset[str] = frozenset()
    own_lattice: frozenset[str] = frozenset()

    def path(self, section: str, key: str) -> KeyPath:
        """Where the spec sets, or would set, a value of these units."""
        own = self.own_geometry if section == "geometry" else self.own_lattice
        if self.override is not None and key in own:
            return ("finger", "overrides", self.override, section, key)
        return ("finger", section, key)


def sizes_of(section: Geometry | None) -> dict[str, float]:
    """The dimensions that a geometry gives, the chamber's width from the unit cell if need be."""
    given = {} if section is None else {k: v for k, v in vars(section).items() if v is not None}
    if "chamber_width_mm" not in given and "unit_cell_mm" in given:
        given["chamber_width_mm"] = geometry.chamber_width(given["unit_cell_mm"])
    return given


def missing_from(
    derivation: Derivation, group: Group, missing: list[str], why: str | None = None
) -> Issue:
    """A value that the geometry should yield, but does not state enough for."""
    return Issue(
        group.path("lattice", derivation.key),
        f"a value, or geometry with {listed(missing if why else derivation.needs)}",
        f"no {listed(missing)}",
        why or derivation.rule,
    )


def possible(
    derivation: Derivation, group: Group, value: float, rule: str | None = None
) -> Issue | None:
    """What is wrong with a value that a rule gives, if no finger can have it."""
    low, high = derivation.bounds
    if low <= value <= high:
        return None
    needs = [need for need in derivation.needs if need in group.own_geometry]
    path = group.path("geometry", (needs or derivation.needs)[0])
    found = f"{derivation.key} = {number(value)}"
    if derivation is STROKE and value <= 0:
        hint = "the dome never reaches its neighbor"
        return Issue(path, "a dome height > the unit separation", found, hint)
    return Issue(path, f"a value from {low:g} to {high:g}", found, rule or derivation.rule)


def agree(given: float, derived: float) -> bool:
    """Whether a given value is the derived one, but for rounding by people."""
    return math.isclose(given, derived, rel_tol=AGREEMENT)


def number(value: float) -> str:
    """A number as messages show it."""
    return f"{value:.10g}"


def listed(keys: tuple[str, ...] | list[str]) -> str:
    """Keys of the geometry section as messages list them."""
    named = ["chamber_width_mm or unit_cell_mm" if k == "chamber_width_mm" else k for k in keys]
    return ", ".join(named)
