"""Chambers that pushes open: their mesh, patches and read-outs, the deck and its springs."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from dpgcli.arrays import Array
from dpgcli.calibration.fe.bricks import Bricks
from dpgcli.calibration.fe.curves import UnitCurve, unit_curve, unit_finding, unit_stiffness
from dpgcli.calibration.fe.hinge import HingeChambers, end_couple, moment
from dpgcli.calibration.fe.models import PUSHED_CELLS, Model, unit_model
from dpgcli.calibration.fe.pushed import (
    End,
    Push,
    apex,
    floor_angle,
    lever,
    loaded,
    opening,
    patch,
    pushed_bricks,
)
from dpgcli.calibration.fe.pushed_deck import DeckStep
from dpgcli.errors import SolverError

REFERENCE = HingeChambers(9.0, 20.0, 0.75, 3.0, 1.5, 26.0)
PUSH = Push(stiffness=50.0, stroke=3.5, dome_height=6.5)
OTHERS = [
    replace(REFERENCE, width=16.0, layer_thickness=1.0),
    replace(REFERENCE, width=24.0, separation=4.5, lid_thickness=1.0),
]


@pytest.fixture
def mesh() -> Bricks:
    return pushed_bricks(REFERENCE, PUSHED_CELLS["medium"], 2)


@pytest.fixture
def model() -> Model:
    return unit_model(REFERENCE, PUSH, "coarse", 5.0)


def turned(mesh: Bricks, angle: float, pivot: tuple[float, float]) -> Array:
    """Displacements of a rigid turn, clockwise, of all beyond the gap's middle."""
    cos, sin = np.cos(angle), np.sin(angle)
    rest = mesh.nodes - [*pivot, 0.0]
    moved = rest @ np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    return np.where(mesh.nodes[:, :1] > 12.25, moved - rest, 0.0)


def cards(deck: str) -> list[tuple[str, list[str]]]:
    """Cards of a deck with their data lines, in order."""
    found: list[tuple[str, list[str]]] = []
    for line in deck.splitlines():
        if line.startswith("*") and not line.startswith("**"):
            found.append((line, []))
        elif not line.startswith("**"):
            found[-1][1].append(line)
    return found


@pytest.mark.parametrize("n_chambers", [2, 4])
@pytest.mark.parametrize("chambers", [REFERENCE, *OTHERS])
@pytest.mark.parametrize("fineness", ["coarse", "medium"])
def test_bricks_fill_the_chambers(chambers: HingeChambers, fineness: str, n_chambers: int) -> None:
    mesh = pushed_bricks(chambers, PUSHED_CELLS[fineness], n_chambers)
    corners = mesh.nodes[mesh.elements]
    sizes = np.ptp(corners, axis=1)
    width, length = chambers.width, n_chambers * chambers.pitch - chambers.separation
    layer = length * chambers.layer_thickness * (width / 2 + 1)
    hull = chambers.outer_length * (width + 1) * (width / 2 + 1)
    cavity = chambers.length * width * width / 2
    assert sizes.min() > 0
    assert sizes.prod(axis=1).sum() == pytest.approx(layer + n_chambers * (hull - cavity))
    assert set(mesh.elements.ravel()) == set(range(len(mesh.nodes)))
    shared = Counter(mesh.elements[:, :8].ravel().tolist())
    assert max(shared.values()) <= 8


def test_the_medium_mesh_is_that_of_the_given_finger() -> None:
    """13,440 coordinates of four chambers (data of the three-gap finger)."""
    mesh = pushed_bricks(REFERENCE, PUSHED_CELLS["medium"], 4)
    assert mesh.nodes.size == 13_440


def test_the_patch_is_what_lies_within_4_2_mm_of_the_axis(mesh: Bricks) -> None:
    at = mesh.nodes[patch(REFERENCE, mesh, 0).nodes]
    wall = mesh.nodes[mesh.nodes[:, 0] == 13.75]
    near = np.hypot(wall[:, 1] - 11.5, wall[:, 2]) <= 4.2
    assert len(at) == 14
    assert sorted(map(tuple, at)) == sorted(map(tuple, wall[near]))


