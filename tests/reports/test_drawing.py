"""Figures have their own settings, whatever is set around them, and words for who cannot see."""

import os
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import pytest
from matplotlib import rc_context, rcParams
from PIL import Image

import dpgcli as dpg
from dpgcli.files.output import Mark, is_own
from dpgcli.reports.drawing import figure_to

ROOT = Path(__file__).parents[2]
SPEC = str(ROOT / "configs" / "three_unit.yaml")
DATA = str(ROOT / "configs" / "calibration" / "three_gap_finger.csv")
FITTED = str(ROOT / "configs" / "calibration" / "three_gap_finger.yaml")
HINGE = str(ROOT / "configs" / "calibration" / "hinge_moment.csv")
PROGRAM = (sys.executable, "-c", "from dpgcli.__main__ import main; main()")
LOUD = "font.size: 30\nsavefig.bbox: tight\nsvg.fonttype: path\naxes.facecolor: red\n"
SVG = "{http://www.w3.org/2000/svg}"


def drawn(folder: Path, *arguments: str, **environment: str) -> "subprocess.CompletedProcess[str]":
    kept = {k: v for k, v in os.environ.items() if not k.startswith(("MPL", "MATPLOTLIB"))}
    return subprocess.run(
        [*PROGRAM, *arguments],
        cwd=folder,
        env={**kept, **environment},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """The figure that is drawn where nothing is set."""
    folder = tmp_path_factory.mktemp("plain")
    assert drawn(folder, "predict", "-q", SPEC, "--plot", "states.svg").returncode == 0
    return (folder / "states.svg").read_bytes()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("environment", "files"),
    [
        ({"MPLBACKEND": "module://matplotlib_inline.backend_inline"}, {}),
        ({"MPLBACKEND": "no_such_backend"}, {}),
        ({"MPLBACKEND": "qtagg"}, {}),
        ({}, {"matplotlibrc": LOUD}),
        ({}, {"matplotlibrc": "backend: nonsense\nno.such_key: 1\ntext.usetex: True\nno colon"}),
        ({"MATPLOTLIBRC": "own.rc"}, {"own.rc": LOUD}),
        ({"MATPLOTLIBRC": "no/such/file"}, {}),
        ({"MPLCONFIGDIR": "own"}, {"own/matplotlibrc": LOUD, "own/stylelib/x.mplstyle": "no: 1"}),
        ({"MPLCONFIGDIR": "/proc/no_such_folder", "HOME": "/proc/no_such_home"}, {}),
    ],
)
def test_figures_are_the_same_whatever_is_set(
    tmp_path: Path, plain: bytes, environment: dict[str, str], files: dict[str, str]
) -> None:
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    done = drawn(tmp_path, "predict", "-q", SPEC, "--plot", "states.svg", **environment)
    assert (done.returncode, done.stderr) == (0, "")
    assert (tmp_path / "states.svg").read_bytes() == plain


@pytest.mark.slow
@pytest.mark.parametrize(
    "arguments",
    [
        ("predict", "-q", SPEC, "--overlay", "--plot"),
        ("compare", "-q", FITTED, DATA, "--plot"),
        ("fit", "hinge", HINGE, "-q", "--plot"),
        ("fit", "finger", FITTED, DATA, "-q", "--plot"),
    ],
)
def test_so_are_those_of_other_commands(tmp_path: Path, arguments: tuple[str, ...]) -> None:
    contents = []
    for name, text in (("one.svg", ""), ("other.svg", LOUD)):
        (tmp_path / "matplotlibrc").write_text(text)
        done = drawn(tmp_path, *arguments, name, MPLBACKEND="no_such_backend")
        assert done.returncode == 0, done.stderr
        assert "matplotlib" not in done.stderr
        contents.append((tmp_path / name).read_bytes())
    assert contents[0] == contents[1]


