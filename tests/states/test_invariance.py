"""Units of measure, storage of uniform fingers, and repeated runs change nothing."""

from collections.abc import Callable

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from dpgcli.arrays import Flags
from dpgcli.design.scene import Scene
from dpgcli.mechanics.finger import SHARED, Finger
from dpgcli.mechanics.terms import chain_potential
from dpgcli.states.certify import certify
from dpgcli.states.plan import Request
from dpgcli.states.predict import predict
from dpgcli.states.settle import settle
from dpgcli.states.tip import tip
from dpgcli.states.units import UnitSolutions

Fingers = Callable[..., Finger]
EXPONENTS = st.floats(-3.0, 3.0)


def in_other_units(finger: Finger, length: float, force: float) -> Finger:
    """The same finger where the units of length and force are that many times smaller."""
    factors = {
        "segment_length": length,
        "segment_height": length,
        "stroke": length,
        "bistable_stiffness": force / length,
        "force_linearity": 1.0,
        "hinge_stiffness": force * length,
        "linear_stiffness": force / length,
        "dome_travel": length,
        "wall_compliance": length / force,
        "hinge_coupling": force * length,
    }
    return Finger(
        finger.n_units, **{name: v * factors[name] for name, v in finger.arrays().items()}
    )


@given(length=EXPONENTS, force=EXPONENTS, seed=st.integers(0, 50), relative=st.floats(0.5, 8.0))
def test_states_do_not_depend_on_the_units_of_measure(
    graded_finger: Fingers,
    all_patterns: Callable[[int], Flags],
    length: float,
    force: float,
    seed: int,
    relative: float,
) -> None:
    finger = graded_finger(3, seed, 12.84 * 10.0**relative)
    scaled = in_other_units(finger, 10.0**length, 10.0**force)
    statuses, poses, reached = [], [], []
    for f, unit in ((finger, 1.0), (scaled, 10.0**length)):
        units = UnitSolutions.of(f)
        batch = settle(units, chain_potential, all_patterns(3), 1e-12)
        statuses.append(certify(batch, units, 1e-12))
        poses.append(tip(batch, with_compliance=False).pose / np.array([[unit], [unit], [1.0]]))
        reached.append(batch.reached)
    np.testing.assert_array_equal(*statuses)
    np.testing.assert_array_equal(*reached)
    np.testing.assert_allclose(poses[0], poses[1], rtol=0, atol=1e-12 * 50)


def test_a_uniform_finger_may_be_stored_unit_by_unit(reference_finger: Fingers) -> None:
    finger = reference_finger(5, 1e4)
    spread = {
        name: v if name in SHARED else np.repeat(v, 5, axis=0)
        for name, v in finger.arrays().items()
    }
    request = Request(columns=("all",))
    once = predict(Scene(finger, ()), request).arrays()
    each = predict(Scene(Finger(5, **spread), ()), request).arrays()
    for name, values in once.items():
        if values.dtype.kind == "U":
            np.testing.assert_array_equal(each[name], values)
        elif name not in ("residual_N", "numerical_error_mm"):
            np.testing.assert_allclose(each[name], values, rtol=1e-9, atol=1e-12)


def test_two_runs_have_the_same_bytes(graded_finger: Fingers) -> None:
    scene = Scene(graded_finger(13, 71, 1e4), ())
    for columns in (("states",), ("states", "openings")):
        first, second = (predict(scene, Request(columns=columns)).arrays() for _ in range(2))
        assert "tip_x_mm" in first
        for name, values in first.items():
            assert values.tobytes() == second[name].tobytes()


def test_a_state_has_the_same_bits_alone_and_in_the_map(graded_finger: Fingers) -> None:
    scene = Scene(graded_finger(6, 72, 1e3), ())
    whole = predict(scene).arrays()
    alone = predict(scene, Request(("101101",))).arrays()
    assert alone.keys() == whole.keys()
    assert "tip_x_mm" in alone
    for name, values in alone.items():
        assert values.tobytes() == whole[name][[0b101101]].tobytes(), name


def test_units_beyond_rigid_bars_do_not_feel_each_other(graded_finger: Fingers) -> None:
    finger = graded_finger(4, 73, np.inf)
    rows = predict(Scene(finger, ()), Request(columns=("openings",))).arrays()
    for i in range(1, 5):
        openings = rows[f"opening_{i}_mm"]
        inverted = np.array([pattern[i - 1] == "1" for pattern in rows["pattern"]])
        assert np.ptp(openings[inverted]) < 1e-13
        np.testing.assert_allclose(openings[~inverted], 0.0, atol=1e-14)
