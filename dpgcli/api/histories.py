"""Pressures over steps, however they are given: ramps, numbers, tables, or the spec's own."""

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from dpgcli.api.arguments import BYTES, each_of, path_of
from dpgcli.api.inputs import by_text
from dpgcli.design.dimensions import LARGEST
from dpgcli.design.lines import NAME, TIME
from dpgcli.design.pressure import History, Pressure
from dpgcli.errors import Field, Problem, SpecError, UsageError
from dpgcli.files.csv_file import Tabular
from dpgcli.files.histories import FEWEST_ROWS, read_history
from dpgcli.files.places import shown
from dpgcli.files.scene_file.pressure import NUMBER, ramp
from dpgcli.files.units import FACTORS, factor_of
from dpgcli.records import dataclass
from dpgcli.text import quoted

PressureInput: TypeAlias = str | Path | Sequence[str] | Sequence[float] | Tabular
"""Ramps in MPa ("0:0.15:0", "A=0:0.15:0"), pressures of one line, or a table of a column a line."""

FIELD = Field("pressure")
TABLES = (".csv", ".tsv", ".txt", ".dat")
OF_LINE = re.compile(rf" *({NAME.pattern}) *=(.*)")
WITH_UNIT = re.compile(r" *([-+.eE0-9]*[.0-9]) *([A-Za-z/][A-Za-z/0-9]*) *")
RAMP = "pressures in MPa such as 0:0.15:0"


@dataclass(frozen=True)
class GivenHistory:
    """Pressures by step, and the files that they were read from."""

    history: History
    files: tuple[Path, ...] = ()


def history_input(pressure: PressureInput | None, known: Pressure) -> GivenHistory:
    """The pressures of all lines by step: as given, else those of the spec.

    Raises SpecError with all that is wrong, UsageError where there are none.

    >>> lines = Pressure(("A", "B"), np.array([0, 1]), None, None)
    >>> history_input(["A=0:0.15:0", "B=0:-0.1:0"], lines).history.pressure.tolist()
    [[0.0, 0.0], [0.15, -0.1], [0.0, 0.0]]
    """
    if pressure is None or (isinstance(pressure, list | tuple) and not pressure):
        if known.history is None:
            raise UsageError(FIELD, ": expected ", RAMP, ", or pressure.history in the spec")
        return GivenHistory(known.history)
    if hasattr(pressure, "to_pandas") or hasattr(pressure, "columns"):
        return _of_table(pressure, known.lines)
    if isinstance(pressure, Mapping):
        ramps = {
            line: ramp(said) if _is_ramp(said) else said
            for line, said in by_text("pressure", pressure).items()
        }
        return _of_table(ramps, known.lines)
    parts = each_of("pressure", pressure)
    are_texts = [isinstance(part, str | Path) for part in parts]
    if not (parts and all(are_texts)):
        if not parts or any(are_texts) or not _is_array(pressure):
            raise UsageError(FIELD, f" {quoted(pressure)}: expected two numbers or more, ", RAMP)
        return _of_table({known.lines[0]: list(parts)}, known.lines)
    texts = [part if isinstance(part, str) else str(path_of("pressure", part)) for part in parts]
    if len(texts) == 1 and _is_file(texts[0]):
        return _of_table(Path(texts[0]), known.lines)
    return _of_ramps(texts, known.lines)


def _is_array(values: Any) -> bool:
    """Whether values are in an order, no letters, and their parts of one length."""
    try:
        return not isinstance(values, BYTES) and np.ndim(values) > 0
    except ValueError:
        return False


def _is_ramp(said: object) -> bool:
    return isinstance(said, str) and all(map(NUMBER.fullmatch, said.split(":")))


def _is_file(text: str) -> bool:
    is_other = OF_LINE.fullmatch(text) is not None or _is_ramp(text)
    is_there = os.path.isfile(text)  # noqa: PTH113  which takes names too long for a file
    return not is_other and (Path(text).suffix.lower() in TABLES or is_there)


def _of_table(table: Any, lines: Sequence[str]) -> GivenHistory:
    """The columns of a table, one for each line."""
    columns = read_history(table, lines)
    name = str(table) if isinstance(table, Path) else str(FIELD)
    if left := [line for line in lines if line not in columns]:
        hint = "a column of zeros keeps a line at 0 MPa"
        expected = f"a column for each line: {', '.join(lines)}"
        raise SpecError((Problem(name, None, None, "header", expected, _none(left), hint),))
    pressures = np.stack([columns[line] for line in lines], axis=1)
    files = (table,) if isinstance(table, Path) else ()
    return GivenHistory(History(pressures, columns.get(TIME)), files)


