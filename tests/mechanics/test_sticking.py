"""Places that stick to a body: derivatives, and where they are."""

import numpy as np
import pytest

from dpgcli.arrays import Array
from dpgcli.mechanics.chain import Chain
from dpgcli.mechanics.face import Face
from dpgcli.mechanics.finger import STUDY, uniform_finger
from dpgcli.mechanics.gaps import FaceGaps
from dpgcli.mechanics.obstacle import Obstacle
from dpgcli.mechanics.sticking import Sticking

STEP = 1e-3
SQUARE = Obstacle.polygon(np.array([[20.0, 34.0, 34.0, 20.0], [-14.0, -14.0, -2.0, -2.0]]))
DISC = Obstacle.disc(np.array([26.0, -12.0]), 8.0)


def begun(body: Obstacle, cell: int, stiffness: float = 1e4) -> tuple[Sticking, Array, FaceGaps]:
    """A finger of three units that sticks where it is pushed in a cell, seen by a moving body."""
    chain = Chain(uniform_finger(3, **STUDY, linear_stiffness=stiffness))
    ways = np.array([[1.0, 0.3], [0.0, -1.0]])[..., None]
    n = chain.size
    face = Face.of(chain, np.array([[1.5]])).seen_from(ways, np.array([n, n + 1]))
    gaps = FaceGaps(face, body)
    here = 0.05 * np.random.default_rng(3).normal(size=(n + 2, 2))
    push = np.zeros((gaps.n_cells, 2))
    push[cell] = 0.7
    return Sticking.of(gaps, here, push, np.full((1, 2), 0.5)), here, gaps


@pytest.mark.parametrize(("body", "cell"), [(DISC, 0), (DISC, 1), (DISC, 2), (SQUARE, 12 + 14)])
@pytest.mark.parametrize("stiffness", [1e4, np.inf])
def test_derivatives(body: Obstacle, cell: int, stiffness: float) -> None:
    measure, here, _ = begun(body, cell, stiffness)
    rows = [row.offset for row in measure.rows]
    away = here + 0.1 * np.random.default_rng(4).normal(size=here.shape)
    found, force = measure(away), np.array([[1.3, -0.6]])
    bent = found.bent(force)
    for place, row in enumerate(rows):
        values, slopes = [], []
        for share in (-2, -1, 1, 2):
            moved = away.copy()
            moved[row] += share * STEP
            at = measure(moved)
            values.append(at.value[0])
            slopes.append(force * at.gradient[:, 0])
        central = [
            (f[0] - 8.0 * f[1] + 8.0 * f[2] - f[3]) / (12.0 * STEP) for f in (values, slopes)
        ]
        assert found.gradient[place, 0] == pytest.approx(central[0], rel=1e-7, abs=1e-8)
        assert bent[place] == pytest.approx(central[1], rel=1e-7, abs=1e-8)


@pytest.mark.parametrize(("body", "cell"), [(DISC, 1), (SQUARE, 12 + 14)])
def test_it_begins_where_the_body_is_nearest_and_counts_across_the_push(
    body: Obstacle, cell: int
) -> None:
    measure, here, gaps = begun(body, cell)
    assert measure(here).value.tolist() == [[0.0, 0.0]]
    touches, gap = gaps.touches(here), gaps(here)
    way = touches.directions[:, cell] * np.ones((2, 2))
    assert (measure.along[:, 0] * way).sum(axis=0) == pytest.approx([0.0, 0.0], abs=1e-15)
    if body is DISC and (gap.place[cell] == cell).all():
        away = touches.places[:, cell] - measure.origin[:, 0]
        assert np.hypot(*away) == pytest.approx(np.abs(gap.value[cell]), rel=1e-12)
    few = measure.take_lanes(np.array([1]))
    moved = here + 0.01
    assert few(moved[:, 1:]).value.tolist() == measure(moved).value[:, 1:].tolist()
