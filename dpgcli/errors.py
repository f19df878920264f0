"""Every error raised on purpose."""

from dataclasses import dataclass

from dpgcli.text import printable


@dataclass(frozen=True)
class Problem:
    """One mistake in a spec or in data, with all that is needed to mend it."""

    file: str
    line: int | None
    column: int | None
    key: str
    expected: str
    found: str
    hint: str = ""

    def __str__(self) -> str:
        place = ":".join(str(p) for p in (self.file, self.line, self.column) if p is not None)
        return printable(f"{place}: {self.statement}")  # in one line, whatever names hold

    @property
    def statement(self) -> str:
        """What is wrong, the place left out."""
        hint = f" ({self.hint})" if self.hint else ""
        return f"{self.key}: expected {self.expected}, found {self.found}{hint}"


class SpecError(Exception):
    """A spec, an option that changes it, or data are wrong; carries every problem found."""

    def __init__(self, problems: tuple[Problem, ...]) -> None:
        super().__init__("\n".join(map(str, problems)))
        self.problems = problems


class UsageError(Exception):
    """What was asked for makes no sense for this scene; the message says what to do."""


class WorkplaceError(Exception):
    """The workers that should do the work cannot, or are lost; what was done is kept."""


class NoWorkerError(WorkplaceError):
    """No worker came for as long as one waits; what was done is kept."""


class NothingSelectedError(Exception):
    """A selection matches no state."""


class OutputError(Exception):
    """A file cannot be written; nothing half-written is left behind."""


class FitError(Exception):
    """A fit that failed; the message says why. Nothing is written."""


class SolverError(Exception):
    """A solver outside dpg failed, or its results make no sense; nothing is made of them."""
