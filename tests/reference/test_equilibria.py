"""The reference itself: against the model's numbers, and an energy written in another way."""

import ast
from dataclasses import replace
from itertools import product
from pathlib import Path
from types import ModuleType

import mpmath
import numpy as np
import pytest

from dpgcli.arrays import Array, Flags
from dpgcli.mechanics.finger import ARRAYS, Finger, uniform_finger
from dpgcli.mechanics.finger import STUDY as REFERENCE
from dpgcli.mechanics.laws import bistable
from dpgcli.mechanics.terms import chain_potential
from dpgcli.reference import energy, equilibria, expansion, vectors
from dpgcli.reference import units as units_module
from dpgcli.reference.energy import ElasticBars, RigidBars
from dpgcli.reference.equilibria import ExtendedStates, extended_states
from dpgcli.reference.units import Unit, extended_units, inverted_angle, spring_barrier
from dpgcli.states.settle import settle
from dpgcli.states.tip import min_eigenvalues, tip
from dpgcli.states.units import UnitSolutions

FOLD = 0.0964682337467354  # α at which the reference unit with rigid bars loses its second well
LONG_DOUBLE = 4.0 * float(np.finfo(np.longdouble).eps)
OWN = (energy, expansion, vectors, units_module)


def finger_of(n_units: int, linear_stiffness: float = np.inf, **changes: float) -> Finger:
    return uniform_finger(n_units, **REFERENCE | changes, linear_stiffness=linear_stiffness)


def graded_finger(n_units: int, linear_stiffness: float) -> Finger:
    random = np.random.default_rng(5)
    values = {name: v * random.uniform(0.8, 1.2, (n_units, 1)) for name, v in REFERENCE.items()}
    values["segment_height"] = values["segment_height"][:1]
    return Finger(n_units, **values, linear_stiffness=np.array([[linear_stiffness]]))


def units_of(*patterns: str) -> Flags:
    return np.array([[digit == "1" for digit in pattern] for pattern in patterns]).T


def solver_nodes(finger: Finger, inverted: Flags) -> Array:
    batch = settle(UnitSolutions.of(finger), chain_potential, inverted, 1e-12)
    stations = batch.potential.coordinates.stations(batch.equilibrium.coordinates)
    return np.stack(stations, axis=1).reshape(4 * finger.n_units, -1)


def assert_same(one: ExtendedStates, other: ExtendedStates, within: float) -> None:
    assert one.is_minimum.all() and other.is_minimum.all()
    assert one.in_pattern.all() and other.in_pattern.all()
    for name in ("pose", "energy", "openings"):
        values, others = getattr(one, name), getattr(other, name)
        assert np.abs(values - others).max() <= within * np.abs(values).max(), name


@pytest.mark.parametrize(
    ("pattern", "x", "y", "energy"),
    [
        ("111", 35.28310873, -17.24079693, 13.08400032),
        ("101", 38.35981703, -11.99285355, 8.72266851),
        ("11111", 44.65422600, -42.23246372, 21.80666612),
    ],
)
def test_reference_values(pattern: str, x: float, y: float, energy: float) -> None:
    states = extended_states(finger_of(len(pattern), 1e4), units_of(pattern))
    assert states.is_minimum.all() and states.in_pattern.all()
    found = [*states.pose[:2, 0], states.energy[0]]
    assert np.abs(np.array(found, float) - (x, y, energy)).max() < 5.1e-9


def test_a_single_unit_with_rigid_bars() -> None:
    states = extended_states(finger_of(1), units_of("1"))
    assert float(states.openings[0, 0]) == pytest.approx(3.2450151985, abs=5.1e-11)
    assert -np.degrees(float(states.pose[2, 0])) == pytest.approx(17.36175941, abs=5.1e-9)
    assert float(states.energy[0]) == pytest.approx(4.3613588754, abs=5.1e-11)
    (unit,) = extended_units(finger_of(1))
    alone = bistable(*(np.array(float(v)) for v in (spring_barrier(unit), 12.84, 0.043, 3.5)))
    assert abs(alone.force) < 1e-13
    assert alone.stiffness < 0.0, "the barrier's, not the well's"


