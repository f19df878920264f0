"""Work in blocks of lanes: the same rows, in memory that has a bound, and said before."""

import tracemalloc
from dataclasses import replace
from pathlib import Path
from time import process_time

import numpy as np
import pytest

import dpgcli as dpg
from dpgcli.api.grasp import check_work, pairs_of, work_of
from dpgcli.api.inputs import scene_input
from dpgcli.design.bodies import Disc, Jaws, Polygon
from dpgcli.design.scene import Gripper, Held, Scene
from dpgcli.errors import UsageError
from dpgcli.grasping import grasp
from dpgcli.grasping.approach import Way
from dpgcli.grasping.costs import Work, design_seconds, is_moving
from dpgcli.mechanics.finger import STUDY, uniform_finger

CONFIGS = Path(__file__).parents[2] / "configs"
GRIPPER = Gripper(base_spacing=30.0, mounting_angle=0.0)


def scene(n_units: int, held: Held = Held.FIXED) -> Scene:
    disc = Disc(np.array([32.0, 0.0]), 10.0)
    return Scene(uniform_finger(n_units, **STUDY), (), GRIPPER, 1.5, body=disc, held=held)


@pytest.mark.parametrize(
    ("held", "way", "both"),
    [
        (Held.FIXED, "place", True),
        pytest.param(Held.FIXED, "insert", False, marks=pytest.mark.slow),
        pytest.param(Held.FREE, "place", False, marks=pytest.mark.slow),
    ],
)
@pytest.mark.parametrize("size", [pytest.param(1, marks=pytest.mark.slow), 3])
def test_rows_are_the_same_in_blocks_of_any_size(
    monkeypatch: pytest.MonkeyPatch, held: Held, way: str, both: bool, size: int
) -> None:
    def rows() -> dict[str, np.ndarray[tuple[int], np.dtype[np.generic]]]:
        body = {"object": "disc:20", "at": (32.0, 1.0)}
        return dpg.grasp(scene(3, held), **body, approach=way, both=both).rows  # type: ignore

    expected = rows()
    monkeypatch.setattr(grasp, "BLOCK", size * grasp.LANE * 9)
    found = rows()
    assert held is Held.FREE or any(expected["resets"] != "")
    for name, values in expected.items():
        assert found[name].tobytes() == values.tobytes(), name
        assert found[name].dtype == values.dtype


@pytest.mark.slow
def test_memory_is_that_of_a_block(monkeypatch: pytest.MonkeyPatch) -> None:
    def peak() -> int:
        tracemalloc.start()
        len(dpg.grasp(scene(6), object="disc:20", at=(32.0, 0.0), patterns=["*"]).rows)
        most = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return most

    peak()  # with what is imported
    whole = peak()
    monkeypatch.setattr(grasp, "BLOCK", 8 * grasp.LANE * 36)
    assert peak() < 0.5 * whole
    assert 0.3 < whole / (64 * grasp.LANE * 36) < 3.0


def test_memory_has_a_bound_whatever_the_number_of_units() -> None:
    for n_units in (14, 26, 64):
        assert Work(2**14, 2**14, n_units, 1, is_moving=False).peak_bytes < 2**29 + 2**28
    assert [*grasp.blocks(0, 5)] == [slice(0, 0)]
    assert sum(b.stop - b.start for b in grasp.blocks(2**14, 26)) == 2**14
    assert max(b.stop - b.start for b in grasp.blocks(2**14, 26)) * grasp.LANE * 26**2 < grasp.BLOCK


def test_grasps_that_take_too_much_are_refused_with_the_number() -> None:
    moving = scene(10, Held.FREE)
    pairs = pairs_of(["*"], moving, both=True)
    with pytest.raises(UsageError, match=r"^1,048,576 grasps of 10 units take about .* GiB of mem"):
        check_work(work_of(moving, pairs))
    with pytest.raises(UsageError, match=r"^1,048,576 grasps of 10 units take about \d"):
        dpg.grasp(scene(10), object="disc:20", at=(32.0, 0.0), both=True)


