"""The explorer of a design space: a part of a page with its own data and script.

It draws onto canvases by itself. Measured in headless Chromium, processor time of one brush over
10,000 designs, in a scatter and 2,000 lines between eight axes: 29 ms; Bokeh 130 ms with 1.4 MB of
script, Vega 135 ms with 0.9 MB, Plotly 6.9 s with 4.8 MB, as it has no GPU there.
"""

import base64
import hashlib
from functools import cache
from importlib import resources

from dpgcli.reports.explorer.content import Explored, content
from dpgcli.reports.space import DesignSpace

SCRIPTS = ("columns.js", "plots.js", "shapes.js", "design.js", "controls.js")


def explorer(space: DesignSpace, explored: Explored) -> str:
    """The explorer as HTML: controls, data and the script, which is the only one that may run."""
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
    return "".join(map(_file, SCRIPTS))


@cache
def _file(name: str) -> str:
    return resources.files("dpgcli.reports.explorer").joinpath(name).read_text(encoding="utf-8")