@pytest.mark.parametrize("chambers", [REFERENCE, *OTHERS])
def test_patch_and_lid_grow_with_the_chamber(chambers: HingeChambers) -> None:
    for fineness, cells in PUSHED_CELLS.items():
        mesh = pushed_bricks(chambers, cells, 3)
        reference = pushed_bricks(REFERENCE, cells, 3)
        for gap in (0, 1):
            start, end = apex(chambers, mesh, PUSH, gap), patch(chambers, mesh, gap)
            lid = gap * chambers.pitch + chambers.outer_length
            disc = start.nodes[start.shifts > 0.0]
            assert mesh.nodes[disc, 0] == pytest.approx(lid)
            side = mesh.nodes[start.nodes[start.turns != 0.0]]
            assert side[:, 2] == pytest.approx(chambers.width / 2 + 1.0)
            assert side[:, 0].min() == pytest.approx(gap * chambers.pitch)
            assert side[:, 0].max() == pytest.approx(lid)
            assert mesh.nodes[end.nodes, 0] == pytest.approx(lid + chambers.separation)
            of_reference = apex(REFERENCE, reference, PUSH, gap), patch(REFERENCE, reference, gap)
            sizes = [len(found.nodes) for found in (start, end)]
            assert sizes == [len(found.nodes) for found in of_reference], fineness
            assert 0.33 < np.ptp(mesh.nodes[end.nodes, 1]) / chambers.width < 0.42
            assert 0.12 < np.ptp(mesh.nodes[end.nodes, 2]) / chambers.width < 0.21
            assert np.ptp(mesh.nodes[disc, 1]) == pytest.approx(chambers.width)


def test_a_spring_begins_at_the_apex_behind_the_lid() -> None:
    mesh = pushed_bricks(REFERENCE, PUSHED_CELLS["coarse"], 4)
    assert lever(REFERENCE) == 10.75
    assert apex(REFERENCE, mesh, PUSH, 0).place.tolist() == [4.25, 11.5, 0.0]
    assert patch(REFERENCE, mesh, 0).place.tolist() == [13.75, 11.5, 0.0]
    assert apex(REFERENCE, mesh, PUSH, 2).place.tolist() == [31.75, 11.5, 0.0]
    assert patch(REFERENCE, mesh, 2).place.tolist() == [41.25, 11.5, 0.0]


@pytest.mark.parametrize("angle", [-0.3, 0.0, 1.0, 3.0])
def test_an_apex_is_rigid_with_its_chamber_however_far_it_turns(mesh: Bricks, angle: float) -> None:
    cos, sin = np.cos(angle), np.sin(angle)
    turn = np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
    shift = np.array([3.0, -2.0, 0.0])
    moved = mesh.nodes @ turn + shift - mesh.nodes
    end = apex(REFERENCE, mesh, PUSH, 0)
    assert end.moved(moved) == pytest.approx((end.place @ turn + shift)[:2])
    assert end.moved(np.stack([moved, 0.0 * moved]))[1] == pytest.approx(end.place[:2])


def test_a_push_has_no_moment_about_what_it_acts_on(mesh: Bricks) -> None:
    """Forces on the nodes of an end, by its weights, have the moment of the force at the end."""
    for end in (apex(REFERENCE, mesh, PUSH, 0), patch(REFERENCE, mesh, 0)):
        force = np.array([0.9, -0.2])
        across = force[0] * end.shifts + force[1] * end.turns
        up = force[1] * end.shifts - force[0] * end.turns
        x, y = mesh.nodes[end.nodes, :2].T
        assert [across.sum(), up.sum()] == pytest.approx(force.tolist())
        expected = end.place[0] * force[1] - end.place[1] * force[0]
        assert (x * up - y * across).sum() == pytest.approx(expected)


@pytest.mark.parametrize("angle", [-0.1, 0.0, 0.2])
def test_a_rigid_turn_opens_the_gap(mesh: Bricks, angle: float) -> None:
    moved = turned(mesh, angle, (12.25, 0.75))
    patch = np.array([1.5, 10.75]) @ [
        [np.cos(angle), -np.sin(angle)],
        [np.sin(angle), np.cos(angle)],
    ]
    length = np.hypot(12.25 + patch[0] - 4.25, 0.75 + patch[1] - 11.5)
    found = opening(REFERENCE, mesh, PUSH, moved, 0)
    assert found == pytest.approx(length - 9.5, abs=1e-12)
    assert floor_angle(REFERENCE, mesh, moved, 0) == 0.0
    assert floor_angle(REFERENCE, mesh, moved, 1) == pytest.approx(-angle, abs=1e-12)
    both = np.stack([moved, 0.0 * moved])
    assert opening(REFERENCE, mesh, PUSH, both, 0) == pytest.approx([float(found), 0.0])


