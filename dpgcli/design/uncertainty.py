"""Covariance of a finger's values, from the standard errors of calibrations."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from dpgcli.arrays import Array
from dpgcli.design.calibrations import Calibration
from dpgcli.design.scene import Uncertainty
from dpgcli.mechanics.finger import KEYS


class Share(NamedTuple):
    """Standard errors, (1 or unit, design), of a calibration's values; 0 in other units."""

    file: int
    key: str
    errors: Array


def uncertainty_of(
    calibrations: Sequence[str | Calibration], shares: Iterable[Share]
) -> Uncertainty | None:
    """The covariance of all fitted values behind a finger; None where there are none.

    An error of a fitted value is the same error in all units that the value is brought to. Values
    of one file are correlated as it says, those of a grid and of other files not (assumed).
    """
    every = list(shares)
    if not every:
        return None
    correlation = np.eye(len(every))
    for row, first in enumerate(every):
        for column, second in enumerate(every):
            if first.file == second.file:
                calibration = calibrations[first.file]
                assert isinstance(calibration, Calibration), "shares come from files"
                correlation[row, column] = calibration.correlation_of(first.key, second.key)
    return Uncertainty(tuple({KEYS[s.key]: s.errors} for s in every), correlation)
