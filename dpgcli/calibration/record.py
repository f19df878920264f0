"""A dome's curve as it was simulated or measured, and warnings about its faults.

Travel u of the dome's pole in mm, positive towards inversion, with any of: energy (mJ), force (N),
pressure (MPa), enclosed volume (mm³), time. Data with time are ordered by it, others by travel.
All thresholds are ours; messages give the numbers behind a judgment.
"""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from dpgcli.arrays import Array, Flags, Indices
from dpgcli.errors import Field, FitError, Message
from dpgcli.records import dataclass

LARGEST_STEP = 0.15  # of the largest travel: nothing is known within a larger step
NEAR_WELL = 0.05  # of the largest travel: how far around a well its shape counts
BEYOND_REST = 0.4  # of the largest travel: where an inverted well may be
RINGING = 0.01  # of the energy at a well: how far a dome that rings is off it
SMALLEST_DEPTH = 0.1  # of the barrier before a well: less is noise
FAST_RATIO = 10.0  # times the speed that three quarters of the moving time stay below
RESTING_SPEED = 0.01  # of the mean speed, range over duration: slower is not moving
SHORTEST_PIECE = 0.01  # of the record's duration: slower for less than that is a turning point
SMALLEST_SWING = 0.02  # of the range of travels: smaller ones do not count as a reversal
AT_REST = 0.01  # of the largest travel: closer to 0 a dome is at rest
MOST_REVERSALS = 2  # of a fast travel: those of a cycle
N_CELLS = 100
DISAGREEMENT = 0.02  # of the range of energies: standard deviation at one travel
MOST_POINTS = 200


@dataclass(frozen=True)
class Record:
    """Arrays (point,), or None where not known; see the module for units."""

    travel: Array
    energy: Array | None = None
    force: Array | None = None
    pressure: Array | None = None
    volume: Array | None = None
    time: Array | None = None

    def points(self, index: Indices | Flags) -> "Record":
        """The record at some of its points."""
        chosen: dict[str, Any] = {k: v if v is None else v[index] for k, v in vars(self).items()}
        return replace(self, **chosen)

    @property
    def largest_travel(self) -> float:
        """The largest travel, in mm."""
        return float(self.travel.max())


def in_order(record: Record) -> tuple[Record, tuple[str, ...]]:
    """The curve sorted by time, else by travel, without repeated points; and the changes made.

    >>> record, said = in_order(Record(np.array([1.0, 0.0, 1.0]), energy=np.array([2.0, 0.0, 2.0])))
    >>> record.travel.tolist(), said
    ([0.0, 1.0], ('the points were not in order of travel: sorted', '1 repeated point left out'))
    """
    said = []
    leading = record.travel if record.time is None else record.time
    if (np.diff(leading) < 0.0).any():
        name = "travel" if record.time is None else "time"
        said.append(f"the points were not in order of {name}: sorted")
        record = record.points(np.argsort(leading, kind="stable"))
    arrays = [v for v in vars(record).values() if v is not None]
    first = np.sort(np.unique(np.stack(arrays), axis=1, return_index=True)[1])
    if n_repeated := len(record.travel) - len(first):
        said.append(f"{n_repeated} repeated point{'s' * (n_repeated != 1)} left out")
        record = record.points(first)
    return record, tuple(said)


def unsampled(travel: Array) -> list[tuple[float, float]]:
    """Stretches of the travel (mm), from rest on, longer than 15 % of the largest without a point.

    >>> unsampled(np.array([2.0, 3.0, 9.0, 10.0]))
    [(0.0, 2.0), (3.0, 9.0)]
    """
    ascending = np.append(min(0.0, travel.min()), np.sort(travel))
    wide = np.flatnonzero(np.diff(ascending) > LARGEST_STEP * ascending[-1])
    return [(float(ascending[i]), float(ascending[i + 1])) for i in wide]


def integral(values: Array, along: Array) -> Array:
    """The integral up to each point, from 0 at the first, by trapezoids.

    >>> integral(np.array([0.0, 2.0, 2.0]), np.array([0.0, 1.0, 3.0])).tolist()
    [0.0, 1.0, 5.0]
    """
    return np.append(0.0, np.cumsum(0.5 * np.diff(along) * (values[1:] + values[:-1])))


def work(record: Record) -> Array:
    """The work done from rest on, ∫F du, or ∫p dV without a force, by trapezoids, mJ, (point,).

    Raises FitError where neither is known, where a static record has an unsampled stretch, or
    where it is not known how much was done up to the first point.
    """
    along, push = (
        (record.travel, record.force)
        if record.force is not None
        else (record.volume, record.pressure)
    )
    if along is None or push is None:
        raise FitError("no work without force_N, or pressure_MPa and volume_mm3")
    start = float(record.travel[0])
    near_rest = LARGEST_STEP if record.force is not None else AT_REST
    gaps = unsampled(record.travel) if record.time is None else []
    if abs(start) > near_rest * record.largest_travel:
        gaps = [(0.0, start)]
    if gaps:
        raise FitError("no work across {:g} to {:g} mm, where nothing is known".format(*gaps[0]))
    before = 0.5 * start * push[0] if record.force is not None else 0.0
    return before + integral(push, along)


