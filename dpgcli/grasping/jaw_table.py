"""Jaws between fingers as tables: what each state bears, and its force by the aperture."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dpgcli.arrays import Columns
from dpgcli.design.outputs import Output
from dpgcli.grasping.jaws import Halt, JawPath
from dpgcli.states.certify import Status
from dpgcli.states.columns import Column, Kind
from dpgcli.states.patterns import inverted_units, texts

FORCES = (Output.FORCES,)
BEARS = 1e-9  # N: a smaller squeeze is no touch

COLUMNS = (
    Column("pattern", "", "state of both fingers", kind=Kind.TEXT),
    Column("status", "", "result of certification, at the first aperture", kind=Kind.STATUS),
    Column("n_inverted", "", "units inverted", kind=Kind.COUNT),
    Column("touch_mm", "mm", "smallest aperture looked at that the fingers touch"),
    Column("stiffness_N_per_mm", "N/mm", "slope of the squeeze there", outputs=FORCES),
    Column("largest_squeeze_N", "N", "largest while no unit resets", outputs=FORCES),
    Column("largest_at_mm", "mm", "aperture of that"),
    Column("resets", "", "units that left their wells, at which aperture", kind=Kind.TEXT),
)
PATH_COLUMNS = (
    Column("pattern", "", "state at the beginning", kind=Kind.TEXT),
    Column("step", "", "number of the aperture on the way", kind=Kind.COUNT),
    Column("jaw_gap_mm", "mm", "aperture of the jaws"),
    Column("pattern_now", "", "state there", kind=Kind.TEXT),
    Column("squeeze_N", "N", "closing force between the two fingers", outputs=FORCES),
    Column("stiffness_N_per_mm", "N/mm", "its slope by the aperture", outputs=FORCES),
)


def jaw_rows(path: JawPath, n_units: int) -> Columns:
    """What each state bears, by column, (lane,)."""
    lanes = range(len(path.codes))
    inverted = inverted_units(path.codes, n_units)
    way_out = len(path.gap) // 2 + 1
    touch, largest, at, stiffness = (np.full(len(path.codes), np.nan) for _ in range(4))
    for lane in lanes:
        halts = _of_lane(path, lane)
        stop = min((halt.step for halt in halts), default=way_out)
        squeeze = path.squeeze[: min(stop, way_out), lane]
        touching = np.flatnonzero(squeeze > BEARS)
        if len(touching):
            first, most = touching[0], np.nanargmax(squeeze)
            touch[lane], stiffness[lane] = path.gap[first], path.stiffness[first, lane]
            largest[lane], at[lane] = squeeze[most], path.gap[most]
        if halts and halts[0].step < way_out and not halts[0].squeeze < largest[lane]:
            largest[lane], at[lane] = halts[0].squeeze, halts[0].gap
    return {
        "pattern": texts(inverted).astype(str),
        "status": path.status,
        "n_inverted": inverted.sum(axis=0),
        "touch_mm": touch,
        "stiffness_N_per_mm": stiffness,
        "largest_squeeze_N": largest,
        "largest_at_mm": at,
        "resets": np.array([_said(_of_lane(path, lane)) for lane in lanes], str),
    }


def path_rows(path: JawPath, n_units: int) -> Columns:
    """Force by aperture, by column: state after state, step by step."""
    n_steps, n = path.squeeze.shape
    pattern = texts(inverted_units(path.codes, n_units)).astype(str)
    now = texts(inverted_units(path.code.T.ravel(), n_units)).astype(str)
    is_there = ~np.isnan(path.squeeze.T.ravel())
    return {
        "pattern": np.repeat(pattern, n_steps),
        "step": np.tile(np.arange(n_steps), n),
        "jaw_gap_mm": np.tile(path.gap, n),
        "pattern_now": np.where(is_there, now, ""),
        "squeeze_N": path.squeeze.T.ravel(),
        "stiffness_N_per_mm": path.stiffness.T.ravel(),
    }


def by_number(rows: Columns) -> list[tuple[int, int, float, float]]:
    """Inverted units, how many states bear anything, the least and the largest that these bear."""
    told = []
    bears = (rows["status"] == Status.STABLE) & ~np.isnan(rows["largest_squeeze_N"])
    for number in np.unique(rows["n_inverted"]):
        force = rows["largest_squeeze_N"][bears & (rows["n_inverted"] == number)]
        if len(force):
            told.append((int(number), len(force), float(force.min()), float(force.max())))
    return told


def _of_lane(path: JawPath, lane: int) -> list[Halt]:
    return [halt for halt in path.halts if halt.lane == lane]


def _said(halts: Sequence[Halt]) -> str:
    """Such as "1 at 42.31 mm; 2,3 at 55 mm"."""
    return "; ".join(f"{_units(halt.flipped)} at {halt.gap:.4g} mm" for halt in halts)


def _units(flipped: NDArray[np.bool_]) -> str:
    return ",".join(str(unit + 1) for unit in np.flatnonzero(flipped))
