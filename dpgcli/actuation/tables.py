"""Tables of a way through pressures: a row for each event, a row for each point."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from dpgcli.actuation.readings import Readings
from dpgcli.actuation.travel import Event, PathPoints, Travel, joined
from dpgcli.arrays import Array, Columns
from dpgcli.design.outputs import STIFFNESS, Output
from dpgcli.design.pressure import History, Pressure
from dpgcli.states.columns import Column, Kind
from dpgcli.states.patterns import texts

SHAPES = (Output.SHAPES,)
TIP = (
    Column("tip_x_mm", "mm", "x of the tip, the last limiting-layer node", outputs=SHAPES),
    Column("tip_y_mm", "mm", "y of the tip; negative is the inner side", outputs=SHAPES),
    Column("tip_angle_rad", "rad", "rotation of the last strut; negative = curled", outputs=SHAPES),
)
APERTURE = Column(
    "aperture_mm", "mm", "gap of the inner faces at the tips; < 0: crossed", outputs=SHAPES
)
OVERLAP = Column(
    "fingers_overlap", "", "the fingers overlap: nothing keeps them apart", kind=Kind.FLAG
)
HEAD = (
    Column("event", "", "number of the event", kind=Kind.COUNT),
    Column("line", "", "pressure line of the unit that gives rise to it", kind=Kind.TEXT),
    Column("pressure_MPa", "MPa", "pressure of that line", outputs=(Output.PRESSURES,)),
    Column("unit", "", "units that flip, the one that gives rise to it first", kind=Kind.TEXT),
    Column("kind", "", "snap, reset, contact or release", kind=Kind.TEXT),
    Column("pattern_before", "", "pattern before the event", kind=Kind.PATTERN),
    Column("pattern_after", "", "pattern after it, at the same pressures", kind=Kind.PATTERN),
    Column(
        "energy_released_mJ",
        "mJ",
        "energy lost, the work of the pressures counted in",
        outputs=(Output.ENERGIES,),
    ),
)
TIE = Column(
    "tie",
    "",
    "other units whose threshold is the same within 1e-6: the model does not say which goes first",
    kind=Kind.TEXT,
)


def event_columns(*, is_gripper: bool) -> tuple[Column, ...]:
    """The columns of events, in every format.

    >>> [column.name for column in event_columns(is_gripper=False)][-2:]
    ['tip_angle_rad', 'tie']
    """
    return (*HEAD, *TIP, *((APERTURE,) if is_gripper else ()), TIE)


def event_rows(way: Travel, readings: Readings, pressure: Pressure) -> Columns:
    """A row for each event; the tip is where it comes to rest at the event's pressures."""
    shapes, events = readings.shapes, way.events
    before, after = (
        np.array([getattr(event, side) for event in events], int) for side in ("before", "after")
    )
    first = np.array([event.units[0] for event in events], int)
    rows: Columns = {
        "event": np.arange(1, len(events) + 1),
        "line": _texts(pressure.lines[line] for line in pressure.line_of[first]),
        "pressure_MPa": shapes.pressure[first, before],
        "unit": _texts(numbered(event.units) for event in events),
        "kind": _texts(event.kind.value for event in events),
        "pattern_before": texts(shapes.inverted[:, before]),
        "pattern_after": texts(shapes.inverted[:, after]),
        "energy_released_mJ": np.array([event.released for event in events]),
        "tie": _texts(numbered(event.tied) for event in events),
    }
    return rows | {name: values[after] for name, values in _tip(readings).items()}


def numbered(units: Sequence[int]) -> str:
    """Units as people count them.

    >>> numbered((0, 1, 4))
    '1,2,5'
    """
    return ",".join(str(unit + 1) for unit in units)


def _texts(words: Iterator[str]) -> np.ndarray[tuple[int], np.dtype[np.str_]]:
    return np.array([*words], np.str_)


def _tip(readings: Readings) -> Columns:
    """The tip's pose, and the aperture if there is one, at each point."""
    rows: Columns = {column.name: values for column, values in zip(TIP, readings.pose, strict=True)}
    if readings.in_gripper is not None:
        rows["aperture_mm"] = readings.in_gripper.aperture
    return rows


