"""Commands as the program lists them: descriptions whole, examples at the end of each help."""

from collections.abc import Callable
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup

from dpgcli.cli.examples import EXAMPLES
from dpgcli.cli.exits import command

WHOLE = 1000  # characters: no description is longer
EMPTY = "is empty: expected a value"


class Command(TyperCommand):
    """A command whose epilog is a list of examples."""

    def parse_args(self, ctx: typer.Context, args: list[str]) -> list[str]:  # type: ignore[override]
        """Refuse empty texts, of variables that are not set: a path of them is this folder."""
        given, _, _ = self.make_parser(ctx).parse_args(args=[*args])
        for parameter in () if ctx.resilient_parsing else self.params:
            said = given.get(parameter.name)
            if "" in (said if isinstance(said, list | tuple) else (said,)):
                raise typer.BadParameter(EMPTY, ctx, parameter)  # type: ignore[arg-type]
        return super().parse_args(ctx, args)

    def get_short_help_str(self, limit: int = 0) -> str:
        """The description, however narrow the terminal."""
        return super().get_short_help_str(WHOLE)

    def format_epilog(self, _: typer.Context, formatter: Any) -> None:  # type: ignore[override]
        """Examples as they are typed: no line is broken."""
        with formatter.section("Examples"):
            for line in (self.epilog or "").splitlines():
                formatter.write(f"{'':{formatter.current_indent}}{line}\n")


class CommandGroup(TyperGroup):
    """A command of several."""

    def get_short_help_str(self, limit: int = 0) -> str:
        """The description, however narrow the terminal."""
        return super().get_short_help_str(WHOLE)


def add_command(
    app: typer.Typer, function: Callable[..., None], group: str = "", **settings: Any
) -> None:
    """Add a function as the command of its name, with its exit codes and examples."""
    name = f"{group} {function.__name__}".strip()
    app.command(cls=Command, epilog="\n".join(EXAMPLES[name]), **settings)(command(function))
