"""The deck of chambers that pushes open and an end couple bends, step by step; mm, N, MPa."""

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from dpgcli.arrays import Array
from dpgcli.calibration.fe.bricks import Bricks
from dpgcli.calibration.fe.cards import (
    END_OF_STEP,
    digits,
    elastic_lines,
    force_lines,
    mesh_lines,
    set_lines,
)
from dpgcli.calibration.fe.hinge import HingeChambers, end_couple, on_plane
from dpgcli.calibration.fe.pushed import End, Push, apex, clamped, loaded, patch
from dpgcli.design.geometry import WALL_THICKNESS
from dpgcli.records import dataclass

OFF, SLACK, ON = 0.0, 0.02, 1.0
"""Temperatures of a spring that is not there, that is as long as at rest, and that pushes. They are
no temperatures of the chambers, which do not expand. What opens the gap is the way from slack to
on, nearly all of a step; a spring of little stiffness would open it at once."""

LONGEST = 10.0
"""Largest elongation of a spring over its length at rest, where its table ends."""


@dataclass(frozen=True)
class DeckStep:
    """A state to go to: which gaps are pushed, and the end couple in N mm."""

    pattern: tuple[bool, ...]
    moment: float = 0.0


def pushed_deck(
    chambers: HingeChambers,
    mesh: Bricks,
    push: Push,
    steps: Sequence[DeckStep],
    words: Sequence[str],
) -> str:
    """The deck of chambers that go from state to state, one second each: statics.

    `words` become its comments.
    """
    gaps = range(len(steps[0].pattern))
    is_bent = any(step.moment for step in steps)
    forces = end_couple(mesh, loaded(mesh)) if is_bent else np.zeros(len(mesh.nodes))
    lines = [
        *(f"** {line}" for line in words),
        *mesh_lines(mesh.nodes, mesh.elements, "C3D20R"),
        *set_lines("*NSET, NSET=FIXED", np.flatnonzero(clamped(mesh))),
        *set_lines("*NSET, NSET=SYMMETRY", np.flatnonzero(on_plane(mesh, 2, 0.0))),
        *elastic_lines(chambers.elastic_modulus, chambers.poisson),
        *(line for gap in gaps for line in _spring_lines(chambers, mesh, push, gap)),
        *_law_lines(chambers, push),
        "*BOUNDARY",
        "FIXED, 1, 3",
        "SYMMETRY, 3, 3",
        "ENDS, 3, 3",
        "*INITIAL CONDITIONS, TYPE=TEMPERATURE",
        f"ALL, {digits(OFF)}",
        f"ENDS, {digits(OFF)}",
    ]
    for before, step in pairwise((DeckStep((False,) * len(gaps)), *steps)):
        lines += _step_lines(step, forces, is_snap=step.pattern != before.pattern)
    return "\n".join(lines) + "\n"


def pushed_words(chambers: HingeChambers, push: Push, n_chambers: int) -> tuple[str, ...]:
    """A description of pushed chambers in words."""
    length = chambers.separation + push.dome_height
    return (
        f"{n_chambers} hollow chambers on a limiting layer, half of them (z = 0 is a plane of "
        f"symmetry): inner length {chambers.length:g} mm,",
        f"inner width and height {chambers.width:g} mm, walls {WALL_THICKNESS:g} mm, "
        f"flat lid {chambers.lid_thickness:g} mm that bears the dome,",
        f"gap {chambers.separation:g} mm, layer {chambers.layer_thickness:g} mm.",
        f"St Venant-Kirchhoff, E = {chambers.elastic_modulus:g} MPa, nu = {chambers.poisson:g}; "
        "reduced integration, large displacements.",
        f"An inverted dome is a spring of {push.stiffness:g} N/mm and {length:g} mm, "
        f"{push.stroke:g} mm too long, on the dome's axis: from its apex,",
        f"{push.dome_height:g} mm behind the lid and moving with it, to the middle of a patch of "
        "the neighbor's wall.",
        "The first chamber's face at x = 0 is clamped.",
    )


def _spring_lines(chambers: HingeChambers, mesh: Bricks, push: Push, gap: int) -> Iterator[str]:
    """Apex, patch and the spring between them."""
    first = len(mesh.nodes) + 1 + 2 * gap
    ends = {first: apex(chambers, mesh, push, gap), first + 1: patch(chambers, mesh, gap)}
    yield "*NODE, NSET=ENDS"
    for node, end in ends.items():
        yield ", ".join([str(node), *map(digits, end.place)])
    yield "*ELEMENT, TYPE=SPRINGA, ELSET=PUSHES"
    yield f"{len(mesh.elements) + 1 + gap}, {first}, {first + 1}"
    yield f"*NSET, NSET=GAP{gap + 1}"
    yield f"{first}, {first + 1}"
    for node, end in ends.items():
        yield from _equation_lines(node, 1, end, -end.turns)
        yield from _equation_lines(node, 2, end, end.turns)


def _equation_lines(node: int, axis: int, end: End, turns: Array) -> Iterator[str]:
    """A displacement of an end by those of its nodes, along the same axis and the other one."""
    shifts = zip(end.nodes.tolist(), end.shifts.tolist(), strict=True)
    turned = zip(end.nodes.tolist(), turns.tolist(), strict=True)
    terms = [
        *((other + 1, axis, weight) for other, weight in shifts if weight),
        *((other + 1, 3 - axis, weight) for other, weight in turned if weight),
    ]
    yield "*EQUATION"
    yield str(len(terms) + 1)
    yield f"{node}, {axis}, -1"
    for other, along, weight in terms:
        yield f"{other}, {along}, {digits(weight)}"


def _law_lines(chambers: HingeChambers, push: Push) -> Iterator[str]:
    """Tables of force over elongation by temperature, linear between them; for half a spring."""
    length = chambers.separation + push.dome_height
    yield "*SPRING, ELSET=PUSHES, NONLINEAR"
    for temperature, stiffness, stroke in (
        (OFF, 0.0, 0.0),
        (SLACK, push.stiffness, 0.0),
        (ON, push.stiffness, push.stroke),
    ):
        for elongation in (-length, LONGEST * length):
            force = stiffness / 2 * (elongation - stroke)
            # reals with a point: CalculiX tells numbers of springs from degrees of freedom by it
            yield f"{force:.9f}, {elongation:.9f}, {temperature:.2f}"


def _step_lines(step: DeckStep, forces: Array, *, is_snap: bool) -> Iterator[str]:
    yield "*STEP, NLGEOM, INC=1000"
    yield "*STATIC"
    yield f"{0.25 if is_snap else 1}, 1, 1e-6, 1"
    yield "*TEMPERATURE"
    for gap, is_pushed in enumerate(step.pattern, start=1):
        yield f"GAP{gap}, {digits(ON if is_pushed else OFF)}"
    if forces.any():
        yield from force_lines(forces, step.moment)
    yield "*NODE PRINT, NSET=ALL, FREQUENCY=1000"
    yield from END_OF_STEP[1:]