def path_columns(
    pressure: Pressure, n_units: int, history: History, *, is_gripper: bool
) -> tuple[Column, ...]:
    """The columns of the points of a path."""
    units = range(1, n_units + 1)
    time = Column("time_s", "s", "time in the history, from its pressures")
    return (
        Column("cycle", "", "how often the history is run through", kind=Kind.COUNT),
        Column("history_step", "", "pressures the point is on the way to, from 1", kind=Kind.COUNT),
        *(() if history.time is None else (time,)),
        *(
            Column(f"pressure_{line}_MPa", "MPa", f"pressure of line {line}")
            for line in pressure.lines
        ),
        Column("pattern", "", "activation pattern, unit 1 first", kind=Kind.PATTERN),
        Column("event", "", "event that it is before, then after; else 0", kind=Kind.COUNT),
        Column("is_stable", "", "no point of a branch beyond the event's fold", kind=Kind.FLAG),
        *(
            Column(f"opening_{unit}_mm", "mm", f"opening of unit {unit}", outputs=SHAPES)
            for unit in units
        ),
        *(
            Column(f"travel_{unit}_mm", "mm", f"travel of the pole of dome {unit}", outputs=SHAPES)
            for unit in units
        ),
        *TIP,
        *((APERTURE, OVERLAP) if is_gripper else ()),
        Column("energy_mJ", "mJ", "energy of the finger", outputs=(Output.ENERGIES,)),
        Column("potential_energy_mJ", "mJ", "the same less p V", outputs=(Output.ENERGIES,)),
        Column("smallest_pivot", "", "of the Hessian, scaled; 0 at a fold", outputs=STIFFNESS),
        Column("residual_N", "N", "largest unbalanced force"),
    )


def path_rows(
    way: Travel,
    branches: Mapping[int, PathPoints],
    readings: Readings,
    pressure: Pressure,
    history: History,
) -> Columns:
    """A row for each point of the path, both sides of each event among them, then of branches.

    The readings are those of all these points.
    """
    points, shapes = joined([way.points, *branches.values()]), readings.shapes
    events = [np.full(len(branch), number) for number, branch in branches.items()]
    first = [
        int(np.flatnonzero(pressure.line_of == line)[0]) for line in range(len(pressure.lines))
    ]
    by_line = zip(pressure.lines, first, strict=True)
    rows: Columns = {"cycle": points.cycle, "history_step": points.step}
    if history.time is not None:
        rows["time_s"] = _times(points, history.time)
    rows |= {f"pressure_{line}_MPa": shapes.pressure[unit] for line, unit in by_line}
    rows |= {
        "pattern": texts(shapes.inverted),
        "event": np.concatenate([_sides(len(way.points), way.events), *events]),
        "is_stable": np.arange(len(points)) < len(way.points),
    }
    for unit, (opening, travelled) in enumerate(
        zip(readings.openings, readings.travels, strict=True), start=1
    ):
        rows |= {f"opening_{unit}_mm": opening, f"travel_{unit}_mm": travelled}
    if readings.in_gripper is not None:
        rows["fingers_overlap"] = readings.in_gripper.overlaps
    return (
        rows
        | _tip(readings)
        | {
            "energy_mJ": readings.energy,
            "potential_energy_mJ": readings.potential_energy,
            "smallest_pivot": readings.balance.curvature,
            "residual_N": readings.balance.residual,
        }
    )


def _times(points: PathPoints, time: Array) -> Array:
    """Times of points, between those of the pressures that they are between."""
    before = time[np.maximum(points.step - 2, 0)]
    return np.asarray(before + points.share * (time[points.step - 1] - before))


def _sides(n_points: int, events: Sequence[Event]) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """The number of the event that a point is a side of, 0 elsewhere."""
    sides = np.zeros(n_points, np.int64)
    for number, event in enumerate(events, start=1):
        sides[[event.before, event.after]] = number
    return sides
