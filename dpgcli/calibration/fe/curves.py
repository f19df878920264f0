"""Curves for calibrations from displacements, and the text of their files."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dpgcli.arrays import Array, Columns
from dpgcli.calibration.fe.bricks import Bricks
from dpgcli.calibration.fe.decks import PressurePulse
from dpgcli.calibration.fe.dome import DomeMesh, DomeShape
from dpgcli.calibration.fe.energy import strain_energy, swept_volume
from dpgcli.calibration.fe.hinge import HingeChambers, chamber_turn, couple, moment
from dpgcli.calibration.fe.pushed import Push, floor_angle, lever, opening
from dpgcli.calibration.fe.pushed_deck import DeckStep
from dpgcli.errors import SolverError


class PressedDomeCurve(NamedTuple):
    """The way of a dome's pole towards inversion; the first row is the dome at rest."""

    pole_travel_mm: Array
    energy_mJ: Array
    pressure_MPa: Array
    volume_mm3: Array
    time_s: Array


class HingeCurve(NamedTuple):
    """Moments on a gap and the rotations by which it opens; the first row is at rest."""

    moment_N_mm: Array
    rotation_rad: Array


class UnitCurve(NamedTuple):
    """A unit on the ground and inverted, at rest and under end couples; by row.

    A moment is positive where it opens the gap, and angles fall then. It is that of the forces at
    rest: they keep their direction, so that it wanes as the cosine of `chamber2_angle_rad`.
    """

    unit: NDArray[np.str_]
    moment_N_mm: Array
    chamber1_angle_rad: Array
    chamber2_angle_rad: Array
    opening_mm: Array
    push_N: Array


Curve = PressedDomeCurve | HingeCurve | UnitCurve | Columns


def dome_curve(
    dome: DomeShape, mesh: DomeMesh, loading: PressurePulse, time: Array, displacements: Array
) -> PressedDomeCurve:
    """The curve of a dynamic run: times (k,) in s, displacements (k, n, 3) in mm."""
    time = np.concatenate([[0.0], time])
    moved = _from_rest(displacements)[..., :2]
    return PressedDomeCurve(
        pole_travel_mm=-moved[:, mesh.pole, 1] + 0.0,
        energy_mJ=strain_energy(dome, mesh, moved),
        pressure_MPa=loading.pressure(time),
        volume_mm3=swept_volume(mesh, moved),
        time_s=time,
    )


def hinge_curve(
    chambers: HingeChambers, mesh: Bricks, largest_moment: float, time: Array, displacements: Array
) -> HingeCurve:
    """The curve of a static run: shares (k,) of the load, displacements (k, n, 3) in mm."""
    share = np.concatenate([[0.0], time])
    moved = _from_rest(displacements)
    turns = [chamber_turn(chambers, mesh, moved, number) for number in (0, 1)]
    return HingeCurve(
        moment_N_mm=share * moment(mesh, largest_moment * couple(chambers, mesh), moved),
        rotation_rad=turns[1] - turns[0],
    )


def unit_curve(
    chambers: HingeChambers,
    mesh: Bricks,
    push: Push,
    steps: Sequence[DeckStep],
    displacements: Array,
) -> UnitCurve:
    """The curve of a unit from displacements (k, n, 3) in mm at the end of each step.

    The first row is the unit at rest.
    """
    moved = _from_rest(displacements)
    is_pushed = np.array([False, *(step.pattern[0] for step in steps)])
    opened = opening(chambers, mesh, push, moved, 0)
    return UnitCurve(
        unit=np.where(is_pushed, "inverted", "ground"),
        moment_N_mm=np.array([0.0, *(step.moment for step in steps)]),
        chamber1_angle_rad=floor_angle(chambers, mesh, moved, 0),
        chamber2_angle_rad=floor_angle(chambers, mesh, moved, 1),
        opening_mm=opened,
        push_N=np.where(is_pushed, push.stiffness * (push.stroke - opened), 0.0),
    )


class UnitStiffness(NamedTuple):
    """Hinge and walls of a unit: its opening in mm, push in N and rotation in rad without a moment;
    k_theta in N mm/rad by the push and by the moments on the ground; c_w in mm/N."""

    opening: float
    push: float
    rotation: float
    by_push: float
    ground: float
    walls: float


