"""What has become of fingers that have met a body: their paths, and what there is to say."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dpgcli.arrays import Array, Codes, Indices, total
from dpgcli.grasping.approach import Approach, Reset
from dpgcli.grasping.contact import Obstructed
from dpgcli.grasping.shapes import ContactShapes
from dpgcli.mechanics.coordinates import Stations
from dpgcli.mechanics.gaps import Touches
from dpgcli.records import dataclass


class Pushes(NamedTuple):
    """Pushes, (cell, batch) N, at each of the places that `touches` are, in the finger's frame."""

    push: Array
    touches: Touches

    @property
    def force(self) -> Array:
        """All of them, (2, batch), N."""
        return total(np.moveaxis(self.touches.directions * self.push, 1, 0))

    def take_lanes(self, index: Indices) -> "Pushes":
        """Those of some lanes."""
        touches = Touches(*(part[..., index] for part in self.touches))
        return Pushes(self.push[:, index], touches)

    @classmethod
    def joined(cls, parts: "Sequence[Pushes | None]", sizes: Sequence[int]) -> "Pushes | None":
        """Those of several batches of these sizes as one, with as many places as any has."""
        most = max((0 if part is None else len(part.push) for part in parts), default=0)
        if not most:
            return None
        push, places, ways = (np.zeros((*of, most, sum(sizes))) for of in ((), (2,), (2,)))
        ends = np.cumsum(sizes)
        for part, end in zip(parts, ends, strict=True):
            if part is not None:
                n, n_lanes = part.push.shape
                lanes = slice(end - n_lanes, end)
                push[:n, lanes] = part.push
                places[:, :n, lanes], ways[:, :n, lanes] = part.touches
        return cls(push, Touches(places, ways))


@dataclass(frozen=True)
class Grasped:
    """Fingers at rest against a body, a lane each; forces on the body in the finger's frame.

    `status` are `Status` codes of the states that `code` (batch,) have become, `after`; `push`
    (cell, batch) N is that at each of the places that `touches` are, on `phalanges` (cell,),
    `force` (2, batch) N, `gap` (batch,) mm the smallest, `margin` what more of the load the next
    unit bears. Without a body these are on the other finger; beside one those are `between`, if
    fingers meet. `nodes`, and `face` (2, node, batch), in mm. `residual` N and `error` mm are those
    of the tip. `resets` say what happened.
    """

    code: Codes
    after: Codes
    status: NDArray[np.uint8]
    push: Array
    touches: Touches
    phalanges: Indices
    force: Array
    gap: Array
    margin: Array
    residual: Array
    error: Array
    nodes: Stations
    face: Array
    resets: tuple[Reset, ...]
    between: Pushes | None = None
    BY_LANE: ClassVar = (
        *("code", "after", "status", "push", "force", "gap", "margin"),
        *("residual", "error"),
    )

    @classmethod
    def joined(cls, parts: Sequence["Grasped"]) -> "Grasped":
        """Those of several batches as one."""
        arrays = {
            name: np.concatenate([getattr(part, name) for part in parts], axis=-1)
            for name in (*cls.BY_LANE, "face")
        }
        sizes = [len(part.code) for part in parts]
        nodes, touches = (
            [np.concatenate(v, axis=-1) for v in zip(*values, strict=True)]
            for values in ([p.nodes for p in parts], [p.touches for p in parts])
        )
        return cls(
            **arrays,
            touches=Touches(*touches),
            phalanges=parts[0].phalanges,
            nodes=Stations(*nodes),
            resets=_resets_joined([part.resets for part in parts], sizes),
            between=Pushes.joined([part.between for part in parts], sizes),
        )

    @property
    def pushes(self) -> tuple[Pushes, ...]:
        """All of them: on the body, and on the other finger beside it."""
        own = Pushes(self.push, self.touches)
        return (own,) if self.between is None else (own, self.between)

    @property
    def size_between(self) -> Array:
        """The size of the force on the other finger beside a body, (batch,), N."""
        if self.between is None:
            return np.zeros(len(self.code))
        return np.asarray(np.hypot(*self.between.force))

    def take_lanes(self, index: Indices) -> "Grasped":
        """Some of the lanes."""
        arrays = {name: getattr(self, name)[..., index] for name in (*self.BY_LANE, "face")}
        return replace(
            self,
            **arrays,
            touches=Touches(*(part[..., index] for part in self.touches)),
            nodes=Stations(*(part[..., index] for part in self.nodes)),
            resets=tuple(resets_of(self.resets, index)),
            between=self.between and self.between.take_lanes(index),
        )


def resets_of(resets: Sequence[Reset], index: Indices) -> Iterator[Reset]:
    """What happened to the lanes at `index`, by their places there."""
    for reset in resets:
        rows = np.flatnonzero(np.isin(index, reset.lanes))
        yield replace(reset.take(np.searchsorted(reset.lanes, index[rows])), lanes=rows)


def _resets_joined(parts: Sequence[Sequence[Reset]], sizes: Sequence[int]) -> tuple[Reset, ...]:
    """Resets of several batches of these sizes, by the lanes of all of them."""
    firsts = np.cumsum([0, *sizes])
    return tuple(
        replace(reset, lanes=reset.lanes + first)
        for first, resets in zip(firsts, parts, strict=False)
        for reset in resets
    )


@dataclass(frozen=True)
class Placed:
    """Fingers about which a body has grown: `status` (batch,) says which are there, or why not."""

    codes: Codes
    own: Obstructed
    grown: Approach
    status: NDArray[np.uint8]

    @classmethod
    def joined(cls, parts: Sequence["Placed"]) -> "Placed":
        """Those of several batches as one, of the same fingers and body."""
        shapes = ContactShapes.joined([part.grown.shapes for part in parts])
        load = np.concatenate([part.grown.load for part in parts])
        sizes = [len(part.codes) for part in parts]
        margins = [part.grown.margin for part in parts if part.grown.margin is not None]
        margin = np.concatenate(margins) if margins else None
        stops = zip(*(part.grown.stops for part in parts), strict=True)
        resets = _resets_joined([part.grown.resets for part in parts], sizes)
        came = Approach(shapes, load, resets, margin, tuple(map(ContactShapes.joined, stops)))
        return cls(
            np.concatenate([part.codes for part in parts]),
            replace(parts[0].own, depth=np.concatenate([part.own.depth for part in parts])),
            came,
            np.concatenate([part.status for part in parts]),
        )

    def with_lanes(self, index: Indices, others: "Placed") -> "Placed":
        """With the lanes at `index` replaced, but for what happened to them on the way."""
        shapes = self.grown.shapes.take_lanes(np.arange(len(self.codes)))
        shapes.put(index, others.grown.shapes)
        status = self.status.copy()
        depth = np.broadcast_to(self.own.depth, len(status)).copy()
        status[index], depth[index] = others.status, others.own.depth
        own, grown = replace(self.own, depth=depth), replace(self.grown, shapes=shapes)
        return Placed(self.codes, own, grown, status)
