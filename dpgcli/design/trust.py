"""What to trust of a finger's outputs: the basis of each and what is known of its error.

It depends on the law, on where values are from, on walls and on what is assumed. Numbers of known
errors are ours: `dpg compare` on finite-element fingers, and moments on a unit, at the study's
dimensions; see the page trust of the manual.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

from dpgcli.design.calibrations import Calibration
from dpgcli.design.dimensions import LINEAR_STIFFNESS, WALL_COMPLIANCE
from dpgcli.design.footing import MOVED, DesignCase, Footing
from dpgcli.design.model_error import model_error_of, shapes_in
from dpgcli.design.outputs import Basis, Output, Trust
from dpgcli.design.rules import (
    BISTABLE_STIFFNESS,
    FORCE_LINEARITY,
    HINGE_STIFFNESS,
    SEGMENT_HEIGHT,
    STROKE,
)

UNKNOWN = "unknown"
SHALLOW = "a twentieth of finite elements' (3.2 mJ in an inverted dome, not 38–79)"
SHALLOW_DOUBT = "published springs hold a twentieth of the energy that finite elements have"
TAKE_A_CURVE = "take a dome's curve (dpg fit bistable, dpg fe dome) with law: push_only"
PULLING = "domes at rest pull in this law; real ones do not touch their neighbor"
RIGID_WALLS = "walls are taken as rigid, real ones give way"
GIVE_WALLS = "say finger.wall_compliance_mm_per_N: dpg help laws"
ASSUMED_BARS = "the stiffest way of a straight finger is that of its bars, k_L/n with 1e4 N/mm"
ASSUMED_AREA = (
    "a dome's area is assumed: the published snap force over finite elements' snap pressure"
)
ASSUMED_SNAP = "the snap pressure is assumed: that of finite elements of the study's dome"
SAY_SNAP = "say pressure.snap_pressure_MPa, or effective_area_mm2, as measured"
BRIDGED_RESET = "reset pressures are assumed: nothing is sampled where domes come back"
SAMPLE = "sample the dome's curve between rest and its inverted well"
CALIBRATE_HERE = "calibrate at this geometry: dpg help calibration"
BENDS_DOWN = (
    "the curve's spline bends down at travel 0: domes are not at rest there but further open, and "
    "where gaps are pulled shut the energy may have no bottom; give points nearer to rest"
)
UNDER_LOAD = "loads move it by stiffness"
WITH_WALLS = "within 30 % of finite elements, up to 60 % too stiff if walls are fitted to shapes"
DOMES = (BISTABLE_STIFFNESS.key, FORCE_LINEARITY.key)


def trusts_of(case: DesignCase) -> tuple[Trust, ...]:
    """What each output of a design rests on, in the order of `Output`."""
    return (
        _under_load(case) if case.is_loaded else _shapes(case),
        _energies(case),
        _barriers(case),
        _ground(case),
        _inverted(case),
        _axial(case),
        _pressures(case),
        _forces(case),
    )


def warnings_of(case: DesignCase) -> tuple[str, ...]:
    """The warnings of fits whose values, or curve, are in use, each with its file's name.

    And of a curve that bends down at rest, where all is in the spline between two points.
    """
    used = {value.file for each in case.values.values() for value in each}
    said = tuple(
        f"{file.source}: {warning}"
        for place, file in enumerate(case.design.calibrations)
        if isinstance(file, Calibration) and (place in used or file is case.domes.calibration)
        for warning in file.warnings
    )
    curve, calibration = case.domes.law.curve, case.domes.calibration
    if curve is None or calibration is None or curve.rest == 0.0:
        return said
    return (*said, f"{calibration.source}: {BENDS_DOWN}")


def _shapes(case: DesignCase) -> Trust:
    """Decided by walls, else by the segment height, unless something else is extrapolated."""
    lead = case.footings[WALL_COMPLIANCE if case.has_walls else SEGMENT_HEIGHT.key]
    gravest = case.gravest(*(key for key in case.footings if key != LINEAR_STIFFNESS))
    lead = gravest if gravest.basis is Basis.EXTRAPOLATED else lead
    error = shapes_in(model_error_of(case))
    return _checked(Trust(Output.SHAPES, lead.basis, error, str(lead)), lead)


def _under_load(case: DesignCase) -> Trust:
    """Shapes under dead loads: as good as the stiffness of the units that bear them."""
    free, stiffness = _shapes(case), [_ground(case), _inverted(case)]
    error = f"{free.known_error}; under loads as the stiffness of units"
    doubted = next((each for each in stiffness if each.doubt), None)
    if free.doubt or doubted is None:
        return replace(free, known_error=error)
    doubt = f"{UNDER_LOAD}: {doubted.doubt}"
    return replace(free, known_error=error, doubt=doubt, instead=doubted.instead)


def _energies(case: DesignCase) -> Trust:
    lead, curve = case.gravest(*DOMES), case.domes.calibration
    source = str(lead) if curve is None else f"curve of {curve.source}, {lead}"
    if case.has_published_domes:
        found = Trust(Output.ENERGIES, lead.basis, SHALLOW, source)
        return replace(found, doubt=SHALLOW_DOUBT, instead=TAKE_A_CURVE)
    if case.pulls and lead.origin in MOVED and not _is_of_grid(lead):
        lead = replace(
            lead, basis=Basis.EXTRAPOLATED
        )  # the scaling is that of domes that only push
        return _checked(Trust(Output.ENERGIES, lead.basis, UNKNOWN, source), lead)
    error = case.known_error(Output.ENERGIES, *DOMES, STROKE.key) or _fit_error(lead)
    return _checked(Trust(Output.ENERGIES, lead.basis, error, source), lead)


def _barriers(case: DesignCase) -> Trust:
    energies = replace(_energies(case), output=Output.BARRIERS)
    known, gaps = case.known_error(Output.BARRIERS, *DOMES), [*_gaps(case)]
    if known or not gaps:
        return replace(energies, known_error=known or energies.known_error)
    stretches = ", ".join("{:.4g} to {:.4g} mm".format(*gap) for _, gap in gaps)
    said = f"nothing is sampled in {gaps[0][0]} from {stretches} of the dome's travel"
    is_bridged = case.domes.calibration is not None
    how = "bridged by a polynomial" if is_bridged else "the fitted law goes on there"
    return replace(
        energies,
        basis=Basis.ASSUMED if is_bridged else Basis.EXTRAPOLATED,
        known_error=UNKNOWN,
        source=f"{said}: {how}",
        doubt=f"{said}: {how}",
        instead=SAMPLE,
    )


def _gaps(case: DesignCase) -> Iterator[tuple[str | None, Sequence[float]]]:
    """Stretches before the inverted well in which the dome's curve was not sampled."""
    file = case.domes.calibration or case.footings[BISTABLE_STIFFNESS.key].calibration
    if file is None or file.curve is None:
        return
    well = case.domes.travel
    if not well and STROKE.key in file.values:
        well = file.values[STROKE.key].value / file.curve.opening_per_travel
    for gap in file.curve.gaps:
        if not well or gap[0] < well:
            yield file.file, gap


