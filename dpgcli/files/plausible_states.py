"""Whether known states can be those of a finger, or are of another one, sign or unit."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from dpgcli.arrays import Array
from dpgcli.calibration.known import KnownStates
from dpgcli.errors import Problem, SpecError
from dpgcli.files.csv_file import FRAME, Tabular
from dpgcli.files.known_states import MOMENT, TIP_ANGLE, read_states
from dpgcli.files.places import Location, located
from dpgcli.mechanics.finger import Finger
from dpgcli.text import counted

UNLIKELY = 30.0  # times what hinge and dome say, or as little of it: another unit
ODD = 6.0  # times the stroke or the length that is known, or as little of it: another unit
FARTHEST = 20.0  # times the finger's length from the origin, or as little of it: another unit
SMALLEST = 1e-9  # rad or mm: less is rounding
LEVERS = (1e-3, 1e5)  # mm, of domes above their hinges: thousands of times as large or small


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
    if len(turned) and np.abs(turned).max() < SMALLEST:
        expected = "angles that fall as moments rise"
        problems.append(located(place, _angle(known), expected, "the same under all moments"))
    elif len(turned) and hinge > 0.0:
        stiffness = float(under @ turned / (turned @ turned)) * finger.n_units
        range_of = (hinge / UNLIKELY, UNLIKELY * (hinge + dome))
        problems += _wrong_moments(place, stiffness, range_of)
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


def _wrong_moments(
    place: Location, stiffness: float, range_of: tuple[float, float]
) -> Iterator[Problem]:
    """Problems of moments over turns, N mm/rad a unit, beside what they may be."""
    low, high = range_of
    if low < stiffness < high:
        return
    guesses = ((1e3, "N m?"), (1e-3, "N um?"))  # which it would be right in
    near = [guess for factor, guess in guesses if low < factor * stiffness < high]
    hint = near[0] if near else "is the unit another one, of moments or of angles?"
    hint = hint if stiffness > 0.0 else "is the sign the other one?"
    expected = "moments in N mm, positive where they open the gaps (angles fall)"
    yield located(place, MOMENT, expected, f"{stiffness:.3g} N mm/rad a unit", hint)


def _angle(known: KnownStates) -> str:
    """The column of the angles, of one unit as its tables have it."""
    return "chamber2_angle_rad" if len(known.patterns) == 1 else TIP_ANGLE


def _reversed(known: KnownStates, place: Location, n_units: int) -> Iterator[Problem]:
    """Problems of inverted units that, without a load, turn up or close where others open.

    Or do neither.
    """
    free = known.moments == 0.0
    curled = known.angles[-1, free & known.patterns.any(axis=0)]
    opened = known.openings[:, free][known.patterns[:, free]]
    opening = "opening_mm" if n_units == 1 else "opening1_mm"
    for key, values, sign, expected in (
        (_angle(known), -curled, "y", "angles that fall as the finger curls towards -y"),
        (opening, opened, "it", "openings > 0 of inverted units"),
    ):
        values = values[np.isfinite(values)]
        largest = np.max(np.abs(values), initial=0.0)
        if len(values) and largest < SMALLEST:
            yield located(place, key, expected, f"{largest:.3g} at most")
        elif values.sum() < 0.0:
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
    if problems := [*problems, *_wrong_angles(known, place)]:
        raise SpecError(tuple(problems))


def _wrong_angles(known: KnownStates, place: Location) -> Iterator[Problem]:
    """Problems of angles beyond what units turn by, or next to none where they have to."""
    sizes, is_known = np.abs(known.angles), np.isfinite(known.angles)
    turn = np.max(sizes, initial=0.0, where=is_known)
    is_turned = is_known & (known.patterns.any(axis=0) | (known.moments != 0.0))
    turned = np.max(sizes, initial=0.0, where=is_turned)
    expected = f"angles of {counted(len(known.patterns), 'unit')} in rad"
    if turn > np.pi * len(known.patterns):  # a unit has two corners of less than 90 degrees
        yield located(place, _angle(known), expected, f"{turn:.3g}", "degrees?")
    elif 0.0 < turned < SMALLEST:
        yield located(place, _angle(known), expected, f"{turned:.3g} at most")


def check_lever(source: Tabular, known: KnownStates, lever: float) -> None:
    """Raise SpecError for openings over turns (mm) that put no dome above its hinge."""
    place = Location(str(source) if isinstance(source, str | Path) else FRAME)
    low, high = LEVERS
    problems = [*_wrong_angles(known, place)]
    if not problems and not low <= lever <= high:
        expected = f"openings in mm that are turns in rad times a height of {low:g} to {high:g} mm"
        problems.append(located(place, "opening_mm", expected, f"{lever:.3g} mm"))
    if problems:
        raise SpecError(tuple(problems))
