"""What designs come to that were searched for: found anew from their specs, as commands find it.

`predict`, `grasp` and `transitions` have other ways to it than the search, one design at a time.
"""

from collections.abc import Sequence
from dataclasses import field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from dpgcli.arrays import Array, Codes, Columns, distinct
from dpgcli.design.dimensions import UNITS
from dpgcli.design.scene import Scene
from dpgcli.files.scene_file import Spec, scene_of
from dpgcli.mechanics.terms import chain_potential
from dpgcli.records import dataclass
from dpgcli.search.columns import body_columns, directions, pressed_columns
from dpgcli.search.designs import Designs
from dpgcli.search.goal import Goal
from dpgcli.search.maps import map_columns
from dpgcli.search.table import Reached
from dpgcli.search.targets import TargetEvaluation
from dpgcli.states.columns import REACHABLE
from dpgcli.states.patterns import inverted_units, texts
from dpgcli.states.plan import Request
from dpgcli.states.predict import predict
from dpgcli.states.units import UnitSolutions

if TYPE_CHECKING:
    from dpgcli.actuation.transitions import StateGraph

AGREEMENT = 1e-9  # of a number: a design's, and that from its spec
OVERLAP = "fingers_overlap"


def reached(goal: Goal, spec: Spec, designs: Designs, place: int) -> Reached:
    """What is found for a spec, which is that of a design; it has to be what the search found."""
    told = _Anew(goal, spec, designs.codes[:, place])
    values = told.values
    if values:
        asked = np.concatenate([target.values for target in goal.targets])
        tolerances = np.repeat([t.tolerance for t in goal.targets], [len(v) for v in values])
        searched = asked + designs.residuals.values[:, place] * tolerances
        check_agreement(np.concatenate(values), searched)
    own = told.of_designs([*designs.columns])
    for name, column in designs.columns.items():
        check_agreement(np.array([own[name]]), column[[place]])
    return Reached(told.patterns, values, own, told.overlapping)


def check_agreement(told: Array, searched: Array) -> None:
    """A broken invariant: both are the same states of the same finger."""
    apart = np.abs(told - searched)
    assert (apart <= AGREEMENT * np.maximum(1.0, np.abs(told))).all(), "predict finds the same"


@dataclass(frozen=True)
class _Anew:
    """The states that are nearest to a goal's targets, (target,), of a spec by itself."""

    goal: Goal
    spec: Spec
    nearest: Codes
    known: dict[str, float] = field(default_factory=dict)  # columns of the design

    @cached_property
    def patterns(self) -> tuple[str, ...]:
        """Of each target; of no meaning where it is about the design."""
        inverted = inverted_units(self.nearest, self.spec.finger.units)
        return tuple(texts(inverted).astype(str).tolist())

    @cached_property
    def scene(self) -> Scene:
        return scene_of(self.spec)

    @cached_property
    def codes(self) -> Codes:
        """Of states that are nearest to some target, each once."""
        own = [k for k, target in enumerate(self.goal.targets) if target.pattern]
        return distinct(self.nearest[own])

    @property
    def values(self) -> tuple[tuple[float, ...], ...]:
        """What each target is about, in all its parts."""
        own = self.of_designs(TargetEvaluation(self.goal).of_designs)
        row = {code: row for row, code in enumerate(self.codes.tolist())}
        return tuple(
            tuple(float(self.states[name][row[code]]) for name in target.columns)
            if target.pattern
            else (own[target.quantity],)
            for target, code in zip(self.goal.targets, self.nearest.tolist(), strict=True)
        )

    @property
    def overlapping(self) -> tuple[str, ...]:
        """States of targets in which the fingers of a gripper overlap."""
        if OVERLAP not in self.states:
            return ()
        inverted = inverted_units(self.codes[self.states[OVERLAP]], self.spec.finger.units)
        return tuple(texts(inverted).astype(str).tolist())

    @cached_property
    def states(self) -> Columns:
        """Columns of the states, (state,)."""
        names = {*TargetEvaluation(self.goal).names}
        if not len(self.codes):
            return {}
        base = self.spec.design
        of_body, pressed = (names & each(base).keys() for each in (body_columns, pressed_columns))
        found = self._predicted(sorted(names - of_body - pressed))
        if of_body:
            from dpgcli.grasping.table import grasp_rows, grasps

            assert self.scene.body is not None, "the base has it"
            pairs = [self.codes] * (1 if self.scene.gripper is None else 2)
            found |= grasp_rows(grasps(self.scene, chain_potential, self.scene.body, pairs))
        return found | (self._under_pressure() if pressed else {})

    def _predicted(self, names: Sequence[str]) -> Columns:
        inverted = inverted_units(self.codes, self.spec.finger.units)
        of_pair = (OVERLAP,) if self.spec.gripper is not None else ()
        request = Request(tuple(texts(inverted).astype(str).tolist()), ("status", *of_pair, *names))
        return predict(self.scene, request).arrays()

    def _under_pressure(self) -> Columns:
        from dpgcli.actuation.pressed import Pressed
        from dpgcli.actuation.transitions import state_graph

        pressure = self.scene.pressure
        assert pressure is not None, "the base has it"
        units = UnitSolutions.of(self.scene.finger)
        graph = state_graph(Pressed.of(units, pressure), pressure.line_of)
        columns: Columns = {REACHABLE.name: graph.reached.known[0, self.codes.astype(np.int64)]}
        for name, (line, sign) in directions(self.spec.design).items():
            columns[name] = _left_at(graph, self.codes, line, sign)
        return columns

    def of_designs(self, names: Sequence[str]) -> dict[str, float]:
        """Columns of the design, by name."""
        missing = [name for name in names if name not in self.known]
        if missing:
            units = {UNITS: np.array([self.spec.finger.units])}
            found = map_columns(self.spec.design, missing, units)
            self.known.update({name: column[0].item() for name, column in found.items()})
        return {name: self.known[name] for name in names}


def _left_at(graph: "StateGraph", codes: Codes, line: int, sign: int) -> Array:
    """The pressures at which states are left that way, MPa."""
    from dpgcli.actuation.transitions import Departure

    rows = graph.transitions
    is_way = (rows.line == line) & (rows.sign == sign)
    leaves = np.isin(rows.outcome, (Departure.LEAVES, Departure.ASTRAY))
    known = np.where(leaves, rows.pressure, np.nan)[is_way]
    by_code = dict(zip(rows.code[is_way].tolist(), known.tolist(), strict=True))
    return np.array([by_code.get(code, np.nan) for code in codes.tolist()])
