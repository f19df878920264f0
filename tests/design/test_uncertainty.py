"""Tolerances of dimensions and of values, through every rule, and what is known of the model."""

from dataclasses import replace

import numpy as np
import pytest

from dpgcli.arrays import Array
from dpgcli.design.calibrations import PUBLISHED, Calibration, DomeCurve, Fitted
from dpgcli.design.dimensions import LEAVE_ONE_OUT, Design, GivenValues, Tolerance
from dpgcli.design.resolve import resolve
from dpgcli.design.scene import FITTED, MODEL, UNKNOWN, Step, Uncertainty
from dpgcli.mechanics.finger import KEYS
from dpgcli.mechanics.terms import chain_potential
from dpgcli.states.plan import Request
from dpgcli.states.predict import predict
from dpgcli.states.settle import settle
from dpgcli.states.tip import tip
from dpgcli.states.units import UnitSolutions

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
GEOMETRY = {key: np.array([size]) for key, size in SIZES.items()}
HERE = {key: size for key, size in SIZES.items() if key != "unit_cell_mm"}
LEVER = Calibration(
    "lever.yaml",
    {
        "bistable_stiffness_N_per_mm": Fitted(14.0),
        "force_linearity": Fitted(0.05),
        "hinge_stiffness_N_mm_per_rad": Fitted(20.0),
        "segment_height_mm": Fitted(12.0, 0.1),
    },
    {**HERE, "chamber_width_mm": 20.0},
    leave_one_out=(0.056, 0.08),
)


def dome() -> Calibration:
    """A curve with a well at 9.5 mm of a dome of 6.5 mm."""
    travel = np.linspace(0.0, 12.0, 49)
    energy = 0.02 * travel**2 * (travel - 9.5) ** 2 + 2.0 * (travel / 9.5) ** 2
    values = {"bistable_stiffness_N_per_mm": Fitted(12.84, 0.1), "stroke_mm": Fitted(3.5)}
    return Calibration("dome.yaml", values, HERE, curve=DomeCurve(travel, energy, 1.0))


BASE = Design(4, GivenValues(GEOMETRY), calibrations=(PUBLISHED,))
DESIGNS = {
    "published": BASE,
    "graded": replace(BASE, overrides={"2-3": GivenValues({"dome_height_mm": np.array([7.1])})}),
    "fitted at its own geometry": replace(BASE, calibrations=(LEVER, PUBLISHED)),
    "a dome that only pushes": replace(BASE, calibrations=(dome(), PUBLISHED), law="push_only"),
}
named = pytest.mark.parametrize("name", DESIGNS)


def tolerated(design: Design, **tolerances: Tolerance) -> Uncertainty:
    known = resolve(replace(design, tolerances=tolerances)).scene().uncertainty
    assert known is not None
    return known


def moved(design: Design, key: str, share: float) -> dict[str, Array]:
    """The lattice with a dimension changed by a share in all units."""

    def changed(section: GivenValues) -> GivenValues:
        own = {k: v * (1.0 + share) if k == key else v for k, v in section.geometry.items()}
        return replace(section, geometry=own)

    overrides = {units: changed(section) for units, section in design.overrides.items()}
    return resolve(replace(design, finger=changed(design.finger), overrides=overrides)).lattice


@named
@pytest.mark.parametrize("key", SIZES)
def test_a_dimension_s_tolerance_moves_the_lattice_as_the_rules_do(name: str, key: str) -> None:
    """By fourth-order central differences, in all units at once, where the fit was made too."""
    (step,) = (s for s in tolerated(DESIGNS[name], **{key: Tolerance(0.1, True)}).steps if s.size)
    near, behind, far, back = (moved(DESIGNS[name], key, s) for s in (1e-3, -1e-3, 2e-3, -2e-3))
    for array, values in near.items():
        slope = (8.0 * (values - behind[array]) - (far[array] - back[array])) / (12.0 * 1e-3)
        found = step.finger.get(array, np.zeros_like(values))
        np.testing.assert_allclose(found, 0.1 * slope, 1e-7, 1e-9 * np.abs(values).max())


