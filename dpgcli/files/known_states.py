"""Known states from tables: tips, angles, openings and pushes by pattern; shapes as points."""

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from dpgcli.arrays import Array
from dpgcli.calibration.known import KnownStates
from dpgcli.errors import Problem, SpecError
from dpgcli.files.csv_file import Sheet, Tabular, read_sheet
from dpgcli.files.layout import NUMBER
from dpgcli.files.places import Location, in_order, located, shown

TIP = ("tip_x_mm", "tip_y_mm")
TIP_ANGLE = "tip_angle_rad"
SECONDS = "seconds"
MOMENT = "moment_N_mm"
UNIT = "unit"  # in place of the pattern of a single one
PATTERN_OF = {"ground": "0", "inverted": "1"}
OF_ONE_UNIT = {UNIT: "pattern", "opening_mm": "opening1_mm", "push_N": "push1_N"}
CLAMPED = "chamber1_angle_rad"  # the first chamber, whose turn counts as none
STATION, OFFSET = "first_station_mm", "tip_offset_mm"
OF_FRAME = re.compile(rf"#+ *({STATION}|{OFFSET}) *:(.*)")
MAY_BE_OF_FRAME = re.compile(
    r"[\W_]*(?:first[\W_]*station|tip[\W_]*offset).*[0-9:=]", re.IGNORECASE
)
ENDS = '",; \t'  # what a spreadsheet writes around a comment
POINT = ("x_mm", "y_mm")
FEWEST_POINTS = 2
MOST_UNITS = 2**18  # in all states: they are solved at once, in about 300 MB


def read_states(source: Tabular, n_units: int, shapes: Tabular | None = None) -> KnownStates:
    """Known states of a finger of n units; empty cells are not known.

    Columns: `pattern`; `tip_x_mm` and `tip_y_mm`; `tip_angle_rad`; `chamber2_angle_rad` …, of the
    phalanges after the first; `opening1_mm` …; `push1_N` …; `moment_N_mm`, the end couple of a row,
    positive where it opens the gaps; `seconds`. In a table of one unit `unit`, ground or inverted,
    may stand for the pattern, `opening_mm` and `push_N` for those of unit 1. A second file has the
    points of the limiting layer, from base to tip: `pattern`, `x_mm`, `y_mm`. Comments above the
    header may say the frame: `# first_station_mm: 5.375, 0.75`, `# tip_offset_mm: 5.375, -0.75`.
    Raises SpecError with every problem of a file.
    """
    sheet = read_sheet(source, _names(n_units) | {*OF_ONE_UNIT})
    if n_units == 1 and UNIT in sheet.names and "pattern" not in sheet.names:
        sheet = _of_one_unit(sheet)
    elif "pattern" not in sheet.names:
        hint = "of one unit? then of a finger with finger.units 1" if UNIT in sheet.names else ""
        raise SpecError((sheet.missing("pattern", hint=hint),))
    if len(sheet.rows) * n_units > MOST_UNITS:
        expected = f"at most {MOST_UNITS // n_units:,} states of {n_units} units"
        wrong = sheet.problem(None, "file", expected, f"{len(sheet.rows):,}", "a part at a time")
        raise SpecError((wrong,))
    patterns = sheet.cells("pattern")
    frame, problems = _frame(sheet)
    problems += _pattern_problems(sheet, n_units)
    if not {*TIP} <= {*sheet.names} and not _known_angles(sheet, n_units):
        problems.append(sheet.missing("tip_x_mm and tip_y_mm, or tip_angle_rad"))
    try:
        _check_numbers(sheet, n_units)
    except SpecError as error:
        problems += error.problems
    if problems:
        raise SpecError(in_order(problems))
    moments = _moments(sheet, patterns)
    known = KnownStates(
        patterns=np.array([[digit == "1" for digit in pattern] for pattern in patterns]).T,
        tip=_columns(sheet, TIP),
        angles=_angles(sheet, n_units),
        openings=_columns(sheet, _by_unit("opening{}_mm", n_units)),
        pushes=_columns(sheet, _by_unit("push{}_N", n_units)),
        seconds=_columns(sheet, [SECONDS])[0],
        moments=moments,
        shapes=() if shapes is None else _read_shapes(shapes, patterns, moments, n_units),
        unused=_unused(sheet, n_units),
        sha256=sheet.sha256,
        first_station=frame.get(STATION),
        tip_offset=frame.get(OFFSET),
    )
    problems = [
        sheet.problem(row, SECONDS, "a time > 0", f"{known.seconds[row]:g}")
        for row in np.flatnonzero(known.seconds <= 0.0).tolist()
    ]
    numbers = (known.tip, known.angles, known.openings, known.pushes)
    if not known.shapes and not any(np.isfinite(values).any() for values in numbers):
        problems.append(sheet.problem(None, "file", "something known of a state", "empty cells"))
    if problems:
        raise SpecError(in_order(problems))
    return known


