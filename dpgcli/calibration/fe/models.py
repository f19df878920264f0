"""The models: their decks, and the curves that their runs give."""

import hashlib
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from dpgcli.arrays import Array
from dpgcli.calibration.fe.cards import UNITS
from dpgcli.calibration.fe.curves import (
    Curve,
    dome_curve,
    dome_finding,
    hinge_curve,
    hinge_finding,
    unit_curve,
    unit_finding,
)
from dpgcli.calibration.fe.decks import (
    dome_deck,
    dome_words,
    hinge_deck,
    hinge_words,
    pulse,
    pulse_words,
)
from dpgcli.calibration.fe.dome import DomeShape, dome_mesh
from dpgcli.calibration.fe.finger import (
    finger_finding,
    finger_states,
    frame_words,
    in_gray_order,
)
from dpgcli.calibration.fe.hinge import HingeChambers, chamber_bricks
from dpgcli.calibration.fe.pushed import MeshCells, Push, pushed_bricks
from dpgcli.calibration.fe.pushed_deck import DeckStep, pushed_deck, pushed_words
from dpgcli.design.geometry import snap_pressure
from dpgcli.errors import SolverError
from dpgcli.records import dataclass

DOME_CELLS = {"coarse": (20, 3, 1), "medium": (28, 4, 2), "fine": (56, 8, 4)}
"""Cells along the cap, along the annulus and through the wall."""

CHAMBER_CELLS = {"coarse": 1, "medium": 2, "fine": 4}
"""Cells along a gap and half a chamber; twice as many across."""

PUSHED_CELLS = {
    "coarse": MeshCells(chamber=2, gap=1, up=(1, 1, 1, 1), across=(1, 2)),
    "medium": MeshCells(chamber=4, gap=2, up=(2, 1, 1, 2), across=(1, 3)),
    "fine": MeshCells(chamber=8, gap=4, up=(4, 2, 2, 4), across=(2, 6)),
}
"""Cells of chambers under pushes; the medium ones are those of unit_moment.csv."""

SHARES = (0.5, 1.0, -0.5, -1.0)
"""End couples of a unit over the largest one, ground and inverted."""

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


def hinge_model(chambers: HingeChambers, fineness: str, largest_moment: float) -> Model:
    """Two chambers under a moment (N mm) on a mesh of CHAMBER_CELLS."""
    mesh = chamber_bricks(chambers, CHAMBER_CELLS[fineness])
    size = _size(fineness, len(mesh.elements), "C3D20R", len(mesh.nodes))
    words = (*hinge_words(chambers, largest_moment), size, UNITS)

    def outcome(time: Array, moved: Array) -> RunOutcome:
        curve = hinge_curve(chambers, mesh, largest_moment, time, moved)
        return RunOutcome(curve, hinge_finding(curve))

    deck = hinge_deck(chambers, mesh, largest_moment, ("dpg fe hinge", *words))
    return Model("hinge", deck, words, len(mesh.nodes), 1.0, outcome)


def unit_model(
    chambers: HingeChambers,
    push: Push,
    fineness: str,
    largest_moment: float,
    shares: Sequence[float] = SHARES,
) -> Model:
    """A gap on the ground and pushed open, at rest and under end couples up to a moment (N mm)."""
    mesh = pushed_bricks(chambers, PUSHED_CELLS[fineness], 2)
    moments = [share * largest_moment for share in shares]
    steps = (
        *(DeckStep((False,), moment) for moment in moments),
        *(DeckStep((True,), moment) for moment in (0.0, *moments)),
    )
    size = _size(fineness, len(mesh.elements), "C3D20R", len(mesh.nodes))
    words = (
        *pushed_words(chambers, push, 2),
        f"Forces that keep their direction bend the second chamber's end with up to "
        f"{largest_moment:g} N mm; positive moments open the gap.",
        "A moment is that of the forces at rest: it wanes as the cosine of chamber2_angle_rad.",
        size,
        UNITS,
    )

    def outcome(time: Array, moved: Array) -> RunOutcome:
        _check_states(len(time), len(steps))
        curve = unit_curve(chambers, mesh, push, steps, moved)
        return RunOutcome(curve, unit_finding(chambers, curve))

    deck = pushed_deck(chambers, mesh, push, steps, ("dpg fe unit", *words))
    return Model("unit", deck, words, len(mesh.nodes), float(len(steps)), outcome)


def finger_model(
    chambers: HingeChambers, push: Push, fineness: str, patterns: Sequence[tuple[bool, ...]]
) -> Model:
    """Chambers on their layer in states, each a pattern of gaps that are pushed open.

    At least one gap of one pattern is. One state follows the other by few changes.
    """
    n_chambers = len(patterns[0]) + 1
    mesh = pushed_bricks(chambers, PUSHED_CELLS[fineness], n_chambers)
    steps = [DeckStep(pattern) for pattern in in_gray_order(patterns)]
    at_rest = [step for step in steps if not any(step.pattern)]
    pushed = [step for step in steps if any(step.pattern)]
    size = _size(fineness, len(mesh.elements), "C3D20R", len(mesh.nodes))
    words = (*pushed_words(chambers, push, n_chambers), *frame_words(chambers), size, UNITS)

    def outcome(time: Array, moved: Array) -> RunOutcome:
        _check_states(len(time), len(pushed))
        moved = np.concatenate([np.zeros((len(at_rest), *moved.shape[1:])), moved])
        states = finger_states(chambers, mesh, push, [*at_rest, *pushed], moved)
        return RunOutcome(states, finger_finding(states))

    deck = pushed_deck(chambers, mesh, push, pushed, ("dpg fe finger", *words))
    return Model("finger", deck, words, len(mesh.nodes), float(len(pushed)), outcome)


def _check_states(found: int, expected: int) -> None:
    if found != expected:
        raise SolverError(f"ccx wrote {found} states of {expected}")


def _size(fineness: str, n_elements: int, kind: str, n_nodes: int) -> str:
    return f"Mesh {fineness}: {n_elements} elements {kind}, {n_nodes} nodes."
