"""Jaws between fingers as tables: what each state bears, and its force by the aperture."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dpgcli.arrays import Array, Columns, Flags, Indices
from dpgcli.design.outputs import Output
from dpgcli.grasping.jaws import Halt, JawPath
from dpgcli.states.certify import Status
from dpgcli.states.columns import Column, Kind
from dpgcli.states.patterns import inverted_units, texts

FORCES = (Output.FORCES,)
RESET, LAST = "reset", "last_aperture"  # why a way out ends, or the word of a status

COLUMNS = (
    Column("pattern", "", "state of both fingers", kind=Kind.TEXT),
    Column("status", "", "result of certification, at the first aperture", kind=Kind.STATUS),
    Column("n_inverted", "", "units inverted", kind=Kind.COUNT),
    Column("touch_mm", "mm", "smallest aperture looked at that the fingers touch"),
    Column("stiffness_N_per_mm", "N/mm", "slope of the squeeze there", outputs=FORCES),
    Column(
        "largest_squeeze_N",
        "N",
        "largest while no unit resets; at least that unless a reset ends the way",
        outputs=FORCES,
    ),
    Column("largest_at_mm", "mm", "aperture of that"),
    Column(
        "ended_by",
        "",
        "what ends the way out: a reset, the last aperture, or why no state is certified",
        kind=Kind.TEXT,
    ),
    Column("lost_mm", "mm", "aperture from which no state is certified, out or back"),
    Column("resets", "", "units that left their wells, at which aperture", kind=Kind.TEXT),
)
PATH_COLUMNS = (
    Column("pattern", "", "state at the beginning", kind=Kind.TEXT),
    Column("step", "", "number of the aperture on the way", kind=Kind.COUNT),
    Column("jaw_gap_mm", "mm", "aperture of the jaws"),
    Column("pattern_now", "", "state there", kind=Kind.TEXT),
    Column("status", "", "result of certification there", kind=Kind.STATUS),
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
        touching = np.flatnonzero(squeeze > 0.0)
        if len(touching):
            first, most = touching[0], np.nanargmax(squeeze)
            touch[lane], stiffness[lane] = path.gap[first], path.stiffness[first, lane]
            largest[lane], at[lane] = squeeze[most], path.gap[most]
        if halts and halts[0].step < way_out and not halts[0].squeeze < largest[lane]:
            largest[lane], at[lane] = halts[0].squeeze, halts[0].gap
    return {
        "pattern": texts(inverted).astype(str),
        "status": path.status[0],
        "n_inverted": inverted.sum(axis=0),
        "touch_mm": touch,
        "stiffness_N_per_mm": stiffness,
        "largest_squeeze_N": largest,
        "largest_at_mm": at,
        "ended_by": np.array([_ended_by(path, lane, way_out) for lane in lanes], str),
        "lost_mm": np.where(_are_lost(path), path.gap[_ends(path)], np.nan),
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
        "status": path.status.T.ravel(),
        "squeeze_N": path.squeeze.T.ravel(),
        "stiffness_N_per_mm": path.stiffness.T.ravel(),
    }


class Borne(NamedTuple):
    """What states with so many inverted units bear, N: exactly, or at least."""

    n_inverted: int
    exactly: Array
    at_least: Array


def by_number(rows: Columns) -> list[Borne]:
    """What those states bear that bear anything, by their number of inverted units."""
    told = []
    force, ends_by_reset = rows["largest_squeeze_N"], is_exact(rows)
    bears = (rows["status"] == Status.STABLE) & ~np.isnan(force)
    for number in np.unique(rows["n_inverted"][bears]):
        are_those = bears & (rows["n_inverted"] == number)
        exactly, at_least = (force[are_those & part] for part in (ends_by_reset, ~ends_by_reset))
        told.append(Borne(int(number), exactly, at_least))
    return told


def is_exact(rows: Columns) -> Flags:
    """Where the largest squeeze is what the state bears; others bear at least that."""
    return np.asarray(rows["ended_by"] == RESET)


def _are_lost(path: JawPath) -> Flags:
    """Lanes that begin in a certified state, and do not come back in one."""
    return np.asarray((path.status[0] == Status.STABLE) & (path.status[-1] != Status.STABLE))


def _ends(path: JawPath) -> Indices:
    """The first step of each lane without a certified state; 0 if there is none."""
    return np.asarray((path.status != Status.STABLE).argmax(axis=0))


def _ended_by(path: JawPath, lane: int, way_out: int) -> str:
    """What ends the way out of a lane."""
    if path.status[0, lane] != Status.STABLE:
        return ""
    if any(halt.step < way_out for halt in _of_lane(path, lane)):
        return RESET
    there = Status(path.status[way_out - 1, lane])
    return LAST if there is Status.STABLE else there.text


def _of_lane(path: JawPath, lane: int) -> list[Halt]:
    return [halt for halt in path.halts if halt.lane == lane]


def _said(halts: Sequence[Halt]) -> str:
    """Such as "1 at 42.31 mm; 2,3 at 55 mm"."""
    return "; ".join(f"{_units(halt.flipped)} at {halt.gap:.4g} mm" for halt in halts)


def _units(flipped: NDArray[np.bool_]) -> str:
    return ",".join(str(unit + 1) for unit in np.flatnonzero(flipped))