def test_work_counts_states_once_and_rows_of_bodies_that_move() -> None:
    pairs = pairs_of(["00*"], scene(5), both=True)
    fixed, moving = work_of(scene(5), pairs), work_of(scene(5, Held.FREE), pairs)
    assert (fixed.n_states, fixed.n_rows) == (16, 64)
    assert (fixed.n_pairs, moving.n_pairs) == (4, 0), "fingers of bodies that move pass each other"
    assert moving.seconds > 3.0 * replace(fixed, n_pairs=0).seconds
    assert work_of(scene(5), pairs, Way.INSERT).seconds > fixed.seconds


def test_work_knows_bodies_and_laws() -> None:
    """Estimates from measured times: corners take longer than a disc, curves longer than both."""
    disc, pairs = scene(8), pairs_of(["*"], scene(8), both=False)
    center = np.array([40.0, 0.0])
    jaws = replace(disc, body=Jaws(center, 20.0, 40.0))
    soft = replace(disc, body=Jaws(center, 20.0, 40.0, 1.0))
    wedge = replace(disc, body=Polygon(center, np.array([[0.0, 9.0, 9.0], [0.0, -9.0, 9.0]])))
    times = [work_of(own, pairs).seconds for own in (disc, jaws, wedge, soft)]
    assert times == sorted(times) and times[-1] > 10.0 * times[0]
    assert not is_moving(jaws) and is_moving(soft)
    let_go = replace(disc, held=Held.FREE)
    assert design_seconds(soft) > 5.0 * design_seconds(let_go), "36 s beside 5 s"
    curved = scene_input(CONFIGS / "gripper_and_can.yaml").scene
    published = scene_input(
        CONFIGS / "gripper_and_can.yaml", ["finger.calibration=published"]
    ).scene
    assert design_seconds(curved) == 10.0 * design_seconds(published)
    beside = replace(disc, body=Disc(np.array([32.0, 1.0]), 10.0))
    assert design_seconds(beside) == 2.0 * design_seconds(disc)


def test_too_many_pairs_are_refused_before_they_are_made() -> None:
    """Two to the 28 of them take gigabytes."""
    long = scene(14)
    for patterns, both in ((["*"], True), (["*/*"], False), (["0*/1*", "*/*"], False)):
        tracemalloc.start()
        with pytest.raises(UsageError, match="grasps: expected at most"):
            pairs_of(patterns, long, both)
        assert tracemalloc.get_traced_memory()[1] < 2**24
        tracemalloc.stop()


def test_each_pair_is_there_once() -> None:
    """In the order in which they come first, as states are."""
    own = scene(3)
    upper, lower = pairs_of(["11*/000", "001", "110/00*", "11*/000"], own, both=False)
    assert list(zip(upper.tolist(), lower.tolist(), strict=True)) == [
        (1, 1),
        (6, 0),
        (7, 0),
        (6, 1),
    ]


@pytest.mark.slow
@pytest.mark.parametrize(("n_units", "n_steps"), [(2, 600), (5, 300)])
def test_fingers_that_close_in_many_steps_take_what_was_said(n_units: int, n_steps: int) -> None:
    """Each step has its price, however few states and units there are."""
    pressures = 0.15 * np.minimum(np.linspace(0, 2, n_steps), np.linspace(2, 0, n_steps))
    gripper = CONFIGS / "gripper.yaml"
    settings = {"finger.units": n_units}
    start = process_time()
    dpg.grasp(
        gripper, object="disc:20", at=(35, 0), approach="close", pressure=pressures,
        settings=settings,
    )  # fmt: skip
    took = process_time() - start
    assert took / 3 < Work(2, 1, n_units, 2, False, Way.CLOSE, n_steps).seconds < 3 * took


def test_a_hundred_thousand_steps_take_long() -> None:
    """12 to 15 ms each: they were said to take a minute for two units."""
    assert 1200 < Work(2, 1, 2, 2, False, Way.CLOSE, 100_000).seconds < 2400
