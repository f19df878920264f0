"""Each check of the certificate alone: what it refuses, and nothing else is wrong."""

from collections.abc import Callable
from dataclasses import fields, replace

import numpy as np
import pytest

from dpgcli.arrays import Flags
from dpgcli.benchmark.network import SpringNetwork
from dpgcli.equilibrium.newton import minimize
from dpgcli.mechanics.curve import spline
from dpgcli.mechanics.finger import Finger, uniform_finger
from dpgcli.mechanics.laws import PUBLISHED, PushOnly, Tabulated
from dpgcli.mechanics.terms import Formulate, chain_potential, lattice_potential
from dpgcli.states.certify import Settled, Status, certified, certify
from dpgcli.states.guess import geometric_guess
from dpgcli.states.pairs.compose import _Block, _fit, paired_states
from dpgcli.states.pairs.halves import Half, Split
from dpgcli.states.settle import settle, settle_from
from dpgcli.states.tip import tip
from dpgcli.states.units import UnitSolutions
from dpgcli.states.wells import inverted_wells

Fingers = Callable[..., Finger]
Patterns = Callable[[int], Flags]


@pytest.fixture
def stable(reference_finger: Fingers) -> tuple[Settled, UnitSolutions]:
    units = UnitSolutions.of(reference_finger(3, 1e4))
    batch = settle(units, chain_potential, np.array([[True], [False], [True]]), 1e-12)
    assert certify(batch, units, 1e-12).tolist() == [Status.STABLE]
    return batch, units


def status_with(stable: tuple[Settled, UnitSolutions], **changes: object) -> Status:
    """The status if some numbers of the equilibrium were others."""
    batch, units = stable
    equilibrium = replace(batch.equilibrium, **changes)  # type: ignore[arg-type]
    changed = certified(units, batch.potential, batch.inverted, equilibrium, 1e-12)
    return Status(changed.status[0])


@pytest.mark.parametrize("residual", [np.nan, np.inf, 1.1e-12])
def test_a_residual_above_the_tolerance_or_none_at_all(
    stable: tuple[Settled, UnitSolutions], residual: float
) -> None:
    relative = np.array([residual])
    assert status_with(stable, relative_residual=relative) is Status.NOT_CONVERGED


@pytest.mark.parametrize("curvature", [np.nan, -1.0, 0.0, 1.4e-8])
def test_a_curvature_that_is_not_safely_positive(
    stable: tuple[Settled, UnitSolutions], curvature: float
) -> None:
    assert status_with(stable, curvature=np.array([curvature])) is Status.MARGINAL


def test_the_gravest_reason_is_given(stable: tuple[Settled, UnitSolutions]) -> None:
    batch, units = stable
    folded = replace(batch, is_folded=np.ones(1, bool))
    assert certify(folded, units, 1e-12).tolist() == [Status.FOLDED]
    astray = replace(folded, equilibrium=replace(batch.equilibrium, relative_residual=np.ones(1)))
    assert certify(astray, units, 1e-12).tolist() == [Status.NOT_CONVERGED]
    elsewhere = replace(folded, inverted=~batch.inverted)
    assert certify(elsewhere, units, 1e-12).tolist() == [Status.FOLDED]
    elsewhere = replace(elsewhere, is_folded=np.zeros(1, bool))
    assert certify(elsewhere, units, 1e-12).tolist() == [Status.ANOTHER_PATTERN]


@pytest.mark.parametrize(("share", "status"), [(0.09, "STABLE"), (0.11, "NOT_CONVERGED")])
def test_an_unbalance_that_a_weak_well_would_not_bear(
    stable: tuple[Settled, UnitSolutions], share: float, status: str
) -> None:
    """A moment of 1e-6 N times H is small against the forces in play, not against that well."""
    batch, units = stable
    gradient = batch.equilibrium.gradient.copy()
    gradient[1] = 1e-6 * 10.75
    weak = np.array([[1e-6 / share], [2.05], [2.05]])
    units = replace(units, wells=replace(units.wells, reset_force=weak))
    assert status_with((batch, units), gradient=gradient) is Status[status]


