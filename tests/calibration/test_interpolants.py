"""Interpolants against scipy's, and at complex places against differences."""

from itertools import product

import numpy as np
import pytest
from scipy.interpolate import RBFInterpolator, RegularGridInterpolator

from dpgcli.arrays import Array
from dpgcli.calibration.interpolants import Multilinear, ThinPlates

RNG = np.random.default_rng(5)
AXES = tuple(np.cumsum(RNG.uniform(0.2, 0.5, n)) for n in (3, 4, 2))
NODES = np.array(list(product(*AXES)))
VALUES = RNG.normal(size=len(NODES))
PLACES = RNG.uniform(-0.3, 1.3, (50, 3))


def test_thin_plates_are_those_of_scipy() -> None:
    points = NODES + RNG.normal(scale=0.05, size=NODES.shape)
    expected = RBFInterpolator(points, VALUES, kernel="thin_plate_spline", degree=1)(PLACES)
    assert ThinPlates.through(points, VALUES)(PLACES) == pytest.approx(expected, rel=1e-9)
    assert ThinPlates.through(points, VALUES)(points) == pytest.approx(VALUES, abs=1e-11)


def test_multilinear_is_that_of_scipy() -> None:
    table = VALUES.reshape([len(axis) for axis in AXES])
    peer = RegularGridInterpolator(AXES, table, bounds_error=False, fill_value=None)
    here = np.concatenate((PLACES, NODES))
    assert Multilinear(AXES, table)(here) == pytest.approx(peer(here), rel=1e-11, abs=1e-12)


@pytest.mark.parametrize(
    "made",
    [
        ThinPlates.through(NODES, VALUES),
        Multilinear(AXES, VALUES.reshape([len(axis) for axis in AXES])),
    ],
)
def test_each_place_by_itself_and_differentiated(made: ThinPlates | Multilinear) -> None:
    together = made(PLACES)
    alone = [made(PLACES[place : place + 1])[0] for place in range(len(PLACES))]
    assert together.tolist() == alone
    for key in range(3):
        step = np.eye(3)[key]
        slope = made(PLACES + 1e-100j * step).imag / 1e-100

        def difference(size: float, step: Array = step) -> Array:
            return (made(PLACES + size * step) - made(PLACES - size * step)) / (2.0 * size)

        expected = (4.0 * difference(1e-5) - difference(2e-5)) / 3.0
        assert slope == pytest.approx(expected, rel=1e-6, abs=1e-7)


def test_points_in_a_line_fix_no_plane() -> None:
    with pytest.raises(np.linalg.LinAlgError):
        ThinPlates.through(np.outer(np.arange(5.0), [1.0, 2.0]), np.arange(5.0))
