"""`transitions`: the study's graded finger, its graph as values and files, what is refused."""

import re
from dataclasses import replace
from pathlib import Path

import networkx as nx
import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

import dpgcli as dpg
from dpgcli.api.transitions import TransitionsResult
from dpgcli.errors import OutputError, SpecError, UsageError
from dpgcli.mechanics.finger import STUDY, uniform_finger

pytestmark = pytest.mark.slow

CONFIGS = Path(__file__).parents[2] / "configs"
GRADED = CONFIGS / "graded_five_unit.yaml"
FITTED = {"finger.calibration": "finite_elements", "finger.law": "push_only"}
LINES = {"pressure.lines": {"A": "1-2", "B": 3}}


@pytest.fixture(scope="module")
def graded() -> TransitionsResult:
    """One line on the study's graded finger."""
    return dpg.transitions(GRADED)


@pytest.fixture(scope="module")
def two_lines() -> TransitionsResult:
    """Two lines on three units."""
    return dpg.transitions(CONFIGS / "three_unit.yaml", settings=LINES)


def row(found: TransitionsResult, pattern: str, line: str, direction: str) -> dict[str, object]:
    frame = found.to_pandas()
    (which,) = np.flatnonzero(
        (frame["pattern"] == pattern) & (frame["line"] == line) & (frame["direction"] == direction)
    )
    return dict(frame.iloc[which])


def test_the_graded_finger_has_its_intermediate_state(graded: TransitionsResult) -> None:
    first, second = (row(graded, pattern, "A", "+") for pattern in ("00000", "11100"))
    assert first["pressure_MPa"] == pytest.approx(0.1495, rel=1e-4)
    assert (first["unit"], first["pattern_after"], first["tie"]) == ("1,2,3", "11100", "2,3")
    assert (second["unit"], second["pattern_after"], second["tie"]) == ("4,5", "11111", "5")
    assert second["pressure_MPa"] > 0.176
    assert graded.reachable == ("00000", "00011", "11100", "11111")
    assert len(graded.unreachable) == 28
    assert len(graded.table) == 64


def test_each_pressure_is_where_the_path_has_its_event(graded: TransitionsResult) -> None:
    """`actuate` finds it on the way, from the state and to the state."""
    for pattern, peak in (("00000", 0.16), ("01100", 0.16), ("11111", -0.07)):
        found = row(graded, pattern, "A", "+" if peak > 0.0 else "-")
        way = dpg.actuate(GRADED, pressure=f"0:{peak}:0", start=pattern)
        assert way.table["pressure_MPa"][0] == pytest.approx(found["pressure_MPa"], rel=1e-10)
        assert way.table["pattern_after"][0] == found["reached_at_pressure"]
        assert way.table["unit"][0] == found["unit"]
        assert way.table["tie"][0] == found["tie"]
        assert way.pattern == found["pattern_after"]


@pytest.mark.parametrize("law", ["tabulated", "push_only"])
def test_domes_with_a_curve_snap_at_their_own_pressure(law: str) -> None:
    """Finite elements' 0.1495 MPa at 6.5 mm; 0.176 at 7.5 mm, within the scaling's error."""
    settings = {**FITTED, "finger.law": law}
    found = dpg.transitions(GRADED, settings=settings)
    assert row(found, "00000", "A", "+")["pressure_MPa"] == pytest.approx(0.1495, rel=2e-3)
    assert row(found, "11100", "A", "+")["pressure_MPa"] == pytest.approx(0.176, rel=0.02)
    assert found.reachable == ("00000", "00011", "11100", "11111")


def test_a_spec_with_lines_has_rows_for_each(two_lines: TransitionsResult) -> None:
    table = two_lines.table
    assert len(table) == 8 * 2 * 2
    assert table["line"].tolist()[:4] == ["A", "A", "B", "B"]
    assert table["direction"].tolist()[:4] == ["+", "-", "+", "-"]
    assert two_lines.reachable == ("000", "001", "110", "111")


def test_the_summary_says_what_is_reached_and_what_pressures_rest_on(
    two_lines: TransitionsResult,
) -> None:
    said = "\n".join(two_lines.summary)
    assert "reachable from rest: 4 states: 000, 001, 110, 111" in said
    assert "not reachable from rest with these lines: 4 states: 010, 011, 100, 101" in said
    assert "from -0.299 to 0.299 MPa: 2 times the largest threshold of any unit alone" in said
    assert "pressures: assumed" in said


