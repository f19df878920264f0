"""Figures in files: the same bytes every time, whole or not at all.

They have Matplotlib's own settings with ours over them, whatever a notebook, `matplotlibrc` or a
style says.
"""

import io
import logging
import os
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Literal
from xml.sax.saxutils import escape

from dpgcli.errors import UsageError
from dpgcli.files.output import Mark, whole_file
from dpgcli.text import printable, shortened

LONGEST_TITLE = 100
AUTHOR = "drawn by dpg"
OURS = {"svg.hashsalt": "dpg", "svg.fonttype": "none", "font.size": 9.0}
BACKEND = "MPLBACKEND"
Layout = Literal["constrained"] | None  # how axes find their places, if not told


@contextmanager
def own_figure(width: float, height: float, layout: Layout = "constrained") -> Iterator[Any]:
    """A figure of that size in inches to add axes to, on a canvas that needs no screen."""
    with _quiet():
        mpl = _matplotlib()
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        default = {key: mpl.rcParamsDefault[key] for key in mpl.rcParamsDefault if key != "backend"}
        with mpl.rc_context({**default, **OURS}):
            figure = Figure(figsize=(width, height), layout=layout, facecolor="white")
            FigureCanvasAgg(figure)
            yield figure


@contextmanager
def _quiet() -> Iterator[None]:
    """Nothing is said of settings that are not used, nor of characters that our font has not."""
    logger = logging.getLogger("matplotlib")
    level = logger.level
    logger.setLevel(logging.ERROR)
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "Glyph .* missing")
            yield
    finally:
        logger.setLevel(level)


def _matplotlib() -> Any:
    """Import Matplotlib; the backend that the environment names is for windows of the user's.

    It stops the import if it is not known. Raises UsageError for settings that cannot be read.
    """
    is_first = "matplotlib" not in sys.modules
    backend = os.environ.pop(BACKEND, None)
    try:
        import matplotlib as mpl
    except (OSError, ValueError) as error:
        raise UsageError(f"Matplotlib cannot read its settings (matplotlibrc): {error}") from error
    finally:
        if backend is not None:
            os.environ[BACKEND] = backend
    if is_first and backend is not None:
        with suppress(ValueError):
            mpl.rcParams["backend"] = backend
    return mpl


@contextmanager
def figure_to(
    path: Path,
    width: float,
    height: float,
    title: str,
    description: str,
    layout: Layout = "constrained",
) -> Iterator[Any]:
    """A figure to add axes to; when all went well, an SVG or PNG file of that size in inches.

    Title and description are for those who do not see it.
    """
    with own_figure(width, height, layout) as figure:
        yield figure
        with whole_file(path, Mark.FIGURE) as temporary:
            if path.suffix.lower() == ".svg":
                text = svg_text(figure, title, description, {"Creator": AUTHOR})
                temporary.write_text(text, encoding="utf-8", newline="\n")
            else:
                texts = {"Title": _shown(title), "Description": _shown(description)}
                said = {"Software": AUTHOR, **texts}
                figure.savefig(temporary, format="png", dpi=150, metadata=said)


def svg_text(figure: Any, title: str, description: str, metadata: dict[str, str | None]) -> str:
    """A figure as SVG, with a title and a description that screen readers read."""
    content = io.StringIO()
    figure.savefig(content, format="svg", metadata={"Date": None, **metadata})
    said = f"<title>{_xml(title)}</title>\n <desc>{_xml(description)}</desc>\n <defs>"
    text = content.getvalue().replace("<svg ", '<svg role="img" ', 1)
    return text.replace("<defs>", said, 1)


def _xml(text: str) -> str:
    return escape(_shown(text))


def _shown(text: str) -> str:
    """Lines without control characters, and without what is no text in names of files."""
    return "\n".join(map(printable, text.split("\n")))


def titled(text: str) -> str:
    """A text that may name a file, as a figure can show it: no formulas, no broken characters.

    >>> titled("cost$a$.csv")
    'cost\\\\$a\\\\$.csv'
    """
    return shortened(text, LONGEST_TITLE).replace("$", r"\$")


@contextmanager
def drawn_to(
    path: Path, width: float, height: float, title: str, description: str, **axes: Any
) -> Iterator[Any]:
    """Axes under a title to draw on; when all went well, a file as that of `figure_to`."""
    with figure_to(path, width, height, title, description) as figure:
        drawn = figure.add_subplot(title=titled(title), **axes)
        drawn.grid(visible=True, alpha=0.25)
        yield drawn
