"""`dpg init`: a commented spec to start from."""

from pathlib import Path
from typing import Annotated

import typer

from dpgcli.cli.streams import say


def init(
    path: Annotated[Path, typer.Argument(help="File to write; - for standard output")] = Path(
        "finger.yaml"
    ),
    force: Annotated[bool, typer.Option("--force", help="Overwrite an existing file")] = False,
) -> None:
    """Write a commented spec to start from."""
    import os
    import sys

    from dpgcli.errors import OutputError
    from dpgcli.files.output import Mark, whole_file
    from dpgcli.files.scene_file import starter

    if path == Path("-"):
        sys.stdout.write(starter())
        return
    if os.path.lexists(path) and not force:
        raise OutputError(f"{path} exists: give another name, or --force to overwrite it")
    with whole_file(path, Mark.ANY) as temporary:
        temporary.write_text(starter(), encoding="utf-8", newline="\n")
    say(f"wrote {path}; next: dpg predict {path}")
