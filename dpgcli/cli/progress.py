"""Progress on standard error: a bar that moves on a terminal, a line now and then elsewhere."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cached_property
from threading import Event, Thread
from time import monotonic
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.progress import Progress

FIRST_SHOWN = 1.0  # s: what is over sooner needs no progress
TERMINAL_PERIOD, PLAIN_PERIOD = 0.2, 5.0  # s
ELAPSED_PERIOD = 30.0  # s
FAST = 10.0  # per s: slower rates have digits behind the point
LINE = 70  # characters on a terminal


@contextmanager
def under_way(what: str, *, quiet: bool) -> Iterator[Callable[[str], None]]:
    """Say what goes on and for how long, on a terminal after a second, elsewhere twice a minute.

    For work that counts nothing; what is yielded takes other words for it.
    """
    words, began, is_over = [what], monotonic(), Event()
    is_terminal = sys.stderr.isatty()

    def say_so() -> None:
        period = FIRST_SHOWN if is_terminal else ELAPSED_PERIOD
        while not is_over.wait(period):
            line = f"{words[-1]}, {monotonic() - began:.0f} s"
            if is_terminal:
                print(f"\r{line[:LINE]:{LINE}}", end="\r", file=sys.stderr, flush=True)
            else:
                print(line, file=sys.stderr, flush=True)

    teller = Thread(target=say_so, daemon=True)
    if not quiet:
        teller.start()
    try:
        yield words.append
    finally:
        is_over.set()
        if not quiet:
            teller.join()
            if is_terminal:
                print(" " * LINE, end="\r", file=sys.stderr, flush=True)


class ProgressLine:
    """Counts things up to a total, with their rate and the time left."""

    def __init__(self, total: int, things: str, *, quiet: bool) -> None:
        self.total, self.things, self.quiet = total, things, quiet
        self.interactive = sys.stderr.isatty()
        self.began = monotonic()
        self.start = 0
        self.due = self.began + (FIRST_SHOWN if self.interactive else PLAIN_PERIOD)

    def resume_at(self, done: int) -> None:
        """Begin the count at what was there before."""
        self.start = done

    def show(self, done: int) -> None:
        """Show how many are done, if it is time to."""
        now = monotonic()
        if self.quiet or now < self.due:
            return
        rate = (done - self.start) / max(now - self.began, 1e-9)
        is_under_way = rate > 0.0 and done < self.total
        left = f", {(self.total - done) / rate:,.0f} s left" if is_under_way else ""
        speed = f"{rate:.2g}" if 0.0 < rate < FAST else f"{rate:,.0f}"
        line = f"{done:,} of {self.total:,} {self.things}, {speed}/s{left}"
        if self.interactive:
            (task,) = self._bar.task_ids
            self._bar.update(task, description=line, completed=done, total=self.total, refresh=True)
        else:
            print(line, file=sys.stderr, flush=True)
        self.due = now + (TERMINAL_PERIOD if self.interactive else PLAIN_PERIOD)

    def clear(self) -> None:
        """Take the bar away."""
        if "_bar" in vars(self):
            self._bar.stop()

    @cached_property
    def _bar(self) -> "Progress":
        """Drawn when it is told to, by no thread, and past nothing that others print."""
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn

        bar = Progress(
            BarColumn(),
            TextColumn("{task.description}", markup=False),
            console=Console(stderr=True, highlight=False),
            auto_refresh=False,
            transient=True,
            redirect_stdout=False,
            redirect_stderr=False,
        )
        bar.add_task("")
        bar.start()
        return bar