def inverted_well(record: Record) -> float | None:
    """The travel (mm) of the inverted dome at rest, None if the curve does not show it.

    The minimum of a cubic through the energies (without them, the integrated force) around the
    one that lies deepest below both sides, else the lowest in the last 60 % of the travel, if it
    is near the points.

    >>> travel = np.linspace(0.0, 3.0, 31)
    >>> round(inverted_well(Record(travel, energy=travel**2 * (travel - 2.5) ** 2)), 3)
    2.5
    """
    record = record.points(np.argsort(record.travel, kind="stable"))
    energy, largest = record.energy, record.largest_travel
    if energy is None:
        push = record.force if record.force is not None else record.pressure
        if push is None:
            return None
        energy = integral(push, record.travel)
    begin = min(BEYOND_REST * largest, _well_of(record.travel, energy))
    late = record.travel > begin
    if not late.any():
        return None
    lowest = record.travel[late][np.argmin(energy[late])]
    away = np.where(late, np.abs(record.travel - lowest), np.inf)
    enough = np.unique(away)[:5][-1]  # at least five points, if they are not far
    near = away <= max(NEAR_WELL * largest, min(enough, LARGEST_STEP * largest))
    if len(np.unique(record.travel[near])) < 4:
        return None
    cubic = np.polynomial.Polynomial.fit(record.travel[near], energy[near], 3)
    flat = cubic.deriv().roots()
    flat = flat[np.isreal(flat)].real
    wells = flat[cubic.deriv(2)(flat) > 0.0]
    if not len(wells):
        return None
    well = float(wells[0])
    is_near = np.abs(record.travel[late] - well).min() <= NEAR_WELL * largest
    on_the_way = (record.travel < well) & (record.travel > well - LARGEST_STEP * largest)
    level = cubic(well) - RINGING * abs(cubic(well) - energy[0])
    comes_down = not on_the_way.any() or energy[on_the_way].mean() > level
    return well if is_near and comes_down and well > begin else None


def _well_of(travel: Array, energy: Array) -> float:
    """Half the travel of the energy that lies deepest below both sides; inf if none lies deep."""
    travel, energy = cleaned(travel, energy)
    before, after = (np.maximum.accumulate(part) for part in (energy, energy[::-1]))
    depth = np.minimum(before, after[::-1]) - energy
    place = int(depth.argmax())
    is_deep = depth[place] > SMALLEST_DEPTH * (before[place] - energy[0])
    return 0.5 * float(travel[place]) if is_deep and depth[place] > 0.0 else np.inf


def speeds(record: Record) -> tuple[Array, float]:
    """Speeds between points, (point − 1,), and the speed above which the dome snaps or rings."""
    assert record.time is not None, "speed needs time"
    duration = float(np.ptp(record.time)) or 1.0
    lasting = np.maximum(np.diff(record.time), np.finfo(float).eps * duration)
    speed = np.abs(np.diff(record.travel)) / lasting
    moving = speed > RESTING_SPEED * np.ptp(record.travel) / duration
    if not moving.any():
        return speed, np.inf
    ascending = np.flatnonzero(moving)[np.argsort(speed[moving], kind="stable")]
    elapsed = np.cumsum(lasting[ascending])
    usual = speed[ascending][np.searchsorted(elapsed, 0.75 * elapsed[-1])]
    return speed, FAST_RATIO * float(usual)


class Pieces(NamedTuple):
    """Flags of the points in slow pieces of a record, (point,), and a message about the choice."""

    kept: Flags
    message: str


def quasi_static(record: Record) -> Pieces:
    """The slow pieces of a record: before a snap, and after its ringing has died.

    Slow is at most ten times the speed that three quarters of the moving time stay below, for at
    least a hundredth of the record. Raises FitError if nothing is left.
    """
    if record.time is None:
        return Pieces(np.ones(len(record.travel), bool), "no time: all points are taken as static")
    speed, limit = speeds(record)
    slow = speed <= limit
    edges = np.flatnonzero(np.diff(np.concatenate(([False], slow, [False])).astype(int)))
    shortest = SHORTEST_PIECE * np.ptp(record.time)
    runs = [
        (a, b)
        for a, b in edges.reshape(-1, 2).tolist()
        if record.time[b] - record.time[a] >= shortest
    ]
    kept = np.zeros(len(record.travel), bool)
    for first, last in runs:
        kept[first : last + 1] = True
    if not kept.any():
        raise FitError("no quasi-static piece: the travel is fast or rings all the time")
    times = ", ".join(f"{record.time[a]:.4g} to {record.time[b]:.4g}" for a, b in runs)
    dropped = f"dropped {int((~kept).sum())} of {len(kept)} points"
    why = f"that snap or ring (faster than {limit:.3g} mm/s)"
    return Pieces(kept, f"quasi-static pieces, time {times}: {dropped} {why}")


