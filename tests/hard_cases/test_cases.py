"""The gauntlet covers what it says, by both formulations, and follows the user's finger."""

from collections.abc import Iterable

import numpy as np
import pytest

from dpgcli.arrays import Array
from dpgcli.errors import UsageError
from dpgcli.hard_cases.cases import (
    Case,
    all_cases,
    built_in_cases,
    cases_of,
    check_families,
    study_finger,
)
from dpgcli.hard_cases.families import FAMILIES, FOLDED_STARTS
from dpgcli.hard_cases.variants import changed, rigid
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.terms import chain_potential
from dpgcli.states.certify import Status, certify
from dpgcli.states.margins import limits
from dpgcli.states.settle import settle
from dpgcli.states.units import UnitSolutions

pytestmark = pytest.mark.slow

NAMES = [family.name for family in FAMILIES]


@pytest.fixture(scope="module")
def built_in() -> list[Case]:
    return list(built_in_cases())


def values(cases: Iterable[Case], family: str, name: str) -> Array:
    """The first unit's value in every finger of a family, in ascending order."""
    found = [c.variant.finger.arrays()[name][0, 0] for c in cases if c.family == family]
    return np.unique(found)


def keys(cases: Iterable[Case]) -> list[tuple[str, ...]]:
    return [(c.subject, c.family, c.variant.label, c.pattern, c.formulation) for c in cases]


def test_every_family_is_there(built_in: list[Case]) -> None:
    assert list(dict.fromkeys(case.family for case in built_in)) == NAMES


def test_no_case_is_there_twice(built_in: list[Case]) -> None:
    assert len(set(keys(built_in))) == len(built_in)


def test_the_same_cases_come_every_time(built_in: list[Case]) -> None:
    again = keys(built_in_cases(["graded", "mirror"]))
    assert again == [key for key in keys(built_in) if key[1] in ("graded", "mirror")]


def test_elastic_bars_go_through_both_formulations_and_rigid_ones_through_one(
    built_in: list[Case],
) -> None:
    """Pressure and contact are followed in the chain only."""
    by_chain = {key[:-1] for key in keys(built_in) if key[-1] == "chain"}
    both = (
        case
        for case in built_in
        if not (case.variant.finger.is_rigid or case.variant.pressure or case.family == "contact")
    )
    elastic = {key[:-1] for key in keys(both)}
    assert {key[:-1] for key in keys(built_in) if key[-1] == "lattice"} == elastic
    assert {key[:-1] for key in keys(built_in)} == by_chain


def test_the_ranges_are_those_of_the_manual(built_in: list[Case]) -> None:
    ratios = values(built_in, "stiffness", "linear_stiffness") / 12.84
    assert ratios == pytest.approx([*10.0 ** np.arange(16), np.inf])
    linearity = values(built_in, "linearity", "force_linearity")
    assert (linearity[0], linearity[-1]) == (0.0, 1.0)
    assert ((linearity > 0.09) & (linearity < 0.12)).sum() >= 3
    strokes = values(built_in, "stroke", "stroke")
    assert strokes[0] == 1e-3
    assert strokes[-1] > 2.0 * 10.75
    hinges = values(built_in, "hinge", "hinge_stiffness")
    assert (hinges[0], hinges[-1]) == (0.0, 1e12)
    lengths = {case.variant.finger.n_units for case in built_in if case.family == "length"}
    assert {1, 64} <= lengths
    assert {c.variant.scale for c in built_in} >= {1e-3, 1.0, 1e3}
    starts = {c.variant.start.strokes for c in built_in if c.family == "guess"}
    assert {0.5, 2.0} <= starts


@pytest.mark.parametrize("name", ["force_linearity", "hinge_stiffness", "stroke"])
def test_folds_are_approached_from_both_sides(built_in: list[Case], name: str) -> None:
    limit = float(getattr(limits(study_finger()), name)[0])
    distances = values((c for c in built_in if c.variant.finger.is_rigid), "fold", name) / limit - 1
    for side in (-1.0, 1.0):
        on_side = side * distances[side * distances > 0.0]
        assert on_side.min() == pytest.approx(1e-12, rel=1e-2)
        assert on_side.max() >= 1e-2


def test_turned_shapes_start_at_every_corner_by_one_unit(built_in: list[Case]) -> None:
    mirror = [case for case in built_in if case.family == "mirror"]
    assert {case.variant.start.corners for case in mirror} == {t[0] for t in FOLDED_STARTS.values()}
    assert {case.variant.finger.n_units for case in mirror} == {1}
    assert not any(case.has_own_guess for case in mirror)


@pytest.mark.parametrize(("n_units", "n_patterns"), [(1, 2), (3, 8), (4, 16), (5, 8), (64, 8)])
def test_of_the_users_finger_all_patterns_are_taken_or_some(n_units: int, n_patterns: int) -> None:
    finger = study_finger().with_units([0] * n_units)
    patterns = {case.pattern for case in cases_of(finger, ["patterns"])}
    assert len(patterns) == n_patterns
    assert {"0" * n_units, "1" * n_units} <= patterns


def test_families_push_the_first_middle_and_last_unit_of_the_users_finger() -> None:
    finger = changed(study_finger().with_units([0] * 8), stroke=np.arange(1.0, 9.0))
    cases = list(cases_of(finger, ["linearity"]))
    assert cases[0].variant.finger.stroke.ravel().tolist() == [1.0, 5.0, 8.0]
    assert [case.subject for case in cases] == ["spec"] * len(cases)


def test_the_fold_is_that_of_the_users_weakest_unit() -> None:
    finger = changed(study_finger(), force_linearity=np.array([0.02, 0.06, 0.04]))
    fingers = [case.variant.finger for case in cases_of(finger, ["fold"])]
    hinges = {f.hinge_stiffness[0, 0] for f in fingers if f.force_linearity[0, 0] != 0.06}
    assert {finger.n_units for finger in fingers} == {1}
    assert hinges == {24.2}


def test_a_rigid_finger_gets_no_lattice_but_with_bars_of_the_gauntlets_own() -> None:
    cases = list(cases_of(rigid(study_finger())))
    elastic = {case.family for case in cases if case.formulation == "lattice"}
    assert elastic == {"stiffness", "guess", "fold", "crossed", "loads"}
    assert len(set(keys(cases))) == len(cases)


def test_the_users_finger_comes_first_and_only_chooses() -> None:
    cases = all_cases(study_finger(), ["scale", "patterns"])
    assert list(dict.fromkeys((c.subject, c.family) for c in cases)) == [
        ("spec", "patterns"),
        ("spec", "scale"),
        ("built-in", "scale"),
    ]


def test_unknown_families_are_named_with_what_there_is() -> None:
    check_families(["patterns", *NAMES])
    with pytest.raises(UsageError, match="stifness: expected some of patterns, stiffness, "):
        check_families(["scale", "stifness"])


def test_a_finger_graded_in_its_lengths_alone_can_be_solved() -> None:
    finger: Finger = changed(study_finger(), segment_length=np.array([13.5, 10.0, 20.0]))
    inverted = np.array([[True], [False], [True]])
    batch = settle(UnitSolutions.of(finger), chain_potential, inverted, 1e-12)
    assert certify(batch, UnitSolutions.of(finger), 1e-12).tolist() == [Status.STABLE]
