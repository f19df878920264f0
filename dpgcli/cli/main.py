"""The `dpg` program."""

import os
from typing import Annotated

import typer

from dpgcli import __version__
from dpgcli.cli import (
    bench,
    check,
    compare,
    explain,
    fe,
    fit,
    init,
    merge,
    predict,
    report,
    schema,
    stress,
    sweep,
    validate,
)
from dpgcli.cli.exits import command, run_and_exit

# Small matrices gain nothing from threads; set before NumPy is loaded.
for _library in ("OPENBLAS", "MKL", "OMP"):
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")

app = typer.Typer(
    name="dpg",
    help="Stable shapes of multistable soft grippers, predicted by a lumped spring lattice.",
    epilog="Exit codes: 0 done, 1 a requirement is not met or a hard case fails, 2 usage or spec, "
    "3 internal error, 4 more failed cases than --max-failed, or no worker, 5 nothing selected, "
    "130/143 interrupted.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)
for _function in (
    predict.predict,
    explain.explain,
    sweep.sweep,
    merge.merge,
    check.check,
    report.report,
    bench.bench,
    compare.compare,
    stress.stress,
    validate.validate,
    init.init,
    schema.schema,
):
    app.command()(command(_function))
app.add_typer(fit.app, name="fit")
fe.app.command()(command(fe.dome))
fe.app.command()(command(fe.hinge))
app.add_typer(fe.app, name="fe")


def _version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        from dpgcli.code import sha256_of_code

        print(f"dpg {__version__}")
        libraries = (f"{name} {version(name)}" for name in ("numpy", "scipy", "pyarrow"))
        print(f"package {sha256_of_code()[:16]}, {', '.join(libraries)}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version")
    ] = False,
) -> None:
    """Stable shapes of multistable soft grippers, predicted by a lumped spring lattice."""


def main() -> None:
    """Run the program."""
    run_and_exit(app)