@pytest.mark.parametrize(("part", "status"), [(0.9, "STABLE"), (1.1, "NOT_CONVERGED")])
def test_an_unbalance_that_a_fold_so_near_would_not_bear(
    stable: tuple[Settled, UnitSolutions], part: float, status: str
) -> None:
    """Curvature 1e-3: a tenth of κ²/96 of (k_b + k_θ/H²) d, which is 45.67 N."""
    gradient = stable[0].equilibrium.gradient.copy()
    gradient[6] = part * 0.1 * 1e-6 / 96.0 * 45.6729 * 10.75
    curvature = np.array([1e-3])
    assert status_with(stable, gradient=gradient, curvature=curvature) is Status[status]


def test_a_faint_hinge_is_no_fold(stable: tuple[Settled, UnitSolutions]) -> None:
    """Rounding is allowed whatever the curvature."""
    gradient = stable[0].equilibrium.gradient.copy()
    gradient[2] = 0.9e-14 * 45.6729 * 10.75
    assert status_with(stable, gradient=gradient, curvature=np.array([1e-7])) is Status.STABLE


def test_forces_of_a_single_unit_by_the_reference(reference_finger: Fingers) -> None:
    """4.72618 N to snap, 2.054675 N to reset: on the opening, hinge included."""
    wells = inverted_wells(reference_finger(1))
    assert wells.snap_force[0, 0] == pytest.approx(4.72618, abs=5e-6)
    assert wells.reset_force[0, 0] == pytest.approx(2.054675, abs=5e-7)


def test_a_unit_without_a_second_well_lacks_a_force(reference_finger: Fingers) -> None:
    """Where α passes its limit the force to reset passes zero, to first order in between."""
    limit = 0.0964682337467354
    below, above = (
        inverted_wells(reference_finger(1, force_linearity=limit + by)).reset_force[0, 0]
        for by in (-1e-7, 1e-7)
    )
    assert below > 0.0 > above
    assert -above == pytest.approx(below, rel=1e-3)
    # dF/dα at the fold: k_b x (1 − β-part): k_b d u [1 − (1−u)(1−2u)] with u ≈ 0.75
    assert below == pytest.approx(1e-7 * 12.84 * 3.5 * 0.75 * 1.125, rel=0.02)


STIFF = {
    "segment_length": 11.0,
    "segment_height": 20.0,
    "stroke": 1.4,
    "bistable_stiffness": 6.0,
    "force_linearity": 0.02,
    "hinge_stiffness": 300.0,
}


@pytest.mark.parametrize("ratio", [1e13, 1e14, 1e15 / 6.0])
def test_between_very_stiff_bars_no_state_is_certified_that_is_none(ratio: float) -> None:
    """What rounding leaves of the bars' forces exceeds all that the dome can do."""
    units = UnitSolutions.of(uniform_finger(1, **STIFF, linear_stiffness=6.0 * ratio))
    inverted = np.ones((1, 1), bool)
    chain = settle(units, chain_potential, inverted, 1e-12)
    assert certify(chain, units, 1e-12).tolist() == [Status.NOT_BISTABLE]
    lattice = settle(units, lattice_potential, inverted, 1e-12)
    assert certify(lattice, units, 1e-12)[0] != Status.STABLE
    assert not lattice.is_balanced[0] or not lattice.reached[0, 0]


