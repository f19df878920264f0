"""What a scene needs, decided once: `explain` prints the plan, `predict` carries it out."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from dpgcli.arrays import Codes
from dpgcli.errors import UsageError
from dpgcli.mechanics.chain import Chain
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.formulation import Formulation
from dpgcli.mechanics.lattice import Lattice
from dpgcli.mechanics.scene import Scene
from dpgcli.states.columns import Column, Group, declared, named
from dpgcli.states.halves import Split
from dpgcli.states.pairs import paired_states
from dpgcli.states.patterns import MOST_SELECTED, select, too_many
from dpgcli.states.rows import Wanted
from dpgcli.states.solve import Status, Units, lanes_at_once, reach

FORMULATIONS: dict[str, type[Chain] | type[Lattice]] = {"chain": Chain, "lattice": Lattice}
DEFAULT_TOLERANCE = 1e-12
SMALLEST_TOLERANCE = 1e-14  # of the forces in play; below, rounding decides
FEWEST_PAIRED_STATES = 2**13
LARGEST_CONTEXT = 4
MOST_STATES_WITH = {
    Group.EIGENVALUE: 2**10,
    Group.STIFFNESS: 2**16,
    Group.ENERGIES: 2**16,
    Group.OPENINGS: 2**16,
}


class Method(StrEnum):
    """How the states are found."""

    DIRECT = "direct"
    PAIRS = "pairs of half-fingers"


@dataclass(frozen=True)
class Request:
    """What is asked of a scene: which states (globs, none = all), which columns, how exactly.

    `tolerance` is the largest residual over the forces in play, (k_b + k_θ/H²) d.
    """

    patterns: tuple[str, ...] = ()
    columns: tuple[str, ...] = ("default",)
    formulation: str = "chain"
    tolerance: float = DEFAULT_TOLERANCE


@dataclass(frozen=True)
class Omission:
    """Something left out, and why."""

    what: str
    why: str


@dataclass(frozen=True)
class Plan:
    """Decisions for one scene and request, and what they cost.

    `codes` is None where all states are wanted. `residual_limit` (N) is the largest residual
    that a stable state may have, in the unit with the largest forces. `bar_flexibility` (mm)
    bounds how far the bars' flexibility moves the tip: what dropping them costs, or would.
    """

    scene: Scene
    request: Request
    units: Units
    method: Method
    split: Split | None
    codes: Codes | None
    n_states: int
    terms: tuple[str, ...]
    unknowns: int
    n_unit_solves: int
    n_finger_solves: int
    columns: tuple[Column, ...]
    omissions: tuple[Omission, ...]
    residual_limit: float
    bar_flexibility: float
    expected_seconds: float
    expected_bytes: int

    @property
    def n_units(self) -> int:
        return self.scene.finger.n_units

    @property
    def groups(self) -> frozenset[Group]:
        return frozenset(column.group for column in self.columns)

    @property
    def wanted(self) -> Wanted:
        """The plan as far as batches of states need it."""
        return Wanted(
            FORMULATIONS[self.request.formulation],
            self.request.tolerance,
            self.groups,
            self.scene.gripper,
            self.scene.layer_thickness or 0.0,
        )


def explain(scene: Scene, request: Request | None = None) -> Plan:
    """Decide what the scene needs; raises UsageError and NothingSelectedError."""
    request = request or Request()
    _check(scene, request)
    finger = scene.finger
    n = finger.n_units
    codes = select(request.patterns, n) if request.patterns else None
    n_states = 2**n if codes is None else len(codes)
    if n_states > MOST_SELECTED:
        raise UsageError(too_many(n, "the finger has"))
    units = Units.of(finger)
    formulation = FORMULATIONS[request.formulation](finger)
    terms = tuple(term.kind for term in formulation.terms)
    available = declared(n, terms, scene.gripper is not None)
    columns, left_out = _columns(available, request.columns, n_states)
    split = _split(units, request, codes is None, n_states, {c.group for c in columns})
    n_solves = n_states if split is None else split.n_solves
    return Plan(
        scene=scene,
        request=request,
        units=units,
        method=Method.DIRECT if split is None else Method.PAIRS,
        split=split,
        codes=codes,
        n_states=n_states,
        terms=terms,
        unknowns=len(formulation.reach),
        n_unit_solves=units.wells.exists.size,
        n_finger_solves=n_solves,
        columns=columns,
        omissions=(*_omissions(scene, units, split, n_solves), *left_out),
        residual_limit=request.tolerance * _largest_force(formulation),
        bar_flexibility=bar_flexibility(finger),
        expected_seconds=_seconds(request, split, n, n_states, {c.group for c in columns}),
        expected_bytes=_bytes(split, n, n_states, len(columns)),
    )


def _largest_force(formulation: Formulation) -> float:
    return float((formulation.gradient_scale / formulation.force_unit).max())


def _check(scene: Scene, request: Request) -> None:
    if request.formulation not in FORMULATIONS:
        raise UsageError(
            f"--formulation {request.formulation!r}: expected {' or '.join(FORMULATIONS)}"
        )
    if request.formulation == "lattice" and scene.finger.is_rigid:
        raise UsageError(
            "--formulation lattice needs a finite finger.linear_stiffness_N_per_mm: "
            "node coordinates cannot drop rigid bars; use the chain"
        )
    if not SMALLEST_TOLERANCE <= request.tolerance <= 1e-3:
        raise UsageError(
            f"--tolerance {request.tolerance}: expected {SMALLEST_TOLERANCE} … 0.001 "
            "of the forces in play; below, rounding decides"
        )


def _columns(
    available: tuple[Column, ...], names: Sequence[str], n_states: int
) -> tuple[tuple[Column, ...], tuple[Omission, ...]]:
    """Columns asked for; by default all but nodes and what is costly in a large map."""
    wanted: set[str] = {"pattern", "status", *names} - {"default", "all"}
    left_out: tuple[Omission, ...] = ()
    groups = list(dict.fromkeys(c.group for c in available))
    if "all" in names:
        wanted |= set(groups)
    elif "default" in names:
        cheap = [
            g
            for g in groups
            if g is not Group.NODES and n_states <= MOST_STATES_WITH.get(g, n_states)
        ]
        left_out = tuple(
            Omission(f"{g} columns", _why_left_out(g)) for g in groups if g not in {*cheap, *names}
        )
        wanted |= set(cheap)
    return named(available, sorted(wanted)), left_out


def _why_left_out(group: Group) -> str:
    if group is Group.NODES:
        return "given on request: --nodes"
    return f"left out above {MOST_STATES_WITH[group]:,} states: --columns default,{group}"


def _split(
    units: Units, request: Request, is_whole: bool, n_states: int, groups: set[Group]
) -> Split | None:
    """Where to cut the finger, if all states are wanted and that is cheaper."""
    fits = groups <= {Group.STATES, Group.ENERGIES} and request.formulation == "chain"
    if not (is_whole and fits and n_states >= FEWEST_PAIRED_STATES):
        return None
    n_inner = units.finger.n_units // 2
    for context in range(0 if units.finger.is_rigid else 1, LARGEST_CONTEXT + 1):
        if _agrees(units.finger, n_inner, context, 0.1 * request.tolerance):
            return Split(units, n_inner, context, request.tolerance)
    return None


def _agrees(finger: Finger, n_inner: int, context: int, tolerance: float) -> bool:
    """Whether halves with that much context fit, tried on the units around the cut."""
    around = finger.units(n_inner - context - 1, n_inner + context + 1)
    trial = Split(Units.of(around), context + 1, context, tolerance)
    return all((s.status != Status.NOT_CONVERGED).all() for s in paired_states(trial))


def bar_flexibility(finger: Finger) -> float:
    """Bound (mm) on how far the bars' flexibility moves the tip, over all states.

    Twice the sum, over units, of what each unit's bars do to first order. For rigid bars: of
    what bars a thousand times as stiff as the stiffest spring would do.
    """
    if finger.is_rigid:
        stiffness = 1e3 * finger.bistable_stiffness.max(axis=0, keepdims=True)
        finger = Finger(finger.n_units, **{**finger.arrays(), "linear_stiffness": stiffness})
    unit = Units.of(finger).first_order
    per_unit = np.abs(unit.chord) + reach(finger)[0] * unit.turn
    return float(2.0 * np.broadcast_to(per_unit, (finger.n_units, 1)).sum())


def _omissions(
    scene: Scene, units: Units, split: Split | None, n_solves: int
) -> tuple[Omission, ...]:
    finger = scene.finger
    n = finger.n_units
    omissions = [Omission("loads, pressure and contact", "the spec has none")]
    if finger.is_rigid:
        omissions.append(
            Omission(
                f"bar terms and {2 * n} bar extensions of {4 * n} unknowns",
                "k_L is infinite; units do not feel each other, "
                "so the guess is the solution and Newton only certifies it",
            )
        )
    if not finger.hinge_stiffness.any():
        omissions.append(Omission("hinge terms", "the hinge stiffness is zero"))
    if units.wells.exists.size < n:
        omissions.append(
            Omission(f"{n - 1} of {n} unit wells", "all units are equal: one is solved")
        )
    if split is not None:
        omissions.append(
            Omission(
                f"{2**n - n_solves:,} of {2**n:,} finger solves",
                f"states are pairs of {split.n_inner}- and {split.n_outer}-unit halves, each "
                f"solved with {split.context} units of the other; every pair is certified",
            )
        )
    if scene.gripper is not None:
        omissions.append(Omission("the second finger", "a mirror image: solved once"))
    return tuple(omissions)


# Rough costs on one core of a 2020s server, in seconds: measured, good to a factor of two.
UNIT_STATE_SECONDS = {"chain": 1.0e-6, "lattice": 2.5e-6}
PAIR_SECONDS = 1.0e-6
EIGENVALUE_SECONDS = 4e-9  # times the cube of the number of unknowns
START_SECONDS = 0.3


def _seconds(
    request: Request, split: Split | None, n: int, n_states: int, groups: set[Group]
) -> float:
    per_unit = UNIT_STATE_SECONDS[request.formulation]
    if split is not None:
        length = n // 2 + split.context
        return START_SECONDS + split.n_solves * length * per_unit + n_states * PAIR_SECONDS
    eigenvalue = EIGENVALUE_SECONDS * (4 * n) ** 3 if Group.EIGENVALUE in groups else 0.0
    return START_SECONDS + n_states * (n * per_unit + eigenvalue)


def _bytes(split: Split | None, n: int, n_states: int, n_columns: int) -> int:
    """Interpreter and libraries, one batch with its temporaries, tables and a block of rows."""
    batch = min(lanes_at_once(n), n_states) * n * 8 * 150
    row = n_columns * 8 + 4 * n
    if split is None:
        return 64 * 2**20 + batch + lanes_at_once(n) * row
    return 128 * 2**20 + batch + split.n_solves * 8 * 24 + 2**16 * row * 4
