"""Decks as text, and curves from made-up displacements."""

from dataclasses import replace

import numpy as np
import pytest

from dpgcli.arrays import Array
from dpgcli.calibration.fe.curves import csv_text
from dpgcli.calibration.fe.decks import pulse
from dpgcli.calibration.fe.dome import DomeShape, dome_mesh
from dpgcli.calibration.fe.hinge import HingeChambers, chamber_bricks
from dpgcli.calibration.fe.models import (
    CHAMBER_CELLS,
    DOME_CELLS,
    Model,
    dome_model,
    expected_peak,
    hinge_model,
    unit_model,
)
from dpgcli.calibration.fe.pushed import Push
from dpgcli.errors import SolverError

DOME = DomeShape(height=6.5, thickness=0.75, elastic_modulus=26.0)
CHAMBERS = HingeChambers(9.0, 20.0, 0.75, 3.0, 1.5, 26.0)


PUSH = Push(stiffness=50.0, stroke=3.5, dome_height=6.5)


def made(name: str) -> Model:
    if name == "dome":
        return dome_model(DOME, "coarse", 0.2)
    if name == "hinge":
        return hinge_model(CHAMBERS, "coarse", 5.0)
    return unit_model(CHAMBERS, PUSH, "coarse", 5.0)


@pytest.fixture(params=["dome", "hinge", "unit"])
def model(request: pytest.FixtureRequest) -> Model:
    return made(request.param)


def cards(deck: str) -> dict[str, list[str]]:
    """Data lines by the first line of each card; of steps the last one's."""
    found: dict[str, list[str]] = {}
    for line in deck.splitlines():
        if line.startswith("*") and not line.startswith("**"):
            found[line] = current = []
        elif not line.startswith("**"):
            current.append(line)
    return found


def test_a_deck_is_made_of_short_lines_that_people_can_read(model: Model) -> None:
    lines = model.deck.splitlines()
    assert lines[0].startswith("** ")
    assert any(line == "** Units: mm, N, MPa, s; mass in t." for line in lines)
    assert model.deck.isascii()
    for line in lines:
        assert len(line) <= 132, "CalculiX reads no further"
        assert line.startswith("**") or len(line.split(",")) <= 16


def test_a_deck_numbers_every_node_once(model: Model) -> None:
    data = cards(model.deck)
    numbers = [int(line.split(",")[0]) for line in data["*NODE, NSET=ALL"]]
    assert numbers == list(range(1, model.n_nodes + 1))


def test_the_same_input_gives_the_same_bytes(model: Model) -> None:
    again = made(model.name)
    assert again.deck == model.deck
    assert again.words == model.words


def test_the_material_of_the_dome() -> None:
    """C10 = G/2 and D1 = 2/K, with G = 26/2.96 and K = 26/0.12."""
    data = cards(dome_model(DOME, "coarse", 0.2).deck)
    c10, d1 = map(float, data["*HYPERELASTIC, NEO HOOKE"][0].split(","))
    assert c10 == pytest.approx(26 / 2.96 / 2)
    assert d1 == pytest.approx(2 * 0.12 / 26)


def test_the_pulse_goes_up_stays_and_goes_down() -> None:
    data = cards(dome_model(DOME, "coarse", 0.2).deck)
    points = [tuple(map(float, line.split(","))) for line in
              data["*AMPLITUDE, NAME=PULSE, TIME=TOTAL TIME"]]  # fmt: skip
    assert [pressure for _, pressure in points] == [0.0, 0.2, 0.2, 0.0]
    times = [time for time, _ in points]
    assert times == sorted(set(times))
    assert pulse(DOME, 0.2).pressure(np.array(times)).tolist() == [0.0, 0.2, 0.2, 0.0]
    assert dome_model(DOME, "coarse", 0.2).deck.count("*DYNAMIC, ALPHA=-0.3") == 3


def test_times_follow_the_vibrations_of_the_dome() -> None:
    """A dome twice as large is twice as slow, one of four times the modulus half as slow."""
    double = DomeShape(13.0, 1.5, 26.0, base_diameter=32.0, rim_radius=20.0)
    assert pulse(double, 0.2).period == pytest.approx(2 * pulse(DOME, 0.2).period)
    stiff = replace(DOME, elastic_modulus=104.0)
    assert pulse(stiff, 0.2).period == pytest.approx(pulse(DOME, 0.2).period / 2)


