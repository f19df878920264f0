"""Known states from tables: tips, angles, openings and pushes by pattern; shapes as points."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from dpgcli.arrays import Array
from dpgcli.calibration.known import KnownStates
from dpgcli.errors import Problem, SpecError
from dpgcli.files.csv_file import FRAME, Sheet, Tabular, read_sheet
from dpgcli.files.layout import NUMBER
from dpgcli.files.places import Location, in_order, located, shown
from dpgcli.mechanics.finger import Finger

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
UNLIKELY = 30.0  # times what hinge and dome say, or as little of it: another unit
ODD = 6.0  # times the stroke or the length that is known, or as little of it: another unit
FARTHEST = 20.0  # times the finger's length from the origin, or as little of it: another unit


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


def states_of(finger: Finger, source: Tabular, shapes: Tabular | None = None) -> KnownStates:
    """Known states that can be those of this finger, in mm and rad.

    Raises SpecError as `read_states`, `check_scale` and `check_loads` do, and for openings or
    layers that are ten times too large or too small for it: centimeters.
    """
    known = read_states(source, finger.n_units, shapes)
    check_scale(source, known, float(finger.straight_length[0]))
    check_loads(source, known, finger)
    if problems := [*_centimeters(source, shapes, known, finger)]:
        raise SpecError(tuple(problems))
    return known


def _centimeters(
    source: Tabular, shapes: Tabular | None, known: KnownStates, finger: Finger
) -> Iterator[Problem]:
    """Problems of openings of inverted units beside the stroke, and of layers beside the finger."""
    inverted = known.openings[:, known.moments == 0.0][known.patterns[:, known.moments == 0.0]]
    opened = float(np.max(inverted, initial=0.0, where=np.isfinite(inverted)))
    lengths = [float(np.hypot(*np.diff(shape, axis=1)).sum()) for shape in known.shapes]
    opening = "opening_mm" if finger.n_units == 1 else "opening1_mm"
    stroke, length = float(finger.stroke.mean()), float(finger.straight_length[0])
    for table, key, what, found, usual in (
        (source, opening, "openings of inverted units", opened, stroke),
        (shapes, "x_mm", "layers from base to tip", max(lengths, default=0.0), length),
    ):
        if found > 0.0 and not usual / ODD < found < usual * ODD:
            place = Location(str(table) if isinstance(table, str | Path) else FRAME)
            hint = "centimeters?" if found < usual else "is the unit another one?"
            expected = f"{what} in mm, about {usual:.3g}"
            yield located(place, key, expected, f"{found:.3g}, the largest", hint)


def check_loads(source: Tabular, known: KnownStates, finger: Finger) -> None:
    """Raise SpecError for moments and pushes of the wrong sign, or of another unit.

    What a moment turns a finger by is between that of its hinges and that of its domes as well;
    a push has the moment of a hinge that is as far open as the stroke.
    """
    place = Location(str(source) if isinstance(source, str | Path) else FRAME)
    problems = []
    hinge, lever = finger.hinge_stiffness.mean(), finger.segment_height.mean()
    dome = finger.bistable_stiffness.mean() * lever**2
    turned, under = _turns(known)
    if len(turned) and hinge > 0.0:
        stiffness = float(under @ turned / (turned @ turned)) * finger.n_units
        expected = "moments in N mm, positive where they open the gaps (angles fall)"
        found = f"{stiffness:.3g} N mm/rad a unit"
        if stiffness <= 0.0:
            problems.append(located(place, MOMENT, expected, found, "is the sign the other one?"))
        elif not hinge / UNLIKELY < stiffness < UNLIKELY * (hinge + dome):
            hint = "N m?" if stiffness < hinge else "N um?"
            problems.append(located(place, MOMENT, expected, found, hint))
    pushes = known.pushes[known.patterns & np.isfinite(known.pushes)]
    usual = hinge * finger.stroke.mean() / lever**2
    key = "push_N" if finger.n_units == 1 else "push1_N"
    if len(pushes) and hinge > 0.0:
        expected = f"pushes of domes in N, positive, about {usual:.2g}"
        push = float(pushes[np.abs(pushes).argmax()])
        found = f"{push:.3g}, the largest"
        if push < 0.0:
            problems.append(located(place, key, expected, found, "is the sign the other one?"))
        elif not usual / UNLIKELY < push < UNLIKELY * usual:
            problems.append(located(place, key, expected, found, "is the unit another one?"))
    problems += _reversed(known, place, finger.n_units)
    if problems:
        raise SpecError(tuple(problems))


def _reversed(known: KnownStates, place: Location, n_units: int) -> Iterator[Problem]:
    """Problems of inverted units that, without a load, turn up or close where others open."""
    free = known.moments == 0.0
    curled = known.angles[-1, free & known.patterns.any(axis=0)]
    opened = known.openings[:, free][known.patterns[:, free]]
    opening = "opening_mm" if n_units == 1 else "opening1_mm"
    for key, values, sign, expected in (
        (TIP_ANGLE, -curled, "y", "angles that fall as the finger curls towards -y"),
        (opening, opened, "it", "openings > 0 of inverted units"),
    ):
        values = values[np.isfinite(values)]
        if len(values) and values.sum() < 0.0:
            found = f"{abs(values.mean()):.3g} in the mean the other way"
            yield located(place, key, expected, found, f"is the sign of {sign} the other one?")


def _turns(known: KnownStates) -> tuple[Array, Array]:
    """How far the end curls beyond its mean for the pattern (rad), and under which moments.

    A straight finger does not turn without a moment.
    """
    turned, under = [], []
    for pattern in np.unique(known.patterns, axis=1).T:
        same = (known.patterns == pattern[:, None]).all(axis=0) & np.isfinite(known.angles[-1])
        if same.any():
            rest = np.zeros(int(not pattern.any()))
            curl = np.concatenate((-known.angles[-1, same], rest))
            moments = np.concatenate((known.moments[same], rest))
            turned.append(curl - curl.mean())
            under.append(moments - moments.mean())
    together = np.concatenate([*turned, np.zeros(0)]), np.concatenate([*under, np.zeros(0)])
    return together if together[1].any() else (np.zeros(0), np.zeros(0))


def check_scale(source: Tabular, known: KnownStates, length: float) -> None:
    """Raise SpecError for what cannot be a finger this long (mm): tips, shapes and angles."""
    place = Location(str(source) if isinstance(source, str | Path) else FRAME)
    problems = []
    points = [shape for shape in known.shapes if shape.size]
    shapes = np.concatenate(points, axis=1) if points else np.zeros((2, 0))
    for key, what, places in (("tip_x_mm", "tips", known.tip), ("x_mm", "shapes", shapes)):
        far = np.max(np.hypot(*places), initial=0.0, where=np.isfinite(places).all(axis=0))
        if far > 0.0 and not length / FARTHEST < far < length * FARTHEST:
            hint = "meters?" if far < length else "micrometers?"
            expected = f"{what} of a finger {length:.4g} mm long, in mm"
            found = f"the farthest at {far:.3g} from the origin"
            problems.append(located(place, key, expected, found, hint))
    turn = np.max(np.abs(known.angles), initial=0.0, where=np.isfinite(known.angles))
    if turn > np.pi * len(known.patterns):  # a unit has two corners of less than 90 degrees
        expected = f"angles of {len(known.patterns)} units in rad"
        problems.append(located(place, TIP_ANGLE, expected, f"{turn:.3g}", "degrees?"))
    if problems:
        raise SpecError(tuple(problems))


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