def test_openings_are_those_of_one_gap() -> None:
    mesh = pushed_bricks(REFERENCE, PUSHED_CELLS["coarse"], 3)
    moved = np.zeros_like(mesh.nodes)
    moved[mesh.nodes[:, 0] > 27.0, 0] = 2.0
    assert opening(REFERENCE, mesh, PUSH, moved, 0) == 0.0
    assert opening(REFERENCE, mesh, PUSH, moved, 1) == pytest.approx(2.0)


def test_the_end_couple_acts_on_the_last_face(mesh: Bricks) -> None:
    forces = end_couple(mesh, loaded(mesh))
    assert forces.sum() == pytest.approx(0.0, abs=1e-12)
    assert moment(mesh, forces, np.zeros_like(mesh.nodes)) == pytest.approx(1.0)
    assert mesh.nodes[np.flatnonzero(forces), 0] == pytest.approx(24.5)
    assert moment(mesh, forces, turned(mesh, 0.3, (12.25, 0.75))) == pytest.approx(np.cos(0.3))
    heights = mesh.nodes[:, 1]
    assert forces[heights > 20.0].sum() > 0.0, "a positive one opens the gap"


def test_equations_of_the_deck_move_the_ends(model: Model) -> None:
    """With displacements at random: the deck's equations hold for `End.moved`."""
    coarse = pushed_bricks(REFERENCE, PUSHED_CELLS["coarse"], 2)
    moved = np.random.default_rng(5).normal(size=coarse.nodes.shape)
    equations = [lines for card, lines in cards(model.deck) if card == "*EQUATION"]
    ends: list[End] = [apex(REFERENCE, coarse, PUSH, 0), patch(REFERENCE, coarse, 0)]
    expected = [(end.moved(moved) - end.place[:2])[axis] for end in ends for axis in (0, 1)]
    assert len(equations) == len(expected)
    for lines, value in zip(equations, expected, strict=True):
        (count,), (node, _, minus), *terms = map(_cells, lines)
        assert [int(node) > model.n_nodes, minus] == [True, "-1"]
        assert int(count) == len(terms) + 1
        found = sum(float(w) * moved[int(n) - 1, int(axis) - 1] for n, axis, w in terms)
        assert found == pytest.approx(value)


def test_the_spring_of_half_a_model_is_half_as_stiff(model: Model) -> None:
    (lines,) = (lines for card, lines in cards(model.deck) if card.startswith("*SPRING"))
    table = np.array([[float(cell) for cell in line.split(",")] for line in lines])
    assert all("." in cell for line in lines for cell in line.split(","))
    force, elongation, temperature = table.T
    assert temperature.tolist() == [0.0, 0.0, 0.02, 0.02, 1.0, 1.0]
    for at, stiffness, stroke in ((0.0, 0.0, 0.0), (0.02, 25.0, 0.0), (1.0, 25.0, 3.5)):
        rows = temperature == at
        assert force[rows] == pytest.approx(stiffness * (elongation[rows] - stroke))
    assert elongation.min() == -9.5
    assert elongation.max() > 20.0


def test_steps_of_the_deck(model: Model) -> None:
    """Ground, then inverted; every step says its temperatures and all its forces."""
    heights = {
        int(line.split(", ")[0]): float(line.split(", ")[2])
        for card, lines in cards(model.deck) if card == "*NODE, NSET=ALL" for line in lines
    }  # fmt: skip
    found = cards(model.deck)
    temperatures = [lines for card, lines in found if card == "*TEMPERATURE"]
    assert temperatures == 4 * [["GAP1, 0"]] + 5 * [["GAP1, 1"]]
    increments = [lines[0].split(",")[0] for card, lines in found if card == "*STATIC"]
    assert increments == ["1"] * 4 + ["0.25"] + ["1"] * 4, "in small steps where the gap opens"
    loads = [lines for card, lines in found if card == "*CLOAD"]
    couples = [
        2 * sum(heights[int(node)] * float(force) for node, _, force in map(_cells, lines))
        for lines in loads
    ]
    assert couples == pytest.approx([2.5, 5, -2.5, -5, 0, 2.5, 5, -2.5, -5], abs=1e-9)
    assert model.end == len(loads) == 9


def _cells(line: str) -> list[str]:
    return line.split(", ")


def test_ends_of_springs_stay_in_the_plane_of_symmetry(model: Model) -> None:
    found = cards(model.deck)
    held = [line for card, lines in found if card == "*BOUNDARY" for line in lines]
    assert held == ["FIXED, 1, 3", "SYMMETRY, 3, 3", "ENDS, 3, 3"]