def _frame(sheet: Sheet) -> tuple[dict[str, tuple[float, float]], list[Problem]]:
    """Points of the frame by key, from comments, and what is wrong with them."""
    frame: dict[str, tuple[float, float]] = {}
    problems = []
    for line, text in sheet.remarks:
        if not MAY_BE_OF_FRAME.match(text):
            continue
        place = Location(sheet.file, line)
        said = OF_FRAME.fullmatch(text.strip(ENDS))
        if said is None:
            expected = f"{STATION} or {OFFSET}, in mm, as in # {STATION}: 5.375, 0.75"
            problems.append(located(place, "comment", expected, shown(text)))
            continue
        key, numbers = said[1], said[2].strip().removeprefix("[").removesuffix("]").split(",")
        if len(numbers) != len(TIP) or not all(NUMBER.fullmatch(n.strip()) for n in numbers):
            expected = "two numbers in mm, such as 5.375, -0.75"
            problems.append(located(place, key, expected, said[2].strip()))
            continue
        point = (float(numbers[0]), float(numbers[1]))
        if frame.setdefault(key, point) != point:
            problems.append(located(place, key, "each point once", "another one"))
    return frame, problems


def _names(n_units: int) -> set[str]:
    """The columns that a table of states may have."""
    by_unit = (*_by_unit("opening{}_mm", n_units), *_by_unit("push{}_N", n_units))
    return {"pattern", *TIP, TIP_ANGLE, MOMENT, SECONDS, *_angle_names(n_units), *by_unit}


def _unused(sheet: Sheet, n_units: int) -> tuple[str, ...]:
    used = _names(n_units) | {CLAMPED}
    used -= set() if {*TIP} <= {*sheet.names} else {*TIP}  # one coordinate places no tip
    return tuple(name for name in sheet.names if name and name not in used)


def _pattern_problems(sheet: Sheet, n_units: int) -> list[Problem]:
    return [
        sheet.problem(row, "pattern", f"{n_units} digits 0 and 1", repr(pattern))
        for row, pattern in enumerate(sheet.cells("pattern"))
        if not re.fullmatch(f"[01]{{{n_units}}}", pattern)
    ]


def _of_one_unit(sheet: Sheet) -> Sheet:
    """A table of one unit, with the names that a table of states has."""
    place = sheet.names.index(UNIT)
    rows = [[*row] for row in sheet.rows]
    problems = []
    for line, row in enumerate(rows):
        said = row[place]
        row[place] = PATTERN_OF.get(said, said)
        if row[place] == said:
            problems.append(sheet.problem(line, UNIT, " or ".join(PATTERN_OF), repr(said)))
    if problems:
        raise SpecError(tuple(problems))
    return replace(sheet.renamed(OF_ONE_UNIT), rows=rows)


