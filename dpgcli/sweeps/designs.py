"""Many designs at once: all states of each in bounded blocks, and their metrics."""

from collections.abc import Collection, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from dpgcli.arrays import Array, Codes, Columns, Indices
from dpgcli.design.scene import Gripper, Scene
from dpgcli.mechanics.terms import chain_potential
from dpgcli.states.accuracy import Exactness
from dpgcli.states.patterns import chunks, inverted_units
from dpgcli.states.quantities import Quantity
from dpgcli.states.rows import RowRequest, solved_rows
from dpgcli.states.settle import lanes_at_once
from dpgcli.states.solved import Surroundings
from dpgcli.states.units import UnitSolutions
from dpgcli.sweeps.metrics import Metrics

ROWS_AT_ONCE = 2**15  # of states, in many batches


class Block(NamedTuple):
    """Rows of states of the designs at some places, equally many of each, design by design.

    `metrics` has a row for each of these designs, and comes with their last states.
    """

    places: Indices
    rows: Columns
    metrics: Columns | None


def design_states(
    scene: Scene,
    exactness: Exactness,
    quantities: tuple[Quantity, ...],
    only: Collection[str] | None = None,
) -> Iterator[Block]:
    """All states of a batch of designs, design by design, in blocks; with a body, if there is one.

    The metrics are all, or `only` those of these names.

    A block holds up to `ROWS_AT_ONCE` states, of several designs or of one: how long one is cut
    depends on its number of units alone.
    """
    units, dropped = exactness.units, exactness.dropped_error
    n_designs = units.finger.n_designs

    def solved(designs: Indices, codes: Codes) -> Columns:
        lanes = np.repeat(designs, len(codes))
        inverted = np.tile(inverted_units(codes, n_units), len(designs))
        around = Surroundings(*placement(scene, n_designs, lanes))
        request = RowRequest(
            chain_potential,
            exactness.tolerance,
            quantities,
            around,
            dropped[lanes],
            has_bars=not exactness.drops_bars,
        )
        found = solved_rows(units_of(units, lanes), inverted, request)
        return found | with_body(scene, units, around, lanes, np.tile(codes, len(designs)))

    n_units = units.finger.n_units
    size = lanes_at_once(n_units)
    for designs in groups_of(np.arange(n_designs), ROWS_AT_ONCE >> n_units):
        pressure = scene.pressure and scene.pressure.take_lanes(designs)
        metrics = Metrics(units_of(units, designs), len(designs), pressure)
        for first in range(0, 2**n_units, ROWS_AT_ONCE):
            n_codes = min(ROWS_AT_ONCE, 2**n_units - first)
            parts = [
                solved(some, codes + np.uint64(first))
                for some in groups_of(designs, size >> n_units)
                for codes in chunks(n_codes, size)
            ]
            rows = joined_rows(parts)
            metrics.add(rows)
            is_last = first + n_codes == 2**n_units
            yield Block(designs, rows, metrics.columns(only) if is_last else None)


def with_body(
    scene: Scene, units: UnitSolutions, around: Surroundings, lanes: Indices, codes: Codes
) -> Columns:
    """What states (lane,) do with the body, none without one."""
    if scene.body is None:
        return {}
    from dpgcli.sweeps.grasps import Encounter, grasp_rows

    layer, gripper = np.asarray(around.layer_thickness), around.gripper
    body, friction = scene.body, scene.friction
    met = units_of(units, lanes), layer, gripper, body.take_lanes(lanes), scene.held
    of_friction = friction and friction.take_lanes(lanes)
    return grasp_rows(Encounter(*met, of_friction, scene.gravity), codes)


def units_of(units: UnitSolutions, index: Indices) -> UnitSolutions:
    """Units of the designs at `index`; what there is one design of stays one."""
    return units.take_lanes(index) if units.wells.exists.shape[1] > 1 else units


def joined_rows(parts: Sequence[Columns]) -> Columns:
    """Concatenate rows of the same columns; what is one part already is not copied."""
    if len(parts) == 1:
        return parts[0]
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def designs_at_once(n_units: int) -> int:
    """How many designs to solve in one batch, all states of each."""
    return max(1, lanes_at_once(n_units) >> n_units)


def groups_of(designs: Indices, size: int) -> Iterator[Indices]:
    """So many designs at a time, or one."""
    size = max(size, 1)
    for first in range(0, len(designs), size):
        yield designs[first : first + size]


def placement(scene: Scene, n_designs: int, lanes: Indices) -> tuple[Gripper | None, float | Array]:
    """The gripper and the layer's thickness of each lane's design."""

    def of_lanes(values: float | Array) -> Array:
        return np.broadcast_to(values, n_designs)[lanes]

    thickness = 0.0 if scene.layer_thickness is None else of_lanes(scene.layer_thickness)
    if scene.gripper is None:
        return None, thickness
    spacing, angle = scene.gripper.base_spacing, scene.gripper.mounting_angle
    return Gripper(of_lanes(spacing), of_lanes(angle)), thickness
