"""Error against run time, on one finger: rows of one table, whatever was measured.

Errors are those of tips, angles and energies against extended precision, over the patterns
that have a state. Times are of one warm call in this process.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import field
from pathlib import Path
from tempfile import gettempdir
from typing import Any

import numpy as np

from dpgcli.actuation.pressed import Pressed
from dpgcli.arrays import Array, Columns, Flags, keep_freed_memory
from dpgcli.benchmark.ablation import ablations, check_ablation
from dpgcli.benchmark.contacts import ContactCase, meets_body
from dpgcli.benchmark.methods import (
    BenchmarkMethod,
    BenchmarkResult,
    package_methods,
    third_party_methods,
)
from dpgcli.benchmark.thresholds import SnapCase
from dpgcli.benchmark.timing import Times, measured, numpy_kernel, peak_bytes
from dpgcli.calibration.comparison import compare
from dpgcli.calibration.known import Frame, KnownStates
from dpgcli.design.pressure import Pressure
from dpgcli.design.scene import Scene
from dpgcli.errors import Field, UsageError
from dpgcli.hard_cases.cases import check_law
from dpgcli.hard_cases.variants import repeated
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.terms import chain_potential
from dpgcli.records import dataclass
from dpgcli.reference.equilibria import ExtendedStates, extended_states
from dpgcli.states.accuracy import DEFAULT_TOLERANCE, check_exactness
from dpgcli.states.columns import Column, Kind
from dpgcli.states.patterns import inverted_units
from dpgcli.states.plan import Request
from dpgcli.states.predict import Prediction, predict
from dpgcli.states.settle import settle
from dpgcli.states.tip import tip
from dpgcli.states.units import UnitSolutions
from dpgcli.temporary import temporary_folder

MOST_STATES, MOST_UNITS_SOLVED = 32, 320  # by the reference, which takes its time
PEER_STATES, MANY_UNITS = 8, 5  # states, fewer for longer fingers
TOUCHING_STATES = 8  # of those against a body
BATCH = 4096  # states of a call, as in a sweep
GROWTH_UNITS = (1, 2, 4, 6, 8, 10, 12, 14, 16, 18, 20)
TABLE_UNITS = 20  # of a finger all of whose states go into a Parquet file
GROWTH_DESIGNS = (1, 4, 16, 64, 256, 1024)
GROWTH_RATIOS = (1.0, 1e2, 1e4, 1e6, 1e9, 1e12, 1e15, math.inf)
REFERENCE_DIGITS = 50

BenchRow = dict[str, Any]

COLUMNS = (
    Column("group", "", "what was varied", kind=Kind.TEXT),
    Column("method", "", "how the states were found", kind=Kind.TEXT),
    Column("n_units", "", "units of the finger", kind=Kind.COUNT),
    Column("n_designs", "", "designs in a call", kind=Kind.COUNT),
    Column("stiffness_ratio", "", "k_L over the largest k_b"),
    Column("n_states", "", "states in a call", kind=Kind.COUNT),
    Column("certified", "", "whether the method certifies what it finds", kind=Kind.FLAG),
    Column("n_missing", "", "states not found, of those that exist", kind=Kind.COUNT),
    Column("max_tip_error_mm", "mm", "largest error of a tip"),
    Column("rms_tip_error_mm", "mm", "root mean square of the tips' errors"),
    Column("max_angle_error_rad", "rad", "largest error of a tip angle"),
    Column("rms_angle_error_rad", "rad", "root mean square of the angles' errors"),
    Column("max_energy_error_mJ", "mJ", "largest error of an energy"),
    Column("rms_energy_error_mJ", "mJ", "root mean square of the energies' errors"),
    Column("bound_mm", "mm", "bound on the change of a tip, known before"),
    Column("max_threshold_error", "", "largest relative error of a pressure at which it snaps"),
    Column("times_as_long", "", "time of a threshold or a contact over that of this package"),
    Column("seconds", "s", "wall time of a call, median"),
    Column("seconds_min", "s", "wall time of a call, smallest"),
    Column("seconds_max", "s", "wall time of a call, largest"),
    Column("cpu_seconds", "s", "CPU time of a call, median"),
    Column("seconds_per_state", "s", "wall time of a call over its states"),
    Column("relative_time", "", "shortest such time over a fixed NumPy kernel's"),
    Column("peak_MiB", "MiB", "largest memory allocated in a call"),
)


@dataclass(frozen=True)
class Bench:
    """A benchmark: its scene, repeats, ablations and known states.

    `target_error` (mm) is that of the plan from which something is put back.
    `known` tips lie in a `frame` of their own. `write` writes a prediction as a table; where it is
    not given, that is not measured.
    """

    scene: Scene
    repeats: int
    keep: tuple[str, ...] = ()
    target_error: float | None = None
    known: KnownStates | None = None
    frame: Frame = field(default_factory=Frame)
    write: Callable[[Prediction, Path], None] | None = None

    @property
    def finger(self) -> Finger:
        return self.scene.finger

    def check(self) -> None:
        """Raise UsageError for a law that has no reference, loads, and what makes no sense."""
        check_law(self.finger)
        if self.finger.is_loaded:
            what = "the methods that are compared with know no loads: take "
            raise UsageError(what, Field("setting"), " loads=null")
        check_exactness(DEFAULT_TOLERANCE, self.target_error)
        for name in self.keep:
            check_ablation(self.scene, name, self.target_error)

    def rows(self) -> Iterator[BenchRow]:
        """Measure, group by group, a row at a time."""
        keep_freed_memory()
        kernel = numpy_kernel()
        for row in self._measured():
            yield {**_blank(), **row, "relative_time": _relative(row, kernel, self.repeats)}

    def _measured(self) -> Iterator[BenchRow]:
        patterns = chosen_patterns(self.finger.n_units)
        reference = extended_states(self.finger, patterns, digits=REFERENCE_DIGITS)
        yield from self._ladder(patterns, reference)
        yield from self._alone(patterns, reference)
        finger = self.finger
        if not (finger.is_rigid or finger.has_walls or finger.is_coupled):  # peers know none
            most = max(1, PEER_STATES // math.ceil(self.finger.n_units / MANY_UNITS))
            few = slice(None, None, -(-patterns.shape[1] // most))
            for method in third_party_methods(self.finger, patterns[:, few]):
                yield self._row(method, _only(reference, few))
        if self.scene.pressure is not None:
            yield from self._thresholds(self.scene.pressure)
        if meets_body(self.scene):
            apart = -(-patterns.shape[1] // TOUCHING_STATES)
            yield from self._contacts(patterns[:, ::apart])
        if self.known is not None:
            yield self._model_error(self.known)
        yield from self._by_units()
        if self.write is not None:
            yield self._to_parquet(self.write)
        yield from self._by_designs()
        yield from self._by_stiffness()
        for name in self.keep:
            yield from self._kept(name)

    def _ladder(self, patterns: Flags, reference: ExtendedStates) -> Iterator[BenchRow]:
        """The package's methods in a batch as large as those of a sweep."""
        n_copies = max(1, BATCH // patterns.shape[1])
        tiled = np.tile(patterns, (1, n_copies))
        for method in package_methods(self.finger, tiled):
            yield self._row(method, reference)

    def _alone(self, patterns: Flags, reference: ExtendedStates) -> Iterator[BenchRow]:
        """The same for this finger's states only."""
        for method in package_methods(self.finger, patterns):
            yield self._row(method._replace(group="one finger"), reference)

    def _row(self, method: BenchmarkMethod, reference: ExtendedStates) -> BenchRow:
        found = method.run()
        n_states = reference.energy.shape[0]
        first = BenchmarkResult(found.pose[:, :n_states], found.energy[:n_states])
        return {
            **self._facts(method.group, method.name, method.n_states),
            "certified": method.certifies,
            **errors(first, reference),
            **_times(measured(method.run, self.repeats), method.n_states),
        }

    def _thresholds(self, pressure: Pressure) -> Iterator[BenchRow]:
        """What follows the straight finger to its first snap, all lines at one pressure."""
        case = SnapCase.of(Pressed.of(UnitSolutions.of(self.finger), pressure))
        own = math.nan
        for follower in case.followers() if math.isfinite(case.threshold) else ():
            found = follower.run()
            times = _times(measured(follower.run, self.repeats), follower.n_states)
            own = times["seconds_per_state"] if math.isnan(own) else own
            off = np.abs(found / case.threshold - 1.0)
            yield {
                **self._facts("pressure", follower.name, follower.n_states),
                **times,
                "n_missing": int(np.isnan(off).sum()),
                "max_threshold_error": _largest(off[np.isfinite(off)]),
                "times_as_long": times["seconds_per_state"] / own,
            }

    def _contacts(self, patterns: Flags) -> Iterator[BenchRow]:
        """States of the upper finger against the body."""
        case, own = ContactCase.of(self.scene, patterns), math.nan
        for method in case.methods():
            row = self._row(method, case.truth)
            own = row["seconds_per_state"] if math.isnan(own) else own
            yield {**row, "times_as_long": row["seconds_per_state"] / own}

    def _facts(
        self, group: str, method: str, n_states: int, finger: Finger | None = None
    ) -> BenchRow:
        finger = finger or self.finger
        ratio = finger.linear_stiffness.max() / finger.bistable_stiffness.max()
        return {
            "group": group,
            "method": method,
            "n_units": finger.n_units,
            "n_designs": 1,
            "stiffness_ratio": float(ratio),
            "n_states": n_states,
        }

    def _model_error(self, known: KnownStates) -> BenchRow:
        """The lattice's own error: its states beside those that were given."""
        found = compare(self.finger, known, self.frame)
        is_state = np.isfinite(found.states.pose[0])
        distance = found.distance[np.isfinite(found.distance)]
        angle = np.abs(found.tip_angle[np.isfinite(found.tip_angle)])
        return {
            **self._facts("model", "lattice against the data given", len(is_state)),
            "n_missing": int((~is_state).sum()),
            "max_tip_error_mm": _largest(distance),
            "rms_tip_error_mm": _rms(distance),
            "max_angle_error_rad": _largest(angle),
            "rms_angle_error_rad": _rms(angle),
        }

    def _by_units(self) -> Iterator[BenchRow]:
        """All 2^n states of fingers that repeat this one's units, as `predict` finds them."""
        for n_units in GROWTH_UNITS:
            finger = repeated(self.finger, n_units)
            scene = Scene(finger, ())

            def whole(scene: Scene = scene) -> None:
                for _ in predict(scene, Request(columns=("states",))).blocks():
                    pass

            method = predict(scene, Request(columns=("states",))).plan.method.value
            yield {
                **self._facts("units", method, 2**n_units, finger),
                **_times(measured(whole, self.repeats), 2**n_units),
                "peak_MiB": peak_bytes(whole) / 2**20,
            }

    def _by_designs(self) -> Iterator[BenchRow]:
        """Designs that all differ, by 1 % in their strokes."""
        patterns = chosen_patterns(self.finger.n_units)
        for n_designs in GROWTH_DESIGNS:
            finger = varied(self.finger, n_designs)
            lanes = np.repeat(np.arange(n_designs), patterns.shape[1])
            inverted = np.tile(patterns, n_designs)

            def whole(finger: Finger = finger, lanes: Any = lanes, on: Flags = inverted) -> None:
                units = UnitSolutions.of(finger).take_lanes(lanes)
                settled = settle(units, chain_potential, on, DEFAULT_TOLERANCE)
                tip(settled, with_compliance=True)

            yield {
                **self._facts("designs", "chain, all designs differ", len(lanes)),
                "n_designs": n_designs,
                **_times(measured(whole, self.repeats), len(lanes)),
                "peak_MiB": peak_bytes(whole) / 2**20,
            }

    def _by_stiffness(self) -> Iterator[BenchRow]:
        """Bars from as soft as the springs to rigid, in both formulations."""
        n_units = min(self.finger.n_units, 3)
        patterns = chosen_patterns(n_units)
        for ratio in GROWTH_RATIOS:
            short = repeated(self.finger, n_units)
            finger = short.with_bars(ratio * float(short.bistable_stiffness.max()))
            reference = extended_states(finger, patterns, digits=REFERENCE_DIGITS)
            wanted = (f"chain, {DEFAULT_TOLERANCE:g}", f"lattice, {DEFAULT_TOLERANCE:g}")
            for method in package_methods(finger, patterns):
                if method.name in wanted:
                    yield {
                        **self._row(method, reference),
                        **self._facts("stiffness", method.name, method.n_states, finger),
                        "peak_MiB": peak_bytes(method.run) / 2**20,
                    }

    def _to_parquet(self, write: Callable[[Prediction, Path], None]) -> BenchRow:
        """All states of a long finger, computed, certified and written to a file."""
        finger = repeated(self.finger, TABLE_UNITS)

        with temporary_folder(Path(gettempdir()) / "bench") as folder:

            def whole() -> None:
                write(predict(Scene(finger, ())), folder / "states.parquet")

            times = measured(whole, self.repeats)
        n_states = 2**TABLE_UNITS
        method = "predicted into a Parquet file"
        return {**self._facts("units", method, n_states, finger), **_times(times, n_states)}

    def _kept(self, name: str) -> Iterator[BenchRow]:
        """The scene as planned, and with one thing put back that the plan leaves out."""
        for method in ablations(self.scene, name, self.target_error):
            yield {
                **self._facts("kept", method.name, method.n_states),
                **_times(measured(method.run, self.repeats), method.n_states),
                "max_tip_error_mm": method.change,
                "bound_mm": method.bound,
                "peak_MiB": peak_bytes(method.run) / 2**20,
            }


def errors(found: BenchmarkResult, reference: ExtendedStates) -> BenchRow:
    """Errors of what was found, over the states that exist."""
    exists = reference.is_minimum & reference.in_pattern
    is_found = np.isfinite(found.pose).all(axis=0)
    both = exists & is_found
    pose = (found.pose - reference.pose)[:, both].astype(float)
    energy = np.abs((found.energy - reference.energy)[both].astype(float))
    distance, angle = np.hypot(pose[0], pose[1]), np.abs(pose[2])
    return {
        "n_missing": int((exists & ~is_found).sum()),
        "max_tip_error_mm": _largest(distance),
        "rms_tip_error_mm": _rms(distance),
        "max_angle_error_rad": _largest(angle),
        "rms_angle_error_rad": _rms(angle),
        "max_energy_error_mJ": _largest(energy),
        "rms_energy_error_mJ": _rms(energy),
    }


def chosen_patterns(n_units: int) -> Flags:
    """All patterns, or as many, evenly spread, as the reference can solve in some seconds."""
    most = min(MOST_STATES, max(4, MOST_UNITS_SOLVED // n_units))
    if 2**n_units <= most:
        return inverted_units(np.arange(2**n_units, dtype=np.uint64), n_units)
    last = 2**n_units - 1
    codes = [last * place // (most - 1) for place in range(most)]
    return inverted_units(np.array(codes, dtype=np.uint64), n_units)


def varied(finger: Finger, n_designs: int) -> Finger:
    """Designs whose strokes differ by up to 1 %."""
    factors = np.linspace(0.99, 1.01, n_designs)
    return finger.changed(stroke=finger.stroke * factors)


def _only(reference: ExtendedStates, few: slice) -> ExtendedStates:
    return ExtendedStates(*(values[..., few] for values in vars(reference).values()))


def _blank() -> BenchRow:
    empty: dict[Kind, Any] = {Kind.TEXT: "", Kind.COUNT: 0, Kind.FLAG: False}
    return {column.name: empty.get(column.kind, math.nan) for column in COLUMNS}


def _relative(row: BenchRow, kernel: Callable[[], object], repeats: int) -> float:
    """The shortest time of a state over that of the kernel, measured next to each other."""
    if "seconds_min" not in row:
        return math.nan
    return float(row["seconds_min"] / row["n_states"] / measured(kernel, repeats).wall_min)


def _times(times: Times, n_states: int) -> BenchRow:
    return {
        "seconds": times.wall,
        "seconds_min": times.wall_min,
        "seconds_max": times.wall_max,
        "cpu_seconds": times.cpu,
        "seconds_per_state": times.wall / n_states,
    }


def as_columns(rows: Sequence[BenchRow]) -> Columns:
    """Rows as the columns of one table."""
    return {column.name: np.array([row[column.name] for row in rows]) for column in COLUMNS}


def _largest(values: Array) -> float:
    return float(values.max()) if len(values) else math.nan


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else math.nan
