"""Derivatives of states by their finger's values: closed forms, and states solved again."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from dpgcli.arrays import Array
from dpgcli.mechanics.chain_geometry import internal
from dpgcli.mechanics.curve import spline
from dpgcli.mechanics.finger import ARRAYS, STUDY, Finger
from dpgcli.mechanics.laws import PUBLISHED, DomeLaw, PushOnly, Tabulated
from dpgcli.mechanics.terms import chain_potential
from dpgcli.states.certify import Settled
from dpgcli.states.sensitivities import sensitivities
from dpgcli.states.settle import settle
from dpgcli.states.tip import tip
from dpgcli.states.units import UnitSolutions

Fingers = Callable[..., Finger]
PATTERNS = np.array([[1, 1, 0, 1], [0, 1, 0, 1], [1, 0, 1, 1]], bool)
TRAVEL = np.linspace(0.0, 1.5, 301)
ENERGY = 0.5 * TRAVEL**2 * (0.043 + 0.957 * (1.0 - TRAVEL) ** 2)
TABLE = Tabulated(spline(tuple(TRAVEL), tuple(ENERGY)))
LAWS = (PUBLISHED, TABLE, PushOnly(PUBLISHED), PushOnly(TABLE))


def solved(finger: Finger) -> Settled:
    return settle(UnitSolutions.of(finger), chain_potential, PATTERNS, 1e-14)


def outputs(finger: Finger) -> dict[str, Array]:
    """Poses and angles of states solved anew."""
    batch = solved(finger)
    chain, values = batch.potential.coordinates, batch.equilibrium.coordinates
    _, near, far, *_ = internal(chain.without_walls(values), finger.is_rigid)
    openings = chain.springs(values).extension
    return {
        "pose": tip(batch, with_compliance=False).pose,
        "strut_angles": -np.cumsum(near + far, axis=0),
        "openings": openings,
        "pushes": -batch.finger.springs(openings).force,
    }


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.description)
@pytest.mark.parametrize("compliance", [0.0, 0.05])
@pytest.mark.parametrize("stiffness", [1e2, np.inf, pytest.param(1e4, marks=pytest.mark.slow)])
def test_they_are_the_slopes_of_states_that_are_solved_again(
    graded_finger: Fingers, stiffness: float, compliance: float, law: DomeLaw
) -> None:
    """By fourth-order central differences with a step of 1e-3 of the value, where it matters."""
    finger = replace(graded_finger(3, 3, linear_stiffness=stiffness), law=law)
    finger = finger.changed(wall_compliance=np.array([[compliance]]))
    for name in ARRAYS:
        value = getattr(finger, name)
        if not value.any() or np.isinf(value).any():
            continue
        if name == "force_linearity" and law.curve is not None:
            continue
        found = sensitivities(solved(finger), [{name: value}])
        near, far = (
            {
                key: up - down
                for (key, up), down in zip(
                    outputs(finger.changed(**{name: value * (1.0 + h)})).items(),
                    outputs(finger.changed(**{name: value * (1.0 - h)})).values(),
                    strict=True,
                )
            }
            for h in (1e-3, 2e-3)
        )
        for key in near:
            slope = (8.0 * near[key] - far[key]) / (12.0 * 1e-3)
            scale = np.abs(slope).max()
            error = np.abs(getattr(found, key)[:, 0] - slope).max()
            kinks = 1e-4 if law.curve is not None else 1e-7  # of the tabulated stiffness
            assert error <= kinks * scale + 1e-9, (name, key)


def test_one_unit_in_closed_form(reference_finger: Fingers) -> None:
    """de/dphi = F H cos(phi/2) + k_theta phi = 0, differentiated by k_theta."""
    units = UnitSolutions.of(reference_finger(1))
    batch = settle(units, chain_potential, np.array([[True]]), 1e-14)
    turn = -float(tip(batch, with_compliance=False).pose[2, 0])
    height, hinge = STUDY["segment_height"], STUDY["hinge_stiffness"]
    spring = units.finger.springs(np.array([[2.0 * height * np.sin(0.5 * turn)]]))
    lever = height * np.cos(0.5 * turn)
    curvature = (
        float(spring.stiffness[0, 0]) * lever**2
        - 0.5 * float(spring.force[0, 0]) * height * np.sin(0.5 * turn)
        + hinge
    )
    found = sensitivities(batch, [{"hinge_stiffness": np.ones((1, 1))}])
    assert -found.pose[2, 0, 0] == pytest.approx(-turn / curvature, rel=1e-12)


def test_a_step_along_several_values_is_the_sum_of_steps(reference_finger: Fingers) -> None:
    batch = solved(reference_finger(3, 1e4))
    steps = [{"stroke": np.array([[0.2]])}, {"hinge_stiffness": np.array([[3.0]])}]
    one, other = sensitivities(batch, steps).pose.transpose(1, 0, 2)
    both = sensitivities(batch, [{**steps[0], **steps[1]}]).pose[:, 0]
    assert both == pytest.approx(one + other, rel=1e-12, abs=1e-14)


def test_a_step_in_one_unit_moves_that_unit(reference_finger: Fingers) -> None:
    """Rigid bars: other units do not feel it."""
    batch = solved(reference_finger(3))
    step = {"stroke": np.array([[0.0], [1.0], [0.0]])}
    found = sensitivities(batch, [step])
    turns = np.diff(found.strut_angles[:, 0], axis=0, prepend=0.0)
    moved = np.abs(turns) > 1e-12
    assert np.array_equal(moved, PATTERNS & np.array([[False], [True], [False]]))


def test_states_in_units_of_their_own_lanes(reference_finger: Fingers) -> None:
    """Alone or in a batch, a state has the same derivatives."""
    finger = reference_finger(3, 1e4)
    step = [{"segment_height": np.ones((1, 1))}]
    together = sensitivities(solved(finger), step).pose
    for state in range(PATTERNS.shape[1]):
        alone = settle(UnitSolutions.of(finger), chain_potential, PATTERNS[:, [state]], 1e-14)
        found = sensitivities(alone, step).pose[..., 0]
        assert found == pytest.approx(together[..., state], rel=1e-12, abs=1e-15)
