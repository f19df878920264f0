"""Specs under pressure, as the functions that follow it take them."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from dpgcli.actuation.pressed import Pressed
from dpgcli.api.inputs import SceneInput, Settings, SpecInput, scene_input
from dpgcli.design.pressure import Pressure
from dpgcli.errors import UsageError
from dpgcli.files.scene_file import checked, scene_of, with_files
from dpgcli.files.scene_file.settings import changed
from dpgcli.records import dataclass
from dpgcli.states.units import UnitSolutions

ONE_LINE: Mapping[str, Any] = {
    "pressure": {}
}  # of a spec that says nothing of it: one line, areas assumed


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
        document = changed(given.document, ONE_LINE)  # read once: it may be standard input
        known = checked(with_files(document, given.folder))
        given = replace(given, scene=scene_of(known), spec=known, document=document)
    pressure = given.scene.pressure
    if pressure is None:
        raise UsageError("pressure is a section of a spec: hand in a spec, or a scene that has it")
    units = UnitSolutions.of(given.scene.finger)
    return PressedInput(given, pressure, Pressed.of(units, pressure))
