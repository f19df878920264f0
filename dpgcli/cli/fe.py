"""`dpg fe`: decks for the finite-element solver CalculiX, and the curves that it finds."""

import sys
import time
from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dpgcli.cli.commands import add_command
from dpgcli.cli.options import Patterns, Quiet, Settings, SpecPath
from dpgcli.cli.progress import under_way
from dpgcli.cli.streams import put, say
from dpgcli.cores import MOST_PROCESSES

if TYPE_CHECKING:
    from dpgcli.calibration.fe.hinge import HingeChambers
    from dpgcli.calibration.fe.models import Model
    from dpgcli.calibration.fe.pushed import Push
    from dpgcli.studies.finite_elements import Limits

app = typer.Typer(
    help="Finite elements of domes, hinges, units, fingers: decks for CalculiX, and its curves.",
    no_args_is_help=True,
)

DOME_KEYS = ("dome_height_mm", "dome_thickness_mm", "elastic_modulus_MPa")
HINGE_KEYS = (
    "chamber_length_mm",
    "chamber_width_mm",
    "dome_thickness_mm",
    "unit_separation_mm",
    "limiting_layer_thickness_mm",
    "elastic_modulus_MPa",
)
UNIT_KEYS = ("dome_height_mm", *HINGE_KEYS)
MOST_STATES = 256  # a minute each, or less


class Mesh(StrEnum):
    """How fine a mesh is."""

    COARSE = "coarse"
    MEDIUM = "medium"
    FINE = "fine"


Out = Annotated[
    Path, typer.Option("-o", "--output", metavar="FOLDER", help="Folder of deck and results")
]
Poisson = Annotated[float, typer.Option("--poisson", help="Poisson's ratio, below 0.5")]
MeshOption = Annotated[Mesh, typer.Option("--mesh", help="How fine the mesh is")]
PushStiffness = Annotated[
    float, typer.Option("--push-stiffness", help="Spring in the dome's place, N/mm")
]
RunOption = Annotated[bool, typer.Option("--run", help="Run ccx, write the curve")]
TimeLimit = Annotated[
    float, typer.Option("--time-limit", metavar="SECONDS", help="End ccx after this time")
]
Threads = Annotated[
    int, typer.Option("--threads", min=1, max=MOST_PROCESSES, help="Threads of ccx")
]


def dome(
    spec: SpecPath,
    out: Out,
    settings: Settings = None,
    base_diameter: Annotated[
        float, typer.Option("--base-diameter", help="Of the dome's mid-surface, mm")
    ] = 16.0,
    rim_radius: Annotated[
        float, typer.Option("--rim-radius", help="Where the annulus is fixed, mm")
    ] = 10.0,
    poisson: Poisson = 0.48,
    pressure: Annotated[
        float | None,
        typer.Option(
            "--pressure", metavar="MPA", help="Peak, MPa  [default: 1.25 times the expected snap]"
        ),
    ] = None,
    mesh: MeshOption = Mesh.MEDIUM,
    run: RunOption = False,
    time_limit: TimeLimit = 3600.0,
    threads: Threads = 1,
    quiet: Quiet = False,
) -> None:
    """Invert a dome by pressure: energy against pole travel."""
    from dpgcli.calibration.fe import models
    from dpgcli.calibration.fe.dome import DomeShape, impossible
    from dpgcli.errors import UsageError

    _check_positive(
        {"--base-diameter": base_diameter, "--rim-radius": rim_radius, "--pressure": pressure}
    )
    _check_poisson(poisson)
    height, thickness, modulus = _dimensions(spec, settings, DOME_KEYS, quiet)
    shape = DomeShape(height, thickness, modulus, poisson, base_diameter, rim_radius)
    if reason := impossible(shape):
        raise UsageError(f"no mesh of this dome: {reason} (--base-diameter, --rim-radius)")
    peak = models.expected_peak(shape) if pressure is None else pressure
    model = models.dome_model(shape, mesh.value, peak)
    _carry_out(model, spec, out, _limits(run, time_limit, threads), quiet)


