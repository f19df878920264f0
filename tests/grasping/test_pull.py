"""Units that reset while a body is pulled on: folds against a formulation of their own."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from scipy.linalg import null_space
from scipy.optimize import root

from dpgcli.arrays import Array, Flags
from dpgcli.design.bodies import Body, Disc, Friction, Jaws
from dpgcli.design.scene import Gripper, Scene
from dpgcli.grasping.contact import Obstructed
from dpgcli.grasping.release import opened_by
from dpgcli.grasping.shapes import ContactShapes
from dpgcli.grasping.table import grasp_rows, grasps
from dpgcli.mechanics.finger import STUDY, uniform_finger
from dpgcli.mechanics.terms import chain_potential
from dpgcli.states.certify import Status

CENTER, RADIUS, SPACING, THICKNESS = np.array([24.0, 0.0]), 11.0, 30.0, 1.5
GRIPPER = Gripper(base_spacing=SPACING, mounting_angle=0.0)
CODES = np.array([3], np.uint64)  # 11
OUT = (1.0, 0.0)


def scene(units: int = 2, friction: float = 5.0, **more: Any) -> Scene:
    finger = uniform_finger(units, **STUDY)
    disc, rubs = Disc(CENTER, RADIUS), Friction(friction)
    known: dict[str, Any] = {"body": disc, "friction": rubs, "gravity": OUT, **more}
    return Scene(finger, (), GRIPPER, THICKNESS, **known)


def rows_of(spec: Scene, codes: Array = CODES) -> dict[str, Any]:
    body: Body | None = spec.body
    assert body is not None
    return grasp_rows(grasps(spec, chain_potential, body, (codes, codes)))


class Half:
    """The upper finger, by its corners, how far the disc has come out, and two forces.

    The disc comes out by u along x, with half of the pull; it touches the last side of the face,
    and the place of the side where it did at first does not slide along it. By complex steps, as
    all of `Own`.
    """

    def __init__(self, own: Any, way: float = 1.0) -> None:
        inverted = np.ones((2, 1), bool)
        center = (CENTER[0], CENTER[1] - 0.5 * SPACING)
        self.own = own(uniform_finger(2, **STUDY), inverted, THICKNESS, center, RADIUS)
        self.n, self.share, self.way = 4, 1.0, way

    def place(self, w: Array) -> Array:
        """Of the face, as the disc sees it."""
        start, end = (np.stack((f.x, f.y)) for f in self.own.nodes(w[: self.n])[2][-2:])
        place = start + self.share * (end - start)
        return np.stack((place[0] - w[self.n], place[1]))

    def energy(self, w: Array) -> Array:
        return np.asarray(self.own.energy(w[: self.n]))

    def gap(self, w: Array) -> Array:
        x, y = self.own.center
        moved = replace(self.own, center=(x + w[self.n], y))
        return np.asarray(moved.gaps(w[: self.n])[-1])

    def nearest(self, q: Array) -> float:
        """The share of the last side where it is nearest to the disc."""
        start, end = (np.array([f.x[0], f.y[0]]) for f in self.own.nodes(q[:, None])[2][-2:])
        away = np.array(self.own.center) - start
        share = away @ (end - start) / ((end - start) @ (end - start))
        return float(np.clip(share, 0.0, 1.0))

    def slip(self, w: Array, place: Array) -> Array:
        """Of that place, across the push at which it began."""
        away = place - np.array(self.own.center)
        across = np.array([-away[1], away[0]]) / np.hypot(*away)
        return np.asarray(across @ (self.place(w) - place[:, None]))

    def residual(self, z: Array, pull: float, place: Array) -> Array:
        """Of balance with both held by forces, and of both."""
        w, (push, rub) = z[: self.n + 1], z[self.n + 1 :]
        forces = self.gradients(w, place)
        balance = forces[0] - push * forces[1] - rub * forces[2]
        balance[self.n] -= 0.5 * self.way * pull
        held = [self.gap(w[:, None])[0], self.slip(w[:, None], place)[0]]
        return np.append(balance, held)

    def gradients(self, w: Array, place: Array) -> tuple[Array, Array, Array]:
        functions = (self.energy, self.gap, lambda w: self.slip(w, place))
        return tuple(self.own.gradient(function, w) for function in functions)  # type: ignore[return-value]

    def hessian(self, z: Array, place: Array) -> Array:
        w, (push, rub) = z[: self.n + 1], z[self.n + 1 :]
        parts = (self.energy, self.gap, lambda w: self.slip(w, place))
        whole = [self.own.hessian(part, w) for part in parts]
        return np.asarray(whole[0] - push * whole[1] - rub * whole[2])

    def curvature(self, z: Array, place: Array) -> tuple[Array, Array]:
        """The least one of motions that neither force resists, and that motion."""
        ways = null_space(self.sides(z, place).T)
        values, vectors = np.linalg.eigh(ways.T @ self.hessian(z, place) @ ways)
        return values[0], ways @ vectors[:, 0]

    def touching(self, q: Array) -> Array:
        """Corners, and the push, in balance at a disc that does not move."""

        def residual(y: Array) -> Array:
            w = np.append(y[: self.n], 0.0)
            balance = self.own.gradient(self.energy, w) - y[-1] * self.own.gradient(self.gap, w)
            return np.append(balance[: self.n], self.gap(w[:, None])[0])

        return np.asarray(_solved(residual, np.append(q, 0.5)))

    def begin(self, begin: Array) -> tuple[Array, Array]:
        """Corners, motion and forces when the disc is let go of; and the place that sticks."""
        y = self.touching(begin)
        self.share = self.nearest(y[: self.n])
        w = np.append(y[: self.n], 0.0)
        place = self.place(w[:, None])[:, 0]
        z = np.append(w, (y[-1], 0.0))
        return _solved(lambda z: self.residual(z, 0.0, place), z), place

    def slip_at(self, begin: Array, friction: float, guess: float) -> float:
        """The pull at which friction across the push is all that the push bears."""
        z, place = self.begin(begin)
        for pull in np.linspace(0.0, 0.9 * guess, 5):
            z = _solved(partial(self.residual, pull=pull, place=place), z)

        def residual(y: Array) -> Array:
            push, rub = y[self.n + 1 : -1]
            held = self.residual(y[:-1], y[-1], place)
            return np.append(held, abs(rub) - friction * push)

        return float(_solved(residual, np.append(z, 0.9 * guess))[-1])

    def fold_at(self, begin: Array) -> float:
        """The pull at which the motion that nothing resists costs nothing."""
        z, place = self.begin(begin)
        pull, step, least = 0.0, 0.5, np.inf
        while step > 0.02:
            further = root(self.residual, z, (pull + step, place), tol=1e-13)
            curvature = self.curvature(further.x, place)[0] if further.success else -1.0
            if 0.0 < curvature < least + 1.0:
                z, pull, least = further.x, pull + step, curvature
            else:
                step *= 0.5
        motion = self.curvature(z, place)[1]
        bent, sides = self.hessian(z, place) @ motion, self.sides(z, place)
        shares = np.linalg.lstsq(sides, -bent, rcond=None)[0]

        def at_fold(y: Array) -> Array:
            m = self.n + 3
            z, pull, v, shares = y[:m], y[m], y[m + 1 : -2], y[-2:]
            flat = self.hessian(z, place) @ v + self.sides(z, place) @ shares
            across = self.sides(z, place).T @ v
            return np.concatenate((self.residual(z, pull, place), flat, across, [v @ v - 1.0]))

        found = _solved(at_fold, np.concatenate((z, [pull], motion, shares)))
        return float(found[self.n + 3])

    def sides(self, z: Array, place: Array) -> Array:
        """Gradients of what is held, (size, 2)."""
        return np.stack(self.gradients(z[: self.n + 1], place)[1:], axis=1)


def _solved(residual: Callable[[Array], Array], start: Array) -> Array:
    found = root(residual, start, tol=1e-13)
    assert np.abs(residual(found.x)).max() < 1e-8
    return np.asarray(found.x)


BEGIN = np.full(4, 0.16)  # rad: two units that are open


def test_a_unit_resets_at_the_fold_of_a_finger_by_itself(own: Any) -> None:
    """Half of the gripper, by a formulation of its own, its fold by SciPy's root."""
    rows = rows_of(scene())
    assert (rows["fails_first"][0], rows["touching"][0]) == ("reset", "2")
    assert rows["payload_N"][0] == pytest.approx(Half(own).fold_at(BEGIN), rel=1e-7)


