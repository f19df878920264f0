"""The explorer in a real browser: what it shows, by mouse, by keyboard, in the dark and printed."""

import base64
import json
import re
from collections.abc import Callable
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dpgcli as dpg
from dpgcli.files.design_spec import design_spec, swept_base
from dpgcli.files.scene_file import canonical_json, checked, scene_of
from dpgcli.files.table_reader import read_designs
from dpgcli.files.table_writer import read_metadata
from dpgcli.files.yaml_file import parse_document
from dpgcli.reports.outlines import drawn_states
from dpgcli.reports.page import html
from dpgcli.reports.space import DesignSpace
from dpgcli.states.plan import Request
from dpgcli.states.predict import predict
from tests.reports.explorer.conftest import drawn

pytestmark = pytest.mark.slow
Open = Callable[..., Any]
Point = tuple[float, float]
ROOT = Path(dpg.__file__).parent.parent
BASE = ROOT / "configs" / "five_unit.yaml"
HEIGHT, GAP = "finger.geometry.dome_height_mm", "finger.geometry.unit_separation_mm"
OVER = "finger.overrides.4-5.geometry.dome_thickness_mm"
SPACE = [
    {"key": HEIGHT, "values": [4.5, 5.5, 6.5, 7.5]},
    {"key": GAP, "values": [2.0, 3.0, 4.0]},
    {"key": OVER, "values": [0.6, 0.75]},
]
N_DESIGNS, N_UNITS = 24, 5
FILLED = """
return ["scatter", "parallel"].map((name) => {
  const {clientWidth, clientHeight} = document.getElementById(`explorer-${name}`);
  return [...Bokeh.index].some(({model}) =>
    model.outer_width === clientWidth && model.outer_height === clientHeight);
});
"""
LOOK = """
const styles = getComputedStyle(document.documentElement);
const plots = [...Bokeh.index].map(({model}) => model).filter((model) => model.renderers);
const colors = plots.map((plot) => plot.below[0].major_label_text_color);
const text = styles.getPropertyValue("--text").trim();
return [plots.map((plot) => plot.output_backend), colors.every((color) => color === text)];
"""
PLACE = """
const place = document.getElementById(arguments[0]);
place.scrollIntoView({block: "center"});
const {left, top, width, height} = place.getBoundingClientRect();
return [left, top, width, height];
"""


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a sweep."""
    folder = tmp_path_factory.mktemp("swept") / "out"
    dpg.sweep({"base": str(BASE), "space": SPACE}, folder, jobs=1)
    return folder


@pytest.fixture
def page(opened: Open, swept: Path) -> Any:
    """A browser with its page."""
    return opened(dpg.report(swept, format="html"))


def text(browser: Any, name: str) -> str:
    found: str = browser.execute_script(
        "return document.getElementById(arguments[0]).textContent", f"explorer-{name}"
    )
    return found


def passing(browser: Any) -> int:
    drawn(browser)
    return int(text(browser, "count").split()[0].replace(",", ""))


def drag(browser: Any, name: str, start: Point, end: Point) -> None:
    """Move the mouse with its button down, as a user would, in shares of a plot."""
    left, top, width, height = browser.execute_script(PLACE, f"explorer-{name}")
    moves = [("mousePressed", start), ("mouseMoved", start), ("mouseMoved", end)]
    for kind, (x, y) in [*moves, ("mouseReleased", end)]:
        at = {"x": left + x * width, "y": top + y * height}
        button = {"button": "left", "buttons": int(kind != "mouseReleased"), "clickCount": 1}
        browser.execute_cdp_cmd("Input.dispatchMouseEvent", {"type": kind, **at, **button})


def fill(browser: Any, label: str, value: str) -> None:
    """Write a value into the field with a label, as a user would."""
    field = browser.find_element("css selector", f'[aria-label="{label}"]')
    field.clear()
    field.send_keys(value)


def numbers(browser: Any) -> dict[str, str]:
    rows = browser.find_elements("css selector", "#explorer-numbers tr")
    pairs = (row.find_elements("css selector", "th, td") for row in rows)
    return {name.text: value.text for name, value in pairs}


def test_a_page_loads_without_errors_and_asks_for_nothing(page: Any) -> None:
    assert page.get_log("browser") == []
    events = (json.loads(entry["message"])["message"] for entry in page.get_log("performance"))
    asked = [
        event["params"]["request"]["url"]
        for event in events
        if event["method"] == "Network.requestWillBeSent"
    ]
    assert [url for url in asked if not url.startswith(("file:", "data:", "chrome"))] == []
    assert passing(page) == N_DESIGNS
    for said in ("Base spec: five_unit.yaml", "Law: published law", "Calibration: published"):
        assert said in page.find_element("css selector", "body").text
    best = page.find_elements("css selector", ".shapes svg[role=img]")
    assert len(best) >= 2
    assert re.match(r"Design \d+: 00000: tip at", best[0].get_attribute("aria-label"))


def test_filters_are_fields(page: Any) -> None:
    fill(page, "dome_height_mm, lowest", "6")
    assert passing(page) == 12
    fill(page, "unit_separation_mm, highest", "2.5")
    assert passing(page) == 4
    page.find_element("id", "explorer-clear").click()
    assert passing(page) == N_DESIGNS
    assert page.find_element("css selector", '[aria-label="dome_height_mm, lowest"]').text == ""


def test_what_is_no_number_is_marked_and_filters_nothing(page: Any) -> None:
    fill(page, "dome_height_mm, lowest", "6,5")
    field = page.find_element("css selector", '[aria-label="dome_height_mm, lowest"]')
    assert (passing(page), field.get_attribute("aria-invalid")) == (N_DESIGNS, "true")
    fill(page, "dome_height_mm, highest", "\N{MINUS SIGN}3.5")  # as the page writes numbers
    assert passing(page) == 0


def test_a_brush_over_an_axis_or_the_scatter_filters(page: Any) -> None:
    drag(page, "parallel", (0.055, 0.1), (0.055, 0.5))
    assert passing(page) == 12  # the upper half of the heights
    fields = [
        page.find_element("css selector", f'[aria-label="dome_height_mm, {end}"]')
        for end in ("lowest", "highest")
    ]
    low, high = (field.get_property("value") for field in fields)
    assert 5.5 < float(low) < 6.5
    assert high == ""  # to the end of the axis and beyond
    drag(page, "parallel", (0.055, 0.5), (0.055, 0.5))  # a click
    assert passing(page) == N_DESIGNS
    drag(page, "scatter", (0.5, 0.02), (0.99, 0.8))
    few = passing(page)
    assert 0 < few < N_DESIGNS
    assert len(page.find_elements("css selector", "#explorer-passing tbody tr")) == min(20, few)


def test_what_passes_is_drawn(page: Any, swept: Path) -> None:
    """By Bokeh's own word: squares, diamonds and a cross in one plot, lines in the other."""
    fill(page, "dome_height_mm, lowest", "6")
    assert passing(page) == 12
    plots = page.execute_script(
        "const plots = [...Bokeh.index].map(({model}) => model).filter((m) => m.renderers);"
        "return plots.map((plot) => plot.renderers.map(({data_source}) =>"
        "  Object.entries(data_source.data).map(([name, values]) => [name, [...values].map("
        "    (value) => typeof value === 'number' ? value : [...value])])))"
    )
    layers = ([dict(layer) for layer in plot] for plot in plots)
    scatter, parallel = sorted(layers, key=lambda found: "xs" in found[0])
    dots, squares, front, cross = scatter
    designs = read_designs(swept / "designs.parquet").columns
    is_high = designs["dome_height_mm"] > 6
    for axis, name in (("x", "workspace_area_mm2"), ("y", "reach_max_mm")):
        np.testing.assert_allclose(dots[axis], designs[name], rtol=1e-5)
        np.testing.assert_allclose(squares[axis], designs[name][is_high], rtol=1e-5)
    assert f"{len(front['x'])} on the Pareto front" in text(page, "count")
    assert len(cross["x"]) == 1
    lines, thick, _, ranges = parallel
    heights = designs["dome_height_mm"][is_high]
    assert [line[0] for line in lines["ys"]] == pytest.approx((heights - 4.5) / 3)
    assert len(thick["ys"]) == 1
    assert (ranges["x"], ranges["y"], ranges["height"]) == ([0], [0.75], [0.5])


