"""Progress: a bar on a terminal, plain lines elsewhere, nothing where it is not wanted."""

import io
import time
from collections.abc import Callable

import pytest

from dpgcli.cli import progress
from dpgcli.cli.progress import ProgressLine, under_way

Line = Callable[..., tuple[ProgressLine, io.StringIO]]


class Terminal(io.StringIO):
    """Text that says that it is a terminal."""

    def isatty(self) -> bool:
        return True


@pytest.fixture
def line(monkeypatch: pytest.MonkeyPatch) -> Line:
    """A line over 2,000 things, always due, and where it is shown; a second passes at each look."""
    times = iter(range(100))
    monkeypatch.setattr(progress, "monotonic", lambda: float(next(times)))
    monkeypatch.setattr(progress, "PLAIN_PERIOD", 0.5)
    for name in ("NO_COLOR", "FORCE_COLOR", "TTY_COMPATIBLE", "TTY_INTERACTIVE", "COLUMNS"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("TERM", "xterm")

    def made(stream: io.StringIO, *, quiet: bool = False) -> tuple[ProgressLine, io.StringIO]:
        monkeypatch.setattr("sys.stderr", stream)
        return ProgressLine(2000, "designs", quiet=quiet), stream

    return made


def test_in_a_log_each_line_stands(line: Line) -> None:
    shown, log = line(io.StringIO())
    shown.resume_at(400)
    shown.show(400)
    shown.show(1600)
    shown.clear()
    assert log.getvalue() == (
        "400 of 2,000 designs, 0/s\n1,600 of 2,000 designs, 600/s, 1 s left\n"
    )


def test_slow_work_has_a_rate_and_the_end_has_nothing_left(line: Line) -> None:
    shown, log = line(io.StringIO())
    shown.show(1)
    shown.show(2000)
    first, last = log.getvalue().splitlines()
    assert first.startswith("1 of 2,000 designs, 1/s, ")
    assert last == "2,000 of 2,000 designs, 1,000/s"


def test_on_a_terminal_a_bar_comes_and_goes(line: Line) -> None:
    shown, terminal = line(Terminal())
    shown.show(500)
    shown.show(1500)
    assert "500 of 2,000 designs, 500/s, 3 s left" in terminal.getvalue()
    assert "1,500 of 2,000 designs, 750/s, 1 s left" in terminal.getvalue()
    shown.clear()
    assert terminal.getvalue().endswith("\x1b[2K"), "the line is erased"
    assert terminal.getvalue().rfind("\x1b[?25h") > terminal.getvalue().rfind("\x1b[?25l"), (
        "the cursor is back"
    )


@pytest.mark.parametrize("stream", [io.StringIO, Terminal])
def test_quiet_is_silent(line: Line, stream: Callable[[], io.StringIO]) -> None:
    shown, output = line(stream(), quiet=True)
    shown.show(500)
    shown.clear()
    assert output.getvalue() == ""


def test_what_is_over_soon_needs_no_progress(line: Line, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progress, "FIRST_SHOWN", 5.0)
    shown, terminal = line(Terminal())
    shown.show(500)
    shown.clear()
    assert terminal.getvalue() == ""


@pytest.mark.parametrize("stream", [io.StringIO, Terminal])
def test_work_that_counts_nothing_says_that_it_goes_on(
    monkeypatch: pytest.MonkeyPatch, stream: Callable[[], io.StringIO]
) -> None:
    monkeypatch.setattr(progress, "FIRST_SHOWN", 0.01)
    monkeypatch.setattr(progress, "ELAPSED_PERIOD", 0.01)
    shown = stream()
    monkeypatch.setattr("sys.stderr", shown)

    def wait_for(text: str) -> None:
        end = time.monotonic() + 20.0
        while text not in shown.getvalue():
            assert time.monotonic() < end
            time.sleep(0.005)

    with pytest.raises(KeyError), under_way("a fit", quiet=False) as say_that:
        wait_for("a fit, 0 s")
        say_that("another")
        wait_for("another, 0 s")
        raise KeyError
    said = shown.getvalue()
    assert said.endswith(" \r" if shown.isatty() else "\n"), "on a terminal the line is erased"
    time.sleep(0.05)
    assert shown.getvalue() == said, "it ends with the work"


@pytest.mark.parametrize("stream", [io.StringIO, Terminal])
def test_quiet_work_and_work_that_is_soon_over_say_nothing(
    monkeypatch: pytest.MonkeyPatch, stream: Callable[[], io.StringIO]
) -> None:
    shown = stream()
    monkeypatch.setattr("sys.stderr", shown)
    with under_way("a fit", quiet=False):
        pass
    monkeypatch.setattr(progress, "FIRST_SHOWN", 0.001)
    with under_way("a fit", quiet=True):
        time.sleep(0.05)
    assert shown.getvalue().strip() == ""


def test_the_first_word_comes_within_two_seconds() -> None:
    assert progress.FIRST_SHOWN <= 1.0
