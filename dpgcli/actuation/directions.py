"""States and what is done to them: one line of pressure up or down, the others left alone."""

from collections.abc import Iterator, Sequence
from dataclasses import fields
from typing import Self

import numpy as np

from dpgcli.actuation.pressed import Pressed, Shapes
from dpgcli.actuation.rest import at_rest
from dpgcli.actuation.staircase import Stair, Way, staircase
from dpgcli.arrays import Array, Codes, Indices
from dpgcli.records import dataclass
from dpgcli.states.patterns import inverted_units
from dpgcli.states.settle import lanes_at_once

SIGNS = (1, -1)  # above and below the pressure around


@dataclass(frozen=True)
class SideBySide:
    """Arrays of the same length, side by side."""

    def take(self, which: Indices) -> Self:
        """Some of the rows."""
        return type(self)(*(getattr(self, field.name)[which] for field in fields(self)))

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """The rows of all parts, of which there is at least one."""
        names = [field.name for field in fields(cls)]
        return cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


@dataclass(frozen=True)
class Directions(SideBySide):
    """States and what is done to each, (lane,): `line` gets a pressure of this `sign`.

    `design` and `code` are places among the designs and of patterns, see `states.patterns`.
    """

    design: Indices
    code: Codes
    line: Indices
    sign: Indices

    @classmethod
    def of(cls, design: Indices, code: Codes, n_lines: int) -> "Directions":
        """Every line up and down, state by state."""
        each = n_lines * len(SIGNS)
        line, sign = (
            part.ravel() for part in np.meshgrid(np.arange(n_lines), SIGNS, indexing="ij")
        )
        n = len(code)
        return cls(design.repeat(each), code.repeat(each), np.tile(line, n), np.tile(sign, n))

    def __len__(self) -> int:
        return len(self.code)

    def chunks(self, n_units: int) -> Iterator["Directions"]:
        """Parts that the processor's cache can hold, in order."""
        size = lanes_at_once(n_units)
        for first in range(0, len(self), size):
            yield self.take(np.arange(first, min(first + size, len(self))))


def raised(
    pressed: Pressed,
    line_of: Indices,
    reach: Array,
    directions: Directions,
    n_stairs: int | None = None,
) -> tuple[Pressed, tuple[Stair, ...], Way]:
    """The staircases of states, all certified, in their directions; see `staircase`."""
    own = pressed.take_lanes(directions.design)
    shapes, _ = at_rest(own, inverted_units(directions.code, pressed.finger.n_units))
    peak = directions.sign * reach[directions.design]
    target = np.where(line_of[:, None] == directions.line, peak, 0.0)
    return own, *staircase(own, shapes, target, n_stairs)


def on_line(shapes: Shapes, line_of: Indices, line: Indices) -> Array:
    """The pressures of shapes, (lane,), on one line each, MPa."""
    first = np.array([int(np.argmax(line_of == place)) for place in range(int(line_of.max()) + 1)])
    return np.asarray(shapes.pressure[first[line], np.arange(len(line))])