def test_a_brush_does_not_draw_the_dots_again(page: Any) -> None:
    """Of each plot only the canvas that lies above: what a brush takes rests on it."""
    page.execute_script(
        "const own = CanvasRenderingContext2D.prototype.clearRect; window.cleared = new Set();"
        "CanvasRenderingContext2D.prototype.clearRect = function (...box) {"
        "  window.cleared.add(this.canvas); return own.apply(this, box); }"
    )
    drag(page, "scatter", (0.5, 0.02), (0.99, 0.8))
    assert 0 < passing(page) < N_DESIGNS
    assert page.execute_script("return window.cleared.size") == 2


def test_the_front_is_that_of_the_table(page: Any, swept: Path) -> None:
    designs = read_designs(swept / "designs.parquet").columns
    across, up = (designs[name] for name in ("workspace_area_mm2", "reach_max_mm"))
    assert text(page, "x").startswith("design")
    for axis, name in (("x", "workspace area (mm²)"), ("y", "reach max (mm)")):
        choice = page.find_element("id", f"explorer-{axis}")
        choice.find_element("xpath", f"option[.='{name}']").click()
    drawn(page)
    better = (across[:, None] >= across) & (up[:, None] >= up)
    better &= (across[:, None] > across) | (up[:, None] > up)
    assert f"{(~better.any(axis=0)).sum()} on the Pareto front" in text(page, "count")