@named
def test_some_dimension_matters_to_each_array(name: str) -> None:
    every = tolerated(DESIGNS[name], **dict.fromkeys(SIZES, Tolerance(0.1, True)))
    reached = {array for step in every.steps if step.size for array in step.finger}
    assert {"segment_length", "stroke", "bistable_stiffness", "hinge_stiffness"} <= reached


def test_a_value_s_own_tolerance_changes_it_whatever_it_comes_from() -> None:
    """Of a graded finger each by its own percentage, or all by the same length."""
    key = "stroke_mm"
    (step,) = tolerated(DESIGNS["graded"], stroke_mm=Tolerance(0.02, True)).steps
    assert step.finger[KEYS[key]][:, 0] == pytest.approx(0.02 * np.array([3.5, 4.1, 4.1, 3.5]))
    (step,) = tolerated(DESIGNS["graded"], stroke_mm=Tolerance(0.02, False)).steps
    assert (step.finger[KEYS[key]] == 0.02).all()
    assert (step.cause, step.size) == (key, "0.02 mm")


def test_steps_of_a_gripper_and_of_its_layer() -> None:
    gripper = {"base_spacing_mm": np.array([60.0]), "mounting_angle_deg": np.array([10.0])}
    spacing, angle, layer = tolerated(
        replace(BASE, gripper=gripper),
        base_spacing_mm=Tolerance(0.01, True),
        mounting_angle_deg=Tolerance(1.0, False),
        limiting_layer_thickness_mm=Tolerance(0.1, False),
    ).steps
    assert (spacing.finger, spacing.base_spacing) == ({}, pytest.approx(0.6))
    assert (angle.finger, angle.mounting_angle) == ({}, pytest.approx(np.pi / 180.0))
    assert layer.layer_thickness == pytest.approx(0.1)
    assert layer.finger["segment_height"] == pytest.approx(0.05)


def test_tolerances_stand_beside_errors_of_fits_and_of_the_model() -> None:
    design = replace(DESIGNS["fitted at its own geometry"], model_error=0.05)
    known = tolerated(design, elastic_modulus_MPa=Tolerance(0.1, True))
    assert known.causes == (FITTED, "elastic_modulus_MPa", MODEL)
    assert known.covariance.tolist() == np.eye(2).tolist()
    assert known.covers == "fitted values, tolerance of elastic_modulus_MPa, model error of 5 %"


def test_without_any_there_is_none() -> None:
    assert resolve(BASE).scene().uncertainty is None
    only_model = resolve(replace(BASE, model_error=0.05)).scene().uncertainty
    assert only_model is not None
    assert (only_model.steps, only_model.model_error) == ((), 0.05)


TOLERANCES = {
    "dome_height_mm": Tolerance(0.02, False),
    "unit_separation_mm": Tolerance(0.01, True),
    "elastic_modulus_MPa": Tolerance(0.1, True),
    "unit_cell_mm": Tolerance(0.1, False),
}


@pytest.mark.parametrize("pattern", ["0100", "1011", "1111"])
def test_it_is_the_scatter_of_fingers_that_are_drawn(pattern: str) -> None:
    """Dimensions drawn at random, resolved and solved: 20,000 fingers."""
    random = np.random.default_rng(5)
    columns = {
        f"finger.geometry.{key}": GEOMETRY[key]
        + tolerance.of(GEOMETRY[key]) * random.normal(size=20_000)
        for key, tolerance in TOLERANCES.items()
    }
    drawn = resolve(BASE.with_values(columns))
    assert not drawn.are_wrong.any()
    finger = drawn.batch(np.arange(20_000)).finger
    inverted = np.array([[digit == "1"] for digit in pattern]).repeat(20_000, axis=1)
    settled = settle(UnitSolutions.of(finger), chain_potential, inverted, 1e-10)
    scatter = tip(settled, with_compliance=False).pose.std(axis=1)
    scene = resolve(replace(BASE, tolerances=TOLERANCES)).scene()
    rows = predict(scene, Request(patterns=(pattern,), columns=("uncertainty",))).arrays()
    names = ("tip_x_uncertainty_mm", "tip_y_uncertainty_mm", "tip_angle_uncertainty_rad")
    assert [rows[name][0] for name in names] == pytest.approx(scatter, rel=0.02)


