"""Bodies in corners of a face, and bodies that slide over one."""

from collections.abc import Callable

import numpy as np
import pytest

from dpgcli.mechanics.finger import Finger


@pytest.mark.xfail(
    strict=True,
    reason="the cell that closes is the first one whose nearest place this is, not the place's "
    "own side; it jumps to a place of its own once the body reaches its side, and the side that "
    "is touched goes on without a constraint (its margin comes from infinity: no event). In "
    "ActiveConstraints.margin `is_again = place != numbers[:, None]` mends it",
)
@pytest.mark.parametrize("bars", [np.inf, 1e4])
def test_a_side_that_is_touched_first_by_way_of_another_stays_closed(
    bars: float, reference_finger: Callable[..., Finger], grown: Callable[..., object]
) -> None:
    """010 meets the disc with its end phalanx; the phalanx before it comes nearer on the way."""
    found = grown(reference_finger(3, bars), ["010"], (25.0, -14.0), 12.0)
    gaps = found.obstructed.gaps()(found.shapes.coordinates).value
    assert gaps.min() >= -1e-9
