"""Families of stiff and extreme variants of a finger, each of which varies one property."""

from collections.abc import Iterator
from itertools import product
from typing import Any

import numpy as np

from dpgcli.arrays import Array, Flags
from dpgcli.hard_cases.bodies import bodies
from dpgcli.hard_cases.variants import (
    LONG_FINGER,
    Family,
    Start,
    Variant,
    changed,
    few_patterns,
    repeated,
    rigid,
    with_bars,
)
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.terms import chain_potential
from dpgcli.states.accuracy import DEFAULT_TOLERANCE
from dpgcli.states.certify import Status
from dpgcli.states.loading import grown
from dpgcli.states.margins import last_where, limits, margins
from dpgcli.states.patterns import inverted_units, texts
from dpgcli.states.settle import settle
from dpgcli.states.units import UnitSolutions
from dpgcli.states.wells import inverted_wells

ALL_PATTERNS_UP_TO = 4  # units
N_GRADED = 4  # units
FOLD_SYMBOLS = {"force_linearity": "α", "hinge_stiffness": "k_θ", "stroke": "d"}
CROSSED_DISTANCES = (1e-2, 1e-6, 1e-10, -1e-10, -1e-6, -1e-2)  # of α from its limit
WALL_RATIOS = (1e-9, 1e-6, 1e-3, 0.1, 1.0, 10.0, 1e3, 1e6)  # c_w k_b
COUPLING_RATIOS = (-0.499, -0.1, 1e-9, 1e-3, 0.05, 0.3, 0.499, 0.4999999)  # κ/k_θ
STIFF_HINGES = (1.0, 4.0)  # times the study's: the stiffer ones nearly lose their second wells
PRESSED_RATIOS = (1.0, 10.0, 1e2, 1e3, 1e4, 1e6, 1e8, 1e10, 1e12, 1e13, 1e14, 1e15)
NEARLY_EQUAL = (1e-3, 3e-6, 1e-6, 1e-9)  # thresholds of two units, relative
PRESSED_DISTANCES = (1e-2, 1e-4, 1e-6, 1e-8, 1e-10)  # of α from its limit
PRESSED_WALLS = (1e-6, 1e-3, 0.1, 1.0, 10.0, 1e3)  # c_w k_b
PRESSED_COUPLINGS = (-0.3, 0.05, 0.49)  # κ/k_θ
LOADED_UNITS = 3
LOADED_RATIOS = (1.0, 1e3, 1e6, 1e12, 1e15)
DEAD_LOADS = {  # N, N mm and N a unit along +y, each more than an inverted unit bears
    "tip force": {"tip_force_x": 1.0, "tip_force_y": 4.0},
    "couple": {"end_moment": -80.0},
    "weight": {"unit_weight": 4.0},
}
BELOW_RESET = (0.5, 1e-3, 1e-9, -1e-6)  # of the load that resets a unit
CROSSED_RATIOS = (0.1, 10.0, 1e4, 1e8, 1e12, 1e15)  # of k_L and k_b
FOLDED_STARTS = {  # near and far corner (rad), and the pattern by the dome's opening
    "straight": ((0.0, 0.0), "0"),
    "inverted": ((0.15, 0.15), "1"),
    "folded inward": ((-3.0, -3.0), "0"),
    "folded outward": ((2.9, 2.9), "1"),
    "mirrored at the near strut": ((-1.7, 0.3), "0"),
    "mirrored at the far strut": ((0.3, -1.7), "0"),
}


def _both(label: str, finger: Finger, **more: Any) -> Iterator[Variant]:
    """The finger as it is, and with rigid bars."""
    yield Variant(label, finger, **more)
    if not finger.is_rigid:
        yield Variant(f"{label}, k_L = ∞", rigid(finger), **more)


