"""States of the finite-element finger that no fit has seen: what choices of a fit do to them."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from dpgcli.api.fits.unit import fit_unit
from dpgcli.arrays import Array
from dpgcli.calibration.choices import HINGES, LEVER, WALLS, Target
from dpgcli.calibration.comparison import Comparison, compare
from dpgcli.calibration.finger import FingerFit
from dpgcli.calibration.fits import Fit
from dpgcli.calibration.known import Frame, KnownStates
from dpgcli.calibration.observations import targets_for
from dpgcli.files.known_states import read_states
from dpgcli.files.scene_file import read_spec, scene_of
from dpgcli.mechanics.finger import Finger

pytestmark = pytest.mark.slow

EXAMPLES = Path(__file__).parents[2] / "configs" / "calibration"
STUDY = EXAMPLES.parent / "three_unit.yaml"
GEOMETRIC = 10.75  # mm, the segment height of the geometry
MIDDLE = Frame((5.375, 0.75), (5.375, -0.75))  # of the layer
TURNS = np.linspace(0.44, 0.64, 21)  # mm/N of walls: an opened gap turns by 0.290 to 0.275 rad


@cache
def given() -> tuple[Finger, KnownStates, KnownStates]:
    """The finger, the states that are fitted, and those that are not."""
    finger = scene_of(read_spec(EXAMPLES / "three_gap_finger.yaml")).finger
    names = ("three_gap_finger_pure_push.csv", "three_gap_finger_pure_push_rest.csv")
    seen, unseen = (read_states(EXAMPLES / name, 3) for name in names)
    return finger, seen, unseen


@cache
def axis() -> tuple[float, Frame]:
    """The segment height by which moments turn a unit, and the frame of the hinge's axis."""
    height = fit_unit(EXAMPLES / "unit_moment.csv", spec=STUDY).values[LEVER]
    above = 0.75 + GEOMETRIC - height
    return height, Frame((5.375, above), (5.375, -above))


def study(height: float, frame: Frame, *free: str, **changes: object) -> FingerFit:
    finger, seen, _ = given()
    targets = targets_for(seen, with_walls=True)
    own = finger.with_values({LEVER: height})
    return replace(FingerFit(own, seen, frame, free or (WALLS, HINGES), targets), **changes)


def predicted(of: FingerFit, found: Fit) -> tuple[Array, Array, Comparison]:
    """Errors of unseen states: of tips, and of pushes, as shares of the smallest that is known."""
    rest = given()[2]
    beside = compare(of.finger.with_values(found.by_key), rest, of.frame)
    return beside.relative, beside.push / rest.pushes[rest.patterns].min(), beside


def test_about_the_axis_of_the_hinge_shapes_pushes_and_stiffness_are_met_together() -> None:
    height, frame = axis()
    assert 0.4 < GEOMETRIC - height < 0.6
    plain, bent = study(GEOMETRIC, MIDDLE), study(height, frame)
    tips, pushes, _ = predicted(bent, found := bent.fit())
    assert np.mean(tips) < 0.018 and np.max(tips) < 0.029 and np.max(pushes) < 0.06
    before = predicted(plain, at_first := plain.fit())[0]
    assert np.mean(before) > 1.25 * np.mean(tips) and np.max(before) > np.max(tips)
    for error in (np.nanmax, np.nanmean, lambda values: np.sqrt(np.nanmean(values**2))):
        assert error(bent.left_out) < error(plain.left_out), "the given states say so themselves"
    stiffness = {name: stiffness_errors(of, fit) for name, of, fit in (
        ("plain", plain, at_first), ("bent", bent, found)
    )}  # fmt: skip
    assert 0.5 < stiffness["plain"].min() < stiffness["plain"].max() < 0.65
    assert 0.1 < stiffness["bent"].min() < stiffness["bent"].max() < 0.22


def stiffness_errors(of: FingerFit, found: Fit) -> Array:
    """Of an inverted unit against moments that nothing was fitted to, (moment,)."""
    unit = of.finger.with_values(found.by_key).with_units([0])
    known = read_states(EXAMPLES / "unit_moment.csv", 1)
    errors = compare(unit, known, Frame()).stiffness
    return errors[known.patterns[0] & (known.moments != 0.0)]


