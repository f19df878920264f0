"""Starting shapes of searches: units in their own wells, or opened by strokes."""

from dataclasses import field

import numpy as np

from dpgcli.arrays import Array, Flags
from dpgcli.mechanics.coordinates import Internal
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.terms import chain_potential
from dpgcli.records import dataclass
from dpgcli.states.rigid_unit import single_units, tangent_of
from dpgcli.states.wells import ByUnit, Wells


def _none() -> Array:
    return np.zeros((1, 1))


@dataclass(frozen=True)
class FirstOrder(ByUnit):
    """The inverted unit with bars nearly rigid: everything to first order in 1/k_L.

    `rigid_angle` m, and `wall` by which its wall gives way (mm); `chord` and `strut` the
    extensions (mm) that the rigid unit's forces cause, a strut's by one of its two units;
    `by_chord`, `by_near_strut`, `by_far_strut` the answer of the near corner to those, rad/mm (of
    the far corner: near and far exchanged). A ground unit carries no force and has all of them
    zero, unless it rests at `rest_angle` and its wall by `rest_wall`: see `straight`. Close to the
    loss of bistability, and without a hinge, the answers grow without bound: they are then scaled
    down to a tenth of m. `turn` is what both corners may turn by in any
    pattern (rad), not scaled down. `wall_by_chord`, `wall_by_corner` and `wall_by_strut` are what
    the wall yields more, as bars and corners move. Shapes as in `Wells`.
    """

    rigid_angle: Array
    wall: Array
    chord: Array
    strut: Array
    by_chord: Array
    by_near_strut: Array
    by_far_strut: Array
    turn: Array
    wall_by_chord: Array = field(default_factory=_none)
    wall_by_corner: Array = field(default_factory=_none)
    wall_by_strut: Array = field(default_factory=_none)
    rest_angle: Array = field(default_factory=_none)
    rest_wall: Array = field(default_factory=_none)


def first_order(finger: Finger, wells: Wells) -> FirstOrder:
    """Answer of each inverted unit to the flexibility of its bars (our derivation).

    With A the Hessian by the two corners, C its columns by a bar and g the force on the bar,
    a bar extends by −g/k_L and the corners follow by −A⁻¹C times that.
    """
    flat, (units, designs) = single_units(finger)
    rigid_angle = np.broadcast_to(wells.angle, (units, designs))
    zero = np.zeros((units, designs))
    wall = zero
    if finger.has_walls:
        wall = np.broadcast_to(
            wells.extension - 2.0 * finger.segment_height * np.sin(wells.angle), zero.shape
        )
    rest_angle, rest_wall = _straight(finger, wells.rest)
    at_rest = {"rest_angle": rest_angle, "rest_wall": rest_wall}
    if finger.is_rigid:
        return FirstOrder(rigid_angle, wall, zero, zero, zero, zero, zero, zero, **at_rest)
    angle = rigid_angle.reshape(1, -1)
    rest = np.zeros_like(angle)
    potential = chain_potential(flat)
    shape = Internal(rest, angle, angle, rest, wall.reshape(1, -1))
    at_well = potential.evaluate(potential.coordinates.of_shape(shape))
    stiffness = np.broadcast_to(finger.linear_stiffness, (units, designs))
    # one unit's rows are e, a, b, s; band[k, j] is the entry (j + k, j)
    band, gradient = at_well.hessian, at_well.gradient
    follows: tuple[Array, ...] = ()
    if finger.has_walls:
        follows = _wall_answers(finger, band, zero.shape)
        band, gradient = without_first(band), gradient[1:]
    chord, strut = (-gradient[row].reshape(units, designs) / stiffness for row in (0, 3))
    answers = [part.reshape(units, designs) for part in _corner_answers(band)]
    by_chord, by_near_strut, by_far_strut = answers
    with np.errstate(invalid="ignore"):  # an infinite answer to no force
        turn = 2.0 * (
            np.abs(by_chord * chord)
            + (np.abs(by_near_strut) + np.abs(by_far_strut)) * 2.0 * np.abs(strut).max(axis=0)
        )
    turn = np.where(np.isnan(turn), np.inf, turn)  # of both corners
    scale = np.minimum(1.0, 0.2 * rigid_angle / np.maximum(turn, np.finfo(float).tiny))
    scaled = (np.where(np.isfinite(part), part, 0.0) * scale for part in answers)
    by_chord, by_near_strut, by_far_strut = scaled
    return FirstOrder(
        rigid_angle,
        wall,
        chord,
        strut,
        by_chord,
        by_near_strut,
        by_far_strut,
        turn,
        *follows,
        **at_rest,
    )


def _straight(finger: Finger, rest: Array) -> tuple[Array, Array]:
    """Corner angle (rad) and yield of the wall (mm) of straight units at rest."""
    if not rest.any():
        return rest, rest
    angle = np.arctan(tangent_of(finger, rest))
    return angle, rest - 2.0 * finger.segment_height * np.sin(angle)


