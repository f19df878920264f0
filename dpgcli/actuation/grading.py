"""The nearest dome heights with which pulses lead to a pattern.

Of each unit by itself the thresholds are known by its dome's height, see `alone`; what a pulse does
is read off as `orders` does. Sought are heights next to the given ones, by the sum of squares, with
which one pulse up, or one up and one down, on each line lead from rest to the pattern, and no peak
is nearer to a threshold than half a separation. What is found is a proposal: bars and walls have no
part in it, so that the finger has to be followed.
"""

import numpy as np

from dpgcli.actuation.alone import thresholds_alone
from dpgcli.actuation.pressed import Pressed
from dpgcli.arrays import Array, Flags, Indices
from dpgcli.design.by_unit import size_by_unit, with_sizes
from dpgcli.design.dimensions import Design
from dpgcli.design.geometry import HULL
from dpgcli.design.resolve import resolve
from dpgcli.states.units import UnitSolutions

HEIGHT = "dome_height_mm"
SEPARATION = 0.05  # of a pressure: how far thresholds that must differ are kept apart
FINEST = 0.01  # mm, of heights: molds are no finer
SAMPLED = 0.1  # mm between heights whose thresholds are found; between them they are linear
PEAKS = 121  # tried on each line, up and down, beside those next to the given thresholds


def nearest_heights(design: Design, line_of: Indices, inverted: Flags) -> Array | None:
    """Heights, mm, (unit,), of one design whose pulses may lead to the pattern `inverted`.

    They lie within the range of finite elements, 4.5 to 7.5 mm, or that of the given ones where
    it is wider. None where heights are not given, or none of these do.
    """
    given = size_by_unit(design, HEIGHT)
    if given is None:
        return None
    heights = _candidates(given[:, 0])
    snap, reset = _sizes_at(design, given[:, 0], heights)
    found = np.empty(len(line_of))
    for line in range(int(line_of.max()) + 1):
        units = np.flatnonzero(line_of == line)
        own = _on_one_line(
            given[units, 0], heights[units], snap[units], reset[units], inverted[units]
        )
        if own is None:
            return None
        found[units] = own
    return found


def _range(given: Array) -> tuple[float, float]:
    """Heights within which to look, mm."""
    lowest, highest = HULL["dome_height"]
    return min(lowest, float(given.min())), max(highest, float(given.max()))


def _candidates(given: Array) -> Array:
    """Heights to choose from, (unit, height), the nearest to the given one first: that itself."""
    low, high = _range(given)
    grid = np.round(np.arange(low, high + 0.5 * FINEST, FINEST), 10)
    every = np.concatenate([given[:, None], np.broadcast_to(grid, (len(given), len(grid)))], axis=1)
    order = np.argsort(np.abs(every - given[:, None]), axis=1, kind="stable")
    return np.take_along_axis(every, order, axis=1)


def _sizes_at(design: Design, given: Array, heights: Array) -> tuple[Array, Array]:
    """Sizes of the thresholds of units at heights, both (unit, height), MPa; NaN where none are."""
    low, high = _range(given)
    sampled = np.linspace(low, high, 1 + max(1, round((high - low) / SAMPLED)))
    sampled = np.unique(np.concatenate([sampled, given]))
    snap, reset = _sampled(design, np.broadcast_to(sampled, (len(given), len(sampled))))
    rows = zip(heights, snap, reset, strict=True)
    both = [(np.interp(own, sampled, up), np.interp(own, sampled, down)) for own, up, down in rows]
    return np.stack([up for up, _ in both]), np.stack([down for _, down in both])


def _sampled(design: Design, heights: Array) -> tuple[Array, Array]:
    """The same at some heights, each of which is a design."""
    snap, reset = np.full(heights.shape, np.nan), np.full(heights.shape, np.nan)
    resolution = resolve(with_sizes(design, HEIGHT, heights))
    for part in resolution.alike(np.flatnonzero(~resolution.are_wrong)):
        scene = resolution.batch(part)
        assert scene.pressure is not None, "heights are sought for pressures"
        alone = thresholds_alone(Pressed.of(UnitSolutions.of(scene.finger), scene.pressure))
        snap[:, part], reset[:, part] = np.abs(alone.snap), np.abs(alone.reset)
    return snap, reset


def _on_one_line(
    given: Array, heights: Array, snap: Array, reset: Array, inverted: Flags
) -> Array | None:
    """Heights of the units of a line, (unit,), by thresholds at their candidates."""
    up = _peaks(snap)[:, None, None]
    down = np.append(0.0, _peaks(reset))[None, :, None]  # none perhaps
    if not up.size:  # no unit is bistable at any height
        return None
    low, high = 1.0 - 0.5 * SEPARATION, 1.0 + 0.5 * SEPARATION
    cost, chosen = np.zeros((up.size, down.size)), []
    for unit, is_up in enumerate(inverted):
        u, r = snap[unit], reset[unit]
        stays = (u <= low * up) & (r >= high * down)
        leaves = (u >= high * up) | (r <= low * down)
        fits = stays if is_up else leaves
        first = fits.argmax(axis=2)  # the nearest height
        change = (heights[unit, first] - given[unit]) ** 2
        cost += np.where(fits.any(axis=2), change, np.inf)
        chosen.append(heights[unit, first])
    best = np.unravel_index(int(cost.argmin()), cost.shape)
    return np.array([own[best] for own in chosen]) if np.isfinite(cost[best]) else None


def _peaks(thresholds: Array) -> Array:
    """Sizes of pressures to try, MPa: those that leave given heights alone, and ones between."""
    known = thresholds[np.isfinite(thresholds)]
    if not len(known):
        return np.zeros(0)
    ends = np.linspace(known.min() / (1.0 + SEPARATION), known.max() * (1.0 + SEPARATION), PEAKS)
    own = thresholds[:, 0]
    beside = [own / (1.0 - 0.5 * SEPARATION), own / (1.0 + 0.5 * SEPARATION)]
    return np.unique(np.concatenate([ends, *(part[np.isfinite(part)] for part in beside)]))
