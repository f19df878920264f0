"""Scatter: batches of draws against one after the other, windows against counting, chunks."""

from collections.abc import Callable

import numpy as np
import pytest

from dpgcli.actuation import scatter
from dpgcli.actuation.pressed import Pressed
from dpgcli.actuation.pulses import Pulse
from dpgcli.actuation.scatter import are_led, followed, ranges_of, reliability, window
from dpgcli.actuation.sequences import PulseSequence, pulse_sequence
from dpgcli.arrays import Array
from dpgcli.mechanics.finger import Finger

pytestmark = pytest.mark.slow

Study = Callable[..., Finger]
Made = Callable[..., Pressed]
STROKES = np.array([[3.5], [3.5], [4.2]])
LINE = np.zeros(3, np.int64)
N = 60


@pytest.fixture
def draws(study: Study, pressed: Made) -> Pressed:
    """Draws that scatter so much that some do other things; two have a unit with one well."""
    random = np.random.default_rng(5)
    stroke = STROKES * (1.0 + 0.06 * random.standard_normal((3, N)))
    linearity = np.full((3, N), 0.043)
    linearity[2, -1] = linearity[0, -2] = 0.9
    return pressed(study(3).changed(stroke=stroke, force_linearity=linearity))


@pytest.fixture
def plan(study: Study, pressed: Made) -> PulseSequence:
    """Up to 111 and down to 001."""
    found = pulse_sequence(pressed(study(3).changed(stroke=STROKES)), LINE, 0, 0b001)
    assert found.pulses is not None
    assert len(found.pulses) == 2
    return found


def test_draws_in_a_batch_do_what_each_does_by_itself(draws: Pressed, plan: PulseSequence) -> None:
    """By ranges of peaks, and followed through the pulses: all together, and one by one."""
    pulses, reach, zeros = plan.pulses or (), plan.reach, np.zeros(N, np.int64)
    together = followed(draws, LINE, pulses, zeros)
    by_ranges = are_led(draws, LINE, pulses, ranges_of(draws, LINE, reach, pulses), zeros)
    some = [0, *np.flatnonzero(together[0] != together[1])[:4], N - 2, N - 1]
    zero = np.zeros(1, np.int64)
    alone = [followed(draws.take_lanes(np.array([k])), LINE, pulses, zero)[:, 0] for k in some]
    assert np.array_equal(together, by_ranges)
    assert np.array_equal(together[:, some], np.array(alone).T)
    assert together[:, -2:].tolist() == [[False, False], [True, False]]  # the first is not needed
    assert 0 < together[1].sum() < N - 1


def test_a_window_is_where_so_many_draws_do_it(draws: Pressed, plan: PulseSequence) -> None:
    """Peaks at both ends of the window, and just outside it, counted by following all draws."""
    first, second = plan.pulses or ()
    every = [(np.arange(N), draws)]
    found = reliability(every, LINE, plan, N, 0.6, from_rest=False)
    low, high = found.windows[0]
    assert np.isinf(high)
    assert low > 0.0

    def done(pulse: Pulse, peak: float) -> int:
        one = Pulse(0, peak, 0.0, 0.0, pulse.source, pulse.target, False)
        return int(followed(draws, LINE, [one], np.full(N, pulse.source))[0].sum())

    assert done(first, low * (1.0 + 1e-9)) >= 0.6 * N > done(first, low * (1.0 - 1e-6))
    begins, ends = found.windows[1]
    assert 0.0 < begins < ends
    for inside, outside in (
        (begins * 1.000001, begins * 0.99999),
        (ends * 0.99999, ends * 1.00001),
    ):
        assert done(second, -inside) >= 0.6 * N > done(second, -outside)


def test_chunks_change_no_bit(
    draws: Pressed, plan: PulseSequence, monkeypatch: pytest.MonkeyPatch
) -> None:
    pulses, reach = plan.pulses or (), plan.reach
    whole = ranges_of(draws, LINE, reach, pulses)
    monkeypatch.setattr(scatter, "lanes_at_once", lambda n_units: 7)
    parts = ranges_of(draws, LINE, reach, pulses)
    for name in ("pulse", "draw", "low", "high"):
        assert np.array_equal(getattr(whole, name), getattr(parts, name))


def test_draws_in_no_batch_are_failures(study: Study, pressed: Made, plan: PulseSequence) -> None:
    own = pressed(study(3).changed(stroke=np.repeat(STROKES, 3, axis=1)))
    some = [(np.array([0, 2, 5]), own)]
    found = reliability(some, LINE, plan, 6, 0.5, from_rest=True)
    assert found.n_led.tolist() == [3, 3]
    assert (found.n_begun, found.n_unknown) == (3, 0)
    assert not np.isnan(found.windows).any()
    assert np.isnan(reliability([], LINE, plan, 6, 0.5, from_rest=True).windows).all()
    most = reliability(some, LINE, plan, 6, 0.51, from_rest=True)
    assert np.isnan(most.windows).all()


@pytest.mark.parametrize("seed", range(20))
def test_windows_against_counting_everywhere(seed: int) -> None:
    random = np.random.default_rng(seed)
    low = random.integers(0, 8, 12).astype(float)
    high = low + random.integers(1, 6, 12)
    high[random.random(12) < 0.2] = np.inf
    for n_needed in range(1, 12):
        found = window(low, high, n_needed)
        assert found == pytest.approx(widest(low, high, n_needed), nan_ok=True)


def widest(low: Array, high: Array, n_needed: int) -> tuple[float, float]:
    """The longest run of half-open unit intervals that enough ranges contain."""
    best, begin = (np.nan, np.nan), None
    for place in [*range(20), None]:
        middle = np.inf if place is None else place + 0.5
        n = np.isinf(high).sum() if place is None else ((low < middle) & (middle < high)).sum()
        if n >= n_needed and begin is None and place is not None:
            begin = place
        if begin is not None and (n < n_needed or place is None):
            end = np.inf if n >= n_needed else float(place)
            if np.isnan(best[0]) or end - begin > best[1] - best[0]:
                best = float(begin), end
            begin = None
    return best
