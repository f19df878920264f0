"""The `dpg` program."""

import os
from collections.abc import Iterator, Mapping
from importlib import import_module
from typing import Annotated, Any

import typer

from dpgcli.cli.commands import CommandGroup, add_command
from dpgcli.cli.exits import run_and_exit

# Small matrices gain nothing from threads; set before NumPy is loaded.
for _library in ("OPENBLAS", "MKL", "OMP"):
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")
# Arrow's own allocators give back memory that is wanted again at once: fresh pages for each block.
os.environ.setdefault("ARROW_DEFAULT_MEMORY_POOL", "system")
# Pydantic would look for plugins among everything that is installed.
os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")

NAMES = (
    *("predict", "explain", "sweep", "merge", "check", "pick", "report", "design", "bench"),
    *("compare", "stress", "actuate", "transitions", "pulses", "landscape", "grasp", "routine"),
    *("validate", "init", "schema", "fit", "fe", "help"),
)


class Commands(Mapping[str, Any]):
    """Commands by name, each imported when it is asked for: one of them is, and help asks all."""

    def __getitem__(self, name: str) -> Any:
        if name not in NAMES:
            raise KeyError(name)
        module = import_module(f"dpgcli.cli.{name}")
        app = typer.Typer(add_completion=False, rich_markup_mode=None)
        if hasattr(module, "app"):  # commands of its own
            app.add_typer(module.app, name=name, cls=CommandGroup)
        else:
            add_command(app, getattr(module, name))
        return typer.main.get_group(app).commands[name]

    def __iter__(self) -> Iterator[str]:
        return iter(NAMES)

    def __len__(self) -> int:
        return len(NAMES)


class _Program(CommandGroup):
    def __init__(self, **named: Any) -> None:
        super().__init__(**{**named, "commands": Commands()})


app = typer.Typer(
    name="dpg",
    cls=_Program,
    help="Stable shapes of multistable soft grippers, predicted by a lumped spring lattice.",
    epilog="Exit codes: 0 done, 1 a requirement is not met or a hard case fails, 2 usage or spec, "
    "3 internal error, 4 more failed cases than --max-failed, or no worker, 5 nothing selected, "
    "130/143 interrupted.",
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)


def _version(context: typer.Context, wanted: bool) -> None:
    if wanted:
        from dpgcli.cli.version import print_version

        print_version(verbose=context.params["verbose"])
        raise typer.Exit


@app.callback()
def options(
    verbose: Annotated[  # before the version, which looks at it
        bool,
        typer.Option("-v", "--verbose", is_eager=True, help="With -V: what was found here, too"),
    ] = False,
    version: Annotated[
        bool, typer.Option("-V", "--version", callback=_version, help="Show the version")
    ] = False,
) -> None:
    """Stable shapes of multistable soft grippers, predicted by a lumped spring lattice."""
    if verbose:
        raise typer.BadParameter("--verbose goes with --version")


def main() -> None:
    """Run the program."""
    run_and_exit(app)
