"""Areas and snap pressures of designs: from specs, curves and assumptions, many at once."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dpgcli.arrays import Array
from dpgcli.design.calibrations import PUBLISHED, Calibration, DomeCurve, Fitted, KnownError
from dpgcli.design.dimensions import Design, GivenPressure, GivenValues
from dpgcli.design.outputs import Basis, Output
from dpgcli.design.resolve import Resolution, resolve
from dpgcli.design.scene import Origin
from dpgcli.files.scene_file import read_spec, scene_of
from dpgcli.mechanics.curve import Spline

STUDY = Path(__file__).parents[2] / "configs" / "three_unit.yaml"

GEOMETRY = {
    "dome_height_mm": 6.5,
    "dome_thickness_mm": 0.75,
    "unit_cell_mm": 22.0,
    "chamber_length_mm": 9.0,
    "channel_width_mm": 10.0,
    "limiting_layer_thickness_mm": 1.5,
    "unit_separation_mm": 3.0,
    "elastic_modulus_MPa": 26.0,
}
AREA, SNAP = "pressure.effective_area_mm2", "pressure.snap_pressure_MPa"
WELL = 13.0  # mm, of the dome below
TRAVEL = np.linspace(0.0, 15.0, 121)
ENERGY = 0.02 * TRAVEL**2 * (TRAVEL - WELL) ** 2 + 0.1 * TRAVEL**2
FORCE = 0.04 * TRAVEL * (TRAVEL - WELL) * (2.0 * TRAVEL - WELL) + 0.2 * TRAVEL
AREAS = 300.0 - 8.0 * TRAVEL  # mm2
VOLUME = 300.0 * TRAVEL - 4.0 * TRAVEL**2
GAP = (2.0, 12.0)


def sizes(**given: float) -> dict[str, Array]:
    return {key: np.array([value]) for key, value in given.items()}


BASE = Design(
    5,
    GivenValues(sizes(**GEOMETRY)),
    calibrations=(PUBLISHED,),
    pressure=GivenPressure(),
)


def dome(*gaps: tuple[float, float], **columns: Any) -> Calibration:
    """A dome of known areas; its columns at the travels outside of the gaps."""
    values = {
        "bistable_stiffness_N_per_mm": Fitted(100.0),
        "stroke_mm": Fitted(3.5),
        "force_linearity": Fitted(0.02),
    }
    kept = np.ones(len(TRAVEL), bool)
    for start, end in gaps:
        kept &= ~((start < TRAVEL) & (end > TRAVEL))
    beside = {
        key: v[kept].tolist() if isinstance(v, np.ndarray) else v for key, v in columns.items()
    }
    curve = DomeCurve(TRAVEL[kept], ENERGY[kept], 3.5 / WELL, gaps, **beside)
    own = {key: size for key, size in GEOMETRY.items() if key != "unit_cell_mm"}
    known = {"pressures": KnownError(0.04, 0.02, "others")}
    return Calibration("dome.yaml", values, own, curve=curve, known_errors=known)


def of(calibration: Calibration, law: str = "push_only", design: Design = BASE) -> Design:
    return replace(design, calibrations=(calibration, PUBLISHED), law=law)


def pressure(design: Design) -> Any:
    found = resolve(design)
    assert not found.are_wrong.any(), found.problems.of(0)
    return found.scene().pressure


def source(design: Design) -> Any:
    (found,) = [s for s in resolve(design).scene().sources if s.key == SNAP.split(".")[1]]
    return found


def areas(shape: Spline, design: Design, travel: Array) -> Array:
    """dV/du over that at the limit point."""
    finger = resolve(design).scene().finger
    full = finger.dome_travel[0, 0] or WELL
    return shape(travel / full).slope


def test_a_design_without_pressure_has_none() -> None:
    found = resolve(replace(BASE, pressure=None))
    assert (found.scene().pressure, dict(found.answers)) == (None, {})


def test_many_designs_at_once() -> None:
    values = np.array([0.1, 0.15, 0.2])
    for key in (SNAP, AREA):
        found = resolve(BASE.with_values({key: values}))
        batch = found.batch(np.array([2, 0]))
        assert batch.pressure is not None
        array = batch.pressure.snap_pressure if key == SNAP else batch.pressure.effective_area
        assert array is not None
        assert array.tolist() == [[0.2, 0.1]]
        again = batch.take_lanes(np.array([1])).pressure
        assert again is not None
        kept = again.snap_pressure if key == SNAP else again.effective_area
        assert kept is not None
        assert kept.tolist() == [[0.1]]


def test_an_override_of_many_designs() -> None:
    key = "pressure.overrides.4-5.snap_pressure_MPa"
    found = resolve(BASE.with_values({key: np.array([0.1, 0.2])})).batch(np.arange(2)).pressure
    assert found is not None
    assert found.snap_pressure is not None
    assert found.snap_pressure.shape == (5, 2)
    assert found.snap_pressure[:3] == pytest.approx(0.1495)
    assert found.snap_pressure[3:].tolist() == [[0.1, 0.2], [0.1, 0.2]]


def test_what_is_assumed_follows_each_design_s_dome() -> None:
    heights = np.array([5.5, 6.5, 7.5])
    design = BASE.with_values({"finger.geometry.dome_height_mm": heights})
    found = resolve(design).batch(np.arange(3)).pressure
    assert found is not None
    assert found.snap_pressure == pytest.approx(0.1495 * (heights[None] / 6.5) ** 1.2)


def test_designs_with_both_are_wrong() -> None:
    design = BASE.with_values({AREA: np.array([30.0, 31.0])}).with_values({SNAP: np.ones(2)})
    assert resolve(design).are_wrong.tolist() == [True, True]


def test_lines_of_a_finger_that_is_too_short() -> None:
    lines = {"A": (1, 2, 3), "B": (4, 5)}
    short = replace(BASE, units=4, pressure=GivenPressure(lines))
    (issue,) = resolve(short).problems.of(0)
    assert issue.statement == "pressure.lines.B: expected units within 1-4, found 5"


@pytest.mark.parametrize("law", ["push_only", "tabulated"])
def test_a_curve_s_snap_pressure_is_scaled_to_other_domes(law: str) -> None:
    design = of(dome(snap_pressure=0.12), law)
    assert pressure(design).snap_pressure.tolist() == [[0.12]]
    assert source(design).origin is Origin.CALIBRATED
    assert source(design).rule == "from dome.yaml"
    thin = design.with_values({"finger.geometry.dome_thickness_mm": np.array([0.6])})
    assert pressure(thin).snap_pressure == pytest.approx(0.12 * (0.6 / 0.75) ** 2.5)
    assert source(thin).origin is Origin.SCALED
    assert source(thin).rule.startswith("from dome.yaml, E t^2.5 h^1.2")
    soft = design.with_values({"finger.geometry.elastic_modulus_MPa": np.array([13.0])})
    assert pressure(soft).snap_pressure == pytest.approx(0.06)
    tall = design.with_values({"finger.geometry.dome_height_mm": np.array([9.0])})
    assert source(tall).origin is Origin.EXTRAPOLATED


def test_a_curve_without_a_snap_pressure_leaves_it_assumed() -> None:
    found = pressure(of(dome()))
    assert (found.snap_pressure.tolist(), found.shape) == ([[0.1495]], None)
    assert source(of(dome())).origin is Origin.ASSUMED
    trust = {t.output: t for t in resolve(of(dome())).trusts}[Output.PRESSURES]
    assert (trust.basis, trust.doubt != "") == (Basis.ASSUMED, True)


def test_the_published_law_takes_what_a_file_before_it_has() -> None:
    both = of(dome(snap_pressure=0.12), "published")
    assert pressure(both).snap_pressure.tolist() == [[0.12]]
    after = replace(both, calibrations=(PUBLISHED, dome(snap_pressure=0.12)))
    assert source(after).origin is Origin.ASSUMED


def test_a_given_area_is_the_same_all_the_way() -> None:
    design = of(dome(GAP, pressure=FORCE / AREAS, snap_pressure=0.12))
    given = design.with_values({AREA: np.array([30.0])})
    found = pressure(given)
    assert (found.effective_area.tolist(), found.snap_pressure, found.shape) == (
        [[30.0]],
        None,
        None,
    )


COLUMNS = {
    "volume": {"volume": VOLUME},
    "pressure": {"pressure": FORCE / AREAS},
    "volume before pressure": {"volume": VOLUME, "pressure": FORCE / 77.0},
    "volumes the other way round": {"volume": -VOLUME, "pressure": FORCE / AREAS},
}


@pytest.mark.parametrize("gaps", [(), (GAP,)], ids=["whole", "with a gap"])
@pytest.mark.parametrize("law", ["push_only", "tabulated"])
@pytest.mark.parametrize("columns", COLUMNS)
def test_areas_by_travel_are_those_of_the_data(columns: str, law: str, gaps: Any) -> None:
    design = of(dome(*gaps, snap_pressure=0.12, **COLUMNS[columns]), law)
    shape = pressure(design).shape
    limit = (FORCE / AREAS)[(GAP[0] + 0.1 if gaps else WELL / 2.0) > TRAVEL].argmax()
    for low, high in ((0.0, 2.0), (12.6, 13.0), (13.4, 15.0)):  # no pressure, no area near 13.2
        own = (low <= TRAVEL) & (high >= TRAVEL)
        found = areas(shape, design, TRAVEL[own])
        assert found == pytest.approx(AREAS[own] / AREAS[limit], rel=2e-2)
    at_limit = areas(shape, design, TRAVEL[[limit]])
    assert at_limit == pytest.approx(1.0, rel=1e-3)  # between two samples perhaps


@pytest.mark.parametrize("columns", ["volume", "pressure"])
def test_between_its_branches_and_beyond_them(columns: str) -> None:
    design = of(dome(GAP, snap_pressure=0.12, **COLUMNS[columns]))
    shape = pressure(design).shape
    between = areas(shape, design, np.linspace(6.0, GAP[1], 200))  # where E' is negative
    assert (np.diff(between) < 2e-4).all()  # of a volume that is twice differentiable
    assert np.ptp(between) > 0.1
    beyond = areas(shape, design, np.array([15.0, 16.0, 40.0]))
    assert beyond == pytest.approx(beyond[0], rel=1e-9)
    rule = source(design).rule
    how = "dV/du" if columns == "volume" else "E'/p"
    assert rule == f"from dome.yaml; area {how} on the branches of its curve, " + (
        "monotone between them, the pressure below its limit (assumed)"
    )


@pytest.mark.parametrize("end", [1.0, 1.5, 2.0])
def test_a_dome_bears_no_more_behind_its_last_sample(end: float) -> None:
    """It snapped there, whatever the energy of the bridge to the other branch is."""
    design = of(dome((end, 12.0), snap_pressure=0.12, pressure=FORCE / AREAS))
    scene = resolve(design).scene()
    shape, curve = pressure(design).shape, scene.finger.law.curve
    assert curve is not None
    full = scene.finger.dome_travel[0, 0]
    travel = np.linspace(0.1, 12.0, 2000)
    pressures = curve(travel / full).slope / shape(travel / full).slope
    assert travel[pressures.argmax()] == pytest.approx(end, abs=0.1)
    own = travel < end
    known = np.interp(travel[own], TRAVEL, FORCE / AREAS)
    assert pressures[own] / pressures.max() == pytest.approx(known / known.max(), rel=1.5e-2)


def test_pressures_are_met_between_samples_too() -> None:
    """A fold of E'/A between two samples would be a snap that the data do not have."""
    design = of(dome(GAP, snap_pressure=0.12, pressure=FORCE / AREAS))
    scene = resolve(design).scene()
    travel = np.linspace(0.3, 2.0, 500)
    full = scene.finger.dome_travel[0, 0]
    curve = scene.finger.law.curve
    assert curve is not None
    assert scene.pressure is not None
    assert scene.pressure.shape is not None
    pressures = curve(travel / full).slope / scene.pressure.shape(travel / full).slope
    expected = np.interp(travel, TRAVEL, FORCE / AREAS)
    assert (np.diff(pressures) > 0.0).all()
    assert pressures / pressures[-1] == pytest.approx(expected / expected[-1], rel=3e-3)


