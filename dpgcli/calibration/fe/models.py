"""The two models: their decks, and the curves that their runs give."""

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from dpgcli.arrays import Array
from dpgcli.calibration.fe.curves import (
    Curve,
    dome_curve,
    dome_finding,
    hinge_curve,
    hinge_finding,
)
from dpgcli.calibration.fe.decks import (
    UNITS,
    dome_deck,
    dome_words,
    hinge_deck,
    hinge_words,
    pulse,
    pulse_words,
)
from dpgcli.calibration.fe.dome import DomeShape, dome_mesh
from dpgcli.calibration.fe.hinge import Chambers, chamber_bricks
from dpgcli.design.geometry import snap_pressure

DOME_CELLS = {"coarse": (20, 3, 1), "medium": (28, 4, 2), "fine": (56, 8, 4)}
"""Cells along the cap, along the annulus and through the wall."""

CHAMBER_CELLS = {"coarse": 1, "medium": 2, "fine": 4}
"""Cells along a gap and half a chamber; twice as many across."""

PEAK_OVER_SNAP = 1.25
"""How far the pressure goes beyond the one that is expected to invert the dome."""


class RunOutcome(NamedTuple):
    """The curve of a run, and its finding in one line."""

    curve: Curve
    finding: str


@dataclass(frozen=True)
class Model:
    """A deck, its description in words, and the curve by times and displacements of a run.

    A run is complete if it gets to the time `end`.
    """

    name: str
    deck: str
    words: tuple[str, ...]
    n_nodes: int
    end: float
    outcome: Callable[[Array, Array], RunOutcome]

    def comments(self, version: str, finding: str) -> tuple[str, ...]:
        """The comments above a curve: solver, model, hash of the deck, finding."""
        digest = hashlib.sha256(self.deck.encode()).hexdigest()
        return (
            f"dpg fe {self.name}: a simulation with finite elements, CalculiX {version}",
            *self.words,
            f"Deck: {self.name}.inp, SHA-256 {digest}",
            finding,
        )


def expected_peak(dome: DomeShape) -> float:
    """A pressure in MPa beyond the snap of most domes: 1.25 times the scaled snap pressure."""
    expected = snap_pressure(dome.height, dome.thickness, dome.elastic_modulus)
    return PEAK_OVER_SNAP * expected


def dome_model(dome: DomeShape, fineness: str, peak: float) -> Model:
    """A dome under a pulse of pressure (MPa) on a mesh of DOME_CELLS."""
    mesh = dome_mesh(dome, *DOME_CELLS[fineness])
    loading = pulse(dome, peak)
    size = _size(fineness, len(mesh.elements), "CAX8R", len(mesh.nodes))
    words = (*dome_words(dome), *pulse_words(loading), size, UNITS)

    def outcome(time: Array, moved: Array) -> RunOutcome:
        curve = dome_curve(dome, mesh, loading, time, moved)
        return RunOutcome(curve, dome_finding(dome, curve))

    deck = dome_deck(dome, mesh, loading, ("dpg fe dome", *words))
    return Model("dome", deck, words, len(mesh.nodes), loading.corners[-1], outcome)


def hinge_model(chambers: Chambers, fineness: str, largest_moment: float) -> Model:
    """Two chambers under a moment (N mm) on a mesh of CHAMBER_CELLS."""
    mesh = chamber_bricks(chambers, CHAMBER_CELLS[fineness])
    size = _size(fineness, len(mesh.elements), "C3D20R", len(mesh.nodes))
    words = (*hinge_words(chambers, largest_moment), size, UNITS)

    def outcome(time: Array, moved: Array) -> RunOutcome:
        curve = hinge_curve(chambers, mesh, largest_moment, time, moved)
        return RunOutcome(curve, hinge_finding(curve))

    deck = hinge_deck(chambers, mesh, largest_moment, ("dpg fe hinge", *words))
    return Model("hinge", deck, words, len(mesh.nodes), 1.0, outcome)


def _size(fineness: str, n_elements: int, kind: str, n_nodes: int) -> str:
    return f"Mesh {fineness}: {n_elements} elements {kind}, {n_nodes} nodes."
