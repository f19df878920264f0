"""Parameter spaces: designs as points of a grid of axes, made when they are asked for."""

from collections.abc import Mapping, Sequence
from math import prod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dpgcli.arrays import Array
from dpgcli.records import dataclass

DesignValues = Mapping[str, NDArray[Any]]  # by key, one for each design
SAMPLES_AT_ONCE = 2**16


@dataclass(frozen=True)
class Axis:
    """Keys that vary together, each with one value per point."""

    values: DesignValues

    def __post_init__(self) -> None:
        if len({len(column) for column in self.values.values()}) != 1:
            raise ValueError("the keys of an axis need equally many values, at least one key")

    def __len__(self) -> int:
        return len(next(iter(self.values.values())))


@dataclass(frozen=True)
class Space:
    """The product of axes, in order, the last one varying fastest.

    >>> space = Space((listed("a", [1, 2]), listed("b", [0.5, 1.0, 1.5])))
    >>> space.size, {k: v.tolist() for k, v in space.designs(2, 5).items()}
    (6, {'a': [1, 2, 2], 'b': [1.5, 0.5, 1.0]})
    """

    axes: tuple[Axis, ...]

    @property
    def keys(self) -> tuple[str, ...]:
        return tuple(key for axis in self.axes for key in axis.values)

    @property
    def size(self) -> int:
        return prod(len(axis) for axis in self.axes)

    def designs(self, start: int, stop: int) -> DesignValues:
        """Values by key of the designs start … stop − 1."""
        places = np.unravel_index(np.arange(start, stop), [len(axis) for axis in self.axes])
        return {
            key: column[place]
            for axis, place in zip(self.axes, places, strict=True)
            for key, column in axis.values.items()
        }


def listed(key: str, values: Sequence[float]) -> Axis:
    """The values as they are; whole numbers stay whole."""
    return Axis({key: np.asarray(values)})


def linear(key: str, first: float, last: float, count: int) -> Axis:
    """Evenly spaced values, both ends included."""
    return Axis({key: np.linspace(first, last, count)})


def logarithmic(key: str, first: float, last: float, count: int) -> Axis:
    """Values in even ratios, both ends included and exact; both above zero."""
    return Axis({key: np.geomspace(first, last, count)})


@dataclass(frozen=True)
class Range:
    """Bounds of a sampled key; `is_logarithmic` samples its logarithm."""

    first: float
    last: float
    is_logarithmic: bool = False

    def at(self, fraction: Array) -> Array:
        """Values at fractions 0 … 1 of the range."""
        if self.is_logarithmic:
            low, high = np.log(self.first), np.log(self.last)
            return np.asarray(np.exp(low + fraction * (high - low)))
        return self.first + fraction * (self.last - self.first)


def sampled(method: str, ranges: Mapping[str, Range], count: int, seed: int) -> Axis:
    """Seeded samples of a box by scipy.stats.qmc: "sobol" (scrambled) or "latin_hypercube"."""
    from scipy.stats import qmc

    engines = {"sobol": qmc.Sobol, "latin_hypercube": qmc.LatinHypercube}
    engine = engines[method](d=len(ranges), rng=np.random.default_rng(seed))
    size = SAMPLES_AT_ONCE if method == "sobol" else count
    columns = {key: np.empty(count) for key in ranges}
    for first in range(0, count, size):
        n = min(size, count - first)
        drawn = 2 ** (n - 1).bit_length() if method == "sobol" else n  # balanced in powers of two
        fractions = engine.random(drawn)[:n]
        for (key, bounds), fraction in zip(ranges.items(), fractions.T, strict=True):
            columns[key][first : first + n] = bounds.at(fraction)
    return Axis(columns)
