"""Whole fingers of pushed chambers: the order of states, and the table read off."""

from itertools import pairwise, product

import numpy as np
import pytest

from dpgcli.calibration.fe.curves import csv_text
from dpgcli.calibration.fe.finger import finger_states, frame_words, in_gray_order, with_seconds
from dpgcli.calibration.fe.hinge import HingeChambers
from dpgcli.calibration.fe.models import PUSHED_CELLS, finger_model
from dpgcli.calibration.fe.pushed import Push, opening, pushed_bricks
from dpgcli.calibration.fe.pushed_deck import DeckStep
from dpgcli.errors import SolverError

CHAMBERS = HingeChambers(9.0, 20.0, 0.75, 3.0, 1.5, 26.0)
PUSH = Push(stiffness=50.0, stroke=3.5, dome_height=6.5)
ALL = list(product((False, True), repeat=3))


def test_one_gap_changes_from_state_to_state() -> None:
    ordered = in_gray_order(ALL)
    assert sorted(ordered) == ALL
    assert not any(ordered[0])
    for before, after in pairwise(ordered):
        assert sum(a != b for a, b in zip(before, after, strict=True)) == 1


def test_states_are_in_order_of_patterns_whatever_came_first() -> None:
    mesh = pushed_bricks(CHAMBERS, PUSHED_CELLS["coarse"], 3)
    moved = np.zeros((3, *mesh.nodes.shape))
    moved[0, mesh.nodes[:, 0] > 26.0, 0] = 3.4  # gap 2 opens
    moved[1, mesh.nodes[:, 0] > 12.0, 0] = 3.4  # gap 1
    moved[2] = moved[0]
    moved[2, mesh.nodes[:, 0] > 12.0, :2] += [3.3, -1.0]
    steps = [DeckStep((False, True)), DeckStep((True, False)), DeckStep((True, True))]
    states = finger_states(CHAMBERS, mesh, PUSH, [steps[1], steps[0], steps[2]], moved[[1, 0, 2]])
    assert list(states) == [
        "pattern", "tip_x_mm", "tip_y_mm", "chamber2_angle_rad", "chamber3_angle_rad",
        "opening1_mm", "opening2_mm", "push1_N", "push2_N",
    ]  # fmt: skip
    assert states["pattern"].tolist() == ["01", "10", "11"]
    assert states["tip_x_mm"] == pytest.approx([38.25 + 3.4, 38.25 + 3.4, 38.25 + 6.7])
    assert states["tip_y_mm"] == pytest.approx([0.0, 0.0, -1.0])
    first = float(opening(CHAMBERS, mesh, PUSH, moved[2], 0))
    assert states["opening1_mm"] == pytest.approx([0.0, 3.4, first])
    assert states["opening2_mm"] == pytest.approx([3.4, 0.0, 3.4])
    assert states["push1_N"] == pytest.approx([0.0, 5.0, 50 * (3.5 - first)])
    assert states["push2_N"] == pytest.approx([5.0, 0.0, 5.0])
    assert csv_text((), states).splitlines()[2].startswith("10,41.65,0,")


def test_the_deck_pushes_one_gap_after_the_other() -> None:
    model = finger_model(CHAMBERS, PUSH, "coarse", ALL)
    lines = model.deck.splitlines()
    steps = [i for i, line in enumerate(lines) if line == "*TEMPERATURE"]
    patterns = ["".join("01"[line.endswith(" 1")] for line in lines[i + 1 : i + 4]) for i in steps]
    assert patterns == ["001", "011", "010", "110", "111", "101", "100"]
    assert "*CLOAD" not in lines
    assert model.end == 7
    assert sum(line.startswith("*ELEMENT, TYPE=SPRINGA") for line in lines) == 3
    with pytest.raises(SolverError, match="ccx wrote 1 states of 7"):
        model.outcome(np.array([7.0]), np.zeros((1, model.n_nodes, 3)))


def test_every_gap_has_a_spring_of_its_own() -> None:
    model = finger_model(CHAMBERS, PUSH, "coarse", ALL)
    lines = model.deck.splitlines()
    starts = [i for i, line in enumerate(lines) if line.startswith("*ELEMENT, TYPE=SPRINGA")]
    springs = [[int(word) for word in lines[i + 1].split(", ")] for i in starts]
    nodes = [node for _, *ends in springs for node in ends]
    assert nodes == list(range(model.n_nodes + 1, model.n_nodes + 7))
    assert len({element for element, *_ in springs}) == 3
    sets = [lines[i + 3] for i in starts]
    assert sets == [f"{nodes[2 * gap]}, {nodes[2 * gap + 1]}" for gap in range(3)]


def test_each_state_takes_its_share_of_the_time() -> None:
    states = with_seconds({"pattern": np.array(["00", "01"])}, 9.0)
    assert states["seconds"].tolist() == [4.5, 4.5]


def test_the_finger_at_rest_needs_no_step() -> None:
    model = finger_model(CHAMBERS, PUSH, "coarse", ALL)
    states, finding = model.outcome(np.arange(1.0, 8.0), np.zeros((7, model.n_nodes, 3)))
    assert isinstance(states, dict)
    assert states["pattern"].tolist() == ["000", "001", "010", "011", "100", "101", "110", "111"]
    assert states["tip_x_mm"] == pytest.approx(52.0)
    assert states["push1_N"] == pytest.approx([0.0] * 4 + [175.0] * 4)
    assert finding == "8 states; tip of 111: 52, 0 mm."


def test_the_frame_is_said_as_the_data_do() -> None:
    said = ("first_station_mm: 5.375, 0.75", "tip_offset_mm: 5.375, -0.75")
    assert frame_words(CHAMBERS) == said
    words = finger_model(CHAMBERS, PUSH, "coarse", ALL).comments("2.20", "")
    assert {*said} < {*words}
