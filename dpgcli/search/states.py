"""Chosen states of many designs at once: what targets are about, NaN where there is no such state.

A column is found as the command finds it whose column it is: free states as `predict` does, with a
body as `grasp`, under pressure as `transitions`.
"""

from collections.abc import Collection
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from dpgcli.arrays import Array, Codes, Columns, Flags, Indices
from dpgcli.design.dimensions import Design
from dpgcli.design.resolve import resolve
from dpgcli.design.scene import Scene
from dpgcli.mechanics.terms import chain_potential
from dpgcli.records import dataclass
from dpgcli.search.columns import KINDS, Direction, body_columns, directions
from dpgcli.states.accuracy import DEFAULT_TOLERANCE
from dpgcli.states.certify import Status
from dpgcli.states.columns import REACHABLE
from dpgcli.states.patterns import inverted_units
from dpgcli.states.quantities import declared
from dpgcli.states.rows import RowRequest, solved_rows
from dpgcli.states.solved import Surroundings
from dpgcli.states.units import UnitSolutions
from dpgcli.sweeps.designs import placement, units_of, with_body
from dpgcli.sweeps.evaluation import reasons_against_bodies

if TYPE_CHECKING:
    from dpgcli.sweeps.pressures import PressedDesigns


def columns_of_states(design: Design, codes: Codes, names: Collection[str]) -> Columns:
    """Columns of certified states with these codes (state, design), by name; else NaN."""
    found = resolve(design)
    rows = {name: np.full(codes.shape, np.nan) for name in names}
    right = np.flatnonzero(~found.are_wrong)
    if not body_columns(design).keys().isdisjoint(names):
        right = right[~np.isin(right, [*reasons_against_bodies(found, right)])]
    for some in found.alike(right):
        own = _States(design, found.batch(some), codes[:, some])
        for name, values in own.columns(names).items():
            rows[name][:, some] = values.reshape(len(some), len(codes)).T
    return rows


@dataclass(frozen=True)
class _States:
    """States with these codes (state, design) of designs in one scene; a lane each, by design."""

    design: Design
    scene: Scene
    codes: Codes

    @property
    def code(self) -> Codes:
        return self.codes.T.ravel()

    @property
    def owner(self) -> Indices:
        """The design of each lane."""
        return np.repeat(np.arange(self.codes.shape[1]), len(self.codes))

    @cached_property
    def units(self) -> UnitSolutions:
        return UnitSolutions.of(self.scene.finger)

    @property
    def around(self) -> Surroundings:
        return Surroundings(*placement(self.scene, self.codes.shape[1], self.owner))

    def columns(self, names: Collection[str]) -> Columns:
        """Columns of stable states, (lane,), as far as their fingers have them; else NaN."""
        quantities = tuple(
            quantity
            for quantity in declared(self.design.units, KINDS, bool(self.design.gripper))
            if quantity.name in ("status", *names)
        )
        inverted = inverted_units(self.code, self.design.units)
        request = RowRequest(chain_potential, DEFAULT_TOLERANCE, quantities, self.around)
        found = solved_rows(units_of(self.units, self.owner), inverted, request)
        is_stable = found.pop("status") == Status.STABLE
        if not body_columns(self.design).keys().isdisjoint(names):
            found |= self._with_body()
        found |= self._under_pressure(names, is_stable)
        return {name: _known(found[name], is_stable) for name in found.keys() & names}

    def _with_body(self) -> Columns:
        """Columns of grasps; NaN where nothing holds the body."""
        found = with_body(self.scene, self.units, self.around, self.owner, self.code)
        is_there = found["grasp_status"] == Status.STABLE
        return {name: _known(found[name], is_there) for name in body_columns(self.design)}

    def _under_pressure(self, names: Collection[str], is_stable: Flags) -> Columns:
        """Columns under pressure, of states that are stable there, too."""
        ways = {name: way for name, way in directions(self.design).items() if name in names}
        if not ways and REACHABLE.name not in names:
            return {}
        from dpgcli.sweeps.pressures import PressedDesigns

        assert self.scene.pressure is not None, "the base has it"
        found = PressedDesigns(self.units, self.scene.pressure, self.codes.shape[1])
        columns = {name: self._left_at(found, way, is_stable) for name, way in ways.items()}
        if REACHABLE.name in names:
            columns[REACHABLE.name] = found.reached.known[self.owner, self.code.astype(int)]
        return columns

    def _left_at(self, found: "PressedDesigns", way: Direction, is_stable: Flags) -> Array:
        """The pressures (MPa) at which states are left that way; NaN where they are not."""
        from dpgcli.actuation.directions import Directions
        from dpgcli.actuation.graph import are_states
        from dpgcli.actuation.transitions import Departure, first_flips

        lanes = np.flatnonzero(is_stable)
        lanes = lanes[are_states(found.pressed, self.owner[lanes], self.code[lanes])]
        line, sign = (np.full(len(lanes), value) for value in way)
        towards = Directions(self.owner[lanes], self.code[lanes], line, sign)
        line_of, reach = found.pressure.line_of, found.thresholds.reach
        first = first_flips(found.pressed, line_of, reach, towards)
        leaves = np.isin(first.outcome, (Departure.LEAVES, Departure.ASTRAY))
        pressure = np.full(len(is_stable), np.nan)
        pressure[lanes] = np.where(leaves, first.pressure, np.nan)
        return pressure


def _known(values: Array, is_there: Flags) -> Array:
    return np.where(is_there & np.isfinite(values), values, np.nan)
