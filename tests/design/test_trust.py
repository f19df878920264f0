"""What outputs rest on: each row over laws, calibrations, walls and bars; spaces; warnings."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from dpgcli.calibration.choices import GridMethod
from dpgcli.calibration.grid import FittedGridLaw, GridPoints
from dpgcli.design.calibrations import (
    PUBLISHED,
    Calibration,
    DomeCurve,
    Fitted,
    Grid,
    KnownError,
)
from dpgcli.design.dimensions import Design, GivenValues
from dpgcli.design.outputs import Basis, Output, Trust, doubts_about, gravest, of_space
from dpgcli.design.resolve import resolve

SIZES = {
    "dome_height_mm": 6.5,
    "dome_thickness_mm": 0.75,
    "unit_cell_mm": 22.0,
    "chamber_length_mm": 9.0,
    "channel_width_mm": 10.0,
    "limiting_layer_thickness_mm": 1.5,
    "unit_separation_mm": 3.0,
    "elastic_modulus_MPa": 26.0,
}
HERE = {**{key: size for key, size in SIZES.items() if key != "unit_cell_mm"}}
HERE["chamber_width_mm"] = 20.0
STUDY_S = {
    "segment_length_mm": 13.5,
    "segment_height_mm": 10.75,
    "stroke_mm": 3.5,
    "bistable_stiffness_N_per_mm": 12.84,
    "force_linearity": 0.043,
    "hinge_stiffness_N_mm_per_rad": 24.2,
}
OWN = {
    "segment_length_mm": 12.0,
    "segment_height_mm": 11.0,
    "stroke_mm": 3.0,
    "bistable_stiffness_N_per_mm": 14.0,
    "force_linearity": 0.03,
    "hinge_stiffness_N_mm_per_rad": 30.0,
}
WALL = "wall_compliance_mm_per_N"
TRAVEL = np.linspace(0.0, 14.0, 57)
ENERGY = 0.05 * TRAVEL**2 * (TRAVEL - 10.0) ** 2 + 0.2 * TRAVEL**2  # a well near 9.8 mm


def arrays(values: Mapping[str, float]) -> dict[str, Any]:
    return {key: np.array([value]) for key, value in values.items()}


def dome(*gaps: tuple[float, float], **more: Any) -> Calibration:
    values = {
        "bistable_stiffness_N_per_mm": Fitted(100.0, 2.0),
        "force_linearity": Fitted(0.02),
        "stroke_mm": Fitted(3.5),
    }
    kept = np.ones(len(TRAVEL), bool)
    for start, end in gaps:
        kept &= ~((TRAVEL - start > 0.0) & (TRAVEL - end < 0.0))
    curve = DomeCurve(TRAVEL[kept], ENERGY[kept], 0.35, gaps)
    return Calibration("dome.yaml", values, HERE, curve=curve, **more)


def fitted(file: str, geometry: Mapping[str, float] = HERE, **values: float) -> Calibration:
    return Calibration(file, {key: Fitted(value) for key, value in values.items()}, geometry)


HINGE = fitted("hinge.yaml", hinge_stiffness_N_mm_per_rad=33.0)
WALLS = fitted("walls.yaml", hinge_stiffness_N_mm_per_rad=33.0, wall_compliance_mm_per_N=0.7)
HEIGHT = fitted("height.yaml", segment_height_mm=12.5)
BASE = Design(3, GivenValues(arrays(SIZES)), calibrations=(PUBLISHED,))
PUSHED = replace(BASE, calibrations=(dome(), PUBLISHED), law="push_only")
TABULATED = replace(PUSHED, law="tabulated")
GIVEN = Design(3, GivenValues(lattice=arrays(OWN)), linear_stiffness=np.array([2e4]))


def sized(design: Design, **sizes: float) -> Design:
    return design.with_values({f"finger.geometry.{k}": np.array([v]) for k, v in sizes.items()})


def walled(design: Design, compliance: float = 0.7) -> Design:
    return design.with_values({f"finger.{WALL}": np.array([compliance])})


def with_files(design: Design, *files: Calibration) -> Design:
    return replace(design, calibrations=(*files, *design.calibrations))


def trusts(design: Design) -> dict[Output, Trust]:
    found = resolve(design)
    assert not found.problems.of(0)
    assert [trust.output for trust in found.trusts] == list(Output)
    return {trust.output: trust for trust in found.trusts}


CURLED = "shapes curl 13–24 % too far against finite elements"
SHALLOW = "a twentieth of finite elements' (3.2 mJ in an inverted dome, not 38–79)"
TOO_STIFF = "times too stiff against finite elements"
OF_FIT = "bistable stiffness ± 2 % (its fit)"
WALLED = "within 30 % of finite elements, up to 60 % too stiff if walls are fitted to shapes"
PUSHES = "pushes 13–43 % off finite elements; loads meet units that are too stiff"
CASES: dict[str, tuple[Design, str]] = {
    "published": (
        BASE,
        f"""
        shapes: published, {CURLED}
        energies and barriers: published!, {SHALLOW}
        barriers: published!, {SHALLOW}
        ground stiffness: published!, 50 {TOO_STIFF}
        inverted stiffness: published!, 6 {TOO_STIFF}
        stiffness along the bars: assumed!, unknown
        pressures: assumed!, unknown
        forces: published!, {PUSHES}
        """,
    ),
    "published, typed": (
        Design(3, GivenValues(lattice=arrays(STUDY_S))),
        f"""
        shapes: published, {CURLED}
        energies and barriers: published!, {SHALLOW}
        barriers: published!, {SHALLOW}
        ground stiffness: published!, 50 {TOO_STIFF}
        inverted stiffness: published!, 6 {TOO_STIFF}
        stiffness along the bars: assumed!, unknown
        pressures: assumed!, unknown
        forces: published!, {PUSHES}
        """,
    ),
    "published, beyond the grid of domes": (
        sized(BASE, dome_height_mm=8.2),
        f"""
        shapes: extrapolated!, {CURLED}
        energies and barriers: extrapolated!, {SHALLOW}
        barriers: extrapolated!, {SHALLOW}
        ground stiffness: extrapolated!, 50 {TOO_STIFF}
        inverted stiffness: extrapolated!, 6 {TOO_STIFF}
        stiffness along the bars: assumed!, unknown
        pressures: assumed!, unknown
        forces: extrapolated!, {PUSHES}
        """,
    ),
    "published, pushing only": (
        replace(BASE, law="push_only"),
        f"""
        shapes: published, {CURLED}
        energies and barriers: published!, {SHALLOW}
        barriers: published!, {SHALLOW}
        ground stiffness: published, within about 20 % of finite elements
        inverted stiffness: published!, 6 {TOO_STIFF}
        stiffness along the bars: assumed!, unknown
        pressures: assumed!, unknown
        forces: published!, {PUSHES}
        """,
    ),
    "values of one's own": (
        GIVEN,
        f"""
        shapes: given, unknown
        energies and barriers: given, unknown
        barriers: given, unknown
        ground stiffness: assumed!, hundreds of {TOO_STIFF}
        inverted stiffness: assumed!, hundreds of {TOO_STIFF}
        stiffness along the bars: given, unknown
        pressures: assumed!, unknown
        forces: assumed!, {PUSHES}
        """,
    ),
    "a curve": (
        TABULATED,
        f"""
        shapes: published, unknown
        energies and barriers: fitted, {OF_FIT}
        barriers: fitted, {OF_FIT}
        ground stiffness: assumed!, hundreds of {TOO_STIFF}
        inverted stiffness: assumed!, hundreds of {TOO_STIFF}
        stiffness along the bars: assumed!, unknown
        pressures: fitted, unknown
        forces: assumed!, {PUSHES}
        """,
    ),
    "a curve that pushes, and a hinge": (
        with_files(PUSHED, HINGE),
        f"""
        shapes: published, {CURLED}
        energies and barriers: fitted, {OF_FIT}
        barriers: fitted, {OF_FIT}
        ground stiffness: fitted, within about 20 % of finite elements
        inverted stiffness: assumed!, 40–90 {TOO_STIFF}
        stiffness along the bars: assumed!, unknown
        pressures: fitted, unknown
        forces: assumed!, {PUSHES}
        """,
    ),
    "and walls that are given": (
        walled(with_files(PUSHED, HINGE)),
        f"""
        shapes: given, unknown
        energies and barriers: fitted, {OF_FIT}
        barriers: fitted, {OF_FIT}
        ground stiffness: fitted, within about 20 % of finite elements
        inverted stiffness: given, unknown
        stiffness along the bars: assumed!, unknown
        pressures: fitted, unknown
        forces: given, unknown
        """,
    ),
    "and walls that are fitted": (
        with_files(PUSHED, WALLS),
        f"""
        shapes: fitted, shapes within 1–6 % of the deflection against finite elements
        energies and barriers: fitted, {OF_FIT}
        barriers: fitted, {OF_FIT}
        ground stiffness: fitted, within about 20 % of finite elements
        inverted stiffness: fitted, {WALLED}
        stiffness along the bars: assumed!, unknown
        pressures: fitted, unknown
        forces: fitted, pushes within about 10 % of finite elements
        """,
    ),
    "a curve with a gap, that pushes": (
        replace(PUSHED, calibrations=(dome((2.0, 8.0)), PUBLISHED)),
        f"""
        shapes: published, {CURLED}
        energies and barriers: fitted, {OF_FIT}
        barriers: assumed!, unknown
        ground stiffness: published, within about 20 % of finite elements
        inverted stiffness: assumed!, 40–90 {TOO_STIFF}
        stiffness along the bars: assumed!, unknown
        pressures: fitted, unknown
        forces: assumed!, {PUSHES}
        """,
    ),
    "a dome fitted over a gap, under the published law": (
        replace(BASE, calibrations=(dome((2.0, 8.0)), PUBLISHED)),
        f"""
        shapes: published, {CURLED}
        energies and barriers: fitted, {OF_FIT}
        barriers: extrapolated!, unknown
        ground stiffness: assumed!, hundreds of {TOO_STIFF}
        inverted stiffness: assumed!, hundreds of {TOO_STIFF}
        stiffness along the bars: assumed!, unknown
        pressures: assumed!, unknown
        forces: assumed!, {PUSHES}
        """,
    ),
}


def lines(design: Design) -> list[str]:
    return [
        f"{t.output}: {t.basis}{'!' if t.doubt else ''}, {t.known_error}"
        for t in trusts(design).values()
    ]


@pytest.mark.parametrize("name", CASES)
def test_the_table(name: str) -> None:
    """An exclamation mark for what is doubted."""
    design, expected = CASES[name]
    assert lines(design) == [line.strip() for line in expected.strip().splitlines()]


def test_a_doubt_says_why_and_what_to_do() -> None:
    found = trusts(BASE)
    assert doubts_about({"min_barrier_mJ": [found[Output.BARRIERS]]}) == [
        "min_barrier_mJ rests on barriers (published: published springs hold a twentieth of the "
        "energy that finite elements have; take a dome's curve (dpg fit bistable, dpg fe dome) "
        "with law: push_only)"
    ]
    both = [found[Output.GROUND], found[Output.AXIAL]]
    assert doubts_about({"stiffness_min_N_per_mm": both, "b": both[:1], "c": both}) == [
        "stiffness_min_N_per_mm and c rest on ground stiffness (published: domes at rest pull in "
        "this law; real ones do not touch their neighbor; take law: push_only) and stiffness along "
        "the bars (assumed: the stiffest way of a straight finger is that of its bars, k_L/n with "
        "1e4 N/mm; say finger.linear_stiffness_N_per_mm)",
        "b rests on ground stiffness (published: domes at rest pull in this law; real ones do not "
        "touch their neighbor; take law: push_only)",
    ]
    assert doubts_about({"reach_max_mm": [found[Output.SHAPES]], "n_units": []}) == []
    assert "walls are taken as rigid" in found[Output.INVERTED].doubt
    assert all(bool(trust.doubt) == bool(trust.instead) for trust in found.values())


def test_the_energy_of_one_design_under_two_laws_says_why() -> None:
    """1.7 mJ and 139 mJ as smallest barrier, of the same dimensions."""
    published, pushed = trusts(BASE)[Output.ENERGIES], trusts(PUSHED)[Output.ENERGIES]
    assert published.source == "bistable stiffness: published value at the reference geometry"
    assert "not 38–79" in published.known_error
    assert pushed.source == "curve of dome.yaml, bistable stiffness: from dome.yaml"


def test_published_springs_of_a_curve_are_still_the_published_ones() -> None:
    mixed = replace(PUSHED, calibrations=(PUBLISHED, dome()))
    assert trusts(mixed)[Output.ENERGIES].known_error == SHALLOW


@pytest.mark.parametrize("law", ["push_only", "tabulated"])
@pytest.mark.parametrize(
    ("gap", "is_met"),
    [((2.0, 8.0), True), ((9.0, 9.5), True), ((9.0, 10.5), True), ((10.5, 13.0), False)],
)
def test_only_gaps_before_the_well_matter(law: str, gap: tuple[float, float], is_met: bool) -> None:
    found = trusts(replace(PUSHED, calibrations=(dome(gap), PUBLISHED), law=law))
    barriers = found[Output.BARRIERS]
    said = f"nothing is sampled in dome.yaml from {gap[0]:g} to {gap[1]:g} mm of the dome's travel"
    assert (barriers.basis is Basis.ASSUMED) is is_met
    assert barriers.doubt == (f"{said}: bridged by a polynomial" if is_met else "")
    assert not found[Output.ENERGIES].doubt


def test_a_gap_does_not_matter_where_the_spring_is_from_elsewhere() -> None:
    spring = fitted("spring.yaml", bistable_stiffness_N_per_mm=20.0, force_linearity=0.03)
    found = trusts(replace(BASE, calibrations=(spring, dome((2.0, 8.0)), PUBLISHED)))
    assert not found[Output.BARRIERS].doubt
    assert found[Output.BARRIERS].source == "bistable stiffness: from spring.yaml"


def grid(method: GridMethod) -> Calibration:
    heights, thicknesses = (a.ravel() for a in np.meshgrid([5.0, 6.0, 7.0], [0.5, 0.75, 1.0]))
    geometry = np.stack((heights, thicknesses), axis=1)
    values = 20.0 * thicknesses**2.8 * (1.0 + 0.01 * np.sin(heights))
    over, key = ("dome_height_mm", "dome_thickness_mm"), "bistable_stiffness_N_per_mm"
    law = FittedGridLaw(method, GridPoints(over, geometry, {key: values}))
    found = Grid(over, frozenset({key}), method is GridMethod.SCALING, law)
    return Calibration("grid.yaml", {}, {"elastic_modulus_MPa": 26.0}, grid=found)


OVER = "over dome_height_mm, dome_thickness_mm"
GRIDS = [
    (GridMethod.INTERPOLATION, 5.5, Basis.FITTED, f"interpolated {OVER}, grid.yaml"),
    (GridMethod.INTERPOLATION, 6.0, Basis.FITTED, f"at a point {OVER}, grid.yaml"),
    (GridMethod.SCALING, 5.5, Basis.FITTED, f"scaling law {OVER}, grid.yaml"),
    (GridMethod.SCALING, 6.0, Basis.FITTED, f"scaling law {OVER}, grid.yaml"),
    (GridMethod.SCALING, 7.5, Basis.EXTRAPOLATED, f"scaling law {OVER}, grid.yaml"),
    (GridMethod.INTERPOLATION, 4.0, Basis.EXTRAPOLATED, f"interpolated {OVER}, grid.yaml"),
]


@pytest.mark.parametrize(("method", "height", "basis", "rule"), GRIDS)
def test_of_a_grid_it_says_how(method: GridMethod, height: float, basis: Basis, rule: str) -> None:
    design = with_files(BASE, grid(method), fitted("a.yaml", force_linearity=0.03))
    energies = trusts(sized(design, dome_height_mm=height))[Output.ENERGIES]
    assert energies.basis is basis
    assert energies.source == f"bistable stiffness: {rule}"
    assert bool(energies.doubt) is (basis is Basis.EXTRAPOLATED)
    assert energies.known_error.endswith("% (its fit)")


def test_of_a_grid_at_another_modulus_it_says_both() -> None:
    design = with_files(BASE, grid(GridMethod.INTERPOLATION), fitted("a.yaml", force_linearity=0.0))
    stiff = trusts(sized(design, dome_height_mm=6.0, elastic_modulus_MPa=30.0))[Output.ENERGIES]
    law = "E t^2.8 h^-0.25 (finite-element scaling)"
    assert stiff.source == f"bistable stiffness: interpolated {OVER}, grid.yaml, {law}"


def test_a_file_that_does_not_say_where_it_holds_is_extrapolated() -> None:
    nowhere = fitted("nowhere.yaml", {}, **{"bistable_stiffness_N_per_mm": 15.0})
    found = trusts(with_files(BASE, nowhere))
    assert {o for o, t in found.items() if t.basis is Basis.EXTRAPOLATED} == {
        Output.SHAPES,
        Output.ENERGIES,
        Output.BARRIERS,
    }
    assert found[Output.ENERGIES].doubt.startswith(
        "nothing backs it here: bistable stiffness: from nowhere.yaml, which does not state its"
    )
    assert found[Output.ENERGIES].instead == "calibrate at this geometry: dpg help calibration"


def test_walls_are_known_beside_a_pushing_dome_of_a_curve_alone() -> None:
    pulled = with_files(TABULATED, WALLS)
    no_curve = with_files(replace(BASE, law="push_only"), WALLS)
    for design in (pulled, no_curve):
        assert trusts(design)[Output.INVERTED].known_error == "unknown"
        assert trusts(design)[Output.FORCES].known_error == "unknown"
    assert resolve(pulled).model_error.text.startswith("unknown for this law and these values")
    assert resolve(no_curve).model_error.text.startswith("unknown for these walls; fitted ones")


def test_walls_do_not_hide_a_dome_that_nothing_backs() -> None:
    found = trusts(sized(walled(with_files(PUSHED, HINGE)), dome_height_mm=8.0))
    for output in (Output.INVERTED, Output.FORCES):
        assert found[output].basis is Basis.EXTRAPOLATED
        assert found[output].doubt.startswith(
            "nothing backs it here: bistable stiffness: from dome"
        )


def test_of_graded_units_the_least_trusted_counts() -> None:
    graded = replace(BASE, overrides={"2": GivenValues(arrays({"dome_height_mm": 8.5}))})
    assert trusts(graded)[Output.ENERGIES].basis is Basis.EXTRAPOLATED
    own = replace(BASE, overrides={"3": GivenValues(lattice=arrays({WALL: 0.7}))})
    assert "walls are taken as rigid" in trusts(own)[Output.INVERTED].doubt
    high = sized(own, dome_height_mm=8.5)
    assert trusts(high)[Output.SHAPES].basis is Basis.EXTRAPOLATED, "whatever walls are assumed"


def test_values_carried_to_another_geometry_say_where_the_error_was_found() -> None:
    moved = sized(with_files(PUSHED, WALLS), limiting_layer_thickness_mm=2.0)
    found = trusts(moved)
    where = " (at the study's dimensions)"
    assert found[Output.GROUND].known_error == f"within about 20 % of finite elements{where}"
    assert found[Output.INVERTED].known_error == WALLED + where, "its hinge is another"
    assert found[Output.SHAPES].known_error.endswith(f"against finite elements{where}")
    high = sized(with_files(BASE, HEIGHT), unit_cell_mm=23.0)
    assert trusts(high)[Output.SHAPES].known_error.endswith(where)
    wider = sized(replace(BASE, law="push_only"), unit_cell_mm=24.0)
    assert trusts(wider)[Output.SHAPES].known_error == CURLED + where


@pytest.mark.parametrize(
    ("bars", "basis"),
    [
        (None, Basis.ASSUMED),
        (np.array([3e3]), Basis.GIVEN),
        (np.array([np.inf]), Basis.GIVEN),
    ],
)
def test_bars(bars: Any, basis: Basis) -> None:
    found = trusts(replace(BASE, linear_stiffness=bars))[Output.AXIAL]
    assert (found.basis, bool(found.doubt)) == (basis, bars is None)
    of_file = with_files(BASE, fitted("bars.yaml", linear_stiffness_N_per_mm=500.0))
    if bars is None:
        assert trusts(of_file)[Output.AXIAL].basis is Basis.FITTED


def test_a_fitted_height_is_known_as_far_as_its_file_says() -> None:
    assert trusts(with_files(BASE, HEIGHT))[Output.SHAPES].known_error == (
        "shapes within 1–8 % of the deflection against finite elements"
    )
    known = replace(HEIGHT, leave_one_out=(0.03, 0.05))
    found = trusts(with_files(BASE, known))[Output.SHAPES]
    assert (found.basis, found.known_error) == (
        Basis.FITTED,
        "states that height.yaml was not fitted to are off by 3 % of the deflection (rms), "
        "5 % at most",
    )


def test_errors_of_a_fit_are_those_beside_its_coupling() -> None:
    """A finger that does not take the coupling of its file is not as near as the fit."""
    key = "hinge_coupling_N_mm_per_rad"
    values = {"hinge_stiffness_N_mm_per_rad": 32.0, WALL: 0.8, key: 1.2}
    errors = {"forces": KnownError(0.01, None, "unseen states")}
    file = replace(fitted("all.yaml", **values), leave_one_out=(0.007, 0.008), known_errors=errors)
    known = with_files(PUSHED, file)
    for design, is_known in (
        (known, True),
        (known.with_values({f"finger.{key}": np.array([1.0])}), False),
        (known.with_values({f"finger.{key}": np.array([0.0])}), False),
    ):
        found = trusts(design)
        assert ("all.yaml" in found[Output.SHAPES].known_error) == is_known
        assert ("unseen states" in found[Output.FORCES].known_error) == is_known


def test_a_calibration_s_own_errors_come_first() -> None:
    """Such as of one that ships: by output, with what it was compared with."""
    names = {
        "shapes": 0.02,
        "energies_and_barriers": 0.03,
        "barriers": 0.04,
        "ground_stiffness": 0.05,
        "inverted_stiffness": 0.15,
        "pressures": 0.06,
        "forces": 0.07,
    }
    assert {*names} == {o.key for o in Output} - {Output.AXIAL.key}
    against = "finite elements; not given"
    errors = {key: KnownError(error, 0.5 * error, against) for key, error in names.items()}
    known = replace(dome((2.0, 8.0)), known_errors=errors)
    walls = replace(WALLS, known_errors=errors)
    found = trusts(replace(PUSHED, calibrations=(walls, known, PUBLISHED)))
    for output, trust in found.items():
        if output not in (Output.AXIAL, Output.SHAPES):
            error = names[output.key]
            said = f"{50 * error:.2g} % (rms), {100 * error:.2g} % at most"
            assert trust.known_error == f"{said}, against {against}"
    assert found[Output.SHAPES].known_error == (
        "shapes by walls.yaml are off by 1 % of the deflection (rms), 2 % at most, against finite "
        "elements; not given"
    )
    for files, share in (((walls, known, PUBLISHED), 0.01), ((walls, PUBLISHED, known), None)):
        assert resolve(replace(PUSHED, calibrations=files)).model_error.share == share


def test_walls_beside_a_height_that_is_fitted_too() -> None:
    both = {"segment_height_mm": Fitted(10.0), **WALLS.values}
    found = trusts(with_files(PUSHED, replace(WALLS, values=both)))
    assert found[Output.SHAPES].known_error == (
        "shapes within 3–10 % of the deflection against finite elements"
    )
    assert found[Output.INVERTED].known_error == WALLED
    given = replace(GIVEN, calibrations=(WALLS, dome()), law="push_only")
    lattice = {k: v for k, v in OWN.items() if k != "force_linearity"}
    given = replace(given, finger=GivenValues(lattice=arrays(lattice)))
    assert trusts(given)[Output.SHAPES].known_error == "unknown", "beside one that is given"


def test_the_last_word_is_the_first_row_s() -> None:
    for design, _ in CASES.values():
        error = resolve(design).model_error.text
        known = trusts(design)[Output.SHAPES].known_error
        assert error.startswith(known)
        assert ("pushes within about 10 %" in error) is (WALL in resolve(design).values)


def test_warnings_are_those_of_files_in_use() -> None:
    said = replace(HINGE, warnings=("one point",))
    other = replace(HEIGHT, warnings=("two points", "three"))
    unused = replace(fitted("no.yaml", hinge_stiffness_N_mm_per_rad=9.0), warnings=("unused",))
    design = replace(BASE, calibrations=(said, other, unused, PUBLISHED))
    assert resolve(design).scene().warnings == (
        "hinge.yaml: one point",
        "height.yaml: two points",
        "height.yaml: three",
    )
    curve = dome(warnings=("a curve alone",))
    spring = fitted("s.yaml", bistable_stiffness_N_per_mm=90.0)
    pushed = replace(PUSHED, calibrations=(spring, curve, PUBLISHED))
    assert resolve(pushed).warnings == ("dome.yaml: a curve alone",), "by its curve"
    assert resolve(replace(pushed, law=None)).warnings == ("dome.yaml: a curve alone",), "by alpha"


def spaces() -> dict[str, Design]:
    random = np.random.default_rng(4)
    n = 60
    heights = random.choice([5.0, 6.5, 8.5], n)
    thickness = random.choice([0.75, 0.8], n)
    return {
        "published": BASE.with_values(
            {
                "finger.geometry.dome_height_mm": heights,
                "finger.geometry.dome_thickness_mm": thickness,
                "finger.geometry.unit_cell_mm": random.choice([22.0, 24.0], n),
            }
        ),
        "walls": with_files(PUSHED, HINGE).with_values(
            {
                f"finger.{WALL}": random.choice([0.0, 0.3, 0.7], n),
                "finger.geometry.dome_height_mm": random.choice([6.0, 6.5], n),
            }
        ),
        "given": GIVEN.with_values(
            {
                "finger.lattice.segment_height_mm": random.choice([10.75, 11.0], n),
                "finger.lattice.bistable_stiffness_N_per_mm": random.choice([12.84, 20.0], n),
                "finger.linear_stiffness_N_per_mm": random.choice([1e3, np.inf], n),
            }
        ),
        "graded": replace(BASE, overrides={"2": GivenValues()}).with_values(
            {"finger.overrides.2.geometry.dome_height_mm": heights}
        ),
        "grid": with_files(BASE, grid(GridMethod.INTERPOLATION)).with_values(
            {"finger.geometry.dome_height_mm": random.choice([5.0, 5.5, 7.5], n)}
        ),
    }


@pytest.mark.parametrize("name", spaces())
def test_kinds_are_those_of_the_designs_one_by_one(name: str) -> None:
    design = spaces()[name]
    found = resolve(design)
    right = np.flatnonzero(~found.are_wrong)
    assert len(right) > 30
    kinds: Counter[tuple[Trust, ...]] = Counter()
    for trusts_of, count in found.kinds_of_trust(right):
        kinds[trusts_of] += count
    one_by_one: Counter[tuple[Trust, ...]] = Counter()
    for place in right:
        ((trusts_of, count),) = found.kinds_of_trust(np.array([place]))
        assert count == 1
        one_by_one[trusts_of] += 1
    assert kinds == one_by_one
    assert len(kinds) > 1


def test_kinds_of_no_design() -> None:
    assert resolve(BASE).kinds_of_trust(np.zeros(0, np.int64)) == []


def some(basis: Basis, doubt: str = "", source: str = "") -> Trust:
    return Trust(Output.SHAPES, basis, "", source, doubt)


@pytest.mark.parametrize(
    ("first", "second"),
    [
        (some(Basis.ASSUMED), some(Basis.FITTED, "a doubt")),
        (some(Basis.PUBLISHED), some(Basis.EXTRAPOLATED)),
        (some(Basis.EXTRAPOLATED, "x"), some(Basis.ASSUMED, "x")),
        (some(Basis.FITTED), some(Basis.GIVEN)),
        (some(Basis.GIVEN), some(Basis.PUBLISHED)),
    ],
)
def test_the_gravest(first: Trust, second: Trust) -> None:
    assert gravest([first, second]) == gravest([second, first]) == second


def test_a_space_is_told_at_its_worst() -> None:
    good, one, other = (
        some(Basis.FITTED),
        some(Basis.ASSUMED, "x", "few"),
        some(Basis.ASSUMED, "x", "most"),
    )
    parts: Sequence[tuple[tuple[Trust, ...], int]] = [((good,), 900), ((one,), 40), ((other,), 60)]
    (found,) = of_space(parts)
    assert found == replace(other, share="100 of 1,000 designs")
    assert str(found) == "shapes (assumed in 100 of 1,000 designs: x)"
    (alike,) = of_space(parts[1:])
    assert (alike.source, alike.share) == ("most", "")
    assert of_space([]) == ()


def test_a_record_comes_back() -> None:
    for trust in trusts(BASE).values():
        assert Trust.of_record(trust.record) == trust
    record = trusts(BASE)[Output.SHAPES].record
    assert [*record] == ["output", "basis", "known_error", "from", "doubt", "instead", "share"]
    for wrong in ({}, {**record, "basis": "hearsay"}, {**record, "from": 3}):
        with pytest.raises((KeyError, TypeError, ValueError)):
            Trust.of_record(wrong)


KNOWN = {key: KnownError(0.1, 0.05, "finite elements") for key in ("shapes", "inverted_stiffness")}


@pytest.mark.parametrize(
    "change",
    [
        {"calibrations": (PUBLISHED, replace(WALLS, known_errors=KNOWN), dome())},
        {"lattice": {"bistable_stiffness_N_per_mm": 4.0}},
        {"lattice": {"hinge_stiffness_N_mm_per_rad": 300.0}},
        {"law": "tabulated"},
        {"law": "published"},
    ],
    ids=["published first", "another dome", "another hinge", "tabulated", "published law"],
)
def test_errors_of_a_file_are_those_of_fingers_with_all_of_it(change: dict[str, Any]) -> None:
    """In which domes only push, by the curve as it is."""
    walls = replace(WALLS, known_errors=KNOWN)
    whole = replace(PUSHED, calibrations=(walls, dome(), PUBLISHED))
    assert "5 % (rms)" in trusts(whole)[Output.INVERTED].known_error
    lattice = change.pop("lattice", None)
    other = replace(whole, **change)
    if lattice is not None:
        other = replace(other, finger=GivenValues(arrays(SIZES), arrays(lattice)))
    found = trusts(other)
    assert found[Output.INVERTED].known_error == "unknown"
    assert found[Output.SHAPES].known_error == "unknown"


def test_a_height_fitted_with_rigid_walls_says_nothing_beside_walls() -> None:
    height = replace(HEIGHT, leave_one_out=(0.05, 0.08))
    alone = trusts(with_files(PUSHED, height))[Output.SHAPES]
    assert alone.known_error.startswith("states that height.yaml was not fitted to are off by 5 %")
    for beside in (with_files(PUSHED, height, WALLS), walled(with_files(PUSHED, height))):
        assert trusts(beside)[Output.SHAPES].known_error == "unknown"


def test_energies_scaled_for_another_law_are_extrapolated() -> None:
    """How they go with height was found for domes that only push."""
    small = sized(TABULATED, dome_height_mm=4.5)
    energies = trusts(small)[Output.ENERGIES]
    assert (energies.basis, energies.known_error) == (Basis.EXTRAPOLATED, "unknown")
    assert energies.doubt
    assert not trusts(PUSHED)[Output.ENERGIES].doubt


@pytest.mark.parametrize("law", ["tabulated", "push_only", None])
@pytest.mark.parametrize("second", [0.01, 0.8])
def test_a_curve_that_bends_down_at_rest_is_warned_of(law: str | None, second: float) -> None:
    """By few points that all rise: the third lies high above the parabola of the second."""
    travel = np.array([0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    energy = np.array([0.0, second, 3.0, 5.0, 4.0, 2.0, 8.0])
    few = replace(dome(), curve=DomeCurve(travel, energy, 0.35, ()))
    found = resolve(replace(PUSHED, calibrations=(few, PUBLISHED), law=law)).warnings
    warns = law is not None and second < 0.1
    alone = replace(PUSHED, calibrations=(replace(few, file=None), PUBLISHED), law=law)
    said = resolve(alone).warnings
    assert [warning.split(": ")[0] for warning in said] == ["finger.calibration"] * warns
    assert [warning.split(" at travel")[0] for warning in found] == (
        ["dome.yaml: the curve's spline bends down"] if warns else []
    )