def _ground(case: DesignCase) -> Trust:
    if case.pulls:
        is_published = case.has_published_domes
        basis = case.footings[BISTABLE_STIFFNESS.key].basis if is_published else Basis.ASSUMED
        error = f"{50 if is_published else 'hundreds of'} times too stiff against finite elements"
        found = Trust(Output.GROUND, basis, error, case.domes.law.description)
        return replace(found, doubt=PULLING, instead="take law: push_only")
    hinge = case.footings[HINGE_STIFFNESS.key]
    known = case.known_error(Output.GROUND, HINGE_STIFFNESS.key)
    if not known and hinge.basis in (Basis.FITTED, Basis.PUBLISHED):
        known = f"within about 20 % of finite elements{case.elsewhere(hinge.key)}"
    return _checked(Trust(Output.GROUND, hinge.basis, known or UNKNOWN, str(hinge)), hinge)


def _inverted(case: DesignCase) -> Trust:
    if case.has_walls:
        return _of_walls(case, Output.INVERTED, WITH_WALLS)
    times = "6" if case.has_published_domes else "hundreds of" if case.pulls else "40–90"
    error = f"{times} times too stiff against finite elements"
    return _of_rigid_walls(case, Output.INVERTED, error)


def _forces(case: DesignCase) -> Trust:
    if case.has_walls:
        return _of_walls(case, Output.FORCES, "pushes within about 10 % of finite elements")
    error = "pushes 13–43 % off finite elements; loads meet units that are too stiff"
    return _of_rigid_walls(case, Output.FORCES, error)


