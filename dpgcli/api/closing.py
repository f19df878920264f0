"""Fingers that close on a body by pressure: what `grasp` needs beside the body."""

from dataclasses import replace

from dpgcli.api.histories import PressureInput, history_input
from dpgcli.api.inputs import SceneInput, Settings, SpecInput
from dpgcli.api.pressure import pressed_input
from dpgcli.errors import Field, UsageError
from dpgcli.grasping.closing import Closing
from dpgcli.mechanics.laws import PushOnly

PUSHED = (
    ": domes that only push leave their neighbors as pressures change, which is not computed "
    "beside a body; take finger.law: published or tabulated"
)


def closing_input(
    spec: SpecInput, settings: Settings, pressure: PressureInput | None
) -> tuple[SceneInput, Closing]:
    """A spec, and the pressures by which its fingers close: as given, else those of the spec.

    Raises SpecError for a wrong spec or history, UsageError for one that does not end at 0 MPa, or
    for domes that only push.
    """
    pressed = pressed_input(spec, settings)
    history = history_input(pressure, pressed.pressure)
    if isinstance(pressed.pressed.finger.law, PushOnly):
        approach = Field("approach")
        raise UsageError(approach, " close", PUSHED, ", or another ", approach)
    last = history.history.pressure[-1]
    if last.any():
        ended = ", ".join(f"{value:g}" for value in last)
        hint = " MPa: expected 0 at the end, as a grasp is what is left without pressure"
        raise UsageError(Field("pressure"), f" ends at {ended}{hint}")
    given = replace(pressed.given, files=(*pressed.given.files, *history.files))
    volumes = pressed.pressed.volumes
    return given, Closing(volumes, pressed.pressure, history.history)