FINITE_ELEMENTS = (
    "shapes curl 13–24 % too far against finite elements; calibrate: dpg help calibration"
)


def known_of(design: Design) -> tuple[str, float | None]:
    found = resolve(design).model_error
    return found.text, found.share


def test_what_is_known_of_the_geometric_lever() -> None:
    assert known_of(BASE) == (FINITE_ELEMENTS, None)
    assert known_of(replace(BASE, law="push_only")) == (FINITE_ELEMENTS, None)
    wider = BASE.with_values({"finger.geometry.unit_cell_mm": np.array([24.0])})
    assert "finite elements (at the study's dimensions); " in known_of(wider)[0]


def test_a_lever_that_is_given_is_the_study_s_or_unknown() -> None:
    def given(height: float) -> Design:
        lattice = {
            "segment_length_mm": 13.5,
            "segment_height_mm": height,
            "stroke_mm": 3.5,
            "bistable_stiffness_N_per_mm": 12.84,
            "force_linearity": 0.043,
            "hinge_stiffness_N_mm_per_rad": 24.2,
        }
        return Design(2, GivenValues(lattice={k: np.array([v]) for k, v in lattice.items()}))

    assert known_of(given(10.75)) == (FINITE_ELEMENTS, None)
    assert known_of(given(13.2)) == (UNKNOWN.text, None)


def test_of_a_law_that_nothing_was_compared_with_nothing_is_known() -> None:
    design = replace(BASE, calibrations=(dome(), PUBLISHED), law="tabulated")
    assert known_of(design) == (UNKNOWN.text, None)


def test_a_calibration_in_use_says_its_own() -> None:
    fitted = replace(BASE, calibrations=(LEVER, PUBLISHED))
    text, share = known_of(fitted)
    assert text == (
        "states that lever.yaml was not fitted to are off by 5.6 % of the deflection (rms), "
        "8 % at most"
    )
    assert share == 0.056
    moved_text, _ = known_of(fitted.with_values({"finger.geometry.unit_cell_mm": np.array([24.0])}))
    assert moved_text.endswith(", at the geometry of the fit, which is another")
    lever = {"segment_height_mm": np.array([10.75])}
    assert known_of(replace(fitted, finger=GivenValues(GEOMETRY, lever))) == (FINITE_ELEMENTS, None)


def test_the_spec_s_word_comes_first() -> None:
    design = replace(BASE, calibrations=(LEVER, PUBLISHED), model_error=0.03)
    assert known_of(design) == ("3 % of the deflection, as the spec says", 0.03)


def test_the_calibration_s_leave_one_out_counts_where_it_is_asked_for() -> None:
    fitted = replace(BASE, calibrations=(LEVER, PUBLISHED))
    silent = resolve(fitted).scene().uncertainty
    assert silent is not None and silent.model_error == 0.0
    asked = resolve(replace(fitted, model_error=LEAVE_ONE_OUT))
    assert not asked.are_wrong.any()
    counted = asked.scene().uncertainty
    assert counted is not None and counted.model_error == 0.056


def test_without_a_calibration_there_is_no_leave_one_out() -> None:
    found = resolve(replace(BASE, model_error=LEAVE_ONE_OUT))
    assert [issue.statement for issue in found.problems.of(0)] == [
        "model_error: expected a calibration in use that has a leave-one-out error, found none "
        "(dpg fit finger writes one; or give a percentage such as 5%)"
    ]


def test_a_step_names_its_cause_once() -> None:
    steps = (Step(FITTED, {}), Step(FITTED, {}), Step("stroke_mm", {}))
    assert Uncertainty(steps, np.eye(3)).causes == (FITTED, "stroke_mm")
