"""How a measured curve leaves rest: its sign, a load cell or a travel that was not set to zero.

A law has no force at rest, and its force rises with the travel from there on. A record of a testing
machine may begin before the dome is touched, under a load, or at the position of the crosshead.
All thresholds are ours.
"""

from collections.abc import Iterator

import numpy as np

from dpgcli.arrays import Array
from dpgcli.calibration.record import LARGEST_STEP, Record
from dpgcli.errors import Field, FitError, Message

NEAR_REST = 0.1  # of the largest travel: a parabola follows a law there to 0.3 % of its peak
FEWEST_NEAR_REST = 6  # points
OFFSET = 0.02  # of the largest force; a smaller one is no offset
SIGNIFICANT = 3.0  # standard errors
LEAVES_REST = 0.2  # of the largest force: a load that tells the sign
RISES = (0.05, 0.3)  # of the largest force before the peak: between them it rises from contact
SLACK = 0.03  # of the largest travel; a law has risen to 5 % of its peak at 0.5 %
FAR = 0.5  # of the largest travel: a record that begins there
LOADED = 0.05  # of the largest force: a dome with less is at rest


def check_sign(record: Record) -> None:
    """Raise FitError for a force or a pressure that pulls where a dome leaves its rest."""
    for name, key, push in _pushes(record):
        _, load = _from_rest(record.travel, push)
        is_large = np.abs(load) > LEAVES_REST * np.abs(push).max()
        if len(load) and load[is_large.argmax()] < 0.0:
            raise FitError(
                f"the {name} is negative where the dome leaves its rest: is its sign the other way "
                "round? ",
                Field("column"),
                f" {key}=-TITLE reverses it",
            )


def beginning_warnings(record: Record) -> Iterator[str]:
    """Warnings about a force or a pressure at rest, and about travel before it rises."""
    for name, key, push in _pushes(record):
        unit = key.rpartition("_")[2]
        travel, load = _from_rest(record.travel, push)
        if not len(travel):
            if record.travel.min() > FAR * record.largest_travel:
                yield from _far(record, name, push)
            continue
        yield from _offset(travel, load, name, unit)
        yield from _slack(travel, load, name)


def _pushes(record: Record) -> Iterator[tuple[str, str, Array]]:
    for name, key in (("force", "force_N"), ("pressure", "pressure_MPa")):
        push = getattr(record, name)
        if push is not None and np.abs(push).max() > 0.0:
            yield name, key, push


def _from_rest(travel: Array, push: Array) -> tuple[Array, Array]:
    """The curve by ascending travel; empty where it begins elsewhere than near rest."""
    order = np.argsort(travel, kind="stable")
    travel, push = travel[order], push[order]
    is_near = abs(travel[0]) <= LARGEST_STEP * travel[-1]
    return (travel, push) if is_near else (travel[:0], push[:0])


def _offset(travel: Array, load: Array, name: str, unit: str) -> Iterator[str]:
    near = travel <= NEAR_REST * travel[-1]
    if near.sum() < FEWEST_NEAR_REST or len(np.unique(travel[near])) < FEWEST_NEAR_REST:
        return
    powers = np.stack([travel[near] ** power for power in range(3)], axis=1)
    powers = powers / np.abs(powers).max(axis=0)
    found, *_ = np.linalg.lstsq(powers, load[near], rcond=None)
    spare = int(near.sum()) - 3
    variance = float(((load[near] - powers @ found) ** 2).sum()) / spare
    error = np.sqrt(variance * np.linalg.pinv(powers.T @ powers)[0, 0])
    if abs(found[0]) > max(OFFSET * np.abs(load).max(), SIGNIFICANT * error):
        yield (
            f"the {name} at rest is {found[0]:.3g} {unit}, not 0 as the law has it: take it off, "
            "or say where the travel begins"
        )


def _slack(travel: Array, load: Array, name: str) -> Iterator[str]:
    """A load that stays what it is at first: nothing is touched yet."""
    peak = int(np.argmax(load[travel <= FAR * travel[-1]]))
    low, high = (share * load[peak] for share in RISES)
    rise = np.arange(peak + 1)
    rise = rise[(load[: peak + 1] >= low) & (load[: peak + 1] <= high)]
    if len(rise) < 2 or np.ptp(travel[rise]) == 0.0:
        return
    slope, start = np.polyfit(travel[rise], load[rise], 1)
    contact = -start / slope if slope > 0.0 else 0.0
    before = load[travel < contact]
    if contact > SLACK * travel[-1] and len(before) and np.abs(before).max() < high:
        yield (
            f"the {name} begins to rise at a travel of {contact:.3g} mm: if the dome is not "
            "touched before, take that off the travel"
        )


def _far(record: Record, name: str, push: Array) -> Iterator[str]:
    first = int(np.argmin(record.travel))
    if abs(push[first]) <= LOADED * np.abs(push).max():
        yield Message(
            f"the travel begins at {record.travel[first]:.4g} mm, with hardly a {name}: if that is "
            "a position and the dome is at rest there, take it off the travel"
        )
