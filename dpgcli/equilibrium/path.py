"""Paths of equilibria as a load changes, each lane on its own: to a load, to a fold or to an event.

A path is followed by one of the family's scalars q, the one that moves most, or by the load where
that is near its end (`corrector`).

Along the path dλ/dq falls to zero at a fold. It is approached from before, by secants on dλ/dq, so
that cells which reach their folds at the same load do no harm: at a distance of τ scales λ is short
of the fold by ½ τ dλ/dτ, up to terms of order τ³.
"""

from collections.abc import Callable, Sequence
from dataclasses import fields

import numpy as np

from dpgcli.arrays import Array, Flags, Indices
from dpgcli.equilibrium.banded import in_lanes
from dpgcli.equilibrium.contracts import Coordinates
from dpgcli.equilibrium.corrector import corrected
from dpgcli.equilibrium.loaded import LoadedLaw, LoadedPotential
from dpgcli.equilibrium.steps import one_step
from dpgcli.equilibrium.walk import PathEnd, Walk, margin_of, turn
from dpgcli.records import dataclass

LARGEST_STEP = 0.1  # of a cell's scale
MAX_STEPS = 600

Watch = Callable[[Indices, Array, Array], None]
"""Told lanes, their coordinates (size, lane) and loads (lane,) after each step."""


@dataclass(frozen=True)
class Ends:
    """The ends of some paths: coordinates (size, batch), loads (batch,) and outcomes.

    At folds and events `cell` is the one that gave rise to it, −1 elsewhere, and `onward` the
    motion of the coordinates per step of one scale, along the path.
    """

    coordinates: Array
    load: Array
    outcome: Indices
    cell: Indices
    onward: Array

    @classmethod
    def joined(cls, parts: "Sequence[Ends]", size: int) -> "Ends":
        """Several, with the first coordinates only, of which all have so many."""
        rows = {"coordinates": slice(size), "onward": slice(size)}
        return cls(
            *(
                np.concatenate([getattr(p, f.name)[rows.get(f.name, ...)] for p in parts], axis=-1)
                for f in fields(cls)
            )
        )

    def take_lanes(self, lanes: Indices) -> "Ends":
        """Some lanes."""
        return Ends(*(np.take(getattr(self, f.name), lanes, axis=-1) for f in fields(self)))


def follow(
    family: LoadedPotential[Coordinates, LoadedLaw],
    coordinates: Array,
    load: Array,
    end: Array,
    largest_step: float = LARGEST_STEP,
    watch: Watch | None = None,
) -> Ends:
    """Follow stable equilibria from loads to others, (batch,), as far as they go.

    The paths begin at equilibria, (size, batch), and end at a fold, where the Hessian is singular,
    at an event, where a margin of the law falls to zero, or at the load asked for. `watch` is told
    where they are after each step; one that failed is told as no step.
    """
    nobody = np.arange(len(load))
    return _walked(family, coordinates, load, end, None, nobody, largest_step, watch)[0]


def to_events(
    family: LoadedPotential[Coordinates, LoadedLaw],
    coordinates: Array,
    load: Array,
    end: Array,
    walk: Walk | None,
    fresh: Indices,
) -> tuple[Ends, Walk]:
    """The same, as far as to where some lanes have come to their end or to an event.

    Outcomes of those that are still under way are −1. They go on by their `walk` the next time; the
    `fresh` ones, all of them if there is no walk, begin.
    """
    return _walked(family, coordinates, load, end, walk, fresh, LARGEST_STEP, None, pauses=True)


@in_lanes
def _walked(
    family: LoadedPotential[Coordinates, LoadedLaw],
    coordinates: Array,
    load: Array,
    end: Array,
    walk: Walk | None,
    fresh: Indices,
    largest_step: float,
    watch: Watch | None,
    *,
    pauses: bool = False,
) -> tuple[Ends, Walk]:
    n, depth, towards = len(load), max(family.column_depths), np.sign(end - load)
    ends = Ends(
        coordinates.copy(), load.copy(), np.full(n, -1), np.full(n, -1), np.zeros_like(coordinates)
    )
    if len(fresh):
        own = family if len(fresh) == n else family.take_lanes(fresh)
        begin = coordinates[:, fresh], load[fresh], towards[fresh]
        begun, fine = _begin(own, *begin, depth, largest_step)
        ends.outcome[fresh[~fine]] = PathEnd.FAILED
        ends.outcome[fresh[fine & (towards[fresh] == 0.0)]] = PathEnd.ARRIVED
        if walk is None:
            walk = begun
        else:
            walk.put(fresh, begun, np.arange(len(fresh)))
    assert walk is not None, "some are fresh"
    whole, active, own = walk, np.flatnonzero(ends.outcome < 0), family
    if len(active) < n:
        walk, own = walk.only(active), family.take_lanes(active)
    while len(active):
        ending = one_step(own, walk, end[active], towards[active], depth, largest_step)
        walk.count += 1
        ending[(ending < 0) & (walk.count >= MAX_STEPS)] = PathEnd.FAILED
        if watch is not None:
            watch(active, walk.coordinates.copy(), walk.load.copy())
        finished = np.flatnonzero(ending >= 0)
        if len(finished):
            _write(ends, active[finished], walk.only(finished), ending[finished])
            keep = np.flatnonzero(ending < 0)
            active, walk = active[keep], walk.only(keep)
            if pauses and np.isin(ending, (PathEnd.ARRIVED, PathEnd.EVENT)).any():
                break
            own = own.take_lanes(keep)
    if walk is not whole:
        whole.put(active, walk, np.arange(len(active)))
    return ends, whole


def _write(ends: Ends, lanes: Indices, walk: Walk, outcome: Indices) -> None:
    is_special = (outcome == PathEnd.FOLD) | (outcome == PathEnd.EVENT)
    ends.coordinates[:, lanes], ends.load[lanes] = walk.coordinates, walk.load
    ends.outcome[lanes] = outcome
    ends.cell[lanes] = np.where(is_special, walk.cell, -1)
    ends.onward[:, lanes] = walk.onward


def _begin(
    family: LoadedPotential[Coordinates, LoadedLaw],
    coordinates: Array,
    load: Array,
    towards: Array,
    depth: int,
    largest_step: float,
) -> tuple[Walk, Flags]:
    """Walks at their first points, and which of these are stable equilibria."""
    n, nothing = len(load), np.full(len(load), -1)
    free = np.zeros(n)
    here = corrected(family, coordinates, load, nothing, free, depth)
    margin = margin_of(family, here)
    walk = Walk(
        here.coordinates, here.load, here.measured.value, np.zeros_like(coordinates),
        free.copy(), nothing, free.copy(), np.full(n, largest_step), free + np.nan, free + np.nan,
        np.zeros_like(coordinates), margin, np.zeros_like(margin), np.zeros(n, bool), nothing,
        0 * nothing,
    )  # fmt: skip
    turn(family, walk, here, nothing, towards)
    return walk, here.is_fine