def test_pressures_that_were_not_measured_everywhere() -> None:
    pressures = (FORCE / AREAS).tolist()
    some = [p if place % 3 else None for place, p in enumerate(pressures)]
    whole, part = (of(dome(snap_pressure=0.12, pressure=column)) for column in (pressures, some))
    at = np.array([1.0, 2.0, 10.0, 14.5])
    found, known = (areas(pressure(design).shape, design, at) for design in (part, whole))
    assert found == pytest.approx(known, rel=1e-2)


def test_an_area_is_no_noise_over_noise() -> None:
    """A gauge that shows 0.1 % of its range too much says nothing of areas near rest."""
    shown = FORCE / AREAS + 1e-3 * np.max(FORCE / AREAS)
    design = of(dome(GAP, snap_pressure=0.12, pressure=shown))
    shape = pressure(design).shape
    own = (GAP[0] >= TRAVEL) | ((TRAVEL >= 13.0) & (TRAVEL <= 13.5))
    found = areas(shape, design, TRAVEL[own])
    assert found == pytest.approx(AREAS[own] / AREAS[GAP[0] == TRAVEL], rel=0.1)


def test_one_branch_by_volume_and_the_other_by_pressure() -> None:
    volumes = [v if u < GAP[0] + 0.1 else None for u, v in zip(TRAVEL, VOLUME, strict=True)]
    kept = (GAP[0] >= TRAVEL) | (GAP[1] <= TRAVEL)
    some = [v for v, is_kept in zip(volumes, kept, strict=True) if is_kept]
    for law in ("push_only", "tabulated"):
        design = of(dome(GAP, snap_pressure=0.12, volume=some, pressure=FORCE / AREAS), law)
        found = areas(pressure(design).shape, design, np.array([1.0, 12.8, 14.5]))
        assert found == pytest.approx(AREAS[[8, 102, 116]] / AREAS[16], rel=2e-2)