def _moments(sheet: Sheet, patterns: Sequence[str]) -> Array:
    """End couples, 0 without a column. Raises SpecError for empty cells, and states given twice."""
    if MOMENT not in sheet.names:
        moments = np.zeros(len(sheet.rows))
    else:
        moments = _columns(sheet, [MOMENT])[0]
    problems = [
        sheet.problem(row, MOMENT, "a number, 0 for none", "nothing")
        for row in np.flatnonzero(np.isnan(moments)).tolist()
    ] or _repeated(sheet, patterns, moments)
    if problems:
        raise SpecError(in_order(problems))
    return moments


def _repeated(sheet: Sheet, patterns: Sequence[str], moments: Array) -> list[Problem]:
    """Problems of states that are there twice: the same pattern under the same moment."""
    states = list(zip(patterns, moments.tolist(), strict=True))
    first = {state: row for row, state in reversed(list(enumerate(states)))}
    expected = f"each pattern once, or once for each {MOMENT}"
    return [
        sheet.problem(row, "pattern", expected, f"{state[0]} for the second time")
        for row, state in enumerate(states)
        if row > first[state]
    ]


def _by_unit(name: str, n_units: int) -> list[str]:
    return [name.format(unit) for unit in range(1, n_units + 1)]


def _check_numbers(sheet: Sheet, n_units: int) -> None:
    """Read all columns at once, so that one message has the problems of all."""
    openings, pushes = (_by_unit(name, n_units) for name in ("opening{}_mm", "push{}_N"))
    more = (*openings, *pushes, MOMENT, SECONDS)
    _columns(sheet, [*TIP, TIP_ANGLE, *_angle_names(n_units), *more])


def _columns(sheet: Sheet, names: Sequence[str]) -> Array:
    """Columns as rows of numbers, (name, state); NaN where there is no column or an empty cell."""
    given = sheet.numbers([name for name in names if name in sheet.names], may_lack=True)
    unknown = np.full(len(sheet.rows), np.nan)
    return np.stack([given.get(name, unknown) for name in names])


def _known_angles(sheet: Sheet, n_units: int) -> set[str]:
    return {TIP_ANGLE, *_angle_names(n_units)} & {*sheet.names}


def _angle_names(n_units: int) -> list[str]:
    """The first chamber is clamped; the last one's angle is that of the tip."""
    return [f"chamber{i}_angle_rad" for i in range(2, n_units + 2)]


def _angles(sheet: Sheet, n_units: int) -> Array:
    """Angles of the phalanges after the first, (unit, state)."""
    angles = _columns(sheet, _angle_names(n_units))
    tip = _columns(sheet, [TIP_ANGLE])[0]
    angles[-1] = np.where(np.isnan(tip), angles[-1], tip)
    return angles


def _read_shapes(
    source: Tabular, patterns: Sequence[str], moments: Array, n_units: int
) -> tuple[Array, ...]:
    """Points by state, in the order of the file; none for a state that is not in it.

    They are of states without a moment: none for those under one.
    """
    sheet = read_sheet(source, ("pattern", *POINT))
    sheet.check_names(("pattern", *POINT))
    problems = _pattern_problems(sheet, n_units)
    points = sheet.numbers(POINT)
    rows: dict[str, list[int]] = {}
    for row, pattern in enumerate(sheet.cells("pattern")):
        rows.setdefault(pattern, []).append(row)
    known = set(patterns)
    for pattern, of_pattern in () if problems else rows.items():
        if pattern not in known:
            expected = "a pattern of the known states"
            problems.append(sheet.problem(of_pattern[0], "pattern", expected, repr(pattern)))
        elif len(of_pattern) < FEWEST_POINTS:
            problems.append(
                sheet.problem(of_pattern[0], "pattern", "2 points or more of it", "one")
            )
    if problems:
        raise SpecError(tuple(problems))
    together = np.stack([points[name] for name in POINT])
    free = (
        [] if moment else rows.get(pattern, [])
        for pattern, moment in zip(patterns, moments, strict=True)
    )
    return tuple(together[:, own] for own in free)
