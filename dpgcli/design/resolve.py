"""From designs to lattices: values unit by unit, their sources, and what is wrong, in one pass."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field, replace
from functools import cached_property, partial

import numpy as np

from dpgcli.arrays import Array, Flags, Indices
from dpgcli.design.calibrations import Calibration
from dpgcli.design.coupling import coupling_of
from dpgcli.design.dimensions import (
    HINGE_COUPLING,
    LEAVE_ONE_OUT,
    LINEAR_STIFFNESS,
    WALL_COMPLIANCE,
    Design,
    GivenValues,
    UnitGroup,
    check_widths,
    groups_of,
    range_issues,
)
from dpgcli.design.domes import Domes, domes_of
from dpgcli.design.fitted import from_file
from dpgcli.design.footing import DesignCase, kinds
from dpgcli.design.lines import history_of, line_issues, line_of, units_by_line
from dpgcli.design.loads import check_across, load_issues
from dpgcli.design.model_error import model_error_of
from dpgcli.design.outputs import Trust
from dpgcli.design.pressure import Pressure
from dpgcli.design.problems import Issue, Problems, number, of_design
from dpgcli.design.rules import (
    FORCE_LINEARITY,
    HINGE_STIFFNESS,
    SEGMENT_HEIGHT,
    STROKE,
    WALLS,
    Value,
    all_by,
)
from dpgcli.design.scene import (
    ORIGINS,
    Chambers,
    Gripper,
    ModelError,
    Origin,
    Scene,
    Uncertainty,
)
from dpgcli.design.snap_pressures import AREA, SNAP, answers_to_pressure
from dpgcli.design.sources import sources_of
from dpgcli.design.trust import trusts_of, warnings_of
from dpgcli.design.uncertainty import Share, tolerance_issues, tolerance_steps, uncertainty_of
from dpgcli.design.values import value_of
from dpgcli.design.volumes import swept_shape
from dpgcli.mechanics.finger import KEYS, LOADS, Finger
from dpgcli.records import dataclass
from dpgcli.text import KeyPath

NEARLY_RIGID = 1.0e4  # N/mm; the study names no number
NO_LEAVE_ONE_OUT = Issue(
    ("model_error",),
    "a calibration in use that has a leave-one-out error",
    "none",
    "dpg fit finger writes one; or give a percentage such as 5%",
)
Pairs = Sequence[tuple[UnitGroup, Value]]


@dataclass(frozen=True, eq=False)
class Resolution:
    """Lattice values by key and group of units, how domes answer, and what is wrong.

    `answers` are effective areas or snap pressures, none where the designs have no pressure.
    """

    design: Design
    domes: Domes
    values: Mapping[str, Pairs]
    problems: Problems
    answers: Mapping[str, Pairs] = field(default_factory=dict)

    @cached_property
    def are_wrong(self) -> Flags:
        """Designs that no finger can have, (design,)."""
        return self.problems.are_met(self.design.n_designs)

    @property
    def gravest_origins(self) -> Indices:
        """The gravest origin among each design's values, (design,), as indices of `ORIGINS`.

        Values that the geometry alone fixes count as given; so does an assumed stiffness of the
        bars, which hardly matters.
        """
        gravest = np.zeros(self.design.n_designs, np.int64)
        given, *harmless = map(ORIGINS.index, (Origin.GIVEN, Origin.DERIVED, Origin.ASSUMED))
        for _, value in (pair for pairs in self.values.values() for pair in pairs):
            is_harmless = np.isin(value.origin, harmless)
            gravest = np.maximum(gravest, np.where(is_harmless, given, value.origin))
        return gravest

    @cached_property
    def lattice(self) -> dict[str, Array]:
        """The finger's arrays by name, (1 or unit, 1 or design); senseless for what is wrong."""
        units = self.design.units
        arrays = {
            KEYS[key]: _by_unit(units, [(group, value.numbers) for group, value in pairs])
            for key, pairs in self.values.items()
        }
        if FORCE_LINEARITY not in self.domes.derivations:
            arrays["force_linearity"] = np.zeros((1, 1))
        if self.domes.travel:
            travels = [
                (group, self.domes.travel_at(group.geometry.get("dome_height_mm")))
                for group, _ in self.values[STROKE.key]
            ]
            arrays["dome_travel"] = _by_unit(units, travels)
        return arrays

    def scene(self) -> Scene:
        """The scene of a single design, if nothing is wrong with it."""
        batch = self.batch(np.zeros(1, np.int64))
        gripper, layer = batch.gripper, batch.layer_thickness
        return Scene(
            batch.finger,
            tuple(sources_of({**self.values, **self.answers}, self.design.units)),
            gripper and Gripper(*(np.asarray(value).item() for value in vars(gripper).values())),
            None if layer is None else np.asarray(layer).item(),
            self._uncertainty(),
            self.model_error,
            self.chambers(np.zeros(1, np.int64)),
            self.trusts,
            self.warnings,
            batch.pressure,
            gravity=batch.gravity,
        )

    @property
    def model_error(self) -> ModelError:
        """What is known of the model's own error, for a single design."""
        return model_error_of(self._case(0))

    @property
    def trusts(self) -> tuple[Trust, ...]:
        """What each output rests on, for a single design."""
        return trusts_of(self._case(0))

    @property
    def warnings(self) -> tuple[str, ...]:
        """The warnings of the calibrations in use."""
        return warnings_of(self._case(0))

    def kinds_of_trust(self, designs: Indices) -> list[tuple[tuple[Trust, ...], int]]:
        """What outputs of some designs, none of them wrong, rest on, and how many of them."""
        values = {**_each(self.values), **_each(self.answers)}
        are_loaded = self._are_loaded(designs)
        parts = designs[~are_loaded], designs[are_loaded]
        found = [pair for part in parts if len(part) for pair in kinds(values, part)]
        return [(trusts_of(self._case(place)), count) for place, count in found]

    def _case(self, place: int) -> DesignCase:
        return DesignCase(self.design, self.domes, _each(self.values), place, _each(self.answers))

    def batch(self, designs: Indices) -> Scene:
        """The scene of some of the designs, none of them wrong, with arrays by design.

        Bars and walls are rigid in all or in none; sources, uncertainty and chambers are left out.
        """
        arrays = {name: _picked(values, designs) for name, values in self.lattice.items()}
        arrays |= self._loads(designs)
        finger = Finger(self.design.units, **arrays, law=self.domes.law)  # type: ignore[arg-type]
        layer = self.design.finger.geometry.get("limiting_layer_thickness_mm")
        thickness = None if layer is None else _picked(layer, designs)
        gripper, pressure = self._gripper(designs), self._pressure(designs)
        body = self.design.body and self.design.body.take_lanes(designs)
        friction = self.design.friction and self.design.friction.take_lanes(designs)
        found = Scene(finger, (), gripper, thickness, pressure=pressure, body=body)
        found = replace(found, held=self.design.held, friction=friction)
        loads = self.design.loads
        return found if loads is None else replace(found, gravity=loads.along)

    def _loads(self, designs: Indices) -> dict[str, Array]:
        """The dead loads by name; none where the spec says nothing of them."""
        if self.design.loads is None:
            return {}
        loads = self.design.loads.arrays(self._mounting_angle).items()
        return {name: _picked(values, designs) for name, values in loads}

    def _are_loaded(self, designs: Indices) -> Flags:
        """Which designs bear any load."""
        none = np.zeros((1, len(designs)))
        loads = self._loads(designs)
        return np.asarray(np.any([loads.get(name, none).any(axis=0) for name in LOADS], axis=0))

    def alike(self, designs: Indices) -> list[Indices]:
        """Some of the designs, none of them wrong, apart by which kinds of energy they have.

        Bars or all walls may be rigid, hinges turn each other or not, loads act or not.
        """
        if not len(designs):
            return []
        kind = np.isinf(_picked(self.lattice["linear_stiffness"], designs)[0]).astype(int)
        if "wall_compliance" in self.lattice:
            kind += 2 * (_picked(self.lattice["wall_compliance"], designs) > 0.0).any(axis=0)
        if "hinge_coupling" in self.lattice:
            kind += 4 * (_picked(self.lattice["hinge_coupling"], designs)[0] != 0.0)
        kind += 8 * self._are_loaded(designs)
        return [part for part in (designs[kind == k ^ 1] for k in range(16)) if len(part)]

    def chambers(self, designs: Indices) -> Chambers:
        """Sizes of the chambers of some designs."""
        groups = [group for group in groups_of(self.design) if group.units]
        keys = ("unit_separation_mm", "chamber_width_mm", "dome_height_mm")
        unknown = np.full(1, np.nan)
        pairs = ([(group, group.geometry.get(key, unknown)) for group in groups] for key in keys)
        by_unit = (_by_unit(self.design.units, sizes) for sizes in pairs)
        return Chambers(*(_picked(sizes, designs) for sizes in by_unit))

    def _gripper(self, designs: Indices) -> Gripper | None:
        given = self.design.gripper
        if not given:
            return None
        angle = _picked(self._mounting_angle, designs)
        return Gripper(_picked(given["base_spacing_mm"], designs), angle)

    @property
    def _mounting_angle(self) -> Array:
        """The tilt of the fingers of a gripper, rad; 0 of a finger by itself."""
        degrees = self.design.gripper.get("mounting_angle_deg", np.zeros(1))
        return np.asarray(degrees * (np.pi / 180.0))  # as np.radians, which takes no complex ones

    def _pressure(self, designs: Indices) -> Pressure | None:
        given, units = self.design.pressure, self.design.units
        if given is None:
            return None
        arrays = {
            key: _picked(_by_unit(units, [(g, v.numbers) for g, v in pairs]), designs)
            for key, pairs in self.answers.items()
        }
        return Pressure(
            tuple(units_by_line(given, units)),
            line_of(given, units),
            arrays.get(AREA),
            arrays.get(SNAP),
            swept_shape(self.domes) if SNAP in arrays else None,
            history_of(given, units),
        )

    def _uncertainty(self) -> Uncertainty | None:
        """What a single design's values, and the model if the spec counts it in, may be off by."""
        design = self.design
        steps = tolerance_steps(design, self.lattice, lambda moved: resolve(moved).lattice)
        share = None if design.model_error is None else self.model_error.share
        return uncertainty_of(design.calibrations, [*self._shares()], [*steps], share or 0.0)

    def _shares(self) -> Iterator[Share]:
        """Standard errors by those of calibration files, unit by unit."""
        for key, pairs in self.values.items():
            for place in range(len(self.design.calibrations)):
                errors = [(group, self._error_by(place, key, value)) for group, value in pairs]
                if any(error.any() for _, error in errors):
                    yield Share(place, key, _by_unit(self.design.units, errors))

    def _error_by(self, place: int, key: str, value: Value) -> Array:
        """How far a value is off by the error of a file's value of that key.

        That of what a curve is measured by cancels where the value is taken from the same file, as
        it is or scaled. Elsewhere the curve is off: as if the value were, the other way.
        """
        is_own, none = value.file == place, np.zeros(1)
        measure = None
        if self.design.calibrations[place] is self.domes.calibration:
            measure = self.domes.measure_error(key)
        if measure is None:
            return _error(value) if is_own else none
        return none if is_own else -measure * value.numbers


