"""The summary of a space, line by line, and the same as a page."""

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
from dpgcli.reports.summary import Section, Table
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


def markdown(designs: pd.DataFrame, units: Any, facts: Any) -> str:
    return markdown_of(columns(designs), units, facts)


def html(designs: pd.DataFrame, units: Any, facts: Any) -> str:
    return html_of(columns(designs), units, facts)


def section(title: str, designs: pd.DataFrame | None = None, facts: Any = None) -> list[str]:
    """Lines of a section that are not empty."""
    text = markdown(space() if designs is None else designs, UNITS, facts)
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


def test_facts_of_the_run_and_nothing_without_them() -> None:
    facts = {
        "seconds": 1.23456789,
        "states_per_second": 98765.4321,
        "failed_designs": [],
        "host": "a|b",
        "command": ["dpg", "sweep", "a b.yaml"],
    }
    assert section("The run", facts=facts)[2:] == [
        "| seconds | 1.2346 s |",
        "| states per second | 98765/s |",
        "| failed designs | none |",
        "| host | a\\|b |",
        "| command | dpg sweep 'a b.yaml' |",
    ]
    assert "The run" not in markdown(space(), UNITS, None)


@pytest.mark.parametrize("facts", [None, {}])
def test_an_empty_table_has_a_summary(facts: Any) -> None:
    assert markdown(space().head(0), UNITS, facts) == "# Design space\n\n0 designs.\n"
    assert "0 designs." in html(space().head(0), UNITS, facts)


def test_nothing_of_a_cell_is_taken_for_markup() -> None:
    designs = space()
    designs.loc[0, "reason"] = "a <b>|*`c`\n[d](e)"
    assert r"| a \<b\>\|\*\`c\` \[d\](e) |" in markdown(designs, UNITS, None)
    assert "a &lt;b&gt;|*`c`" in html(designs, UNITS, None)


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


def test_the_page_has_the_same_cells_and_needs_no_other_file() -> None:
    page = html(space(), UNITS, {"seconds": 2.0})
    reader = Cells()
    reader.feed(page)
    assert reader.open == []
    lines = markdown(space(), UNITS, {"seconds": 2.0}).splitlines()
    cells = [cell for line in lines if line[:2] == "| " for cell in line[2:-2].split(" | ")]
    assert reader.cells == [cell for cell in cells if cell != "---"]
    assert (page.count("<h1>"), page.count("<h2>")) == (1, 7)
    assert "prefers-color-scheme: dark" in page
    assert not re.search(r"url\((?!#)|@import|<script|<link", page)


@given(st.text(max_size=40))
@example("a&lt;b &#60; &amp;amp; & c")
@example("_a_ b_c __d__ *e* ~~f~~ ![g](h) <i@j.k> https://l.m `n` \\* \\")
@example("---")
@example("- 1. # > + =")
def test_whatever_a_cell_says_the_page_says_the_same(text: str) -> None:
    table = Table(("a", "b"), [["0", text], [text, "1"]])
    reader = Cells()
    reader.feed(_html(_markdown([Section("S", [table])])))
    said = printable(" ".join(text.split()))
    assert reader.cells == ["a", "b", "0", said, said, "1"]


def svg_texts(designs: pd.DataFrame) -> list[str]:
    page = html(designs, UNITS, None)
    root = ET.fromstring(page[page.index("<svg") : page.index("</svg>") + 6])
    return [element.text or "" for element in root.iter("{http://www.w3.org/2000/svg}text")]


def test_figures_have_axes_with_units() -> None:
    texts = svg_texts(space())
    assert texts.count("height (mm)") == texts.count("gap (mm)") == 1
    assert texts.count("workspace area (mm²)") == 1
    assert "distinct tips" not in texts  # it does not vary


def test_points_off_a_grid_and_single_values_are_drawn_too() -> None:
    scattered = space(height_mm=np.arange(8) ** 1.5)
    assert "gap (mm)" in svg_texts(scattered)
    single = scattered.drop(columns="gap_mm")
    assert {"height (mm)", "workspace area (mm²)"} <= set(svg_texts(single))


def test_many_points_are_drawn_as_pixels() -> None:
    many = pd.concat([space()] * 300, ignore_index=True)
    page = html(many.assign(height_mm=np.linspace(1, 9, len(many))), UNITS, None)
    assert 'href="data:image/png' in page
    assert len(page) < 300_000
    assert "One design in" not in page


def test_of_too_many_points_some_are_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("dpgcli.reports.maps.MOST_POINTS", 10)
    many = pd.concat([space()] * 5, ignore_index=True)
    assert "One design in" not in html(many, UNITS, None)  # a grid is drawn whole
    scattered = many.assign(height_mm=np.linspace(1, 9, len(many)))
    assert "One design in 5 is drawn." in html(scattered, UNITS, None)


def test_the_same_table_gives_the_same_page() -> None:
    assert html(space(), UNITS, None) == html(space(), UNITS, None)
    assert markdown(space(), UNITS, None) == markdown(space(), UNITS, None)


def test_without_matplotlib_the_page_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    page = html(space(), UNITS, None)
    assert "No figures: they need Matplotlib" in page
    assert "<svg" not in page
    assert "370.37 mm²" in page


def test_verdicts_in_markdown() -> None:
    rules = [requirement(text, ["gap_mm", "n_stable"]) for text in ("gap_mm < 9", "n_stable > 5")]
    text = verdicts_markdown(check_requirements(columns(space().tail(4)), rules))
    assert text == (
        "# Requirements\n\nmet: gap\\_mm \\< 9: all 4 designs\n\n"
        "not met: n\\_stable \\> 5: 1 of 4 designs\n\n| first that fail |\n| --- |\n"
        "| design 4 (height\\_mm = 3, gap\\_mm = 1): n\\_stable = 5 |\n"
    ).replace("\\_", "_")
