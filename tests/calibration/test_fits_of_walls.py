"""Fits of walls: values come back, errors weigh, and given finite elements are met."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq, least_squares

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


@pytest.mark.parametrize("size", [1e-3, 1e3])
def test_where_walls_begin_knows_no_length(size: float) -> None:
    """The same finger a thousand times as small or large, its forces as they are."""
    start = finite_elements()[0].with_units([0, 1])
    scaled = start.changed(
        segment_length=start.segment_length * size,
        segment_height=start.segment_height * size,
        stroke=start.stroke * size,
        dome_travel=start.dome_travel * size,
        bistable_stiffness=start.bistable_stiffness / size,
        linear_stiffness=start.linear_stiffness / size,
        hinge_stiffness=start.hinge_stiffness * size,
    )
    truth = {HINGES: 31.0 * size, WALLS: 0.8 * size}
    own = lattice_states(scaled.with_values(truth), PATTERNS, Frame(), MOMENTS * size)
    known = replace(KnownStates.of_tips(PATTERNS, own.tip), moments=MOMENTS * size)
    known = replace(known, angles=own.angles, pushes=own.pushes)
    found = FingerFit(scaled, known, Frame(), tuple(truth), (Target.ANGLES, Target.PUSHES)).fit()
    for key, value in truth.items():
        assert found.by_key[key] == pytest.approx(value, rel=1e-6)


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
    """Without the rows of −5 N mm: their increments within 8 % (inverted) and 3 % (ground)."""
    given = np.flatnonzero(unit.moments > -3.0)
    start = unit_finger(unit.chosen(given), 10.75)
    study = FingerFit(start, unit.chosen(given), Frame(), (HINGES, WALLS, LEVER), ALL[1:3])
    values = study.fit().by_key
    found = compare(start.with_values(values), unit, Frame())
    beyond = unit.moments == -5.0
    errors = np.abs(found.stiffness[beyond])
    assert errors[unit.patterns[0, beyond]] < 0.08
    assert errors[~unit.patterns[0, beyond]] < 0.03


def test_a_unit_by_its_moment_balance(unit: KnownStates) -> None:
    """k θ = M + P H cos(θ/2) and o = 2 H sin(θ/2) + c P, row by row, by SciPy alone."""
    angle_error, opening_error = 0.002, 0.03
    fit = fit_unit(
        EXAMPLES / "unit_moment.csv",
        error=[f"angles={angle_error}", f"openings={opening_error}"],
    )
    inverted = unit.patterns[0]
    slope, start = np.polyfit(unit.openings[0, inverted], unit.pushes[0, inverted], 1)
    spring, too_long = -slope, -start / slope

    def residual(values: Array) -> Array:
        hinge, walls, lever = values
        found = []
        for moment, pushed in zip(unit.moments, inverted, strict=True):

            def push(turn: float, on: bool = bool(pushed)) -> float:
                free = too_long - 2.0 * lever * np.sin(turn / 2.0)
                return spring * free / (1.0 + walls * spring) if on else 0.0

            def unbalanced(turn: float, m: float = float(moment), by: Any = push) -> float:
                return hinge * turn - m - by(turn) * lever * np.cos(turn / 2.0)

            turn = brentq(unbalanced, -1.0, 1.0, xtol=1e-14)
            found.append((turn, 2.0 * lever * np.sin(turn / 2.0) + walls * push(turn)))
        turns, openings = np.array(found).T
        given = inverted | (unit.moments != 0.0)
        return np.concatenate(
            (
                (turns + unit.angles[0]) / angle_error,
                (openings - unit.openings[0])[given] / opening_error,
            )
        )

    peer = least_squares(residual, [30.0, 0.8, 10.5], x_scale=[30.0, 0.8, 10.5], xtol=1e-12)
    for key, value in zip((HINGES, WALLS, LEVER), peer.x, strict=True):
        assert fit.values[key] == pytest.approx(value, rel=1e-5)


def test_rows_in_which_a_dome_has_let_go_are_no_part_of_its_line() -> None:
    """k θ = M + P H cos(θ/2) and o = 2 H sin(θ/2) + c P with P = s (o_0 − o) >= 0, exactly."""
    lever, hinge, walls, spring, too_long = 6.9, 4.6, 1.2, 22.0, 2.2
    rows: dict[str, list[Any]] = {"unit": [], "moment_N_mm": [], "chamber2_angle_rad": []}
    rows |= {"opening_mm": [], "push_N": []}

    def push(turn: float) -> float:
        gap = 2.0 * lever * np.sin(turn / 2.0)
        return float(max(spring * (too_long - gap) / (1.0 + walls * spring), 0.0))

    for name, moments in (("ground", (-0.7, 0.3, 1.2)), ("inverted", (-0.7, 0.3, 1.2, 2.2, 3.0))):
        for moment in moments:
            on = float(name == "inverted")
            turn = brentq(
                lambda t, m=moment, on=on: hinge * t - m - on * push(t) * lever * np.cos(t / 2.0),
                *(-1.0, 1.0),
                xtol=1e-15,
            )
            pushed = on * push(turn)
            opening = 2.0 * lever * np.sin(turn / 2.0) + walls * pushed
            told = (
                (name, moment, -turn, opening, pushed) if on else (name, moment, -turn, None, None)
            )
            for column, value in zip(rows.values(), told, strict=True):
                column.append(value)
    assert [value for value in rows["push_N"] if value is not None].count(0.0) == 2
    found = fit_unit(rows).values
    for key, value in {LEVER: lever, HINGES: hinge, WALLS: walls}.items():
        assert found[key] == pytest.approx(value, rel=1e-6)


def test_one_moment_does_not_tell_hinge_and_walls_apart(unit: KnownStates) -> None:
    alone = unit.chosen(np.flatnonzero(unit.patterns[0] & (unit.moments == 0.0)))
    start = unit_finger(unit, 10.75)
    study = FingerFit(start, alone, Frame(), (HINGES, WALLS), (Target.ANGLES, Target.ANGLES))
    with pytest.raises(FitError, match=r"apart.*rows with moment_N_mm, of a ground"):
        study.fit()


@pytest.mark.parametrize(
    ("free", "targets"),
    [
        ((WALLS, HINGES, LEVER), ALL[:1] + ALL[2:]),
        pytest.param((WALLS, HINGES), ALL[:2], marks=pytest.mark.slow),
    ],
)
def test_a_bound_does_not_hide_what_data_do_not_tell(
    free: tuple[str, ...], targets: tuple[Target, ...]
) -> None:
    """Shapes and pushes at rest: walls end as rigid, or hinges at a bound, as good as any other."""
    finger, known = finite_elements()
    with pytest.raises(FitError, match="apart"):
        FingerFit(finger, known, FRAME, free, targets).fit()


def test_a_noisy_opening_does_not_make_a_push_a_pull(unit: KnownStates) -> None:
    """Openings of one pusher differ by 0.016 mm, less than anybody measures."""
    random = np.random.default_rng(3)
    for _ in range(20):
        noisy = unit.openings + 0.02 * random.normal(size=unit.openings.shape)
        finger = unit_finger(replace(unit, openings=noisy), 10.75)
        assert finger.bistable_stiffness.item() > 5.0
        assert finger.stroke.item() == pytest.approx(3.5, abs=0.1)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"push_N": [0.0, 0.9, 0.9], "opening_mm": [0, 3.4, 3.4]}, "under two moments or more"),
        ({"push_N": [0.0, 0.6, 0.9], "opening_mm": [0, 3.2, 3.5]}, "a push falls"),
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


def test_states_that_no_fit_has_seen() -> None:
    """011, 101 and 111: pushes within 6 %, tips within 3.1 % of the deflection, 2.3 % in the mean.

    That tips are no nearer is the lattice's: an opened gap tilts the chambers beside it, so that
    gaps within a finger turn it further than the last one does, and opened neighbors push less.
    """
    finger, known = finite_elements()
    rest = read_states(EXAMPLES / "three_gap_finger_pure_push_rest.csv", 3)
    study = FingerFit(finger, known, FRAME, (WALLS, HINGES), targets_for(known, with_walls=True))
    found = compare(finger.with_values(study.fit().by_key), rest, FRAME)
    assert np.nanmax(found.relative) < 0.0315 and np.nanmean(found.relative) < 0.0235
    assert np.nanmax(found.push) < 0.06 * rest.pushes[rest.patterns].min()
