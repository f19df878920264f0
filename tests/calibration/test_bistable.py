"""The bistable law from curves: known values come back, and every warning has its reason."""

from pathlib import Path

import numpy as np
import pytest

from dpgcli.arrays import Array
from dpgcli.calibration.bistable import (
    BistableFit,
    BistableOptions,
    OpeningRule,
    fit_bistable,
    law,
    rests,
    slopes,
)
from dpgcli.calibration.choices import Branches, CurveQuantity, Loss, Rule
from dpgcli.calibration.record import Record
from dpgcli.errors import FitError
from dpgcli.files.calibration.results import values_of
from dpgcli.files.measured import read_curve

DATA = Path(__file__).parents[2] / "configs" / "calibration"
TRUE = np.array([12.84, 0.043, 3.5])
TRAVEL = np.linspace(0.0, 4.2, 85)
EQUAL = OpeningRule(Rule.EQUAL)
NOISE = {CurveQuantity.ENERGY: 0.1, CurveQuantity.FORCE: 0.3}


def curve(quantity: CurveQuantity, seed: int | None = None, travel: Array = TRAVEL) -> Record:
    exact = law(travel, TRUE, quantity)
    if seed is not None:
        exact = exact + np.random.default_rng(seed).normal(0.0, NOISE[quantity], len(travel))
    return Record(travel, **{quantity.value: exact})


def fitted(
    data: Record, quantity: CurveQuantity = CurveQuantity.ENERGY, **options: object
) -> BistableFit:
    opening = options.pop("opening", EQUAL)
    return fit_bistable(data, BistableOptions(opening, quantity, **options))  # type: ignore[arg-type]


def warned(found: BistableFit, start: str) -> list[str]:
    return [text for text in found.warnings if text.startswith(start)]


@pytest.mark.parametrize("quantity", [CurveQuantity.ENERGY, CurveQuantity.FORCE])
def test_exact_curves_give_the_law_back_without_a_warning(quantity: CurveQuantity) -> None:
    found = fitted(curve(quantity), quantity)
    assert found.fit.values == pytest.approx(TRUE, rel=1e-9)
    assert found.warnings == ()
    assert found.gaps == []
    assert found.well == pytest.approx(float(rests(TRUE).well), abs=0.01)


@pytest.mark.parametrize("quantity", [CurveQuantity.ENERGY, CurveQuantity.FORCE])
def test_noisy_curves_give_no_warning_either(quantity: CurveQuantity) -> None:
    assert fitted(curve(quantity, 0), quantity).warnings == ()


@pytest.mark.slow
@pytest.mark.parametrize("quantity", [CurveQuantity.ENERGY, CurveQuantity.FORCE])
def test_standard_errors_are_the_scatter_over_repeated_noise(quantity: CurveQuantity) -> None:
    fits = [fitted(curve(quantity, seed), quantity).fit for seed in range(200)]
    scatter = np.std([f.values for f in fits], axis=0, ddof=1)
    stated = np.sqrt(np.mean([f.standard_errors**2 for f in fits], axis=0))
    assert stated == pytest.approx(scatter, rel=0.15)  # 200 know a deviation to 5 %
    bias = np.mean([f.values for f in fits], axis=0) - TRUE
    assert (np.abs(bias) < 4.0 * scatter / np.sqrt(200)).all()


def test_the_bootstrap_agrees_with_the_standard_errors() -> None:
    found = fitted(curve(CurveQuantity.ENERGY, 1), resamples=200).fit
    assert found.intervals is not None
    half = np.diff(found.intervals)[:, 0] / (2 * 1.96)
    assert half == pytest.approx(found.standard_errors, rel=0.35)


@pytest.mark.parametrize("quantity", [CurveQuantity.ENERGY, CurveQuantity.FORCE])
@pytest.mark.parametrize("values", [TRUE, np.array([44.0, 0.5, 13.0])])
def test_slopes_are_central_differences(quantity: CurveQuantity, values: Array) -> None:
    opening = np.linspace(-0.5, 5.0, 23)
    found = slopes(opening, values, quantity)
    for place, size in enumerate(values):
        step = 1e-3 * size * np.eye(3)[place]
        parts = [
            weight * law(opening, values + k * step, quantity)
            for k, weight in ((-2, 1), (-1, -8), (1, 8), (2, -1))
        ]
        expected = np.sum(parts, axis=0) / (12e-3 * size)
        assert found[:, place] == pytest.approx(expected, rel=1e-7, abs=1e-9)


def test_the_turning_points_carry_no_force() -> None:
    found = np.array(rests(TRUE))
    assert law(found, TRUE, CurveQuantity.FORCE) == pytest.approx([0, 0], abs=1e-12)
    assert np.isnan(rests(np.array([1.0, 0.112, 1.0]))).all()
    assert np.isfinite(rests(np.array([1.0, 0.111, 1.0]))).all()


