"""A landscape as a table: states and the saddles between them, in the order of the way."""

import numpy as np

from dpgcli.arrays import Array, Columns
from dpgcli.design.outputs import Output
from dpgcli.states.certify import Status
from dpgcli.states.columns import Column, Kind
from dpgcli.states.landscape import Landscape
from dpgcli.states.patterns import texts
from dpgcli.states.saddles import SaddleStatus

COLUMNS = (
    Column("step", "", "flips up to here, this one included", kind=Kind.COUNT),
    Column("pattern", "", "activation pattern; of a saddle with ? where it flips", kind=Kind.TEXT),
    Column("kind", "", "state or saddle", kind=Kind.TEXT),
    Column("unit", "", "unit that flips in this step, 0 at the start", kind=Kind.COUNT),
    Column("energy_mJ", "mJ", "potential energy", outputs=(Output.ENERGIES,)),
    Column("barrier_mJ", "mJ", "from the state before to the saddle", outputs=(Output.BARRIERS,)),
    Column("tip_x_mm", "mm", "x of the tip", outputs=(Output.SHAPES,)),
    Column("tip_y_mm", "mm", "y of the tip", outputs=(Output.SHAPES,)),
    Column("status", "", "of a state stable or marginal, of a saddle certified", kind=Kind.TEXT),
)


def landscape_rows(landscape: Landscape) -> Columns:
    """Rows by column: the first state, then for each flip its saddle and the state behind it."""
    flips, at = landscape.flips, landscape.saddles
    n = len(flips.unit)
    step = np.arange(1, n + 1)
    system = landscape.states.potential.coordinates
    states = system.tip(landscape.states.equilibrium.coordinates)[0]
    passes = flips.potential.coordinates.tip(at.coordinates)[0] if n else np.zeros((3, 0))
    status = np.array([s.text for s in Status])[landscape.states.status]
    over = np.array([s.text for s in SaddleStatus])[at.status]
    unit = flips.unit + 1
    nothing = np.full(n + 1, np.nan)
    columns = {
        "step": (np.arange(n + 1), step),
        "pattern": (texts(landscape.states.inverted).astype(str), landscape.saddle_names),
        "kind": (np.full(n + 1, "state"), np.full(n, "saddle")),
        "unit": (np.concatenate(([0], unit)), unit),
        "energy_mJ": (landscape.energy, at.energy),
        "barrier_mJ": (nothing, landscape.barrier),
        "tip_x_mm": (states[0], passes[0]),
        "tip_y_mm": (states[1], passes[1]),
        "status": (status, over),
    }
    return {name: _alternating(*both) for name, both in columns.items()}


def _alternating(states: Array, saddles: Array) -> Array:
    """The values of states with those of the saddles between them."""
    values = np.empty(len(states) + len(saddles), np.result_type(states, saddles))
    values[0::2], values[1::2] = states, saddles
    return values