def _wall_answers(finger: Finger, band: Array, shape: tuple[int, ...]) -> tuple[Array, ...]:
    """What a wall yields more by its chord (mm/mm), a corner (mm/rad) and a strut (mm/mm)."""
    ratio = np.broadcast_to(finger.wall_ratio, shape)
    with np.errstate(divide="ignore", invalid="ignore"):  # no second well
        rows = (-ratio * (band[row, 0] / band[0, 0]).reshape(shape) for row in (1, 2, 4))
        return tuple(np.where(np.isfinite(part), part, 0.0) for part in rows)


def without_first(band: Array) -> Array:
    """The band of a unit's Hessian once its first coordinate, the wall's, follows the others.

    >>> without_first(np.array([[[2.0], [3.0]], [[1.0], [0.0]]]))[0].ravel()  # 3 − 1²/2
    array([2.5])
    """
    first, rest = band[1:, 0], band[:, 1:].copy()
    size = rest.shape[1]
    with np.errstate(divide="ignore", invalid="ignore"):  # no second well
        for depth in range(min(len(rest), size)):
            n = min(size - depth, len(first) - depth)
            rest[depth, :n] -= first[depth : depth + n] * first[:n] / band[0, 0]
    return rest


def _corner_answers(band: Array) -> tuple[Array, Array, Array]:
    """−A⁻¹C for the near corner, by chord, near and far strut; infinite for a singular A."""
    corner, mixed = band[0, 1], band[1, 1]
    chord_near, strut_near, strut_far = band[1, 0], band[2, 1], band[1, 2]
    opening, leaning = corner + mixed, corner - mixed  # the eigenvalues of A
    smallest = np.finfo(float).eps * corner
    is_singular = (np.abs(opening) <= smallest) | (np.abs(leaning) <= smallest)
    with np.errstate(divide="ignore", invalid="ignore"):
        determinant = np.where(is_singular, 0.0, opening * leaning)
        answers = (
            -chord_near / np.where(is_singular, 0.0, opening),
            # by mirror symmetry the near strut acts on the near corner as the far on the far
            -(corner * strut_far - mixed * strut_near) / determinant,
            -(corner * strut_near - mixed * strut_far) / determinant,
        )
    by_chord, by_near, by_far = (np.where(is_singular, np.inf, part) for part in answers)
    return by_chord, by_near, by_far


def geometric_guess(finger: Finger, inverted: Flags, unit: FirstOrder) -> Internal:
    """The shape of a pattern, (unit, batch), with each unit in its own well.

    Bars extend, and corners follow, to first order; the error left is of order (k_b/k_L)².
    """
    on = inverted.astype(float)
    off = 1.0 - on
    if finger.is_rigid:
        rest = np.zeros((1, 1))
        angle = unit.rigid_angle * on + unit.rest_angle * off
        return Internal(rest, angle, angle, rest, unit.wall * on + unit.rest_wall * off)
    strut = unit.strut * on
    strut[:-1] += (unit.strut * on)[1:]
    near_strut = np.zeros_like(strut)
    near_strut[1:] = strut[:-1]
    common = unit.rigid_angle + unit.by_chord * unit.chord
    ground = off * unit.rest_angle
    near = on * (common + unit.by_near_strut * near_strut + unit.by_far_strut * strut) + ground
    far = on * (common + unit.by_near_strut * strut + unit.by_far_strut * near_strut) + ground
    wall = unit.wall * on + unit.rest_wall * off
    if finger.has_walls:
        turned = near + far - 2.0 * unit.rigid_angle * on
        wall += on * (unit.wall_by_chord * unit.chord + unit.wall_by_corner * turned)
        wall += on * (unit.wall_by_strut * (near_strut + strut))
    return Internal(unit.chord * on, near, far, strut, wall)


def stroke_guess(finger: Finger, inverted: Flags, strokes: float) -> Internal:
    """The shape with every inverted unit opened by `strokes` times its stroke, (unit, batch).

    Both corners open by m with 2 H sin m = strokes · d, at most 90°; bars keep their lengths.

    >>> from dpgcli.mechanics.finger import uniform_finger
    >>> unit = uniform_finger(1, segment_length=13.5, segment_height=10.0, stroke=10.0,
    ...     bistable_stiffness=1.0, force_linearity=0.0, hinge_stiffness=1.0)
    >>> angle = stroke_guess(unit, np.array([[True]]), 1.0).near_angle[0, 0]
    >>> round(float(np.degrees(angle)), 9)
    30.0
    """
    half = np.minimum(strokes * finger.stroke / (2.0 * finger.segment_height), 1.0)
    rest = np.zeros((1, 1))
    angle = np.arcsin(half) * inverted
    return Internal(rest, angle, angle, rest)
