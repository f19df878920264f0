"""The search for the values at which residuals are smallest, within bounds."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.optimize import least_squares

from dpgcli.arrays import Array, Flags, Indices
from dpgcli.calibration.choices import Loss
from dpgcli.calibration.losses import TUNING, growth
from dpgcli.errors import FitError
from dpgcli.records import dataclass

NEAR_BOUND = 1e-3  # of a parameter's size: closer than this, the bound itself is tried
SMALLEST_SINGULAR_VALUE = (
    1e-9  # of the Jacobian's unit columns; below it, they depend on each other
)
SMALLEST_EFFECT = 1e-12  # of the largest parameter's effect on the data; below it is rounding
TOLERANCE = 1e-14
MOST_STEPS = 500
NORMAL_DEVIATION = 1.4826  # of normal errors, over their median absolute value

Function = Callable[[Array], Array]


@dataclass(frozen=True)
class Parameter:
    """A value to fit, or held at its start: key (unit in the name), start and bounds."""

    key: str
    start: float
    lower: float = -np.inf
    upper: float = np.inf
    is_free: bool = True

    @property
    def size(self) -> float:
        """A positive number of the parameter's magnitude.

        >>> Parameter("force_linearity", -0.5).size, Parameter("force_linearity", 0.0).size
        (0.5, 1.0)
        """
        return abs(self.start) or 1.0


@dataclass(frozen=True)
class Search:
    """The cost to minimize: a residual's `rows` under a loss, by the parameters."""

    parameters: tuple[Parameter, ...]
    residual: Function
    jacobian: Function
    loss: Loss
    rows: Indices

    def scaled(self, start: Array, free: Flags, given: float | None) -> tuple[Array, float]:
        """A better start and the scale of the loss, from fits that each refine the scale."""
        if given is not None or self.loss is Loss.LINEAR:
            return start, 1.0 if given is None else given
        plain = replace(self, loss=Loss.LINEAR)
        values = plain.solved(start, free, 1.0)[0]
        scale = 1.0
        for _ in range(3):
            size = float(np.median(np.abs(self.residual(values))))
            if size == 0.0:
                break  # half of the points are met exactly: any scale will do
            scale = TUNING[self.loss] * NORMAL_DEVIATION * size
            values = self.solved(values, free, scale)[0]
        return values, scale

    def solved(self, start: Array, free: Flags, scale: float) -> tuple[Array, Flags]:
        """Values at the smallest cost, and flags of the free ones; values at a bound are held."""
        values = self.searched(start, free, scale)
        for place in np.flatnonzero(free):
            parameter = self.parameters[place]
            for bound in (parameter.lower, parameter.upper):
                if abs(values[place] - bound) > NEAR_BOUND * parameter.size:
                    continue
                held = free.copy()
                held[place] = False
                moved = values.copy()
                moved[place] = bound
                at_bound, still_free = self.solved(moved, held, scale)
                if self.cost(at_bound, scale) <= self.cost(values, scale) * (1.0 + 1e-9):
                    return at_bound, still_free
        return values, free

    def searched(self, start: Array, free: Flags, scale: float) -> Array:
        """The minimum over the free parameters. Raises FitError if the search finds none."""
        if not free.any():
            return start
        at_start = self.residual(start)[self.rows]
        if not np.isfinite(at_start).all():
            raise FitError(f"the model has no value at its start: {self.named(start)}")
        size, lower, upper = np.array([(p.size, p.lower, p.upper) for p in self.parameters])[free].T
        # all of order one, so that tolerances mean the same in any unit
        unit = float(np.sqrt((at_start**2).mean())) or 1.0

        def residual(scaled: Array) -> Array:
            return np.asarray(self.residual(_with(start, free, scaled * size))[self.rows] / unit)

        def jacobian(scaled: Array) -> Array:
            slopes = self.jacobian(_with(start, free, scaled * size))
            return np.asarray(slopes[np.ix_(self.rows, free)] * size / unit)

        found = least_squares(
            residual,
            start[free] / size,
            jacobian,
            bounds=(lower / size, upper / size),
            method="trf",
            loss=self.loss.value,
            f_scale=scale / unit,
            ftol=TOLERANCE,
            xtol=TOLERANCE,
            gtol=TOLERANCE,
            max_nfev=MOST_STEPS,
        )
        values = _with(start, free, found.x * size)
        self.check_told_apart(values, free)
        if found.status <= 0:
            hint = self.told_apart_worst(values, free)
            at = self.named(values)
            raise FitError(f"no convergence after {found.nfev} steps, at {at}{hint}")
        return values

    def check_told_apart(self, values: Array, free: Flags) -> None:
        """Raise FitError for parameters that the data leave undetermined."""
        keys, columns = self._effects(values, free)
        _, singular, directions = np.linalg.svd(columns, full_matrices=False)
        if singular[-1] > SMALLEST_SINGULAR_VALUE:
            return
        if idle := [k for k, effect in zip(keys, columns.T, strict=True) if not effect.any()]:
            raise FitError(f"the data do not depend on {' and '.join(idle)}: fix it")
        alike = [k for k, part in zip(keys, directions[-1], strict=True) if abs(part) > 0.1]
        raise FitError(f"the data cannot tell {' and '.join(alike)} apart: fix one of them")

    def told_apart_worst(self, values: Array, free: Flags) -> str:
        """The two free values whose effects on the data are most alike, and what helps, in words.

        Along a valley of such values the search goes on without end.
        """
        keys, columns = self._effects(values, free)
        if len(keys) == 1:
            return ""
        alike = np.triu(np.abs(columns.T @ columns), 1)
        pair = np.unravel_index(alike.argmax(), alike.shape)
        one, other = (keys[place] for place in pair)
        return (
            f": of the free values the data tell {one} and {other} apart worst (their effects are "
            f"alike by {100.0 * alike[pair]:.4g} %): fix one of them"
        )

    def _effects(self, values: Array, free: Flags) -> tuple[list[str], Array]:
        """Keys of the free values, and their effects on the data, (row, value), of length one.

        What is rounding beside the others is zero.
        """
        slopes = self.jacobian(values)[np.ix_(self.rows, free)]
        length = np.sqrt((slopes**2).sum(axis=0))
        effect = length * np.array([p.size for p in self.parameters])[free]
        length = np.where(effect > SMALLEST_EFFECT * effect.max(initial=0.0), length, 0.0)
        keys = [p.key for p, is_free in zip(self.parameters, free, strict=True) if is_free]
        return keys, slopes / np.where(length > 0.0, length, np.inf)

    def cost(self, values: Array, scale: float) -> float:
        """½ Σ C² ρ((r/C)²) over the rows that count."""
        ratio = (self.residual(values)[self.rows] / scale) ** 2
        return float(0.5 * scale**2 * growth(self.loss, ratio).sum())

    def named(self, values: Array) -> str:
        """Values with their keys, for messages."""
        pairs = zip(self.parameters, values, strict=True)
        return ", ".join(f"{p.key} = {value:.6g}" for p, value in pairs)


def _with(values: Array, free: Flags, some: Array) -> Array:
    """The values with the free ones replaced."""
    changed = values.copy()
    changed[free] = some
    return changed
