"""The pressure at which a recorded dome snapped."""

import numpy as np

from dpgcli.arrays import Array
from dpgcli.calibration.branches import in_time, ways
from dpgcli.calibration.record import LARGEST_STEP, Record, speeds

FALLEN = 0.05  # of the largest pressure: what is lower behind it has a limit point before it
LEFT_REST = 0.2  # of the largest pressure: lower ones may be noise about 0


def snap_pressure(record: Record) -> float | None:
    """The largest pressure (MPa) that the dome bore on its first way from rest, before it snapped.

    It snaps where its travel becomes fast, or, in a record without such a piece, where nothing is
    sampled any more or where the pressure falls. None where the pressure is not known, or where it
    only rises.

    >>> travel = np.linspace(0.0, 3.0, 31)  # a path past the limit point at 1 mm, and its well at 2
    >>> snap_pressure(Record(travel, pressure=travel * (2.0 - travel)))
    1.0
    """
    if record.pressure is None:
        return None
    record = in_time(record)
    found = ways(record)
    if found is None:
        record = record.points(np.argsort(record.travel, kind="stable"))
    assert record.pressure is not None, "points have what their record has"
    first, last = (0, len(record.travel) - 1) if found is None else found.runs[0]
    travel = record.travel[first : last + 1]
    if travel[-1] < travel[0] or travel[0] > LARGEST_STEP * record.largest_travel:
        return None
    pressure = record.pressure[first : last + 1]
    stop = _end(record, travel, pressure)
    largest = float(pressure[:stop].max())
    behind = pressure[int(pressure[:stop].argmax()) : stop]
    is_known = stop < len(travel) or behind.min() < (1.0 - FALLEN) * largest
    return largest if is_known and largest > 0.0 else None


def _end(record: Record, travel: Array, pressure: Array) -> int:
    """How many points of a first way are before the snap; all where it does not show."""
    if record.time is not None:
        speed, limit = speeds(record)
        fast = np.flatnonzero(speed[: len(travel) - 1] > limit)
        if len(fast):
            return int(fast[0]) + 1
    steps = np.diff(travel) > LARGEST_STEP * record.largest_travel
    has_left = np.maximum.accumulate(pressure) > LEFT_REST * np.abs(pressure).max()
    is_over = has_left[1:] & (pressure[1:] <= 0.0)
    ends = np.flatnonzero(steps | is_over)
    return int(ends[0]) + 1 if len(ends) else len(travel)
