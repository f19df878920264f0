"""The plan of a scene, decided once: `explain` prints it, `predict` carries it out."""

from collections.abc import Iterator
from dataclasses import replace
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

from dpgcli.design.outputs import Trust
from dpgcli.design.scene import Scene
from dpgcli.errors import Field, UsageError
from dpgcli.mechanics.coordinates import FingerPotential
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.terms import Formulate, chain_potential, lattice_potential
from dpgcli.records import dataclass
from dpgcli.states.accuracy import (
    DEFAULT_TOLERANCE,
    AccuracyLevel,
    Exactness,
    bar_flexibility,
    check_exactness,
    exactnesses,
)
from dpgcli.states.certify import Status
from dpgcli.states.chosen_columns import chosen_columns
from dpgcli.states.columns import Group
from dpgcli.states.costs import peak_bytes, seconds
from dpgcli.states.omissions import Omission, omissions
from dpgcli.states.patterns import MOST_SELECTED, Selection, select, too_many
from dpgcli.states.quantities import ALWAYS, LEAST, MISSED, Quantity, declared, shares
from dpgcli.states.rows import RowRequest
from dpgcli.states.solved import Surroundings
from dpgcli.states.units import UnitSolutions
from dpgcli.text import quoted

if TYPE_CHECKING:
    from dpgcli.states.pairs.halves import Split

FORMULATIONS: dict[str, Formulate] = {"chain": chain_potential, "lattice": lattice_potential}
FEWEST_PAIRED_STATES = 2**13
LARGEST_CONTEXT = 4


class Method(StrEnum):
    """How the states are found."""

    DIRECT = "direct"
    PAIRS = "pairs of half-fingers"


@dataclass(frozen=True)
class Request:
    """A request: which states (globs, none = all), which columns, how exactly.

    `tolerance` is the largest residual over the forces in play, (k_b + k_θ/H²) d. With a
    `target_error` (mm, of the tip) the plan takes the cheapest level that is bounded by it.
    """

    patterns: tuple[str, ...] = ()
    columns: tuple[str, ...] = ("default",)
    formulation: str = "chain"
    tolerance: float = DEFAULT_TOLERANCE
    target_error: float | None = None


@dataclass(frozen=True)
class Plan:
    """Decisions for one scene and request, and what they cost.

    `selection` is None where all states are wanted. `residual_limit` (N) is the largest residual
    that a stable state may have, in the unit with the largest forces. `bar_flexibility` (mm)
    bounds how far the bars' flexibility moves the tip: what dropping them costs, or would; it is
    infinite under dead loads.
    `accuracy_level` was chosen for the target error, if there is one; `error_bound` (mm) is what it
    promises for every tip, and infinite where nothing can be promised before the work.
    """

    scene: Scene
    request: Request
    exactness: Exactness
    method: Method
    split: "Split | None"
    selection: Selection | None
    n_states: int
    terms: tuple[str, ...]
    unknowns: int
    n_unit_solves: int
    n_finger_solves: int
    columns: tuple[Quantity, ...]
    omissions: tuple[Omission, ...]
    residual_limit: float
    bar_flexibility: float
    error_bound: float
    expected_seconds: float
    expected_bytes: int

    @property
    def n_units(self) -> int:
        return self.scene.finger.n_units

    @property
    def trusts(self) -> tuple[Trust, ...]:
        """What each kind of output rests on; none of values without a spec."""
        return self.scene.trusts

    @property
    def warnings(self) -> tuple[str, ...]:
        """The warnings of the calibrations in use."""
        return self.scene.warnings

    @property
    def groups(self) -> frozenset[Group]:
        return frozenset(column.group for column in self.columns)

    @property
    def units(self) -> UnitSolutions:
        """The finger's units, as they are solved."""
        return self.exactness.units

    @property
    def accuracy_level(self) -> AccuracyLevel | None:
        """The accuracy level chosen for the target error, if there is one."""
        return self.exactness.accuracy_level

    @property
    def dropped_error(self) -> float:
        """Bound on the tip displacement by the bars that were dropped, mm."""
        return float(self.exactness.dropped_error[0])

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """The quantities to compute: those of its columns, those that judge every state, shares.

        Where barriers are asked for, also those that the summary tells.
        """
        of_barriers = (*LEAST, MISSED) if Group.BARRIERS in self.groups else ()
        wanted = dict.fromkeys((*ALWAYS, *self.columns, *self.shares.values(), *of_barriers))
        return tuple(wanted)

    @property
    def covers(self) -> str:
        """What the uncertainties that are asked for count in, if they are."""
        known = self.scene.uncertainty
        return known.covers if known is not None and Group.UNCERTAINTY in self.groups else ""

    @property
    def shares(self) -> dict[str, Quantity]:
        """By cause, if uncertainties are asked for."""
        known = self.scene.uncertainty
        return shares(known) if known is not None and Group.UNCERTAINTY in self.groups else {}

    @property
    def rows(self) -> RowRequest:
        """The part of the plan that batches of states need."""
        scene = self.scene
        return RowRequest(
            FORMULATIONS[self.request.formulation],
            self.request.tolerance,
            self.quantities,
            Surroundings(scene.gripper, scene.layer_thickness or 0.0, scene.uncertainty),
            self.dropped_error,
        )


