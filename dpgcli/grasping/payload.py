"""The payload of a grasp: the largest pull on the body that friction at its contacts bears.

Contact forces of a grasp are without friction: N at each place, along d. When what holds the body
lets go and a pull P along g comes, the force at a place may be any in the triangle n d + t e with
0 ≤ n ≤ N and |t| ≤ μ n, e across d: no place pushes harder than in the grasp. The largest P for
which they balance it, force and moment, is a linear program. Its answer in closed form (ours): the
sum of the triangles is a convex body in (F_x, F_y, M) which planes bound whose normals v are
across two of the triangles' sides (Ziegler, Lectures on Polytopes, 1995, section 7), so that

    P = min Σ max(0, N (v·d + μ |v·e|)) / −v·g   over v with v·g < 0.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from dpgcli.arrays import Array, Indices, total
from dpgcli.grasping.frames import FingerFrame
from dpgcli.mechanics.gaps import Touches

SLACK = 1e-10  # of the pushes: what forces may be out of balance, which is rounding
NOTHING = 1e-7  # of the pushes: a smaller payload is slack
NUMBERS = 2**20  # that are worked on at once


class Contacts(NamedTuple):
    """Pushes on bodies, (place, lane) N, where they are (mm) and which way, (2, place, lane).

    Places without a push count for nothing.
    """

    push: Array
    places: Array
    directions: Array

    @classmethod
    def of(cls, push: Array, touches: Touches) -> "Contacts":
        """Those of a finger, in its own frame."""
        return cls(push, *touches).pressed

    @classmethod
    def joined(cls, parts: Sequence["Contacts"]) -> "Contacts":
        """Those of several fingers on one body."""
        push, *others = zip(*parts, strict=True)
        places, directions = (np.concatenate(values, axis=1) for values in others)
        return cls(np.concatenate(push), places, directions).pressed

    @property
    def pressed(self) -> "Contacts":
        """As many places as the lane needs that has most of them."""
        n = int((self.push > 0.0).sum(axis=0).max(initial=0))
        first = np.argsort(-self.push, axis=0, kind="stable")[:n]
        places, directions = (np.take_along_axis(v, first[None], axis=1) for v in self[1:])
        return Contacts(np.take_along_axis(self.push, first, axis=0), places, directions)

    def take_lanes(self, index: Indices | slice) -> "Contacts":
        """Those of some lanes."""
        return Contacts(*(values[..., index] for values in self))

    def about(self, frame: FingerFrame, points: Array, opened: Array) -> "Contacts":
        """Those of a finger in the gripper's frame, its places counted from points, (2, lane).

        Jaws have `opened` by (lane,) mm since the places are told of.
        """
        x, y = frame.placed(self.places) - points[:, None]
        raised = np.stack((x, y + 0.5 * frame.side * opened))
        return Contacts(self.push, raised, frame.outside(self.directions))


def payloads(contacts: Contacts, friction: float | Array, gravity: tuple[float, float]) -> Array:
    """The largest pulls along gravity at the origin that friction bears, (lane,), N.

    >>> both = np.array([[1.0, -1.0], [0.0, 0.0]])  # two places that push along x
    >>> fingers = Contacts(np.full((2, 1), 3.0), -10.0 * both[..., None], both[..., None])
    >>> payloads(fingers, 0.5, (0.0, -1.0)).round(6).tolist()  # 2 μ N
    [3.0]
    """
    n_places, n_lanes = contacts.push.shape
    coefficient = np.broadcast_to(friction, n_lanes)
    found, n_sides = np.zeros(n_lanes), 3 * n_places + 3
    if not n_places:
        return found
    at_once = max(NUMBERS // (n_sides**2 * n_places), 1)
    for first in range(0, n_lanes, at_once):
        some = slice(first, first + at_once)
        found[some] = _payloads(contacts.take_lanes(some), coefficient[some], gravity)
    return found


def _payloads(contacts: Contacts, coefficient: Array, gravity: tuple[float, float]) -> Array:
    push, whole = contacts.push, total(contacts.push)
    across = np.stack((-contacts.directions[1], contacts.directions[0]))
    along, beside = _wrenches(contacts, contacts.directions), _wrenches(contacts, across)
    normals = _normals(along, coefficient * beside)
    slack = SLACK * whole * total(np.abs(normals))
    bound = np.full(len(whole), np.inf)
    by_friction = coefficient * np.abs(_products(normals, beside))
    for side in (1.0, -1.0):
        reach = push * (side * _products(normals, along) + by_friction)
        against = -side * (gravity[0] * normals[0] + gravity[1] * normals[1])
        most = total(np.moveaxis(np.maximum(reach, 0.0), 1, 0)) + slack
        share = most / np.where(against > 0.0, against, 1.0)
        bound = np.minimum(bound, np.where(against > 0.0, share, np.inf).min(axis=0))
    return np.where(bound > NOTHING * whole, bound, 0.0)


def _wrenches(contacts: Contacts, forces: Array) -> Array:
    """Forces (2, place, lane) with their moments over what is a large lever, (3, place, lane)."""
    x, y = contacts.places
    lever = np.hypot(x, y).max(axis=0, initial=0.0)
    moment = (x * forces[1] - y * forces[0]) / np.where(lever > 0.0, lever, 1.0)
    return np.concatenate((forces, moment[None]))


def _normals(along: Array, beside: Array) -> Array:
    """Directions across any two sides of triangles, or axes, (3, pair, lane)."""
    axes = np.broadcast_to(np.eye(3)[..., None], (3, 3, along.shape[2]))
    sides = np.concatenate((along + beside, along - beside, beside, axes), axis=1)
    first, second = np.triu_indices(sides.shape[1], 1)
    (a, b, c), (x, y, z) = sides[:, first], sides[:, second]
    normals = np.stack((b * z - c * y, c * x - a * z, a * y - b * x))
    length = np.sqrt(total(normals * normals))
    return np.asarray(normals / np.where(length > 0.0, length, 1.0))


def _products(normals: Array, wrenches: Array) -> Array:
    """v·w of every normal and place, (pair, place, lane)."""
    return total(normals[:, :, None] * wrenches[:, None])
