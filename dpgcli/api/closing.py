"""Fingers that close on a body by pressure: what `grasp` needs beside the body."""

from collections.abc import Callable
from dataclasses import replace

from dpgcli.actuation.graph import rests
from dpgcli.actuation.pressed import Pressed
from dpgcli.api.histories import PressureInput, history_input
from dpgcli.api.inputs import SceneInput, Settings, SpecInput
from dpgcli.api.pressure import pressed_input
from dpgcli.design.scene import Scene
from dpgcli.errors import Field, UsageError
from dpgcli.grasping.closing import Closing
from dpgcli.states.units import UnitSolutions


def closing_input(
    spec: SpecInput,
    settings: Settings,
    pressure: PressureInput | None,
    completed: Callable[[SceneInput], SceneInput],
) -> tuple[SceneInput, Closing]:
    """A spec `completed` by a body, and the pressures by which its fingers close.

    They are those given, else those of the spec. Raises SpecError for a wrong spec or history,
    UsageError with all that is missing, and for a history that does not end at 0 MPa.
    """
    pressed, missing = pressed_input(spec, settings), list[UsageError]()
    given = history = None
    try:
        given = completed(pressed.given)
    except UsageError as error:
        missing.append(error)
    try:
        history = history_input(pressure, pressed.pressure)
    except UsageError as error:
        missing.append(error)
    if given is None or history is None:
        first, *others = (error.message for error in missing)
        raise UsageError(first, *(part for other in others for part in ("\n", other)))
    last = history.history.pressure[-1]
    if last.any():
        ended = ", ".join(f"{value:g}" for value in last)
        hint = " MPa: expected 0 at the end, as a grasp is what is left without pressure"
        raise UsageError(Field("pressure"), f" ends at {ended}{hint}")
    given = replace(given, files=(*given.files, *history.files))
    volumes = pressed.pressed.volumes
    return given, Closing(volumes, pressed.pressure, history.history)


def rest_of(scene: Scene, closing: Closing) -> str:
    """The pattern in which fingers rest before any pressure, 0…0 where that is not known."""
    pressed = Pressed(UnitSolutions.of(scene.finger), closing.volumes)
    (code,), (is_certain,) = rests(pressed, 1)
    return f"{int(code) if is_certain else 0:0{scene.finger.n_units}b}"
