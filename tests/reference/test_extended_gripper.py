"""The reference for two fingers: against that for one, by symmetry, and what is deep in what."""

from dataclasses import replace

import numpy as np
import pytest

from dpgcli.arrays import Array, Flags
from dpgcli.mechanics.finger import STUDY, Finger, uniform_finger
from dpgcli.reference.bodies import RoundBody, StraightBody
from dpgcli.reference.contact import extended_contact
from dpgcli.reference.equilibria import extended_states
from dpgcli.reference.gripper import Grip, depth, extended_grip

LENGTH, HEIGHT, THICKNESS = STUDY["segment_length"], STUDY["segment_height"], 1.5
STRAIGHT = np.array([LENGTH, 0.0, LENGTH, HEIGHT])
STILL, BOTH = np.zeros(3), np.array([[True], [False]])


def unit() -> Finger:
    return uniform_finger(1, **STUDY, linear_stiffness=np.inf)


def turned(*corners: float) -> Array:
    """Nodes (4 n,) of rigid units by their corners a_1, b_1, a_2, …"""
    base, angle, nodes = np.zeros(2), 0.0, list[Array]()
    for a, b in zip(corners[::2], corners[1::2], strict=True):
        base = base + LENGTH * np.array([np.cos(angle + a), -np.sin(angle + a)])
        angle += a + b
        nodes += [base, base + HEIGHT * np.array([np.sin(angle), np.cos(angle)])]
    return np.concatenate(nodes)


def test_fingers_that_touch_nothing_are_those_by_themselves() -> None:
    nodes = np.stack((turned(0.15, 0.15), STRAIGHT))
    found = extended_grip(unit(), BOTH, Grip(100.0, THICKNESS), nodes, STILL)
    alone = extended_states(unit(), BOTH.T, nodes.T)
    assert found is not None and found.is_minimum and found.in_pattern
    assert np.abs(found.pose - alone.pose.T).max() < 1e-18
    assert [len(push) for push in found.push] == [0, 0, 0]


@pytest.mark.parametrize("side", [0, 1])
def test_a_body_at_one_finger_is_as_if_there_were_no_other(side: int) -> None:
    """In that finger's frame; the lower one's is mirrored."""
    own = np.array([9.0, -6.25])
    there = own + np.array([0.0, 50.0])
    center = (float(there[0]), float(there[1]) * (1 - 2 * side))
    grip = Grip(100.0, THICKNESS, RoundBody(center, 6.0, THICKNESS))
    pattern = BOTH if side == 0 else BOTH[::-1]
    bent = turned(0.05, 0.2)
    nodes = np.stack((bent, STRAIGHT) if side == 0 else (STRAIGHT, bent))
    found = extended_grip(unit(), pattern, grip, nodes, STILL)
    body = RoundBody((float(own[0]), float(own[1])), 6.0, THICKNESS)
    alone = extended_contact(unit(), np.array([True]), body, bent, np.zeros(1))
    assert found is not None and alone is not None
    assert len(found.push[side]) == 1 and abs(found.push[side] - alone.push).max() < 1e-18
    assert np.abs(found.pose[side] - alone.pose).max() < 1e-18


def met(pattern: Flags, nodes: Array, spacing: float, apart: float = 0.0) -> tuple[float, Array]:
    finger = uniform_finger(2, **STUDY, linear_stiffness=np.inf)
    found = extended_grip(finger, pattern, Grip(spacing, THICKNESS), nodes, STILL, apart=apart)
    assert found is not None and found.is_minimum and found.in_pattern
    return float(found.push[2][0]), found.pose[:, :2].astype(float)


def test_fingers_that_meet_change_places() -> None:
    """A tip on the other's side: pushes stay, tips change places; bases apart are a spacing."""
    nodes = np.stack((turned(0.15, 0.15, 0.15, 0.15), turned(0.0, 0.0, 0.0, 0.0)))
    pattern = np.array([[True, True], [False, False]])
    push, tips = met(pattern, nodes, 9.0)
    other, swapped = met(pattern[::-1], nodes[::-1], 9.0)
    further, _ = met(pattern, nodes, 8.5, apart=0.5)
    assert push > 0.01
    assert other == pytest.approx(push, rel=1e-14) and further == pytest.approx(push, rel=1e-14)
    assert swapped[::-1] == pytest.approx(tips, abs=1e-14)
    closer, _ = met(pattern, nodes, 8.75)
    assert closer > push


@pytest.mark.parametrize(("y", "deep"), [(0.0, 0.75), (0.5, 1.25), (-1.0, 1.75), (0.0, -1.0)])
def test_depths_are_those_of_straight_fingers(y: float, deep: float) -> None:
    """A block of 8 mm between faces that are 7.5 mm apart, or one of 4 mm that touches neither."""
    high = 8.0 if deep > 0.0 else 4.0
    corners = ((3.0, y - 0.5 * high), (9.0, y - 0.5 * high), (9.0, y + 0.5 * high))
    block = StraightBody((*corners, (3.0, y + 0.5 * high)), THICKNESS)
    nodes = np.stack((STRAIGHT, STRAIGHT))
    found = depth(unit(), Grip(9.0, THICKNESS, block), nodes, STILL)
    expected = max(0.0, 0.5 * high + abs(y) - 3.75) if deep > 0.0 else 0.0
    assert found == pytest.approx(expected, abs=1e-12)
    moved = np.array([0.0, -y, 0.0])
    again = depth(unit(), Grip(9.0, THICKNESS, block), nodes, moved)
    assert again == pytest.approx(max(0.0, 0.5 * high - 3.75), abs=1e-12)


def test_fingers_in_each_other_are_deep() -> None:
    nodes = np.stack((turned(0.1, 0.1), STRAIGHT))
    grip = Grip(1.5 + 0.2, THICKNESS)  # faces 0.2 mm from each other at the bases
    end = nodes[0, :2] + 0.5 * THICKNESS * np.array([-np.sin(0.2), -np.cos(0.2)])
    expected = -float(end[1]) - 0.5 * THICKNESS - 0.2
    apart = depth(unit(), grip, nodes, STILL, apart=expected - 0.3)
    assert apart == pytest.approx(0.3, abs=1e-12)


def test_a_body_turns_about_the_center_of_its_area() -> None:
    """A block that is turned by 90° is as high as it was wide."""
    block = StraightBody(((2.0, -2.0), (12.0, -2.0), (12.0, 2.0), (2.0, 2.0)), THICKNESS)
    grip, nodes = Grip(10.5, THICKNESS, block, 3), np.stack((STRAIGHT, STRAIGHT))
    assert depth(unit(), grip, nodes, STILL) == 0.0
    deep = depth(unit(), grip, nodes, np.array([0.0, 0.0, 0.5 * np.pi]))
    assert deep == pytest.approx(5.0 - 4.5, abs=1e-12)
    assert depth(unit(), replace(grip, body=None), nodes, STILL) == 0.0