@pytest.mark.slow
def test_so_are_those_of_reports(tmp_path: Path) -> None:
    sweep = f"base: {SPEC}\nspace: [{{key: finger.geometry.dome_height_mm, values: [6, 6.5, 7]}}]"
    (tmp_path / "sweep.yaml").write_text(sweep)
    swept = drawn(tmp_path, "sweep", "sweep.yaml", "--output", "out", "--executor", "serial", "-q")
    assert swept.returncode == 0, swept.stderr
    pages = []
    for name, text in (("one.html", ""), ("other.html", LOUD)):
        (tmp_path / "matplotlibrc").write_text(text)
        done = drawn(tmp_path, "report", "out", "-o", name, MPLBACKEND="no_such_backend")
        assert (done.returncode, "<svg" in (tmp_path / name).read_text()) == (0, True)
        pages.append((tmp_path / name).read_text())
    figures = [page[page.index("<svg") : page.index("</svg>")] for page in pages]
    assert figures[0] == figures[1]


def test_settings_that_cannot_be_read_are_a_message(tmp_path: Path) -> None:
    (tmp_path / "matplotlibrc").write_bytes(b"# caf\xe9\n")
    done = drawn(tmp_path, "predict", "-q", SPEC, "--plot", "states.svg")
    assert done.returncode == 2
    assert "matplotlibrc" in done.stderr and "Traceback" not in done.stderr


@pytest.mark.slow
def test_a_notebook_keeps_its_settings(tmp_path: Path) -> None:
    """Also those of the plots that it draws later, and its backend."""
    states = dpg.predict(SPEC)
    states.draw(tmp_path / "plain.svg")
    with rc_context({"font.size": 31.0, "svg.fonttype": "path", "lines.linewidth": 9.0}):
        states.draw(tmp_path / "loud.svg")
        assert rcParams["font.size"] == 31.0
    assert (tmp_path / "loud.svg").read_bytes() == (tmp_path / "plain.svg").read_bytes()
    said = (
        f"import dpgcli as dpg; dpg.predict({SPEC!r}).draw('s.svg');"
        "import matplotlib, os; print(matplotlib.rcParams['backend'], os.environ['MPLBACKEND'])"
    )
    done = subprocess.run(
        [sys.executable, "-c", said],
        cwd=tmp_path,
        env={**os.environ, "MPLBACKEND": "svg"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout == "svg svg\n"


def test_a_figure_has_words_for_those_who_do_not_see_it(tmp_path: Path) -> None:
    states = dpg.predict(SPEC)
    states.draw(tmp_path / "states.svg")
    root = ET.parse(tmp_path / "states.svg").getroot()
    assert root.get("role") == "img"
    title, description = (root.findtext(f"{SVG}{name}") for name in ("title", "desc"))
    assert title == "States of a finger of 3 units"
    lines = (description or "").splitlines()
    assert len(lines) == 8
    tip = states.table["tip_x_mm"][5], states.table["tip_y_mm"][5]
    assert f"101: tip at x {tip[0]:.6g} mm, y {tip[1]:.6g} mm" in lines
    states.draw(tmp_path / "states.png")
    with Image.open(tmp_path / "states.png") as image:
        said: dict[str, Any] = dict(image.info)
    assert (said["Title"], said["Description"]) == (title, description)


@pytest.mark.parametrize("suffix", [".svg", ".png"])
def test_a_figure_is_known_again_whatever_it_is_called(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a{suffix}"
    for _ in range(2):
        with figure_to(path, 2.0, 2.0, "&" * 100, "<b>\n\x1b[2J\u4e2d" * 1000) as figure:
            figure.add_subplot().set_title("中")  # in no font of Matplotlib's
        assert is_own(path, Mark.FIGURE)
    if suffix == ".svg":
        root = ET.parse(path).getroot()
        assert root.findtext(f"{SVG}title") == "&" * 100
        assert "\x1b" not in path.read_text(encoding="utf-8")
