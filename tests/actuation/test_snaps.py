"""What fingers become where a unit has lost its place: shapes that can be, ties that are said."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import dpgcli as dpg
from dpgcli.actuation import cascades, snaps
from dpgcli.actuation.directions import Directions, raised
from dpgcli.actuation.pressed import Halt, Pressed
from dpgcli.actuation.rest import at_rest
from dpgcli.actuation.staircase import driven
from dpgcli.actuation.travel import travel
from dpgcli.arrays import Array, Flags, Indices
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.pressure import DomeVolumes
from dpgcli.states.units import UnitSolutions

Study, Made = Callable[..., Finger], Callable[..., Pressed]
AREA = 4.7261788958 / 0.1495  # mm², of the study's springs


def test_no_way_leads_through_a_shape_that_crosses_itself(study: Study, pressed: Made) -> None:
    """All units at once: at rest 1^8 has room, under the pressure of the snap it has not."""
    finger = pressed(study(8).changed(stroke=np.array([[8.6]])))
    rest, settled = at_rest(finger, np.array([[False, True]]).repeat(8, axis=0))
    assert settled.status.tolist() == [0, 0], "both are states at rest"
    start = rest.take_lanes(np.array([0]))
    target = np.full((8, 1), 2.0)
    directions = Directions.of(np.zeros(1, int), np.zeros(1, np.uint64), 1)
    _, stairs, way = raised(finger, np.zeros(8, int), np.array([2.0]), directions)
    alone = travel(finger, start, target.T)
    assert (alone.reason, alone.events) == (Halt.FOLDED, ())
    assert alone.folded is not None and alone.folded.all(), "the shape beyond is what folds"
    assert driven(finger, start, target).reason.tolist() == [Halt.FOLDED]
    assert stairs == ()
    assert way.reason[0] == Halt.FOLDED


@pytest.mark.slow
def test_commands_agree_on_a_snap_that_folds() -> None:
    lattice = {
        "segment_length_mm": 13.5,
        "segment_height_mm": 10.75,
        "stroke_mm": 8.6,
        "bistable_stiffness_N_per_mm": 12.84,
        "force_linearity": 0.0286,
        "hinge_stiffness_N_mm_per_rad": 24.2,
    }
    finger = {"units": 8, "linear_stiffness_N_per_mm": 1e4, "lattice": lattice}
    spec = {"finger": finger, "pressure": {"effective_area_mm2": 30}}
    row = dpg.transitions(spec).to_pandas().query("pattern == '00000000' and direction == '+'")
    assert row["note"].str.startswith("folds onto itself").all()
    assert dpg.transitions(spec).reachable == ("00000000",)
    with pytest.raises(dpg.DpgError, match=r"snaps at .* to 11111111, which folds onto itself"):
        dpg.actuate(spec, pressure="0:2:0")


STIFFNESSES = [300.0, *(pytest.param(k, marks=pytest.mark.slow) for k in (5.0, 30.0, 1e4))]


class First(NamedTuple):
    """The first event of straight fingers as the pressure rises: a lane each."""

    inverted: Flags
    tied: Flags
    unit: Indices


def first_event(finger: Finger, area: Array) -> First:
    """Of fingers whose domes have these areas, mm², (unit, lane)."""
    n_units, n = area.shape
    pressed = Pressed(UnitSolutions.of(finger), DomeVolumes(area))
    rows = np.arange(n), np.zeros(n, np.uint64), np.zeros(n, int), np.ones(n, int)
    line_of, reach = np.zeros(n_units, int), np.full(n, 0.6)
    _, stairs, _ = raised(pressed, line_of, reach, Directions(*rows), 1)
    events = stairs[0].events
    assert len(stairs) == 1 and len(events.lanes) == n and events.is_fine.all()
    return First(events.after.inverted, events.halted.tied, events.halted.unit)


def near_ties(study: Study, linear_stiffness: float) -> tuple[Finger, Array]:
    """Three unequal units, and areas with which all snap at nearly the same pressure by itself."""
    random = np.random.default_rng(20)
    stroke = np.array([[3.5], [3.9], [3.3]])
    apart = random.choice([-1.0, 1.0], (3, 12)) * 10.0 ** random.uniform(-8.0, -1.5, (3, 12))
    finger = study(3, linear_stiffness).changed(stroke=stroke)
    return finger, AREA * stroke / 3.5 * (1.0 + apart)


@pytest.mark.parametrize("linear_stiffness", STIFFNESSES)
@pytest.mark.parametrize("share", [0.5, pytest.param(0.1, marks=pytest.mark.slow)])
def test_snaps_do_not_hang_on_steps_and_tolerances(
    study: Study, monkeypatch: pytest.MonkeyPatch, linear_stiffness: float, share: float
) -> None:
    finger, area = near_ties(study, linear_stiffness)
    usual = first_event(finger, area)
    own = snaps._downhill_step
    monkeypatch.setattr(snaps, "_downhill_step", lambda pressed: share * own(pressed))
    monkeypatch.setattr(cascades, "LARGEST_STEP", share * cascades.LARGEST_STEP)
    for module in (snaps, cascades):
        monkeypatch.setattr(module, "TOLERANCE", 0.5 * module.TOLERANCE)
    shorter = first_event(finger, area)
    is_tied = (usual.tied | shorter.tied).any(axis=0)
    assert (usual.inverted == shorter.inverted)[:, ~is_tied].all()
    assert (usual.unit == shorter.unit)[~is_tied].all()
    assert (usual.inverted.sum(axis=0) == 1).sum() > 1, "some go alone"


@pytest.mark.slow
def test_a_tie_is_where_a_millionth_of_the_pressure_decides(study: Study) -> None:
    """Unit 2 goes along with unit 1 from some area on: it is a tie there, and nowhere else."""
    finger = study(2, 30.0).changed(stroke=np.array([[3.5], [3.9]]))
    base = AREA * np.array([[1.0], [3.9 / 3.5]])

    def goes_along(more: Array) -> First:
        return first_event(finger, base * np.stack((np.ones(len(more)), 1.0 + more)))

    low, high = -0.002, 0.0
    for _ in range(3):
        places = np.linspace(low, high, 21)
        found = goes_along(places)
        assert (found.unit == 0).all() and found.inverted[0].all()
        assert not found.inverted[1, 0] and found.inverted[1, -1]
        place = int(found.inverted[1].argmax())
        low, high = places[place - 1], places[place]
    found = goes_along(high + 1e-6 * np.array([-4.0, -0.5, 0.5, 4.0]))
    assert found.inverted[1].tolist() == [False, False, True, True]
    assert found.tied.tolist() == [[False] * 4, [False, True, True, False]]


@pytest.mark.parametrize("linear_stiffness", STIFFNESSES)
def test_snaps_end_where_the_gradient_leads(study: Study, linear_stiffness: float) -> None:
    """Units with one snap pressure, against the flow x' = -dE/dx of all coordinates, by SciPy.

    Long Newton steps are no such flow: they take a second unit along.
    """
    stroke = np.array([[3.5], [3.9], [3.3]])
    finger = study(3, linear_stiffness).changed(stroke=stroke)
    area = AREA * stroke / 3.5
    pressed = Pressed(UnitSolutions.of(finger), DomeVolumes(area))
    rest, _ = at_rest(pressed, np.zeros((3, 1), bool))
    halted = pressed.followed(rest, np.full((3, 1), 0.6))
    there = pressed.with_domes(pressed.domes(halted.shapes.pressure))
    scale = pressed.coordinates.stiffness_scale[:, 0]

    def motion(_: float, coordinates: Array) -> Array:
        return np.asarray(-there.evaluate(coordinates[:, None]).gradient[:, 0] / scale)

    flow = solve_ivp(motion, (0.0, 3e4), halted.start[:, 0], method="LSODA", rtol=1e-7)
    is_open = pressed.extensions(flow.y[:, -1:]) > 0.5 * stroke
    assert first_event(finger, area).inverted.tolist() == is_open.tolist()
