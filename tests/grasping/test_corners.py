"""Bodies in corners of a face, and bodies that slide over one."""

from collections.abc import Callable

import numpy as np
import pytest

from dpgcli.equilibrium import newton
from dpgcli.grasping import descent
from dpgcli.mechanics.finger import Finger


@pytest.mark.parametrize("bars", [np.inf, 1e4])
def test_a_side_that_is_touched_first_by_way_of_another_stays_closed(
    bars: float, reference_finger: Callable[..., Finger], grown: Callable[..., object]
) -> None:
    """010 meets the disc with its end phalanx; the phalanx before it comes nearer on the way."""
    found = grown(reference_finger(3, bars), ["010"], (25.0, -14.0), 12.0)
    gaps = found.obstructed.gaps()(found.shapes.coordinates).value
    assert gaps.min() >= -1e-9


@pytest.mark.parametrize("bars", [np.inf, 1e4])
def test_a_side_that_comes_near_within_one_step_is_met(
    bars: float, reference_finger: Callable[..., Finger], grown: Callable[..., object]
) -> None:
    """0101 behind soft walls meets the disc with its end, then with the phalanx before it."""
    finger = reference_finger(4, bars).changed(wall_compliance=np.array([[0.6]]))
    found = grown(finger, ["0101"], (38.0, -14.0), 14.0)
    gaps = found.obstructed.gaps()(found.shapes.coordinates).value
    assert gaps.min() >= -1e-9


@pytest.mark.slow
def test_a_tip_that_slips_over_a_body_is_no_grasp(
    reference_finger: Callable[..., Finger],
    grown: Callable[..., object],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Beyond the tip the gap of a body behind the face jumps: the first search tells, and ends."""
    searches = []

    def counted(*args: object, **options: object) -> object:
        searches.append(args)
        return newton.minimize(*args, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(descent, "minimize", counted)
    found = grown(reference_finger(3, 1e3), ["111"], (41.0, -20.0), 16.0)
    assert len(searches) == 1
    assert not found.shapes.is_there.any()