def energy_in_complex_numbers(
    units: list[Unit], nodes: list[mpmath.mpf], coupling: float = 0.0
) -> mpmath.mpf:
    """The model's energy; rigid bars must have kept their lengths."""
    last_turn = mpmath.mpf(0)
    base, top = mpmath.mpc(0), mpmath.mpc(0, units[0].height)
    energy = mpmath.mpf(0)
    for i, unit in enumerate(units):
        next_base, next_top = (mpmath.mpc(*nodes[k : k + 2]) for k in (4 * i, 4 * i + 2))
        chord, near, far = next_base - base, top - base, next_top - next_base
        u = (abs(next_top - top) - unit.length) / unit.stroke
        well = unit.linearity * u**2 + (1 - unit.linearity) * u**2 * (1 - u) ** 2
        turns = [mpmath.arg(strut / chord / 1j) for strut in (near, far)]
        energy += unit.bistable * unit.stroke**2 * well / 2
        energy += unit.hinge * (turns[0] ** 2 + turns[1] ** 2)
        turn = turns[0] - turns[1]
        energy -= coupling * turn * last_turn
        last_turn = turn
        extensions = abs(chord) - unit.length, abs(far) - unit.height
        if mpmath.isinf(unit.bar):
            assert max(map(abs, extensions)) < mpmath.mpf("1e-55")
        else:
            energy += unit.bar * (extensions[0] ** 2 + extensions[1] ** 2) / 2
        base, top = next_base, next_top
    return energy


@pytest.mark.parametrize("linear_stiffness", [30.0, np.inf])
@pytest.mark.parametrize(("n", "coupling"), [(2, 0.0), (3, 5.0)])
def test_energy_and_derivatives_are_those_of_the_model(
    linear_stiffness: float, n: int, coupling: float
) -> None:
    finger = graded_finger(n, linear_stiffness)
    random = np.random.default_rng(7)
    with mpmath.workdps(60):
        units = extended_units(finger)
        bars = (RigidBars if finger.is_rigid else ElasticBars)(units, mpmath.mpf(coupling))
        bent = RigidBars(units).nodes([mpmath.mpf(v) for v in random.uniform(-0.2, 0.5, 2 * n)])
        if not finger.is_rigid:
            off = random.random(4 * n)
            bent = [value + mpmath.mpf(v) for value, v in zip(bent, off, strict=True)]
        here = bars.unknowns(bent)
        size, h = len(here), mpmath.mpf("1e-12")

        def energy(*changes: tuple[int, int]) -> mpmath.mpf:
            step = [h * sum(sign for row, sign in changes if row == k) for k in range(size)]
            return energy_in_complex_numbers(units, bars.nodes(bars.moved(here, step)), coupling)

        expansion = bars.at(here)
        assert abs(expansion.energy - energy()) < 1e-50
        for i in range(size):
            slope = (energy((i, 1)) - energy((i, -1))) / (2 * h)
            assert abs(expansion.gradient[i] - slope) < 1e-18
            for j in range(i + 1):
                bend = sum(p * q * energy((i, p), (j, q)) for p, q in product((1, -1), repeat=2))
                entry = expansion.band[i][i - j] if i - j < len(expansion.band[i]) else 0
                assert abs(entry - bend / (4 * h * h)) < 1e-17, (i, j)


@pytest.mark.parametrize("linear_stiffness", [1e3, np.inf])
def test_agrees_with_the_solver(linear_stiffness: float) -> None:
    finger = graded_finger(3, linear_stiffness)
    inverted = units_of("010", "110", "111")
    states = extended_states(finger, inverted)
    batch = settle(UnitSolutions.of(finger), chain_potential, inverted, 1e-12)
    at_tip = tip(batch, with_compliance=False)
    assert np.abs(states.pose[:2] - at_tip.pose[:2]).max() < 1e-12
    assert np.abs(states.pose[2] - at_tip.pose[2]).max() < 1e-13
    openings = batch.potential.coordinates.openings(batch.equilibrium.coordinates)
    assert np.abs(states.openings - openings).max() < 1e-13
    assert states.min_eigenvalue == pytest.approx(min_eigenvalues(batch), rel=1e-9)


