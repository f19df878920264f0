"""Searches at a workplace: the same bytes for any number of processes, and where they go on."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dpgcli as dpg
from dpgcli.api.given import goal_input
from dpgcli.errors import NothingSelectedError, UsageError, WorkplaceError
from dpgcli.search import search as module
from dpgcli.search.part import Clock, Found, Part, searched_part
from dpgcli.search.search import Limits, Task, search
from dpgcli.studies.search import SearchStudy, StoredTask, packed, unpacked
from dpgcli.sweeps.executors import Backend, Result, Runner, serial
from dpgcli.sweeps.maker import HERE

STROKE = "finger.lattice.stroke_mm"
LATTICE = {
    "segment_length_mm": 13.5,
    "segment_height_mm": 10.75,
    "stroke_mm": 3.5,
    "bistable_stiffness_N_per_mm": 12.84,
    "force_linearity": 0.043,
    "hinge_stiffness_N_mm_per_rad": 24.2,
}
FINGER = {"units": 2, "linear_stiffness_N_per_mm": 1.0e4, "lattice": LATTICE}
Make = Callable[..., dict[str, Any]]


@pytest.fixture
def goal(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Three choices, hence three parts, of a few starts."""
    monkeypatch.setattr(module, "STARTS", 4)
    target = {"pattern": "11*", "quantity": "tip_y_mm", "value": -9.0, "tolerance_mm": 0.1}
    vary = {"finger.units": [2, 3, 4], STROKE: {"from": 2.5, "to": 4.5}}
    return {"base": {"finger": FINGER}, "vary": vary, "targets": [target]}