def _patterns(base: Finger) -> Iterator[Variant]:
    n = base.n_units
    if n <= ALL_PATTERNS_UP_TO:
        flags = inverted_units(np.arange(2**n, dtype=np.uint64), n)
        chosen = tuple(text.decode() for text in texts(flags))
    else:
        ends = "1".ljust(n, "0"), "1".rjust(n, "0")
        halves = ("1" * (n // 2)).ljust(n, "0"), ("1" * (n // 2)).rjust(n, "0")
        chosen = ("0" * n, "1" * n, ("10" * n)[:n], ("01" * n)[:n], *ends, *halves)
    yield Variant("as given", base, chosen)


def _stiffness(base: Finger) -> Iterator[Variant]:
    patterns = few_patterns(base.n_units, with_ground=True)
    for exponent in range(16):
        yield Variant(f"k_L/k_b = 1e{exponent}", with_bars(base, 10.0**exponent), patterns)
    yield Variant("k_L = ∞", rigid(base), patterns)


def _linearity(base: Finger) -> Iterator[Variant]:
    for value in (0.0, 1e-12, 1e-3, 0.03, 0.06, 0.09, 0.095, 0.1, 1 / 9, 0.12, 0.5, 1.0):
        bent = changed(base, force_linearity=value)
        patterns = few_patterns(base.n_units, with_ground=value > 0.1)
        yield from _both(f"α = {value:.4g}", bent, patterns=patterns)


def _stroke(base: Finger) -> Iterator[Variant]:
    """Strokes up to half a turn of one unit; a softer hinge lets wide openings rest."""
    for value in (1e-3, 1e-2, 0.1, 1.0):
        yield from _both(f"d = {value:g} mm", changed(base, stroke=value))
    height = base.segment_height.max()
    for ratio, part in product((0.3, 0.6, 0.9, 1.1, 1.3, 1.6, 1.9, 2.2, 2.7), (1.0, 1e-2)):
        hinge = part * base.hinge_stiffness
        wide = changed(base, stroke=ratio * height, hinge_stiffness=hinge)
        yield from _both(f"d = {ratio:g} H, {part:g} k_θ", wide)


def _length(base: Finger) -> Iterator[Variant]:
    for n in (1, 2, 5, 8, 13, 32, 64):
        yield from _both(f"n = {n}", repeated(base, n))
    yield Variant(
        f"n = {LONG_FINGER}, in a ring", repeated(base, LONG_FINGER), ("1" * LONG_FINGER,)
    )


def _hinge(base: Finger) -> Iterator[Variant]:
    for value in (0.0, 1e-9, 1e-6, 1e-3, 1.0, 10.0, 100.0, 1e6, 1e12):
        bent = changed(base, hinge_stiffness=value)
        patterns = few_patterns(base.n_units, with_ground=True)
        yield from _both(f"k_θ = {value:g} N mm/rad", bent, patterns=patterns)


def _scale(base: Finger) -> Iterator[Variant]:
    for unit, scale in (("m", 1e-3), ("µm", 1e3), ("km", 1e-6), ("nm", 1e6)):
        yield from _both(f"in {unit}", base, scale=scale)


def _graded(base: Finger) -> Iterator[Variant]:
    """Four units that differ by orders of magnitude, step by step or by turns."""
    finger = repeated(base, N_GRADED)
    steps, by_turns = np.logspace(-3.0, 3.0, N_GRADED), np.resize([1e-3, 1e3], N_GRADED)
    fingers = {}
    for words, factors in (("from 1e-3 to 1e3", steps), ("1e-3 and 1e3 by turns", by_turns)):
        domes = factors[:, None] * finger.bistable_stiffness
        hinges = factors[:, None] * finger.hinge_stiffness
        fingers[f"k_b × {words}"] = changed(finger, bistable_stiffness=domes)
        fingers[f"k_θ × {words}"] = changed(finger, hinge_stiffness=hinges)
        both = changed(finger, bistable_stiffness=domes, hinge_stiffness=hinges)
        fingers[f"k_b and k_θ × {words}"] = both
    strokes, lengths = np.logspace(-2.0, 0.8, N_GRADED), np.logspace(2.0, -0.5, N_GRADED)
    fingers["d from 0.01 to 6.3 mm"] = changed(finger, stroke=strokes)
    fingers["L from 100 to 0.3 mm"] = changed(finger, segment_length=lengths)
    linearities = np.resize([0.0, 0.2], N_GRADED)
    fingers["α = 0 and 0.2 by turns"] = changed(finger, force_linearity=linearities)
    for label, graded in fingers.items():
        patterns = dict.fromkeys((*few_patterns(N_GRADED), _all_that_can(graded)))
        yield from _both(label, graded, patterns=tuple(patterns))


def _all_that_can(finger: Finger) -> str:
    """The pattern with every unit inverted that has a second well with rigid bars."""
    exists = np.broadcast_to(inverted_wells(finger).exists, (finger.n_units, 1))
    return "".join("01"[has_well] for has_well in exists[:, 0].tolist())


def _wells(base: Finger) -> Iterator[Variant]:
    """Wells of nearly the same energy: α and the hinge's stiffness nearly zero."""
    for linearity, part in ((1e-2, 1e-2), (1e-4, 1e-4), (1e-8, 1e-4), (0.0, 1e-4), (1e-12, 1e-6)):
        hinge = part * base.hinge_stiffness
        even = changed(base, force_linearity=linearity, hinge_stiffness=hinge)
        yield from _both(f"α = {linearity:g}, {part:g} k_θ", even)


def _guess(base: Finger) -> Iterator[Variant]:
    """Starts away from the geometric guess, which between stiff bars is the answer already."""
    for strokes in (0.5, 0.6, 0.75, 0.9, 1.0, 1.25, 1.5, 2.0):
        yield from _both(
            f"{strokes:g} stroke{'s' * (strokes != 1.0)}", base, start=Start(strokes=strokes)
        )
    for ratio in (1e6, 1e9, 1e12):
        stiff = with_bars(base, ratio)
        yield Variant(f"1 stroke, k_L/k_b = {ratio:g}", stiff, start=Start(strokes=1.0))


def _fold(base: Finger) -> Iterator[Variant]:
    """The weakest unit alone, at and beyond the loss of its second well."""
    unit = base.with_units([int(np.argmin(margins(base).force_linearity))])
    folds = limits(unit)
    stiff = with_bars(unit, 1e9)
    for name in FOLD_SYMBOLS:
        limit = float(getattr(folds, name)[0])
        yield from _approach("k_L = ∞", rigid(unit), name, limit)
        yield from _approach("k_L/k_b = 1e9", stiff, name, limit)
    soft = with_bars(unit, 10.0)
    yield from _approach("k_L/k_b = 10", soft, "force_linearity", _last_linearity(soft))
    if not unit.is_rigid:
        yield from _approach("own k_L", unit, "force_linearity", _last_linearity(unit))


def _approach(bars: str, finger: Finger, name: str, limit: float) -> Iterator[Variant]:
    """Variants with a value near its limit, on both sides; none without a limit."""
    for distance in (1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12, -1e-12, -1e-7, -1e-2):
        if 0.0 < limit < np.inf:
            at = changed(finger, **{name: limit * (1.0 - distance)})
            side = f"fold − {distance:g}" if distance > 0.0 else f"fold + {-distance:g}"
            yield Variant(f"{FOLD_SYMBOLS[name]} at {side}, {bars}", at, ("1",))


def _last_linearity(unit: Finger) -> float:
    """The largest α with which a unit with elastic bars still rests beyond its barrier."""

    def rests(linearity: Array) -> Flags:
        units = UnitSolutions.of(changed(unit, force_linearity=linearity))
        settled = settle(units, chain_potential, np.ones((1, 1), bool), DEFAULT_TOLERANCE)
        is_stable: Flags = settled.status[0] == Status.STABLE
        return is_stable

    return last_where(rests, np.array(0.0), np.array(1.0)).item()


def _crossed(base: Finger) -> Iterator[Variant]:
    """Units equally near to their loss of bistability, between bars from soft to very stiff."""
    grades = np.linspace(0.7, 1.4, N_GRADED)
    uniform, graded = repeated(base, N_GRADED), repeated(base.with_units([0]), N_GRADED)
    fingers = {
        "1 unit": base.with_units([0]),
        "1 unit of short stroke": changed(
            base.with_units([0]), stroke=0.07 * base.segment_height[0]
        ),
        f"{N_GRADED} units": uniform,
        f"{N_GRADED} graded units": changed(
            graded,
            stroke=grades * graded.stroke[0],
            bistable_stiffness=grades[::-1] * graded.bistable_stiffness[0],
        ),
    }
    folds = {label: limits(finger).force_linearity for label, finger in fingers.items()}
    for (label, finger), distance in product(fingers.items(), CROSSED_DISTANCES):
        near = changed(finger, force_linearity=folds[label] * (1.0 - distance))
        side = f"{label}, α at fold {'−' if distance > 0.0 else '+'} {abs(distance):g}"
        for ratio in CROSSED_RATIOS:
            yield Variant(f"{side}, k_L/k_b = {ratio:g}", with_bars(near, ratio))
        yield Variant(f"{side}, k_L = ∞", rigid(near))


def _walls(base: Finger) -> Iterator[Variant]:
    """Walls from nearly rigid to without stiffness, of all units and of the first alone."""
    finger = repeated(base, N_GRADED)
    softness = 1.0 / float(base.bistable_stiffness.min())
    for ratio in WALL_RATIOS:
        label = f"c_w k_b = {ratio:g}"
        yield from _both(label, changed(finger, wall_compliance=ratio * softness))
        first = np.zeros(N_GRADED)
        first[0] = ratio * softness
        yield from _both(f"{label}, first unit", changed(finger, wall_compliance=first))


def _coupling(base: Finger) -> Iterator[Variant]:
    """Hinges that turn their neighbors, up to where the energy has no bottom; walls as well."""
    finger = repeated(base, N_GRADED)
    softness = 0.1 / float(base.bistable_stiffness.min())
    for factor, ratio in product(STIFF_HINGES, COUPLING_RATIOS):
        hinges = factor * finger.hinge_stiffness[:, 0]
        stiff = changed(finger, hinge_stiffness=hinges, hinge_coupling=ratio * hinges.min())
        label = f"k_θ × {factor:g}, κ/k_θ = {ratio:g}"
        yield from _both(label, stiff)
        if factor > 1.0:
            yield from _both(f"{label}, walls", changed(stiff, wall_compliance=softness))


def _loads(base: Finger) -> Iterator[Variant]:
    """Dead loads up to just below the one that resets a unit, and beyond it."""
    finger = changed(repeated(base, LOADED_UNITS), gravity_y=1.0)
    fingers = {f"k_L/k_b = {ratio:g}": with_bars(finger, ratio) for ratio in LOADED_RATIOS}
    inverted = "1" * LOADED_UNITS
    for bars, unloaded in {**fingers, "k_L = ∞": rigid(finger)}.items():
        for words, load in DEAD_LOADS.items():
            largest = _share_held(changed(unloaded, **load))
            for below in BELOW_RESET if np.isfinite(largest) else ():
                share = largest * (1.0 - below)
                loaded = changed(unloaded, **{name: share * value for name, value in load.items()})
                side = f"{abs(below):g} {'below' if below > 0.0 else 'beyond'} its reset"
                yield Variant(f"{words}, {side}, {bars}", loaded, (inverted,))


def _share_held(finger: Finger) -> float:
    """The share of its loads at which the first inverted unit resets; NaN where none does."""
    inverted = np.ones((finger.n_units, 1), bool)
    free = settle(UnitSolutions.of(finger.unloaded), chain_potential, inverted, DEFAULT_TOLERANCE)
    if free.status[0] != Status.STABLE:
        return np.nan
    start = free.equilibrium.coordinates
    return float(grown(UnitSolutions.of(finger), chain_potential, inverted, start).share[0])


def _mirror(base: Finger) -> Iterator[Variant]:
    """One unit from impossible shapes, each next to a minimum of the equations."""
    unit = base.with_units([0])
    for name, (corners, pattern) in FOLDED_STARTS.items():
        yield from _both(f"from {name}", unit, patterns=(pattern,), start=Start(corners=corners))


def _pressure(base: Finger) -> Iterator[Variant]:
    """Thresholds of pressure that rises or falls on all units at once."""
    unit = base.with_units([0])
    for n_units in (1, N_GRADED):
        finger = _with_strokes(unit, np.linspace(0.9, 1.15, n_units))
        for ratio in PRESSED_RATIOS[:: 1 if n_units == 1 else 3]:
            label = f"{n_units} unit{'s' * (n_units > 1)}, k_L/k_b = {ratio:g}"
            yield from _driven(label, with_bars(finger, ratio))
        yield from _driven(f"{n_units} unit{'s' * (n_units > 1)}, k_L = ∞", rigid(finger))
    for apart, (bars, finger) in product(NEARLY_EQUAL, _stiff_and_rigid(unit).items()):
        factors = np.array([1.0, 1.0 + apart])
        pair = changed(
            repeated(finger, 2),
            bistable_stiffness=factors * finger.bistable_stiffness[0],
            hinge_stiffness=factors * finger.hinge_stiffness[0],
        )
        yield from _driven(f"thresholds {apart:g} apart, {bars}", pair, alternating=False)
    fold = float(limits(unit).force_linearity[0])
    for distance, (bars, finger) in product(PRESSED_DISTANCES, _stiff_and_rigid(unit).items()):
        near = changed(finger, force_linearity=fold * (1.0 - distance))
        yield from _driven(f"α at fold − {distance:g}, {bars}", near)
    for linearity in (0.12, 0.2, 0.3, 0.35, 0.5):
        yield from _driven(f"α = {linearity:g}", changed(unit, force_linearity=linearity))
    softness = 1.0 / float(unit.bistable_stiffness.min())
    for ratio, n_units in product(PRESSED_WALLS, (1, 2)):
        finger = _with_strokes(unit, np.linspace(1.0, 1.1, n_units))
        walled = changed(finger, wall_compliance=ratio * softness)
        label = f"{n_units} unit{'s' * (n_units > 1)}, c_w k_b = {ratio:g}"
        yield from _driven(label, walled, alternating=False)
    for ratio, (bars, finger) in product(PRESSED_COUPLINGS, _stiff_and_rigid(unit).items()):
        coupling = ratio * float(unit.hinge_stiffness.min())
        graded = _with_strokes(finger, np.linspace(1.0, 1.1, 2))
        coupled = changed(graded, hinge_coupling=coupling)
        yield from _driven(f"κ/k_θ = {ratio:g}, {bars}", coupled, alternating=False)


def _driven(label: str, finger: Finger, *, alternating: bool = True) -> Iterator[Variant]:
    """The finger under pressure that rises or falls, from patterns that it may change."""
    ends = few_patterns(finger.n_units, with_ground=True)
    inverted, ground, *others = ends[0], ends[-1], *ends[1:-1]
    for words, sign, first in (("rises", 1, ground), ("falls", -1, inverted)):
        patterns = (first, *others) if alternating else (first,)
        yield Variant(f"{label}, pressure {words}", finger, patterns, pressure=sign)


def _with_strokes(unit: Finger, factors: Array) -> Finger:
    return changed(repeated(unit, len(factors)), stroke=factors * unit.stroke[0])


def _stiff_and_rigid(unit: Finger) -> dict[str, Finger]:
    return {"k_L/k_b = 1e3": with_bars(unit, 1e3), "k_L = ∞": rigid(unit)}


PATTERNS = Family("patterns", _patterns)  # states of the finger as it is given
FAMILIES = (
    Family("stiffness", _stiffness),  # k_L/k_b from 1 to 1e15, and infinite
    Family("linearity", _linearity),  # α from 0 through the loss of bistability to 1
    Family("stroke", _stroke),  # d from 1e-3 mm to more than twice the height
    Family("length", _length),  # 1 to 64 units
    Family("hinge", _hinge),  # k_θ from 0 to 1e12 N mm/rad
    Family("scale", _scale),  # lengths in m, µm, km and nm give the answer in mm
    Family("graded", _graded),  # units that differ by orders of magnitude
    Family("wells", _wells),  # two wells of nearly the same energy
    Family("guess", _guess),  # searches that begin at 0.5 to 2 strokes
    Family("fold", _fold),  # α, k_θ and d at the loss of bistability, to 1e-12 of it
    Family("crossed", _crossed),  # k_L, the distance to the fold, units and grading at once
    Family("walls", _walls),  # c_w k_b from 1e-9 to 1e6, of all units or one
    Family("coupling", _coupling),  # κ/k_θ from −0.499 to 0.4999999
    Family("loads", _loads),  # forces, couples and weights up to those that reset a unit
    Family("pressure", _pressure),  # thresholds of pressure, at the ends of what there is
    Family("contact", bodies),  # a body in the way: large and small, grazing, in corners
    Family("mirror", _mirror),  # searches that begin folded through or mirrored
)
