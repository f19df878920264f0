"""Designs become lattices: many at once as each by itself, differentiable, wrong ones masked."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from dpgcli.arrays import Array
from dpgcli.calibration.choices import GridMethod
from dpgcli.calibration.grid import FittedGridLaw, GridPoints
from dpgcli.design.calibrations import PUBLISHED, Calibration, DomeCurve, Fitted, Grid
from dpgcli.design.dimensions import Design, GivenValues, are_possible
from dpgcli.design.resolve import Resolution, resolve
from dpgcli.design.scene import ORIGINS
from dpgcli.files.scene_file.models import FingerSpec, GripperSpec
from dpgcli.files.sections import Geometry, Lattice

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
OVER = ("dome_height_mm", "dome_thickness_mm")
STIFFNESS = "bistable_stiffness_N_per_mm"


def sizes(**given: float) -> dict[str, Array]:
    return {key: np.array([value]) for key, value in given.items()}


def grid(method: GridMethod, *, is_regular: bool) -> Calibration:
    """Values that are no product of powers, at the nodes of a grid or anywhere."""
    geometry = np.array([(h, t) for h in (4.5, 5.5, 6.6, 7.5) for t in (0.5, 0.7, 1.0)])
    if not is_regular:
        geometry = geometry + np.random.default_rng(3).uniform(-0.04, 0.04, geometry.shape)
    stiffness = 12.0 * geometry[:, 1] ** 2 * (1.0 + 0.1 * np.sin(geometry[:, 0]))
    law = FittedGridLaw(method, GridPoints(OVER, geometry, {STIFFNESS: stiffness}))
    known = Grid(OVER, frozenset({STIFFNESS}), method is GridMethod.SCALING, law)
    return Calibration("grid.yaml", {}, {"elastic_modulus_MPa": 26.0}, grid=known)


def dome() -> Calibration:
    """A curve with a well at 9.5 mm of a dome of 6.5 mm."""
    travel = np.linspace(0.0, 12.0, 49)
    energy = 0.02 * travel**2 * (travel - 9.5) ** 2 + 2.0 * (travel / 9.5) ** 2
    values = {STIFFNESS: Fitted(12.84, 0.1), "stroke_mm": Fitted(3.5, 0.01)}
    own = {key: size for key, size in GEOMETRY.items() if key != "unit_cell_mm"}
    return Calibration("dome.yaml", values, own, curve=DomeCurve(travel, energy, 1.0))


DESIGNS = {
    "published": Design(5, GivenValues(sizes(**GEOMETRY)), {}, np.array([1e4]), (PUBLISHED,)),
    "graded": Design(
        5,
        GivenValues(sizes(**GEOMETRY)),
        {"4-5": GivenValues(sizes(dome_height_mm=7.1, unit_separation_mm=3.3))},
        np.array([1e4]),
        (PUBLISHED,),
    ),
    "given": Design(
        3,
        GivenValues(sizes(**GEOMETRY), sizes(stroke_mm=3.5, hinge_stiffness_N_mm_per_rad=20.0)),
        {},
        np.array([np.inf]),
        (PUBLISHED,),
    ),
    **{
        f"{method}, {is_regular}": Design(
            2,
            GivenValues(sizes(**{**GEOMETRY, "elastic_modulus_MPa": 28.0})),
            {},
            np.array([1e4]),
            (grid(method, is_regular=is_regular), PUBLISHED),
        )
        for method in GridMethod
        for is_regular in (True, False)
    },
    **{
        law: Design(
            4, GivenValues(sizes(**GEOMETRY)), {}, np.array([1e4]), (dome(), PUBLISHED), law
        )
        for law in ("tabulated", "push_only")
    },
}
KEYS = [f"finger.geometry.{key}" for key in GEOMETRY]
named = pytest.mark.parametrize("name", DESIGNS)


def moved(design: Design, key: str, step: complex) -> dict[str, Array]:
    """The lattice, its bars aside, with a dimension near its own moved by a step."""
    size = design.finger.geometry[key.rsplit(".", 1)[-1]]
    lattice = resolve(design.with_values({key: size * 1.01 + step})).lattice
    return {name: values for name, values in lattice.items() if name != "linear_stiffness"}


@named
def test_a_complex_step_differentiates_every_rule(name: str) -> None:
    """Against fourth-order central differences, beside the reference and within the ranges."""
    design, n_slopes = DESIGNS[name], 0
    for key in KEYS:
        step = 1e-3 * design.finger.geometry[key.rsplit(".", 1)[-1]].item()
        steps = (2.0 * step, step, -step, -2.0 * step)
        ahead, near, behind, back = (moved(design, key, s) for s in steps)
        for array, values in moved(design, key, 1e-100j).items():
            slope = values.imag / 1e-100
            difference = 8.0 * (near[array] - behind[array]) - (ahead[array] - back[array])
            rounding = 1e-12 * np.abs(values).max() / step
            np.testing.assert_allclose(slope, difference / (12.0 * step), 1e-7, rounding)
            n_slopes += np.count_nonzero(slope)
    assert n_slopes >= 5


@named
def test_many_designs_are_each_by_itself(name: str) -> None:
    """To the last bit, with the same problems in the same words and of the same origin."""
    rng = np.random.default_rng(11)
    columns = {
        key: size * rng.uniform(0.7, 1.5, 60)
        for key, size in ((k, DESIGNS[name].finger.geometry[k.rsplit(".", 1)[-1]]) for k in KEYS)
    }
    together = resolve(DESIGNS[name].with_values(columns))
    n_wrong = 0
    for place in range(60):
        own = {key: column[place : place + 1] for key, column in columns.items()}
        alone = resolve(DESIGNS[name].with_values(own))
        assert together.problems.of(place) == alone.problems.of(0)
        assert together.are_wrong[place] == alone.are_wrong[0]
        n_wrong += alone.are_wrong[0]
        if not alone.are_wrong[0]:
            assert together.gravest_origins[place] == alone.gravest_origins[0]
            check_same(together, place, alone)
    assert (n_wrong < 60) == (name != "given")  # where a stroke is given, others disagree


def check_same(together: Resolution, place: int, alone: Resolution) -> None:
    for array, values in alone.batch(np.array([0])).finger.arrays().items():
        many = together.batch(np.array([place])).finger.arrays()[array]
        assert np.array_equal(*np.broadcast_arrays(many, values)), array


def test_the_words_for_one_design_are_its_own() -> None:
    heights = {"finger.geometry.dome_height_mm": np.array([2.5, 6.5, 2.0])}
    found = resolve(DESIGNS["published"].with_values(heights))
    assert found.are_wrong.tolist() == [True, False, True]
    assert [issue.found for issue in found.problems.of(2)] == ["stroke_mm = -1"]
    assert found.problems.of(1) == []
    origins = [ORIGINS[place].value for place in found.gravest_origins]
    assert origins == ["extrapolated", "calibrated", "extrapolated"]


def test_a_value_of_an_override_is_one_of_its_units() -> None:
    """In place of what the override says already, beside it, and of units that had none."""
    columns = {
        "finger.overrides.4-5.geometry.dome_height_mm": np.array([7.0, 6.8]),
        "finger.overrides.2.lattice.stroke_mm": np.array([3.5, 3.5]),
    }
    stroke = resolve(DESIGNS["graded"].with_values(columns)).lattice["stroke"]
    assert (
        pytest.approx(np.array([[3.5, 3.5, 3.5, 3.7, 3.7], [3.5, 3.5, 3.5, 3.5, 3.5]]), rel=1e-12)
        == stroke.T
    )


def test_a_unit_cell_has_room_between_its_walls() -> None:
    cells = {"finger.geometry.unit_cell_mm": np.array([1.0, 2.0, 2.5])}
    found = resolve(DESIGNS["published"].with_values(cells))
    assert found.are_wrong.tolist() == [True, True, False]
    assert [issue.expected for issue in found.problems.of(1)] == ["a length > 2 mm"]


def test_values_given_twice_agree_to_a_millionth() -> None:
    strokes = 3.5 * (1.0 + np.array([-1.1e-6, -0.9e-6, 0.0, 0.9e-6, 1.1e-6]))
    found = resolve(DESIGNS["given"].with_values({"finger.lattice.stroke_mm": strokes}))
    assert found.are_wrong.tolist() == [True, False, False, False, True]


@pytest.mark.parametrize(
    ("section", "needed"),
    [
        (Geometry, {}),
        (Lattice, {}),
        (GripperSpec, {"base_spacing_mm": 1.0}),
        (FingerSpec, {"units": 1}),
    ],
)
def test_a_key_can_have_the_values_that_a_spec_takes(section: Any, needed: Any) -> None:
    limits = [1e-12, 1.0, 90.0, 1e12, 1e18]
    values = np.array(
        [-91, -90, -1, 0, 0.5, 1.5, *(f * x for x in limits for f in (0.99, 1, 1.01))]
    )

    def takes(key: str, value: float) -> bool:
        try:
            section.model_validate({**needed, key: value})
        except ValueError:
            return False
        return True

    numbers = {k for k, f in section.model_fields.items() if "float" in str(f.annotation)}
    for key in numbers:
        every = np.append(values, np.inf)
        assert are_possible(key, every).tolist() == [takes(key, v) for v in every.tolist()], key
    assert numbers


def test_assumed_bars_count_as_given() -> None:
    """They are the gravest assumption by name, and the one that matters least."""
    base = DESIGNS["published"]
    for bars, origin in ((None, "assumed"), (np.array([1e4]), "given")):
        found = resolve(replace(base, linear_stiffness=bars))
        ((_, value),) = found.values["linear_stiffness_N_per_mm"]
        assert (ORIGINS[value.origin.item()], value.numbers.item()) == (origin, 1e4)
        assert [ORIGINS[place].value for place in found.gravest_origins] == ["calibrated"]