def record_warnings(record: Record, *, is_cut: bool) -> Iterator[str]:
    """Warnings about faults of a record; `is_cut` if only its slow pieces are used."""
    if not is_cut and rings(record):
        yield Message(
            f"ringing: the travel reverses {_reversals(record)} times while it is fast; ",
            Field("branches"),
            " quasi-static leaves that out",
        )
    if record.energy is None:
        return
    yield from _disagreement(record.travel, record.energy)
    with suppress(FitError):  # no work is known
        yield from _departure(record.energy, work(record))
    at_rest = np.abs(record.travel) <= AT_REST * record.largest_travel
    if at_rest.any():
        offset = float(record.energy[at_rest][0])
        if abs(offset) > 0.01 * np.ptp(record.energy):
            yield f"the energy at rest is {offset:.4g} mJ, not 0 as the law has it"


def rings(record: Record) -> bool:
    """Whether the travel swings while it is fast; False without time."""
    return _reversals(record) > MOST_REVERSALS


def _reversals(record: Record) -> int:
    """The number of reversals of the travel in its fast part."""
    if record.time is None:
        return 0
    from scipy.signal import find_peaks  # half of a fit's start, for records with time only

    speed, limit = speeds(record)
    fast = np.flatnonzero(speed > limit)
    if not len(fast):
        return 0
    travel = record.travel[fast[0] : fast[-1] + 2]
    swing = SMALLEST_SWING * np.ptp(record.travel)
    return sum(len(find_peaks(sign * travel, prominence=swing)[0]) for sign in (1.0, -1.0))


def _disagreement(travel: Array, energy: Array) -> Iterator[str]:
    """Energies that differ at the same travel: the record drifts, dissipates or is noisy."""
    width = np.ptp(travel) / N_CELLS
    cell = np.floor((travel - travel.min()) / width).astype(int) if width > 0.0 else travel * 0
    most, place = 3, -1
    for number in np.unique(cell):
        inside = cell == number
        if inside.sum() > most:
            away = travel[inside] - travel[inside].mean()
            slope = (away @ energy[inside]) / ((away @ away) or 1.0)
            rest = energy[inside] - slope * away
            if rest.std() > DISAGREEMENT * np.ptp(energy):
                most, place = int(inside.sum()), int(number)
    if place >= 0:
        inside = cell == place
        low, high = energy[inside].min(), energy[inside].max()
        yield (
            f"drifting energy: at {most} points near a travel of {travel[inside].mean():.4g} mm it "
            f"is anything from {low:.4g} to {high:.4g} mJ"
        )


def _departure(energy: Array, done: Array) -> Iterator[str]:
    """An energy that is not the work done."""
    done = done - done[0]
    away = np.abs(energy - energy[0] - done)
    worst = int(away.argmax())
    if away[worst] > 0.05 * np.ptp(energy):
        yield Message(
            f"the energy is not the work done: {energy[worst]:.4g} mJ where the work is "
            f"{energy[0] + done[worst]:.4g} mJ; ",
            Field("quantity"),
            " work integrates it",
        )


def cleaned(travel: Array, energy: Array) -> tuple[Array, Array]:
    """The curve by ascending travel, thinned to about 200 points.

    Points within the same two-hundredth of the sampled travel are averaged, as are neighbors that
    are closer than a quarter of it.

    >>> cleaned(np.array([2.0, 0.0, 2.0]), np.array([5.0, 0.0, 7.0]))
    (array([0., 2.]), array([0., 6.]))
    """
    ascending = np.argsort(travel, kind="stable")
    travel, energy = travel[ascending], energy[ascending]
    gaps = sum(end - start for start, end in unsampled(travel))
    width = (travel[-1] - min(0.0, travel[0]) - gaps) / MOST_POINTS
    for cell in (np.floor(travel / width) if width > 0.0 else travel, None):
        if cell is None:  # neighbors on both sides of a cell's edge
            cell = np.cumsum(np.diff(travel, prepend=travel[0]) > 0.25 * width)
        _, group, counts = np.unique(cell, return_inverse=True, return_counts=True)
        travel, energy = (np.bincount(group, values) / counts for values in (travel, energy))
    return travel, energy


def lag1_autocorrelation(residuals: Array) -> float:
    """Lag-1 autocorrelation of residuals: 0 if independent, towards 1 if neighbors agree.

    Σ r_i r_(i+1) / Σ r_i², without the mean, since residuals of a fit are about zero.

    >>> round(lag1_autocorrelation(np.array([1.0, 1.0, 1.0, -1.0, -1.0, -1.0])), 3)
    0.5
    """
    squares = float((residuals**2).sum())
    return float((residuals[1:] * residuals[:-1]).sum()) / squares if squares > 0.0 else 0.0
