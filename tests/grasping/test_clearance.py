"""How near moving bodies come to fingers: against dense sampling, and where they first meet."""

from typing import Any

import numpy as np
import pytest
import shapely

import dpgcli as dpg
from dpgcli.arrays import Array
from dpgcli.design.bodies import Body, Disc, Jaws, Polygon
from dpgcli.grasping.clearance import Clearance, clearance, outlines
from dpgcli.grasping.table import Grasps

N_SAMPLES = 4001
WALLS = np.array([[shapely.box(10.0, 12.0, 60.0, 30.0)], [shapely.box(10.0, -30.0, 60.0, -14.0)]])
DART = np.array([[-9.0, 9.0, 1.0, 9.0], [-7.0, -7.0, 0.0, 7.0]])  # with a corner that goes inwards
BODIES = {
    "disc": Disc(np.array([40.0, 0.0]), 9.0),
    "dart": Polygon(np.array([40.0, 0.0]), DART),
    "jaws": Jaws(np.array([40.0, 0.0]), gap=14.0, height=20.0),
}


def sampled(around: Any, body: Body, begin: Array, end: Array) -> tuple[float, float]:
    """The least gap of places one by one, and the first share with none."""
    shares = np.linspace(0.0, 1.0, N_SAMPLES)
    places = begin[:, None] + shares * (end - begin)[:, None]
    if isinstance(body, Disc):
        each = shapely.distance(around[:, :1], shapely.points(places.T)) - body.radius
    else:
        corners = (body.corners - body.center[:, None])[..., None] + places[:, None]
        each = shapely.distance(around[:, :1], shapely.polygons(corners.transpose(2, 1, 0)))
    least = each.min(axis=0)
    met = np.flatnonzero(least <= 0.0)
    return max(float(least.min()), 0.0), float(shares[met[0]]) if len(met) else 1.0


def found(around: Any, body: Body, begin: Array, end: Array) -> Clearance:
    return clearance(around, body, begin[:, None], end[:, None])


@pytest.mark.parametrize("name", BODIES)
@pytest.mark.parametrize("seed", range(8))
def test_ways_are_those_of_dense_samples(name: str, seed: int) -> None:
    body, draw = BODIES[name], np.random.default_rng(seed)
    begin, end = np.array([90.0, 0.0]), body.center + draw.normal(0.0, 4.0, 2)
    begin = begin + draw.normal(0.0, 12.0, 2)
    gap, share = sampled(WALLS, body, begin, end)
    way = found(WALLS, body, begin, end)
    step = float(np.hypot(*(end - begin))) / (N_SAMPLES - 1)
    assert gap - step <= way.gap[0] <= gap + 1e-9
    assert share - 1.0 / (N_SAMPLES - 1) - 1e-9 <= way.share[0] <= share + 1e-9
    assert way.is_clear[0] == (gap > 0.0)


def test_some_of_these_ways_are_clear_and_some_are_not() -> None:
    shares = []
    for seed in range(8):
        draw = np.random.default_rng(seed)
        end = BODIES["disc"].center + draw.normal(0.0, 4.0, 2)
        begin = np.array([90.0, 0.0]) + draw.normal(0.0, 12.0, 2)
        shares.append(found(WALLS, BODIES["disc"], begin, end).share[0])
    assert 0 < sum(share < 1.0 for share in shares) < 8


def test_a_disc_meets_a_corner_where_it_must() -> None:
    """At 60,12 by a disc of 13 mm on the axis: 5 mm before it, 13² = 12² + 5²."""
    way = found(
        WALLS, Disc(np.array([40.0, 0.0]), 13.0), np.array([90.0, 0.0]), np.array([40.0, 0])
    )
    assert way.share[0] == pytest.approx(0.5, abs=1e-14)


@pytest.mark.parametrize("name", BODIES)
def test_a_body_that_begins_in_a_finger_has_met_it(name: str) -> None:
    way = found(WALLS, BODIES[name], np.array([40.0, 20.0]), np.array([90.0, 0.0]))
    assert way.share[0] == way.gap[0] == 0.0
    small = np.array([[shapely.box(39.9, 0.9, 40.1, 1.1)]])  # all of it within the body
    way = found(small, BODIES["jaws"], np.array([40.0, 0.0]), np.array([90.0, 0.0]))
    assert way.share[0] == way.gap[0] == 0.0


def test_a_step_that_samples_pass_over_is_met() -> None:
    """A needle of 1e-5 mm across the way, between two samples."""
    needle = np.array([[shapely.box(60.0055, -1.0, 60.00551, 1.0)]])
    disc = Disc(np.array([40.0, 0.0]), 1e-6)
    assert not found(needle, disc, np.array([90.0, 0.0]), np.array([40.0, 0.0])).is_clear[0]
    assert sampled(needle, disc, np.array([90.0, 0.0]), np.array([40.0, 0.0]))[0] > 0.0