@pytest.mark.parametrize("linear_stiffness", [100.0, 1e30, np.inf])
def test_both_starts_lead_to_the_same_state(linear_stiffness: float) -> None:
    finger, inverted = graded_finger(3, linear_stiffness), units_of("101", "011")
    nodes = solver_nodes(finger, inverted)
    nodes += np.random.default_rng(3).normal(0.0, 1e-6, nodes.shape)
    assert_same(
        extended_states(finger, inverted), extended_states(finger, inverted, nodes), LONG_DOUBLE
    )


@pytest.mark.parametrize("linear_stiffness", [100.0, 1e8, np.inf])
@pytest.mark.parametrize("strokes", [0.65, 2.0])
def test_a_far_start_leads_to_the_same_state(linear_stiffness: float, strokes: float) -> None:
    finger, inverted = finger_of(3, linear_stiffness), units_of("101")
    units = extended_units(finger)
    angles = np.repeat(np.arcsin(strokes * 3.5 / 21.5) * inverted[:, 0], 2)
    nodes = np.array([RigidBars(units).nodes([mpmath.mpf(v) for v in angles])], float).T
    assert_same(
        extended_states(finger, inverted), extended_states(finger, inverted, nodes), LONG_DOUBLE
    )


@pytest.mark.parametrize(("pattern", "stroke"), [("101", 28.0), ("11011", 28.661)])
def test_long_strokes_of_soft_bars_are_not_jumped_over(pattern: str, stroke: float) -> None:
    finger = finger_of(len(pattern), 3.0, stroke=stroke)
    states = extended_states(finger, units_of(pattern))
    assert states.is_minimum.all()
    sides = states.openings[:, 0] > 0.7 * stroke
    assert sides.tolist() == [digit == "1" for digit in pattern], "four units make a ring"


def test_stiff_bars_approach_rigid_ones() -> None:
    inverted = units_of("11", "10")
    rigid = extended_states(graded_finger(2, np.inf), inverted)
    stiff = extended_states(graded_finger(2, 1e30), inverted)
    assert_same(rigid, stiff, LONG_DOUBLE)
    assert stiff.min_eigenvalue == pytest.approx(rigid.min_eigenvalue, rel=1e-12)
    assert (stiff.condition > 1e30).all()


def test_condition_and_smallest_eigenvalue_of_a_single_unit() -> None:
    finger = finger_of(1)
    (unit,) = extended_units(finger)
    with mpmath.workdps(40):
        bars, h = RigidBars([unit]), mpmath.mpf("1e-12")
        angles = [inverted_angle(unit)] * 2
        (corner,), (_, mixed) = (map(float, row) for row in bars.at(angles).band)
        steps = ([0, 0], [h, 0], [0, h])
        rest, *moved = np.array([bars.nodes(bars.moved(angles, step)) for step in steps])
        rates = np.array([(nodes - rest) / h for nodes in moved], float)
    compliance = np.linalg.inv([[corner, mixed], [mixed, corner]])
    states = extended_states(finger, units_of("1"))
    assert states.condition[0] == pytest.approx((corner + mixed) / (corner - mixed), rel=1e-12)
    softest = np.linalg.eigvalsh(rates.T @ compliance @ rates)[-1]
    assert states.min_eigenvalue[0] == pytest.approx(1.0 / softest, rel=1e-9)


@pytest.mark.parametrize("linear_stiffness", [1e4, np.inf])
def test_an_impossible_pattern_is_no_state_of_its_own(linear_stiffness: float) -> None:
    finger = finger_of(2, linear_stiffness, force_linearity=1.0)
    states = extended_states(finger, units_of("00", "10"))
    assert (states.is_minimum & states.in_pattern).tolist() == [True, False]


@pytest.mark.parametrize(("margin", "exists"), [(1e-12, True), (-1e-12, False)])
def test_the_loss_of_bistability(margin: float, exists: bool) -> None:
    states = extended_states(finger_of(1, force_linearity=FOLD - margin), units_of("1"))
    assert (states.is_minimum & states.in_pattern).tolist() == [exists]


def test_a_mechanism_is_no_minimum() -> None:
    states = extended_states(finger_of(2, 1e4, hinge_stiffness=0.0), units_of("10"))
    assert states.in_pattern.all() and not states.is_minimum.any()
    assert np.isnan(states.min_eigenvalue).all() and np.isnan(states.condition).all()