def _none(lines: Sequence[str]) -> str:
    return f"none for {', '.join(lines)}"


def _of_ramps(texts: Sequence[str], lines: Sequence[str]) -> GivenHistory:
    """The pressures of ramps, one for each line, of as many pressures each."""
    said: dict[str, list[float]] = {}
    problems: list[Problem] = []
    for text in texts:
        named = OF_LINE.fullmatch(text)
        line, own = (named[1], named[2]) if named else (lines[0], text)
        if _is_file(text):
            problems.append(_problem(text, "a table alone, of all lines", "ramps beside it"))
            continue
        found = [*_line_problems(text, line if named else None, lines, said), *_problems(text, own)]
        problems += found
        said[line] = [] if found else ramp(own)
    if not problems:
        problems += _unequal(said, lines)
    if problems:
        raise SpecError(tuple(problems))
    return GivenHistory(History(np.array([said[line] for line in lines]).T))


def _problem(key: str, expected: str, found: str, hint: str = "") -> Problem:
    return Problem(FIELD, None, None, key, expected, found, hint)


def _line_problems(
    text: str, line: str | None, lines: Sequence[str], said: Mapping[str, Any]
) -> Iterator[Problem]:
    """What is wrong with the line of a ramp."""
    if line is None and len(lines) > 1:
        every = " and ".join(f"{name}={text}" for name in lines)
        yield _problem(text, "the line before the pressures", "none", f"such as {every}")
    elif line is not None and line not in lines:
        close = get_close_matches(line, lines, n=1)
        hint = f"did you mean {close[0]}?" if close else ""
        yield _problem(text, f"a line: {', '.join(lines)}", line, hint)
    elif (line or lines[0]) in said:
        yield _problem(text, "each line once", f"{line or lines[0]} again")


def _problems(text: str, own: str) -> Iterator[Problem]:
    """What is wrong with the pressures of a ramp."""
    parts = own.split(":")
    if not own.strip():
        yield _problem(text, RAMP, "nothing")
    elif mixed := [unit for part in parts if (unit := _unit(part))]:
        yield _problem(text, f"{RAMP}, without a unit", mixed[0], _in_megapascals(parts))
    elif wrong := [part for part in parts if not NUMBER.fullmatch(part)]:
        hint = "" if len(parts) > 1 else "or the name of a CSV file that is there"
        yield _problem(text, RAMP, shown(wrong[0]), hint)
    elif len(parts) < FEWEST_ROWS:
        number = own.strip()
        hint = f"0:{number} goes there from 0, 0:{number}:0 back as well"
        yield _problem(text, f"{FEWEST_ROWS} or more {RAMP}", "one", hint)
    elif large := [part for part in parts if abs(float(part)) > LARGEST]:
        expected = f"pressures from {-LARGEST:g} to {LARGEST:g} MPa"
        yield _problem(text, expected, large[0].strip())


def _unit(part: str) -> str:
    """The unit behind a number, if there is one."""
    said = None if NUMBER.fullmatch(part) else WITH_UNIT.fullmatch(part)
    return said[2] if said else ""


def _in_megapascals(parts: Sequence[str]) -> str:
    """The pressures of a ramp with units as they have to be written, if the units are known."""
    numbers = []
    for part in parts:
        unit = _unit(part)
        factor = factor_of("pressure", unit) if unit else 1.0
        number = NUMBER.fullmatch(part.strip().removesuffix(unit))
        if factor is None or number is None:
            known = ", ".join(FACTORS["pressure"])
            return f"a CSV file may be in {known}, its columns named such as A (kPa)"
        numbers.append(f"{factor * float(number[0]):.10g}")
    return f"in MPa: {':'.join(numbers)}; a CSV file may be in kPa, its columns named A (kPa)"


def _unequal(said: Mapping[str, Sequence[float]], lines: Sequence[str]) -> Iterator[Problem]:
    """Lines that are left out, and ramps of other lengths: all lines step together."""
    n_steps, first = len(next(iter(said.values()))), next(iter(said))
    if left := [line for line in lines if line not in said]:
        zeros = ":".join("0" * n_steps)
        hint = f"{left[0]}={zeros} keeps it at 0 MPa"
        yield _problem("lines", f"pressures of each: {', '.join(lines)}", _none(left), hint)
    for line, values in said.items():
        if len(values) != n_steps:
            expected = f"{n_steps} pressures, as {first}: all lines step together"
            yield _problem(line, expected, str(len(values)))
