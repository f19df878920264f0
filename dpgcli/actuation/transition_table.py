"""The table of transitions: a row for each stable state, line and sign."""

import numpy as np

from dpgcli.actuation.tables import TIE, numbered
from dpgcli.actuation.transitions import Departure, Transitions
from dpgcli.arrays import Codes, Columns
from dpgcli.design.outputs import Output
from dpgcli.design.pressure import Pressure
from dpgcli.states.columns import Column, Kind
from dpgcli.states.patterns import inverted_units, texts

COLUMNS = (
    Column("pattern", "", "stable state, unit 1 first", kind=Kind.PATTERN),
    Column("line", "", "pressure line that changes, the others at zero", kind=Kind.TEXT),
    Column("direction", "", "+ where its pressure rises, - where it falls", kind=Kind.TEXT),
    Column(
        "pressure_MPa",
        "MPa",
        "pressure at which the state is left; none where it is not: see note",
        outputs=(Output.PRESSURES,),
    ),
    Column("unit", "", "units that flip, the one that gives rise to it first", kind=Kind.TEXT),
    Column("reached_at_pressure", "", "pattern at that pressure", kind=Kind.PATTERN),
    Column("pattern_after", "", "pattern once the pressure is let go", kind=Kind.PATTERN),
    TIE,
    Column("note", "", "why there is no pressure, or no state after it", kind=Kind.TEXT),
)
DIRECTIONS = {1: "+", -1: "-"}


def transition_rows(found: Transitions, pressure: Pressure) -> Columns:
    """Transitions by column, of the lines of a finger."""
    n_units = len(pressure.line_of)
    flips = (found.outcome == Departure.LEAVES) | (found.outcome == Departure.ASTRAY)
    rests = found.outcome == Departure.LEAVES
    return {
        "pattern": _patterns(found.code, n_units),
        "line": np.array(pressure.lines)[found.line],
        "direction": np.array([DIRECTIONS[sign] for sign in found.sign.tolist()], "U1"),
        "pressure_MPa": np.where(flips, found.pressure, np.nan),
        "unit": _units(found.unit, found.flipped, n_units),
        "reached_at_pressure": np.where(flips, _patterns(found.reached, n_units), b""),
        "pattern_after": np.where(rests, _patterns(found.after, n_units), b""),
        "tie": _units(np.full(len(found.code), -1), found.tied, n_units),
        "note": _notes(found),
    }


def _patterns(codes: Codes, n_units: int) -> np.ndarray[tuple[int], np.dtype[np.bytes_]]:
    return texts(inverted_units(codes, n_units))


def _units(
    first: np.ndarray[tuple[int], np.dtype[np.int64]], codes: Codes, n_units: int
) -> np.ndarray[tuple[int], np.dtype[np.str_]]:
    """Units of codes in words, `first` before the others."""
    words: dict[tuple[int, int], str] = {}
    pairs = list(zip(first.tolist(), codes.tolist(), strict=True))
    for unit, code in set(pairs):
        others = [k for k in range(n_units) if code >> (n_units - 1 - k) & 1 and k != unit]
        words[unit, code] = numbered(([unit] if unit >= 0 else []) + others)
    return np.array([words[pair] for pair in pairs], np.str_)


def _notes(found: Transitions) -> np.ndarray[tuple[int], np.dtype[np.str_]]:
    ends = zip(found.outcome.tolist(), found.pressure.tolist(), strict=True)
    return np.array([Departure(code).text(pressure) for code, pressure in ends], np.str_)
