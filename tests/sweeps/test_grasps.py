"""Bodies by design: each is what it is by itself."""

from dataclasses import replace

import numpy as np
import pytest

from dpgcli.design.bodies import (
    COMPLIANCE,
    DIAMETER,
    GAP,
    HEIGHT,
    PLACES,
    Body,
    Disc,
    Jaws,
    Polygon,
)
from dpgcli.design.scene import Gripper, Held, Scene
from dpgcli.grasping.table import grasp_rows as rows_of
from dpgcli.grasping.table import grasps
from dpgcli.mechanics.finger import STUDY, uniform_finger
from dpgcli.mechanics.terms import chain_potential
from dpgcli.states.units import UnitSolutions
from dpgcli.sweeps.grasps import Encounter, grasp_columns, grasp_rows

FINGER = uniform_finger(3, **STUDY)
SCENE = Scene(FINGER, (), Gripper(base_spacing=30.0, mounting_angle=0.1), 1.5)
CENTER = np.array([32.0, 0.0])
WEDGE = np.array([[-8.0, 8.0, 8.0], [0.0, -10.0, 10.0]])
CODES = np.arange(8, dtype=np.uint64)


@pytest.mark.parametrize(
    ("body", "key", "column"),
    [
        (Jaws(CENTER, 18.0, 12.0), GAP, [14.0, 18.0, 22.0]),
        pytest.param(Jaws(CENTER, 20.0, 12.0), HEIGHT, [8.0, 16.0], marks=pytest.mark.slow),
        (Jaws(CENTER, 20.0, 12.0), PLACES[1], [0.0, 1.0]),
        pytest.param(Polygon(CENTER, WEDGE), PLACES[0], [28.0, 33.0], marks=pytest.mark.slow),
        pytest.param(Polygon(CENTER, WEDGE), PLACES[1], [0.0, -1.5], marks=pytest.mark.slow),
        (Disc(CENTER, 10.0), PLACES[1], [0.0, -1.5]),
    ],
)
def test_bodies_by_design(body: Body, key: str, column: list[float]) -> None:
    designs = np.repeat(np.arange(len(column)), len(CODES))
    many = body.with_value(key, np.array(column)).take_lanes(designs)
    layer = np.full(len(designs), 1.5)
    angle, spacing = np.full(len(designs), 0.1), np.full(len(designs), 30.0)
    own = Encounter(UnitSolutions.of(FINGER), layer, Gripper(spacing, angle), many, Held.FIXED)
    found = grasp_rows(own, np.tile(CODES, len(column)))
    n_touching = 0
    for place, value in enumerate(column):
        one = body.with_value(key, np.array([value])).take_lanes(np.zeros(1, int))
        alone = _single(one)
        rows = rows_of(grasps(replace(SCENE, body=alone), chain_potential, alone, (CODES, CODES)))
        lanes = slice(place * len(CODES), (place + 1) * len(CODES))
        for column_ in grasp_columns(is_pair=True)[1:]:
            expected, said = rows[column_.name], found[column_.name][lanes]
            if expected.dtype.kind == "f":
                assert said == pytest.approx(expected, abs=1e-9, nan_ok=True), column_.name
            else:
                assert said.astype(expected.dtype).tolist() == expected.tolist(), column_.name
        n_touching += int((rows["n_contacts"] > 0).sum())
    assert n_touching > 0


def test_between_fingers_about_bodies_that_move_nothing_is_known() -> None:
    one, code = Disc(CENTER[:, None], np.array([10.0])), np.array([6], np.uint64)
    gripper = Gripper(np.array([30.0]), np.array([0.1]))
    given = UnitSolutions.of(FINGER), np.array([1.5]), gripper, one
    for held, is_known in ((Held.FIXED, True), (Held.GUIDED, False)):
        rows = grasp_rows(Encounter(*given, held), code)
        assert np.isfinite(rows["between_fingers_N"]).tolist() == [is_known]


@pytest.mark.parametrize(
    ("body", "key"),
    [
        (Disc(CENTER, 10.0), GAP),
        (Jaws(CENTER, 20.0, 12.0), DIAMETER),
        (Polygon(CENTER, WEDGE), COMPLIANCE),
    ],
)
def test_a_body_takes_its_own_keys_only(body: Body, key: str) -> None:
    with pytest.raises(AssertionError, match=key):
        body.with_value(key, np.array([20.0, 25.0]))


def _single(body: Body) -> Body:
    """A batch of one as no batch."""
    center = body.center[:, 0]
    if isinstance(body, Disc):
        return Disc(center, np.asarray(body.radius).item())
    if isinstance(body, Polygon):
        return Polygon(center, body.around)
    return Jaws(center, np.asarray(body.gap).item(), np.asarray(body.height).item())


def test_two_designs_are_not_the_parts_of_a_place() -> None:
    """A size of two designs has the shape of a center."""
    disc = Disc(CENTER, 10.0).with_value("disc.diameter_mm", np.array([10.0, 30.0]))
    found = disc.take_lanes(np.array([1, 0, 1]))
    assert np.asarray(found.radius).tolist() == [15.0, 5.0, 15.0]
    assert found.center.tolist() == [[32.0] * 3, [0.0] * 3]
