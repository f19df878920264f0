"""Stages of routines: many fingers at once, each with pulses of its own."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from dpgcli.actuation.pulses import Pulse, routes
from dpgcli.api.routine import planned
from dpgcli.design.bodies import Disc
from dpgcli.grasping.closing import driven
from dpgcli.grasping.plans import Prospect, releases, variants
from dpgcli.grasping.stages import beside, kept, pulsed, some
from dpgcli.grasping.table import grasp_rows

SPEC: dict[str, Any] = {
    "finger": {
        "units": 2,
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
    "gripper": {"base_spacing_mm": 34, "mounting_angle_deg": 0},
    "object": {"disc": {"diameter_mm": 26}, "at_mm": [20, 0]},
    "pressure": {"lines": {"A": "1", "B": "2"}},
}
UP = [Pulse(line, 0.2, 0.15, 0.3, 0, 0, is_open=False) for line in (0, 1)]
DOWN = [Pulse(line, -0.1, -0.07, -0.3, 0, 0, is_open=False) for line in (0, 1)]


@pytest.fixture(scope="module")
def known() -> Prospect:
    _, found = planned(SPEC, (90.0, 0.0), None, None, "", "", ())
    return found


def test_lanes_go_their_own_ways_as_if_they_were_alone(known: Prospect) -> None:
    task, sequences = known.task, [(UP[0],), (), (UP[1], UP[0]), (UP[0], DOWN[0])]
    codes = np.zeros(len(sequences), np.uint64)
    parts, near = pulsed(task, beside(task, codes), sequences, known.reach)
    rows = grasp_rows(kept(task, parts, task.centers(len(codes))))
    assert rows["pattern_after"].tolist() == ["10", "00", "11", "00"]
    assert np.isinf(near[1])
    for lane in (2, 3):
        pulses = sequences[lane]
        alone, size = pulsed(task, beside(task, codes[:1]), [pulses], known.reach)
        assert size[0] == pytest.approx(near[lane], rel=1e-6)
        own, other = parts[0].grown.shapes, alone[0].grown.shapes
        lanes = own.take_lanes(np.array([lane]))
        np.testing.assert_allclose(lanes.coordinates, other.coordinates, atol=1e-13)
        np.testing.assert_allclose(lanes.push, other.push, atol=1e-12)
    few = some(parts, np.array([2, 0]))
    assert few[0] is few[1]
    left = grasp_rows(kept(task, few, task.centers(2)))
    assert left["pattern_after"].tolist() == ["11", "10"]


@pytest.mark.slow
def test_a_body_off_the_axis_meets_each_finger_by_itself(known: Prospect) -> None:
    _, other = planned(SPEC, (90.0, 1.5), None, (20.0, 1.5), "", "", ())
    parts, _ = pulsed(
        other.task, beside(other.task, np.zeros(1, np.uint64)), [(UP[0],)], known.reach
    )
    assert parts[0] is not parts[1]
    found = kept(other.task, parts, other.task.centers(1))
    assert found.fingers[0].push.sum() > found.fingers[1].push.sum()
    assert other.coming.gap[0] == pytest.approx(17.0 - 0.75 - 13.0 - 1.5)
    assert known.coming.gap[0] == pytest.approx(17.0 - 0.75 - 13.0)


def test_the_next_threshold_counts_as_the_last_one_does(known: Prospect) -> None:
    """Free units snap at 0.1495 MPa: 0.14 is 0.0095 MPa before, 0.16 is 0.0105 MPa beyond."""
    task, limit = known.task, 0.2
    pulses = [(replace(UP[0], peak=peak),) for peak in (0.14, 0.16)]
    far = replace(task, scene=replace(task.scene, body=Disc(np.array([500.0, 0.0]), 1.0)))
    _, near = pulsed(far, beside(far, np.zeros(2, np.uint64)), pulses, limit)
    np.testing.assert_allclose(near * [0.14, 0.16], [0.0095, 0.0105], atol=1e-7)
    _, near = pulsed(far, beside(far, np.zeros(1, np.uint64)), pulses[:1], 0.149)
    assert near.tolist() == [np.inf]


def test_ways_in_parts_are_the_whole_way(known: Prospect) -> None:
    """Units that reset on the way from 0.1 to -0.1 MPa do so at the same share of it."""
    (part, _), volumes = beside(known.task, np.array([0b11], np.uint64)), known.task.pressed.volumes
    history = np.array([[[0.1], [0.1]], [[-0.1], [-0.1]]])
    start = replace(part.grown, resets=())
    whole = driven(part.own, start, volumes, history)
    there = driven(part.own, start, volumes, history[:1])
    back = driven(part.own, there, volumes, history[1:], history[0])
    assert 0 < len(back.resets) == len(whole.resets)
    for told, other in zip(back.resets, whole.resets, strict=True):
        assert told.load == pytest.approx(other.load, rel=1e-9)
        assert told.pressure == pytest.approx(0.1 - 0.2 * told.load * np.ones((2, 1)))
        assert other.pressure == pytest.approx(told.pressure)


def test_plans_of_few_pulses_come_first(known: Prospect) -> None:
    counts = [plan.n_pulses for plan in known.plans]
    assert set(counts) == {1, 2}
    assert counts == sorted(counts)
    assert [len(plans) for plans in known.rounds()] == [counts.count(n) for n in (1, 2)]
    for plan in known.plans:
        assert known.coming.is_clear[known.opened == plan.opened].all()


def test_pulses_let_go_from_every_state(known: Prospect) -> None:
    found = releases(known, [0b01, 0b11])
    assert found[0b11] == routes(known.graph, known.reach, 0b11)
    assert len(found[0b11][0b00]) == 2
    assert found[0b01][0b00][0].line == 1


def test_states_that_rest_does_not_lead_to_have_pulses_of_their_own() -> None:
    """One line inverts both units; a body may leave either."""
    _, known = planned({**SPEC, "pressure": {}}, (90.0, 0.0), None, None, "", "", ())
    assert sorted(known.graph.code.tolist()) == [0b00, 0b11]
    found = releases(known, [0b01, 0b10, 0b11])
    assert set(found[0b01]) == {0b01, 0b11, 0b00}
    assert set(found[0b10]) == {0b10, 0b11, 0b00}
    assert set(found[0b11]) == {0b11, 0b00}


def test_peaks_that_nothing_bounds_are_tried_higher() -> None:
    bound, free = UP[0], Pulse(0, -0.11, -0.1, -0.3, 0, 0, is_open=True)
    assert [*variants((bound,), 0.3)] == [(bound,)]
    (same, higher) = variants((bound, free), 0.3)
    assert same == (bound, free)
    assert [pulse.peak for pulse in higher] == [bound.peak, pytest.approx(-0.2)]
