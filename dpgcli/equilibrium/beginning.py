"""Which laws hold as a load begins to rise, at places where either of two may.

Such are contacts that are closed without a push. As the load begins to rise each goes on closed,
and what pushes must not become a pull, or open, and its gap must not become a penetration. What the
others do is in the rates of both. This is a linear complementarity problem, whose matrix is that of
stable equilibria, positive definite: it has one solution (Cottle, Pang, Stone, The Linear
Complementarity Problem, 1992, section 3.3), and changing the first wrong one again and again finds
it (Murty 1974; there 4.2). All wrong ones at once is mostly faster, and is tried before.
"""

from collections.abc import Callable

import numpy as np

from dpgcli.arrays import Flags, Indices

NO_RATE = 1e-9  # of the largest rate: less is rounding, or of second order
AT_ONCE = 4  # times, before one after the other
PASSES = 8  # for each place


def about_to_act(
    active: Flags, is_level: Flags, are_wrong: Callable[[Indices, Flags], Flags]
) -> Flags:
    """Which places are closed as the load begins to rise, (place, batch); `active` are so before.

    Only those that are level, where either law holds, may change. Of some lanes and what is closed
    there `are_wrong` tells which places go against their laws, (place, lane).

    >>> pull = np.array([[2.0, -1.0]])  # by lane, of what is closed; it opens at its negative
    >>> about_to_act(np.ones((1, 2), bool), np.ones((1, 2), bool),
    ...     lambda lanes, closed: (pull[:, lanes] > 0.0) == closed).tolist()
    [[False, True]]
    """
    found = active.copy()
    lanes = np.flatnonzero(is_level.any(axis=0))
    for count in range(PASSES * len(active)):
        if not len(lanes):
            break
        wrong = are_wrong(lanes, found[:, lanes]) & is_level[:, lanes]
        if count >= AT_ONCE:
            wrong &= np.arange(len(wrong))[:, None] == wrong.argmax(axis=0)
        found[:, lanes] ^= wrong
        lanes = lanes[wrong.any(axis=0)]
    return found
