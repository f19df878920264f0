"""The states of a finger of pushed chambers, as a table of known states."""

from collections.abc import Sequence

import numpy as np

from dpgcli.arrays import Array, Columns
from dpgcli.calibration.fe.bricks import Bricks
from dpgcli.calibration.fe.hinge import HingeChambers, on_plane
from dpgcli.calibration.fe.pushed import Push, floor_angle, opening
from dpgcli.calibration.fe.pushed_deck import DeckStep
from dpgcli.states.patterns import texts


def in_gray_order(patterns: Sequence[tuple[bool, ...]]) -> list[tuple[bool, ...]]:
    """Patterns so that one gap changes from each to the next, where all are there.

    >>> in_gray_order([(False, False), (False, True), (True, False), (True, True)])
    [(False, False), (False, True), (True, True), (True, False)]
    """
    return sorted(patterns, key=lambda pattern: (np.cumsum(pattern) % 2).tolist())


def finger_states(
    chambers: HingeChambers,
    mesh: Bricks,
    push: Push,
    steps: Sequence[DeckStep],
    displacements: Array,
) -> Columns:
    """States by pattern, first the gap nearest the clamp, from displacements (k, n, 3) in mm.

    The tip is the end of the layer's lower edge, angles are those of the floors of the chambers
    after the first, counterclockwise.
    """
    rows = sorted(range(len(steps)), key=lambda row: steps[row].pattern)
    moved = displacements[rows]
    is_pushed = np.array([steps[row].pattern for row in rows]).T
    gaps = range(len(is_pushed))
    openings = np.array([opening(chambers, mesh, push, moved, gap) for gap in gaps])
    pushes = np.where(is_pushed, push.stiffness * (push.stroke - openings), 0.0)
    end = (
        on_plane(mesh, 0, mesh.nodes[:, 0].max()) & on_plane(mesh, 1, 0.0) & on_plane(mesh, 2, 0.0)
    )
    tip = (mesh.nodes + moved)[:, end, :2][:, 0]
    return {
        "pattern": texts(is_pushed).astype(str),
        "tip_x_mm": tip[:, 0],
        "tip_y_mm": tip[:, 1],
        **{
            f"chamber{gap + 2}_angle_rad": floor_angle(chambers, mesh, moved, gap + 1)
            for gap in gaps
        },
        **{f"opening{gap + 1}_mm": openings[gap] for gap in gaps},
        **{f"push{gap + 1}_N": pushes[gap] for gap in gaps},
    }


def with_seconds(states: Columns, seconds: float) -> Columns:
    """States with the seconds that each took, in equal shares; the one at rest comes with them."""
    count = len(states["pattern"])
    return states | {"seconds": np.full(count, seconds / count)}


def frame_words(chambers: HingeChambers) -> tuple[str, ...]:
    """Where the lattice's stations lie in these states: at mid-chamber, on the layer's middle."""
    along, up = chambers.outer_length / 2, chambers.layer_thickness / 2
    return (f"first_station_mm: {along:g}, {up:g}", f"tip_offset_mm: {along:g}, {-up:g}")


def finger_finding(states: Columns) -> str:
    """How many states, and where the tip comes to with most gaps open, in one line."""
    patterns = states["pattern"].tolist()
    most = max(range(len(patterns)), key=lambda row: patterns[row].count("1"))
    x, y = (float(states[name][most]) for name in ("tip_x_mm", "tip_y_mm"))
    plural = "s" * (len(patterns) > 1)
    return f"{len(patterns)} state{plural}; tip of {patterns[most]}: {x:.5g}, {y:.5g} mm."
