"""Curves of domes and hinges and tables of geometries, read with units in column names."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from dpgcli.arrays import Array
from dpgcli.calibration.choices import LINEARITY
from dpgcli.calibration.record import Record
from dpgcli.design.dimensions import SMALLEST, unit_of
from dpgcli.design.geometry import snap_pressure
from dpgcli.errors import Field, Message, Problem, SpecError
from dpgcli.files.calibration.models import Values
from dpgcli.files.csv_file import AS_IT_IS, Choice, Sheet, Tabular, read_sheet
from dpgcli.files.own_units import InOwnUnits, chosen_units, in_own_units
from dpgcli.files.places import in_order
from dpgcli.files.sections import Geometry, expected_of
from dpgcli.files.units import asked_for, factor_of
from dpgcli.files.yaml_file import MAX_NODES

TRAVELS = ("pole_travel_mm", "travel_mm")
QUANTITIES = {"energy_mJ": "energy", "force_N": "force", "pressure_MPa": "pressure"}
OTHERS = {"volume_mm3": "volume", "time_s": "time"}
CURVE = {**dict.fromkeys(TRAVELS, "travel"), **QUANTITIES, **OTHERS}  # quantities by column
MOMENT, ROTATIONS = "moment_N_mm", ("rotation_rad", "rotation_mid_chamber_rad")
HINGE = {MOMENT: "moment", **dict.fromkeys(ROTATIONS, "rotation")}

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
USUAL = {  # largest values of a geometry, by the unit of its key, and what others may be in
    "mm": (0.05, 200.0, "meters?", "micrometers?"),
    "MPa": (1e-3, 1e4, "gigapascals?", "kPa or Pa?"),
}
SPRINGS = {  # of the largest value over a power of the largest travel, and that power: N/mm
    "force": (0.03, 500.0, 1),  # from silicone of 0.5 MPa to stiff TPU, domes of millimeters
    "energy": (0.005, 150.0, 2),
}
MOST_NUMBERS = MAX_NODES * 9 // 10
POSITIVE = f"a number > 0, at least {SMALLEST:g}, since logarithms are fitted"
DOME = ("dome_height_mm", "dome_thickness_mm", "elastic_modulus_MPa")
BEHIND = {"travel": DOME[:1], "energy": DOME, "force": DOME, "pressure": DOME}  # a range of its own
MARGIN = 100.0  # between a dome and the estimate for its geometry; another unit is 1000 off


@dataclass(frozen=True)
class Measured:
    """A curve, the columns that were not used, and the SHA-256 of the file.

    `notes` say in which units other than ours its columns were.
    """

    curve: Record
    ignored: tuple[str, ...]
    sha256: str
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Moments:
    """Moments (N mm) over rotations (rad), (row,); the texts of columns that hold text, by name.

    `ignored` are columns that were not used, `sha256` is the file's.
    """

    moment: Array
    rotation: Array
    texts: Mapping[str, tuple[str, ...]]
    ignored: tuple[str, ...]
    sha256: str
    notes: tuple[str, ...] = ()

    @property
    def doubts(self) -> tuple[str, ...]:
        """Units, and columns whose texts tell rows of different hinges apart, in words."""
        return self.notes + tuple(
            Message(
                f"rows of {n} different {name} are fitted as one hinge: choose with ",
                Field("where"),
                f" '{name}=...'",
            )
            for name, texts in self.texts.items()
            if (n := len(set(texts))) > 1
        )


@dataclass(frozen=True)
class GridTable:
    """Geometries (point, key) by `over`, and positive quantities (point,) by key.

    `constant` holds geometry that is the same in all points. `doubts` are what no soft finger has,
    in words: nothing else here tells whether the unit is wrong or the finger unusual.
    """

    over: tuple[str, ...]
    geometry: Array
    quantities: dict[str, Array]
    constant: dict[str, float]
    ignored: tuple[str, ...]
    doubts: tuple[str, ...]
    sha256: str


def read_curve(
    source: Tabular, geometry: Mapping[str, float] | None = None, choice: Choice = AS_IT_IS
) -> Measured:
    """A dome's curve; the geometry tells units that are a thousand times off.

    Raises SpecError with every problem at once, UsageError for a choice that is none.
    """
    given = chosen_units(choice, CURVE)
    sheet = read_sheet(source, CURVE, choice)
    headless = list(_one_of(sheet, TRAVELS, "travel"))
    if not set(QUANTITIES) & set(sheet.names):
        headless.append(sheet.missing(*QUANTITIES, hint=_titled(sheet, *QUANTITIES.values())))
    if headless:
        raise SpecError(tuple(headless))
    columns = {name: kind for name, kind in CURVE.items() if name in sheet.names}
    own = in_own_units(sheet, columns, given)
    arrays = {kind: own.values[name] for name, kind in columns.items()}
    travel = next(name for name in TRAVELS if name in columns)
    problems = [
        *_signs(sheet, travel, arrays["travel"]),
        *_scales(sheet, own.values, columns, geometry),
    ]
    problems = problems or list(_springs(sheet, own, columns, geometry))
    if problems:
        raise SpecError(in_order(problems))
    return Measured(Record(**arrays), _unused(sheet, columns), sheet.sha256, own.notes)


def read_moments(source: Tabular, where: str | None = None, choice: Choice = AS_IT_IS) -> Moments:
    """Moments and rotations of a hinge; `where` "COLUMN=TEXT" chooses rows.

    Raises SpecError with every problem at once, UsageError for a choice that is none.
    """
    given = chosen_units(choice, HINGE)
    sheet = read_sheet(source, HINGE, choice)
    headless = list(_one_of(sheet, ROTATIONS, "rotation"))
    if MOMENT not in sheet.names:
        headless.append(sheet.missing(MOMENT, hint=_titled(sheet, "moment")))
    if headless:
        raise SpecError(tuple(headless))
    rotation = next(name for name in ROTATIONS if name in sheet.names)
    if where is not None:
        sheet = _chosen(sheet, where)
    known = {MOMENT: "moment", rotation: "rotation"}
    own = in_own_units(sheet, known, given)
    columns = own.values
    problems = list(_scales(sheet, columns, known, None))
    if problems:
        raise SpecError(in_order(problems))
    texts = {name: tuple(sheet.cells(name)) for name in sheet.names if not _is_numeric(sheet, name)}
    unused = tuple(name for name in _unused(sheet, known) if name not in texts)
    return Moments(columns[MOMENT], columns[rotation], texts, unused, sheet.sha256, own.notes)


def read_table(source: Tabular) -> GridTable:
    """Quantities over geometries: columns that are keys of the geometry, and the others.

    Columns of text are left out. Raises SpecError with every problem at once.
    """
    sheet = read_sheet(source, Geometry.model_fields)
    keys = [name for name in sheet.names if name in Geometry.model_fields]
    others = [
        name
        for name in sheet.names
        if name not in keys and (name in Values.model_fields or _is_numeric(sheet, name))
    ]
    if not keys:
        raise SpecError((sheet.missing("of the geometry, such as dome_height_mm"),))
    if not others:
        raise SpecError((sheet.missing("of a quantity, such as bistable_stiffness_N_per_mm"),))
    columns = sheet.numbers([*keys, *others])
    n_numbers = len(sheet.rows) * len(columns)
    if n_numbers > MOST_NUMBERS:
        expected = f"at most {MOST_NUMBERS:,} numbers, as many as a calibration file holds"
        raise SpecError((sheet.problem(None, "file", expected, f"{n_numbers:,}"),))
    problems = [
        sheet.problem(row, name, POSITIVE, f"{values[row]:g}")
        for name, values in columns.items()
        for row in np.flatnonzero(values < SMALLEST).tolist()
    ]
    problems += [
        sheet.problem(row, LINEARITY, expected_of(LINEARITY), f"{columns[LINEARITY][row]:g}")
        for row in np.flatnonzero(columns.get(LINEARITY, np.zeros(0)) > 1.0).tolist()
    ]
    problems += _repeated(sheet, np.stack([columns[key] for key in keys], axis=1))
    over = tuple(key for key in keys if np.ptp(columns[key]) > 0.0)
    if not over and not problems:
        problems.append(sheet.problem(None, "file", "geometries that differ", "one and the same"))
    if problems:
        raise SpecError(in_order(problems))
    return GridTable(
        over,
        np.stack([columns[key] for key in over], axis=1),
        {name: columns[name] for name in others},
        {key: float(columns[key][0]) for key in keys if key not in over},
        tuple(name for name in sheet.names if name not in columns),
        tuple(_doubts({key: columns[key] for key in keys})),
        sheet.sha256,
    )


def _doubts(geometry: Mapping[str, Array]) -> Iterator[str]:
    for key, values in geometry.items():
        low, high, small, large = USUAL[unit_of(key)]
        if not low <= values.max() <= high:
            guess = large if values.max() > high else small
            yield f"{key} is {values.max():.4g} at most: {guess}"


def _one_of(sheet: Sheet, names: tuple[str, ...], quantity: str) -> Iterator[Problem]:
    """The problem that there is none of these columns, or more than one."""
    found = [name for name in names if name in sheet.names]
    if len(found) > 1:
        yield sheet.problem(None, "header", f"one of {', '.join(names)}", " and ".join(found))
    elif not found:
        yield sheet.missing(*names, hint=_titled(sheet, quantity))


def _titled(sheet: Sheet, *quantities: str) -> str:
    """How to say which column it is: the first whose unit is one of these quantities."""
    for quantity in quantities:
        for title, unit in sheet.units.items():
            if title and factor_of(quantity, unit) is not None:
                name = next(name for name, kind in {**CURVE, **HINGE}.items() if kind == quantity)
                return Message(Field("column"), f" '{name}={title}'?")
    return ""


def _unused(sheet: Sheet, known: Mapping[str, str]) -> tuple[str, ...]:
    return tuple(name for name in sheet.names if name and name not in known)


def _is_numeric(sheet: Sheet, name: str) -> bool:
    """Whether at least one cell of a column is a number, so that all should be."""
    for cell in sheet.cells(name):
        try:
            float(cell)
        except ValueError:
            continue
        return True
    return False


def _chosen(sheet: Sheet, where: str) -> Sheet:
    name, equals, text = where.partition("=")
    if not equals:
        raise SpecError((sheet.problem(None, Field("where"), "COLUMN=TEXT", repr(where)),))
    sheet.check_names([name.strip()])
    cells = sheet.cells(name.strip())
    kept = [row for row, cell in enumerate(cells) if cell == text.strip()]
    if not kept:
        there = "; ".join(dict.fromkeys(cells))
        expected = f"a text of {name}"
        raise SpecError((sheet.problem(None, Field("where"), expected, repr(text), there),))
    return sheet.chosen(kept)


def _repeated(sheet: Sheet, geometry: Array) -> Iterator[Problem]:
    first: dict[tuple[float, ...], int] = {}
    for row, values in enumerate(map(tuple, geometry.tolist())):
        if values in first:
            found = f"that of line {sheet.lines[first[values]]} again"
            yield sheet.problem(row, "geometry", "each geometry once", found)
        first.setdefault(values, row)


def _signs(sheet: Sheet, name: str, travel: Array) -> Iterator[Problem]:
    if travel.max() <= 0.0 or travel.min() < -0.5 * travel.max():
        found = f"{travel.min():g} to {travel.max():g}"
        title = sheet.titles.get(name, name)
        reverse = Message(Field("column"), f" {name}=-{title} reverses it")
        hint = reverse if travel.min() < 0.0 and name not in sheet.reversed else ""
        yield sheet.problem(None, name, "travels that are positive towards inversion", found, hint)


def _scales(
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
            needed = BEHIND.get(kind, ())
            if missing := [key for key in needed if key not in (geometry or {})]:
                hint = Message(hint, " if it is right, say how large the dome is:")
                for key in missing:
                    hint = Message(hint, " ", Field("geometry"), f" {key}=...")
            expected = f"a largest value of {low:.3g} to {high:.3g}"
            yield sheet.problem(None, name, expected, f"{largest:.4g}", hint)


def _springs(
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
            guess = GUESSES[kind][spring > high]
            hint = Message(guess, " if it is right, say so: ", asked_for(kind))
            expected = f"the spring of a dome of millimeters, {low:g} to {high:g} N/mm"
            over = " ".join(filter(None, ("travel", "squared" * (power == 2))))
            found = f"{spring:.3g} N/mm by the largest value over {over}"
            yield sheet.problem(None, name, expected, found, hint)


def _of_dome(geometry: Mapping[str, float]) -> dict[str, tuple[float, float]]:
    """Largest values that a dome of this geometry may have.

    Energy E t^2.8 h^1.75, from 68 mJ at h = 6.5 mm, t = 0.75 mm, E = 26 MPa: the finite-element
    grid of configs/calibration.
    """
    height = geometry.get("dome_height_mm")
    if height is None:
        return {}
    ranges = {"travel": (0.05 * height, 20.0 * height)}
    if set(DOME) <= set(geometry):
        _, thickness, modulus = dome = [geometry[key] for key in DOME]
        energy = 68.0 * modulus / 26.0 * (thickness / 0.75) ** 2.8 * (height / 6.5) ** 1.75
        pressure = snap_pressure(*dome)
        usual = {"energy": energy, "force": energy / height, "pressure": pressure}
        ranges |= {kind: (size / MARGIN, size * MARGIN) for kind, size in usual.items()}
    return ranges
