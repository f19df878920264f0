"""Which law the domes of a design follow, and the curve behind it."""

from dataclasses import replace
from functools import partial

import numpy as np

from dpgcli.arrays import Array
from dpgcli.design.calibrations import Calibration, DomeCurve
from dpgcli.design.problems import Issue
from dpgcli.design.rules import (
    BISTABLE_STIFFNESS,
    DERIVATIONS,
    FORCE_LINEARITY,
    STROKE,
    Derivation,
)
from dpgcli.mechanics.curve import AT_REST, FEWEST_POINTS, bridged, spline
from dpgcli.mechanics.laws import PUBLISHED, DomeLaw, PushOnly, Tabulated
from dpgcli.records import dataclass

WHERE = ("finger", "law")
HINT = "dpg fit bistable writes one"
NEXT_TO_NOTHING = 0.01  # of a curve's energies
CLOSE = 0.01  # of a curve's travels: so near to rest its energy is that at rest, and a square
NEAR_START = 4.0  # first travels: as far the slope is like that from rest to the first point
STEEPER = 1.5  # than any slope nearby: no dome's own
NORMALS = (BISTABLE_STIFFNESS.key, STROKE.key)


@dataclass(frozen=True)
class Domes:
    """How domes answer, and by which rules their values come about.

    `calibration` has the curve, if there is one, and `measures` are the keys of its values that the
    curve is measured by. `travel` is that of the inverted dome at rest (mm), at a dome height of
    `height` (mm, if it is known), for domes with a travel of their own; else 0.
    """

    law: DomeLaw = PUBLISHED
    derivations: tuple[Derivation, ...] = DERIVATIONS
    calibration: Calibration | None = None
    measures: tuple[str, ...] = ()
    travel: float = 0.0
    height: float | None = None

    def measure_error(self, key: str) -> float | None:
        """Relative standard error of what the curve is measured by; None for other keys.

        Domes answer by E = (k_b/k_f) (d/d_f)² E_f(x d_f/d), with the k_f and d_f of the curve's own
        file; those that push only do so with the travel for d, which the curve itself tells. An
        error of k_f or d_f is therefore one of k_b or d by the same share, the other way.
        """
        if self.calibration is None or key not in self.measures:
            return None
        value, error = self.calibration.values[key]
        return (error or 0.0) / value

    def travel_at(self, height: Array | None) -> Array:
        """Travel of an inverted dome of another height, which it grows with (finite elements)."""
        if self.height is None or height is None:
            return np.array([self.travel])
        return self.travel * height / self.height


def domes_of(law: str | None, calibrations: tuple[str | Calibration, ...]) -> Domes | Issue:
    """The law of a name, with the first curve among the calibrations."""
    if law in (None, "published"):
        return Domes()
    curves = [c for c in calibrations if isinstance(c, Calibration) and c.curve is not None]
    calibration = curves[0] if curves else None
    if law == "push_only" and calibration is None:
        return Domes(PushOnly(PUBLISHED))
    if calibration is None or calibration.curve is None:
        return Issue(WHERE, "a calibration with a curve beside law: tabulated", "none", HINT)
    if issue := _curve_issue(calibration, calibration.curve):
        return issue
    stiffness, stroke = (calibration.values.get(key) for key in NORMALS)
    if stiffness is None or stroke is None:
        expected = f"{BISTABLE_STIFFNESS.key} and {STROKE.key} beside the curve"
        return Issue(WHERE, expected, f"not both in {calibration.source}", HINT)
    if law == "tabulated":
        return _tabulated(calibration, calibration.curve, stiffness.value, stroke.value)
    return _pushing(curves, calibration.curve, stiffness.value)


