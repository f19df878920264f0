"""Shapes of fingers: where chambers, domes and layers are, and which states are drawn."""

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely

from dpgcli.api.inputs import scene_input
from dpgcli.design.scene import Gripper, Scene
from dpgcli.mechanics.finger import Finger
from dpgcli.reports.outlines import (
    COLUMNS,
    OF_GRIPPERS,
    DrawnState,
    FingerShape,
    Points,
    Profile,
    drawn_states,
    notes,
)
from dpgcli.states.plan import Request
from dpgcli.states.predict import predict

CONFIGS = Path(__file__).parents[2] / "configs"


def drawn(scene: Scene, *patterns: str) -> list[DrawnState]:
    columns = COLUMNS if scene.gripper is None else (*COLUMNS, *OF_GRIPPERS)
    return drawn_states(predict(scene, Request(patterns, columns=columns)))


def spec(name: str, **settings: Any) -> Scene:
    keys = {f"finger.{key.replace('__', '.')}": value for key, value in settings.items()}
    return scene_input(CONFIGS / f"{name}.yaml", keys).scene


def shape_of(scene: Scene, pattern: str) -> FingerShape:
    ((finger,),) = (state.fingers for state in drawn(scene, pattern))
    return finger


def polygon(points: Points) -> Any:
    return shapely.Polygon(np.column_stack((points.real, points.imag)))


def test_a_straight_finger_has_the_sizes_of_its_mold() -> None:
    """Chambers of 9 + 2 · 0.75 mm by 20 mm with gaps of 3 mm, on a layer 1.5 mm thick."""
    finger = shape_of(spec("three_unit"), "000")
    boxes = [polygon(points).bounds for points in finger.chambers]
    expected = [(13.5 * i - 5.25, 0.75, 13.5 * i + 5.25, 20.75) for i in range(4)]
    np.testing.assert_allclose(boxes, expected, atol=1e-9)
    assert finger.thickness == 1.5
    assert finger.tip == pytest.approx(40.5)
    assert finger.layer[[0, -1]] == pytest.approx([-5.25, 45.75])
    assert finger.layer.imag == pytest.approx(0.0, abs=1e-9)
    assert not finger.are_inverted.any()


def test_a_dome_lies_in_its_chamber_until_it_is_inverted() -> None:
    """Folded in by its height of 6.5 mm, 14 mm wide; pushed out it touches the next chamber."""
    ground, inverted = (shape_of(spec("three_unit"), pattern) for pattern in ("000", "010"))
    area = np.pi / 4.0 * 14.0 * 6.5
    first, second, third = (polygon(points) for points in ground.chambers[:3])
    assert [first.area, second.area] == pytest.approx([210.0 - area] * 2, rel=0.005)
    out, beyond = polygon(inverted.chambers[1]), polygon(inverted.chambers[2])
    assert out.area > 210.0
    assert out.distance(beyond) < 0.05
    assert out.intersection(beyond).area < 2.0  # it stands against it, not in it
    assert second.distance(third) == pytest.approx(3.0)
    assert inverted.are_inverted.tolist() == [False, True, False, False]


def test_layers_run_along_the_floors_of_chambers() -> None:
    finger = shape_of(spec("five_unit"), "11111")
    line = shapely.LineString(np.column_stack((finger.layer.real, finger.layer.imag)))
    for points in finger.chambers:
        assert polygon(points).distance(line) == pytest.approx(0.75, abs=1e-6)
    assert line.distance(shapely.Point(finger.tip.real, finger.tip.imag)) < 1e-9


def test_units_with_higher_domes_are_taller() -> None:
    scene = spec("graded_five_unit")
    heights = [polygon(points).bounds[3] for points in shape_of(scene, "00000").chambers]
    assert heights == pytest.approx([20.75] * 3 + [0.75 + 20.0 * 7.5 / 6.5] * 3)
    assert "not to scale" in notes(scene)[0]
    assert notes(spec("five_unit")) == []


def test_units_of_another_length_have_longer_chambers() -> None:
    scene = spec("three_unit", overrides={"2": {"geometry": {"chamber_length_mm": 20}}})
    boxes = [polygon(points).bounds for points in shape_of(scene, "000").chambers]
    gaps = [later[0] - box[2] for box, later in pairwise(boxes)]
    assert gaps == pytest.approx([3.0, 3.0, 3.0])
    assert boxes[-1][2] == pytest.approx(40.5 + 11.0 + 5.25)


def test_a_lattice_alone_has_the_proportions_of_the_study() -> None:
    given = Profile.of(spec("three_unit"))
    lattice = Profile.of(spec("eight_unit", units=3))
    for name in ("length", "gap", "dome", "height", "axis", "layer"):
        assert getattr(lattice, name) == pytest.approx(getattr(given, name)), name
    assert "proportions of the study" in notes(spec("eight_unit"))[0]


def test_sizes_that_do_not_fit_still_give_a_shape() -> None:
    """A layer thicker than the fingers, gaps longer than their units: the lattice allows both."""
    scene = spec("eight_unit", geometry__limiting_layer_thickness_mm=80)
    assert polygon(shape_of(scene, "0" * 8).chambers[0]).area > 1.0
    scene = spec("eight_unit", geometry__unit_separation_mm=50)
    assert polygon(shape_of(scene, "0" * 8).chambers[0]).area > 1.0


@pytest.mark.parametrize("scale", [1e-6, 1e-3, 1e3])
def test_pictures_scale_with_their_finger(
    reference_finger: Callable[..., Finger], scale: float
) -> None:
    def shape(factor: float) -> FingerShape:
        sizes = ("segment_length", "segment_height", "stroke")
        lengths = {
            name: factor * size for name, size in zip(sizes, (13.5, 10.75, 3.5), strict=True)
        }
        hinge = {"hinge_stiffness": 24.2 * factor**2}
        return shape_of(Scene(reference_finger(3, **lengths, **hinge), sources=()), "101")

    np.testing.assert_allclose(shape(scale).points, scale * shape(1.0).points, rtol=1e-6)


def test_states_come_by_the_number_of_inverted_units_then_as_in_the_table() -> None:
    patterns = [state.pattern for state in drawn(spec("three_unit"))]
    assert patterns == ["000", "001", "010", "100", "011", "101", "110", "111"]


def test_what_is_not_stable_has_no_shape_but_a_word() -> None:
    scene = spec("three_unit", geometry__dome_height_mm=4.2, geometry__dome_thickness_mm=0.4)
    first, *others = drawn(scene)
    assert first.fingers
    assert {state.description for state in others if not state.fingers} >= {"111: not bistable"}
    assert all(np.isfinite(state.tip) for state in (first, *others) if state.fingers)


def test_fingers_of_a_gripper_mirror_each_other() -> None:
    """Their faces are as far apart as the aperture says."""
    for state in drawn(spec("gripper"), "10000", "11111"):
        upper, lower = state.fingers
        np.testing.assert_array_equal(upper.points, lower.points.conj())
        assert state.aperture is not None and state.faces is not None
        assert state.faces[0].imag - state.faces[1].imag == pytest.approx(state.aperture)
        assert state.overlaps is (state.aperture < 0.0)
        assert ("overlap" in state.description) is state.overlaps


def test_a_tilted_mount_tilts_the_finger(reference_finger: Callable[..., Finger]) -> None:
    gripper = Gripper(base_spacing=60.0, mounting_angle=np.pi / 6.0)
    (state,) = drawn(Scene(reference_finger(3), (), gripper), "000")
    mount = state.fingers[0].mount
    assert np.angle(mount[1] - mount[0]) == pytest.approx(np.pi / 2.0 + np.pi / 6.0)