def test_what_is_folded_where_a_unit_resets_bears_nothing_that_is_known(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A shape that no finger can take ends the way, and nothing else does."""

    def folded(own: Obstructed, shapes: ContactShapes) -> Flags:
        return np.ones(shapes.coordinates.shape[1], bool)

    monkeypatch.setattr(Obstructed, "are_folded", folded)
    rows = rows_of(scene())
    assert rows["status"].tolist() == [Status.STABLE]
    assert np.isnan(rows["payload_N"]).all() and rows["fails_first"].tolist() == [""]


@pytest.mark.parametrize("friction", [0.3, 0.6, 1.0])
def test_fingers_that_give_way_slip_where_a_finger_by_itself_does(
    own: Any, friction: float
) -> None:
    """Pushed on towards the base its push falls; or it slips before, by the forces of the grasp."""
    rows = rows_of(scene(friction=friction, gravity=(-1.0, 0.0)))
    assert rows["fails_first"].tolist() == ["slip"]
    x, y = (abs(rows[f"finger_force_{axis}_N"][0]) for axis in "xy")
    by_forces = 2.0 * (friction * y + np.sign(rows["finger_force_x_N"][0]) * x)
    half = Half(own, way=-1.0)
    followed = half.slip_at(BEGIN, friction, rows["payload_N"][0])
    assert rows["payload_N"][0] == pytest.approx(min(by_forces, followed), rel=1e-7)


def test_only_jaws_that_give_way_open() -> None:
    motions = np.array([[1.0, 2.0], [0.5, -0.5]])
    jaws = Jaws(CENTER, gap=20.0, height=40.0)
    assert opened_by(replace(jaws, stiffness=1.0), motions).tolist() == [0.5, -0.5]
    for body in (jaws, Disc(CENTER, RADIUS)):
        assert opened_by(body, motions).tolist() == [0.0, 0.0]


def test_a_body_that_slips_as_it_is_let_go_of_bears_nothing() -> None:
    """Fingers push it towards the base and hardly rub: only a pull that is there would keep it."""
    rows = rows_of(scene(friction=0.05))
    x, y = (abs(rows[f"finger_force_{axis}_N"][0]) for axis in "xy")
    assert x > 0.05 * y > 0.0
    assert rows["payload_N"].tolist() == [0.0] and rows["fails_first"].tolist() == ["slip"]


@pytest.mark.parametrize("gravity", [OUT, (0.0, 1.0)])
def test_a_finger_of_two_by_itself_bears_nothing(gravity: tuple[float, float]) -> None:
    """The upper one rests on the disc, the lower one does not come to it."""
    rows = rows_of(scene(body=Disc(np.array([24.0, 9.0]), 4.0), gravity=gravity))
    assert rows["n_contacts"].tolist() == [1]
    assert rows["payload_N"].tolist() == [0.0] and rows["fails_first"].tolist() == ["slip"]
