"""Walls that give way: against extended precision and SciPy, in their limits; their cost."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq, minimize

from dpgcli.arrays import Array, Flags
from dpgcli.mechanics.finger import STUDY, Finger, uniform_finger
from dpgcli.mechanics.laws import PUBLISHED, DomeLaw, PushOnly, bistable
from dpgcli.mechanics.terms import Formulate, chain_potential, lattice_potential
from dpgcli.reference.equilibria import extended_states
from dpgcli.reference.units import extended_units, inverted_rest
from dpgcli.states.certify import Settled, Status
from dpgcli.states.rigid_unit import tangent_of
from dpgcli.states.settle import settle
from dpgcli.states.tip import tip
from dpgcli.states.units import UnitSolutions
from dpgcli.states.wells import barriers, inverted_wells

FORMULATIONS = [
    pytest.param(chain_potential, np.inf, id="rigid"),
    pytest.param(chain_potential, 1e4, id="chain"),
    pytest.param(lattice_potential, 1e4, id="lattice"),
    pytest.param(chain_potential, 50.0, id="soft chain"),
]
COMPLIANCES = [1e-6, 1e-2, 0.7, 30.0, 1e6 / 12.84]  # mm/N; the last is a million times 1/k_b


def finger_with(n_units: int, *compliance: float, bars: float = np.inf) -> Finger:
    finger = uniform_finger(n_units, **STUDY, linear_stiffness=bars)
    return finger.changed(wall_compliance=np.array(compliance)[:, None])


def settled(finger: Finger, patterns: Flags, formulate: Formulate = chain_potential) -> Settled:
    return settle(UnitSolutions.of(finger), formulate, patterns, 1e-12)


@pytest.mark.parametrize(("formulate", "bars"), FORMULATIONS)
@pytest.mark.parametrize(
    "compliance",
    [
        (0.0, 0.7),
        *COMPLIANCES[::2],
        *(pytest.param(c, marks=pytest.mark.slow) for c in COMPLIANCES[1::2]),
    ],
    ids=str,
)
def test_states_are_those_of_extended_precision(
    formulate: Formulate,
    bars: float,
    compliance: float | tuple[float, ...],
    all_patterns: Callable[[int], Flags],
) -> None:
    values = compliance if isinstance(compliance, tuple) else (compliance,)
    finger, patterns = finger_with(2, *values, bars=bars), all_patterns(2)
    found, exact = settled(finger, patterns, formulate), extended_states(finger, patterns)
    assert (exact.is_minimum & exact.in_pattern).all()
    assert (found.status == Status.STABLE).all()
    at = tip(found, with_compliance=False)
    error = np.hypot(*(at.pose[:2] - exact.pose[:2].astype(float)))
    assert (error <= at.error).all()
    assert at.error.max() < 1e-10
    energy = sum(found.equilibrium.energies.values())
    assert energy == pytest.approx(exact.energy.astype(float), rel=1e-11, abs=1e-11)


def test_rigid_walls_are_reached_at_first_order(all_patterns: Callable[[int], Flags]) -> None:
    patterns = all_patterns(3)
    rigid = tip(settled(finger_with(3, 0.0), patterns), with_compliance=False).pose
    off = [
        np.abs(tip(settled(finger_with(3, c), patterns), with_compliance=False).pose - rigid).max()
        for c in (1e-4, 1e-5)
    ]
    assert off[0] / off[1] == pytest.approx(10.0, rel=2e-2)


def test_walls_without_stiffness_leave_every_unit_flat(
    all_patterns: Callable[[int], Flags],
) -> None:
    found = settled(finger_with(3, 1e6 / 12.84), all_patterns(3))
    assert (found.status == Status.STABLE).all()
    openings = found.potential.coordinates.openings(found.equilibrium.coordinates)
    domes = found.potential.coordinates.springs(found.equilibrium.coordinates).extension
    own = float(PUBLISHED.rests(found.finger.domes).well[0, 0])  # of a dome that nothing holds
    assert domes[found.inverted] == pytest.approx(own, rel=1e-5)
    hinge = STUDY["hinge_stiffness"] / STUDY["segment_height"] ** 2  # in series with the wall
    assert openings[found.inverted] == pytest.approx(own / (1e6 / 12.84 * hinge), rel=1e-4)


@pytest.mark.parametrize("compliance", [0.05, 0.7, 5.0])
def test_a_unit_is_the_minimum_that_scipy_finds(compliance: float) -> None:
    """Over the opening's angle and the wall's w, with nothing of the package but the law."""
    height, hinge = STUDY["segment_height"], STUDY["hinge_stiffness"]

    def energy(at: Array) -> float:
        turn, wall = at
        x = 2.0 * height * np.sin(turn / 2.0) + wall
        values = (STUDY["bistable_stiffness"], STUDY["force_linearity"], STUDY["stroke"])
        dome = bistable(np.array(x), *map(np.array, values)).energy
        return float(dome + 0.5 * hinge * turn**2 + 0.5 * wall**2 / compliance)

    found = settled(finger_with(1, compliance), np.array([[True]]))
    best = minimize(energy, [0.2, 0.5], method="Nelder-Mead", options={"xatol": 1e-9, "fatol": 0})
    turn, wall = best.x
    coordinates = found.potential.coordinates
    at = found.equilibrium.coordinates
    assert -tip(found, with_compliance=False).pose[2, 0] == pytest.approx(turn, rel=1e-6)
    opening = coordinates.springs(at).extension - coordinates.openings(at)
    assert opening[0, 0] == pytest.approx(wall, rel=1e-6)
    assert found.equilibrium.energies["wall"][0] == pytest.approx(
        wall**2 / 2 / compliance, rel=1e-6
    )


@pytest.mark.parametrize("law", [PUBLISHED, PushOnly(PUBLISHED)])
def test_an_inverted_unit_softens_as_wall_and_dome_in_series(law: object) -> None:
    """Two corners that open alike see K/(1 + c_w K): from a finger whose walls are rigid."""
    finger = finger_with(1, 0.7)
    finger = Finger(**{**vars(finger), "law": law})
    found = settled(finger, np.array([[True]]))
    coordinates = found.potential.coordinates
    extension = coordinates.springs(found.equilibrium.coordinates).extension
    dome = float(finger.springs(extension).stiffness[0, 0])
    push = float(finger.springs(extension).force[0, 0])
    series = dome / (1.0 + 0.7 * dome)
    m = -float(tip(found, with_compliance=False).pose[2, 0]) / 2.0
    lever, bend = 10.75 * np.cos(m), -10.75 / 2.0 * np.sin(m)
    stiffness = STUDY["hinge_stiffness"] + series * lever**2 + push * bend
    compliance = tip(found, with_compliance=True).compliance
    assert compliance is not None
    assert 1.0 / compliance[5, 0] == pytest.approx(stiffness, rel=1e-9)


def test_barriers_are_those_of_the_path_over_dome_and_wall() -> None:
    finger = finger_with(1, 0.7)
    wells = inverted_wells(finger)
    y = np.linspace(0.0, 4.0, 40001)[None]
    x = np.linspace(0.0, 4.0, 4001)[:, None]
    hinge = 2.0 * np.arcsin(x / 21.5)
    support = np.array([np.min(0.5 * 24.2 * hinge**2 + (v - x) ** 2 / 1.4) for v in y[0, ::400]])
    dome = finger.springs(y[:, ::400]).energy[0]
    energy = dome + support
    top = energy[: len(energy) * 7 // 10].max()
    well = energy[len(energy) * 7 // 10 :].min()
    assert barriers(finger, wells)[0] == pytest.approx(min(top, top - well), rel=2e-3)


def test_a_finger_with_rigid_walls_has_no_unknown_of_them() -> None:
    for bars, formulate in (
        (np.inf, chain_potential),
        (1e4, chain_potential),
        (1e4, lattice_potential),
    ):
        without, walls = (formulate(finger_with(3, c, bars=bars)) for c in (0.0, 0.5))
        assert walls.coordinates.size == without.coordinates.size + 3
        assert "wall" not in without.kinds
        assert "wall" in walls.kinds


@pytest.mark.parametrize("stroke", [3.5, 24.0, 30.0])  # the last beyond what bars can open, 2H
@pytest.mark.parametrize("compliance", [1e-4, 0.1, 3.0, 100.0])
def test_the_opening_behind_a_wall_is_the_root(stroke: float, compliance: float) -> None:
    """By bisection, also where bars nearly end the opening."""
    finger = uniform_finger(1, **{**STUDY, "hinge_stiffness": 300.0, "stroke": stroke})
    finger = finger.changed(wall_compliance=np.array([[compliance]]))
    extension = np.array([[-0.5], [1e-3], [0.7], [1.3]]) * stroke
    opening = 21.5 * np.sin(np.arctan(tangent_of(finger, extension.reshape(1, -1)).ravel()))
    for y, x in zip(extension.ravel(), opening, strict=True):

        def excess(m: float, y: float = float(abs(y))) -> float:
            return (y - 21.5 * np.sin(m)) * np.cos(m) - 600.0 * compliance / 10.75 * m

        m = brentq(excess, 0.0, np.pi / 2.0, xtol=1e-300, rtol=1e-14)
        assert x == pytest.approx(np.copysign(21.5 * np.sin(m), y), rel=1e-11)


def test_the_barrier_of_a_dome_that_opens_beyond_its_bars() -> None:
    """By a scan of the dome's extension, wall and hinge in series."""
    finger = uniform_finger(
        1, **{**STUDY, "stroke": 24.0, "force_linearity": 0.02, "hinge_stiffness": 300.0}
    ).changed(wall_compliance=np.array([[3.0]]))
    assert barriers(finger, inverted_wells(finger))[0] == pytest.approx(118.364, abs=1e-3)


