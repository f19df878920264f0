"""`dpg grasp`: what the fingers of a gripper do with a body between them."""

import sys
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dpgcli.cli.options import (
    LONG,
    Patterns,
    Pressures,
    Quiet,
    Settings,
    SpecPath,
    TableFile,
    check_plot,
    check_table_name,
    point,
)
from dpgcli.cli.printing import ROWS_SHOWN, Format, print_rows
from dpgcli.cli.progress import under_way
from dpgcli.cli.streams import say
from dpgcli.text import counted

if TYPE_CHECKING:
    from dpgcli.api.grasp import GraspResult
    from dpgcli.api.inputs import SceneInput
    from dpgcli.grasping.costs import Work

Body = Annotated[
    str | None,
    typer.Option(
        "--object",
        metavar="BODY",
        help="Body: disc:40, jaws:30x40 or a YAML file; without one two fingers meet",
    ),
]
Place = Annotated[
    str | None,
    typer.Option("--at", metavar="X,Y", help="Its place in the gripper's frame, in mm: 40,0"),
]
Both = Annotated[
    bool, typer.Option("--both", help="All pairs of states, of the upper and the lower finger")
]
JawGaps = Annotated[
    str | None,
    typer.Option(
        "--jaws", metavar="FROM:TO", help="Open jaws from one aperture to another, and back: 10:60"
    ),
]


class ApproachName(StrEnum):
    """How fingers and a body come to touch."""

    PLACE = "place"
    CLOSE = "close"
    INSERT = "insert"


Coming = Annotated[
    ApproachName,
    typer.Option(
        "--approach",
        help="It grows at its place, fingers close on it by --pressure, or it moves in along -x",
    ),
]
Plot = Annotated[
    Path | None,
    typer.Option("--plot", metavar="FILE", help="Draw each grasp: a .svg or .png file"),
]


def grasp(
    spec: SpecPath,
    body: Body = None,
    at: Place = None,
    patterns: Patterns = None,
    both: Both = False,
    approach: Coming = ApproachName.PLACE,
    pressure: Pressures = None,
    jaws: JawGaps = None,
    settings: Settings = None,
    printed_as: Annotated[
        Format | None, typer.Option("--format", help="How to print the grasps")
    ] = None,
    output: TableFile = None,
    plot: Plot = None,
    quiet: Quiet = False,
) -> None:
    """Let fingers close on a body, or on each other: contacts, forces, and which units reset."""
    from dpgcli.api.grasp import (
        check_drawable,
        check_work,
        grasp_input,
        grasp_of,
        pairs_of,
        patterns_of,
        work_of,
    )
    from dpgcli.api.inputs import scene_input
    from dpgcli.files.output import Mark, check_outputs
    from dpgcli.grasping.approach import Way

    if plot is not None:
        check_plot(plot)
    check_table_name(output)
    way, place = Way(approach.value), point("--at", at)
    if jaws is not None:
        _check_alone(body, both, approach, pressure)
        given = scene_input(spec, settings or ())
        _open_jaws(given, jaws, place, patterns, printed_as, output, plot, quiet)
        return
    given, closing = grasp_input(spec, body, place, settings or (), way, pressure)
    chosen = patterns_of(given.scene, closing, patterns or None)
    pairs = pairs_of(chosen, given.scene, both)
    if plot is not None:
        check_drawable(len(pairs[0]))
    check_outputs(given.files, (output, Mark.TABLE), (plot, Mark.FIGURE))
    work = work_of(given.scene, pairs, way, closing)
    check_work(work)
    if work.seconds > LONG and not quiet:
        say(_expected(work))
    with under_way("closing the fingers", quiet=quiet):
        found = grasp_of(given, chosen, both, way, closing)
    if output is not None:
        found.save(output)
    if plot is not None:
        found.draw(plot)
    is_shown = printed_as is not None or output is None
    _tell(found, printed_as, is_shown or len(found.rows["pattern"]) <= ROWS_SHOWN, quiet)


def _tell(found: "GraspResult", printed_as: Format | None, is_shown: bool, quiet: bool) -> None:
    """Rows, and what is said of them."""
    if is_shown:
        print_rows(found.columns, found.rows, printed_as or Format.TABLE)
    sys.stdout.flush()
    if not quiet:
        for line in found.summary:
            say(line)


def _expected(work: "Work") -> str:
    """What is said before long work."""
    from dpgcli.sweeps.extent import size_text, time_text

    return (
        f"{counted(work.n_rows, 'grasp')} of {counted(work.n_states, 'state')}: about "
        f"{time_text(work.seconds)} on one core and {size_text(work.peak_bytes)} of memory (rough)"
    )


def _check_alone(
    body: str | None, both: bool, approach: ApproachName, pressure: list[str] | None
) -> None:
    """Raise UsageError for options that jaws have no use for."""
    from dpgcli.errors import UsageError

    given = {
        "--object": body is not None,
        "--both": both,
        "--approach": approach is not ApproachName.PLACE,
        "--pressure": bool(pressure),
    }
    if idle := [option for option, is_given in given.items() if is_given]:
        raise UsageError(
            f"--jaws goes without {' and '.join(idle)}: they grow at their place, and "
            "both fingers are in the same state"
        )


def _open_jaws(
    given: "SceneInput",
    jaws: str,
    at: tuple[float, float] | None,
    patterns: list[str] | None,
    printed_as: Format | None,
    output: Path | None,
    plot: Path | None,
    quiet: bool,
) -> None:
    """Force by the aperture of jaws, for each state."""
    from dpgcli.api.grasp import check_drawable
    from dpgcli.api.jaws import jaws_of, states_of
    from dpgcli.files.output import Mark, check_outputs
    from dpgcli.grasping.costs import jaw_seconds
    from dpgcli.grasping.jaw_table import COLUMNS
    from dpgcli.sweeps.extent import time_text

    gaps, chosen = _gaps(jaws), tuple(patterns or ("*",))
    n_states = len(states_of(given.scene, chosen))
    if plot is not None:
        check_drawable(n_states)
    check_outputs(given.files, (output, Mark.TABLE), (plot, Mark.FIGURE))
    seconds = jaw_seconds(given.scene, n_states)
    if seconds > LONG and not quiet:
        many, took = counted(n_states, "state"), time_text(seconds)
        say(f"{many}: about {took} on one core (rough)")
    with under_way("opening the jaws", quiet=quiet):
        found = jaws_of(given, gaps, at, chosen)
    if output is not None:
        found.save(output)
    if plot is not None:
        found.draw(plot)
    print_rows(COLUMNS, found.rows, printed_as or Format.TABLE)
    sys.stdout.flush()
    if not quiet:
        for line in found.summary:
            say(line)


def _gaps(text: str) -> tuple[float, float]:
    """Two apertures in mm. Raises UsageError for a text that is no such two."""
    from dpgcli.errors import UsageError
    from dpgcli.text import number_in

    numbers = [number_in(part) for part in text.split(":")]
    if len(numbers) != 2 or any(number != number for number in numbers):
        raise UsageError(f"--jaws {text}: expected two apertures in mm, such as 10:60")
    return numbers[0], numbers[1]
