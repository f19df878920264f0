"""Predicted states beside known ones: finite elements or measurements, in their own frame."""

import numpy as np

from dpgcli.arrays import Array, Columns
from dpgcli.calibration.known import Frame, KnownStates, LatticeStates, lattice_states
from dpgcli.errors import Field, Message
from dpgcli.mechanics.finger import Finger
from dpgcli.records import dataclass
from dpgcli.states.columns import Column, Kind
from dpgcli.states.patterns import texts

MISFIT = 0.02  # of the finger's length: how far a straight finger may be off in its own frame
ALIKE = 2.0  # times the spread of errors: a mean that is larger is one of the frame
POINTS_AT_ONCE = 2**12
SMALLEST_DEFLECTION = 1e-2  # of the largest: a smaller one counts as the straight finger


@dataclass(frozen=True)
class Comparison:
    """Errors of predicted states, (state,), NaN if missing in the lattice or in the data.

    `distance` (mm) between the tips, `deflection` (mm) of the known tip from where the straight
    finger's is, `tip_angle` the difference of the tip angles (rad), and largest differences over
    units: `angle` of the phalanges (rad; where more than the last is known), `opening` (mm), `push`
    (N). `stiffness` is the relative error of the stiffness against an end moment: what the known
    tip turns by under it, over what the predicted one does, less 1; of states that are in the data
    without a moment, too. `shape` (2, state) is the
    largest and the root mean square distance (mm) of the known points from the predicted layer.
    """

    states: LatticeStates
    distance: Array
    deflection: Array
    tip_angle: Array
    angle: Array
    opening: Array
    push: Array
    stiffness: Array
    shape: Array

    @property
    def relative(self) -> Array:
        """Distance over deflection; NaN for a tip that hardly moves."""
        largest = np.max(self.deflection, initial=0.0, where=np.isfinite(self.deflection))
        moved = self.deflection > SMALLEST_DEFLECTION * largest
        return np.where(moved, self.distance / np.where(moved, self.deflection, 1.0), np.nan)


def compare(finger: Finger, known: KnownStates, frame: Frame) -> Comparison:
    """Compare the states of one finger with known ones.

    >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
    >>> finger = uniform_finger(2, **STUDY)
    >>> straight = np.array([[False], [False]])
    >>> known = KnownStates.of_tips(straight, np.array([[27.0], [1.0]]))
    >>> float(compare(finger, known, Frame()).distance[0])
    1.0
    """
    states = lattice_states(finger, known.patterns, frame, known.moments)
    straight = frame.tips(np.array([finger.straight_length, [0.0], [0.0]]))
    angles = np.abs(states.angles - known.angles)
    has_more = np.isfinite(known.angles[:-1]).any(axis=0)  # than that of the tip
    return Comparison(
        states=states,
        distance=np.hypot(*(states.tip - known.tip)),
        deflection=np.hypot(*(known.tip - straight)),
        tip_angle=angles[-1],
        angle=np.where(has_more, _largest(angles), np.nan),
        opening=_largest(np.abs(states.openings - known.openings)),
        push=_largest(np.abs(states.pushes - known.pushes)),
        stiffness=_stiffness_errors(known, states.angles[-1]),
        shape=_shape_errors(
            _from_clamp(states.layer, float(finger.straight_length[0])), known.shapes
        ),
    )


def frame_misfit(finger: Finger, known: KnownStates, found: Comparison, frame: Frame) -> str:
    """What is to be said if the data's frame is another one; empty if it fits.

    A straight finger is straight in any model. Without one in the data, tips that are all off by
    the same show it.
    """
    off = known.tip - found.states.tip
    off = off[:, np.isfinite(off).all(axis=0)]
    straight = ~known.patterns.any(axis=0) & (known.moments == 0.0)
    straight &= np.isfinite(known.tip - found.states.tip).all(axis=0)
    if straight.any():
        shift, what = (known.tip - found.states.tip)[:, straight][:, 0], "the straight state is off"
    elif off.shape[1] > 1:
        shift, what = off.mean(axis=1), "all tips are off in the same way,"
        if np.hypot(*shift) < ALIKE * np.sqrt(((off - shift[:, None]) ** 2).sum(axis=0).mean()):
            return ""
    else:
        return ""
    if np.hypot(*shift) < MISFIT * float(finger.straight_length[0]):
        return ""
    places = (np.add(place, shift) + 0.0 for place in (frame.first_station, frame.tip))
    station, tip = ("{:.4g},{:.4g}".format(*place) for place in places)
    return Message(
        f"the frame does not fit: {what} by {np.hypot(*shift):.4g} mm; ",
        Field("first_station"),
        f" {station} would bring that to zero, as would ",
        Field("tip_offset"),
        f" {tip}, or a part of it in each",
    )


def _stiffness_errors(known: KnownStates, angle: Array) -> Array:
    """Δθ known over Δθ predicted, less 1, from the pattern's row without a moment, (state,)."""
    unloaded = {p.tobytes(): i for i, p in enumerate(known.patterns.T) if known.moments[i] == 0.0}
    own = np.array([unloaded.get(p.tobytes(), i) for i, p in enumerate(known.patterns.T)])
    turned, predicted = (a - a[own] for a in (known.angles[-1], angle))
    has_turned = predicted != 0.0
    return np.where(has_turned, turned / np.where(has_turned, predicted, 1.0) - 1.0, np.nan)


