"""Curves for calibrations from displacements, and the text of their files."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from dpgcli.arrays import Array
from dpgcli.calibration.fe.bricks import Bricks
from dpgcli.calibration.fe.decks import Pulse
from dpgcli.calibration.fe.dome import DomeMesh, DomeShape
from dpgcli.calibration.fe.energy import strain_energy, swept_volume
from dpgcli.calibration.fe.hinge import Chambers, chamber_turn, couple, moment
from dpgcli.errors import SolverError


class DomeCurve(NamedTuple):
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


Curve = DomeCurve | HingeCurve


def dome_curve(
    dome: DomeShape, mesh: DomeMesh, loading: Pulse, time: Array, displacements: Array
) -> DomeCurve:
    """The curve of a dynamic run: times (k,) in s, displacements (k, n, 3) in mm."""
    time = np.concatenate([[0.0], time])
    moved = _from_rest(displacements)[..., :2]
    return DomeCurve(
        pole_travel_mm=-moved[:, mesh.pole, 1] + 0.0,
        energy_mJ=strain_energy(dome, mesh, moved),
        pressure_MPa=loading.pressure(time),
        volume_mm3=swept_volume(mesh, moved),
        time_s=time,
    )


def hinge_curve(
    chambers: Chambers, mesh: Bricks, largest_moment: float, time: Array, displacements: Array
) -> HingeCurve:
    """The curve of a static run: shares (k,) of the load, displacements (k, n, 3) in mm."""
    share = np.concatenate([[0.0], time])
    moved = _from_rest(displacements)
    turns = [chamber_turn(chambers, mesh, moved, number) for number in (0, 1)]
    return HingeCurve(
        moment_N_mm=share * moment(mesh, largest_moment * couple(chambers, mesh), moved),
        rotation_rad=turns[1] - turns[0],
    )


def dome_finding(dome: DomeShape, curve: DomeCurve) -> str:
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
    rows = zip(*(column.tolist() for column in curve), strict=True)
    lines = [
        *(f"# {comment}" for comment in comments),
        ",".join(curve._fields),
        *(",".join(f"{value:.10g}" for value in row) for row in rows),
    ]
    return "\n".join(lines) + "\n"


def _from_rest(displacements: Array) -> Array:
    return np.concatenate([np.zeros_like(displacements[:1]), displacements])
