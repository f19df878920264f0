"""Figures in files: the same bytes every time, whole or not at all."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from dpgcli.files.output import Mark, whole_file
from dpgcli.text import shortened

LONGEST_TITLE = 100
AUTHOR = "drawn by dpg"


@contextmanager
def figure_to(path: Path, width: float, height: float) -> Iterator[Any]:
    """A figure to add axes to; when all went well, an SVG or PNG file of that size in inches."""
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with mpl.rc_context({"svg.hashsalt": "dpg", "svg.fonttype": "none"}):
        figure = Figure(figsize=(width, height), layout="constrained")
        FigureCanvasAgg(figure)
        yield figure
        kind = path.suffix.lower().removeprefix(".")
        metadata = {"svg": {"Date": None, "Creator": AUTHOR}, "png": {"Software": AUTHOR}}[kind]
        with whole_file(path, Mark.FIGURE) as temporary:
            figure.savefig(temporary, format=kind, dpi=150, metadata=metadata)


def titled(text: str) -> str:
    """A text that may name a file, as a figure can show it: no formulas, no broken characters.

    >>> titled("cost$a$.csv")
    'cost\\\\$a\\\\$.csv'
    """
    return shortened(text, LONGEST_TITLE).replace("$", r"\$")


@contextmanager
def drawn_to(path: Path, width: float, height: float, **axes: Any) -> Iterator[Any]:
    """Axes to draw on; when all went well, an SVG or PNG file of that size in inches."""
    with figure_to(path, width, height) as figure:
        drawn = figure.add_subplot(**axes)
        drawn.grid(visible=True, alpha=0.25)
        yield drawn
