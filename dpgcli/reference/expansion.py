"""Sums of springs in mpmath numbers: their energy, its gradient and its Hessian."""

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from mpmath import mpf

Rate = dict[int, "mpf"]


class ExactResponse(NamedTuple):
    """A spring's energy, force and stiffness."""

    energy: "mpf"
    force: "mpf"
    stiffness: "mpf"


def linear(stiffness: "mpf", x: "mpf") -> ExactResponse:
    """E = ½ k x²."""
    return ExactResponse(stiffness * x * x / 2, stiffness * x, stiffness)


class Expansion:
    """An energy with its gradient and Hessian, summed up element by element.

    `band[i][k]` is the Hessian's entry (i, i−k). Where walls give way, each unit has a row more,
    before its own `width`; in rates the walls are rows −1, −2, ….
    """

    def __init__(self, size: int, bandwidth: int, width: int = 0) -> None:
        from mpmath import mpf

        self.width = width
        self.energy = mpf(0)
        self.gradient = [mpf(0)] * size
        self.band = [[mpf(0)] * (min(row, bandwidth) + 1) for row in range(size)]

    def row(self, row: int) -> int:
        """Where a row of a rate stands."""
        if not self.width:
            return row
        if row < 0:
            return (self.width + 1) * (-1 - row)
        unit, rest = divmod(row, self.width)
        return (self.width + 1) * unit + 1 + rest

    def add(self, response: ExactResponse, rate: Rate) -> None:
        """Add E, F r and K r rᵀ of a spring whose coordinate has the gradient r, `rate`.

        The rate's own derivatives, F ∇r, are added by `add_square` and `add_bend`.
        """
        self.energy += response.energy
        for row, slope in rate.items():
            self.gradient[self.row(row)] += response.force * slope
        self.add_square(response.stiffness, rate)

    def add_square(self, factor: "mpf", rate: Rate) -> None:
        """Add factor · r rᵀ to the Hessian."""
        placed = {self.row(row): slope for row, slope in rate.items()}
        for row, slope in placed.items():
            scaled = factor * slope
            for column, other in placed.items():
                if column <= row:
                    self.band[row][row - column] += scaled * other

    def add_bend(self, factor: "mpf", first: Rate, second: Rate) -> None:
        """Add factor · (r sᵀ + s rᵀ) to the Hessian."""
        first, second = ({self.row(row): v for row, v in rate.items()} for rate in (first, second))
        for row in first:
            r, s = factor * first[row], factor * second[row]
            for column in first:
                if column <= row:
                    self.band[row][row - column] += r * second[column] + s * first[column]
