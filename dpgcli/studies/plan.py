"""The plan of a sweep: what it will come to, before any of it is done."""

import numpy as np

from dpgcli.design.dimensions import UNITS
from dpgcli.design.outputs import Trust
from dpgcli.errors import UsageError
from dpgcli.files.sweep_file import Sweep
from dpgcli.records import dataclass
from dpgcli.studies.sweep import Study
from dpgcli.sweeps.executors import chunked
from dpgcli.sweeps.extent import ASKED_AT_ONCE, MOST_ASKED


@dataclass(frozen=True)
class SweepPlan:
    """What a sweep will come to; time, disk and memory to a factor of two either way.

    In spaces of up to a million designs each is looked at: `n_excluded` do not meet a constraint,
    `n_invalid` are no fingers that can exist, and `n_states` is the number of states that will be
    computed. In larger ones the first two are None, and the states are those of all designs.
    `refusal` says why `sweep` will not begin on this machine, if it will not. `trusts` are what
    outputs rest on, at worst of all designs, `warnings` those of the calibrations in use.
    """

    sweep: Sweep
    n_designs: int
    n_excluded: int | None
    n_invalid: int | None
    n_states: int
    most_units: int
    expected_seconds: float
    expected_disk_bytes: int
    expected_memory_bytes: int
    refusal: str
    trusts: tuple[Trust, ...]
    warnings: tuple[str, ...]


def plan_of_sweep(study: Study) -> SweepPlan:
    """The plan of a study; nothing is solved, nothing written."""
    space, extent = study.sweep.space, study.extent
    unseen = (None, None, extent.n_states, extent.most_units)
    is_counted = space.size <= MOST_ASKED
    n_excluded, n_invalid, n_states, most_units = _counted(study) if is_counted else unseen
    return SweepPlan(
        study.sweep,
        space.size,
        n_excluded,
        n_invalid,
        n_states,
        most_units,
        extent.seconds_of(n_states),
        extent.bytes_of(n_states),
        extent.bytes_in_memory,
        _refusal(study),
        study.trusts,
        study.warnings,
    )


def nothing_to_solve(study: Study) -> str:
    """Why no design of a study can be solved; empty where one can, or where they are too many."""
    space = study.sweep.space
    if space.size > MOST_ASKED:
        return ""
    reason = ""
    for chunk in chunked([(0, space.size)], ASKED_AT_ONCE):
        values = space.designs(chunk.start, chunk.stop)
        if study.evaluation.exist(values)[1].any():
            return ""
        reason = reason or study.evaluation.reason(values)
    return reason or "constraints exclude all of them"


def _counted(study: Study) -> tuple[int, int, int, int]:
    """Designs that are excluded or invalid, and of all others the states and the most units."""
    evaluation, space = study.evaluation, study.sweep.space
    n_excluded = n_invalid = n_states = most_units = 0
    for chunk in chunked([(0, space.size)], ASKED_AT_ONCE):
        values = space.designs(chunk.start, chunk.stop)
        allowed, right = evaluation.exist(values)
        n_excluded += int((~allowed).sum())
        n_invalid += int((allowed & ~right).sum())
        units = values.get(UNITS, np.full(len(right), study.sweep.base.finger.units))
        numbers = units[right].astype(np.int64).tolist()  # of designs that exist: whole ones
        n_states += sum(1 << n for n in numbers)
        most_units = max([most_units, *numbers])
    return n_excluded, n_invalid, n_states, most_units


def _refusal(study: Study) -> str:
    try:
        study.extent.check(study.chunk_size, is_sent=False)
        study.check_memory()
    except UsageError as error:
        return error.message
    return ""
