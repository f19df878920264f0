"""The summary of a space, line by line, and the same as a page."""

import json
import re
import sys
import xml.etree.ElementTree as ET
from html.parser import HTMLParser
from itertools import product
from math import nan
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from dpgcli.arrays import Columns
from dpgcli.reports.page import _html, _markdown, verdicts_markdown
from dpgcli.reports.page import html as html_of
from dpgcli.reports.page import markdown as markdown_of
from dpgcli.reports.space import DesignSpace
from dpgcli.reports.summary import PageSection, PageTable, in_short
from dpgcli.sweeps.gate import check_requirements, requirement
from dpgcli.text import printable

UNITS = {
    "height_mm": "mm",
    "gap_mm": "mm",
    "workspace_area_mm2": "mm²",
    "aperture_min_mm": "mm",
    "max_residual_N": "N",
}
KINDS = dict.fromkeys(("calibration", "status", "reason"), object)


def space(**changes: Any) -> pd.DataFrame:
    """Heights 1 … 4 by gaps 1 and 2; designs of height <= gap are invalid, one is partly stable."""
    height, gap = (np.array(v) for v in zip(*product([1.0, 2.0, 3.0, 4.0], [1, 2]), strict=True))
    valid = height > gap
    columns = {
        "design": np.arange(8),
        "height_mm": height,
        "gap_mm": gap,
        "calibration": np.where(valid, "scaled", ""),
        "status": np.where(valid, "stable", "invalid"),
        "reason": [
            "" if v else f"too low, found {h - g:g}"
            for v, h, g in zip(valid, height, gap, strict=True)
        ],
        "n_states": np.where(valid, 8, 0),
        "n_stable": np.where(valid, 8, 0),
        "n_unknown_states": np.zeros(8, int),
        "n_distinct_tips": np.where(valid, 8, 0),
        "workspace_area_mm2": np.where(valid, (height - gap) * 123.456789, nan),
        "max_residual_N": np.where(valid, height * 1e-14, nan),
    }
    designs = pd.DataFrame({**columns, **changes})
    designs.loc[4, ["status", "n_stable"]] = "partly_stable", 5
    return designs


def columns(designs: pd.DataFrame) -> Columns:
    """As they are read from a table."""
    return {name: np.array(designs[name].tolist(), KINDS.get(name)) for name in designs}


def markdown(designs: pd.DataFrame, **metadata: str) -> str:
    return markdown_of(DesignSpace(columns(designs), UNITS, metadata))


def html(designs: pd.DataFrame, **metadata: str) -> str:
    return html_of(DesignSpace(columns(designs), UNITS, metadata))


def section(title: str, designs: pd.DataFrame | None = None) -> list[str]:
    """Lines of a section that are not empty."""
    text = markdown(space() if designs is None else designs)
    found = re.search(rf"^##? {title}\n(.*?)(?=^#|\Z)", text, re.MULTILINE | re.DOTALL)
    assert found, text
    return [line for line in found[1].splitlines() if line]


def test_the_extent_of_the_space() -> None:
    assert section("Design space") == [
        "8 designs over height_mm (1 … 4 mm, 4 values), gap_mm (1 … 2 mm, 2 values)."
    ]


def test_counts_by_status_and_calibration() -> None:
    assert section("Designs by status and calibration") == [
        "| status | designs | scaled | not solved |",
        "| --- | --- | --- | --- |",
        "| stable | 4 | 4 | 0 |",
        "| partly_stable | 1 | 1 | 0 |",
        "| invalid | 3 | 0 | 3 |",
    ]