def explain(scene: Scene, request: Request | None = None) -> Plan:
    """Decide what the scene needs; raises UsageError and NothingSelectedError."""
    request = request or Request()
    _check(scene, request)
    n = scene.finger.n_units
    scene_units = UnitSolutions.of(scene.finger)
    needs_bars = any(quantity.needs_bars for quantity in _asked_for(request, n))
    ((_, exactness),) = exactnesses(
        scene_units, request.tolerance, request.target_error, needs_bars=needs_bars
    )
    request, units = replace(request, tolerance=exactness.tolerance), exactness.units
    is_bounded = request.formulation == "chain"
    selection = select(request.patterns, n) if request.patterns else None
    n_states = 2**n if selection is None else len(selection)
    if n_states > MOST_SELECTED:
        raise UsageError(too_many(n, "the finger has"))
    potential = FORMULATIONS[request.formulation](units.finger)
    terms = potential.kinds
    uncertainty = scene.uncertainty if request.formulation == "chain" else None
    available = declared(n, terms, scene.gripper is not None, uncertainty=uncertainty)
    has_bars = not exactness.drops_bars
    columns, left_out = chosen_columns(available, request.columns, n_states, has_bars=has_bars)
    groups = {column.group for column in columns}
    split = _split(units, potential, request, selection is None, groups)
    n_solves = n_states if split is None else split.n_solves
    return Plan(
        scene=scene,
        request=request,
        exactness=exactness,
        method=Method.DIRECT if split is None else Method.PAIRS,
        split=split,
        selection=selection,
        n_states=n_states,
        terms=terms,
        unknowns=potential.coordinates.size,
        n_unit_solves=units.wells.exists.size,
        n_finger_solves=n_solves,
        columns=columns,
        omissions=(*omissions(scene, units, split, n_solves, exactness), *left_out),
        residual_limit=request.tolerance * _largest_force(potential),
        bar_flexibility=_flexibility(scene_units),
        error_bound=float(exactness.error_bounds[0]) if is_bounded else np.inf,
        expected_seconds=seconds(
            request.formulation,
            split,
            n,
            n_states,
            {c.group for c in columns},
            is_loaded=units.finger.is_loaded,
        ),
        expected_bytes=peak_bytes(split, n, n_states, len(columns)),
    )


def _largest_force(potential: FingerPotential) -> float:
    scales = potential.coordinates
    return float((scales.gradient_scale / scales.force_unit).max())


def _check(scene: Scene, request: Request) -> None:
    if request.formulation not in FORMULATIONS:
        raise UsageError(
            Field("formulation"),
            f" {quoted(request.formulation)}: expected {' or '.join(FORMULATIONS)}",
        )
    if request.formulation == "lattice" and scene.finger.is_rigid:
        raise UsageError(
            Field("formulation"),
            " lattice needs a finite finger.linear_stiffness_N_per_mm: "
            "node coordinates cannot drop rigid bars; use the chain",
        )
    if {Group.UNCERTAINTY, Group.SHARES} & {*request.columns}:
        _check_uncertainty(scene, request)
    check_exactness(request.tolerance, request.target_error)
    if request.target_error is not None and request.formulation != "chain":
        raise UsageError(
            Field("target_error"),
            " chooses among accuracy levels of the chain: drop ",
            Field("formulation"),
        )


def _check_uncertainty(scene: Scene, request: Request) -> None:
    if scene.uncertainty is None:
        measures = dict.fromkeys(s.key for s in scene.sources if s.standard_error)
        cancels = f" but {' and '.join(measures)}: it cancels, the curve is of the same file"
        raise UsageError(
            Field("uncertainty"),
            f": no value of the spec has a standard error{cancels if measures else ''}; "
            "calibrate it by a file of dpg fit, or say uncertainty (tolerances by key) or "
            "model_error in the spec",
        )
    if request.formulation != "chain":
        raise UsageError(
            Field("uncertainty"),
            " is known in the chain's coordinates: drop ",
            Field("formulation"),
        )


def _asked_for(request: Request, n_units: int) -> Iterator[Quantity]:
    """Quantities that columns name, themselves or by group, among those of every finger."""
    names = {*request.columns, *(Group if "all" in request.columns else ())}
    return (q for q in declared(n_units, (), False) if q.name in names or q.group in names)


def _split(
    units: UnitSolutions,
    potential: FingerPotential,
    request: Request,
    is_whole: bool,
    groups: set[Group],
) -> "Split | None":
    """Where to cut the finger, if all states are wanted and that is cheaper."""
    fits = groups <= {Group.STATES, Group.ENERGIES} and request.formulation == "chain"
    n_units = units.finger.n_units
    if not (is_whole and fits and 2**n_units >= FEWEST_PAIRED_STATES):
        return None
    from dpgcli.states.pairs.halves import Split  # many states alone are made of halves

    n_inner = n_units // 2
    cut = n_inner * potential.coordinates.size // n_units
    shared = slice(cut if units.finger.is_rigid else cut - 1, cut)  # a strut
    if not potential.is_separable(shared):
        return None
    for context in range(0 if units.finger.is_rigid else 1, LARGEST_CONTEXT + 1):
        if _agrees(units.finger, n_inner, context, 0.1 * request.tolerance):
            return Split(units, n_inner, context, request.tolerance)
    return None


def _agrees(finger: Finger, n_inner: int, context: int, tolerance: float) -> bool:
    """Whether halves with that much context fit, tried on the units around the cut."""
    from dpgcli.states.pairs.compose import paired_states
    from dpgcli.states.pairs.halves import Split

    around = finger.section(n_inner - context - 1, n_inner + context + 1)
    trial = Split(UnitSolutions.of(around), context + 1, context, tolerance)
    return all((s.status != Status.NOT_CONVERGED).all() for s in paired_states(trial))


def _flexibility(units: UnitSolutions) -> float:
    """Bound on the tip displacement by bar elasticity, mm; rigid bars count as k_L = 1000 k_b."""
    finger = units.finger
    if finger.is_rigid:
        units = UnitSolutions.of(finger.with_bars(1e3 * float(finger.bistable_stiffness.max())))
    return float(bar_flexibility(units)[0])