@pytest.mark.parametrize("law", [PUBLISHED, PushOnly(PUBLISHED)], ids=lambda law: law.description)
def test_a_batch_of_soft_and_rigid_walls_has_the_wells_of_each_alone(law: DomeLaw) -> None:
    """Next to folds, too, where places of the scan are moved: hinges up to the loss of a well."""
    hinges, walls = np.meshgrid(np.linspace(20.0, 120.0, 41), [0.0, 0.05, 2.0])
    finger = replace(
        uniform_finger(1, **STUDY).changed(
            hinge_stiffness=hinges.reshape(1, -1), wall_compliance=walls.reshape(1, -1)
        ),
        law=law,
    )
    together = inverted_wells(finger)
    assert 0 < together.exists.sum() < together.exists.size
    for lane in range(hinges.size):
        alone = inverted_wells(finger.take_lanes(np.array([lane])))
        exists = bool(alone.exists[0, 0])
        assert exists == together.exists[0, lane]
        if exists:
            assert together.extension[0, lane] == pytest.approx(alone.extension[0, 0], abs=1e-9)
            assert together.barrier[0, lane] == pytest.approx(alone.barrier[0, 0], abs=1e-9)


@pytest.mark.parametrize(
    ("compliance", "barrier"), [(0.0, 197.558), (1e-9, 197.558), (1e-5, 197.570), (0.1, 399.394)]
)
@pytest.mark.parametrize("law", [PUBLISHED, PushOnly(PUBLISHED)], ids=lambda law: law.description)
def test_the_barrier_of_a_faint_hinge_beyond_its_bars(
    law: DomeLaw, compliance: float, barrier: float
) -> None:
    """Corners within 1e-14 of 90 degrees; barriers by a minimizer in 40 digits."""
    values = {"segment_height": 20.0, "stroke": 64.0, "bistable_stiffness": 13.0}
    springs = {"force_linearity": 0.001, "hinge_stiffness": 0.003}
    finger = replace(uniform_finger(1, **{**STUDY, **values, **springs}), law=law)
    finger = finger.changed(wall_compliance=np.array([[compliance]]))
    assert barriers(finger, inverted_wells(finger))[0] == pytest.approx(barrier, abs=2e-3)