def test_a_pressure_is_a_force_over_its_area() -> None:
    pressure = Record(TRAVEL, pressure=law(TRAVEL, TRUE, CurveQuantity.FORCE) / 31.6)
    assert fitted(pressure, CurveQuantity.PRESSURE, area=31.6).fit.values == pytest.approx(TRUE)


def test_work_is_fitted_as_an_energy() -> None:
    fine = np.linspace(0.0, 4.2, 3001)
    found = fitted(curve(CurveQuantity.FORCE, travel=fine), CurveQuantity.WORK)
    assert found.fit.values == pytest.approx(TRUE, rel=1e-4)


@pytest.mark.parametrize("quantity", [CurveQuantity.ENERGY, CurveQuantity.FORCE])
def test_the_mapping_stretches_the_law(quantity: CurveQuantity) -> None:
    """x = f u: the stroke scales by f and the stiffness by f^-2, energies stay."""
    factor, data = 0.25, curve(quantity)
    found = fitted(data, quantity, opening=OpeningRule(Rule.PROPORTIONAL, factor))
    assert found.fit.values == pytest.approx(TRUE * [factor**-2, 1.0, factor], rel=1e-8)
    assert found.factor == factor


def test_a_stroke_puts_the_inverted_well_there() -> None:
    found = fitted(curve(CurveQuantity.ENERGY), opening=OpeningRule(Rule.STROKE, 1.75))
    assert float(rests(found.fit.values).well) == pytest.approx(1.75, rel=2e-3)


def test_fixed_values_stay() -> None:
    found = fitted(
        curve(CurveQuantity.ENERGY, 0), fixed={"stroke_mm": 3.5, "force_linearity": 0.043}
    )
    assert found.fit.values[1:].tolist() == [0.043, 3.5]
    assert found.fit.values[0] == pytest.approx(12.84, rel=0.01)
    everything = dict(
        zip(("bistable_stiffness_N_per_mm", "force_linearity", "stroke_mm"), TRUE, strict=True)
    )
    assert fitted(curve(CurveQuantity.ENERGY), fixed=everything).fit.rms < 1e-12


def test_an_unsampled_middle_makes_the_barrier_an_extrapolation() -> None:
    ends = TRAVEL[(TRAVEL < 0.6) | (TRAVEL > 3.2)]
    found = fitted(curve(CurveQuantity.ENERGY, travel=ends))
    (said,) = found.warnings
    assert said.startswith("nothing is sampled from 0.55 to 3.25 mm: the barrier of the fitted ")
    assert found.gaps == [(pytest.approx(0.55), pytest.approx(3.25))]


def test_an_unsampled_well_is_said() -> None:
    found = fitted(curve(CurveQuantity.ENERGY, travel=TRAVEL[TRAVEL < 2.8]))
    (said,) = found.warnings
    assert said.startswith("the inverted well is not sampled (travel up to 2.75 mm)")
    assert said.endswith("the fitted one, at 3.325 mm, is an extrapolation")


def test_a_curve_before_its_barrier_says_so() -> None:
    found = fitted(curve(CurveQuantity.ENERGY, travel=TRAVEL[TRAVEL < 1.5]))
    assert warned(found, "nothing is sampled beyond 1.45 mm: the barrier of the fitted law")


@pytest.mark.parametrize(
    ("linearity", "said"), [(0.2, "not bistable"), (0.105, "hardly bistable"), (0.09, "")]
)
def test_a_law_without_second_well_is_said(linearity: float, said: str) -> None:
    energies = law(TRAVEL, np.array([12.84, linearity, 3.5]), CurveQuantity.ENERGY)
    found = fitted(Record(TRAVEL, energy=energies))
    bistable = [text for text in found.warnings if "bistable" in text]
    assert bool(bistable) == bool(said)
    assert all(text.startswith(said) and "the hinge takes" in text for text in bistable)


@pytest.mark.parametrize("loss", [Loss.LINEAR, Loss.HUBER])
@pytest.mark.parametrize("by", ["force", "pressure"])
@pytest.mark.slow
def test_standard_errors_of_a_work_are_those_of_its_errors_added_up(by: str, loss: Loss) -> None:
    """Drawn at random: forces, or pressures, have independent errors, and work has their sums."""
    random, area = np.random.default_rng(1), 30.0
    travel = np.linspace(0.0, 4.2, 101)
    force = law(travel, TRUE, CurveQuantity.FORCE)
    deviations = []
    for _ in range(40):
        push = force + random.normal(0.0, 0.005 * force.max(), len(travel))
        record = (
            Record(travel, force=push)
            if by == "force"
            else Record(travel, pressure=push / area, volume=area * travel)
        )
        found = fitted(record, CurveQuantity.WORK, loss=loss)
        assert not warned(found, "neighboring residuals"), "noise that is added up is no misfit"
        deviations.append((found.fit.values - TRUE) / found.fit.standard_errors)
    spread = np.sqrt((np.array(deviations) ** 2).mean(axis=0))
    assert (spread > 0.7).all() and (spread < 1.4).all(), spread