def test_a_strut_pulled_through_its_base_is_folded() -> None:
    """The chain has a minimum with a strut of −2.5 mm; what soft bars really do is found next."""
    finger = uniform_finger(
        2,
        segment_length=1.0,
        segment_height=10.0,
        stroke=15.0,
        bistable_stiffness=10.0,
        force_linearity=0.05,
        hinge_stiffness=100.0,
        linear_stiffness=0.2,
    )
    units, chain, inverted = (
        UnitSolutions.of(finger),
        chain_potential(finger),
        np.ones((2, 1), bool),
    )
    guess = chain.coordinates.of_shape(geometric_guess(finger, inverted, units.first_order))
    astray = settle_from(units, chain, inverted, guess, 1e-12)
    assert 10.0 + astray.equilibrium.coordinates[3, 0] == pytest.approx(-2.4958, abs=1e-4)
    assert astray.equilibrium.relative_residual[0] < 1e-12
    assert certify(astray, units, 1e-12).tolist() == [Status.FOLDED]
    found = settle(units, chain_potential, inverted, 1e-12)
    assert certify(found, units, 1e-12).tolist() == [Status.STABLE]
    nodes = np.stack(
        found.potential.coordinates.stations(found.equilibrium.coordinates), axis=1
    ).ravel()
    network = SpringNetwork.of(finger)
    assert np.abs(network.energy_and_gradient(nodes)[1]).max() < 1e-10
    assert np.linalg.eigvalsh(network.hessian(nodes))[0] > 1e-3


def half_with(half: Half, **joint: float) -> Half:
    assert half.joint is not None
    changed = {name: np.full_like(half.joint.stiffness, value) for name, value in joint.items()}
    return replace(half, joint=replace(half.joint, **changed))


class OfHalves(Split):
    """A split whose halves are given."""

    def inner(self) -> Half:
        return half_with(super().inner(), stiffness=-3e7)


def test_a_pair_that_is_not_convex_is_marginal(reference_finger: Fingers) -> None:
    """Both halves are minima with their strut held; what is negative is their sum at the strut."""
    own = Split(UnitSolutions.of(reference_finger(4, 1e7)), 2, 1, 1e-12)
    (states,) = paired_states(own)
    fits = states.status == Status.STABLE
    assert fits.sum() == 12
    (states,) = paired_states(OfHalves(own.units, 2, 1, 1e-12))
    assert (states.status[fits] == Status.MARGINAL).all()


@pytest.mark.parametrize("pull", [3.0, -3.0])
def test_the_shared_strut_feels_both_halves_and_their_disagreement(
    reference_finger: Fingers, pull: float
) -> None:
    """Force at the strut: pulls of both, and of the held outer half per mm times the gap."""
    split = Split(UnitSolutions.of(reference_finger(4, 1e4)), 2, 1, 1e-12)
    inner, outer = split.inner(), split.outer()
    assert inner.joint is not None
    assert outer.joint is not None
    assert outer.clamped is not None
    gap = 1e-3
    inner = half_with(inner, extension=gap, force=2.0)
    outer = half_with(outer, extension=0.0, force=1.0)
    nothing = np.zeros_like(outer.clamped.cell_stiffness)
    per_mm = np.full_like(outer.clamped.strut_stiffness, 1e3 * pull)
    clamped = replace(outer.clamped, strut_stiffness=per_mm, cell_stiffness=nothing)
    block = _Block(np.arange(4), 2, 1)
    fit = _fit(split, inner, replace(outer, clamped=clamped), block)
    assert fit.residual == pytest.approx(abs(2.0 + 1.0 + pull), abs=1e-9)


def test_units_of_halves_are_those_of_the_whole(
    reference_finger: Fingers, all_patterns: Patterns
) -> None:
    """The last unit's forces make all bars soft; the half that does not hold it knows so, too."""
    strong = np.array([1.0, 1.0, 1.0, 1.0, 1.0, 300.0])[:, None]
    finger = reference_finger(6, 1e3).changed(
        bistable_stiffness=12.84 * strong,
        hinge_stiffness=24.2 * strong,
        force_linearity=np.array([0.043, 0.105, 0.043, 0.043, 0.043, 0.043])[:, None],
    )
    split = Split(UnitSolutions.of(finger), 3, 2, 1e-12)
    (pairs,) = paired_states(split)
    direct = certify(
        settle(split.units, chain_potential, all_patterns(6), 1e-12), split.units, 1e-12
    )
    fits = pairs.status != Status.NOT_CONVERGED
    assert (direct[fits] == Status.ANOTHER_PATTERN).sum() > 16
    assert (pairs.status[fits] == direct[fits]).all()