def test_a_curve_that_begins_beside_rest() -> None:
    whole = dome(GAP, snap_pressure=0.12, volume=VOLUME)
    assert whole.curve is not None
    columns = {name: getattr(whole.curve, name)[4:] for name in ("travel", "energy", "volume")}
    design = of(replace(whole, curve=replace(whole.curve, **columns)))
    scene = resolve(design).scene()
    curve, shape = scene.finger.law.curve, pressure(design).shape
    assert curve is not None
    fine = np.linspace(0.5, 2.0, 97) / scene.finger.dome_travel[0, 0]
    limit = (curve(fine).slope / shape(fine).slope).argmax()
    assert shape(fine[limit]).slope == pytest.approx(1.0, rel=1e-4)
    first = areas(shape, design, np.array([0.0, 0.2, 0.5]))
    assert first == pytest.approx(first[-1], rel=1e-3)


def test_the_shipped_dome_has_one_limit_point() -> None:
    """E' is not smooth there; over areas that keep to the pressures it rises all the way."""
    scene = scene_of(read_spec(STUDY, ["finger.calibration=finite_elements", "pressure={}"]))
    assert scene.pressure is not None
    shape, curve = scene.pressure.shape, scene.finger.law.curve
    assert shape is not None
    assert curve is not None
    travel = np.linspace(0.2, 1.86, 2000) / scene.finger.dome_travel[0, 0]
    pressures = curve(travel).slope / shape(travel).slope
    assert (np.diff(pressures) > 0.0).all()