def resolve(design: Design) -> Resolution:
    """The lattices of a batch of designs, where their values come from, and what is wrong.

    >>> section = {"segment_length_mm": 13.5, "segment_height_mm": 10.75, "stroke_mm": 3.5,
    ...     "bistable_stiffness_N_per_mm": 12.84, "force_linearity": 0.043,
    ...     "hinge_stiffness_N_mm_per_rad": 24.2}
    >>> lattice = {key: np.array([value]) for key, value in section.items()}
    >>> base = Design(2, GivenValues(lattice=lattice), linear_stiffness=np.array([np.inf]))
    >>> found = resolve(base.with_values({"finger.lattice.stroke_mm": np.array([3.0, 3.5])}))
    >>> found.lattice["stroke"], found.are_wrong
    (array([[3. , 3.5]]), array([False, False]))
    """
    problems = Problems()
    for issue in range_issues(design.units, design.overrides):
        problems.everywhere(issue)
    check_widths(design.finger.geometry, problems)
    for issue in line_issues(design.pressure, design.units) if design.pressure else ():
        problems.everywhere(issue)
    if design.loads is not None:
        for issue in load_issues(design.loads, design.units):
            problems.everywhere(issue)
        if design.gripper:
            check_across(design.loads, problems)
    domes = domes_of(design.law, design.calibrations)
    if isinstance(domes, Issue):
        problems.everywhere(domes)
        return Resolution(design, Domes(), {}, problems)
    _check_linearities(design, domes, problems)
    every = groups_of(design)
    base, groups = every[0], [group for group in every if group.units]
    values: dict[str, Pairs] = {}
    for derivation in domes.derivations:
        chosen = [base] if derivation is SEGMENT_HEIGHT else groups
        found = [(group, value_of(derivation, group, base, problems)) for group in chosen]
        values[derivation.key] = [(g, value) for g, value in found if value is not None]
    values[LINEAR_STIFFNESS] = [(base, _bars(design, base))]
    found = [(group, _walls(group, problems)) for group in groups]
    walls = [(group, value) for group, value in found if value is not None]
    if any(_may_yield(value, WALL_COMPLIANCE in design.tolerances) for _, value in walls):
        values[WALL_COMPLIANCE] = walls
    coupling = coupling_of(design, base, values[HINGE_STIFFNESS.key], problems)
    if coupling is not None and _may_yield(coupling, HINGE_COUPLING in design.tolerances):
        values[HINGE_COUPLING] = [(base, coupling)]
    answers: Mapping[str, Pairs] = {}
    if design.pressure is not None:
        answers = answers_to_pressure(design.pressure, domes, groups, problems)
    resolution = Resolution(design, domes, values, problems, answers)
    for issue in tolerance_issues(design, [*values]):
        problems.everywhere(issue)
    if design.model_error == LEAVE_ONE_OUT and resolution.model_error.share is None:
        problems.everywhere(NO_LEAVE_ONE_OUT)
    return resolution


