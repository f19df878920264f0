"""Domes that only push, with a curve of their own: single rigid units, by scalar equations."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar

from dpgcli.actuation.domes import limits
from dpgcli.actuation.pressed import Halt, Pressed
from dpgcli.actuation.rest import at_rest
from dpgcli.actuation.staircase import Events, driven
from dpgcli.api.pressure import pressed_input
from dpgcli.arrays import Array

pytestmark = pytest.mark.slow

Made = Callable[..., Pressed]
SPEC = """\
finger:
  units: {units}
  calibration: finite_elements
  law: push_only
  linear_stiffness_N_per_mm: .inf
  {more}
  geometry:
    dome_height_mm: 6.5
    dome_thickness_mm: 0.75
    unit_cell_mm: 22
    chamber_length_mm: 9
    channel_width_mm: 10
    limiting_layer_thickness_mm: 1.5
    unit_separation_mm: 3
    elastic_modulus_MPa: 26
{pressure}
"""


@dataclass(frozen=True)
class Unit:
    """One unit between rigid bars, by the extension y of its dome's spring: p(y), MPa.

    The dome pushes P = p A − E', the hinge bears k_θ φ/(H cos(φ/2)) at x = 2H sin(φ/2), and walls
    take w = c_w P, so that y = x + w.
    """

    pressed: Pressed

    def dome(self, y: float) -> float:
        """The pressure at which the dome alone rests."""
        finger = self.pressed.finger
        force = finger.law.pulling.response(np.array([[y]]), finger.domes).force
        return float((force / self.area(y))[0, 0])

    def area(self, y: float) -> float:
        return float(
            self.pressed.volumes.swept(np.array([[y]]), self.pressed.finger.domes).area[0, 0]
        )

    def hinge(self, x: float) -> float:
        """The push that opens the hinge by x, N."""
        finger = self.pressed.finger
        height = finger.segment_height[0, 0]
        turn = 2.0 * np.arcsin(x / (2.0 * height))
        return float(finger.hinge_stiffness[0, 0] * turn / (height * np.cos(turn / 2.0)))

    def touching(self, y: float) -> float:
        """The pressure at which the dome in touch rests."""
        walls = float(self.pressed.finger.wall_compliance[0, 0])
        x = brentq(lambda x: x + walls * self.hinge(x) - y, 0.0, y, xtol=1e-15) if y > 0.0 else y
        return self.dome(y) + self.hinge(x) / self.area(y)


def largest(
    function: Callable[[float], float], start: float, end: float, sign: float = 1.0
) -> float:
    """The largest value between two places, the smallest with sign −1: by a grid, then refined."""
    places = np.linspace(start, end, 400)
    best = int(np.argmax([sign * function(y) for y in places]))
    bounds = places[max(best - 1, 0)], places[min(best + 1, 399)]
    found = minimize_scalar(
        lambda y: -sign * function(y), bounds=bounds, method="bounded", options={"xatol": 1e-10}
    )
    return -sign * float(found.fun)


def first_top(function: Callable[[float], float], start: float, end: float) -> float:
    """The first of the largest values around, by a fine grid."""
    places = np.linspace(start, end, 800)
    values = np.array([function(y) for y in places])
    first = int(np.flatnonzero((values[1:-1] >= values[:-2]) & (values[1:-1] > values[2:]))[0])
    return largest(function, places[first], places[first + 2])


@pytest.fixture
def made(tmp_path: Path) -> Made:
    """A spec's finger under pressure, rigid bars, domes with the curve of finite elements."""

    def of(units: int = 1, walls: float = 0.0, pressure: str = "", **changes: Array) -> Pressed:
        path = tmp_path / "finger.yaml"
        more = f"wall_compliance_mm_per_N: {walls}"
        path.write_text(SPEC.format(units=units, more=more, pressure=pressure))
        pressed = pressed_input(path).pressed
        if not changes:
            return pressed
        units_of = type(pressed.units)
        return Pressed(units_of.of(pressed.finger.changed(**changes)), pressed.volumes)

    return of


