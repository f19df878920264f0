"""The explorer of a design space: a part of a page with its own data and script.

Its plots are drawn by Bokeh, whose script is in the page. What a brush changes lies on a canvas of
its own there; the manual has what that takes, and what other libraries would.
"""

import base64
import hashlib
from collections.abc import Iterator
from functools import cache
from importlib import resources
from importlib.util import find_spec
from pathlib import Path

from dpgcli.reports.explorer.content import Explored, content
from dpgcli.reports.space import DesignSpace

BOKEH = ("bokeh.min.js", "bokeh-api.min.js")
SCRIPTS = (
    "columns.js",
    "plots.js",
    "scatter.js",
    "parallel.js",
    "shapes.js",
    "design.js",
    "controls.js",
)
NO_BOKEH = "No explorer: it needs Bokeh, pip install bokeh."


def is_drawable() -> bool:
    """Whether the package is installed that has Bokeh's script."""
    return find_spec("bokeh") is not None


def explorer(space: DesignSpace, explored: Explored) -> str:
    """The explorer as HTML: controls, data and the script, which is the only one that may run."""
    if not is_drawable():
        return f"<p>{NO_BOKEH}</p>\n"
    data = f'<script type="application/json" id="explorer-data">{content(space, explored)}</script>'
    return f"{_file('explorer.html')}{data}\n<script>{_script()}</script>\n"


def style() -> str:
    """The style of a page with or without an explorer."""
    return _file("explorer.css")


def policy() -> str:
    """A Content-Security-Policy: no network, and no script but this one."""
    digest = base64.b64encode(hashlib.sha256(_script().encode()).digest()).decode()
    return (
        f"default-src 'none'; script-src 'sha256-{digest}'; style-src 'unsafe-inline'; "
        "img-src data:; base-uri 'none'; form-action 'none'"
    )


def _script() -> str:
    """Bokeh's script and ours, none without Bokeh."""
    return "".join((*_bokeh(), *map(_file, SCRIPTS))) if is_drawable() else ""


def _bokeh() -> Iterator[str]:
    """Its parts, without the import of a package that only starts a server."""
    spec = find_spec("bokeh")
    assert spec
    assert spec.origin, "a package with code"
    folder = Path(spec.origin).parent / "server" / "static" / "js"
    for name in BOKEH:
        yield folder.joinpath(name).read_text(encoding="utf-8") + "\n"


@cache
def _file(name: str) -> str:
    return resources.files("dpgcli.reports.explorer").joinpath(name).read_text(encoding="utf-8")
