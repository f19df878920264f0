"""Which columns the header of a table has: those that were chosen, by our names, and the others."""

from collections import Counter
from collections.abc import Container, Iterator, Mapping, Sequence

from dpgcli.files.layout import SheetRow, has_numbers, header_in, is_number, is_of_units
from dpgcli.files.unit_words import are_units, together, unit_in
from dpgcli.files.units import bare, name_and_unit
from dpgcli.records import dataclass


@dataclass(frozen=True)
class Head:
    """Names of columns in the order of the cells, and the rows below.

    `line` is that of the header. By name, `titles` are those of columns that were chosen, `units`
    what the file has behind a title, in a row of units, or anywhere in the title of one of those;
    `reversed` are names whose numbers are. `untitled` are places of columns without a title, behind
    the first that has one.
    """

    names: tuple[str, ...]
    rows: list[SheetRow]
    line: int
    units: Mapping[str, str]
    titles: Mapping[str, str]
    reversed: frozenset[str]
    untitled: tuple[int, ...]


def headed(
    rows: Sequence[SheetRow],
    wanted: Container[str],
    columns: Mapping[str, str],
    *,
    is_first: bool = False,
    may_be_longer: bool = False,
) -> Head:
    """Find the header, and the columns that were chosen: titles by our names.

    Where no row is one, columns are called by their places, from 1. If it `may_be_longer` than
    the rows, titles at its end have no cells; else one may have been cut in two.
    """
    sources = [source.removeprefix("-") for source in columns.values()]
    place = 0 if is_first else header_in(rows, wanted, sources)
    line, below = rows[place].line, list(rows[place + 1 :])
    titles = list(rows[place].cells)
    if _are_numbers(titles, below, sources):
        below, titles = list(rows[place:]), [str(n) for n in range(1, len(titles) + 1)]
    units = [row.cells for row in _units_above(rows[:place])]
    if below and _is_of_units_below(below[0], below[1:]):
        units.append(below.pop(0).cells)
    found = dict(_found(titles, columns))
    chosen = {column for column, _ in found.values()}
    names = _named(titles, found, wanted)
    needed = {*found} | {n for n in names if n in wanted}
    n_names = _width(names, below, needed if may_be_longer else names)
    first = next((place for place, title in enumerate(titles) if title), 0)
    own = [unit_in(t) if n in chosen else name_and_unit(t)[1] for n, t in enumerate(titles)]
    said = dict(zip(names, _together(own, units), strict=True))
    return Head(
        tuple(names[:n_names]),
        _cut(below, n_names, len(titles)),
        line,
        {name: unit for name, unit in said.items() if unit},
        {name: titles[column] for name, (column, _) in found.items()},
        frozenset(name for name, (_, is_reversed) in found.items() if is_reversed),
        tuple(place for place in range(first, n_names) if not titles[place]),
    )


def _are_numbers(titles: Sequence[str], below: Sequence[SheetRow], sources: Sequence[str]) -> bool:
    """Whether a row is no header: all its cells are numbers, or those of a place that is chosen."""
    places = (place for source in sources if (place := _place(titles, source)) is not None)
    is_chosen = any(is_number(titles[place]) for place in places)
    return all(map(is_number, titles)) or (
        is_chosen and not _has_words_above_numbers(titles, below)
    )


def may_be_titles(rows: Sequence[SheetRow]) -> bool:
    """Whether the first of some rows looks like titles: it counts on, or has words above numbers.

    >>> may_be_titles([SheetRow(["0", "1"], 1), SheetRow(["0.5", "9"], 2)])
    True
    """
    first, *below = rows
    numbers = list(filter(is_number, first.cells))
    counted = ([str(begin + n) for n in range(len(numbers))] for begin in (0, 1))
    counts_on = len(numbers) > 1 and numbers in counted
    return counts_on or _has_words_above_numbers(first.cells, below)


def _has_words_above_numbers(cells: Sequence[str], below: Sequence[SheetRow]) -> bool:
    words = [place for place, cell in enumerate(cells) if cell and not is_number(cell)]
    columns = ([row.cells[place] for row in below if len(row.cells) > place] for place in words)
    return any(2 * sum(map(is_number, column)) > len(column) for column in columns)


def _found(
    titles: Sequence[str], columns: Mapping[str, str]
) -> Iterator[tuple[str, tuple[int, bool]]]:
    """The place of each column that was chosen, and whether its numbers are reversed."""
    for name, source in columns.items():
        for title in dict.fromkeys((source, source.removeprefix("-"))):
            place = _place(titles, title)
            if place is not None:
                yield name, (place, title != source)
                break


def _place(titles: Sequence[str], source: str) -> int | None:
    """The place of a title, with its unit or without; of a number that is none, the place itself.

    None where there is no such title, or more than one, or a number is a title at another place.
    """
    is_place = source.isascii() and source.isdigit() and len(source) < 7
    place = int(source) - 1 if is_place and 1 <= int(source) <= len(titles) else None
    bare_titles = [name_and_unit(title)[0] for title in titles]
    for known in (titles, bare_titles):
        if source in known:
            is_one = list(known).count(source) == 1 and place in (None, known.index(source))
            return known.index(source) if is_one else None
    return place


def _named(
    titles: Sequence[str], found: Mapping[str, tuple[int, bool]], wanted: Container[str]
) -> list[str]:
    """Our names where columns were chosen; of the others, those that stand there once.

    A name that is wanted may have its unit behind it.
    """
    bare_names = [name_and_unit(title)[0] for title in titles]
    names = [
        name if name in wanted and name not in found and name not in titles else title
        for title, name in zip(titles, bare_names, strict=True)
    ]
    if found:
        counts = Counter(titles)
        pairs = zip(names, titles, strict=True)
        names = ["" if counts[title] > 1 else name for name, title in pairs]
    for name, (place, _) in found.items():
        names[place] = name
    return names


def _units_above(rows: Sequence[SheetRow]) -> Iterator[SheetRow]:
    """Rows above the header that name units; those with text between have nothing else."""
    if rows and is_of_units(rows[-1]):
        yield rows[-1]
    yield from (row for row in rows[:-1] if are_units(row.cells))


def _is_of_units_below(row: SheetRow, rows: Sequence[SheetRow]) -> bool:
    """Whether the first row below the header names units: a 1 beside them may be a number."""
    if has_numbers(row):
        return is_of_units(row) and _has_words_above_numbers(row.cells, rows)
    return is_of_units(row)


def _together(own: Sequence[str], rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """The unit of each column, by its title and by the rows of units; all where they differ."""
    for column, unit in enumerate(own):
        yield together([unit, *(bare(row[column]) for row in rows if len(row) > column)])


def _width(names: Sequence[str], rows: Sequence[SheetRow], needed: Container[str]) -> int:
    """The number of columns: those at the end without a title, or without any cell, are none."""
    width = len(names)
    while width > 1 and not names[width - 1] and not any(any(r.cells[width - 1 :]) for r in rows):
        width -= 1
    longest = max((len(row.cells) for row in rows), default=width)
    while width > max(longest, 1) and names[width - 1] not in needed:
        width -= 1
    return width


def _cut(rows: list[SheetRow], width: int, n_titles: int) -> list[SheetRow]:
    """The rows without the separator that ends each of them: one more is a decimal comma's."""
    lengths = {len(row.cells) for row in rows}
    is_habit = len(lengths) == 1 and (len(rows) > 1 or lengths == {n_titles})
    if not is_habit or any(any(row.cells[width:]) for row in rows):
        return rows
    return [SheetRow(row.cells[:width], row.line) for row in rows]
