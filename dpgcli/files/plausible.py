"""Whether columns can be those of soft domes and hinges, or have another sign or unit."""

from collections.abc import Iterator, Mapping

import numpy as np

from dpgcli.arrays import Array
from dpgcli.design.geometry import REFERENCE, snap_pressure
from dpgcli.errors import Field, Message, Problem
from dpgcli.files.csv_file import Sheet
from dpgcli.files.own_units import InOwnUnits
from dpgcli.files.units import asked_for

PLAUSIBLE = {  # of the largest value, for what soft fingers are made of; without geometry
    "travel": (0.1, 1e3),
    "energy": (0.1, 1e5),
    "force": (1e-3, 1e4),
    "pressure": (1e-4, 10.0),
    "moment": (0.02, 1e6),
    "rotation": (1e-6, 3.2),
}
GUESSES = {  # the unit behind values that are too small, and too large
    "travel": ("meters?", "micrometers?"),
    "energy": ("joules?", "microjoules?"),
    "force": ("kilonewtons?", "millinewtons?"),
    "pressure": ("gigapascals?", "kPa or Pa?"),
    "moment": ("N m?", "N um?"),
    "rotation": ("", "degrees?"),
}
SPRINGS = {  # of the largest value over a power of the largest travel, and that power: N/mm
    "force": (0.03, 500.0, 1),  # from silicone of 0.5 MPa to stiff TPU, domes of millimeters
    "energy": (0.005, 150.0, 2),
}
DOME = ("dome_height_mm", "dome_thickness_mm", "elastic_modulus_MPa")
BEHIND = {"travel": DOME[:1], "energy": DOME, "force": DOME, "pressure": DOME}  # a range of its own
MARGIN = 100.0  # between a dome and the estimate for its geometry; another unit is 1000 off


def wrong_signs(sheet: Sheet, name: str, travel: Array) -> Iterator[Problem]:
    """Travels that are not positive towards inversion, or not mostly."""
    if travel.max() <= 0.0 or travel.min() < -0.5 * travel.max():
        found = f"{travel.min():g} to {travel.max():g}"
        title = sheet.titles.get(name, name)
        reverse = Message(Field("column"), f" {name}=-{title} reverses it")
        hint = reverse if travel.min() < 0.0 and name not in sheet.reversed else ""
        yield sheet.problem(None, name, "travels that are positive towards inversion", found, hint)


def other_scales(
    sheet: Sheet,
    columns: Mapping[str, Array],
    known: Mapping[str, str],
    geometry: Mapping[str, float] | None,
) -> Iterator[Problem]:
    """Columns whose largest value no dome has: most likely in another unit."""
    ranges = {**PLAUSIBLE, **_of_dome(geometry or {})}
    for name, values in columns.items():
        kind = known[name]
        largest = float(np.abs(values).max())
        if kind not in ranges or largest == 0.0:
            continue
        low, high = ranges[kind]
        if not low <= largest <= high:
            hint = GUESSES[kind][largest > high]
            if kind == "moment":  # no geometry tells how large a hinge is
                hint = Message(hint, " if it is right, say so: ", asked_for(kind))
            needed = BEHIND.get(kind, ())
            if missing := [key for key in needed if key not in (geometry or {})]:
                hint = Message(hint, " if it is right, say how large the dome is:")
                for key in missing:
                    hint = Message(hint, " ", Field("geometry"), f" {key}=...")
            expected = f"a largest value of {low:.3g} to {high:.3g}"
            yield sheet.problem(None, name, expected, f"{largest:.4g}", hint)


def other_springs(
    sheet: Sheet,
    own: InOwnUnits,
    columns: Mapping[str, str],
    geometry: Mapping[str, float] | None,
) -> Iterator[Problem]:
    """Columns whose unit nobody said, and that make a spring as no dome of millimeters has it."""
    travel = next(own.values[name] for name, kind in columns.items() if kind == "travel").max()
    for name, kind in columns.items():
        if kind not in SPRINGS or name in own.said or set(BEHIND[kind]) <= set(geometry or ()):
            continue
        low, high, power = SPRINGS[kind]
        spring = float(np.abs(own.values[name]).max()) / travel**power if travel > 0.0 else 0.0
        if spring > 0.0 and not low <= spring <= high:
            guess = GUESSES[kind][bool(spring > high)]
            hint = Message(guess, " if it is right, say so: ", asked_for(kind))
            expected = f"the spring of a dome of millimeters, {low:g} to {high:g} N/mm"
            over = " ".join(filter(None, ("travel", "squared" * (power == 2))))
            found = f"{spring:.3g} N/mm by the largest value over {over}"
            yield sheet.problem(None, name, expected, found, hint)


def _of_dome(geometry: Mapping[str, float]) -> dict[str, tuple[float, float]]:
    """Largest values that a dome of this geometry may have, whatever its base.

    Over a base of 16 mm its energy is E t^2.8 h^1.75, from 68 mJ at h = 6.5 mm, t = 0.75 mm,
    E = 26 MPa: the finite-element grid of configs/calibration. Scaled copies of that dome have its
    pressure and s³ times its energy: over a base that is larger as the dome is higher, 16/6.5 h,
    energies are E t^2.8 h^0.2 and pressures E (t/h)^2.5.
    """
    height = geometry.get("dome_height_mm")
    if height is None:
        return {}
    ranges = {"travel": (0.05 * height, 20.0 * height)}
    if set(DOME) <= set(geometry):
        fixed, similar = (_usual(geometry, s) for s in (1.0, height / REFERENCE.dome_height))
        ranges |= {
            kind: (min(size, similar[kind]) / MARGIN, max(size, similar[kind]) * MARGIN)
            for kind, size in fixed.items()
        }
    return ranges


def _usual(geometry: Mapping[str, float], scale: float) -> dict[str, float]:
    """Energy (mJ), force (N) and pressure (MPa) of a dome whose base is 16 mm times a scale."""
    height, thickness, modulus = (geometry[key] for key in DOME)
    height, thickness = height / scale, thickness / scale
    energy = 68.0 * modulus / 26.0 * (thickness / 0.75) ** 2.8 * (height / 6.5) ** 1.75
    pressure = snap_pressure(height, thickness, modulus)
    force = energy / height
    return {"energy": energy * scale**3, "force": force * scale**2, "pressure": pressure}
