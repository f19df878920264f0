"""What outputs rest on, as lines of text."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

from dpgcli.design.outputs import Output, Trust


def trust_lines(trusts: Sequence[Trust], warnings: Sequence[str]) -> Iterator[str]:
    """A table of what each output rests on, and the warnings of calibrations in use."""
    if not trusts:
        yield "nothing: there is no design to solve"
        return
    rows = [("output", "basis", "known error", "from"), *_rows(trusts)]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        cells = (cell.ljust(width) for cell, width in zip(row, widths, strict=True))
        yield "  ".join(cells).rstrip()
    if doubted := [trust.output for trust in _shown(trusts) if trust.doubt]:
        yield f"choose no design by these without more: {', '.join(doubted)} (dpg help trust)"
    yield from (f"warning: {warning}" for warning in warnings)


def _shown(trusts: Sequence[Trust]) -> list[Trust]:
    """All, but barriers only where they rest on something else than energies."""
    (energies,) = (trust for trust in trusts if trust.output is Output.ENERGIES)
    alike = replace(energies, output=Output.BARRIERS)
    return [trust for trust in trusts if trust != alike]


def _rows(trusts: Sequence[Trust]) -> Iterator[tuple[str, str, str, str]]:
    for trust in _shown(trusts):
        name = "of these, barriers" if trust.output is Output.BARRIERS else trust.output.value
        yield name, trust.basis_text, trust.known_error, trust.source