def test_lanes_are_apart() -> None:
    ends = np.array([[40.0, 40.0, 40.0], [0.0, 2.0, 9.0]])
    begins = np.array([[90.0] * 3, [0.0] * 3])
    way = clearance(np.repeat(WALLS, 3, axis=1), BODIES["disc"], begins, ends)
    for lane in range(3):
        alone = found(WALLS, BODIES["disc"], begins[:, lane], ends[:, lane])
        assert (way.gap[lane], way.share[lane]) == (alone.gap[0], alone.share[0])


SPEC = {
    "finger": {
        "units": 3,
        "calibration": "published",
        "linear_stiffness_N_per_mm": float("inf"),
        "geometry": {
            "dome_height_mm": 6.5,
            "dome_thickness_mm": 0.75,
            "unit_cell_mm": 22,
            "chamber_length_mm": 9,
            "channel_width_mm": 10,
            "limiting_layer_thickness_mm": 1.5,
            "unit_separation_mm": 3,
            "elastic_modulus_MPa": 26,
        },
    },
    "gripper": {"base_spacing_mm": 40, "mounting_angle_deg": 10},
}


@pytest.fixture(scope="module")
def grasped() -> Grasps:
    return dpg.grasp(SPEC, object="disc:1", at=(900.0, 0.0), patterns=["000", "011"]).grasps


def drawn(grasps: Grasps, row: int) -> Any:
    finger = grasps.scene.finger
    height, length = finger.segment_height[0], finger.segment_length[-1]
    parts = [
        outlines(own, frame, height, length)
        for own, frame in zip(grasps.fingers, grasps.frames, strict=True)
    ]
    return np.concatenate(parts)[:, row]


def test_fingers_are_from_face_to_roof_and_to_the_end_of_the_last_phalanx(grasped: Grasps) -> None:
    """Straight and tilted: rectangles of 21.5 mm, from the face 0.75 mm inside the nodes on."""
    upper = shapely.union_all(drawn(grasped, 0)[:4])
    assert upper.area == pytest.approx(21.5 * 3.5 * 13.5)
    tilt = np.radians(10.0)
    along, up = np.array([np.cos(tilt), np.sin(tilt)]), np.array([-np.sin(tilt), np.cos(tilt)])
    foot = np.array([0.0, 20.0]) - 0.75 * up
    end = foot + 3.5 * 13.5 * along
    whole = shapely.polygons([foot, end, end + 21.5 * up, foot + 21.5 * up])
    assert shapely.hausdorff_distance(upper, whole) < 1e-9
    lower = shapely.union_all(drawn(grasped, 0)[4:])
    assert shapely.hausdorff_distance(shapely.transform(lower, lambda p: p * [1, -1]), whole) < 1e-9


def test_curled_fingers_have_the_faces_of_the_contact(grasped: Grasps) -> None:
    polygons = drawn(grasped, 1)
    for place, frame in enumerate(grasped.frames):
        face = frame.placed(grasped.fingers[place].face[..., 1])
        corners = [shapely.get_coordinates(p)[:2] for p in polygons[4 * place : 4 * place + 3]]
        np.testing.assert_allclose([c[0] for c in corners], face[:, :-1].T, atol=1e-12)
        np.testing.assert_allclose([c[1] for c in corners], face[:, 1:].T, atol=1e-12)
    assert shapely.is_valid(polygons).all()


def test_fingers_that_are_not_there_have_no_gap() -> None:
    """One lane of two is; the body comes no part of the way past the other."""
    around = np.concatenate((WALLS, np.full(WALLS.shape, None)), axis=1)
    begin, end = np.array([[90.0, 90.0], [0.0, 0.0]]), np.array([[40.0, 40.0], [0.0, 0.0]])
    for body in BODIES.values():
        both, alone = (clearance(a, body, b, e) for a, b, e in (
            (around, begin, end), (WALLS, begin[:, :1], end[:, :1]),
        ))  # fmt: skip
        assert both.gap[0] == alone.gap[0] and np.isnan(both.gap[1])
        assert both.share[0] == alone.share[0] and both.share[1] == 0.0
        assert both.is_clear.tolist() == [bool(alone.is_clear[0]), False]


def test_outlines_of_what_is_not_there_are_none() -> None:
    grasps = dpg.grasp("configs/gripper.yaml", object="disc:20", at=(40.0, 0.0), patterns="10000")
    own, frame = grasps.grasps.fingers[0], grasps.grasps.frames[0]
    nowhere = own.take_lanes(np.array([0, 0]))
    nowhere.face[..., 1] = np.nan
    height, length = np.array([10.75]), np.array([13.5])
    alone, both = (outlines(each, frame, height, length)[:, 0] for each in (own, nowhere))
    assert shapely.equals(alone, both).all()
    assert (outlines(nowhere, frame, height, length)[:, 1] == None).all()  # noqa: E711