def test_the_peak_is_beyond_the_snap_of_every_dome_of_the_grid() -> None:
    """Limit pressures of finite elements made for this project: height, thickness, MPa."""
    grid = [
        *((4.5, 0.5, 0.0335334), (4.5, 0.75, 0.0959349), (4.5, 1.0, 0.201106)),
        *((5.5, 0.5, 0.0438137), (5.5, 1.0, 0.254197), (6.5, 0.5, 0.0546613)),
        *((6.5, 0.75, 0.149509), (7.5, 0.75, 0.17635), (7.5, 1.0, 0.357641)),
    ]
    for height, thickness, limit in grid:
        peak = expected_peak(DomeShape(height, thickness, 26.0))
        assert 1.15 < peak / limit < 1.35


def test_forces_of_the_hinge_are_half_a_couple() -> None:
    model = hinge_model(CHAMBERS, "medium", 5.0)
    data = cards(model.deck)
    heights = [float(line.split(",")[2]) for line in data["*NODE, NSET=ALL"]]
    loads = [line.split(",") for line in data["*CLOAD"]]
    force = {int(node): float(value) for node, _, value in loads}
    assert sum(force.values()) == pytest.approx(0.0, abs=1e-9)
    assert sum(f * heights[n - 1] for n, f in force.items()) == pytest.approx(2.5)


def test_the_curve_of_a_dome_that_moves_as_told() -> None:
    mesh = dome_mesh(DOME, *DOME_CELLS["coarse"])
    model = dome_model(DOME, "coarse", 0.2)
    ends = np.array(pulse(DOME, 0.2).corners)
    inverted = np.zeros((len(mesh.nodes), 3))
    inverted[:, 1] = -2 * (mesh.nodes[:, 1] - 0.375)
    curve, finding = model.outcome(ends, np.stack([0.1 * inverted, inverted, inverted]))
    assert curve.pole_travel_mm == pytest.approx([0.0, 1.225, 12.25, 12.25])
    assert curve.pressure_MPa == pytest.approx([0.0, 0.2, 0.2, 0.0], abs=1e-9)
    assert curve.energy_mJ[0] == curve.volume_mm3[0] == 0.0
    assert "snaps at 0.2 MPa" in finding
    assert "stays inverted at zero pressure: pole travel 12.25 mm" in finding
    back = np.stack([inverted, inverted, 0.0 * inverted])
    assert "returns as the pressure goes: it is not bistable" in model.outcome(ends, back).finding
    never = model.outcome(ends, 0.1 * back).finding
    assert never == "The dome does not snap up to 0.2 MPa."


def test_the_curve_of_a_hinge_that_turns_as_told() -> None:
    mesh = chamber_bricks(CHAMBERS, CHAMBER_CELLS["coarse"])
    model = hinge_model(CHAMBERS, "coarse", 5.0)
    shares = np.array([0.5, 1.0])
    curve, finding = model.outcome(shares, np.stack([_turned(mesh.nodes, a) for a in (0.1, 0.2)]))
    assert curve.rotation_rad == pytest.approx([0.0, 0.1, 0.2])
    assert curve.moment_N_mm == pytest.approx([0.0, 2.5 * np.cos(0.1), 5 * np.cos(0.2)])
    assert finding == "Moment over rotation at 0.2 rad: 24.5 N mm/rad."


def test_a_file_of_comments_names_and_rows() -> None:
    model = hinge_model(CHAMBERS, "coarse", 5.0)
    mesh = chamber_bricks(CHAMBERS, CHAMBER_CELLS["coarse"])
    outcome = model.outcome(np.array([1.0]), _turned(mesh.nodes, 0.25)[None])
    text = csv_text(model.comments("2.20", "It is so."), outcome.curve)
    comments = [line for line in text.splitlines() if line.startswith("# ")]
    assert comments[0] == "# dpg fe hinge: a simulation with finite elements, CalculiX 2.20"
    assert comments[-1] == "# It is so."
    assert text.splitlines()[len(comments) :] == [
        "moment_N_mm,rotation_rad",
        "0,0",
        f"{5 * np.cos(0.25):.10g},0.25",
    ]


def test_a_hinge_that_does_not_open_is_no_result() -> None:
    model = hinge_model(CHAMBERS, "coarse", 5.0)
    with pytest.raises(SolverError, match="should open the hinge"):
        model.outcome(np.array([1.0]), np.zeros((1, model.n_nodes, 3)))


def _turned(nodes: Array, angle: float) -> Array:
    cos, sin = np.cos(angle), np.sin(angle)
    rest = nodes - [12.25, 0.75, 0.0]
    moved = rest @ np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    return np.where(nodes[:, :1] > 12.25, moved - rest, 0.0)