def test_what_the_model_says_of_itself(model: Model) -> None:
    said = "\n".join(model.comments("2.20", "So it is."))
    for words in (
        "dpg fe unit: a simulation",
        "gap 3 mm, layer 1.5 mm",
        "a spring of 50 N/mm and 9.5 mm, 3.5 mm too long",
        "up to 5 N mm; positive moments open the gap",
        "Mesh coarse: 148 elements C3D20R",
        "SHA-256",
    ):
        assert words in said


def test_the_curve_of_a_unit_that_moves_as_told(mesh: Bricks) -> None:
    steps = (DeckStep((False,), 2.5), DeckStep((True,), 0.0), DeckStep((True,), -2.5))
    angles = (0.1, 0.3, 0.25)
    moved = np.stack([turned(mesh, angle, (12.25, 0.75)) for angle in angles])
    curve = unit_curve(REFERENCE, mesh, PUSH, steps, moved)
    assert curve._fields == (
        "unit", "moment_N_mm", "chamber1_angle_rad", "chamber2_angle_rad", "opening_mm", "push_N"
    )  # fmt: skip
    assert curve.unit.tolist() == ["ground", "ground", "inverted", "inverted"]
    assert curve.moment_N_mm.tolist() == [0.0, 2.5, 0.0, -2.5]
    assert curve.chamber1_angle_rad == pytest.approx(np.zeros(4))
    assert curve.chamber2_angle_rad == pytest.approx([0.0, -0.1, -0.3, -0.25])
    opened = opening(REFERENCE, mesh, PUSH, moved, 0)
    assert curve.opening_mm == pytest.approx([0.0, *opened])
    assert curve.push_N == pytest.approx([0.0, 0.0, *(50 * (3.5 - opened[1:]))])


def table(hinge: float, walls: float) -> UnitCurve:
    """A unit of one hinge and walls whose moments are as they are in the turned state."""
    turns = np.array([0.0, 0.15, -0.15, 0.26])
    push = hinge * 0.26 / 10.75
    opened = 2 * 10.75 * np.sin(0.13) + walls * push
    moments = np.array([0.0, *(hinge * turns[1:3] / np.cos(turns[1:3] + 0.01)), 0.0])
    return UnitCurve(
        unit=np.array(["ground", "ground", "ground", "inverted"]),
        moment_N_mm=moments,
        chamber1_angle_rad=np.full(4, -0.01),
        chamber2_angle_rad=-turns - 0.01,
        opening_mm=np.array([0.0, 1.6, -1.6, opened]),
        push_N=np.array([0.0, 0.0, 0.0, push]),
    )


def test_hinge_and_walls_of_a_unit_come_back() -> None:
    found = unit_stiffness(table(33.0, 0.7), 10.75)
    assert found.by_push == pytest.approx(33.0)
    assert found.ground == pytest.approx(33.0)
    assert found.walls == pytest.approx(0.7)
    assert found.rotation == pytest.approx(0.26)
    said = unit_finding(REFERENCE, table(33.0, 0.7))
    assert said.endswith("k_theta 33 N mm/rad (ground: 33), c_w 0.7 mm/N.")


def test_moments_that_are_too_large_are_said() -> None:
    curve = table(33.0, 0.7)
    narrow = replace(REFERENCE, separation=1.6)
    assert unit_finding(narrow, curve).endswith(
        " A moment closes the gap, where the chambers would touch: take smaller ones."
    )
    pulled = curve._replace(push_N=np.array([0.0, -0.1, 0.0, curve.push_N[3]]))
    assert "the push becomes a pull" in unit_finding(REFERENCE, pulled)
    assert "touch and one opens" in unit_finding(narrow, pulled)


@pytest.mark.parametrize("turn", ["moment_N_mm", "chamber2_angle_rad", "push_N"])
def test_a_unit_that_does_not_open_is_no_result(turn: str) -> None:
    curve = table(33.0, 0.7)
    other = curve._replace(**{turn: -getattr(curve, turn)})
    with pytest.raises(SolverError, match="should open the gap"):
        unit_stiffness(other, 10.75)


def test_a_run_that_left_out_a_state_is_no_result(model: Model) -> None:
    with pytest.raises(SolverError, match="ccx wrote 8 states of 9"):
        model.outcome(np.arange(2.0, 10.0), np.zeros((8, model.n_nodes, 3)))