def test_a_walk_near_a_fold_goes_on_to_where_rounding_ends_it(reference_finger: Fingers) -> None:
    """There, a tolerance of 1e-3 would let a unit stop that has nowhere to rest."""
    finger = reference_finger(1, force_linearity=0.0964682337467354 + 1e-5)
    units, chain = UnitSolutions.of(finger), chain_potential(finger)
    start = np.full((2, 1), np.arcsin(0.765 * 3.5 / 21.5))
    assert np.abs(chain.coordinates.corner_moments(start, start * 0.0)).max() == 0.0
    batch = settle_from(units, chain, np.ones((1, 1), bool), start, 1e-3)
    assert certify(batch, units, 1e-3)[0] != Status.STABLE


def test_soft_bars_do_not_prove_that_there_is_no_well(reference_finger: Fingers) -> None:
    """A unit between rigid bars has none; between soft ones that is not said, and it may rest."""
    soft = UnitSolutions.of(reference_finger(1, 0.5, force_linearity=0.1))
    assert not soft.wells.exists.any()
    assert soft.are_soft.all()
    assert not soft.have_no_well.any()
    stiff = UnitSolutions.of(reference_finger(1, 1e4, force_linearity=0.1))
    assert stiff.have_no_well.all()
    never = UnitSolutions.of(reference_finger(1, 0.5, force_linearity=0.112))
    assert never.have_no_well.all(), "the dome itself turns over nowhere"


def test_a_unit_in_its_well_is_there_whatever_rigid_bars_say(
    stable: tuple[Settled, UnitSolutions],
) -> None:
    """Beyond a rigid fold, elastic bars may still leave a well: who rests in it is bistable."""
    batch, units = stable
    none = replace(units.wells, exists=np.zeros((1, 1), bool))
    assert certify(batch, replace(units, wells=none), 1e-12).tolist() == [Status.STABLE]


@pytest.mark.parametrize("past", [-1e-12, 1e-12])
def test_at_a_rigid_fold_the_walk_goes_on_until_the_elastic_well_is_sure(
    reference_finger: Fingers, past: float
) -> None:
    """What rigid bars lack is 1e-13 of the forces in play; a residual of 1e-12 would not do."""
    linearity = 0.0964682337467354 * (1.0 + past)
    finger = reference_finger(1, 12.84e9, force_linearity=linearity)
    units, inverted = UnitSolutions.of(finger), np.ones((1, 1), bool)
    batch = settle(units, chain_potential, inverted, 1e-12)
    assert certify(batch, units, 1e-12).tolist() == [Status.STABLE]
    potential = chain_potential(finger)
    far = minimize(potential, batch.equilibrium.coordinates * 1.0001, 1e-12)
    assert not certified(units, potential, inverted, far, 1e-12).is_balanced[0]


@pytest.mark.parametrize("formulation", [chain_potential, lattice_potential])
def test_near_a_right_angle_moments_count_by_their_lever(
    formulation: Formulate,
) -> None:
    """A corner near 90° hardly extends the spring: the lattice's last digits are forces there."""
    finger = uniform_finger(
        1,
        segment_length=14.0,
        segment_height=10.0,
        stroke=30.9,
        bistable_stiffness=10.0,
        force_linearity=0.0940983,
        hinge_stiffness=2.928e-5,
        linear_stiffness=4.33e14,
    )
    units = UnitSolutions.of(finger)
    batch = settle(units, formulation, np.ones((1, 1), bool), 1e-12)
    assert certify(batch, units, 1e-12)[0] != Status.STABLE