def events_of(pressed: Pressed, *targets: float) -> list[tuple[str, float, bool]]:
    """What happens to the first unit: why it stopped, at which pressure, and if it is inverted."""
    n = pressed.finger.n_units
    shapes, _ = at_rest(pressed, np.zeros((n, 1), bool))
    found = []
    for target in targets:
        way = driven(pressed, shapes, np.full((n, 1), target))
        assert way.reason.tolist() == [Halt.ARRIVED]
        found += [_told(event) for event in way.events]
        shapes = way.shapes
    return found


def _told(event: Events) -> tuple[str, float, bool]:
    pressure = float(event.halted.shapes.pressure[0, 0])
    return Halt(event.halted.reason[0]).name, pressure, bool(event.after.inverted[0, 0])


@pytest.mark.parametrize("walls", [0.0, 0.7, 3.0])
def test_a_dome_snaps_by_itself_and_resets_with_the_push_of_its_neighbor(
    made: Made, walls: float
) -> None:
    pressed = made(walls=walls)
    unit, (top, well) = Unit(pressed), _rests(pressed)
    contact = float(pressed.finger.domes.contact[0, 0])
    snap, reset = events_of(pressed, 0.3, -0.3)
    assert (snap[0], snap[2], reset[0], reset[2]) == ("ALONE", True, "FOLD", False)
    assert snap[1] == pytest.approx(largest(unit.dome, 0.1 - contact, top), rel=1e-10)
    assert snap[1] == pytest.approx(0.1495, abs=1e-4)  # the finite elements' own
    assert reset[1] == pytest.approx(largest(unit.touching, 0.0, well, -1.0), rel=1e-10)
    assert reset[1] > largest(unit.dome, 0.0, well, -1.0), "the neighbor's push helps"


def _rests(pressed: Pressed) -> tuple[float, float]:
    top, well = pressed.finger.law.rests(pressed.finger.domes)
    return float(np.ravel(top)[0]), float(np.ravel(well)[0])


@pytest.mark.parametrize(
    ("gap", "walls"),
    [
        (0.2, 0.0),
        (1.5, 0.2),
        *(pytest.param(*p, marks=pytest.mark.slow) for p in ((0.2, 0.2), (1.5, 0.0))),
    ],
)
def test_a_ground_dome_meets_its_neighbor_where_it_has_crossed_the_gap(
    made: Made, gap: float, walls: float
) -> None:
    """u = x + h + s with x = 0: the pressure at which the free dome has travelled the gap."""
    travel = 13.7077958
    stroke = np.array([[travel - gap]])
    pressed = made(walls=walls, stroke=stroke, dome_travel=np.array([[travel]]))
    unit = Unit(pressed)
    assert float(pressed.finger.domes.contact[0, 0]) == pytest.approx(gap, rel=1e-9)
    meets = unit.dome(0.0)
    assert 0.0 < meets < 0.1495
    peak = float(limits(pressed.finger, pressed.volumes).peak[0, 0])
    there, back, again, snap, *_ = events_of(pressed, 0.5 * (meets + 0.149), 0.0, 0.4)
    assert [there[0], back[0], again[0], snap[0]] == ["CONTACT", "RELEASE", "CONTACT", "FOLD"]
    for event in (there, back, again):
        assert event[1] == pytest.approx(meets, rel=1e-11)
    assert snap[1] == pytest.approx(first_top(unit.touching, 0.0, peak + 2.0), rel=1e-10)
    assert snap[1] > 0.14951, "the neighbor holds it back"


def test_going_down_from_a_fold_ends_in_the_next_well(made: Made) -> None:
    """Pushed beyond its samples a dome has small wells: none is stepped over on the way down."""
    travel = 13.7077958
    pressed = made(stroke=np.array([[travel - 1.5]]), dome_travel=np.array([[travel]]))
    unit = Unit(pressed)
    shapes, _ = at_rest(pressed, np.zeros((1, 1), bool))
    folds = [
        event
        for event in driven(pressed, shapes, np.array([[0.4]])).events
        if event.halted.reason[0] == Halt.FOLD
    ]
    assert len(folds) > 3
    for event in folds:
        at, rest = (
            float(pressed.extensions(shape.coordinates)[0, 0])
            for shape in (event.halted.shapes, event.after)
        )
        way = np.linspace(at, rest, 300)
        pressure = float(event.halted.shapes.pressure[0, 0])
        assert max(unit.touching(y) for y in way) <= pressure * (1.0 + 1e-9)
