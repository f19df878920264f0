"""Specs under pressure, as the functions that follow it take them."""

from dataclasses import dataclass

from dpgcli.actuation.pressed import Pressed
from dpgcli.api.inputs import SceneInput, Settings, SpecInput, scene_input, setting_texts
from dpgcli.design.pressure import Pressure
from dpgcli.errors import UsageError
from dpgcli.states.units import UnitSolutions

ONE_LINE = "pressure={}"  # of a spec that says nothing of it: one line, areas assumed


@dataclass(frozen=True)
class PressedInput:
    """A scene, its lines of pressure, and its finger under them."""

    given: SceneInput
    pressure: Pressure
    pressed: Pressed


def pressed_input(spec: SpecInput, settings: Settings = ()) -> PressedInput:
    """Read a spec; without a section on pressure all units are on one line, and areas assumed.

    Raises SpecError with all problems of the spec, UsageError for values without such a section.
    """
    given = scene_input(spec, settings)
    if given.scene.pressure is None and given.document is not None:
        given = scene_input(spec, (*setting_texts(settings), ONE_LINE))
    pressure = given.scene.pressure
    if pressure is None:
        raise UsageError("pressure is a section of a spec: hand in a spec, or a scene that has it")
    units = UnitSolutions.of(given.scene.finger)
    return PressedInput(given, pressure, Pressed.of(units, pressure))