@pytest.mark.parametrize(("ratio", "past"), [(10.0, 1e-4), (1e3, 1e-6), (1e6, 1e-10)])
def test_a_dome_that_only_pushes_keeps_the_state_that_elastic_bars_leave_it(
    reference_finger: Fingers, ratio: float, past: float
) -> None:
    """Beyond the rigid fold; the search begins where the dome is in touch."""
    linearity = 0.0964682337467354 * (1.0 + past)
    both = reference_finger(3, 12.84 * ratio, force_linearity=linearity)
    pushing = UnitSolutions.of(replace(both, law=PushOnly(PUBLISHED)))
    inverted = np.array([[True], [False], [True]])
    batches = [
        settle(units, chain_potential, inverted, 1e-12)
        for units in (UnitSolutions.of(both), pushing)
    ]
    tips = [tip(batch, with_compliance=False).pose[:, 0] for batch in batches]
    assert certify(batches[1], pushing, 1e-12).tolist() == [Status.STABLE]
    assert tips[1] == pytest.approx(tips[0], abs=1e-7)


def test_a_dome_beyond_the_lever_leaves_the_ground_state(reference_finger: Fingers) -> None:
    """Rigid bars never bring the neighbor in touch: there is no well, and nothing is NaN."""
    travel = np.linspace(0.0, 1.5, 301)
    energy = 0.5 * travel**2 * (0.043 + 0.957 * (1.0 - travel) ** 2)
    law = PushOnly(Tabulated(spline(tuple(travel), tuple(energy))))
    units = UnitSolutions.of(replace(reference_finger(3, 1e4, stroke=43.0), law=law))
    assert not units.wells.exists.any()
    assert np.isfinite(units.wells.angle).all()
    inverted = np.array([[False, True], [False, False], [False, False]])
    batch = settle(units, chain_potential, inverted, 1e-12)
    assert certify(batch, units, 1e-12)[0] == Status.STABLE


def test_a_dome_without_a_second_well_is_never_inverted(reference_finger: Fingers) -> None:
    travel = np.linspace(0.0, 0.8, 30)  # the curve ends before its well
    energy = 0.5 * travel**2 * (0.043 + 0.957 * (1.0 - travel) ** 2)
    law = Tabulated(spline(tuple(travel), tuple(energy)))
    units = UnitSolutions.of(replace(reference_finger(1, 1e4), law=law))
    batch = settle(units, chain_potential, np.ones((1, 1), bool), 1e-12)
    assert certify(batch, units, 1e-12).tolist() == [Status.NOT_BISTABLE]


def test_soft_units_meet_wherever_a_curve_has_its_well(reference_finger: Fingers) -> None:
    """A well at 1.8 strokes opens three units to a ring: alone as in a batch."""
    travel = np.linspace(0.0, 2.7, 40)
    energy = 0.5 * travel**2 * (1.0 + 0.985 * ((travel / 1.8) ** 2 - travel / 0.9))
    finger = uniform_finger(
        3,
        segment_length=10.0,
        segment_height=17.0,
        stroke=19.0,
        bistable_stiffness=7.0,
        force_linearity=0.015,
        hinge_stiffness=4.0,
        linear_stiffness=7.0,
    )
    units = UnitSolutions.of(replace(finger, law=Tabulated(spline(tuple(travel), tuple(energy)))))
    batch = settle(units, chain_potential, np.ones((3, 1), bool), 1e-12)
    assert certify(batch, units, 1e-12).tolist() == [Status.FOLDED]


def test_wells_are_the_same_alone_and_in_a_batch() -> None:
    random = np.random.default_rng(0)
    shape = (1, 200)
    finger = Finger(
        1,
        segment_length=random.uniform(5.0, 20.0, shape),
        segment_height=random.uniform(5.0, 20.0, shape),
        stroke=10.0 ** random.uniform(-2.0, 1.0, shape),
        bistable_stiffness=10.0 ** random.uniform(-1.0, 2.0, shape),
        force_linearity=random.uniform(0.0, 0.1, shape),
        hinge_stiffness=10.0 ** random.uniform(-2.0, 2.0, shape),
        linear_stiffness=np.full(shape, 1e5),
    )
    together = inverted_wells(finger)
    for design in range(200):
        alone = inverted_wells(finger.take_lanes(np.array([design])))
        for field in fields(alone):
            assert getattr(alone, field.name)[0, 0] == getattr(together, field.name)[0, design]
