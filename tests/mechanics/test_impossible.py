"""Shapes that the equations allow and no finger takes."""

import numpy as np
import pytest

from dpgcli.arrays import Array
from dpgcli.mechanics.chain import Chain
from dpgcli.mechanics.coordinates import Internal
from dpgcli.mechanics.finger import STUDY, Finger, uniform_finger
from dpgcli.mechanics.lattice import Lattice

FINGER = uniform_finger(2, **STUDY, linear_stiffness=1e4)
REST = {"chord": 0.0, "near_angle": 0.0, "far_angle": 0.0, "strut": 0.0}


def shape(**second_unit: float) -> Internal:
    """The straight finger with other values in its second unit."""
    return Internal(*(np.array([[0.0], [second_unit.get(name, 0.0)]]) for name in REST))


def is_folded(finger: Finger, at: Internal, formulation: type[Chain | Lattice] = Chain) -> bool:
    potential = formulation(finger)
    return bool(potential.springs(potential.of_shape(at)).is_folded[0])


@pytest.mark.parametrize("formulation", [Chain, Lattice])
@pytest.mark.parametrize(
    ("possible", "impossible"),
    [
        ({"near_angle": 1.5}, {"near_angle": 1.6}),
        ({"far_angle": -0.8}, {"far_angle": -1.6}),
        ({"chord": -13.4}, {"chord": -13.6}),
        ({"strut": -10.7}, {"strut": -10.8}),
    ],
)
def test_each_limit_alone(
    formulation: type[Chain | Lattice], possible: dict[str, float], impossible: dict[str, float]
) -> None:
    assert not is_folded(FINGER, shape(**possible), formulation)
    assert is_folded(FINGER, shape(**impossible), formulation)


@pytest.mark.parametrize("formulation", [Chain, Lattice])
def test_struts_that_cross_at_less_than_a_right_angle(formulation: type[Chain | Lattice]) -> None:
    slim = FINGER.changed(segment_length=np.array([[6.0]]))
    angle = np.arcsin(3.0 / 10.75)
    assert not is_folded(slim, shape(near_angle=-0.9 * angle, far_angle=-0.9 * angle), formulation)
    assert is_folded(slim, shape(near_angle=-1.1 * angle, far_angle=-1.1 * angle), formulation)


def sides_cross(corners: Array) -> bool:
    """Whether two opposite sides of a quadrilateral B0 B1 T1 T0 meet, by orientation."""

    def turn(a: Array, b: Array, c: Array) -> float:
        return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))

    def meet(a: Array, b: Array, c: Array, d: Array) -> bool:
        return turn(a, b, c) * turn(a, b, d) < 0.0 and turn(c, d, a) * turn(c, d, b) < 0.0

    b0, b1, t1, t0 = corners
    return meet(b0, b1, t1, t0) or meet(b1, t1, t0, b0)


def test_what_is_possible_is_a_quadrilateral_whose_sides_do_not_cross() -> None:
    """Random cells of all proportions: every crossing is refused."""
    random = np.random.default_rng(3)
    n_crossing = n_possible = 0
    for _ in range(4000):
        unit = uniform_finger(
            1,
            **{**STUDY, "segment_length": random.uniform(1.0, 20.0)},
            linear_stiffness=1e4,
        )
        low, high = np.array([-14.0, -1.8, -1.8, -12.0]), np.array([6.0, 1.8, 1.8, 10.0])
        at = Internal(*(np.array([[value]]) for value in random.uniform(low, high)))
        chain = Chain(unit)
        b_x, b_y, t_x, t_y = (float(values[0, 0]) for values in chain.stations(chain.of_shape(at)))
        corners = np.array([(0.0, 0.0), (b_x, b_y), (t_x, t_y), (0.0, 10.75)])
        folded = is_folded(unit, at)
        n_possible += not folded
        if sides_cross(corners):
            n_crossing += 1
            assert folded, at
    assert min(n_crossing, n_possible) > 300