def test_a_long_list_is_cut(graded: TransitionsResult) -> None:
    (line,) = (line for line in graded.summary if line.startswith("not reachable"))
    assert line.endswith(" and 12 more")


def test_the_graph_has_what_is_known_of_states_and_edges(
    two_lines: TransitionsResult, tmp_path: Path
) -> None:
    two_lines.save_graph(tmp_path / "a.graphml")
    graph = nx.read_graphml(tmp_path / "a.graphml", force_multigraph=True)
    states = dpg.predict(CONFIGS / "three_unit.yaml").table
    assert list(graph.nodes) == states["pattern"].tolist()
    for place, (pattern, node) in enumerate(graph.nodes(data=True)):
        assert node["pattern"] == pattern
        assert node["energy_mJ"] == pytest.approx(states["energy_mJ"][place], abs=1e-9)
        assert node["tip_x_mm"] == pytest.approx(states["tip_x_mm"][place], abs=1e-9)
        assert node["reachable"] is (pattern in two_lines.reachable)
    leads = two_lines.to_pandas().query("pattern_after != ''")
    assert graph.number_of_edges() == len(leads) == 20
    names = re.findall(r'<edge [^>]*id="(\d+)"', (tmp_path / "a.graphml").read_text("utf-8"))
    assert names == [str(number) for number in range(20)], "other readers keep one edge an id"
    edge = next(data for data in graph["000"]["110"].values())
    assert (edge["line"], edge["direction"], edge["unit"]) == ("A", "+", "1,2")
    assert edge["pressure_MPa"] == row(two_lines, "000", "A", "+")["pressure_MPa"]
    reached = nx.descendants(graph, "000") | {"000"}
    assert reached == set(two_lines.reachable)


def test_files_are_the_same_bytes_twice(two_lines: TransitionsResult, tmp_path: Path) -> None:
    again = dpg.transitions(CONFIGS / "three_unit.yaml", settings=LINES)
    for k, found in enumerate((two_lines, again)):
        found.save(tmp_path / f"{k}.parquet")
        found.save_graph(tmp_path / f"{k}.graphml")
        found.draw(tmp_path / f"{k}.svg")
    for kind in ("parquet", "graphml", "svg"):
        one, other = ((tmp_path / f"{k}.{kind}").read_bytes() for k in range(2))
        assert one == other


def test_the_table_says_what_it_is_of(two_lines: TransitionsResult, tmp_path: Path) -> None:
    two_lines.save(tmp_path / "a.parquet")
    written = pq.read_table(tmp_path / "a.parquet")
    pd.testing.assert_frame_equal(written.to_pandas(), two_lines.to_pandas())
    metadata = written.schema.metadata
    assert float(metadata[b"dpg.largest_pressure_MPa"]) == two_lines.graph.reach
    assert b'"lines":{"A":"1-2","B":"3"}' in metadata[b"dpg.spec"].replace(b" ", b"")
    pressure = written.schema.field("pressure_MPa").metadata
    assert (pressure[b"unit"], pressure[b"basis"]) == (b"MPa", b"assumed")


def test_the_figure_names_states_and_pressures(
    two_lines: TransitionsResult, tmp_path: Path
) -> None:
    two_lines.draw(tmp_path / "a.svg")
    drawn = (tmp_path / "a.svg").read_text(encoding="utf-8")
    for text in ("000", "101", "0.1495 tie", "-0.06499", "line A", "line B", "pressure falls"):
        assert f">{text}<" in drawn
    assert "not reached from rest" in drawn
    every = dpg.transitions(
        CONFIGS / "three_unit.yaml", settings={"pressure.lines": {"A": 1, "B": 2, "C": 3}}
    )
    every.draw(tmp_path / "b.svg")
    assert "not reached from rest" not in (tmp_path / "b.svg").read_text(encoding="utf-8")


def test_files_of_others_stay(two_lines: TransitionsResult, tmp_path: Path) -> None:
    (tmp_path / "mine.graphml").write_text("<graphml/>")
    with pytest.raises(OutputError, match=r"mine\.graphml"):
        two_lines.save_graph(tmp_path / "mine.graphml")
    two_lines.save_graph(tmp_path / "own.graphml")
    two_lines.save_graph(tmp_path / "own.graphml")


@pytest.mark.parametrize("name", ["a.xml", "a.parquet", "graph"])
def test_a_graph_is_graphml(two_lines: TransitionsResult, tmp_path: Path, name: str) -> None:
    with pytest.raises(UsageError, match=r"\.graphml"):
        two_lines.save_graph(tmp_path / name)


