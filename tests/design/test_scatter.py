"""Scattered designs: each value's own statistics, what units share, streams, what is impossible."""

from pathlib import Path

import numpy as np
import pytest

from dpgcli.arrays import Array
from dpgcli.design.by_unit import size_by_unit, unit_by_unit, with_sizes
from dpgcli.design.dimensions import Design, GivenPressure, GivenValues, Tolerance
from dpgcli.design.resolve import resolve
from dpgcli.design.scatter import OF_FINGERS, OF_UNITS, scatter_issues, scattered
from dpgcli.files.scene_file import read_spec
from dpgcli.files.scene_file.tolerances import Tolerances

GRADED = Path(__file__).parents[2] / "configs" / "graded_five_unit.yaml"
N = 4000
HEIGHTS = Tolerance(0.1, False)


@pytest.fixture
def design() -> Design:
    """The study's graded finger."""
    return read_spec(GRADED, ["pressure={}"]).design


def strokes(design: Design, **spread: Tolerance) -> Array:
    ((_, _, finger),) = scattered(design, spread, N, 1).batches()
    return finger.stroke


def test_every_key_of_tolerances_scatters_but_those_of_grippers() -> None:
    assert {*OF_UNITS, *OF_FINGERS} == {*Tolerances.model_fields} - {
        "base_spacing_mm",
        "mounting_angle_deg",
    }


def test_units_scatter_by_themselves_around_their_own_values(design: Design) -> None:
    """d = h - s: mean and deviation of each unit, and no correlation between two."""
    found = strokes(design, dome_height_mm=HEIGHTS)
    assert found.shape == (5, N)
    np.testing.assert_allclose(found.mean(axis=1), [3.5, 3.5, 3.5, 4.5, 4.5], atol=0.006)
    np.testing.assert_allclose(found.std(axis=1), 0.1, rtol=0.05)
    off = np.corrcoef(found) - np.eye(5)
    assert np.abs(off).max() < 0.06


def test_a_percentage_is_of_each_value(design: Design) -> None:
    found = strokes(design, dome_height_mm=Tolerance(0.02, True))
    np.testing.assert_allclose(
        found.std(axis=1), 0.02 * np.array([6.5, 6.5, 6.5, 7.5, 7.5]), rtol=0.05
    )


def test_the_material_is_the_same_in_all_units(design: Design) -> None:
    other = {**design.overrides["4-5"].geometry, "elastic_modulus_MPa": np.array([52.0])}
    own = Design(**{**vars(design), "overrides": {"4-5": type(design.finger)(other)}})
    for spec, ratio in ((design, 1.0), (own, 2.0)):
        draws = scattered(spec, {"elastic_modulus_MPa": Tolerance(0.02, True)}, N, 1)
        ((_, _, finger),) = draws.batches()
        hinge = finger.hinge_stiffness * np.ones((5, 1))
        assert hinge[0].std() / hinge[0].mean() == pytest.approx(0.02, rel=0.05)
        np.testing.assert_allclose(hinge[4], ratio * hinge[0], rtol=1e-12)


def test_lattice_values_move_whatever_they_come_from(design: Design) -> None:
    spread = {"stroke_mm": HEIGHTS, "segment_height_mm": HEIGHTS}
    ((_, scene, finger),) = scattered(design, spread, N, 1).batches()
    assert finger.segment_height.shape == (1, N)
    assert finger.segment_height.std() == pytest.approx(0.1, rel=0.05)
    np.testing.assert_allclose(finger.stroke.std(axis=1), 0.1, rtol=0.05)
    assert scene.finger.stroke.std(axis=1).max() == 0.0
    assert np.array_equal(finger.segment_length, scene.finger.segment_length)


def test_draws_depend_on_seed_and_key_alone(design: Design) -> None:
    """Not on other keys, on their order, or on how many are drawn after them."""
    both = {"dome_thickness_mm": Tolerance(0.01, True), "dome_height_mm": HEIGHTS}
    first = strokes(design, dome_height_mm=HEIGHTS)
    assert np.array_equal(first, strokes(design, **both))
    assert np.array_equal(first, strokes(design, **dict(reversed(both.items()))))
    few = scattered(design, {"dome_height_mm": HEIGHTS}, 10, 1)
    ((_, _, finger),) = few.batches()
    assert np.array_equal(finger.stroke, first[:, :10])
    ((_, _, other),) = scattered(design, {"dome_height_mm": HEIGHTS}, 10, 2).batches()
    assert not np.isclose(other.stroke, finger.stroke).any()


def test_no_scatter_is_the_design_itself(design: Design) -> None:
    draws = scattered(design, {"dome_height_mm": Tolerance(0.0, False)}, 3, 1)
    ((_, scene, _),) = draws.batches()
    nominal = resolve(design).scene()
    for name, values in nominal.finger.arrays().items():
        assert np.array_equal(
            values * np.ones((5, 3)), scene.finger.arrays()[name] * np.ones((5, 3))
        )
    assert nominal.pressure is not None
    assert scene.pressure is not None
    assert nominal.pressure.snap_pressure is not None
    assert scene.pressure.snap_pressure is not None
    assert np.array_equal(
        nominal.pressure.snap_pressure * np.ones((5, 3)), scene.pressure.snap_pressure
    )


