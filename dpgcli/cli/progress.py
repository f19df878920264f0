"""Progress on standard error: one line that moves on a terminal, a line now and then elsewhere."""

import sys
from time import monotonic

FIRST_SHOWN = 1.0  # s: what is over sooner needs no progress
TERMINAL_PERIOD, PLAIN_PERIOD = 0.2, 5.0  # s


class ProgressLine:
    """Counts things up to a total, with their rate and the time left."""

    def __init__(self, total: int, things: str, *, quiet: bool) -> None:
        self.total, self.things, self.quiet = total, things, quiet
        self.interactive = sys.stderr.isatty()
        self.began = monotonic()
        self.start = 0
        self.due = self.began + (FIRST_SHOWN if self.interactive else PLAIN_PERIOD)
        self.is_shown = False

    def resume_at(self, done: int) -> None:
        """What was there before does not count as progress."""
        self.start = done

    def show(self, done: int) -> None:
        """Show how many are done, if it is time to."""
        now = monotonic()
        if self.quiet or now < self.due:
            return
        rate = (done - self.start) / max(now - self.began, 1e-9)
        left = f", {(self.total - done) / rate:,.0f} s left" if rate > 0 else ""
        line = f"{done:,} of {self.total:,} {self.things}, {rate:,.0f}/s{left}"
        if self.interactive:
            print(f"\r{line:<70}", end="", file=sys.stderr, flush=True)
        else:
            print(line, file=sys.stderr, flush=True)
        self.is_shown = self.interactive
        self.due = now + (TERMINAL_PERIOD if self.interactive else PLAIN_PERIOD)

    def clear(self) -> None:
        """Take the moving line away."""
        if self.is_shown:
            print("\r" + " " * 70, end="\r", file=sys.stderr, flush=True)
