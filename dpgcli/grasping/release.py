"""Bodies that may move: let go of where they were placed, they go where forces on them balance.

The body has grown about the fingers while it was kept in its place. What keeps it is a force on
each of its motions; as that goes to nothing the body and both fingers move on, and units reset as
they must. A body that no finger keeps from moving on leaves them: there is no rest.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from dpgcli.arrays import Indices
from dpgcli.grasping.approach import Approach, approach
from dpgcli.grasping.contact import ContactShapes, Motion, Obstructed
from dpgcli.grasping.grasp import Placed


def together(
    parts: Sequence[Placed], lanes: Sequence[Indices], motion: Motion
) -> tuple[Obstructed, ContactShapes]:
    """The fingers of a lane as one, with a body that may move: those at `lanes` of each part."""
    few = [part.grown.shapes.take_lanes(index) for part, index in zip(parts, lanes, strict=True)]
    n = len(lanes[0])
    first = parts[0].own
    own = replace(
        first, bodies=tuple(part.own.bodies[0] for part in parts), depth=np.zeros(1), motion=motion
    )
    coordinates = np.stack([shapes.coordinates for shapes in few], axis=1).reshape(-1, n)
    shapes = ContactShapes(
        np.concatenate((coordinates, np.zeros((motion.n, n)))),
        np.concatenate([shapes.push for shapes in few]),
        np.concatenate([shapes.active for shapes in few]),
        np.concatenate([shapes.inverted for shapes in few]),
        np.all([shapes.is_there for shapes in few], axis=0),
    )
    return own, shapes


def released(own: Obstructed, shapes: ContactShapes) -> tuple[Obstructed, Approach]:
    """Let go of bodies that were kept where they are; the scene once nothing keeps them."""
    assert own.motion is not None, "a body that may move"
    n = shapes.coordinates.shape[1]
    begin = np.zeros(n)
    potential = own.pressed(shapes.inverted, shapes.push, begin)
    kept = potential.evaluate(shapes.coordinates).gradient[own.n_own :]
    keeping = replace(own, motion=replace(own.motion, hold=kept))
    return own, approach(keeping, shapes, begin, begin + 1.0)