def test_best_and_worst_with_swept_values_and_ties() -> None:
    designs = space(aperture_min_mm=[nan, nan, -3.0, nan, 2.0, 1.0, -0.5, 4.0])
    assert section("Best and worst designs", designs) == [
        "The largest value counts as best, of aperture_min_mm the one nearest zero.",
        "| metric |  | value | design | height_mm | gap_mm |",
        "| --- | --- | --- | --- | --- | --- |",
        "| workspace_area_mm2 | best | 370.37 mm² | 6 | 4 mm | 1 mm |",
        "| workspace_area_mm2 | worst | 123.46 mm² | 2 and 1 more | 2 mm | 1 mm |",
        "| n_distinct_tips | all alike | 8 | 2 and 4 more | 2 mm | 1 mm |",
        "| aperture_min_mm | best | -0.5 mm | 6 | 4 mm | 1 mm |",
        "| aperture_min_mm | worst | 4 mm | 7 | 4 mm | 2 mm |",
    ]


def test_values_are_not_alike_because_they_are_small() -> None:
    designs = space(workspace_area_mm2=np.arange(8) * 1e-12)
    rows = [line for line in section("Best and worst designs", designs) if "area" in line]
    assert [row.split(" | ")[2:4] for row in rows] == [["7e-12 mm²", "7"], ["2e-12 mm²", "2"]]


def test_a_design_without_a_state_is_neither_best_nor_worst() -> None:
    designs = space(n_distinct_tips=[99, 99, 7, 0, 8, 8, 8, 8])
    rows = [line for line in section("Best and worst designs", designs) if "tips" in line]
    assert [row.split(" | ")[2:4] for row in rows] == [["8", "4 and 3 more"], ["7", "2"]]


def test_failures_are_grouped_by_reasons_that_differ_in_numbers_only() -> None:
    assert section("What failed and why")[2:] == [
        "| invalid | 3 | too low, found 0 | 0 | 1 mm | 1 mm |",
        "| partly_stable | 1 | some patterns have no certified state; states.parquet says why "
        "| 4 | 3 mm | 1 mm |",
    ]


def test_the_most_frequent_failure_comes_first() -> None:
    designs = space(reason=["rare"] + ["frequent"] * 7)
    lines = section("What failed and why", designs)[2:]
    assert [line.split(" | ")[2:4] for line in lines] == [
        ["frequent", "1"], ["rare", "0"], ["frequent", "4"]
    ]  # fmt: skip


def test_more_kinds_of_failure_than_there_is_room_for() -> None:
    reasons = [f"cause {'x' * place}" for place in range(35)]
    designs = pd.concat([space()] * 5, ignore_index=True).head(35)
    lines = section("What failed and why", designs.assign(status="failed", reason=reasons))
    assert len(lines) == 2 + 30 + 1
    assert lines[-1] == "And 5 more."


def test_where_bistability_ends() -> None:
    assert section("Where bistability ends") == [
        "| range of | stable | partly_stable | invalid |",
        "| --- | --- | --- | --- |",
        "| height_mm | 2 … 4 mm | 3 mm | 1 … 2 mm |",
        "| gap_mm | 1 … 2 mm | 1 mm | 1 … 2 mm |",
        "Along height_mm; – where the space ends first or nothing is stable.",
        "| gap_mm | not stable up to | stable from | stable to | not stable from |",
        "| --- | --- | --- | --- | --- |",
        "| 1 mm | 1 mm | 2 mm | 2 mm | 3 mm |",
        "| 1 mm | 3 mm | 4 mm | 4 mm | – |",
        "| 2 mm | 2 mm | 3 mm | 4 mm | – |",
    ]


def test_the_boundary_along_a_single_value() -> None:
    designs = space()[lambda d: d["gap_mm"] == 2].drop(columns="gap_mm")
    assert section("Where bistability ends", designs)[-1] == "| 2 mm | 3 mm | 4 mm | – |"


def test_excluded_designs_say_nothing_about_bistability() -> None:
    designs = space()
    designs.loc[designs["status"] != "stable", "status"] = "excluded"
    assert section("Where bistability ends", designs) == [
        "Nowhere in this space: every design in it is stable."
    ]