def files(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


class StoppedError(Exception):
    """As Ctrl-C."""


@pytest.fixture
def stopped(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[int]]:
    """Have a run stop after two parts; the numbers of the parts that are done."""
    done: list[int] = []
    run = Runner.run

    def stopping(self: Any, chunks: Any) -> Iterator[Result[Any]]:
        for result in run(self, chunks):
            yield result
            done.append(result.chunk.start)
            if len(done) == 2:
                raise StoppedError

    monkeypatch.setattr(Runner, "run", stopping)
    yield done


def test_an_interrupted_search_goes_on_to_the_same_bytes(
    goal: dict[str, Any], stopped: list[int], tmp_path: Path
) -> None:
    with pytest.raises(StoppedError):
        dpg.inverse_design(goal, tmp_path / "out")
    assert not (tmp_path / "out" / "best.parquet").exists()
    with pytest.raises(
        UsageError, match="holds an unfinished search that differs in seed: finish it as"
    ):
        dpg.inverse_design(goal, tmp_path / "out", seed=2)
    dpg.inverse_design(goal, tmp_path / "out")
    assert sorted(stopped) == [0, 1, 2]  # two were there
    assert not (tmp_path / "out" / ".parts").exists()
    stopped += [9]
    dpg.inverse_design(goal, tmp_path / "whole")
    assert files(tmp_path / "out") == files(tmp_path / "whole")


def test_a_search_is_no_sweep(goal: dict[str, Any], stopped: list[int], tmp_path: Path) -> None:
    """What is unfinished in a folder is told apart, whoever comes upon it."""
    search, sweep, whole = (tmp_path / name for name in ("search", "sweep", "whole"))
    axis = {"key": STROKE, "values": [2.5, 3.0]}
    given: Any = {"base": goal["base"], "space": [axis]}
    with pytest.raises(StoppedError):
        dpg.inverse_design(goal, search)
    for shards in ([search], [search, search]):
        with pytest.raises(UsageError, match="search holds an unfinished search, no shard of a "):
            dpg.merge(shards, whole)
    with pytest.raises(UsageError, match="search holds an unfinished search: finish it as it was"):
        dpg.sweep(given, search, executor="serial")
    dpg.sweep(given, sweep, executor="serial", shard="1/2")
    with pytest.raises(UsageError, match="sweep holds an unfinished sweep: finish it as it was"):
        dpg.inverse_design(goal, sweep)
    with pytest.raises(UsageError, match="search holds an unfinished search, no shard of a sweep"):
        dpg.merge([sweep, search], whole)
    stopped += [9]
    dpg.inverse_design(goal, search)  # as it was
    assert (search / "best.parquet").exists()


def test_restart_and_damage(goal: dict[str, Any], stopped: list[int], tmp_path: Path) -> None:
    with pytest.raises(StoppedError):
        dpg.inverse_design(goal, tmp_path)
    (part,) = tmp_path.glob(f".parts/*/{stopped[0]:010d}-*.part")
    part.write_bytes(part.read_bytes()[:-9])
    dpg.inverse_design(goal, tmp_path)
    assert sorted(stopped[2:]) == sorted([stopped[0], 2])  # the damaged one again
    stopped[:] = []
    with pytest.raises(StoppedError):
        dpg.inverse_design(goal, tmp_path, seed=2)
    stopped += [9]
    dpg.inverse_design(goal, tmp_path, restart=True)
    assert sorted(stopped[3:]) == [0, 1, 2]
    assert not (tmp_path / ".parts").exists()


@pytest.mark.parametrize("more", [{}, pytest.param({"evaluations": 150}, marks=pytest.mark.slow)])
def test_any_number_of_processes_gives_the_same_bytes(
    goal: dict[str, Any], more: dict[str, Any], tmp_path: Path
) -> None:
    """Two processes have their own STARTS: what parts are is decided here."""
    dpg.inverse_design(goal, tmp_path / "one", **more)
    dpg.inverse_design(goal, tmp_path / "two", jobs=2, **more)
    found = dpg.inverse_design(goal, **more)
    found.save(tmp_path / "alone")
    assert files(tmp_path / "one") == files(tmp_path / "two") == files(tmp_path / "alone")


def test_parts_are_what_they_were_after_the_disk(goal: dict[str, Any]) -> None:
    made = goal_input({**goal, "constraints": ["n_stable >= 4"]}).goal
    part = Part(0, 0, {"finger.units": np.array([2, 3])}, None, 3, None)
    found = searched_part(made, 1, part, Clock())
    again = unpacked(packed(found))
    assert packed(again) == packed(found)
    assert again.trace.keys() == found.trace.keys()
    assert (again.n_starts, again.n_empty) == (6, found.n_empty)
    for name in ("points", "codes", "hold", "objectives", "are_finished"):
        assert np.array_equal(getattr(again.designs, name), getattr(found.designs, name))


def test_a_part_that_kills_its_workers_is_told(
    goal: dict[str, Any], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def killed(self: Any, chunks: Any) -> Iterator[Result[Any]]:
        yield from (Result(chunk, None) for chunk in chunks)

    monkeypatch.setattr(Runner, "run", killed)
    with pytest.raises(WorkplaceError, match="part 0 of the search killed its worker, twice"):
        dpg.inverse_design(goal, tmp_path)


def test_workers_without_a_common_disk_send_what_they_find(
    goal: dict[str, Any], tmp_path: Path
) -> None:
    """As Dask's do."""
    given = goal_input(goal)
    remote = serial().__class__("elsewhere", serial().make, 1, is_local=False)
    study = SearchStudy(given, 1, Limits(), remote, tmp_path)
    study.begin()
    found, alone = search(given.goal, 1, run=study.run), search(given.goal, 1)
    assert np.array_equal(found.best.points, alone.best.points)
    assert len(study.store.parts()) == 3


def test_a_budget_keeps_nothing_and_parts_that_are_late_are_left_out(
    goal: dict[str, Any], tmp_path: Path
) -> None:
    found = dpg.inverse_design(goal, tmp_path, budget=1e-9)
    assert found.searched.n_starts == 4  # of the first part alone
    assert found.searched.is_stopped
    assert "finished" in found.table.names
    assert not (tmp_path / ".parts").exists()


def test_limits_go_on_with_other_starts_and_are_shared(goal: dict[str, Any]) -> None:
    made = goal_input(goal).goal
    asked: list[Sequence[Part]] = []

    def run(task: Task, parts: Sequence[Part]) -> Iterator[Found | None]:
        asked.append(parts)
        yield from map(task, parts)

    search(made, 1, Limits(evaluations=240), run)
    assert len(asked) > 1
    numbers = [part.number for parts in asked for part in parts]
    assert numbers == [*range(len(numbers))]
    assert [part.stream for parts in asked for part in parts] == numbers
    assert {part.evaluations for part in asked[0]} == {80}
    assert asked[1][0].evaluations is not None and asked[1][0].evaluations < 80


def test_what_nobody_can_go_on_with_is_not_kept(goal: dict[str, Any], tmp_path: Path) -> None:
    """Where no start is a finger, another goal may go into the folder."""
    hinge = {"finger.lattice.hinge_stiffness_N_mm_per_rad": {"from": 1000.0, "to": 2000.0}}
    with pytest.raises(NothingSelectedError):
        dpg.inverse_design({**goal, "vary": hinge}, tmp_path / "out")
    assert not (tmp_path / "out").exists()
    assert dpg.inverse_design(goal, tmp_path / "out").specs


def test_workers_of_another_code_are_told_of_the_search(
    goal: dict[str, Any], tmp_path: Path
) -> None:
    other = HERE._replace(code="f" * 64)
    mixed = Backend("the cluster", lambda _: pytest.fail("used"), 2, ask=lambda _: {"a": other})
    study = SearchStudy(goal_input(goal), 1, Limits(None, None), mixed, tmp_path)
    with pytest.raises(WorkplaceError, match=r"worker a .* but this search is of"):
        study.begin()
    with pytest.raises(WorkplaceError, match=r"a worker .* but this search is of"):
        StoredTask(lambda _: pytest.fail("done"), None)(None, other)  # type: ignore[arg-type]