def _of_rigid_walls(case: DesignCase, output: Output, error: str) -> Trust:
    spring = case.footings[BISTABLE_STIFFNESS.key]
    basis = spring.basis if case.has_published_domes else Basis.ASSUMED
    source = f"rigid walls, {spring}"
    return Trust(output, basis, error, source, doubt=RIGID_WALLS, instead=GIVE_WALLS)


def _of_walls(case: DesignCase, output: Output, error: str) -> Trust:
    keys = (WALL_COMPLIANCE, BISTABLE_STIFFNESS.key, HINGE_STIFFNESS.key)
    lead, known = case.gravest(*keys), case.known_error(output, *keys)
    if not known and case.has_fitted_walls:
        known = error + case.elsewhere(WALL_COMPLIANCE, HINGE_STIFFNESS.key, SEGMENT_HEIGHT.key)
    if case.has_published_domes:
        said = Trust(output, lead.basis, UNKNOWN, str(lead))
        return replace(said, doubt=SHALLOW_DOUBT, instead=TAKE_A_CURVE)
    return _checked(Trust(output, lead.basis, known or UNKNOWN, str(lead)), lead)


def _axial(case: DesignCase) -> Trust:
    bars = case.footings[LINEAR_STIFFNESS]
    error = case.known_error(Output.AXIAL, LINEAR_STIFFNESS) or UNKNOWN
    found = Trust(Output.AXIAL, bars.basis, error, str(bars))
    if bars.basis is not Basis.ASSUMED:
        return found
    return replace(found, doubt=ASSUMED_BARS, instead=f"say finger.{LINEAR_STIFFNESS}")


def _pressures(case: DesignCase) -> Trust:
    answer = case.answer
    if answer is None:
        return _unasked_pressures(case)
    if answer.basis is Basis.ASSUMED:
        doubt = ASSUMED_AREA if case.domes.calibration is None else ASSUMED_SNAP
        found = Trust(Output.PRESSURES, Basis.ASSUMED, UNKNOWN, str(answer))
        return replace(found, doubt=doubt, instead=SAY_SNAP)
    known = case.known_by(Output.PRESSURES, answer) or UNKNOWN
    is_bridged = case.domes.calibration is not None and any(_gaps(case))
    source = f"{answer}; {BRIDGED_RESET}" if is_bridged else str(answer)
    return _checked(Trust(Output.PRESSURES, answer.basis, known, source), answer)


def _unasked_pressures(case: DesignCase) -> Trust:
    """What pressures would rest on if the spec had any."""
    spring, curve = case.footings[BISTABLE_STIFFNESS.key], case.domes.calibration
    if curve is None:
        found = Trust(Output.PRESSURES, Basis.ASSUMED, UNKNOWN, ASSUMED_AREA)
        return replace(found, doubt=ASSUMED_AREA, instead=TAKE_A_CURVE)
    error = case.known_error(Output.PRESSURES, BISTABLE_STIFFNESS.key) or UNKNOWN
    source = f"curve of {curve.source}, {spring}"
    return _checked(Trust(Output.PRESSURES, spring.basis, error, source), spring)


def _checked(found: Trust, footing: Footing) -> Trust:
    """The same, doubted where a value is taken where nothing backs it."""
    if footing.basis is not Basis.EXTRAPOLATED:
        return found
    return replace(found, doubt=f"nothing backs it here: {footing}", instead=CALIBRATE_HERE)


def _is_of_grid(footing: Footing) -> bool:
    """Whether a value is from a file over several geometries."""
    return footing.calibration is not None and footing.calibration.grid is not None


def _fit_error(lead: Footing) -> str:
    """The error of a fitted value by its own file: a standard error, or the fit's residual."""
    if lead.error is not None:
        return f"{lead.name} ± {100.0 * lead.error:.2g} % (its fit)"
    file = lead.calibration
    return UNKNOWN if file is None or not file.residual else f"{file.residual} (its fit)"
