"""`dpg stress`: stiff and extreme cases beside extended precision."""

import math
import sys
from collections import Counter
from collections.abc import Iterator
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated

import typer

from dpgcli.cli.exits import ExitCode
from dpgcli.cli.options import Quiet, Settings, check_table_name
from dpgcli.cli.printing import Format, print_grid, printer_of
from dpgcli.cli.progress import ProgressLine
from dpgcli.cli.streams import put, say

if TYPE_CHECKING:
    from dpgcli.api.stress import HardCases, StressResult
    from dpgcli.arrays import Columns
    from dpgcli.hard_cases.outcomes import Outcome
    from dpgcli.hard_cases.table import FamilySummary
    from dpgcli.mechanics.finger import Finger

MISSED = "Missed, where node coordinates or the guess that was given end"
MARGINS = (
    "Values of each unit, and where each alone would cost it its second well (bars as if rigid)"
)


def stress(
    spec: Annotated[
        Path | None,
        typer.Argument(metavar="SPEC", help="YAML spec; none: the built-in cases alone"),
    ] = None,
    only: Annotated[
        list[str] | None,
        typer.Option("--only", metavar="FAMILY", help="Only these families; repeatable"),
    ] = None,
    settings: Settings = None,
    printed_as: Annotated[
        Format, typer.Option("--format", help="A summary, or every case as json or csv")
    ] = Format.TABLE,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", metavar="FILE", help="Write every case to this Parquet file"
        ),
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Compare stiff and extreme cases with extended precision."""
    from dpgcli.api.stress import hard_cases
    from dpgcli.files.output import Mark, check_outputs

    cases = hard_cases(spec, only or (), settings or ())
    check_outputs(cases.given.files if cases.given else (), (output, Mark.TABLE))
    check_table_name(output)
    began = perf_counter()
    finger = cases.given.scene.finger if cases.given else None
    found = cases.result(_printed(printed_as, _progress(cases, quiet), finger))
    if output is not None:
        found.save(output)
    if not quiet:
        sys.stdout.flush()
        say(_summary(found, perf_counter() - began))
    if found.failures:
        raise typer.Exit(ExitCode.REQUIREMENT)


def _progress(cases: "HardCases", quiet: bool) -> Iterator["Outcome"]:
    """Outcomes as they come, with progress."""
    line = ProgressLine(len(cases.cases), "cases", quiet=quiet)
    for done, outcome in enumerate(cases.outcomes(), start=1):
        yield outcome
        line.show(done)
    line.clear()


def _printed(
    printed_as: Format, coming: Iterator["Outcome"], finger: "Finger | None"
) -> list["Outcome"]:
    """All outcomes: printed one by one as they come, or in tables at the end."""
    from dpgcli.hard_cases.table import STRESS_COLUMNS, rows

    outcomes: list[Outcome] = []

    def blocks() -> Iterator["Columns"]:
        for outcome in coming:
            outcomes.append(outcome)
            yield rows([outcome])

    if printed_as is Format.TABLE:
        outcomes += coming
        _print_tables(outcomes, finger)
    else:
        for _ in printer_of(printed_as)(STRESS_COLUMNS, blocks()):
            pass
    return outcomes


def _print_tables(outcomes: list["Outcome"], finger: "Finger | None") -> None:
    """Families by whose finger it is, cases that matter in full, and the finger's margins."""
    from dpgcli.hard_cases.table import summarized

    summaries = summarized(outcomes)
    titles = {"spec": "The spec's finger", "built-in": "The study's finger"}
    for subject in dict.fromkeys(summary.subject for summary in summaries):
        own = [_family(summary) for summary in summaries if summary.subject == subject]
        _print_table(titles[subject], own)
    failing = [outcome for outcome in outcomes if outcome.is_failure]
    missed = [o for o in outcomes if o.verdict == "missed" and not o.is_failure]
    _print_table("Failures", _in_full(failing))
    _print_table(MISSED, _in_full(missed))
    if finger is not None:
        _print_table(MARGINS, _margins(finger))


def _print_table(title: str, records: list[dict[str, str]]) -> None:
    """Print records of the same names under a title, if there are any."""
    left = ("subject", "family", "case", "formulation", "pattern", "verdict", "status", "units")
    if records:
        names = dict.fromkeys(name for record in records for name in record)
        texts = {name: [record.get(name, "-") for record in records] for name in names}
        put(f"{title}\n")
        print_grid(texts, left=(*left, "reached_pattern"))
        put("")


def _family(summary: "FamilySummary") -> dict[str, str]:
    counts = {verdict.value: str(n) for verdict, n in summary.verdicts.items()}
    errors = {
        "threshold_error": summary.true_threshold_error,
        "force_error_N": summary.true_force_error,
    }
    return {
        "family": summary.family,
        "formulation": summary.formulation,
        "cases": str(summary.n_cases),
        **counts,
        "failures": str(summary.n_failures),
        "residual_N": _rounded(summary.residual),
        "over_floor": _rounded(summary.residual_over_floor),
        "condition": _rounded(summary.condition),
        "true_tip_error_mm": _rounded(summary.true_tip_error),
        "iterations": f"{summary.iterations:.0f}" if summary.iterations >= 0 else "-",
        **{name: _rounded(error) for name, error in errors.items() if not math.isnan(error)},
    }


def _in_full(outcomes: list["Outcome"]) -> list[dict[str, str]]:
    """All that is known of some cases."""
    from dpgcli.hard_cases.table import STRESS_COLUMNS, rows
    from dpgcli.states.columns import Kind
    from dpgcli.states.rows import as_text

    values = rows(outcomes)
    texts = {
        column.name: [
            _rounded(value) if column.kind is Kind.NUMBER else str(value)
            for value in as_text(column, values[column.name]).tolist()
        ]
        for column in STRESS_COLUMNS
        if column.kind is not Kind.FLAG
    }
    return [dict(zip(texts, row, strict=True)) for row in zip(*texts.values(), strict=True)]


def _margins(finger: "Finger") -> list[dict[str, str]]:
    """One record for each run of equal units."""
    import numpy as np

    from dpgcli.states.margins import NAMES, limits

    ends = limits(finger)
    columns = []
    for name in NAMES:
        values = np.broadcast_to(finger.arrays()[name], (finger.n_units, 1))[:, 0]
        pairs = zip(values, getattr(ends, name), strict=True)
        columns.append([_to_the_end(value, end) for value, end in pairs])
    records = []
    for cells, members in groupby(enumerate(zip(*columns, strict=True), 1), itemgetter(1)):
        units = sorted({unit for unit, _ in members})
        named = f"{units[0]}-{units[-1]}" if len(units) > 1 else str(units[0])
        heads = ("force_linearity", "hinge_stiffness_N_mm_per_rad", "stroke_mm")
        records.append({"units": named, **dict(zip(heads, cells, strict=True))})
    return records


def _to_the_end(value: float, end: float) -> str:
    """A value, and the one at which the second well goes; none has one, or no value loses it."""
    if math.isfinite(end):
        return f"{value:.6g} (goes at {end:.6g})"
    return f"{value:.6g} ({'never goes' if end > 0.0 else 'none'})"


def _rounded(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.1e}"


def _summary(found: "StressResult", seconds: float) -> str:
    outcomes = found.outcomes
    counts = Counter(outcome.verdict.value for outcome in outcomes)
    verdicts = ", ".join(f"{n:,} {verdict}" for verdict, n in counts.most_common())
    n_failures = len(found.failures)
    failures = f"{n_failures} failure{'s' * (n_failures != 1)}"
    return f"{len(outcomes):,} cases in {seconds:.0f} s: {verdicts}; {failures}"
