"""What a page needs to draw any state of a design: sizes of its chambers, poses of its units."""

from collections.abc import Iterator, Sequence
from dataclasses import field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dpgcli.arrays import Indices
from dpgcli.records import dataclass
from dpgcli.reports.explorer.poses import StateTips, UnitPoses, are_composed, deviation, unit_poses
from dpgcli.reports.outlines import DEEPEST, DOME_WIDTH, GAP, Sizes

MOST_STATES = 2**20  # of all designs that are drawn
MOST_UNITS = 12  # of a design that is drawn
MOST_OTHERS = 64  # states of a design that are not stable
EXACT, SHOWN = 7, 5  # digits: of what states are composed of, and of what is drawn alone
NO_STATES = "No states are drawn: this design has none that is stable."
NOT_COMPOSED = (
    "No states are drawn: they are not composed of units by themselves, as where loads act or "
    "hinges turn each other, or a unit is not stable where it alone is inverted. `dpg predict` "
    "draws them."
)
NOT_HERE = "No states are drawn: this page has those of other designs only."
TOO_LONG = (
    f"No states are drawn: a page has those of up to {MOST_UNITS} units. `dpg predict` draws some."
)
NO_TABLE = "No states are drawn: there is no states.parquet of this sweep beside the table."
NO_BASE = "No states are drawn: the table does not say what its designs are made from."
NOTE = (
    "States are composed of units at rest and inverted ones, as the states with none and one "
    "inverted unit say. Over all states that this page draws, tips are at most {:.1g} mm from "
    "those of states.parquet, energies {:.1g} mJ"
)
SAME = {"dome_width": DOME_WIDTH, "deepest": DEEPEST, "least_length": GAP}


class DesignStates(NamedTuple):
    """All states of designs with equally many units: their rows, statuses (design, state), tips."""

    rows: Indices
    status: NDArray[Any]
    tips: StateTips
    sizes: Sizes


@dataclass
class Shapes:
    """Shapes by row of a table, as values of JSON; reasons for rows that have none."""

    otherwise: str
    notes: Sequence[str] = ()
    values: list[dict[str, Any]] = field(default_factory=list)
    others: dict[int, dict[int, str]] = field(default_factory=dict)
    places: dict[int, int] = field(default_factory=dict)
    reasons: dict[int, str] = field(default_factory=dict)
    off: tuple[float, float] = (0.0, 0.0)  # largest deviations of drawn states, mm and mJ

    def add(self, found: DesignStates) -> None:
        """Take in designs whose states are composed of units by themselves."""
        poses = unit_poses(found.tips, found.sizes.length.T)
        off = deviation(poses, found.tips)
        are_drawn = are_composed(poses, found.tips, off)
        are_drawn &= (found.status != "stable").sum(axis=1) <= MOST_OTHERS
        self.reasons |= dict.fromkeys(found.rows[~are_drawn].tolist(), NOT_COMPOSED)
        drawn = np.flatnonzero(are_drawn)
        tip, energy = (max(v[drawn], default=0.0) for v in (off.tip, off.energy))
        self.off = max(self.off[0], float(tip)), max(self.off[1], float(energy))
        for design, own in zip(drawn.tolist(), _values(found.sizes, poses, drawn), strict=True):
            self.places[int(found.rows[design])] = place = len(self.values)
            self.values.append(own)
            status = found.status[design]
            if others := np.flatnonzero(status != "stable").tolist():
                self.others[place] = {code: status[code].replace("_", " ") for code in others}

    def said(self, rows: Indices) -> dict[str, Any]:
        """For JSON, of some rows of the table."""
        reasons = [self.otherwise, *dict.fromkeys(self.reasons.values())]
        places = [
            self.places.get(row, -1 - reasons.index(self.reasons.get(row, self.otherwise)))
            for row in rows.tolist()
        ]
        names = self.values[0] if self.values else ()
        return {
            "places": places,
            "values": {name: [own[name] for own in self.values] for name in names},
            "others": self.others,
            "reasons": reasons,
            "note": "; ".join((NOTE.format(*self.off), *self.notes)),
            "same": SAME,
        }


def _values(sizes: Sizes, poses: UnitPoses, designs: Indices) -> Iterator[dict[str, Any]]:
    """Numbers of each design by name: one for all units where they are alike."""
    by_unit = {
        "length": (poses.length, EXACT),
        "along": (poses.offset.real, EXACT),
        "up": (poses.offset.imag, EXACT),
        "turn": (poses.turn, EXACT),
        "energy": (poses.energy, EXACT),
        "rest_energy": (poses.rest_energy, EXACT),
        "gap": (sizes.gap.T, SHOWN),
        "dome": (sizes.dome.T, SHOWN),
        "height": (sizes.height.T, SHOWN),
        "axis": (sizes.axis[:, None], SHOWN),
        "layer": (sizes.layer[:, None], SHOWN),
    }
    n_units = poses.length.shape[1]
    columns = [_alike(values[designs], digits) for values, digits in by_unit.values()]
    for row in zip(*columns, strict=True):
        yield {"units": n_units, **dict(zip(by_unit, row, strict=True))}


def _alike(values: NDArray[Any], digits: int) -> Iterator[Any]:
    for row in values.tolist():
        own = [rounded(value, digits) for value in row]
        yield own[0] if own.count(own[0]) == len(own) else own


def rounded(value: float, digits: int) -> float | None:
    """A number with so many digits, None for NaN.

    >>> rounded(0.123456, 3), rounded(float("nan"), 3)
    (0.123, None)
    """
    return None if value != value else float(f"{value:.{digits}g}")
