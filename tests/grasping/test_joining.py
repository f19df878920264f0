"""Fingers that touch a body and each other: by an energy of its own, by SciPy, and by symmetry."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pytest
from scipy.optimize import NonlinearConstraint, minimize
from shapely import LineString, Point, affinity

from dpgcli.arrays import Array
from dpgcli.design.bodies import Body, Disc, Friction, Jaws, Polygon
from dpgcli.design.pressure import History, Pressure
from dpgcli.design.scene import Gripper, Held, Scene
from dpgcli.grasping import joining
from dpgcli.grasping.approach import Approach, Way
from dpgcli.grasping.closing import Closing, driven
from dpgcli.grasping.contact import Obstructed
from dpgcli.grasping.frames import frames
from dpgcli.grasping.shapes import ContactShapes
from dpgcli.grasping.table import BETWEEN, Grasps, columns_of, grasp_rows, grasps
from dpgcli.mechanics.finger import STUDY, Finger, uniform_finger
from dpgcli.mechanics.laws import PUBLISHED, PushOnly
from dpgcli.mechanics.pressure import DomeVolumes
from dpgcli.mechanics.terms import chain_potential
from dpgcli.states.certify import Status
from dpgcli.states.patterns import codes_of

Fingers = Callable[..., Finger]
THICKNESS = 1.5
AREA = 31.61  # mm², of the study's dome: it snaps at 0.1495 MPa


def codes(*patterns: str) -> Any:
    return codes_of(np.array([[digit == "1" for digit in text] for text in patterns]).T)


class Drawn:
    """A random finger, two patterns of it, a gripper, and a disc in the way of one of both."""

    def __init__(self, seed: int) -> None:
        random = np.random.default_rng(700 + seed)
        n = self.n = int(random.integers(2, 4))
        values = {name: value * random.uniform(0.9, 1.1, (n, 1)) for name, value in STUDY.items()}
        values["segment_height"] = values["segment_height"][:1]
        values["force_linearity"] = random.uniform(0.02, 0.04, (n, 1))
        bars = np.array([[(1e3, 1e4, np.inf)[seed % 3]]])
        finger = Finger(n, **values, linear_stiffness=bars)
        self.finger = finger.changed(wall_compliance=np.array([[0.6 if seed % 2 else 0.0]]))
        drawn = (random.choice(["0", "1"], n, p=[0.3, 0.7]) for _ in range(99))
        self.patterns = list(dict.fromkeys("".join(digits) for digits in drawn))[:2]
        self.gripper = Gripper(
            random.uniform(8.0, 16.0) + 4.0 * (n - 2), random.uniform(-0.35, -0.05)
        )
        bare = Scene(self.finger, (), self.gripper, THICKNESS)
        met = grasps(bare, chain_potential, None, [codes(text) for text in self.patterns])
        upper = int(random.integers(2))
        face = frames(self.gripper)[upper].placed(met.take(upper, 0)[0].face)[..., 0]
        side, share = int(random.integers(n - 1)), random.uniform(0.1, 0.9)
        along = face[:, side + 1] - face[:, side]
        inwards = np.array([along[1], -along[0]]) / np.hypot(*along) * (1 - 2 * upper)
        self.radius, self.deep = random.uniform(1.0, 5.0), random.uniform(0.05, 0.3)
        middle = face[:, side] + share * along + (self.radius - self.deep) * inwards
        self.disc = Disc(middle, self.radius)

    @property
    def scene(self) -> Scene:
        return Scene(self.finger, (), self.gripper, THICKNESS, body=self.disc)


class Both:
    """Two fingers in a gripper and a disc: energy and gaps by interleaved coordinates.

    Cells are sides of the upper face and the disc, then the lower one's; behind them nodes of one
    finger and sides of the other, whose end counts, as the package numbers them.
    """

    def __init__(self, own: Any, drawn: Drawn, inverted: Any) -> None:
        self.drawn, self.n = drawn, drawn.n
        parts = np.reshape(inverted, (2, -1))
        self.own = [own(drawn.finger, part, THICKNESS, (0.0, 0.0), 1.0) for part in parts]

    def energy(self, q: Array) -> Array:
        """Of both, N mm, (batch,)."""
        return np.asarray(sum(one.energy(q[f::2]) for f, one in enumerate(self.own)))

    def outline(self, finger: int, q: Array) -> list[Any]:
        """The nodes of the face and the end's, x and y, in the gripper's frame."""
        base, top, face = self.own[finger].nodes(q[finger::2])
        x, y = top[-1].x - base[-1].x, top[-1].y - base[-1].y
        share = float(self.drawn.finger.segment_height[0, 0]) / np.sqrt(x**2 + y**2)
        end = base[-1].x + share * x, base[-1].y + share * y
        gripper, side = self.drawn.gripper, 1.0 - 2.0 * finger
        cos, sin, half = np.cos(gripper.mounting_angle), np.sin(gripper.mounting_angle), 0.5
        return [
            (cos * x - sin * y, side * (sin * x + cos * y + half * gripper.base_spacing))
            for x, y in [*face, end]
        ]

    def gap(self, cell: int, q: Array) -> Array:
        """How far the disc is from a side, or a node on the inner side of one, mm, (batch,)."""
        finger, side = divmod(cell, self.n)
        if finger < 2:
            point, radius = self.drawn.disc.center, self.drawn.radius
            return self._distance(finger, side, q, point) - radius
        finger, rest = divmod(cell - 2 * self.n, (self.n + 1) * (self.n + 2))
        node, side = divmod(rest, self.n + 1)
        return self._distance(finger, side, q, self.outline(1 - finger, q)[node])

    def _distance(self, finger: int, side: int, q: Array, point: Any) -> Array:
        """Of a point from the line of a side, or from its end that is nearest."""
        (x0, y0), (x1, y1) = self.outline(finger, q)[side : side + 2]
        dx, dy, px, py = x1 - x0, y1 - y0, point[0] - x0, point[1] - y0
        length = np.sqrt(dx**2 + dy**2)
        share = (px * dx + py * dy) / length**2
        ends = np.where(share.real < 0.0, 0.0, 1.0)
        around = np.sqrt((px - ends * dx) ** 2 + (py - ends * dy) ** 2)
        line = (1.0 - 2.0 * finger) * (dy * px - dx * py) / length
        return np.asarray(np.where((share.real < 0.0) | (share.real > 1.0), around, line))

    def gaps(self, cells: Any, q: Array) -> Array:
        """The same of some cells, (cell, batch)."""
        return np.stack([self.gap(int(cell), q) for cell in cells])

    def lines(self, q: Array) -> list[list[tuple[float, float]]]:
        """Faces with their ends."""
        outlines = (self.outline(finger, q[:, None]) for finger in range(2))
        return [[(float(x[0]), float(y[0])) for x, y in line] for line in outlines]


class Found(NamedTuple):
    """What the package found, and both fingers by the definitions of these tests."""

    grasps: Grasps
    both: Both
    q: Array
    push: Array
    unit: Array
    joint: Obstructed
    shapes: ContactShapes

    @property
    def cells(self) -> Any:
        return np.flatnonzero(self.push > 0.0)

    def gradient(self, function: Callable[[Array], Array], q: Array | None = None) -> Array:
        return np.asarray(self.both.own[0].gradient(function, self.q if q is None else q))

    def taken(self, finger: int) -> tuple[Any, int]:
        return self.grasps.take(finger, 0)


def through(finger: Finger, *pressures: float) -> Closing:
    """All units on one line, from no pressure through these, MPa."""
    n = finger.n_units
    line = Pressure(("A",), np.zeros(n, int), np.array([[AREA]]), None)
    volumes, history = DomeVolumes(np.full((n, 1), AREA)), History(np.array(pressures)[:, None])
    return Closing(volumes, line, history)


def joined(drawn: Drawn, own: Any, peak: float | None = None) -> Found:
    """What becomes of a pair, which touches the disc and each other; it may close on it."""
    kept: list[Any] = []
    whole = joining.described

    def watched(own: Any, texts: Any, came: Any, *rest: Any) -> Any:
        kept.append((own, own.relabeled(came.shapes)))
        return whole(own, texts, came, *rest)

    pair = [codes(text) for text in drawn.patterns]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(joining, "described", watched)
        by = None if peak is None else through(drawn.finger, peak, 0.0)
        way = Way.PLACE if by is None else Way.CLOSE
        found = grasps(drawn.scene, chain_potential, drawn.disc, pair, way, by)
    (joint, shapes), rows = kept[-1], grasp_rows(found)
    assert rows["status"].tolist() == [Status.STABLE]
    assert rows["n_contacts"][0] > 0 and rows["between_fingers_N"][0] > 0.0
    assert peak is None or (rows["events"][0] != "") == (peak > 0.15), "they snap"
    lengths = joint.potentials(shapes.inverted)[0].coordinates.force_unit
    unit = np.repeat(np.broadcast_to(lengths, (joint.n_own // 2, 1))[:, 0], 2)
    both = Both(own, drawn, shapes.inverted[:, 0])
    push = np.where(shapes.push[:, 0] > 1e-12, shapes.push[:, 0], 0.0)
    return Found(found, both, shapes.coordinates[:, 0], push, unit, joint, shapes)


QUICK = (2, 6)
PRESSED = (
    *QUICK,
    0,
    3,
    4,
    5,
    *range(8, 14),
    15,
    17,
    18,
    19,
    20,
    22,
    23,
    24,
    26,
    29,
    41,
    44,
    46,
    47,
    48,
)
CLOSED = [(2, 0.2), (2, 0.04), (10, 0.2)]
SEEDS = [pytest.param(s, marks=[] if s in QUICK else pytest.mark.slow, id=str(s)) for s in PRESSED]
SEEDS += [
    pytest.param(c, marks=[] if c == CLOSED[0] else pytest.mark.slow, id=f"{c[0]} at {c[1]}")
    for c in CLOSED
]


@pytest.fixture(scope="module", params=SEEDS)
def found(request: Any, own: Any) -> Found:
    seed, *peak = np.ravel(request.param)
    return joined(Drawn(int(seed)), own, *peak)


def test_they_balance_without_penetration(found: Found) -> None:
    cells, both, disc = found.cells, found.both, found.both.drawn.disc
    gaps = both.gaps(cells, found.q[:, None])[:, 0]
    assert cells.min() < 2 * both.n <= cells.max(), "a disc's and a finger's"
    assert np.abs(gaps).max() <= 1e-9 and np.abs(gaps * found.push[cells]).max() <= 1e-9
    slopes = found.gradient(lambda q: both.gaps(cells, q))
    rest = found.gradient(both.energy) - found.push[cells] @ slopes
    assert np.abs(rest / found.unit).max() <= 1e-9, "N"
    upper, lower = both.lines(found.q)
    assert LineString(upper).distance(LineString(lower)) <= 1e-9
    assert not affinity.translate(LineString(upper), 0.0, 1e-8).intersects(LineString(lower))
    for line in (upper, lower):
        assert Point(*disc.center).distance(LineString(line[:-1])) >= disc.radius - 1e-9


def test_action_is_reaction_and_moments_balance(found: Found) -> None:
    """Places and pushes that are told turn each finger about its base as its first corner does.

    What the first side is pushed with the clamped node bears a share of.
    """
    seen = frames(found.both.drawn.gripper)
    by_upper, by_lower = (
        frame.outside(found.taken(number)[0].between.force)[:, found.taken(number)[1]]
        for number, frame in enumerate(seen)
    )
    assert by_upper == pytest.approx(-by_lower, abs=1e-12) and np.hypot(*by_upper) > 0.0
    rows = grasp_rows(found.grasps)
    assert rows["between_fingers_N"][0] == pytest.approx(np.hypot(*by_upper), rel=1e-12)
    forces = []
    for number, one in enumerate(found.both.own):
        finger, lane = found.taken(number)
        corner = int(one.finger.has_walls) + int(not one.finger.is_rigid)  # behind v and e
        moment = 0.0
        for part in finger.pushes:
            places, ways = (values[..., lane] for values in part.touches)
            force = -ways * part.push[:, lane]
            start, end = finger.face[:, :2, lane].T
            share = (end - start) @ (places - start[:, None]) / ((end - start) @ (end - start))
            off = start[:, None] + share * (end - start)[:, None] - places
            at_clamp = np.where((np.hypot(*off) < 1e-9) & (share < 1.0), 1.0 - share, 0.0)
            moment += (places[0] * force[1] - places[1] * force[0]).sum()
            moment -= (at_clamp * (start[0] * force[1] - start[1] * force[0])).sum()
        by_corner = one.gradient(one.energy, found.q[number::2])[corner]
        assert by_corner == pytest.approx(-moment, abs=1e-9), "N mm"
        forces.append(seen[number].outside(finger.force)[:, lane])
    assert rows["squeeze_N"][0] == pytest.approx(0.5 * (forces[1][1] - forces[0][1]), abs=1e-12)
    assert rows["finger_force_x_N"][0] == pytest.approx(forces[0][0], abs=1e-9), "on the disc"


def test_they_are_minima_on_the_tangent_space(found: Found) -> None:
    cells, push, both = found.cells, found.push[found.cells], found.both
    slopes = found.gradient(lambda q: both.gaps(cells, q))
    tangent = np.linalg.svd(slopes.T / found.unit[:, None])[0][:, len(cells) :]

    def lagrangian(q: Array) -> Array:
        return np.asarray(both.energy(q) - push @ both.gaps(cells, q))

    hessian = both.own[0].hessian(lagrangian, found.q) / found.unit / found.unit[:, None]
    assert np.linalg.eigvalsh(tangent.T @ hessian @ tangent).min() > 1e-3, "N/mm"


def test_slsqp_finds_the_same_minima(found: Found, slsqp: Any) -> None:
    both, unit = found.both, found.unit

    def gaps(q: Array) -> Array:
        return both.gaps(found.cells, q)

    best = slsqp(both.energy, gaps, found.gradient, found.q, unit)
    assert best.x / unit == pytest.approx(found.q, abs=2e-5)
    assert best.fun == pytest.approx(float(both.energy(found.q[:, None])[0]), rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("seed", PRESSED[:3])
def test_trust_constr_finds_the_same_minima(seed: int, own: Any) -> None:
    found = joined(Drawn(seed), own)
    both, unit, cells, tool = found.both, found.unit, found.cells, found.both.own[0]

    def curvature(function: Callable[[Array], Array], z: Array) -> Array:
        return np.asarray(tool.hessian(function, z / unit) / unit / unit[:, None])

    gaps = NonlinearConstraint(
        lambda z: both.gaps(cells, (z / unit)[:, None])[:, 0],
        0.0,
        np.inf,
        jac=lambda z: found.gradient(lambda q: both.gaps(cells, q), z / unit) / unit,
        hess=lambda z, v: curvature(lambda q: v @ both.gaps(cells, q), z),
    )
    best = minimize(
        lambda z: float(both.energy((z / unit)[:, None])[0]),
        found.q * unit + np.random.default_rng(2).normal(0.0, 0.02, len(unit)),
        jac=lambda z: found.gradient(both.energy, z / unit) / unit,
        hess=lambda z: curvature(both.energy, z),
        constraints=gaps,
        method="trust-constr",
        options={"gtol": 1e-9, "xtol": 1e-12, "maxiter": 600},
    )
    assert best.x / unit == pytest.approx(found.q, abs=2e-5)


def driven_on(found: Found, pressures: Array) -> list[ContactShapes]:
    """Shapes of a pair at these pressures, MPa, reached one after the other without an event."""
    steps = np.broadcast_to(pressures[:, None, None], (len(pressures), found.both.n, 1))
    start = Approach(found.shapes, np.ones(1), ())
    volumes = through(found.both.drawn.finger, 0.0).volumes
    came = driven(found.joint, start, volumes, steps)
    assert not came.resets and all(stop.is_there.all() for stop in came.stops)
    return [found.joint.relabeled(stop) for stop in came.stops[1:]]


def swept(both: Both, q: Array) -> Array:
    """What domes sweep, mm³, (batch,)."""
    extensions = (one.extensions(q[finger::2]) for finger, one in enumerate(both.own))
    return np.asarray(AREA * sum(sum(own) for own in extensions))


@pytest.mark.parametrize("seed", [2, pytest.param(11, marks=pytest.mark.slow)])
def test_under_pressure_they_balance_and_pay_for_what_they_do(
    seed: int, own: Any, slsqp: Any
) -> None:
    """Optimality, SciPy's minimum at a pressure, and dΠ = −ΣA x dp from one to another."""
    found, pressures = joined(Drawn(seed), own), np.linspace(0.01, 0.05, 21)
    both, unit = found.both, found.unit
    shapes = driven_on(found, pressures)
    q, push = shapes[-1].coordinates[:, 0], shapes[-1].push[:, 0]
    cells = np.flatnonzero(push > 1e-12)
    assert cells.min() < 2 * both.n <= cells.max(), "a disc's and a finger's"
    gaps = both.gaps(cells, q[:, None])[:, 0]
    assert np.abs(gaps).max() <= 1e-9

    def energy(q: Array, p: float = pressures[-1]) -> Array:
        return np.asarray(both.energy(q) - p * swept(both, q))

    def of_cells(q: Array) -> Array:
        return both.gaps(cells, q)

    rest = found.gradient(energy, q) - push[cells] @ found.gradient(of_cells, q)
    assert np.abs(rest / unit).max() <= 1e-9, "N"
    best = slsqp(energy, of_cells, found.gradient, q, unit)
    assert best.x / unit == pytest.approx(q, abs=2e-5)
    volumes = [float(swept(both, there.coordinates)[0]) for there in shapes]
    first, last = (float(energy(shapes[k].coordinates, pressures[k])[0]) for k in (0, -1))
    weights = np.array([1.0, *[4.0, 2.0] * 9, 4.0, 1.0]) / 3.0 * 0.002  # Simpson
    assert last - first == pytest.approx(-weights @ volumes, rel=1e-8)
    assert abs(last - first) > 0.1


