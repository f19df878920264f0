"""What a page has of a space: which designs, numbers as they are, text that is only text."""

import base64
import hashlib
import json
import re
from html.parser import HTMLParser
from typing import Any

import numpy as np
import pytest

from dpgcli.reports import explorer as module
from dpgcli.reports.explorer.content import Explored, best_rows, content, shown_rows
from dpgcli.reports.page import html
from dpgcli.reports.space import DesignSpace

INF, NAN = float("inf"), float("nan")


def space(n: int = 6, **changes: Any) -> DesignSpace:
    designs = {
        "design": np.arange(n),
        "height_mm": np.arange(n) / 3.0,
        "calibration": np.full(n, "scaled", object),
        "status": np.full(n, "stable", object),
        "reason": np.full(n, "", object),
        "n_stable": np.full(n, 8),
        "workspace_area_mm2": np.arange(n, 0, -1) / 7.0,
        "n_distinct_tips": np.full(n, 8),
        **changes,
    }
    return DesignSpace(designs, {"height_mm": "mm", "workspace_area_mm2": "mm²"})


def said(found: DesignSpace) -> dict[str, Any]:
    data: dict[str, Any] = json.loads(content(found, Explored(shown_rows(found))))
    return data


def columns(found: DesignSpace) -> dict[str, Any]:
    return {column["name"]: column for column in said(found)["columns"]}


def test_swept_values_are_exact_and_others_have_six_digits() -> None:
    found = columns(space())
    assert found["height_mm"]["values"] == [k / 3 for k in range(6)]
    assert found["workspace_area_mm2"]["values"][1] == 0.714286
    assert found["design"]["values"] == [*range(6)]
    assert found["workspace_area_mm2"]["label"] == "workspace area (mm²)"


def test_numbers_that_json_has_not() -> None:
    values = np.array([INF, -INF, NAN, -0.0, 1e-300, 1e300])
    found = columns(space(height_mm=values, workspace_area_mm2=values))
    expected = [".inf", "-.inf", None, 0.0, 1e-300, 1e300]
    assert found["height_mm"]["values"] == found["workspace_area_mm2"]["values"] == expected


def test_texts_are_there_once() -> None:
    reasons = np.array(["b", "a", "b", "x" * 999, "", "a"], object)
    found = columns(space(reason=reasons))["reason"]
    assert [found["texts"][code] for code in found["values"]][:3] == ["b", "a", "b"]
    assert max(map(len, found["texts"])) <= 200


@pytest.mark.parametrize(
    ("changes", "axes"),
    [
        ({}, ("workspace_area_mm2", "height_mm")),
        ({"workspace_area_mm2": np.full(6, 3.0)}, ("height_mm", "design")),
        ({"n_stable": np.zeros(6, int)}, ("design", "n_stable")),
        ({"reach_max_mm": np.arange(6.0)}, ("workspace_area_mm2", "reach_max_mm")),
    ],
)
def test_what_does_not_vary_is_no_axis(changes: dict[str, Any], axes: tuple[str, str]) -> None:
    data = said(space(**changes))
    assert (data["across"], data["up"]) == axes
    drawn = {column["name"] for column in data["columns"] if column["is_axis"]}
    assert drawn == {*axes, "height_mm"} - {"design", "n_stable"} - (
        {"height_mm"} if "n_stable" in axes else set()
    )


def test_of_too_many_designs_some_are_there_and_the_page_says_so() -> None:
    area = np.ones(1_000_000)
    area[123_456:123_458] = 2.0, 0.5
    many = space(1_000_000, workspace_area_mm2=area)
    rows = shown_rows(many)
    assert 9_990 < len(rows) <= 10_000
    assert {0, 123_456, 123_457, 999_999} <= {*rows.tolist()}  # the best and the worst, too
    steps = np.diff(rows)
    assert (steps.min() > 0, steps.max() <= 102) == (True, True)
    shown = said(many)["shown"]
    assert shown.startswith(f"{len(rows):,} of 1,000,000 designs are here, spread evenly")
    assert said(space())["shown"] == "All 6 designs are here."


def test_best_is_what_few_designs_are() -> None:
    assert best_rows(space()) == {0: ["workspace_area_mm2"]}
    alike = np.array([2.0, 2.0, 2.0, 2.0, 1.0, 1.0])
    assert best_rows(space(workspace_area_mm2=alike)) == {}


class Scripts(HTMLParser):
    """The scripts of a page, and its policy."""

    def __init__(self) -> None:
        super().__init__()
        self.scripts: list[tuple[str | None, str]] = []
        self.policy = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag == "script":
            self.scripts.append((dict(attrs).get("type"), ""))
        if tag == "meta" and "http-equiv" in dict(attrs):
            self.policy = dict(attrs)["content"] or ""

    def handle_data(self, data: str) -> None:
        if self.scripts and not self.scripts[-1][1]:
            self.scripts[-1] = (self.scripts[-1][0], data)


def test_the_only_script_is_the_one_that_the_policy_names() -> None:
    evil = "</script><script>alert(1)</script><!--"
    reader = Scripts()
    reader.feed(html(space(reason=np.full(6, evil, object), **{evil: np.arange(6)})))
    (kind, data), (script_kind, script) = reader.scripts
    assert (kind, script_kind) == ("application/json", None)
    assert evil in [column["name"] for column in json.loads(data)["columns"]]
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert f"script-src 'sha256-{digest}';" in reader.policy
    assert "default-src 'none'" in reader.policy
    assert "unsafe-eval" not in reader.policy


def test_without_bokeh_the_page_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "find_spec", lambda name: None)
    page = html(space())
    assert "No explorer: it needs Bokeh, pip install bokeh." in page
    assert not re.search(r"<script|<select", page)
    assert "<h2>Best and worst" in page


def test_an_empty_space_has_no_explorer() -> None:
    page = html(space(0))
    assert "0 designs." in page
    assert not re.search(r"<script|<canvas|Explorer", page)
