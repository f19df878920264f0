"""Curves of domes and hinges and tables of geometries, read with units in column names."""

from collections.abc import Iterator, Mapping

import numpy as np

from dpgcli.arrays import Array
from dpgcli.calibration.choices import LINEARITY
from dpgcli.calibration.record import Record
from dpgcli.design.dimensions import SMALLEST, unit_of
from dpgcli.errors import Field, Message, Problem, SpecError
from dpgcli.files.calibration.models import Values
from dpgcli.files.csv_file import AS_IT_IS, Choice, Sheet, Tabular, read_sheet
from dpgcli.files.layout import is_number
from dpgcli.files.own_units import chosen_units, in_own_units
from dpgcli.files.places import in_order
from dpgcli.files.plausible import other_scales, other_springs, wrong_signs
from dpgcli.files.sections import Geometry, expected_of
from dpgcli.files.units import factor_of
from dpgcli.files.yaml_file import MAX_NODES
from dpgcli.records import dataclass

TRAVELS = ("pole_travel_mm", "travel_mm")
QUANTITIES = {"energy_mJ": "energy", "force_N": "force", "pressure_MPa": "pressure"}
OTHERS = {"volume_mm3": "volume", "time_s": "time"}
CURVE = {**dict.fromkeys(TRAVELS, "travel"), **QUANTITIES, **OTHERS}  # quantities by column
MOMENT, ROTATIONS = "moment_N_mm", ("rotation_rad", "rotation_mid_chamber_rad")
HINGE = {MOMENT: "moment", **dict.fromkeys(ROTATIONS, "rotation")}

USUAL = {  # largest values of a geometry, by the unit of its key, and what others may be in
    "mm": (0.05, 200.0, "meters?", "micrometers?"),
    "MPa": (1e-3, 1e4, "gigapascals?", "kPa or Pa?"),
}
MOST_NUMBERS = MAX_NODES * 9 // 10
POSITIVE = f"a number > 0, at least {SMALLEST:g}, since logarithms are fitted"


@dataclass(frozen=True)
class MeasuredCurve:
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
) -> MeasuredCurve:
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
        *wrong_signs(sheet, travel, arrays["travel"]),
        *other_scales(sheet, own.values, columns, geometry),
    ]
    problems = problems or list(other_springs(sheet, own, columns, geometry))
    if problems:
        raise SpecError(in_order(problems))
    return MeasuredCurve(Record(**arrays), _unused(sheet, columns), sheet.sha256, own.notes)


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
    unsaid = {name: columns[name] for name, kind in known.items() if kind not in given}
    problems = list(other_scales(sheet, unsaid, known, None))
    if problems:
        raise SpecError(in_order(problems))
    texts = {name: tuple(sheet.cells(name)) for name in sheet.names if not _is_numeric(sheet, name)}
    unused = tuple(name for name in _unused(sheet, known) if name not in texts)
    return Moments(columns[MOMENT], columns[rotation], texts, unused, sheet.sha256, own.notes)


def read_table(source: Tabular) -> GridTable:
    """Quantities over geometries: columns that are keys of the geometry, and the others.

    Columns of text are left out. Raises SpecError with every problem at once.
    """
    sheet = read_sheet(source, {*Geometry.model_fields, *Values.model_fields})
    keys = [name for name in sheet.names if name in Geometry.model_fields]
    if not keys:
        raise SpecError((sheet.missing("of the geometry, such as dome_height_mm"),))
    others = [
        name
        for name in sheet.names
        if name not in keys and (name in Values.model_fields or _is_numeric(sheet, name))
    ]
    if not others:
        raise SpecError((sheet.missing("of a quantity, such as bistable_stiffness_N_per_mm"),))
    n_numbers = len(sheet.rows) * len({*keys, *others})
    if n_numbers > MOST_NUMBERS:
        expected = f"at most {MOST_NUMBERS:,} numbers, as many as a calibration file holds"
        raise SpecError((sheet.problem(None, "file", expected, f"{n_numbers:,}"),))
    columns = sheet.numbers([*keys, *others])
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
                names = (name for name, kind in {**CURVE, **HINGE}.items() if kind == quantity)
                name = min(names, key=len)
                return Message(Field("column"), f" '{name}={title}'?")
    return ""


def _unused(sheet: Sheet, known: Mapping[str, str]) -> tuple[str, ...]:
    return tuple(name for name in sheet.names if name and name not in known)


def _is_numeric(sheet: Sheet, name: str) -> bool:
    """Whether at least one cell of a column is a number, so that all should be."""
    cells = sheet.cells(name)
    return any(is_number(cell) or cell.lstrip("+-").lower() in ("inf", "nan") for cell in cells)


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