EVERY = np.arange(8, dtype=np.uint64)
ON_AXIS = Disc(np.array([10.0, 0.0]), 12.0)
FAR = Disc(np.array([400.0, 0.0]), 5.0)
GIVES_WAY = Gripper(2.095335672462368, 0.28275180489860696), "1011/1011"
WEDGE = np.array([[-5.0, 5.0, 5.0, -5.0], [-10.0, -12.0, 12.0, 10.0]])


def rows_of(finger: Finger, gripper: Gripper, body: Body | None, *pairs: str) -> Any:
    """The table of these pairs, or of all mirrored ones."""
    scene = Scene(finger, (), gripper, THICKNESS, body=body)
    halves = zip(*(text.split("/") for text in pairs), strict=True)
    both = [codes(*own) for own in halves] if pairs else [EVERY, EVERY]
    return grasp_rows(grasps(scene, chain_potential, body, both))


@pytest.mark.slow
def test_mirrored_pairs_are_minima(
    reference_finger: Fingers, own: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of half of the energy: each finger against the disc and the axis, by SLSQP."""
    finger, gripper = reference_finger(3), Gripper(25.0, 0.0)
    kept: list[Any] = []
    whole = joining.bearing_sideways

    def watched(found: Any, own: Any, came: Any) -> Any:
        kept.append((own, own.relabeled(came.shapes)))
        return whole(found, own, came)

    monkeypatch.setattr(joining, "bearing_sideways", watched)
    rows = rows_of(finger, gripper, ON_AXIS)
    (obstructed, shapes), *others = kept
    pressed = rows["between_fingers_N"] > 0.0
    assert not others and rows["pattern"][pressed].tolist() == ["110", "111"]
    assert (rows["n_contacts"][pressed] == 2).all() and (rows["overlaps"] == 0).all()
    for lane in range(2):
        inverted, q = shapes.inverted[:, lane], shapes.coordinates[:, lane]
        one = own(finger, inverted, THICKNESS, (10.0, -12.5), 12.0)

        def gaps(q: Array, one: Any = one) -> Array:
            base, top, face = one.nodes(q)
            return np.stack([*one.gaps(q), *(y + 12.5 for _, y in [*face[1:], _end(base, top)])])

        pulled, slopes = one.gradient(one.energy, q), one.gradient(gaps, q)
        push = shapes.push[:, lane]
        unit = obstructed.potentials(shapes.inverted)[0].coordinates.force_unit[:, 0]
        assert np.abs((pulled - push @ slopes) / unit).max() <= 1e-9, "N"
        at = gaps(q[:, None])[:, 0]
        assert at.min() >= -1e-9 and np.abs(at * push).max() <= 1e-9 and (push > 0.0).sum() == 2
        best = minimize(
            lambda z, one=one, unit=unit: float(one.energy((z / unit)[:, None])[0]),
            q * unit + np.random.default_rng(3).normal(0.0, 0.02, len(q)),
            jac=lambda z, one=one, unit=unit: one.gradient(one.energy, z / unit) / unit,
            constraints={
                "type": "ineq",
                "fun": lambda z, gaps=gaps, unit=unit, on=push > 0.0: gaps((z / unit)[:, None])[
                    on, 0
                ],
                "jac": lambda z, gaps=gaps, unit=unit, one=one, on=push > 0.0: (
                    one.gradient(gaps, z / unit)[on] / unit
                ),
            },
            method="SLSQP",
            options={"ftol": 1e-14, "maxiter": 500},
        )
        assert best.x / unit == pytest.approx(q, abs=2e-5)
        assert rows["between_fingers_N"][pressed][lane] == pytest.approx(push[3:].sum(), abs=1e-9)


def _end(base: Any, top: Any) -> Any:
    x, y = top[-1].x - base[-1].x, top[-1].y - base[-1].y
    share = STUDY["segment_height"] / np.sqrt(x**2 + y**2)
    return base[-1].x + share * x, base[-1].y + share * y


@pytest.mark.parametrize(
    "body", [Jaws(np.array([10.0, 0.0]), 24.0, 8.0), Polygon(np.array([10.0, 0.0]), WEDGE)]
)
def test_straight_bodies_are_touched_as_well(body: Body, reference_finger: Fingers) -> None:
    rows = rows_of(reference_finger(3), Gripper(25.0, 0.0), body)
    both = (rows["between_fingers_N"] > 0.0) & (rows["n_contacts"] > 0)
    assert (rows["status"] == Status.STABLE).all() and both.any() and not rows["overlaps"].any()
    assert np.nanmax(rows["penetration_mm"]) <= 1e-9 and np.nanmax(rows["residual_N"]) <= 1e-9


@pytest.mark.parametrize("y", [0.0, 1.0])
def test_a_disc_out_of_reach_is_none(y: float, reference_finger: Fingers) -> None:
    """On the axis or off it: also a pair that gives way to one side, and resets."""
    finger, gripper = reference_finger(3), Gripper(25.0, 0.0)
    far = Disc(np.array([400.0, y]), 5.0)
    pairs = ("111/111", "110/110", "011/110", "110/011", "111/101", "000/000")
    alone, beside = (rows_of(finger, gripper, body, *pairs) for body in (None, far))
    assert (beside["n_contacts"] == 0).all() and (alone["n_contacts"] > 0).sum() == 3
    for name in ("status", "pattern_after", "overlaps"):
        assert beside[name].tolist() == alone[name].tolist(), name
    assert beside["aperture_mm"] == pytest.approx(alone["aperture_mm"], abs=1e-9)
    between = np.hypot(alone["finger_force_x_N"], alone["finger_force_y_N"])
    assert beside["between_fingers_N"] == pytest.approx(between, abs=1e-9)
    assert (beside["squeeze_N"] == 0.0).all() and (beside["max_contact_N"] == 0.0).all()
    told = [text.replace(" of coming together", "") for text in beside["resets"]]
    assert told == alone["resets"].tolist()


def test_only_fingers_that_overlap_come_together(
    reference_finger: Fingers, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Far apart nobody does."""
    n_lanes: list[int] = []
    for name in ("_mirrored", "_paired"):
        whole = getattr(joining, name)

        def counted(*args: Any, _whole: Any = whole) -> Any:
            found = _whole(*args)
            n_lanes.append(len(found.rows))
            return found

        monkeypatch.setattr(joining, name, counted)
    finger = reference_finger(3)
    rows_of(finger, Gripper(100.0, 0.0), FAR)
    assert n_lanes == []
    rows = rows_of(finger, Gripper(25.0, 0.0), FAR, "111/111", "000/000", "110/111", "001/000")
    assert n_lanes == [1, 1]
    scene = Scene(finger, (), Gripper(25.0, 0.0), THICKNESS, body=FAR)
    pairs = codes("111", "000", "110", "001"), codes("111", "000", "111", "000")
    assert joining.n_overlapping(scene, chain_potential, pairs) == 1, "that is no mirrored one"
    assert (rows["between_fingers_N"] > 0.0).tolist() == [True, False, True, False]


@pytest.mark.slow
def test_swapped_fingers_have_mirrored_forces(reference_finger: Fingers) -> None:
    finger, gripper = reference_finger(3), Gripper(25.0, 0.0)
    one = rows_of(finger, gripper, Disc(np.array([10.0, 0.3]), 11.8), "111/110")
    other = rows_of(finger, gripper, Disc(np.array([10.0, -0.3]), 11.8), "110/111")
    assert one["between_fingers_N"][0] > 0.1 and one["n_contacts"].tolist() == [2]
    for name in ("squeeze_N", "between_fingers_N", "max_contact_N", "margin", "aperture_mm"):
        assert one[name] == pytest.approx(other[name], rel=1e-9), name
    assert one["touching"].tolist() == other["touching"].tolist()


def test_a_body_keeps_mirrored_pairs_from_giving_way(reference_finger: Fingers) -> None:
    """They are marginal by giving way to one side alone, as in `test_meeting`."""
    gripper, pair = GIVES_WAY
    finger, touched = reference_finger(4, np.inf), Disc(np.array([30.0, 0.0]), 4.74)
    away, kept = (rows_of(finger, gripper, body, pair) for body in (FAR, touched))
    assert away["status"].tolist() == [Status.MARGINAL]
    assert np.isnan(away["between_fingers_N"]).all()
    assert kept["status"].tolist() == [Status.STABLE] and kept["n_contacts"].tolist() == [2]
    assert kept["between_fingers_N"][0] > 0.1


@pytest.mark.parametrize(
    ("law", "half"),
    [
        (PUBLISHED, 12.0),
        (PUBLISHED, 4.0),
        pytest.param(PushOnly(PUBLISHED), 12.0, marks=pytest.mark.slow),
    ],
)
def test_mirrored_pairs_close_as_on_a_plate_at_their_axis(
    law: Any, half: float, graded_finger: Fingers
) -> None:
    """Events, states and forces; the wider ones only meet under pressure, and part again."""
    finger = replace(graded_finger(3, 5, force_linearity=0.03), law=law)
    by = through(finger, 0.25, 0.0)
    scene = Scene(finger, (), Gripper(2.0 * half, 0.0), THICKNESS, body=FAR)
    pair = codes("000"), codes("000")
    rows = grasp_rows(grasps(scene, chain_potential, FAR, pair, Way.CLOSE, by))
    corners = np.array([[-5.0, 90.0, 90.0, -5.0], [-half - 9.0, -half - 9.0, -half, -half]])
    plate = Polygon(np.zeros(2), corners)
    alone = Scene(finger, (), None, THICKNESS, body=plate)
    other = grasp_rows(grasps(alone, chain_potential, plate, [codes("000")], Way.CLOSE, by))
    assert rows["events"][0] == other["events"][0] != ""
    assert rows["pattern_after"].tolist() == other["pattern_after"].tolist()
    assert rows["between_fingers_N"] == pytest.approx(-other["finger_force_y_N"], abs=1e-9)
    assert rows["status"].tolist() == [Status.STABLE] and not rows["overlaps"].any()


@pytest.mark.slow
def test_a_pair_that_closes_is_the_mirror_image_of_the_other(reference_finger: Fingers) -> None:
    finger = reference_finger(3)
    by, rows = through(finger, 0.05, 0.0), []
    for y, pair in ((0.3, ("111", "110")), (-0.3, ("110", "111"))):
        disc = Disc(np.array([10.0, y]), 11.8)
        scene = Scene(finger, (), Gripper(25.0, 0.0), THICKNESS, body=disc)
        both = [codes(text) for text in pair]
        rows.append(grasp_rows(grasps(scene, chain_potential, disc, both, Way.CLOSE, by)))
    one, other = rows
    assert one["between_fingers_N"][0] > 0.01 and one["status"].tolist() == [Status.STABLE]
    for name in ("squeeze_N", BETWEEN, "max_contact_N", "aperture_mm"):
        assert one[name] == pytest.approx(other[name], rel=1e-9), name
    after = [rows["pattern_after"][0].split("/") for rows in (one, other)]
    assert after[0] == after[1][::-1]


def test_bodies_that_move_leave_fingers_to_pass(reference_finger: Fingers) -> None:
    """The tables have no column that says otherwise."""
    scene = Scene(reference_finger(3), (), Gripper(25.0, 0.0), THICKNESS, body=ON_AXIS)
    for other in (replace(scene, held=Held.FREE), replace(scene, body=None)):
        assert BETWEEN not in {column.name for column in columns_of(other, None)}
    assert BETWEEN in {column.name for column in columns_of(scene, None)}


@pytest.mark.slow
def test_payloads_beside_other_fingers(reference_finger: Fingers) -> None:
    """A pair that is no mirror image bears something; of a mirrored one it is not known."""
    finger, gripper = reference_finger(3), Gripper(25.0, 0.0)
    scene = Scene(finger, (), gripper, THICKNESS, body=ON_AXIS, friction=Friction(0.5, None))
    pairs = codes("111", "111"), codes("111", "110")
    rows = grasp_rows(grasps(scene, chain_potential, ON_AXIS, pairs))
    assert (rows["between_fingers_N"] > 0.0).all()
    assert np.isnan(rows["payload_N"]).tolist() == [True, False] and rows["payload_N"][1] > 0.0
    assert rows["fails_first"].tolist()[0] == "" and rows["fails_first"][1] in {"slip", "reset"}


@pytest.mark.parametrize("scale", [1.0, 1e-10])
def test_overlaps_are_counted_in_a_world_of_any_size(scale: float) -> None:
    """All lengths a share, with the same moduli: fingers overlap as they did."""
    values: dict[str, Any] = {name: scale * value for name, value in STUDY.items()}
    values["force_linearity"] = STUDY["force_linearity"]
    values["hinge_stiffness"] = scale**3 * STUDY["hinge_stiffness"]
    finger = uniform_finger(2, **values)
    gripper = Gripper(base_spacing=8.0 * scale, mounting_angle=0.0)
    disc = Disc(np.array([100.0, 0.0]) * scale, scale)
    scene = Scene(finger, (), gripper, scale * THICKNESS, body=disc)
    pairs = codes("11", "00"), codes("01", "01")
    assert joining.n_overlapping(scene, chain_potential, pairs) == 1