def test_what_is_too_large_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="20 units: expected at most 16"):
        dpg.transitions(CONFIGS / "twenty_unit.yaml")
    seven = dpg.transitions(CONFIGS / "three_unit.yaml", settings={"finger.units": 7})
    with pytest.raises(UsageError, match="at most 64 states, not 128"):
        seven.draw(tmp_path / "a.svg")


def test_mere_values_have_no_pressure() -> None:
    with pytest.raises(UsageError, match="pressure is a section of a spec"):
        dpg.transitions(uniform_finger(2, **STUDY))


def test_problems_of_a_spec_come_at_once() -> None:
    settings = {"pressure.lines": {"A": "1-2"}, "pressure.effective_area_mm2": 0}
    with pytest.raises(SpecError) as error:
        dpg.transitions(CONFIGS / "three_unit.yaml", settings=settings)
    assert len(error.value.problems) == 2


def test_half_the_area_takes_twice_the_pressure() -> None:
    areas = (
        dpg.transitions(
            CONFIGS / "three_unit.yaml", settings={"pressure.effective_area_mm2": area}
        ).table["pressure_MPa"]
        for area in (30.0, 15.0)
    )
    whole, half = areas
    np.testing.assert_allclose(half, 2.0 * whole, rtol=1e-9)
    assert np.isnan(whole).sum() == 2


def test_soft_bars_let_units_pull_each_other_along() -> None:
    """At 3 N/mm one unit takes others with it, and these are no ties."""
    settings = {"finger.linear_stiffness_N_per_mm": 3.0}
    found = dpg.transitions(CONFIGS / "three_unit.yaml", settings=settings)
    first = row(found, "000", "A", "+")
    assert (first["unit"], first["reached_at_pressure"], first["tie"]) == ("2,1,3", "111", "")
    assert row(found, "001", "A", "+")["pressure_MPa"] < first["pressure_MPa"]
    frame = found.to_pandas()
    leads = frame[frame["pattern_after"] != ""]
    flips = [
        sum(a != b for a, b in zip(before, at, strict=True))
        for before, at in zip(leads["pattern"], leads["reached_at_pressure"], strict=True)
    ]
    assert flips == [len(unit.split(",")) for unit in leads["unit"]]
    assert max(flips) == 3
    assert found.reachable == ("000", "011", "111")


def test_scatter_adds_the_spread_of_thresholds() -> None:
    """Of the material alone: 2 % of the modulus are 2 % of every threshold."""
    plain = dpg.transitions(GRADED).table
    found = dpg.transitions(GRADED, scatter="elastic_modulus_MPa=2%", draws=200)
    table = found.table
    assert list(table.names) == [
        *plain.names,
        *("share_leaving", "share_without_state", "share_unknown", "share_same_unit"),
        *("pressure_mean_MPa", "pressure_deviation_MPa", "pressure_low_MPa", "pressure_high_MPa"),
    ]
    leaves = ~np.isnan(plain["pressure_MPa"])
    assert np.array_equal(table["share_leaving"], leaves)
    nominal = plain["pressure_MPa"][leaves]
    ratio = table["pressure_deviation_MPa"][leaves] / np.abs(nominal)
    np.testing.assert_allclose(ratio, 0.02, rtol=0.15)
    np.testing.assert_allclose(table["pressure_mean_MPa"][leaves], nominal, rtol=0.005)
    assert (table["share_same_unit"][leaves] == 1.0).all()
    assert any("200 fingers drawn, seed 1" in line for line in found.summary)


def test_too_many_scattered_thresholds_are_refused() -> None:
    with pytest.raises(UsageError, match="give fewer draws"):
        dpg.transitions(GRADED, scatter="stroke_mm=1%", draws=100_000)
    with pytest.raises(UsageError, match="draws goes with scatter"):
        dpg.transitions(GRADED, draws=5)


def test_a_single_direction_is_told_of_as_one() -> None:
    """A unit alone: up it leaves, down nothing happens; inverted the other way round."""
    found = dpg.transitions(CONFIGS / "three_unit.yaml", settings={"finger.units": 1})
    counts = [line for line in found.summary if " direction" in line]
    assert counts == [
        "2 directions lead to another state or back",
        "2 directions in which no unit leaves",
    ]
    one = found.graph.transitions.take(np.array([0]))
    alone = replace(found, graph=replace(found.graph, transitions=one))
    assert "1 direction leads to another state or back" in alone.summary
