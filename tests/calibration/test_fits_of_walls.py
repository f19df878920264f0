"""Fits of walls: values come back, errors weigh, and given finite elements are met."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dpgcli.api.fits.unit import fit_unit
from dpgcli.arrays import Array
from dpgcli.calibration.choices import HINGES, LEVER, WALLS, Target
from dpgcli.calibration.comparison import compare
from dpgcli.calibration.finger import FingerFit
from dpgcli.calibration.known import Frame, KnownStates, lattice_states
from dpgcli.calibration.observations import Observations, targets_for
from dpgcli.calibration.unit import unit_finger
from dpgcli.errors import FitError
from dpgcli.files.known_states import read_states
from dpgcli.files.scene_file import read_spec, scene_of
from dpgcli.mechanics.finger import Finger

Fingers = Callable[..., Finger]
EXAMPLES = Path(__file__).parents[2] / "configs" / "calibration"
FRAME = Frame((5.375, 0.75), (5.375, -0.75))
PATTERNS = np.array([[0, 0, 0, 1, 1, 1], [0, 0, 1, 0, 0, 1]], bool)
MOMENTS = np.array([0.0, 4.0, 0.0, 0.0, -6.0, 5.0])
TRUTH = {HINGES: 31.0, WALLS: 0.8, LEVER: 10.2}
ALL = tuple(Target)


def finite_elements() -> tuple[Finger, KnownStates]:
    scene = scene_of(read_spec(EXAMPLES / "three_gap_finger.yaml"))
    return scene.finger, read_states(EXAMPLES / "three_gap_finger_pure_push.csv", 3)


def known_of(finger: Finger, moments: Array = MOMENTS) -> KnownStates:
    own = lattice_states(finger, PATTERNS, FRAME, moments)
    known = KnownStates.of_tips(PATTERNS, own.tip)
    pieces = {"angles": own.angles, "openings": own.openings, "pushes": own.pushes}
    return replace(known, moments=moments, **pieces)


@pytest.mark.parametrize("targets", [ALL, (Target.ANGLES, Target.PUSHES)], ids=str)
def test_values_come_back_from_states_under_moments(targets: tuple[Target, ...]) -> None:
    start = finite_elements()[0].with_units([0, 1])
    study = FingerFit(start, known_of(start.with_values(TRUTH)), FRAME, tuple(TRUTH), targets)
    found = study.fit()
    for key, value in TRUTH.items():
        assert found.by_key[key] == pytest.approx(value, rel=1e-6)


def test_walls_that_are_rigid_come_back_as_rigid() -> None:
    start = finite_elements()[0].with_units([0, 1])
    study = FingerFit(start, known_of(start), FRAME, (WALLS,), (Target.TIPS, Target.PUSHES))
    found = study.fit()
    assert found.by_key[WALLS] == pytest.approx(0.0, abs=1e-9)


def test_stated_errors_weigh() -> None:
    """Pushes that are 10 % too large and tips that are right: each is met if it counts alone."""
    start = finite_elements()[0].with_units([0, 1]).with_values({LEVER: TRUTH[LEVER]})
    known = known_of(start.with_values(TRUTH))
    known = replace(known, pushes=1.1 * known.pushes)
    found = {}
    for counted, other in ((Target.TIPS, Target.PUSHES), (Target.PUSHES, Target.TIPS)):
        errors = {counted: 1e-6, other: 1e3}
        targets = (Target.TIPS, Target.PUSHES)
        study = FingerFit(start, known, FRAME, (WALLS, HINGES), targets, errors=errors)
        assert study.observations.errors == errors, "none is estimated"
        parts = dict(study.observations.by_target(study.fit().residuals))
        found[counted] = {target: np.abs(part).max() for target, part in parts.items()}
    assert found[Target.TIPS][Target.TIPS] < 0.1 * found[Target.PUSHES][Target.TIPS]
    assert found[Target.PUSHES][Target.PUSHES] < 0.1 * found[Target.TIPS][Target.PUSHES]


def test_estimated_errors_are_those_that_are_left() -> None:
    finger, known = finite_elements()
    free = (WALLS, HINGES)
    study = FingerFit(finger, known, FRAME, free, targets_for(known, with_walls=True))
    assert study.targets == (Target.TIPS, Target.OPENINGS, Target.PUSHES)
    left = dict(study.observations.by_target(study.fit().residuals))
    errors = study.observations.errors
    assert np.sqrt((left[Target.TIPS] ** 2).mean()) == pytest.approx(errors[Target.TIPS], rel=0.3)
    opened = known.openings[known.patterns]
    assert errors[Target.OPENINGS] == pytest.approx(0.01 * np.sqrt((opened**2).mean()), rel=1e-9)


def test_derivatives_are_those_of_differences() -> None:
    finger = finite_elements()[0].with_units([0, 1]).with_values(TRUTH)
    study = FingerFit(finger, known_of(finger), FRAME, tuple(TRUTH), ALL)
    errors = {t: 1.0 + k for k, t in enumerate(ALL)}
    seen = Observations(study.known, FRAME, ALL, errors)
    from dpgcli.mechanics.finger import KEYS
    from dpgcli.states.sensitivities import sensitivities

    states = lattice_states(finger, PATTERNS, FRAME, MOMENTS)
    steps = [{KEYS[key]: np.ones((1, 1))} for key in TRUTH]
    exact = seen.jacobian(states, sensitivities(states.settled, steps))
    for column, (key, value) in enumerate(TRUTH.items()):
        step = 1e-5 * value
        ends = [
            seen.residual(
                lattice_states(finger.with_values({key: value + d}), PATTERNS, FRAME, MOMENTS)
            )
            for d in (-step, step)
        ]
        slope = (ends[1] - ends[0]) / (2.0 * step)
        assert exact[:, column] == pytest.approx(slope, rel=1e-6, abs=1e-8)


def test_walls_bring_shapes_and_pushes_of_finite_elements_together() -> None:
    """What no lever can do: with the rigid one the pushes are 0.12 N off."""
    finger, known = finite_elements()
    study = FingerFit(finger, known, FRAME, (WALLS, HINGES), targets_for(known, with_walls=True))
    found = study.compared(study.fit())
    assert np.nanmax(found.relative) < 0.065 and np.nanmean(found.relative) < 0.035
    assert np.nanmax(found.push) < 0.06 * 0.83
    lever = FingerFit(finger, known, FRAME, (LEVER,))
    assert np.nanmax(lever.compared(lever.fit()).push) > 0.2


@pytest.fixture(scope="module")
def unit() -> KnownStates:
    return read_states(EXAMPLES / "unit_moment.csv", 1)


def test_a_units_turns_beyond_the_fitted_ones(unit: KnownStates) -> None:
    """Without the rows of −5 N mm: their increments within 15 % (inverted) and 6 % (ground)."""
    given = np.flatnonzero(unit.moments > -3.0)
    start = unit_finger(unit.chosen(given), 10.75)
    study = FingerFit(start, unit.chosen(given), Frame(), (HINGES, WALLS, LEVER), tuple(ALL[1:]))
    values = study.fit().by_key
    found = compare(start.with_values(values), unit, Frame())
    beyond = unit.moments == -5.0
    errors = np.abs(found.stiffness[beyond])
    assert errors[unit.patterns[0, beyond]] < 0.15
    assert errors[~unit.patterns[0, beyond]] < 0.06


def test_a_unit_by_its_moment_balance(unit: KnownStates) -> None:
    """k θ = M + P H cos(θ/2) and o = 2 H sin(θ/2) + c P, by linear least squares over rows.

    It weighs moments where the fit weighs turns, so that they differ by what the model is off.
    """
    fit = fit_unit(EXAMPLES / "unit_moment.csv")
    rows = unit.patterns[0]
    turn, push, opening = -unit.angles[0, rows], unit.pushes[0, rows], unit.openings[0, rows]
    balance = np.stack((turn, -push * np.cos(turn / 2.0), 0.0 * turn), axis=1)
    ground = np.stack(
        (-unit.angles[0, ~rows], 0.0 * unit.moments[~rows], 0.0 * unit.moments[~rows]), 1
    )
    opens = np.stack((0.0 * turn, 2.0 * np.sin(turn / 2.0), push), axis=1)
    left = np.concatenate((balance, ground, 10.0 * opens))
    right = np.concatenate((unit.moments[rows], unit.moments[~rows], 10.0 * opening))
    hinge, lever, walls = np.linalg.lstsq(left, right, rcond=None)[0]
    assert fit.values[HINGES] == pytest.approx(hinge, rel=0.04)
    assert fit.values[LEVER] == pytest.approx(lever, rel=0.03)
    assert fit.values[WALLS] == pytest.approx(walls, rel=0.1)


def test_one_moment_does_not_tell_hinge_and_walls_apart(unit: KnownStates) -> None:
    alone = unit.chosen(np.flatnonzero(unit.patterns[0] & (unit.moments == 0.0)))
    start = unit_finger(unit, 10.75)
    study = FingerFit(start, alone, Frame(), (HINGES, WALLS), (Target.ANGLES, Target.ANGLES))
    with pytest.raises(FitError, match=r"apart.*rows with moment_N_mm, of a ground"):
        study.fit()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"push_N": [0.0, 0.9, 0.9], "opening_mm": [0, 3.4, 3.4]}, "under two moments or more"),
        ({"push_N": [0.0, 0.6, 0.9], "opening_mm": [0, 3.4, 3.5]}, "a push falls with it"),
    ],
)
def test_what_pushes_must_be_known(change: dict[str, list[float]], said: str) -> None:
    rows = {"unit": ["ground", "inverted", "inverted"], "moment_N_mm": [2.5, 0.0, 2.5]}
    with pytest.raises(FitError, match=said):
        fit_unit(rows | {"chamber2_angle_rad": [-0.08, -0.26, -0.28]} | change)


def test_without_inverted_rows_only_the_hinge_is_fitted() -> None:
    rows = {"unit": ["ground"] * 2, "moment_N_mm": [2.5, -2.5], "chamber2_angle_rad": [-0.1, 0.1]}
    fit = fit_unit(rows)
    assert fit.values == {HINGES: pytest.approx(25.0)}
    assert any("no inverted unit" in line for line in fit.summary)
