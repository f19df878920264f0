"""Fingers as they come out of the mold: draws of a design whose values scatter unit by unit.

Each value of each unit is drawn by itself from a normal distribution around the given one. What is
one value of the whole finger is one draw in all its units: its material, its width, its layer, its
bars. A key's draws depend on the seed and the key alone.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import product

import numpy as np

from dpgcli.arrays import Array, Flags, Indices
from dpgcli.design.by_unit import size_by_unit, unit_by_unit
from dpgcli.design.coupling import is_bounded
from dpgcli.design.dimensions import (
    HINGE_COUPLING,
    LINEAR_STIFFNESS,
    Design,
    GivenPressure,
    Sizes,
    Tolerance,
    are_possible,
    unit_range,
)
from dpgcli.design.geometry import REFERENCE, snap_pressure
from dpgcli.design.problems import Issue, number, of_design
from dpgcli.design.resolve import Resolution, resolve
from dpgcli.design.rules import DERIVATIONS, FORCE_LINEARITY, HINGE_STIFFNESS, Derivation
from dpgcli.design.scene import Scene
from dpgcli.design.snap_pressures import SNAP, SNAP_PRESSURE
from dpgcli.design.uncertainty import given, tolerance_issues
from dpgcli.mechanics.finger import KEYS, Finger
from dpgcli.records import dataclass

OF_UNITS = (  # in this order, which is that of their streams of random numbers: append only
    "dome_height_mm",
    "dome_thickness_mm",
    "chamber_length_mm",
    "channel_width_mm",
    "unit_separation_mm",
    "segment_length_mm",
    "stroke_mm",
    "bistable_stiffness_N_per_mm",
    "force_linearity",
    "hinge_stiffness_N_mm_per_rad",
    "wall_compliance_mm_per_N",
)
OF_FINGERS = (
    "elastic_modulus_MPa",
    "unit_cell_mm",
    "chamber_width_mm",
    "limiting_layer_thickness_mm",
    "segment_height_mm",
    LINEAR_STIFFNESS,
    HINGE_COUPLING,
)
WIDTH_FROM = {"unit_cell_mm": "chamber_width_mm"}  # which makes the chamber's, unless it is given
SCATTERED = (*OF_UNITS, *OF_FINGERS)


@dataclass(frozen=True, eq=False)
class Scattered:
    """Draws of one design: their dimensions are resolved, lattice values still to be moved.

    `moves` (1 or unit, draw) are what is added to the finger's arrays, by the key of a spec, and
    `are_wrong` (draw,) draws that no finger can have.
    """

    resolution: Resolution
    moves: Mapping[str, Array]
    are_wrong: Flags

    def batches(self) -> Iterator[tuple[Indices, Scene, Finger]]:
        """The draws that are fingers: scenes of arrays by draw, and their fingers moved.

        The areas on which pressure works are those of the fingers before: where lattice values
        scatter, a dome that bears more snaps at a higher pressure.
        """
        for part in self.resolution.alike(np.flatnonzero(~self.are_wrong)):
            scene = self.resolution.batch(part)
            moved = {KEYS[key]: move[:, part] for key, move in self.moves.items()}
            arrays = scene.finger.arrays()
            changes = {name: arrays[name] + move for name, move in moved.items()}
            yield part, scene, scene.finger.changed(**changes) if changes else scene.finger


def scatter_issues(design: Design, spread: Mapping[str, Tolerance]) -> Iterator[Issue]:
    """Keys that have no value here, or that a percentage says nothing about."""
    own = replace(design, tolerances=spread)
    yield from tolerance_issues(own, [*resolve(own).values])
    moved = (key for key, tolerance in spread.items() if tolerance.size > 0.0)
    for key, other in product(moved, DERIVATIONS):
        if _is_fixed(key, other, design):
            yield _fixed(key, other, design)


def _is_fixed(key: str, other: Derivation, design: Design) -> bool:
    """Whether a lattice value is given that a dimension which scatters would move.

    A rule says what it would be, as long as it is none of a calibration; else the value of the
    whole finger is no more that of a unit of another size.
    """
    if WIDTH_FROM.get(key, key) not in other.needs or not given(design, other.key):
        return False
    sections = (design.finger, *design.overrides.values())
    known = {WIDTH_FROM.get(size, size) for section in sections for size in section.geometry}
    is_checked = other.origin is None and known.issuperset(other.needs)
    is_of_unit = key in OF_UNITS and other.key in design.finger.lattice
    return is_checked or (is_of_unit and other is not FORCE_LINEARITY)


def _fixed(key: str, other: Derivation, design: Design) -> Issue:
    value = number(of_design(given(design, other.key)[0], 0))
    hint = f"scatter {other.key} instead, or take it out of the spec: it would follow {key}"
    return Issue((key,), f"no {other.key} given in the spec", value, hint)


def scattered(
    design: Design, spread: Mapping[str, Tolerance], n_draws: int, seed: int
) -> Scattered:
    """Draws of a single design by the standard deviations of its values, by key.

    The deviation of a dimension reaches the lattice by the rules behind its values; that of a
    lattice value moves the value itself, whatever it comes from.

    >>> from dpgcli.design.dimensions import GivenValues
    >>> section = {"segment_length_mm": 13.5, "segment_height_mm": 10.75, "stroke_mm": 3.5,
    ...     "bistable_stiffness_N_per_mm": 12.84, "force_linearity": 0.043,
    ...     "hinge_stiffness_N_mm_per_rad": 24.2}
    >>> lattice = {key: np.array([value]) for key, value in section.items()}
    >>> base = Design(2, GivenValues(lattice=lattice))
    >>> draws = scattered(base, {"stroke_mm": Tolerance(0.1, False)}, 1000, 1)
    >>> (_, _, finger), = draws.batches()
    >>> finger.stroke.shape, finger.stroke.std(axis=1, ddof=1).round(2).tolist()
    ((2, 1000), [0.1, 0.1])
    """
    drawn = {key: _deviates(key, seed, n_draws, design.units) for key in spread}
    sizes = {key: own for key, own in drawn.items() if key not in KEYS}
    lattice = {key: tolerance for key, tolerance in spread.items() if key in KEYS}
    moved, are_wrong = _moved(design, spread, sizes)
    resolution = resolve(replace(moved, n_designs=n_draws, tolerances=lattice))
    are_wrong = are_wrong | resolution.are_wrong
    moves = {}
    for key in (key for key in drawn if key in KEYS):
        value = resolution.lattice[KEYS[key]]
        moves[key] = spread[key].of(value) * drawn[key]
        are_wrong = are_wrong | ~are_possible(key, value + moves[key]).all(axis=0)
    hinge, coupling = (
        resolution.lattice.get(KEYS[key], np.zeros((1, 1))) + moves.get(key, np.zeros((1, 1)))
        for key in (HINGE_STIFFNESS.key, HINGE_COUPLING)
    )
    are_wrong = are_wrong | ~is_bounded(coupling, hinge).all(axis=0)
    return Scattered(resolution, moves, are_wrong)


def _deviates(key: str, seed: int, n_draws: int, n_units: int) -> Array:
    """Standard normal deviates, (1 or unit, draw): more draws begin with those of fewer."""
    stream = np.random.default_rng([seed, SCATTERED.index(key)])
    return stream.standard_normal((n_draws, n_units if key in OF_UNITS else 1)).T


def _moved(
    design: Design, spread: Mapping[str, Tolerance], drawn: Mapping[str, Array]
) -> tuple[Design, Flags]:
    """The designs with scattered dimensions, and those of which one is impossible by itself."""
    wrong = [np.zeros(1, bool)]

    def scattered_sizes(sizes: Sizes, keys: Mapping[str, Array]) -> Sizes:
        found = dict(sizes)
        for key, deviate in keys.items():
            if key not in sizes:
                continue
            value = sizes[key] + spread[key].of(sizes[key]) * deviate
            is_possible = are_possible(key, value)
            wrong.append(~is_possible)
            found[key] = np.where(is_possible, value, sizes[key])
        return found

    own = unit_by_unit(design)
    common = {key: z[0] for key, z in drawn.items() if key in OF_FINGERS}
    overrides = {}
    for unit, section in own.overrides.items():
        every = {**design.finger.geometry, **section.geometry}
        its = {key: z[int(unit) - 1] for key, z in drawn.items() if key in OF_UNITS}
        changed = scattered_sizes({key: every[key] for key in its.keys() & every.keys()}, its)
        known = scattered_sizes(section.geometry, common)
        overrides[unit] = replace(section, geometry={**known, **changed})
    finger = replace(design.finger, geometry=scattered_sizes(design.finger.geometry, common))
    are_wrong = np.any(np.broadcast_arrays(*wrong), axis=0)
    moved = replace(own, finger=finger, overrides=overrides)
    return replace(moved, pressure=_snapping(design, moved)), np.asarray(are_wrong)


def _snapping(design: Design, moved: Design) -> GivenPressure | None:
    """What is said of pressure; a snap pressure that is given is that of the sizes that are given.

    Those of other sizes are scaled from it as any are, E t^2.5 h^1.2.
    """
    given = design.pressure
    if given is None:
        return None
    scale = snap_pressure(*_dome_sizes(moved)) / snap_pressure(*_dome_sizes(design))
    overrides = {}
    for unit, row in enumerate(np.broadcast_to(scale, (design.units, scale.shape[1])), start=1):
        said: dict[str, Array] = dict(given.values)
        for text, own in given.overrides.items():
            said |= own if unit in unit_range(text) else {}
        if SNAP in said:
            said[SNAP] = said[SNAP] * row
        overrides[str(unit)] = said
    return replace(given, values={}, overrides=overrides)


def _dome_sizes(design: Design) -> tuple[Array, Array, Array]:
    """Height, thickness and modulus of each dome; of the reference where none is given."""
    usual = (REFERENCE.dome_height, REFERENCE.dome_thickness, REFERENCE.elastic_modulus)
    pairs = zip(SNAP_PRESSURE.needs, usual, strict=True)
    known = [(size_by_unit(design, key), number) for key, number in pairs]
    height, thickness, modulus = (
        np.array([[number]]) if size is None else size for size, number in known
    )
    return height, thickness, modulus
