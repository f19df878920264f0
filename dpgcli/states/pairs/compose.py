"""States of a whole finger as pairs of half-fingers (see `halves`), streamed in blocks."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dpgcli.arrays import Array, Flags, Indices
from dpgcli.records import dataclass
from dpgcli.states.certify import MARGINAL_CURVATURE, SMALL_SHARE, Status
from dpgcli.states.crossing import Outline, diagonals, is_simple
from dpgcli.states.pairs.halves import Half, Split
from dpgcli.states.patterns import inverted_units
from dpgcli.states.solved import SolvedStates

STATES_AT_ONCE = 2**16


def paired_states(split: Split) -> Iterator[SolvedStates]:
    """All states in the order of their codes; a pair that does not fit is `NOT_CONVERGED`."""
    inner, outer = split.inner(), split.outer()
    rows = max(1, STATES_AT_ONCE >> split.n_outer)
    for first in range(0, 2**split.n_inner, rows):
        patterns = np.arange(first, min(first + rows, 2**split.n_inner))
        yield _pair(split, inner, outer, _Block(patterns, split.n_outer, split.context))


@dataclass(frozen=True)
class _Block:
    """Some inner patterns, each with all outer patterns.

    Arrays get the axes (inner pattern, nearest outer units, other outer units): an inner
    entry depends on the first two, an outer entry on the last two and the inner pattern's
    own nearest units.
    """

    patterns: Indices
    n_outer: int
    context: int

    def inner(self, table: NDArray[Any]) -> NDArray[Any]:
        near = 2**self.context
        entries = table.reshape(*table.shape[:-1], -1, near, 1)
        return entries[..., self.patterns, :, :]

    def outer(self, table: NDArray[Any]) -> NDArray[Any]:
        near = 2**self.context
        entries = table.reshape(*table.shape[:-1], near, near, -1)
        return entries[..., self.patterns % near, :, :]

    def flat(self, values: NDArray[Any]) -> NDArray[Any]:
        near = 2**self.context
        shape = (len(self.patterns), near, 2**self.n_outer // near)
        lead = values.shape[:-3]
        return np.broadcast_to(values, (*lead, *shape)).reshape(*lead, -1)


class _Fit(NamedTuple):
    """Residuals and errors of pairs by the disagreement of their halves at the shared strut."""

    residual: Array
    relative_residual: Array
    tip_error: Array
    is_convex: Flags


def _pair(split: Split, inner: Half, outer: Half, block: _Block) -> SolvedStates:
    x, y, turn = block.inner(inner.pose)
    cos, sin = np.cos(turn), np.sin(turn)
    along, across, beyond = block.outer(outer.pose)
    pose = np.stack(
        [
            block.flat(x + cos * along - sin * across),
            block.flat(y + sin * along + cos * across),
            block.flat(turn + beyond),
        ]
    )
    fit = _fit(split, inner, outer, block)
    status = np.maximum(block.inner(inner.status), block.outer(outer.status))
    status = np.where(fit.is_convex, status, np.maximum(status, Status.MARGINAL))
    is_small = fit.residual <= SMALL_SHARE * split.weakest
    fits = (fit.relative_residual <= split.tolerance) & is_small
    status = block.flat(np.where(fits, status, np.uint8(Status.NOT_CONVERGED))).copy()
    crosses = _cross(split, inner, outer, block)
    status[crosses & (status != Status.NOT_CONVERGED)] = Status.FOLDED
    codes = (block.patterns[:, None] << split.n_outer) + np.arange(2**split.n_outer)
    reached = (block.flat(block.inner(inner.reached)), block.flat(block.outer(outer.reached)))
    return SolvedStates(
        inverted=inverted_units(codes.ravel().astype(np.uint64), split.n_units),
        reached=np.concatenate(reached),
        status=status,
        pose=pose,
        tip_error=block.flat(fit.tip_error),
        energies=_added(inner, outer, block),
        residual=block.flat(fit.residual),
    )


def _cross(split: Split, inner: Half, outer: Half, block: _Block) -> Flags:
    """Whether the outer half runs into the inner one, (state,); each by itself is certified."""
    loop, near_part, far_part = split.units.shortest_loop, inner.around, outer.around
    if loop is None or near_part is None or far_part is None:
        return block.flat(np.zeros((1, 1, 1), bool))
    x, y, turn = block.inner(inner.pose)
    joint, direction = x + 1j * y, np.exp(1j * turn)

    def whole(near: Array, far: Array) -> Array:
        """All stations of each pair, (station, …)."""
        parts = block.inner(near), joint + direction * block.outer(far[1:])
        return np.concatenate([block.flat(part) for part in parts])

    touching = max(diagonals(part).max() for part in (near_part, far_part))
    base = block.inner(near_part.base)
    near = np.zeros((1, 1, 1), bool)
    for beyond in range(1, split.n_outer + 1):
        station = joint + direction * block.outer(far_part.base[beyond])
        far_enough = base[: max(0, split.n_inner + beyond - loop + 1)]
        near = near | (np.abs(far_enough - station) < touching).any(axis=0)
    crosses = block.flat(near).copy()
    lanes = np.flatnonzero(crosses)
    if len(lanes):  # few, so that a closer look is cheap
        around = whole(near_part.base, far_part.base), whole(near_part.top, far_part.top)
        crosses[lanes] = ~is_simple(Outline(*(nodes[:, lanes] for nodes in around)))
    return crosses


def _added(inner: Half, outer: Half, block: _Block) -> dict[str, Array]:
    """Energies of the pair by kind; a half may lack a kind that the other has."""
    parts = {kind: block.inner(part) for kind, part in inner.energies.items()}
    for kind, part in outer.energies.items():
        parts[kind] = parts.get(kind, 0.0) + block.outer(part)
    return {kind: block.flat(part) for kind, part in parts.items()}


def _fit(split: Split, inner: Half, outer: Half, block: _Block) -> _Fit:
    """Residual and Newton's next step of the pair, to first order in the disagreement Δs.

    The pair takes the inner half's extension of the strut and holds the outer half.
    """
    residual = np.maximum(block.inner(inner.residual), block.outer(outer.residual))
    relative = np.maximum(
        block.inner(inner.relative_residual), block.outer(outer.relative_residual)
    )
    error = block.inner(inner.tip_error) + block.outer(outer.tip_error)
    if inner.joint is None or outer.joint is None or outer.clamped is None:
        return _Fit(residual, relative, error, np.ones((1, 1, 1), bool))
    apart = block.inner(inner.joint.extension) - block.outer(outer.joint.extension)
    force = block.inner(inner.joint.force) + block.outer(outer.joint.force)
    at_strut = np.abs(force + block.outer(outer.clamped.strut_stiffness) * apart)
    inner_stiffness, outer_stiffness = (
        block.inner(inner.joint.stiffness),
        block.outer(outer.joint.stiffness),
    )
    stiffness = inner_stiffness + outer_stiffness
    step = -(force + outer_stiffness * apart) / stiffness
    gap = np.abs(apart)
    scale = split.strut_force
    return _Fit(
        np.maximum(residual + block.outer(outer.clamped.cell_stiffness) * gap, at_strut),
        np.maximum(
            relative + block.outer(outer.clamped.relative_stiffness) * gap, at_strut / scale
        ),
        error
        + block.inner(inner.joint.tip_motion) * np.abs(step)
        + block.outer(outer.joint.tip_motion) * np.abs(apart + step),
        stiffness > MARGINAL_CURVATURE * np.abs(inner_stiffness),
    )
