"""Decks for CalculiX as text; the same input gives the same bytes. Units: mm, N, MPa, t, s."""

from collections.abc import Iterator, Sequence

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
from dpgcli.calibration.fe.dome import DomeMesh, DomeShape
from dpgcli.calibration.fe.energy import moduli
from dpgcli.calibration.fe.hinge import HingeChambers, couple, layer_end, on_plane
from dpgcli.design.geometry import WALL_THICKNESS
from dpgcli.records import dataclass

DENSITY = 1.2e-9
"""Density in t/mm^3, that of silicones. It only sets the clock: see `pulse`."""

RAMP, HOLD, RELEASE = 190.0, 35.0, 85.0
LARGEST_INCREMENT, SMALLEST_INCREMENT = 3.5, 1e-6
"""Times of the dynamic run in periods of the dome; it snaps and rings within a few of them."""

MOMENT_STEPS = 5


@dataclass(frozen=True)
class PressurePulse:
    """Pressure over time: up to the peak (MPa), a while there, down to zero; a period is in s."""

    peak: float
    period: float

    @property
    def corners(self) -> tuple[float, ...]:
        """Times in s at the ends of ramp, hold and release, in the digits that are printed."""
        ends = np.cumsum([RAMP, HOLD, RELEASE]) * self.period
        return tuple(float(f"{end:.7g}") for end in ends)

    def pressure(self, time: Array) -> Array:
        """Pressure in MPa at times in s.

        >>> PressurePulse(peak=2.0, period=1.0).pressure(np.array([95.0, 200.0, 310.0])).tolist()
        [1.0, 2.0, 0.0]
        """
        return np.interp(time, (0.0, *self.corners), (0.0, self.peak, self.peak, 0.0))


def pulse(dome: DomeShape, peak: float) -> PressurePulse:
    """A pulse slow beside the dome's vibrations, whose periods go as a^2/t sqrt(rho/E)."""
    radius = dome.base_diameter / 2
    speed = np.sqrt(dome.elastic_modulus / DENSITY)
    return PressurePulse(peak, float(radius**2 / (dome.thickness * speed)))


def dome_deck(dome: DomeShape, mesh: DomeMesh, loading: PressurePulse, words: Sequence[str]) -> str:
    """The deck of a dome that pressure on its convex side inverts: implicit dynamics.

    `words` become its comments.
    """
    nodes = np.column_stack([mesh.nodes, np.zeros(len(mesh.nodes))])
    shear, bulk = moduli(dome.elastic_modulus, dome.poisson)
    lines = [
        *(f"** {line}" for line in words),
        *mesh_lines(nodes, mesh.elements, "CAX8R"),
        *set_lines("*ELSET, ELSET=LOADED", mesh.loaded),
        *set_lines("*NSET, NSET=FIXED", mesh.fixed),
        *set_lines("*NSET, NSET=AXIS", mesh.axis),
        "*MATERIAL, NAME=RUBBER",
        "*HYPERELASTIC, NEO HOOKE",
        f"{digits(shear / 2)}, {digits(2 / bulk)}",
        "*DENSITY",
        digits(DENSITY),
        "*SOLID SECTION, ELSET=BODY, MATERIAL=RUBBER",
        "*BOUNDARY",
        "FIXED, 1, 2",
        "AXIS, 1, 1",
        "*AMPLITUDE, NAME=PULSE, TIME=TOTAL TIME",
        *_pulse_lines(loading),
    ]
    for duration in np.diff((0.0, *loading.corners)):
        lines += _dynamic_step(duration, loading.period)
    return "\n".join(lines) + "\n"


def dome_words(dome: DomeShape) -> tuple[str, ...]:
    """A description of a dome's model in words."""
    return (
        f"Axisymmetric dome: a spherical cap of mid-surface height {dome.height:g} mm over a base "
        f"of diameter {dome.base_diameter:g} mm,",
        f"{dome.thickness:g} mm thick, mitered to a flat annulus that is fixed at "
        f"r = {dome.rim_radius:g} mm.",
        f"Neo-Hookean, E = {dome.elastic_modulus:g} MPa, nu = {dome.poisson:g} (small strain); "
        "reduced integration.",
    )


def pulse_words(loading: PressurePulse) -> tuple[str, ...]:
    """A description of a dome's loading in words."""
    ramp, hold, release = np.diff((0.0, *loading.corners))
    return (
        "Pressure on the whole convex side, dome and annulus; implicit dynamics, alpha = -0.3, "
        f"density {DENSITY:g} t/mm^3:",
        f"{loading.peak:g} MPa within {ramp:.4g} s, held for {hold:.4g} s, "
        f"down to zero within {release:.4g} s.",
    )


def hinge_deck(
    chambers: HingeChambers, mesh: Bricks, largest_moment: float, words: Sequence[str]
) -> str:
    """The deck of two chambers that a moment turns against each other: statics.

    `words` become its comments.
    """
    step = digits(1 / MOMENT_STEPS)
    lines = [
        *(f"** {line}" for line in words),
        *mesh_lines(mesh.nodes, mesh.elements, "C3D20R"),
        *set_lines("*NSET, NSET=FIXED", np.flatnonzero(layer_end(chambers, mesh, 0.0))),
        *set_lines("*NSET, NSET=SYMMETRY", np.flatnonzero(on_plane(mesh, 2, 0.0))),
        *elastic_lines(chambers.elastic_modulus, chambers.poisson),
        "*BOUNDARY",
        "FIXED, 1, 3",
        "SYMMETRY, 3, 3",
        "*STEP, NLGEOM, INC=1000",
        "*STATIC",
        f"{step}, 1, 1e-6, {step}",
        *force_lines(couple(chambers, mesh), largest_moment),
        *END_OF_STEP,
    ]
    return "\n".join(lines) + "\n"


def hinge_words(chambers: HingeChambers, largest_moment: float) -> tuple[str, ...]:
    """A description of a hinge's model in words."""
    return (
        "2 hollow chambers on a limiting layer, half of them (z = 0 is a plane of "
        f"symmetry): inner length {chambers.length:g} mm,",
        f"inner width and height {chambers.width:g} mm, walls {WALL_THICKNESS:g} mm, "
        f"flat lid {chambers.lid_thickness:g} mm in the dome's place,",
        f"gap {chambers.separation:g} mm, layer {chambers.layer_thickness:g} mm.",
        f"St Venant-Kirchhoff, E = {chambers.elastic_modulus:g} MPa, nu = {chambers.poisson:g}; "
        "reduced integration, large displacements.",
        "The layer's end is clamped at x = 0; forces that keep their direction bend its other end "
        f"with a moment of up to {largest_moment:g} N mm.",
    )


def _pulse_lines(loading: PressurePulse) -> Iterator[str]:
    times = (0.0, *loading.corners)
    for time, pressure in zip(times, loading.pressure(np.array(times)), strict=True):
        yield f"{digits(time)}, {digits(pressure)}"


def _dynamic_step(duration: float, period: float) -> list[str]:
    largest, smallest = LARGEST_INCREMENT * period, SMALLEST_INCREMENT * period
    return [
        "*STEP, NLGEOM, INC=100000",
        "*DYNAMIC, ALPHA=-0.3",
        ", ".join(map(digits, (largest, duration, smallest, largest))),
        "*DLOAD, AMPLITUDE=PULSE",
        "LOADED, P2, 1",
        *END_OF_STEP,
    ]
