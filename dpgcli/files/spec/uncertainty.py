"""What the errors of calibration files mean for the values of a finger."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from dpgcli.arrays import Array
from dpgcli.files.calibration.models import Calibration
from dpgcli.mechanics.finger import KEYS
from dpgcli.mechanics.scene import Uncertainty


class Share(NamedTuple):
    """Values by unit, (1 or unit, 1), that come from a file, by its place; 0 in other units."""

    file: int
    key: str
    values: Array


def uncertainty_of(
    calibrations: Sequence[str | Calibration], shares: Iterable[Share]
) -> Uncertainty | None:
    """The covariance of all fitted values behind a finger; None where there are none.

    Calibrated values are scaled to other geometries by factors, and so are their errors.
    """
    by_place = {(share.file, share.key): share.values for share in shares}
    directions: list[dict[str, Array]] = []
    blocks: list[Array] = []
    for place, calibration in enumerate(calibrations):
        if not isinstance(calibration, Calibration):
            continue
        keys = list(calibration.uncertain)
        used = [k for k, key in enumerate(keys) if (place, key) in by_place]
        for key in (keys[k] for k in used):
            fitted = calibration.fitted(key)
            assert fitted is not None, "uncertain values are among the given ones"
            directions.append({KEYS[key]: by_place[place, key] / fitted.value})
        blocks.append(_covariance(calibration)[np.ix_(used, used)])
    return Uncertainty(tuple(directions), _diagonal(blocks)) if directions else None


def _covariance(calibration: Calibration) -> Array:
    errors = np.array(list(calibration.uncertain.values()))
    correlation = np.array(calibration.correlation or np.eye(len(errors)))
    return np.asarray(errors[:, None] * correlation.reshape(len(errors), -1) * errors)


def _diagonal(blocks: Sequence[Array]) -> Array:
    """One matrix with the blocks along its diagonal."""
    size = sum(map(len, blocks))
    whole, start = np.zeros((size, size)), 0
    for block in blocks:
        stop = start + len(block)
        whole[start:stop, start:stop] = block
        start = stop
    return whole