def test_another_patterns_state_is_not_in_the_pattern() -> None:
    finger = finger_of(2, 1e4)
    nodes = solver_nodes(finger, units_of("01"))
    states = extended_states(finger, units_of("10"), nodes)
    assert states.is_minimum.all() and not states.in_pattern.any()
    assert (states.openings[:, 0] > 2.0).tolist() == [False, True]


@pytest.mark.parametrize("linear_stiffness", [1e4, np.inf])
def test_a_folded_state_is_not_in_the_pattern(linear_stiffness: float) -> None:
    finger = finger_of(1, linear_stiffness, hinge_stiffness=1e-3)
    units = extended_units(finger)
    folded = RigidBars(units).nodes([np.pi - inverted_angle(units[0])] * 2)
    states = extended_states(finger, units_of("1"), np.array([folded], float).T)
    assert states.is_minimum.all() and states.openings[0, 0] > 3.0
    assert not states.in_pattern.any()


def test_a_start_that_leads_nowhere_spoils_its_own_state_only() -> None:
    finger, inverted = finger_of(2, 1e4), units_of("10", "10", "10")
    nodes = solver_nodes(finger, inverted)
    nodes[3, 0], nodes[:, 1] = np.nan, 0.0
    states = extended_states(finger, inverted, nodes)
    assert states.is_minimum.tolist() == states.in_pattern.tolist() == [False, False, True]
    for values in (states.pose, states.openings, states.energy[None], states.condition[None]):
        assert np.isnan(values).all(axis=0).tolist() == [True, True, False]


@pytest.mark.parametrize(("n_units", "linear_stiffness"), [(12, 1e6), (64, np.inf)])
def test_tip_angle_counts_full_turns(n_units: int, linear_stiffness: float) -> None:
    single = extended_states(finger_of(1), units_of("1")).pose[2, 0]
    states = extended_states(finger_of(n_units, linear_stiffness), units_of("1" * n_units))
    assert states.is_minimum.all()
    assert states.in_pattern.tolist() == [n_units == 12], "64 units meet themselves"
    assert float(states.pose[2, 0]) == pytest.approx(n_units * float(single), rel=1e-4)


@pytest.mark.parametrize("linear_stiffness", [1e4, np.inf])
def test_the_unit_of_length_does_not_matter(linear_stiffness: float) -> None:
    finger, inverted, scale = graded_finger(2, linear_stiffness), units_of("11", "01"), 2.0**10
    powers = dict(zip(ARRAYS, (-1, -1, -1, 1, 0, -1, 1, -1, -1, -1), strict=True))
    scaled = {name: values * scale ** powers[name] for name, values in finger.arrays().items()}
    one, other = extended_states(finger, inverted), extended_states(Finger(2, **scaled), inverted)
    rows = np.array([[scale], [scale], [1.0]])
    pose, energy, openings = other.pose * rows, other.energy * scale, other.openings * scale
    restored = ExtendedStates(
        pose, energy, openings, other.min_eigenvalue, other.condition,
        other.is_minimum, other.in_pattern,
    )  # fmt: skip
    assert_same(one, restored, LONG_DOUBLE)
    assert other.min_eigenvalue / scale == pytest.approx(one.min_eigenvalue, rel=1e-12)


def test_wrong_shapes_are_refused() -> None:
    finger = finger_of(2)
    with pytest.raises(ValueError, match="2 designs"):
        two = replace(finger, stroke=np.array([[3.5, 3.6]]))
        extended_states(two, units_of("10"))
    with pytest.raises(ValueError, match="inverted has shape"):
        extended_states(finger, units_of("101"))
    with pytest.raises(ValueError, match="nodes has shape"):
        extended_states(finger, units_of("10"), np.zeros((8, 2)))


@pytest.mark.parametrize("module", [equilibria, *OWN])
def test_shares_no_code_with_the_solver(module: ModuleType) -> None:
    tree = ast.parse(Path(module.__file__ or "").read_text(encoding="utf-8"))
    modules = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    used = {name for name in modules if name and name.startswith("dpgcli")}
    others = {each.__name__ for each in OWN}
    assert used - others <= {"dpgcli.arrays", "dpgcli.mechanics.finger", "dpgcli.records"}
