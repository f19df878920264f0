"""Cards of a CalculiX deck as lines of text; nodes and elements are numbered from 1 there."""

from collections.abc import Iterable, Iterator

from dpgcli.arrays import Array, Indices

UNITS = "Units: mm, N, MPa, s; mass in t."
END_OF_STEP = ("*NODE PRINT, NSET=ALL", "U", "*END STEP")


def digits(value: float) -> str:
    """A number in twelve digits.

    >>> digits(1 / 3)
    '0.333333333333'
    """
    return f"{value:.12g}"


def mesh_lines(nodes: Array, elements: Indices, kind: str) -> Iterator[str]:
    """Nodes and elements, at most fifteen numbers to a line as CalculiX wants it."""
    yield "*NODE, NSET=ALL"
    for number, point in enumerate(nodes, start=1):
        yield ", ".join([str(number), *map(digits, point)])
    yield f"*ELEMENT, TYPE={kind}, ELSET=BODY"
    for number, element in enumerate(elements, start=1):
        yield from _wrapped((number, *(element + 1)), 15)


def set_lines(head: str, indices: Indices) -> Iterator[str]:
    """A set of nodes or elements."""
    yield head
    yield from _wrapped(indices + 1, 15)


def elastic_lines(modulus: float, poisson: float) -> tuple[str, ...]:
    """Rubber of all elements, in large displacements St Venant-Kirchhoff."""
    return (
        "*MATERIAL, NAME=RUBBER",
        "*ELASTIC",
        f"{digits(modulus)}, {digits(poisson)}",
        "*SOLID SECTION, ELSET=BODY, MATERIAL=RUBBER",
    )


def force_lines(forces: Array, size: float) -> Iterator[str]:
    """Forces (n,) in N along x, so many times; they keep their direction."""
    yield "*CLOAD"
    for node in forces.nonzero()[0].tolist():
        yield f"{node + 1}, 1, {digits(size * forces[node])}"


def _wrapped(numbers: Iterable[int], n_per_line: int) -> Iterator[str]:
    words = [str(number) for number in numbers]
    for start in range(0, len(words), n_per_line):
        more = "," if start + n_per_line < len(words) else ""
        yield ", ".join(words[start : start + n_per_line]) + more