def test_no_design_is_stable() -> None:
    lines = section("Where bistability ends", space().query("status != 'stable'"))
    assert lines == ["No design in this space is stable."]


def test_the_largest_numerical_error() -> None:
    row = "| max_residual_N | 4e-14 N | 6 | 4 mm | 1 mm |"
    assert section("Largest numerical error")[2:] == [row]


def test_an_empty_table_has_a_summary() -> None:
    assert markdown(space().head(0)) == "# Design space\n\n0 designs.\n"
    assert "0 designs." in html(space().head(0))


def test_nothing_of_a_cell_is_taken_for_markup() -> None:
    designs = space()
    designs.loc[0, "reason"] = "a <b>|*`c`\n[d](e)"
    assert r"| a \<b\>\|\*\`c\` \[d\](e) |" in markdown(designs)
    assert "a &lt;b&gt;|*`c`" in html(designs)


class Cells(HTMLParser):
    """Cells of all tables; refuses tags that are not closed in order."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.cells: list[str] = []

    def handle_starttag(self, tag: str, attrs: Any) -> None:
        assert not {"src", "href"} & dict(attrs).keys()
        if tag != "meta":
            self.open.append(tag)
        if tag in ("td", "th"):
            self.cells.append("")

    def handle_startendtag(self, tag: str, attrs: Any) -> None:
        pass

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] in ("td", "th"):
            self.cells[-1] += data


def apart(page: str) -> tuple[str, str]:
    """What is before and behind the explorer of a page."""
    before, _, rest = page.partition("<h2>Explorer</h2>")
    return before, rest.rpartition("</script>")[2]


def test_the_page_has_the_same_cells_and_needs_no_other_file() -> None:
    page = html(space())
    reader = Cells()
    reader.feed("".join(apart(page)))
    assert reader.open == []
    lines = markdown(space()).splitlines()
    cells = [cell for line in lines if line[:2] == "| " for cell in line[2:-2].split(" | ")]
    assert reader.cells == [cell for cell in cells if cell != "---"]
    assert (page.count("<h1>"), page.count("<h2>")) == (1, 7)
    assert "prefers-color-scheme: dark" in page
    assert not re.search(r"url\((?!#)|@import|<link", "".join(apart(page)))
    assert not re.search(r"<script[^>]* src", page)


@given(st.text(max_size=40))
@example("a&lt;b &#60; &amp;amp; & c")
@example("_a_ b_c __d__ *e* ~~f~~ ![g](h) <i@j.k> https://l.m `n` \\* \\")
@example("---")
@example("- 1. # > + =")
def test_whatever_a_cell_says_the_page_says_the_same(text: str) -> None:
    table = PageTable(("a", "b"), [["0", text], [text, "1"]])
    reader = Cells()
    reader.feed(_html(_markdown([PageSection("S", [table])])))
    said = printable(" ".join(text.split()))
    assert reader.cells == ["a", "b", "0", said, said, "1"]


def svg_texts(designs: pd.DataFrame) -> list[str]:
    page = apart(html(designs))[1]
    root = ET.fromstring(page[page.index("<svg") : page.index("</svg>") + 6])
    return [element.text or "" for element in root.iter("{http://www.w3.org/2000/svg}text")]


def test_figures_have_axes_with_units() -> None:
    texts = svg_texts(space())
    assert texts.count("height (mm)") == texts.count("gap (mm)") == 2  # two maps
    assert texts.count("workspace area (mm²)") == 1
    assert "distinct tips" not in texts  # it does not vary


def test_points_off_a_grid_and_single_values_are_drawn_too() -> None:
    scattered = space(height_mm=np.arange(8) ** 1.5)
    assert "gap (mm)" in svg_texts(scattered)
    single = scattered.drop(columns="gap_mm")
    assert {"height (mm)", "workspace area (mm²)"} <= set(svg_texts(single))


def test_many_points_are_drawn_as_pixels() -> None:
    many = pd.concat([space()] * 300, ignore_index=True)
    page = html(many.assign(height_mm=np.linspace(1, 9, len(many))))
    assert 'href="data:image/png' in page
    assert sum(map(len, apart(page))) < 300_000
    assert "One design in" not in page


def test_of_too_many_points_some_are_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("dpgcli.reports.maps.MOST_POINTS", 10)
    many = pd.concat([space()] * 5, ignore_index=True)
    assert "One design in" not in html(many)  # a grid is drawn whole
    scattered = many.assign(height_mm=np.linspace(1, 9, len(many)))
    assert "One design in 5 is drawn." in html(scattered)


def test_the_same_table_gives_the_same_page() -> None:
    assert html(space()) == html(space())
    assert markdown(space()) == markdown(space())


def test_without_matplotlib_the_page_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    page = html(space())
    assert "No figures: they need Matplotlib" in page
    assert "<svg" not in "".join(apart(page))
    assert "370.37 mm²" in page


def test_verdicts_in_markdown() -> None:
    rules = [requirement(text, ["gap_mm", "n_stable"]) for text in ("gap_mm < 9", "n_stable > 5")]
    text = verdicts_markdown(check_requirements(columns(space().tail(4)), rules))
    assert text == (
        "# Requirements\n\nmet: gap\\_mm \\< 9: all 4 designs\n\n"
        "not met: n\\_stable \\> 5: 1 of 4 designs\n\n| first that fail |\n| --- |\n"
        "| design 4 (height\\_mm = 3, gap\\_mm = 1): n\\_stable = 5 |\n"
    ).replace("\\_", "_")


BASE = {
    "dpg.base": "base.yaml",
    "dpg.law": "published law",
    "dpg.sweep": json.dumps(
        {
            "base": json.dumps(
                {
                    "finger": {
                        "units": 3,
                        "calibration": [{"file": "dome.yaml", "values": {}}, "published"],
                        "geometry": {"elastic_modulus_MPa": 26.0},
                    }
                }
            )
        }
    ),
}


def test_base_law_and_calibration_are_named() -> None:
    lines = markdown(space(), **BASE).splitlines()
    assert "Base spec: base.yaml (units 3, elastic_modulus_MPa 26)." in lines
    assert "Law: published law. Calibration: dome.yaml, published." in lines
    for wrong in ("", "{", "[]", '{"base": 1}', '{"base": "[1]"}', '{"base": "{}"}'):
        assert "Base spec" not in markdown(space(), **{**BASE, "dpg.sweep": wrong})


def test_the_best_designs_come_first_then_the_figures() -> None:
    titles = re.findall(r"<h2>([^<]*)", html(space()))
    assert titles[:3] == ["Explorer", "Best and worst designs", "Figures"]
    assert re.findall(r"^## (.*)", markdown(space()), re.MULTILINE)[0] == titles[1]


def with_bars(stiffest: Any, **more: Any) -> pd.DataFrame:
    return space(n_units=np.full(8, 4), stiffness_max_N_per_mm=stiffest, **more)


@pytest.mark.parametrize(
    ("given", "alone"),
    [(None, 2500.0), (4000.0, 1000.0), (".inf", None), ("dome.yaml", 100.0)],
)
@pytest.mark.slow
def test_a_stiffness_that_only_shows_the_bars_is_not_ranked(given: Any, alone: Any) -> None:
    """k_L/n of 4 units: assumed, given, or from a calibration; of rigid bars there is none."""
    finger: dict[str, Any] = {"units": 4, "calibration": "published"}
    if given == "dome.yaml":
        bars = {"linear_stiffness_N_per_mm": {"value": 400.0}}
        finger["calibration"] = [{"file": given, "values": bars}]
    elif given is not None:
        finger["linear_stiffness_N_per_mm"] = given
    said = {"dpg.sweep": json.dumps({"base": json.dumps({"finger": finger})})}
    growing = np.linspace(1.0, 1.0005, 8) * (alone or 2500.0)
    text = markdown(with_bars(growing), **said)
    assert ("| stiffness_max_N_per_mm | best |" in text) == (alone is None)
    assert ("is not ranked for any design: it is that of the straight" in text) == bool(alone)
    figures = apart(html(with_bars(growing), **said))[1]
    assert ("stiffness max" in figures) == (alone is None)
    if alone:
        softer = growing * np.where(np.isin(np.arange(8), (2, 4)), 0.5, 1.0)
        assert "| stiffness_max_N_per_mm | best | " in markdown(with_bars(softer), **said)
        assert "is not ranked for 3 designs" in markdown(with_bars(softer), **said)


def test_bars_that_vary_are_judged_design_by_design() -> None:
    bars = np.linspace(1e3, 1e4, 8)
    designs = with_bars(bars / 4.0)
    designs.insert(3, "linear_stiffness_N_per_mm", bars)
    assert "is not ranked for any design" in markdown(designs, **BASE)


def test_a_table_that_says_nothing_of_its_base_is_ranked_as_it_is() -> None:
    assert "| stiffness_max_N_per_mm | best |" in markdown(with_bars(np.linspace(2500, 2501, 8)))


@pytest.mark.parametrize("bars", [{}, {"linear_stiffness_N_per_mm": np.linspace(1e3, 1e4, 8)}])
def test_without_the_number_of_units_nothing_tells_bars_alone(bars: dict[str, Any]) -> None:
    designs = with_bars(np.linspace(2500, 2501, 8), **bars).drop(columns="n_units")
    text = markdown(designs, **BASE)
    assert "| stiffness_max_N_per_mm | best |" in text
    assert "bars, k_L/n: the table has no numbers n_units to tell by." in text
    assert "n_units" not in markdown(space())
    assert "stiffness max" in html(designs, **BASE)


@pytest.mark.parametrize("metric", ["aperture_min_mm", "reach_min_mm", "n_stable"])
@pytest.mark.slow
def test_every_metric_that_varies_has_a_map(metric: str) -> None:
    texts = svg_texts(space(**{metric: np.arange(1, 9)}))
    words = {"aperture_min_mm": "aperture min (mm)", "n_stable": "stable"}
    assert words.get(metric, "reach min mm") in texts
    constant = space(**{metric: np.full(8, 8)})
    constant.loc[4, "status"] = "stable"
    constant["n_stable"] = 8
    assert words.get(metric, "reach min mm") not in svg_texts(constant)


def test_a_map_over_hidden_axes_says_what_it_shows() -> None:
    """Of designs that share a place the best one: the largest, or the one nearest zero."""
    both = pd.concat([space(), space()], ignore_index=True)
    both.insert(3, "width_mm", np.repeat([1.0, 2.0], 8))
    both["aperture_min_mm"] = np.tile([np.arange(8) - 3.0], 2)[0] * np.repeat([2.0, 1.0], 8)
    page = html(both)
    assert "A place stands for all designs there, of every width mm 1 … 2" in page
    texts = svg_texts(both)
    assert "workspace area (mm²), largest over width mm" in texts
    assert "aperture min (mm), nearest zero over width mm" in texts
    assert not [text for text in svg_texts(space()) if "over" in text]


def test_in_short_there_are_counts_and_the_best_and_the_worst() -> None:
    line, table = in_short(DesignSpace(columns(space()), UNITS))
    assert line == "8 designs: 4 stable, 1 partly_stable, 3 invalid"
    rows = {row[0]: list(row[1:]) for row in table.rows}
    assert rows["workspace_area_mm2"] == ["370.37 mm²", "6", "123.46 mm²", "2 and 1 more"]
    assert rows["n_distinct_tips"] == ["8", "2 and 4 more", "all alike", ""]
    assert {len(row) for row in table.rows} == {5}
    assert in_short(DesignSpace(columns(space().head(0)), UNITS))[0] == "0 designs: none"