@pytest.mark.parametrize("compliance", [1e-12, 1e-9, 1e-5, 0.1])
def test_a_dome_too_large_for_its_bars_has_no_well_behind_a_wall(compliance: float) -> None:
    values = {"segment_height": 20.0, "stroke": 90.0, "bistable_stiffness": 13.0}
    springs = {"force_linearity": 0.001, "hinge_stiffness": 0.015}
    finger = uniform_finger(1, **{**STUDY, **values, **springs})
    finger = finger.changed(wall_compliance=np.array([[compliance]]))
    wells = inverted_wells(finger)
    assert not wells.exists.any()
    assert barriers(finger, wells)[0] == 0.0


def test_the_reference_knows_openings_beyond_the_bars() -> None:
    """Where a step of Newton's method by the opening leaves it: corners near 90 degrees."""
    values = {"segment_height": 20.0, "stroke": 64.0, "bistable_stiffness": 13.0}
    springs = {"force_linearity": 0.001, "hinge_stiffness": 24.0}
    finger = uniform_finger(1, **{**STUDY, **values, **springs})
    finger = finger.changed(wall_compliance=np.array([[1e-3]]))
    from mpmath import workdps

    with workdps(40):
        angle, wall = inverted_rest(extended_units(finger)[0])
    found = inverted_wells(finger)
    assert found.angle[0, 0] == pytest.approx(float(angle), rel=1e-9)
    assert found.extension[0, 0] - 40.0 * np.sin(found.angle[0, 0]) == pytest.approx(float(wall))


@pytest.mark.parametrize("compliance", [5e-324, 1e-300, 1e-30])
def test_walls_that_hardly_give_way_are_rigid(compliance: float) -> None:
    """The share that walls take underflows, or what is divided by it overflows."""
    rigid = uniform_finger(1, **STUDY)
    finger = rigid.changed(wall_compliance=np.array([[compliance]]))
    extension = np.array([[0.0, 1.0, 3.5, 21.0]])
    assert tangent_of(finger, extension) == pytest.approx(tangent_of(rigid, extension), rel=1e-12)


@pytest.mark.parametrize("bars", [np.inf, 1e4])
def test_units_taken_from_a_finger_keep_its_walls(bars: float) -> None:
    """Solved again by themselves: designs or units all of whose walls are rigid."""
    finger = finger_with(3, 0.7, 0.0, 0.0, bars=bars)
    pattern = np.ones((2, 1), bool)
    cut = settled(finger.section(1, 3), pattern)
    bare = settled(finger_with(2, 0.0, bars=bars), pattern)
    assert cut.status.tolist() == bare.status.tolist() == [Status.STABLE]
    assert cut.equilibrium.energy == pytest.approx(bare.equilibrium.energy, rel=1e-12)
    size = bare.potential.coordinates.size
    assert cut.potential.coordinates.size == size + 2