def hinge(
    spec: SpecPath,
    out: Out,
    settings: Settings = None,
    poisson: Poisson = 0.48,
    moment: Annotated[float, typer.Option("--moment", help="Largest moment, N mm")] = 5.0,
    mesh: MeshOption = Mesh.MEDIUM,
    run: RunOption = False,
    time_limit: TimeLimit = 3600.0,
    threads: Threads = 1,
    quiet: Quiet = False,
) -> None:
    """Open the hinge between two chambers by a moment: moment against rotation."""
    from dpgcli.calibration.fe.hinge import HingeChambers
    from dpgcli.calibration.fe.models import hinge_model

    _check_positive({"--moment": moment})
    _check_poisson(poisson)
    length, width, lid, gap, layer, modulus = _dimensions(spec, settings, HINGE_KEYS, quiet)
    chambers = HingeChambers(length, width, lid, gap, layer, modulus, poisson)
    model = hinge_model(chambers, mesh.value, moment)
    _carry_out(model, spec, out, _limits(run, time_limit, threads), quiet)


def unit(
    spec: SpecPath,
    out: Out,
    settings: Settings = None,
    poisson: Poisson = 0.48,
    push_stiffness: PushStiffness = 50.0,
    moment: Annotated[
        float, typer.Option("--moment", help="Largest end couple, N mm; half of it and both signs")
    ] = 5.0,
    mesh: MeshOption = Mesh.MEDIUM,
    run: RunOption = False,
    time_limit: TimeLimit = 3600.0,
    threads: Threads = 1,
    quiet: Quiet = False,
) -> None:
    """Push the gap between two chambers open and bend it by end couples: hinge and walls."""
    from dpgcli.calibration.fe.models import unit_model

    _check_positive({"--moment": moment, "--push-stiffness": push_stiffness})
    chambers, push = _pushed(spec, settings, poisson, push_stiffness, quiet)
    model = unit_model(chambers, push, mesh.value, moment)
    _carry_out(model, spec, out, _limits(run, time_limit, threads), quiet)


def finger(
    spec: SpecPath,
    out: Out,
    settings: Settings = None,
    patterns: Patterns = None,
    poisson: Poisson = 0.48,
    push_stiffness: PushStiffness = 50.0,
    mesh: MeshOption = Mesh.MEDIUM,
    run: RunOption = False,
    time_limit: TimeLimit = 3600.0,
    threads: Threads = 1,
    quiet: Quiet = False,
) -> None:
    """Push gaps of a whole finger open, state by state: the table that `dpg compare` reads."""
    from dpgcli.calibration.fe.models import finger_model

    _check_positive({"--push-stiffness": push_stiffness})
    chambers, push = _pushed(spec, settings, poisson, push_stiffness, quiet)
    chosen = _chosen(spec, settings, patterns)
    model = finger_model(chambers, push, mesh.value, chosen)
    _carry_out(model, spec, out, _limits(run, time_limit, threads), quiet)


def _pushed(
    spec: Path, settings: list[str] | None, poisson: float, stiffness: float, quiet: bool
) -> "tuple[HingeChambers, Push]":
    """The chambers of a spec, and the spring in the place of its domes."""
    from dpgcli.calibration.fe.hinge import HingeChambers
    from dpgcli.calibration.fe.pushed import Push
    from dpgcli.design.geometry import stroke
    from dpgcli.errors import UsageError

    _check_poisson(poisson)
    height, length, width, lid, gap, layer, modulus = _dimensions(spec, settings, UNIT_KEYS, quiet)
    if (push := stroke(height, gap)) <= 0.0:
        raise UsageError(
            f"the dome does not reach its neighbor: dome_height_mm {height:g} is not above "
            f"unit_separation_mm {gap:g}"
        )
    return HingeChambers(length, width, lid, gap, layer, modulus, poisson), Push(
        stiffness, push, height
    )


