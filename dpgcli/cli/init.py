"""`dpg init`: commented files to start from."""

import os
from pathlib import Path
from typing import Annotated

import typer

from dpgcli.cli.streams import say

FINGER, GRIPPER, SWEEP = Path("finger.yaml"), Path("gripper.yaml"), Path("sweep.yaml")


def init(
    path: Annotated[
        Path | None,
        typer.Argument(
            help="File to write; - for standard output  "
            "[default: finger.yaml, gripper.yaml or sweep.yaml]"
        ),
    ] = None,
    has_gripper: Annotated[
        bool, typer.Option("--gripper", help="A gripper of two mirrored fingers")
    ] = False,
    is_sweep: Annotated[
        bool,
        typer.Option(
            "--sweep", help="A space of designs around a spec, which is written beside it if needed"
        ),
    ] = False,
    force: Annotated[bool, typer.Option("--force", help="Overwrite an existing file")] = False,
) -> None:
    """Write a commented spec or sweep to start from."""
    from dpgcli.files import scene_file, sweep_file

    spec, text = GRIPPER if has_gripper else FINGER, scene_file.starter(has_gripper=has_gripper)
    if is_sweep:
        _write_sweep(path or SWEEP, sweep_file.starter(spec.name), spec.name, text, force=force)
    elif _write(path or spec, text, force=force):
        say(f"wrote {path or spec}; next: dpg predict {path or spec}")


def _write_sweep(path: Path, text: str, base_name: str, base_text: str, *, force: bool) -> None:
    """The sweep, and its base unless that is there; what is there is never replaced."""
    from dpgcli.errors import OutputError, UsageError

    base = path.parent / base_name
    if os.path.realpath(path) == os.path.realpath(base):
        raise UsageError(f"{path} is the base of the sweep: give the sweep another name")
    if path == Path("-"):
        _write(path, text, force=force)
        return
    _check_new(path, force=force)
    is_there = os.path.lexists(base)
    if not is_there:
        _write(base, base_text, force=False)
    try:
        _write(path, text, force=force)
    except OutputError:
        if not is_there:  # half of a pair is none
            base.unlink()
        raise
    say(
        f"wrote {path}, around {base}, {'as it was there' if is_there else 'written with it'}; "
        f"next: dpg explain {path}, dpg sweep {path} --output out"
    )


def _write(path: Path, text: str, *, force: bool) -> bool:
    """Write a file whole, or standard output; whether it was a file."""
    import sys

    from dpgcli.files.output import Mark, whole_file

    if path == Path("-"):
        sys.stdout.write(text)
        return False
    _check_new(path, force=force)
    with whole_file(path, Mark.ANY) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")
    return True


def _check_new(path: Path, *, force: bool) -> None:
    """Raise OutputError for what is there, unless it is to be replaced."""
    from dpgcli.errors import OutputError

    if os.path.lexists(path) and not force:
        raise OutputError(f"{path} exists: give another name, or --force to overwrite it")