def _check_linearities(design: Design, domes: Domes, problems: Problems) -> None:
    """Note force linearities beside a law that has none."""
    if FORCE_LINEARITY in domes.derivations:
        return
    paths: dict[KeyPath, GivenValues] = {("finger", "lattice"): design.finger}
    for units, own in design.overrides.items():
        paths["finger", "overrides", units, "lattice"] = own
    for path, section in paths.items():
        given = section.lattice.get(FORCE_LINEARITY.key)
        if given is not None:
            where = (*path, FORCE_LINEARITY.key)
            problems.add(np.ones(1, bool), partial(_linearity_issue, where, design.law, given))


def _linearity_issue(where: KeyPath, law: str | None, given: Array, design: int) -> Issue:
    hint = "the shape of the curve is that of its calibration"
    return Issue(where, f"none beside law: {law}", number(of_design(given, design)), hint)


def _bars(design: Design, base: UnitGroup) -> Value:
    """The stiffness of the bars: given, fitted, or assumed."""
    if design.linear_stiffness is not None:
        return all_by(design.linear_stiffness, Origin.GIVEN, "as given")
    rule = "the study calls the bars nearly rigid and names no number"
    assumed = all_by(np.array([NEARLY_RIGID]), Origin.ASSUMED, rule)
    return _fitted(LINEAR_STIFFNESS, base) or assumed


