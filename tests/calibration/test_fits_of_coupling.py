"""Fits of how hinges turn their neighbors: values come back, and finite elements are met."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dpgcli.api.fits.unit import fit_unit
from dpgcli.calibration.choices import COUPLING, HINGES, LEVER, WALLS, Target
from dpgcli.calibration.comparison import compare
from dpgcli.calibration.finger import FingerFit
from dpgcli.calibration.known import Frame, KnownStates, lattice_states
from dpgcli.calibration.observations import targets_for
from dpgcli.errors import FitError
from dpgcli.files.known_states import read_states
from dpgcli.files.scene_file import read_spec, scene_of
from dpgcli.mechanics.finger import Finger

EXAMPLES = Path(__file__).parents[2] / "configs" / "calibration"
FRAME = Frame((5.375, 0.75), (5.375, -0.75))
PATTERNS = np.array([[0, 0, 1, 1, 1], [0, 1, 0, 1, 0], [1, 0, 0, 0, 1]], bool)
FREE = (HINGES, WALLS, COUPLING)
MET = (Target.TIPS, Target.OPENINGS, Target.PUSHES)


def pushed() -> Finger:
    return scene_of(read_spec(EXAMPLES / "three_gap_finger.yaml")).finger


def known_of(finger: Finger) -> KnownStates:
    own = lattice_states(finger, PATTERNS, FRAME)
    pieces = {"angles": own.angles, "openings": own.openings, "pushes": own.pushes}
    return replace(KnownStates.of_tips(PATTERNS, own.tip), **pieces)


@pytest.mark.parametrize("coupling", [2.5, -2.5, 0.0])
def test_values_come_back(coupling: float) -> None:
    truth = {HINGES: 31.0, WALLS: 0.8, COUPLING: coupling}
    known = known_of(pushed().with_values(truth))
    found = FingerFit(pushed(), known, FRAME, FREE, MET).fit()
    for key, value in truth.items():
        assert found.by_key[key] == pytest.approx(value, rel=1e-6, abs=1e-7)


def test_a_coupling_that_is_not_free_stays() -> None:
    finger = pushed().with_values({COUPLING: 2.0})
    study = FingerFit(finger, known_of(finger), FRAME, (HINGES,), MET)
    found = study.fit()
    assert found.by_key[COUPLING] == 2.0
    assert found.by_key[HINGES] == pytest.approx(24.2, rel=1e-6)
    assert COUPLING not in FingerFit(pushed(), known_of(finger), FRAME, (HINGES,), MET).fit().by_key


def test_what_has_no_neighbors_is_not_coupled() -> None:
    unit = pushed().with_units([0])
    own = lattice_states(unit, np.array([[False, True]]), FRAME)
    known = KnownStates.of_tips(np.array([[False, True]]), own.tip)
    with pytest.raises(FitError, match=f"do not depend on {COUPLING}"):
        FingerFit(unit, known, FRAME, (COUPLING,)).fit()


def test_hinges_without_stiffness_couple_nothing() -> None:
    finger = pushed().with_values({HINGES: 0.0})
    with pytest.raises(FitError, match="no stiffness to couple"):
        FingerFit(finger, known_of(pushed()), FRAME, (COUPLING,), MET).fit()


def test_no_fit_has_hinges_that_run_away() -> None:
    """Neighbors that need few pushes to stay open, beside a coupling that is held."""
    finger = pushed().with_values({COUPLING: 10.0})
    every = np.ones((3, 1), bool)
    pushes = lattice_states(pushed().with_values({HINGES: 3.0}), every, FRAME).pushes
    known = replace(KnownStates.of_tips(every, np.full((2, 1), np.nan)), pushes=pushes)
    with pytest.raises(FitError, match=rf"{COUPLING} ended at 10, half of {HINGES} or more"):
        FingerFit(finger, known, FRAME, (HINGES,), (Target.PUSHES,)).fit()


@pytest.mark.slow
def test_unseen_states_and_stiffness_of_finite_elements_are_met_by_one_fit() -> None:
    """Of a finger on the hinge's axis: shapes, pushes, closed gaps, and what moments meet."""
    seen, unseen = (
        read_states(EXAMPLES / f"three_gap_finger_pure_push{rest}.csv", 3) for rest in ("", "_rest")
    )
    height = fit_unit(
        EXAMPLES / "unit_moment.csv", spec=EXAMPLES.parent / "three_unit.yaml"
    ).values[LEVER]
    above = 0.75 + 10.75 - height
    frame = Frame((5.375, above), (5.375, -above))
    finger = pushed().with_values({LEVER: height})
    study = FingerFit(finger, seen, frame, FREE, targets_for(seen, with_walls=True))
    found = study.fit()
    place = [parameter.key for parameter in found.parameters].index(COUPLING)
    assert found.by_key[COUPLING] == pytest.approx(1.16, abs=0.05)
    assert found.standard_errors[place] < 0.1, "the given states know it"
    assert np.nanmax(study.left_out) < 0.01, "and say so of each other"
    beside = compare(finger.with_values(found.by_key), unseen, frame)
    assert beside.relative.max() < 0.01 and beside.relative.mean() < 0.008
    assert beside.push.max() < 0.01 * unseen.pushes[unseen.patterns].min()
    assert beside.opening.max() < 0.015, "of closed gaps, too, which no fit has met"
    assert beside.angle.max() < 0.01
    moments = read_states(EXAMPLES / "unit_moment.csv", 1)
    unit = finger.with_values(found.by_key).with_units([0])
    stiffness = np.abs(compare(unit, moments, Frame()).stiffness)
    is_moved = moments.moments != 0.0
    assert stiffness[is_moved & moments.patterns[0]].max() < 0.15
    assert stiffness[is_moved & ~moments.patterns[0]].max() < 0.06


def test_in_the_layer_s_middle_it_helps_as_well() -> None:
    seen, unseen = (
        read_states(EXAMPLES / f"three_gap_finger_pure_push{rest}.csv", 3) for rest in ("", "_rest")
    )
    study = FingerFit(pushed(), seen, FRAME, FREE, targets_for(seen, with_walls=True))
    beside = compare(pushed().with_values(study.fit().by_key), unseen, FRAME)
    assert beside.relative.max() < 0.025 and beside.relative.mean() < 0.018
    assert beside.push.max() < 0.01 * unseen.pushes[unseen.patterns].min()