def test_another_shape_of_a_work_is_said_and_intervals_are_too_narrow() -> None:
    force = law(TRAVEL, TRUE, CurveQuantity.FORCE) + 5.0 * np.sin(2.0 * TRAVEL)
    found = fitted(Record(TRAVEL, force=force), CurveQuantity.WORK, resamples=20)
    assert warned(found, "neighboring residuals are alike")
    assert warned(found, "bootstrap: errors of a work add up")
    assert not warned(fitted(curve(CurveQuantity.ENERGY, 0), resamples=20), "bootstrap: errors")


def test_a_value_at_its_bound_is_said() -> None:
    energies = law(TRAVEL, np.array([12.84, -0.05, 3.5]), CurveQuantity.ENERGY)
    found = fitted(Record(TRAVEL, energy=energies))
    assert warned(found, "force_linearity ended at its bound 0")
    assert found.fit.values[1] == 0.0


def test_another_shape_is_said() -> None:
    found = fitted(Record(TRAVEL, energy=np.sin(3.0 * TRAVEL) ** 2 + 0.1 * TRAVEL))
    assert warned(found, "the law does not follow the curve: R^2 = ")
    assert warned(found, "neighboring residuals are alike")


def test_the_curve_is_kept_for_a_tabulated_law() -> None:
    found = fitted(curve(CurveQuantity.ENERGY))
    assert found.curve is not None
    assert np.array_equal(found.curve[0], TRAVEL)
    assert np.array_equal(found.curve[1], law(TRAVEL, TRUE, CurveQuantity.ENERGY))


def test_the_curve_of_a_force_is_its_integral() -> None:
    found = fitted(curve(CurveQuantity.FORCE), CurveQuantity.FORCE)
    assert found.curve is not None
    assert found.curve[1] == pytest.approx(law(TRAVEL, TRUE, CurveQuantity.ENERGY), abs=0.02)


def test_an_integral_begins_at_rest() -> None:
    found = fitted(curve(CurveQuantity.FORCE, travel=TRAVEL[2:]), CurveQuantity.FORCE)
    assert found.curve is not None
    assert found.curve[1] == pytest.approx(law(TRAVEL[2:], TRUE, CurveQuantity.ENERGY), abs=0.03)


def test_work_from_a_first_point_that_is_not_rest() -> None:
    fine = np.linspace(0.3, 4.2, 3001)
    found = fitted(curve(CurveQuantity.FORCE, travel=fine), CurveQuantity.WORK)
    assert found.fit.values == pytest.approx(TRUE, rel=0.02), "½ u F up to the first point"


def test_what_is_before_the_first_point_is_not_known() -> None:
    late = fitted(curve(CurveQuantity.FORCE, travel=np.linspace(2.8, 4.2, 40)), CurveQuantity.FORCE)
    assert late.gaps == [(0.0, 2.8)]
    assert late.curve is None
    assert warned(late, "no curve written: no work across 0 to 2.8 mm")
    assert warned(late, "nothing is sampled from 0 to 2.8 mm: the barrier of the fitted law")


def test_a_curve_of_few_points_is_not_written() -> None:
    one = curve(CurveQuantity.ENERGY, travel=np.array([3.0]))
    found = fitted(one, fixed={"stroke_mm": 3.5, "force_linearity": 0.043})
    assert found.fit.values[0] == pytest.approx(12.84)
    assert warned(found, "no curve written: expected 4 points or more, found 1")


def test_no_curve_where_the_force_is_not_known() -> None:
    ends = TRAVEL[(TRAVEL < 0.6) | (TRAVEL > 3.2)]
    found = fitted(curve(CurveQuantity.FORCE, travel=ends), CurveQuantity.FORCE)
    assert found.curve is None
    assert warned(found, "no curve written: no work across 0.55 to 3.25 mm")


@pytest.mark.parametrize(
    ("data", "quantity", "opening", "said"),
    [
        (curve(CurveQuantity.ENERGY), CurveQuantity.FORCE, EQUAL, "no force in the curve"),
        (curve(CurveQuantity.ENERGY), CurveQuantity.WORK, EQUAL, "no work without"),
        (Record(TRAVEL[:2], energy=TRAVEL[:2]), CurveQuantity.ENERGY, EQUAL, "2 points for 3 free"),
        (Record(TRAVEL, energy=-TRAVEL), CurveQuantity.ENERGY, EQUAL, "is its sign the other way"),
        (
            curve(CurveQuantity.ENERGY, travel=TRAVEL[:20]),
            CurveQuantity.ENERGY,
            OpeningRule(Rule.STROKE, 3.5),
            "does not show where the inverted dome rests",
        ),
    ],
)
def test_fits_that_cannot_be(
    data: Record, quantity: CurveQuantity, opening: OpeningRule, said: str
) -> None:
    with pytest.raises(FitError, match=said):
        fitted(data, quantity, opening=opening)