def _walls(group: UnitGroup, problems: Problems) -> Value | None:
    """How far walls give way: given, fitted, or not at all; None where a file's does not fit."""
    if WALL_COMPLIANCE in group.lattice:
        return all_by(group.lattice[WALL_COMPLIANCE], Origin.GIVEN, "as given")
    for place, calibration in enumerate(group.calibrations):
        if isinstance(calibration, Calibration) and calibration.has(WALL_COMPLIANCE):
            return from_file(WALLS, group, calibration, place, problems)
    return all_by(np.zeros(1), Origin.ASSUMED, "walls are rigid unless given or calibrated")


def _may_yield(value: Value, is_tolerated: bool) -> bool:
    """Whether a value counts, or may by a standard error or a tolerance of what there is."""
    assumed = ORIGINS.index(Origin.ASSUMED)
    is_known = bool((value.origin != assumed).any())
    return bool(value.numbers.any() or _error(value).any() or (is_tolerated and is_known))


def _fitted(key: str, group: UnitGroup) -> Value | None:
    """The value of the first calibration that has one."""
    for place, calibration in enumerate(group.calibrations):
        if isinstance(calibration, Calibration) and key in calibration.values:
            fitted = calibration.values[key]
            value = all_by(
                np.array([fitted.value]), Origin.CALIBRATED, f"from {calibration.source}"
            )
            error = fitted.standard_error
            return replace(
                value, standard_error=None if error is None else np.array([error]), file=place
            )
    return None


def _by_unit(n_units: int, pairs: Sequence[tuple[UnitGroup, Array]]) -> Array:
    """Values by unit, (unit, design), or (1, design) where all units share them."""
    numbers = np.broadcast_arrays(*(values for _, values in pairs))
    if all(np.array_equal(numbers[0], other) for other in numbers[1:]):
        return numbers[0][None]
    rows = {
        unit: row for (group, _), row in zip(pairs, numbers, strict=True) for unit in group.units
    }
    return np.stack([rows[unit] for unit in range(1, n_units + 1)])


def _picked(values: Array, designs: Indices) -> Array:
    """Values of some designs along the last axis."""
    if values.shape[-1] == 1:
        return np.repeat(values, len(designs), axis=-1)
    return np.take(values, designs, axis=-1)


def _each(values: Mapping[str, Pairs]) -> dict[str, list[Value]]:
    """Values by key, one for each group of units."""
    return {key: [value for _, value in pairs] for key, pairs in values.items()}


def _error(value: Value) -> Array:
    return np.zeros(1) if value.standard_error is None else value.standard_error
