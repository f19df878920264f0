"""Predicted shapes with known tips over them."""

from pathlib import Path

from dpgcli.accuracy.comparison import Frame, KnownTips, compare
from dpgcli.files.output import whole_file
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.scene import Scene
from dpgcli.states.patterns import texts
from dpgcli.states.plan import Request
from dpgcli.states.predict import predict


def draw_comparison(finger: Finger, known: KnownTips, frame: Frame, name: str, path: Path) -> None:
    """Draw each state's limiting layer to its tip, and the known tip, to an SVG or PNG file."""
    import matplotlib as mpl
    from matplotlib import colormaps
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    tips = compare(finger, known, frame).predicted
    patterns = [text.decode() for text in texts(known.patterns)]
    request = Request(tuple(patterns), columns=("pattern", "status", "nodes"))
    rows = predict(Scene(finger, ()), request).arrays()
    place = {pattern: index for index, pattern in enumerate(rows["pattern"].tolist())}
    with mpl.rc_context({"svg.hashsalt": "dpg", "svg.fonttype": "none"}):
        figure = Figure(figsize=(9.0, 6.0), layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.add_subplot(xlabel="x (mm)", ylabel="y (mm)", aspect="equal", title=name)
        axes.grid(visible=True, alpha=0.25)
        for state, pattern in enumerate(patterns):
            row, (known_x, known_y) = place[pattern], known.position[:, state]
            color = colormaps["viridis"](0.85 * pattern.count("1") / finger.n_units)
            line = [
                [rows[f"B{i}_{axis}_mm"][row] + shift for i in range(finger.n_units + 1)]
                for axis, shift in zip("xy", frame.first_station, strict=True)
            ]
            axes.plot(
                [*line[0], tips[0, state]], [*line[1], tips[1, state]], color=color, marker="."
            )
            axes.plot(known_x, known_y, "x", color=color, ms=9, mew=2)
            axes.annotate(
                pattern, (known_x, known_y), textcoords="offset points", xytext=(7, 4), fontsize=8
            )
        axes.plot([], [], "k.-", label="predicted, to its tip")
        axes.plot([], [], "kx", ms=9, mew=2, label="known tip")
        axes.legend(frameon=False)
        kind = path.suffix.lower().removeprefix(".")
        metadata = {"Date": None} if kind == "svg" else {"Software": None}
        with whole_file(path) as temporary:
            figure.savefig(temporary, format=kind, dpi=150, metadata=metadata)