def unit_stiffness(curve: UnitCurve, lever: float) -> UnitStiffness:
    """k_theta = F H/theta and c_w = (o - 2 H sin(theta/2))/F of an inverted unit without a moment.

    F is the push, H the lever (mm), o the opening, theta the rotation from floor to floor. On the
    ground k_theta is the secant from the largest moment that closes the gap to the one that opens
    it, both as they are in the turned state.
    Raises SolverError for a unit that no push or moment opened.
    """
    theta = curve.chamber1_angle_rad - curve.chamber2_angle_rad
    is_inverted = curve.unit == "inverted"
    free = np.flatnonzero(is_inverted & (curve.moment_N_mm == 0.0)).item()
    ground = np.flatnonzero(~is_inverted)
    ends = ground[[curve.moment_N_mm[ground].argmin(), curve.moment_N_mm[ground].argmax()]]
    bent = float(np.ptp(theta[ends]) * np.sign(theta[ends[1]] - theta[ends[0]]))
    opened, push, turned = (float(v[free]) for v in (curve.opening_mm, curve.push_N, theta))
    if bent <= 0.0 or turned <= 0.0 or push <= 0.0:
        raise SolverError(
            f"pushes and moments should open the gap; ccx turned it by {turned:.4g} rad under a "
            f"push of {push:.4g} N, and by {bent:.4g} rad between the moments"
        )
    moments = (curve.moment_N_mm * np.cos(curve.chamber2_angle_rad))[ends]
    return UnitStiffness(
        opening=opened,
        push=push,
        rotation=turned,
        by_push=push * lever / turned,
        ground=float(np.ptp(moments)) / bent,
        walls=(opened - 2 * lever * float(np.sin(turned / 2))) / push,
    )


def unit_finding(chambers: HingeChambers, curve: UnitCurve) -> str:
    """Opening, push, rotation and what follows from them; doubts, if any; in one line."""
    found = unit_stiffness(curve, lever(chambers))
    closes = curve.opening_mm.min() <= -chambers.separation
    pulls = curve.push_N.min() < 0.0
    doubts = (
        *(["closes the gap, where the chambers would touch"] if closes else []),
        *(["opens the gap so far that the push becomes a pull"] if pulls else []),
    )
    doubt = f" A moment {' and one '.join(doubts)}: take smaller ones." if doubts else ""
    return (
        f"Inverted: opening {found.opening:.4g} mm, push {found.push:.4g} N, rotation "
        f"{found.rotation:.4g} rad; k_theta {found.by_push:.4g} N mm/rad (ground: "
        f"{found.ground:.4g}), c_w {found.walls:.4g} mm/N.{doubt}"
    )


def dome_finding(dome: DomeShape, curve: PressedDomeCurve) -> str:
    """A sentence on the dome's snap, if any, and its rest at the end."""
    inverted = curve.pole_travel_mm > dome.height  # the pole beyond the plane of the base
    if not inverted.any():
        return f"The dome does not snap up to {curve.pressure_MPa.max():.4g} MPa."
    row = int(inverted.argmax())
    snap = (
        f"The dome snaps at {curve.pressure_MPa[row]:.4g} MPa (time {curve.time_s[row]:.4g} s), "
        "rings,"
    )
    if not inverted[-1]:
        return f"{snap} and returns as the pressure goes: it is not bistable."
    return (
        f"{snap} and stays inverted at zero pressure: pole travel {curve.pole_travel_mm[-1]:.5g} "
        f"mm, energy {curve.energy_mJ[-1]:.4g} mJ."
    )


def hinge_finding(curve: HingeCurve) -> str:
    """Moment over rotation at the end of the curve. Raises SolverError if it did not open."""
    moment, rotation = curve.moment_N_mm[-1], curve.rotation_rad[-1]
    if rotation <= 0:
        raise SolverError(f"the moment should open the hinge; ccx turned it by {rotation:.4g} rad")
    return f"Moment over rotation at {rotation:.4g} rad: {moment / rotation:.4g} N mm/rad."


def csv_text(comments: Sequence[str], curve: Curve) -> str:
    """Comment lines, a line of names, and a line for each row with ten digits."""
    columns = curve if isinstance(curve, dict) else curve._asdict()
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    lines = [
        *(f"# {comment}" for comment in comments),
        ",".join(columns),
        *(",".join(map(_cell, row)) for row in rows),
    ]
    return "\n".join(lines) + "\n"


def _cell(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:.10g}"


def _from_rest(displacements: Array) -> Array:
    return np.concatenate([np.zeros_like(displacements[:1]), displacements])