def test_the_pitch_comes_back_about_the_axis_alone() -> None:
    """Gaps are 13.75 mm apart: a fit that turns them about the layer's middle shortens that."""
    key = "segment_length_mm"
    found = {
        name: study(*where, WALLS, HINGES, key).fit().by_key[key]
        for name, where in (("middle", (GEOMETRIC, MIDDLE)), ("axis", axis()))
    }
    assert found["axis"] == pytest.approx(13.75, abs=0.015)
    assert abs(found["middle"] - 13.75) > 2.0 * abs(found["axis"] - 13.75)


@pytest.mark.parametrize(
    "errors", [{Target.TIPS: 0.02}, {Target.TIPS: 1.0}, {Target.PUSHES: 1.0}, {Target.PUSHES: 1e-3}]
)
def test_errors_that_are_stated_change_next_to_nothing(errors: dict[Target, float]) -> None:
    """Tips say how far a gap turns, pushes how hard: neither has a say in the other."""
    plain = study(GEOMETRIC, MIDDLE).fit().by_key
    stated = study(GEOMETRIC, MIDDLE, errors=errors).fit().by_key
    for key in (WALLS, HINGES):
        assert stated[key] == pytest.approx(plain[key], rel=2e-3)


def test_no_turn_of_a_gap_is_near_to_all_unseen_states() -> None:
    """About the layer's middle: whatever walls, at best 2 % in the mean and 2.2 % at worst."""
    found = {}
    for walls in TURNS:
        of = study(GEOMETRIC, MIDDLE, HINGES, targets=(Target.PUSHES,))
        held = replace(of, finger=of.finger.with_values({WALLS: float(walls)}))
        tips, pushes, _ = predicted(held, held.fit())
        assert np.max(pushes) == pytest.approx(0.0545, abs=5e-4), "which do not ask for the turn"
        found[float(walls)] = np.mean(tips), np.max(tips)
    assert len(found) == len(TURNS)
    means, worst = np.array([*found.values()]).T
    assert 0.0195 < means.min() < 0.0203 and 0.021 < worst.min() < 0.024
    for errors in (means, worst):
        assert 0 < errors.argmin() < len(TURNS) - 1


def test_the_given_states_do_not_say_how_to_weigh_them() -> None:
    """Tips in mm, in percent or between: each predicted from the others is off by the same."""
    of = study(*axis(), WALLS, HINGES)
    known = given()[1].chosen(np.arange(1, 5))
    walls = np.linspace(0.2, 1.2, 201)
    tips = [
        compare(of.finger.with_values({HINGES: 30.81, WALLS: w}), known, of.frame) for w in walls
    ]
    off, deflection = np.array([c.distance for c in tips]), tips[0].deflection
    rms, worst = [], []
    for power in (0.0, 0.5, 0.75, 1.0):
        costs = (off / deflection**power) ** 2
        without = costs.sum(axis=1, keepdims=True) - costs
        left_out = off[without.argmin(axis=0), np.arange(4)] / deflection
        rms.append(np.sqrt((left_out**2).mean()))
        chosen = of.finger.with_values(
            {HINGES: 30.81, WALLS: float(walls[costs.sum(axis=1).argmin()])}
        )
        worst.append(compare(chosen, given()[2], of.frame).relative.max())
    assert 0.0395 < min(rms) < max(rms) < 0.042
    assert min(worst) < 0.022 and worst[0] > 0.025 and worst[-1] > 0.025


def test_a_gap_tilts_the_chambers_beside_it() -> None:
    """The cause: closed gaps turn by 0.015 to 0.017 rad beside an opened one, in the data."""
    _, seen, unseen = given()
    closed, opened = [], []
    for known in (seen, unseen):
        turns = -np.diff(known.angles, axis=0, prepend=0.0)
        for pattern, each in zip(known.patterns.T, turns.T, strict=True):
            beside = np.array([*pattern[1:], False]).astype(int) + np.array([False, *pattern[:-1]])
            closed += each[~pattern & (beside == 1)].tolist()
            opened += each[pattern & (beside == 0)].tolist()
    assert len(closed) == 6 and len(opened) == 5
    assert 0.014 < min(closed) < max(closed) < 0.018
    assert 0.258 < min(opened) < max(opened) < 0.268
