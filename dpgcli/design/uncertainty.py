"""Covariance of what a finger's values may be off by: errors of calibrations, tolerances."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from dpgcli.arrays import COMPLEX_STEP, Array
from dpgcli.design.calibrations import Calibration
from dpgcli.design.dimensions import (
    HINGE_COUPLING,
    WALL_COMPLIANCE,
    Design,
    GivenValues,
    Sizes,
    Tolerance,
    unit_of,
)
from dpgcli.design.problems import Issue, number, of_design
from dpgcli.design.scene import FITTED, Step, Uncertainty
from dpgcli.mechanics.finger import KEYS

LAYER = "limiting_layer_thickness_mm"
SPACING = "base_spacing_mm"
ANGLE = "mounting_angle_deg"
LatticeArrays = Mapping[str, Array]


class Share(NamedTuple):
    """Standard errors, (1 or unit, design), of a calibration's values; 0 in other units."""

    file: int
    key: str
    errors: Array


def uncertainty_of(
    calibrations: Sequence[str | Calibration],
    shares: Sequence[Share],
    tolerances: Sequence[Step],
    model_error: float,
) -> Uncertainty | None:
    """The covariance of all that may be off behind a finger; None where nothing is.

    An error of a fitted value is the same error in all units that the value is brought to. Values
    of one file are correlated as it says; those of a grid, of other files and tolerances are not
    (assumed).
    """
    if not (shares or tolerances or model_error):
        return None
    covariance = np.eye(len(shares) + len(tolerances))
    for row, first in enumerate(shares):
        for column, second in enumerate(shares):
            if first.file == second.file:
                calibration = calibrations[first.file]
                assert isinstance(calibration, Calibration), "shares come from files"
                covariance[row, column] = calibration.correlation_of(first.key, second.key)
    fitted = (Step(FITTED, {KEYS[share.key]: share.errors}) for share in shares)
    return Uncertainty((*fitted, *tolerances), covariance, model_error)


def tolerance_issues(design: Design, valued: Sequence[str]) -> Iterator[Issue]:
    """Tolerances of values that there are not, or that a percentage says nothing about.

    `valued` are the keys of the lattice that have a value.
    """
    for key, tolerance in design.tolerances.items():
        path = ("uncertainty", key)
        found = given(design, key)
        if not found and key not in valued:
            yield Issue(path, "a key that has a value here", key, _missing(key))
        elif any(np.isinf(value).any() for value in found):
            yield Issue(path, "no tolerance of rigid bars", tolerance.text(key))
        elif tolerance.is_relative and any((value == 0.0).any() for value in found):
            expected = f"a number in {unit_of(key) or 'the unit of its key'}"
            yield Issue(path, expected, tolerance.text(key), f"{key} is 0")
        elif not tolerance.is_relative and key != ANGLE and found:
            smallest = min(of_design(value, 0) for value in found)
            if tolerance.size > smallest > 0.0:
                yield Issue(path, f"less than {number(smallest)}, the value", tolerance.text(key))


def _missing(key: str) -> str:
    if key in (SPACING, ANGLE):
        return "there is no gripper"
    if key == WALL_COMPLIANCE:
        return "walls are rigid: give finger.wall_compliance_mm_per_N, 0 perhaps"
    if key == HINGE_COUPLING:
        return f"hinges do not turn each other: give finger.{HINGE_COUPLING}, 0 perhaps"
    return "the law has none" if key in KEYS else "finger.geometry does not give it"


def given(design: Design, key: str) -> list[Array]:
    """The values that a design gives a key, of all units and of some."""
    sections = (design.finger, *design.overrides.values())
    found = [part[key] for s in sections for part in (s.geometry, s.lattice) if key in part]
    if key == "linear_stiffness_N_per_mm" and design.linear_stiffness is not None:
        found.append(design.linear_stiffness)
    if key == HINGE_COUPLING and design.hinge_coupling is not None:
        found.append(design.hinge_coupling)
    if key in design.gripper:
        found.append(design.gripper[key])
    return found


def tolerance_steps(
    design: Design, lattice: LatticeArrays, lattice_of: Callable[[Design], LatticeArrays]
) -> Iterator[Step]:
    """The steps of a single design's tolerances; `lattice_of` resolves a design.

    A tolerance is the same error in all units: they come from one mold and one batch. That of a
    dimension reaches the lattice by the rules behind its values, differentiated by a complex step;
    that of a lattice value changes the value itself, whatever it comes from.
    """
    for key, tolerance in design.tolerances.items():
        size = tolerance.text(key)
        if key in KEYS:
            value = lattice[KEYS[key]]
            yield Step(key, {KEYS[key]: tolerance.of(value)}, size=size)
        elif key in (SPACING, ANGLE):
            change = of_design(tolerance.of(design.gripper[key]), 0)
            spacing, angle = (change, 0.0) if key == SPACING else (0.0, np.radians(change))
            yield Step(key, {}, spacing, float(angle), size=size)
        else:
            changes = {
                name: values.imag / COMPLEX_STEP
                for name, values in lattice_of(_moved(design, key, tolerance)).items()
                if np.iscomplexobj(values) and values.imag.any()
            }
            layer = of_design(tolerance.of(given(design, key)[0]), 0) if key == LAYER else 0.0
            yield Step(key, changes, layer_thickness=layer, size=size)


def _moved(design: Design, key: str, tolerance: Tolerance) -> Design:
    """The design an imaginary tolerance away in one dimension, in every unit that has it."""

    def stepped(sizes: Sizes) -> Sizes:
        if key not in sizes:
            return sizes
        return {**sizes, key: sizes[key] + 1j * COMPLEX_STEP * tolerance.of(sizes[key])}

    def moved(section: GivenValues) -> GivenValues:
        return replace(section, geometry=stepped(section.geometry))

    overrides = {units: moved(section) for units, section in design.overrides.items()}
    return replace(design, finger=moved(design.finger), overrides=overrides)
