"""Every error raised on purpose, and messages that name fields."""

from collections.abc import Callable
from typing import Any, Self

from dpgcli.records import dataclass
from dpgcli.text import legible, printable


class Field(str):
    """The name of a field in a message, as Python has it; a command line has an option for it."""

    __slots__ = ()


class Message(str):
    """A text some of whose parts may be fields.

    >>> Message("drop ", Field("target_error"))
    'drop target_error'
    """

    parts: tuple[str, ...]

    def __new__(cls, *parts: str) -> Self:
        flat = [piece for part in parts for piece in getattr(part, "parts", (part,))]
        message = super().__new__(cls, "".join(flat))
        message.parts = tuple(flat)
        return message


def respelled(text: str, spell: Callable[[str], str]) -> str:
    """A text with its fields spelled in another way; text that is no Message as it is.

    >>> respelled(Message("drop ", Field("tolerance")), lambda field: f"--{field}")
    'drop --tolerance'
    """
    return "".join(spell(p) if isinstance(p, Field) else p for p in Message(text).parts)


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
        """The problem in words, without its place."""
        hint = f" ({self.hint})" if self.hint else ""
        return f"{self.key}: expected {self.expected}, found {self.found}{hint}"


class DpgError(Exception):
    """Any error raised on purpose: what was wrong with the input, or went wrong outside.

    The parts of its message may be fields; in the others stands what somebody handed in, which is
    made fit to print here. Any other exception is a bug.
    """

    def __init__(self, *parts: str) -> None:
        flat = Message(*parts).parts
        self.message = Message(*(p if isinstance(p, Field) else legible(p) for p in flat))
        super().__init__(self.message)


class SpecError(DpgError):
    """A spec, an option that changes it, or data are wrong; carries every problem found."""

    def __init__(self, problems: tuple[Problem, ...]) -> None:
        super().__init__("\n".join(map(str, problems)))
        self.problems = problems


class UsageError(DpgError):
    """A choice that makes no sense for this scene; the message says what to do."""


class WorkplaceError(DpgError):
    """The workers that should do the work cannot, or are lost; what was done is kept."""


class NoWorkerError(WorkplaceError):
    """No worker came for as long as one waits; what was done is kept."""


class NothingSelectedError(DpgError):
    """A selection matches no state."""


class OutputError(DpgError):
    """A file cannot be written; nothing half-written is left behind."""


class FitError(DpgError):
    """A fit that failed; the message says why. Nothing is written."""


class ActuationError(DpgError):
    """A finger cannot go on under these pressures; `result` has what happened before."""

    def __init__(self, result: Any, *parts: str) -> None:
        super().__init__(*parts)
        self.result = result


class SolverError(DpgError):
    """A solver outside dpg failed, or its results make no sense; nothing is made of them."""