def test_arrow_keys_walk_through_the_designs(page: Any, swept: Path) -> None:
    designs = read_designs(swept / "designs.parquet").columns
    fill(page, "dome_height_mm, lowest", "6")
    scatter = page.find_element("id", "explorer-scatter")
    areas = []
    for _ in range(3):
        scatter.send_keys("\ue014")  # right
        drawn(page)
        areas.append(designs["workspace_area_mm2"][int(text(page, "title").split()[1])])
        assert float(numbers(page)["dome_height_mm"].split()[0]) >= 6
    assert areas == sorted(areas) or areas[0] == max(areas)
    page.execute_script("document.querySelector('#explorer-passing button').focus()")
    page.switch_to.active_element.send_keys("\ue007")  # return
    number = page.find_element("css selector", "#explorer-passing button").text
    assert text(page, "title") == f"Design {number}"


def test_states_are_those_of_predict(page: Any, swept: Path) -> None:
    """Every corner of every chamber, of a design whose units differ."""
    page.execute_script("document.querySelector('#explorer-passing button').click()")
    drawn(page)
    number = int(text(page, "title").split()[1])
    shown = page.execute_script(
        "return [...document.querySelectorAll('#explorer-states figure')].map((figure) => ["
        "figure.querySelector('figcaption').textContent,"
        "figure.querySelectorAll('.inverted').length,"
        "[...figure.querySelectorAll('polygon')].map((p) => p.getAttribute('points'))])"
    )
    assert len(shown) == 2**N_UNITS
    columns = ("pattern", "status", "tip_x_mm", "tip_y_mm", "nodes")
    prediction = predict(scene_of(spec_of(swept, number)), Request(columns=columns))
    states = {state.pattern: state for state in drawn_states(prediction)}
    for said, n_inverted, polygons in shown:
        pattern = said[:N_UNITS]
        (finger,) = states[pattern].fingers
        assert n_inverted == pattern.count("1")
        x, y = re.findall(r"[-\d.]+", said.replace("\u2212", "-"))[1:3]
        assert abs(float(x) + 1j * float(y) - states[pattern].tip) < 0.01
        for points, chamber in zip(polygons, finger.chambers, strict=True):
            x, y = np.array([pair.split(",") for pair in points.split()], float).T
            assert np.abs(x - 1j * y - chamber).max() < 2e-2


def spec_of(swept: Path, number: int) -> Any:
    designs = read_designs(swept / "designs.parquet").columns
    values = {
        HEIGHT: designs["dome_height_mm"][number].item(),
        GAP: designs["unit_separation_mm"][number].item(),
        OVER: designs[OVER][number].item(),
    }
    return design_spec(swept_base(read_metadata(swept / "designs.parquet")), values)


def test_units_are_inverted_by_buttons(page: Any) -> None:
    first = page.find_element("css selector", "#explorer-units button")
    before = text(page, "large")
    assert first.get_attribute("aria-pressed") == "true"
    first.send_keys("\ue00d")  # space
    assert first.get_attribute("aria-pressed") == "false"
    assert (before[:N_UNITS], text(page, "large")[:N_UNITS]) == ("11111", "01111")


def test_the_spec_of_a_design_is_a_spec(page: Any, swept: Path) -> None:
    button = page.find_element("id", "explorer-spec-button")
    assert not page.find_element("id", "explorer-spec").is_displayed()
    button.click()
    assert button.get_attribute("aria-expanded") == "true"
    written = page.find_element("id", "explorer-spec").text
    number = int(text(page, "title").split()[1])
    found = checked(parse_document("spec.yaml", written))
    assert canonical_json(found) == canonical_json(spec_of(swept, number))


EVIL = "<script>document.title='evil'</script><img src=x onerror=\"document.title='evil'\">"


