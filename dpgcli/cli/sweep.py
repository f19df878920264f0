"""`dpg sweep`: the design space, into two tables."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from dpgcli.cli.options import Quiet, Settings, Tolerance

JOBS = "Worker processes  [default: cores]"


def sweep(
    spec: Annotated[Path, typer.Argument(metavar="SWEEP", help="YAML file of a sweep")],
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder of the tables")],
    jobs: Annotated[int | None, typer.Option("-j", "--jobs", min=1, help=JOBS)] = None,
    settings: Settings = None,
    tolerance: Tolerance = None,
    restart: Annotated[
        bool, typer.Option("--restart", help="Drop what an unfinished sweep left")
    ] = False,
    force: Annotated[bool, typer.Option("--force", help="Go on even if the disk is small")] = False,
    quiet: Quiet = False,
) -> None:
    """Evaluate every design of a space, resumably."""
    import os

    from dpgcli.exploration.executors import SerialExecutor, process_pool
    from dpgcli.files.sweep import read_sweep
    from dpgcli.states.plan import DEFAULT_TOLERANCE
    from dpgcli.studies.sweep import Study

    study = Study(read_sweep(spec, settings or ()), output, tolerance or DEFAULT_TOLERANCE)
    if study.is_up_to_date:
        print(f"{output}: up to date", file=sys.stderr)
        return
    if restart:
        study.drop_unfinished()
    study.check_unfinished()
    if not force:
        study.check_room()
    n_workers = jobs or os.cpu_count() or 1
    make = process_pool if n_workers > 1 else lambda _: SerialExecutor()
    progress = study.compute(make, n_workers, lambda _: None)
    study.assemble()
    if not quiet:
        print(progress, file=sys.stderr)