def _chosen(
    path: Path, settings: list[str] | None, globs: list[str] | None
) -> "list[tuple[bool, ...]]":
    """The patterns to solve; all of them, where none is named, if they are few enough."""
    from dpgcli.errors import UsageError
    from dpgcli.files.scene_file import read_keys
    from dpgcli.states.patterns import inverted_units, select

    n_units = read_keys(path, settings or ()).finger.units
    selection = select(globs or ["*"], n_units)
    if len(selection) > MOST_STATES:
        raise UsageError(
            f"{len(selection)} states are too many for finite elements, at most {MOST_STATES}: "
            "choose some with --pattern"
        )
    codes = inverted_units(selection.codes(0, len(selection)), n_units).T
    chosen = [tuple(pattern) for pattern in codes.tolist()]
    if not any(map(any, chosen)):
        raise UsageError("nothing is pushed in state " + "0" * n_units)
    return chosen


def _check_positive(lengths: dict[str, float | None]) -> None:
    """Options that are neither zero nor negative, nor no number, nor beyond reason."""
    from dpgcli.design.dimensions import LARGEST, SMALLEST
    from dpgcli.errors import UsageError

    for option, value in lengths.items():
        if value is not None and not SMALLEST <= value <= LARGEST:
            raise UsageError(
                f"{option} {value:g}: expected a number > 0, {SMALLEST:g} to {LARGEST:g}"
            )


def _check_poisson(poisson: float) -> None:
    from dpgcli.errors import UsageError

    if not 0.0 <= poisson < 0.5:
        hint = "rubber is near 0.5, but 0.5 itself has no finite bulk modulus"
        raise UsageError(f"--poisson {poisson:g}: expected 0 to below 0.5 ({hint})")


def _dimensions(
    path: Path, settings: list[str] | None, keys: Sequence[str], quiet: bool
) -> list[float]:
    """The values of some keys of the spec's geometry, and a word on those of single units."""
    from dpgcli.files.scene_file import read_keys
    from dpgcli.files.scene_file.dimensions import dimensions, overridden

    spec = read_keys(path, settings or ())
    values = dimensions(spec, str(path), keys, "dpg fe builds its mesh from it")
    if not quiet and (units := overridden(spec, keys)):
        say(f"geometry of the whole finger; units {', '.join(units)} differ: --set their values")
    return list(values.values())


def _limits(run: bool, time_limit: float, threads: int) -> "Limits | None":
    """The limits of a run, none if none is wanted."""
    from dpgcli.studies.finite_elements import Limits

    _check_positive({"--time-limit": time_limit})
    return Limits(time_limit, threads) if run else None


def _carry_out(
    model: "Model", spec: Path, folder: Path, limits: "Limits | None", quiet: bool
) -> None:
    """Write the deck, run it if wanted, and name the files on standard output."""
    from dpgcli.files.output import Mark, check_outputs, sole_use
    from dpgcli.studies import finite_elements as studies

    deck, curve = studies.deck_path(model, folder), studies.curve_path(model, folder)
    with sole_use(folder):
        check_outputs((spec,), *((path, Mark.ANY) for path in studies.files(deck)))
        for path in studies.write_deck(model, folder):
            say(f"{path}: removed, it came from another deck")
        if limits is None:
            put(str(deck))
            return
        start = time.monotonic()
        try:
            with under_way(f"ccx on {deck}", quiet=quiet):
                finding = studies.run(model, folder, limits)
        finally:
            put(str(deck))
        put(str(curve))
    if not quiet:
        sys.stdout.flush()
        say(f"{finding} ({time.monotonic() - start:.3g} s)")


def _as_before(name: str) -> str:
    """`--output` for `--out`, its former name, for one version more."""
    return "output" if name == "out" else name


for _function in (dome, hinge, unit, finger):
    add_command(app, _function, "fe", context_settings={"token_normalize_func": _as_before})
