"""Figures as one sees them: nothing is cut off, no text lies on another, colors mean one thing."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_hex, to_rgb
from matplotlib.text import Text

import dpgcli as dpg
from dpgcli.reports import comparison, figures
from dpgcli.reports.drawing import own_figure
from dpgcli.reports.fingers import INVERTED, MEASURE, REST, TIP

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
CONFIGS = ROOT / "configs"
SHALLOW = {"finger.geometry.dome_height_mm": 4.2, "finger.geometry.dome_thickness_mm": 0.4}
TINY = {
    f"finger.lattice.{key}": value
    for key, value in {
        "segment_length_mm": 13.5e-3,
        "segment_height_mm": 10.75e-3,
        "stroke_mm": 3.5e-3,
        "hinge_stiffness_N_mm_per_rad": 24.2e-6,
    }.items()
}
INK = 0.3  # of a line's height: letters leave so much of it free
CASES: dict[str, tuple[str, dict[str, Any], str]] = {
    "three units": ("three_unit", {}, "*"),
    "five units": ("five_unit", {}, "*"),
    "64 states": ("three_unit", {"finger.units": 6}, "*"),
    "eight units": ("eight_unit", {}, "1*11"),
    "twenty units": ("twenty_unit", {}, "1" * 17 + "*"),
    "sixty-four units": ("twenty_unit", {"finger.units": 64}, "0" * 58 + "*"),
    "graded": ("graded_five_unit", {}, "*"),
    "gripper": ("gripper", {}, "*"),
    "tilted gripper": ("gripper", {"gripper.mounting_angle_deg": 40, "finger.units": 2}, "*"),
    "single": ("three_unit", {}, "101"),
    "single unit": ("three_unit", {"finger.units": 1}, "*"),
    "single gripper": ("gripper", {}, "11111"),
    "not bistable": ("three_unit", SHALLOW, "*"),
    "none stable": ("three_unit", SHALLOW, "1*"),
    "micrometers": ("eight_unit", {"finger.units": 3, **TINY}, "*"),
}


@contextmanager
def seen(monkeypatch: pytest.MonkeyPatch, module: Any) -> Iterator[list[Any]]:
    """The figures that a module draws, instead of their files."""
    drawn: list[Any] = []

    @contextmanager
    def kept(path: Path, width: float, height: float, *words: str, **layout: Any) -> Iterator[Any]:
        with own_figure(width, height, **layout) as figure:
            yield figure
            figure.canvas.draw()
            drawn.append(figure)

    monkeypatch.setattr(module, "figure_to", kept)
    yield drawn


@pytest.fixture
def draw(monkeypatch: pytest.MonkeyPatch) -> Any:
    def draw(case: str, *, overlay: bool = False) -> Any:
        name, settings, patterns = CASES[case]
        found = dpg.predict(CONFIGS / f"{name}.yaml", settings=settings, patterns=patterns)
        with seen(monkeypatch, figures) as drawn:
            found.draw("states.svg", overlay=overlay)
        return drawn[0]

    return draw


def boxes(figure: Any) -> tuple[list[str], np.ndarray[Any, Any]]:
    """Texts that are seen, with their left, bottom, right and upper sides in pixels."""
    renderer = figure.canvas.get_renderer()
    texts = [t for t in figure.findobj(Text) if t.get_text().strip() and t.get_visible()]
    found = [(t.get_text(), Text.get_window_extent(t, renderer)) for t in texts]  # no leaders
    found = [(text, box) for text, box in found if box.width > 0]
    ticks = {t for axes in figure.axes for t in _hidden_ticks(axes)}
    kept = [(t.get_text(), b) for t, (_, b) in zip(texts, found, strict=True) if t not in ticks]
    return [text for text, _ in kept], np.array([box.extents for _, box in kept])


def _hidden_ticks(axes: Any) -> Iterator[Text]:
    """Labels of ticks that an axis does not show."""
    for axis in (axes.xaxis, axes.yaxis):
        shown = {tick.label1 for tick in axis.get_major_ticks() if tick.label1.get_visible()}
        yield from (t for t in axis.findobj(Text) if t not in shown and t is not axis.label)


def check_seen(figure: Any) -> None:
    """Every text is on the page, on no other, and large enough."""
    texts, sides = boxes(figure)
    assert len(texts) > 3
    low, high = sides[:, :2], sides[:, 2:]
    off = (low < 0.0).any(axis=1) | (high > figure.bbox.size).any(axis=1)
    assert not [text for text, is_off in zip(texts, off, strict=True) if is_off]
    room = np.minimum(high[:, None], high) - np.maximum(low[:, None], low)
    room[:, :, 1] -= INK * np.minimum.outer(*[high[:, 1] - low[:, 1]] * 2)
    on_another = np.triu((room > 0.5).all(axis=2), 1)
    assert not [(texts[i], texts[j]) for i, j in np.argwhere(on_another)]
    sizes = [t.get_fontsize() for t in figure.findobj(Text) if t.get_text().strip()]
    assert min(sizes) >= 5.0


@pytest.mark.parametrize("overlay", [False, True], ids=["panels", "overlay"])
@pytest.mark.parametrize("case", CASES)
def test_nothing_is_cut_off_or_hidden(draw: Any, case: str, overlay: bool) -> None:
    """Texts are on the page and not on each other, shapes inside their panels, at one scale."""
    figure = draw(case, overlay=overlay)
    check_seen(figure)
    scales: list[float] = []
    for axes in figure.axes:
        frame = axes.get_window_extent()
        scales += np.diff(axes.transData.transform([(0, 0), (1, 1)]), axis=0).ravel().tolist()
        for shapes in axes.findobj(PolyCollection):
            points = np.concatenate([path.vertices for path in shapes.get_paths()])
            pixels = axes.transData.transform(points)
            assert (pixels >= frame.min).all() and (pixels <= frame.max).all()
    assert np.ptp(scales) / scales[0] < 1e-6


def test_panels_are_titled_by_patterns_in_their_order(draw: Any) -> None:
    titles = [axes.get_title() for axes in draw("three units").axes]
    assert titles == ["000", "001", "010", "100", "011", "101", "110", "111"]


def test_long_patterns_are_titles_of_several_lines(draw: Any) -> None:
    titles = [axes.get_title() for axes in draw("sixty-four units").axes]
    assert titles[-1].replace("\n", "") == "0" * 58 + "1" * 6
    assert "\n" in titles[0]


def test_inverted_units_are_filled(draw: Any) -> None:
    for axes in draw("five units").axes:
        (chambers,) = axes.findobj(PolyCollection)
        colors = [to_hex(color) for color in chambers.get_facecolors()[:-1]]
        filled = {"0": REST.lower(), "1": INVERTED.lower()}
        assert colors == [filled[digit] for digit in axes.get_title()]


def test_a_gripper_has_two_fingers_and_its_aperture_measured(draw: Any) -> None:
    spec = dpg.predict(CONFIGS / "gripper.yaml", columns="default")
    apertures = dict(zip(spec.table["pattern"], spec.table["aperture_mm"], strict=True))
    for axes in draw("gripper").axes:
        assert len(axes.findobj(PolyCollection)) == 2
        value = apertures[axes.get_title()]
        (said,) = (t for t in axes.texts if "mm" in t.get_text())
        first, *rest = said.get_text().split("\n")
        assert float(first.removesuffix(" mm").replace("\u2212", "-")) == round(value, 1)
        assert rest == (["overlap"] if value < 0.0 else [])
        (arrow,) = (t for t in axes.texts if t is not said)
        assert abs(arrow.xy[1] - arrow.xyann[1]) == pytest.approx(abs(value))
        lines = [line for line in axes.lines if line.get_color() == MEASURE]
        assert sorted(line.get_ydata()[0] for line in lines) == pytest.approx(
            sorted((arrow.xy[1], arrow.xyann[1]))
        )


def test_the_tip_is_marked_where_the_table_says(draw: Any) -> None:
    table = dpg.predict(CONFIGS / "five_unit.yaml").table
    tips = dict(
        zip(table["pattern"], zip(table["tip_x_mm"], table["tip_y_mm"], strict=True), strict=True)
    )
    for axes in draw("five units").axes:
        (mark,) = (line for line in axes.lines if line.get_color() == TIP)
        place = (mark.get_xdata()[0], mark.get_ydata()[0])
        assert place == pytest.approx(tips[axes.get_title()], abs=1e-9)


def test_what_is_not_stable_is_a_word(draw: Any) -> None:
    first, *others = draw("not bistable").axes
    assert first.findobj(PolyCollection)
    words = {text.get_text() for axes in others for text in axes.texts}
    assert words == {"not\nbistable"}
    assert not [axes for axes in others if axes.findobj(PolyCollection)]
    note = [text.get_text() for text in draw("not bistable", overlay=True).texts]
    assert note == ["not drawn: 7 that are not stable"]


def test_axes_name_their_unit(draw: Any) -> None:
    for case, unit in (("three units", "mm"), ("micrometers", "µm")):
        texts = {text.get_text() for text in draw(case).texts}
        assert {f"x ({unit})", f"y ({unit})"} <= texts


def test_colors_differ_in_gray_too() -> None:
    """Luminance of what is filled, what is not, and the layer."""
    weights = np.array([0.2126, 0.7152, 0.0722])
    grays = sorted(float(weights @ to_rgb(color)) for color in (INVERTED, REST, "black"))
    assert np.diff(grays).min() > 0.25


def test_all_states_in_one_have_their_patterns_beside_them(draw: Any) -> None:
    axes = draw("64 states", overlay=True).axes[0]
    labels = [text.get_text() for text in axes.texts]
    assert sorted(labels) == sorted(f"{i:06b}" for i in range(64))
    lines = [line for line in axes.lines if len(line.get_xdata()) > 2]
    assert len(lines) == 64


def test_a_comparison_of_many_states_can_be_read(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    table = dpg.predict(CONFIGS / "five_unit.yaml").table
    rows = [
        f"{pattern},{x + 1.0},{y}"
        for pattern, x, y in zip(
            table["pattern"], table["tip_x_mm"], table["tip_y_mm"], strict=True
        )
    ]
    data = tmp_path / "tips.csv"
    data.write_text("pattern,tip_x_mm,tip_y_mm\n" + "\n".join(rows) + "\n")
    with seen(monkeypatch, comparison) as drawn:
        dpg.compare(CONFIGS / "five_unit.yaml", data).draw(tmp_path / "c.svg")
    check_seen(drawn[0])
    assert {text.get_text() for text in drawn[0].axes[0].texts} == set(table["pattern"])