def _curve_issue(calibration: Calibration, curve: DomeCurve) -> Issue | None:
    """Too few points, or a first one whose energy cannot be counted from rest."""
    travels, energies = np.array(curve.travel), np.array(curve.energy)
    begins_before = travels[0] < 0.0
    n_points = len(travels)
    if begins_before:
        n_points = 1 + int((travels > AT_REST * np.ptp(travels)).sum())
    if n_points < FEWEST_POINTS:
        from_rest = " from rest on" if begins_before else ""
        found = f"{n_points}{from_rest} in {calibration.source}"
        return Issue(WHERE, f"a curve of {FEWEST_POINTS} points or more", found, HINT)
    if travels[0] <= 0.0 or _at_rest(travels, energies) is not None:
        return None
    expected = "a curve that begins at rest, travel 0, or whose energies are counted from there"
    found = f"{energies[0]:g} mJ at {travels[0]:g} mm in {calibration.source}"
    return Issue(WHERE, expected, found, "add the point at travel 0 to the curve")


def _at_rest(travels: Array, energies: Array) -> float | None:
    """The energy at rest (mJ) of a curve that begins beyond it; None where that is not known.

    A curve that begins close to it tells it, whatever its energies are counted from: there a dome
    has no force. One that begins further away is taken to be counted from rest, unless from there
    to the first point is steeper than any way nearby, or energies are next to nothing.
    """
    start, energy = travels[0], energies[0]
    if start <= CLOSE * np.ptp(travels):
        apart = int(np.argmax(travels >= 2.0 * start))
        first, second = start**2, travels[apart] ** 2
        return float((energy * second - energies[apart] * first) / (second - first))
    near = travels[1:] <= max(NEAR_START * start, travels[FEWEST_POINTS - 1])
    steepest = np.abs(np.diff(energies) / np.diff(travels))[near].max()
    is_from_rest = abs(energy) <= STEEPER * steepest * start
    return 0.0 if is_from_rest or abs(energy) <= NEXT_TO_NOTHING * np.ptp(energies) else None


def _no_well(calibration: Calibration) -> Issue:
    return Issue(WHERE, "a curve with an inverted well", f"none in {calibration.source}", HINT)


def _tabulated(
    calibration: Calibration, curve: DomeCurve, stiffness: float, stroke: float
) -> Domes | Issue:
    shape = spline(*_points(curve, stroke / curve.opening_per_travel, stiffness * stroke**2))
    if not np.isfinite(shape.rests[1]):
        return _no_well(calibration)
    rules = tuple(d for d in DERIVATIONS if d is not FORCE_LINEARITY)
    return Domes(Tabulated(shape), rules, calibration, NORMALS)


def _pushing(curves: list[Calibration], curve: DomeCurve, stiffness: float) -> Domes | Issue:
    """By the curve of the first; the strokes of all are those of laws fitted to curves."""
    calibration = curves[0]
    travel = spline(*_points(curve, 1.0, 1.0)).rests[1]
    if not np.isfinite(travel):
        return _no_well(calibration)
    shape = spline(*_points(curve, travel, stiffness * travel**2))
    height = calibration.geometry.get("dome_height_mm")
    measures = (BISTABLE_STIFFNESS.key,)
    domes = Domes(PushOnly(Tabulated(shape)), (), calibration, measures, travel, height)
    stroke = replace(
        STROKE,
        value=partial(_stroke_in_contact, domes),
        rule="travel of the inverted dome - dome height - unit separation (contact)",
        not_from=tuple(curves),
    )
    rules = (stroke if d is STROKE else d for d in DERIVATIONS if d is not FORCE_LINEARITY)
    return replace(domes, derivations=tuple(rules))


def _stroke_in_contact(domes: Domes, height: Array, separation: Array) -> Array:
    return domes.travel_at(height) - height - separation


def _points(curve: DomeCurve, travel: float, energy: float) -> tuple[tuple[float, ...], ...]:
    """Travels and energies over a travel and an energy, from rest on, gaps bridged."""
    travels, energies = np.array(curve.travel), np.array(curve.energy)
    if travels[0] > 0.0:
        at_rest = _at_rest(travels, energies)
        assert at_rest is not None, "refused before"
        travels, energies = np.append(0.0, travels), np.append(0.0, energies - at_rest)
    travels, energies = bridged(travels, energies, curve.gaps)
    return tuple((travels / travel).tolist()), tuple((energies / energy).tolist())