def test_a_second_curve_is_not_the_law_s() -> None:
    files = (dome(), dome(snap_pressure=0.12), PUBLISHED)
    assert source(replace(of(dome()), calibrations=files)).origin is Origin.ASSUMED


def test_columns_that_say_nothing() -> None:
    for columns in ({"pressure": 0.0 * FORCE}, {"pressure": -FORCE}, {"volume": -VOLUME}):
        assert pressure(of(dome(GAP, snap_pressure=0.12, **columns))).shape is None
    beyond = dome((0.0, 12.0), snap_pressure=0.12, pressure=FORCE / AREAS)
    assert pressure(of(beyond, "tabulated")).shape is None


CASES = {
    "assumed": (BASE, Basis.ASSUMED, "unknown"),
    "an area": (BASE.with_values({AREA: np.array([30.0])}), Basis.GIVEN, "unknown"),
    "a snap pressure": (BASE.with_values({SNAP: np.array([0.1])}), Basis.GIVEN, "unknown"),
    "a curve": (
        of(dome(snap_pressure=0.12)),
        Basis.FITTED,
        "2 % (rms), 4 % at most, against others",
    ),
    "a curve that is scaled": (
        of(dome(snap_pressure=0.12)).with_values(
            {"finger.geometry.dome_height_mm": np.array([7.0])}
        ),
        Basis.FITTED,
        "2 % (rms), 4 % at most, against others (at the study's dimensions)",
    ),
    "a curve beyond its range": (
        of(dome(snap_pressure=0.12)).with_values(
            {"finger.geometry.dome_height_mm": np.array([9.0])}
        ),
        Basis.EXTRAPOLATED,
        "2 % (rms), 4 % at most, against others (at the study's dimensions)",
    ),
    "one unit's assumed": (
        BASE.with_values({"pressure.overrides.1-4.snap_pressure_MPa": np.array([0.1])}),
        Basis.ASSUMED,
        "unknown",
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_what_pressures_rest_on(name: str) -> None:
    design, basis, error = CASES[name]
    trust = {t.output: t for t in resolve(design).trusts}[Output.PRESSURES]
    assert (trust.basis, trust.known_error) == (basis, error)
    assert bool(trust.doubt) is (basis in (Basis.ASSUMED, Basis.EXTRAPOLATED))


def test_reset_pressures_of_a_curve_with_a_gap_are_assumed() -> None:
    for gaps, is_said in (((), False), ((GAP,), True)):
        trusts = resolve(of(dome(*gaps, snap_pressure=0.12))).trusts
        source = {t.output: t for t in trusts}[Output.PRESSURES].source
        assert ("reset pressures are assumed" in source) is is_said


def test_designs_of_a_space_differ_in_what_pressures_rest_on() -> None:
    heights = {"finger.geometry.dome_height_mm": np.array([6.5, 7.0, 9.0])}
    found: Resolution = resolve(of(dome(snap_pressure=0.12)).with_values(heights))
    kinds = found.kinds_of_trust(np.arange(3))
    bases = [{t.output: t for t in trusts}[Output.PRESSURES].basis for trusts, _ in kinds]
    assert sorted(bases) == ["extrapolated", "fitted", "fitted"]


def test_designs_that_differ_in_nothing_else_are_kinds_of_their_own() -> None:
    """The springs are given: only the snap pressure is scaled with the dome's thickness."""
    given = {
        "finger.lattice.bistable_stiffness_N_per_mm": np.array([90.0]),
        "finger.lattice.segment_length_mm": np.array([13.5]),
        "finger.geometry.dome_thickness_mm": np.array([0.75, 0.75, 1.2]),
    }
    design = of(dome(snap_pressure=0.12)).with_values(given)
    design = replace(
        design,
        finger=replace(
            design.finger,
            geometry={**design.finger.geometry, "chamber_length_mm": np.array([9.0, 9.0, 8.1])},
        ),
    )
    kinds = resolve(design).kinds_of_trust(np.arange(3))
    assert sorted(count for _, count in kinds) == [1, 2]