def _largest(errors: Array) -> Array:
    """The largest known error over units, (state,); NaN if none is known."""
    is_known = np.isfinite(errors)
    largest = np.max(errors, axis=0, initial=0.0, where=is_known)
    return np.where(is_known.any(axis=0), largest, np.nan)


def _from_clamp(layer: Array, length: float) -> Array:
    """The layer with a straight piece before its first station, as long as the finger."""
    before = layer[:, :1] - np.array([length, 0.0])[:, None, None]
    return np.concatenate((before, layer), axis=1)


def _shape_errors(layer: Array, shapes: tuple[Array, ...]) -> Array:
    errors = np.full((2, layer.shape[2]), np.nan)
    for state, points in enumerate(shapes):
        if points.size and np.isfinite(layer[:, :, state]).all():
            parts = range(0, points.shape[1], POINTS_AT_ONCE)
            line = layer[:, :, state]
            apart = np.concatenate(
                [distances(points[:, i : i + POINTS_AT_ONCE], line) for i in parts]
            )
            errors[:, state] = apart.max(), np.sqrt((apart**2).mean())
    return errors


def distances(points: Array, line: Array) -> Array:
    """Distance (mm) of points (2, m) from a line through corners (2, k), (m,).

    >>> distances(np.array([[-3.0, 1.0], [4.0, 2.0]]), np.array([[0.0, 2.0], [0.0, 0.0]])).tolist()
    [5.0, 2.0]
    """
    start, along = line[:, :-1, None], np.diff(line, axis=1)[:, :, None]
    beside = points[:, None] - start
    squared = (along**2).sum(axis=0)
    share = (beside * along).sum(axis=0) / np.where(squared > 0.0, squared, 1.0)
    nearest = beside - np.clip(share, 0.0, 1.0) * along
    return np.asarray(np.hypot(*nearest).min(axis=0))


def _number_column(name: str, unit: str, description: str) -> Column:
    return Column(name, unit, description)


COLUMNS = (
    Column("pattern", "", "activation pattern", kind=Kind.PATTERN),
    Column("status", "", "stable where certified, else why not", kind=Kind.STATUS),
    _number_column("tip_x_mm", "mm", "predicted tip"),
    _number_column("tip_y_mm", "mm", "predicted tip"),
    _number_column("moment_N_mm", "N mm", "end moment, positive where it opens the gaps"),
    _number_column("known_x_mm", "mm", "known tip"),
    _number_column("known_y_mm", "mm", "known tip"),
)
ERRORS = (
    _number_column("error_mm", "mm", "distance between the tips"),
    _number_column("error_percent", "%", "the same over the deflection of the known tip"),
    _number_column("angle_error_rad", "rad", "difference of the tip angles"),
    _number_column("max_angle_error_rad", "rad", "largest difference of the phalanges' angles"),
    _number_column("max_opening_error_mm", "mm", "largest difference of the openings"),
    _number_column("max_push_error_N", "N", "largest difference of the domes' pushes"),
    _number_column(
        "stiffness_error_percent", "%", "of the stiffness against the end moment, from no moment"
    ),
    _number_column("max_shape_error_mm", "mm", "largest distance of a known point from the layer"),
    _number_column("rms_shape_error_mm", "mm", "root mean square of these distances"),
)
CALIBRATED = "calibrated_"


def rows(known: KnownStates, found: Comparison, calibrated: Comparison | None = None) -> Columns:
    """Columns by name: predicted and known tips, and the errors of quantities in the data.

    With a calibrated comparison its errors stand beside the others'.
    """
    table = {
        "pattern": texts(known.patterns),
        "status": found.states.status,
        **({"moment_N_mm": known.moments} if known.moments.any() else {}),
        "tip_x_mm": found.states.tip[0],
        "tip_y_mm": found.states.tip[1],
        "known_x_mm": known.tip[0],
        "known_y_mm": known.tip[1],
    }
    errors = _errors(found)
    better = {} if calibrated is None else _errors(calibrated)
    shown = [name for name in errors if _has_any(errors[name]) or _has_any(better.get(name))]
    return {
        **table,
        **{name: errors[name] for name in shown},
        **{CALIBRATED + name: better[name] for name in shown if better},
    }


def _has_any(errors: Array | None) -> bool:
    return errors is not None and bool(np.isfinite(errors).any())


def _errors(found: Comparison) -> Columns:
    errors = (
        found.distance,
        100.0 * found.relative,
        found.tip_angle,
        found.angle,
        found.opening,
        found.push,
        100.0 * found.stiffness,
        *found.shape,
    )
    return {column.name: values for column, values in zip(ERRORS, errors, strict=True)}


def columns(table: Columns) -> tuple[Column, ...]:
    """The columns that a comparison has."""
    calibrated = (
        _number_column(CALIBRATED + c.name, c.unit, f"{c.description}, calibrated") for c in ERRORS
    )
    return tuple(c for c in (*COLUMNS, *ERRORS, *calibrated) if c.name in table)