def hostile() -> DesignSpace:
    """A space whose names, units and texts would be markup and scripts."""
    height, gap = np.array([*product([1.0, 2.0, 3.0], [1.0, 2.0])]).T
    n = len(height)
    designs = {
        "design": np.arange(n),
        EVIL: height,
        "__proto__": gap,
        r"$$\frac{1}{2}$$": gap,
        "</script><script>document.title='evil'</script>": gap,
        "calibration": np.full(n, "scaled", object),
        "status": np.full(n, EVIL, object),
        "reason": np.array([f"</script>{EVIL}{k}" for k in range(n)], object),
        "n_stable": np.full(n, 8),
        "n_units": np.full(n, 3),
        "workspace_area_mm2": height * gap,
        "reach_max_mm": np.array([1.0, np.inf, np.nan, 2.0, -np.inf, 3.0]),
    }
    return DesignSpace(designs, dict.fromkeys(designs, EVIL))


def test_names_and_texts_are_text(opened: Open) -> None:
    browser = opened(html(hostile()))
    assert browser.get_log("browser") == []
    assert browser.title == "Design space"
    assert passing(browser) == 6
    assert browser.find_elements("css selector", "body img, body script[src]") == []
    options = browser.find_elements("css selector", "#explorer-x option")
    said = [option.get_attribute("textContent") for option in options]
    assert any("<script>" in label for label in said)
    (tex,) = (option for option, label in zip(options, said, strict=True) if "frac" in label)
    tex.click()  # would ask for a library that sets formulas
    assert passing(browser) == 6
    assert browser.get_log("browser") == []
    browser.execute_script("document.querySelector('#explorer-passing button').click()")
    drawn(browser)
    assert any("<script>" in name for name in numbers(browser))
    assert "No states are drawn" in text(browser, "states-note")


def test_no_other_script_runs(page: Any) -> None:
    """The policy of the page refuses what is not its own script, were it to come in."""
    page.execute_script(
        "const s = document.createElement('script'); s.textContent = 'document.title = \"evil\"';"
        "document.body.append(s);"
    )
    assert page.title == "Design space"
    assert "Content Security Policy" in page.get_log("browser")[0]["message"]


def test_an_empty_space_has_a_page(opened: Open) -> None:
    designs = {name: values[:0] for name, values in hostile().designs.items()}
    browser = opened(html(DesignSpace(designs, {})))
    assert browser.get_log("browser") == []
    assert "0 designs." in browser.find_element("css selector", "body").text
    assert browser.find_elements("css selector", ".scatter") == []


def test_a_space_without_states_has_a_page(opened: Open) -> None:
    designs = {**hostile().designs, "n_stable": np.zeros(6, int)}
    browser = opened(html(DesignSpace(designs, {})))
    assert browser.get_log("browser") == []
    assert passing(browser) == 6


@pytest.mark.parametrize(
    "values", [[1e308, -1e308], [np.inf, 1.0], [5e-324, 1e-323], [1e-320, 1e308], [np.nan] * 2]
)
def test_values_that_no_axis_reaches_are_at_its_end(opened: Open, values: list[float]) -> None:
    designs = {**hostile().designs, "reach_max_mm": np.resize(values, 6)}
    browser = opened(html(DesignSpace(designs, {})))
    places = "return columnOf('reach_max_mm').places.every((p) => isNaN(p) || (p >= 0 && p <= 1))"
    assert browser.execute_script(places)
    for option in browser.find_elements("css selector", "#explorer-x option"):
        if "reach max" in option.get_attribute("textContent"):
            option.click()
    assert browser.execute_script("return chosen.x === columnOf('reach_max_mm')")
    assert browser.get_log("browser") == []
    assert passing(browser) == 6


def luminance(color: str) -> float:
    channels = np.array([int(part) for part in re.findall(r"\d+", color)[:3]]) / 255
    linear = np.where(channels <= 0.04045, channels / 12.92, ((channels + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


def contrast(one: str, other: str) -> float:
    """The ratio of WCAG 2, from 1 to 21."""
    light, dark = sorted((luminance(one), luminance(other)), reverse=True)
    return (light + 0.05) / (dark + 0.05)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_what_is_said_can_be_read(page: Any, scheme: str) -> None:
    feature = {"name": "prefers-color-scheme", "value": scheme}
    page.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [feature]})
    drawn(page)
    try:
        colors = page.execute_script(
            "const at = (tag) => getComputedStyle(document.querySelector(tag));"
            "const probe = document.createElement('p'); document.body.append(probe);"
            "const named = ['text', 'mark', 'front', 'edge', 'inverted'].map((name) => {"
            "probe.style.color = `var(--${name})`; return getComputedStyle(probe).color; });"
            "return [at('body').backgroundColor, ...named]"
        )
        page_color, words, mark, front, edge, inverted = colors
        assert page.execute_script(LOOK) == [["canvas", "canvas"], True]
        assert (luminance(page_color) < 0.1) == (scheme == "dark")
        assert contrast(page_color, words) > 7
        assert min(contrast(page_color, other) for other in (mark, front, edge)) > 4.5
        assert contrast(inverted, edge) > 1.5  # a filled chamber has an edge
    finally:
        page.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})