def test_the_quasi_static_dome() -> None:
    """Pinned: the finite-element dome of configs/calibration, x = u; errors are those of misfit."""
    found = fitted(read_curve(DATA / "dome_path_h6.5_t0.75.csv").curve)
    assert found.fit.values == pytest.approx([44.12, 0.01566, 13.494], rel=1e-3)
    assert found.fit.r_squared == pytest.approx(0.9970, abs=1e-4)
    assert found.well == pytest.approx(13.7083, abs=0.005)
    assert warned(found, "nothing is sampled from 1.864 to 13.71 mm")


def test_the_dynamic_dome_rings_and_drifts() -> None:
    record = read_curve(DATA / "dome_dynamic_h6.5_t0.75.csv").curve
    found = fitted(record)
    assert warned(found, "ringing: the travel reverses 76 times")
    assert warned(found, "drifting energy: at 94 points near a travel of 13.79 mm")
    assert warned(found, "no curve written: its energies are those of a ringing dome")
    assert found.curve is None
    assert found.fit.r_squared < 0.7


def test_its_quasi_static_pieces_are_near_the_static_dome() -> None:
    record = read_curve(DATA / "dome_dynamic_h6.5_t0.75.csv").curve
    found = fitted(record, branches=Branches.QUASI_STATIC)
    assert warned(
        found, "quasi-static pieces, time 0.001 to 0.08925, 0.09866 to 0.22: dropped 1194"
    )
    assert not warned(found, "ringing")
    assert warned(found, "drifting energy"), "what is kept has drifted all the same"
    static = fitted(read_curve(DATA / "dome_path_h6.5_t0.75.csv").curve).fit.values
    stiffness, linearity, stroke = found.fit.values / static
    assert stiffness == pytest.approx(1.0, abs=0.03)
    assert stroke == pytest.approx(1.0, abs=0.01)
    assert 1.04 < linearity < 1.17, "the inverted energy has drifted by 4 to 17 %"
    assert found.fit.r_squared > 0.998
    assert found.curve is not None


@pytest.mark.parametrize("quantity", [CurveQuantity.ENERGY, CurveQuantity.FORCE])
@pytest.mark.parametrize("largest", [3.6, 4.2, 9.0, 12.0])
def test_a_well_is_found_however_far_the_travel_goes_on(
    quantity: CurveQuantity, largest: float
) -> None:
    found = fitted(curve(quantity, 0, np.linspace(0.0, largest, 300)), quantity)
    assert found.well == pytest.approx(3.325, abs=0.05)
    assert not warned(found, "the inverted well")


@pytest.mark.parametrize("seed", range(5))
def test_noise_on_the_way_to_the_barrier_is_no_well(seed: int) -> None:
    found = fitted(curve(CurveQuantity.ENERGY, seed, np.linspace(0.0, 2.6, 300)))
    assert found.well is None
    assert warned(found, "the inverted well is not sampled (travel up to 2.6 mm)")


def test_a_well_within_the_data_is_no_extrapolation() -> None:
    found = fitted(curve(CurveQuantity.ENERGY, travel=np.linspace(0.0, 4.2, 10)))
    assert found.well is None, "three points are near it"
    (said,) = found.warnings
    assert said.startswith("the data alone do not show where the inverted dome rests")
    assert said.endswith("the law has it at 3.325 mm, within the data")


def test_a_well_in_a_gap_is_an_extrapolation() -> None:
    found = fitted(curve(CurveQuantity.ENERGY, travel=TRAVEL[(TRAVEL < 2.8) | (TRAVEL > 3.9)]))
    assert warned(found, "the inverted well is not sampled (nothing from 2.75 to 3.9 mm)")


def test_a_linearity_of_zero_that_is_found_to_rounding_is_zero() -> None:
    fits = []
    for n_points in range(6, 40):
        opening = np.linspace(0.0, 4.2, n_points)
        force = law(opening, np.array([12.84, 0.0, 3.5]), CurveQuantity.FORCE)
        fits.append(fitted(Record(opening, force=force), CurveQuantity.FORCE).fit)
    assert any(0.0 < fit.values[1] < 1e-12 for fit in fits), "no case of the kind"
    for fit in fits:
        linearity = values_of(fit, only_free=False).force_linearity
        assert linearity is not None and linearity.value == pytest.approx(0.0, abs=1e-9)