@pytest.mark.parametrize(
    ("key", "least"), [("dome_height_mm", 3.0), ("unit_separation_mm", 0.0), ("stroke_mm", 0.0)]
)
def test_draws_that_make_no_finger_are_wrong(design: Design, key: str, least: float) -> None:
    """Domes that never reach their neighbors, and sizes below zero."""
    draws = scattered(design, {key: Tolerance(2.5, False)}, N, 1)
    n_wrong = int(draws.are_wrong.sum())
    stream = np.random.default_rng([1, OF_UNITS.index(key)])
    nominal = {"dome_height_mm": [6.5, 6.5, 6.5, 7.5, 7.5], "stroke_mm": [3.5, 3.5, 3.5, 4.5, 4.5]}
    drawn = np.array(nominal.get(key, [3.0] * 5)) + 2.5 * stream.standard_normal((N, 5))
    is_wrong = (drawn <= least).any(axis=1)
    if key == "unit_separation_mm":
        is_wrong |= (drawn >= np.array(nominal["dome_height_mm"])).any(axis=1)
    assert np.array_equal(draws.are_wrong, is_wrong)
    assert 0.1 * N < n_wrong < 0.9 * N
    ((places, _, finger),) = draws.batches()
    assert len(places) == N - n_wrong
    assert (finger.stroke > 0.0).all()
    assert not draws.are_wrong[places].any()


def test_a_snap_pressure_that_is_given_is_that_of_the_given_dome(design: Design) -> None:
    """Draws of other domes snap elsewhere, by E t^2.5 h^1.2, by unit and with overrides."""
    given = GivenPressure(
        values={"snap_pressure_MPa": np.array([0.14])},
        overrides={"2-3": {"snap_pressure_MPa": np.array([0.16])}},
    )
    own = Design(**{**vars(design), "pressure": given})
    spread = {"dome_thickness_mm": Tolerance(0.02, True), "dome_height_mm": HEIGHTS}
    ((_, scene, finger),) = scattered(own, spread, N, 1).batches()
    assert scene.pressure is not None
    found = scene.pressure.snap_pressure
    assert found is not None
    nominal = np.array([[0.14], [0.16], [0.16], [0.14], [0.14]])
    thick = 0.5 * (finger.segment_length - 9.0 - 3.0) / 0.75
    tall = (finger.stroke + 3.0) / np.array([[6.5], [6.5], [6.5], [7.5], [7.5]])
    np.testing.assert_allclose(found, nominal * thick**2.5 * tall**1.2, rtol=1e-12)


@pytest.mark.parametrize(
    ("where", "moved", "others"),
    [
        ("lattice.stroke_mm=3.5", "dome_height_mm unit_separation_mm", "elastic_modulus_MPa"),
        ("overrides.4-5.lattice.stroke_mm=4.5", "dome_height_mm", "channel_width_mm"),
        ("lattice.segment_height_mm=10.75", "unit_cell_mm", "dome_height_mm"),
        ("lattice.bistable_stiffness_N_per_mm=12", "dome_thickness_mm", "elastic_modulus_MPa"),
        ("lattice.force_linearity=0.1", "", "dome_height_mm dome_thickness_mm"),
        (
            "overrides.1-5.lattice.bistable_stiffness_N_per_mm=12",
            "",
            "dome_height_mm dome_thickness_mm",
        ),
    ],
)
def test_a_value_that_is_given_does_not_follow_what_scatters(
    where: str, moved: str, others: str
) -> None:
    """And no other one is refused: of these, some draws are fingers."""
    settings = ["pressure={}", f"finger.{where}"]
    if "overrides" not in where:
        settings.insert(0, "finger.overrides={}")
    if "1-5" in where:
        settings.insert(0, "finger.overrides={}")
    given = read_spec(GRADED, settings).design
    value = where.partition("=")[2]
    for key in moved.split():
        (issue,) = scatter_issues(given, {key: HEIGHTS})
        assert (issue.path, issue.found) == ((key,), value)
        assert where.split(".")[-1 if "." not in value else -2].partition("=")[0] in issue.expected
        assert not [*scatter_issues(given, {key: Tolerance(0.0, False)})]
        assert scattered(given, {key: HEIGHTS}, 20, 1).are_wrong.all()
    for key in others.split():
        assert not [*scatter_issues(given, {key: HEIGHTS})]
        assert not scattered(given, {key: HEIGHTS}, 20, 1).are_wrong.all()


def test_what_says_nothing_here_is_an_issue(design: Design) -> None:
    hints = {
        "wall_compliance_mm_per_N": "walls are rigid",
        "chamber_width_mm": "finger.geometry does not give it",
    }
    for key, hint in hints.items():
        (issue,) = scatter_issues(design, {key: Tolerance(0.02, True)})
        assert issue.path[-1] == key
        assert issue.hint.startswith(hint)
    zero = read_spec(GRADED, ["finger.wall_compliance_mm_per_N=0"]).design
    (issue,) = scatter_issues(zero, {"wall_compliance_mm_per_N": Tolerance(0.02, True)})
    assert issue.expected == "a number in mm/N"
    assert issue.hint == "wall_compliance_mm_per_N is 0"


def test_units_have_sections_of_their_own(design: Design) -> None:
    own = unit_by_unit(design)
    assert [*own.overrides] == ["1", "2", "3", "4", "5"]
    one, other = resolve(design), resolve(own)
    for name, values in one.lattice.items():
        assert np.array_equal(values * np.ones((5, 1)), other.lattice[name] * np.ones((5, 1)))
    heights = size_by_unit(design, "dome_height_mm")
    assert heights is not None
    assert heights.ravel().tolist() == [6.5, 6.5, 6.5, 7.5, 7.5]
    some = {"1": GivenValues({"dome_height_mm": np.array([6.5])})}
    assert size_by_unit(Design(2, GivenValues(), some), "dome_height_mm") is None
    moved = resolve(with_sizes(design, "dome_height_mm", np.array([[5.0, 5.5]] * 5)))
    assert moved.lattice["stroke"].tolist() == [[2.0, 2.5]]