def test_a_page_is_printed_on_white_without_controls(page: Any) -> None:
    feature = {"name": "prefers-color-scheme", "value": "dark"}
    page.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print", "features": [feature]})
    try:
        drawn(page)
        is_shown = {
            name: page.find_element("id", f"explorer-{name}").is_displayed()
            for name in ("clear", "filters", "scatter", "parallel", "numbers", "passing")
        }
        background = page.execute_script("return getComputedStyle(document.body).backgroundColor")
        assert page.execute_script(LOOK) == [["svg", "svg"], True]  # sharp on paper
    finally:
        page.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "", "features": []})
    assert is_shown == {
        "clear": False,
        "filters": False,
        "scatter": True,
        "parallel": True,
        "numbers": True,
        "passing": True,
    }
    assert luminance(background) > 0.9
    printed = base64.b64decode(page.execute_cdp_cmd("Page.printToPDF", {})["data"])
    assert printed.startswith(b"%PDF")


def test_every_control_and_picture_has_a_name(page: Any) -> None:
    nameless = page.execute_script(
        "return [...document.querySelectorAll('button, select, input, [role=img]')]"
        ".filter((e) => !e.getAttribute('aria-label') && !e.labels?.length)"
        ".filter((e) => !e.textContent.trim())"
        ".map((e) => e.outerHTML)"
    )
    assert nameless == []
    wide = "return document.documentElement.scrollWidth - document.documentElement.clientWidth"
    for width in (1280, 600, 400):
        page.set_window_size(width, 1000)
        drawn(page)
        assert page.execute_script(wide) <= 0
        drawn(page)
        assert page.execute_script(FILLED) == [True, True]
    page.set_window_size(1280, 1000)


@cache
def many() -> DesignSpace:
    """10,000 designs of 15 columns."""
    random, n = np.random.default_rng(1), 10_000
    values = {f"value_{k}_mm": random.uniform(1, 2, n) for k in range(3)}
    total = sum(values.values())
    metrics = ("workspace_area_mm2", "reach_min_mm", "reach_max_mm", "min_barrier_mJ")
    return DesignSpace(
        {
            "design": np.arange(n),
            **values,
            "calibration": np.full(n, "scaled", object),
            "status": np.full(n, "stable", object),
            "reason": np.full(n, "", object),
            "n_stable": np.full(n, 32),
            **{name: total * random.uniform(1, 2, n) for name in metrics},
            **{f"max_{k}_N": random.uniform(1, 2, n) for k in range(4)},
        },
        {},
    )


def test_ten_thousand_designs_are_brushed(opened: Open) -> None:
    written = html(many())
    assert len(written.encode()) < 8e6
    browser = opened(written)
    assert passing(browser) == 10_000
    for k in range(3):
        drag(browser, "scatter", (0.2 + 0.02 * k, 0.1), (0.7 + 0.02 * k, 0.8))
        assert 0 < passing(browser) < 10_000


@pytest.mark.benchmark
def test_what_a_brush_takes(opened: Open, capsys: pytest.CaptureFixture[str]) -> None:
    """Time of the page's thread, without the browser's other work, with `-m benchmark`."""
    browser = opened(html(many()))
    browser.execute_cdp_cmd("Performance.enable", {"timeDomain": "threadTicks"})

    def busy() -> float:
        metrics = browser.execute_cdp_cmd("Performance.getMetrics", {})["metrics"]
        return float(next(m["value"] for m in metrics if m["name"] == "TaskDuration"))

    before = busy()
    for k in range(10):
        drag(browser, "scatter", (0.2 + 0.02 * k, 0.1), (0.7 + 0.02 * k, 0.8))
    with capsys.disabled():
        print(f"\na brush over 10,000 designs: {(busy() - before) / 10:.3f} s")
