"""Columns of a table in our units, whatever units the file or its reader says they are in."""

from collections.abc import Iterator, Mapping

from dpgcli.arrays import Array
from dpgcli.errors import Field, Message, Problem, SpecError, UsageError
from dpgcli.files.csv_file import Choice, Sheet
from dpgcli.files.places import in_order
from dpgcli.files.units import OWN, asked_for, factor_of, listed, units_in
from dpgcli.records import dataclass


@dataclass(frozen=True)
class InOwnUnits:
    """Columns by name in our units, those whose unit somebody `said`, and notes for a user."""

    values: dict[str, Array]
    said: frozenset[str]
    notes: tuple[str, ...]


def chosen_units(choice: Choice, quantities: Mapping[str, str]) -> dict[str, float]:
    """Factors of the units that a choice has; `quantities` are those of the columns by name.

    Raises UsageError for a column or a quantity that there is none of, or no unit of it.
    """
    taken: dict[str, str] = {}
    for name, title in choice.columns.items():
        said = f" {name}={title}: "
        if name not in quantities:
            expected = f"expected one of {', '.join(quantities)} before the ="
            raise UsageError(Field("column"), said, expected)
        if other := taken.get(title.removeprefix("-")):
            raise UsageError(Field("column"), said, f"that is {other} already")
        taken[title.removeprefix("-")] = name
    if choice.skip is not None and choice.skip < 0:
        raise UsageError(Field("skip"), f" {choice.skip}: expected a number of lines")
    return units_in(choice.units, quantities)


def in_own_units(
    sheet: Sheet, quantities: Mapping[str, str], given: Mapping[str, float]
) -> InOwnUnits:
    """Columns as numbers in our units: by what was `given`, else by what the file says.

    Raises SpecError for units that are not known, or that say something else than a name does.
    """
    problems = list(_unit_problems(sheet, quantities, given))
    factors = {name: _factor(sheet, name, kind, given) for name, kind in quantities.items()}
    try:
        columns = sheet.numbers(list(quantities), factors=factors)
    except SpecError as error:
        raise SpecError(in_order([*error.problems, *problems])) from None
    if problems:
        raise SpecError(tuple(problems))
    return InOwnUnits(
        columns,
        frozenset(n for n, kind in quantities.items() if kind in given or n in sheet.units),
        tuple(_notes(sheet, quantities, given)),
    )


def _factor(sheet: Sheet, name: str, quantity: str, given: Mapping[str, float]) -> float:
    stated = factor_of(quantity, sheet.units.get(name, OWN[quantity]))
    return given.get(quantity, stated or 1.0)


def _unit_problems(
    sheet: Sheet, quantities: Mapping[str, str], given: Mapping[str, float]
) -> Iterator[Problem]:
    for name, quantity in quantities.items():
        unit = sheet.units.get(name, "")
        if not unit or quantity in given:
            continue
        factor = factor_of(quantity, unit)
        hint = Message("say which: ", asked_for(quantity))
        if factor is None:
            yield sheet.problem(None, name, listed(quantity), unit, hint)
        elif factor != 1.0 and name not in sheet.titles:
            expected = f"{OWN[quantity]}, as the name has it"
            yield sheet.problem(None, name, expected, f"{unit} beside it", hint)


def _notes(
    sheet: Sheet, quantities: Mapping[str, str], given: Mapping[str, float]
) -> Iterator[str]:
    for name, quantity in quantities.items():
        unit, title = sheet.units.get(name, ""), sheet.titles.get(name, name)
        factor = _factor(sheet, name, quantity, given)
        stated = factor_of(quantity, unit) if unit else factor
        if stated != factor:
            yield f"{title} is in {unit} as the file says, and was taken as {factor:g} of {name}"
        elif factor != 1.0:
            yield f"{title} times {factor:.10g} is {name}"
