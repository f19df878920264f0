"""Bodies as arguments: texts such as "disc:40", files, places; and which of them can be grasped."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from dpgcli.api.arguments import check_texts, files_of, path_of, point
from dpgcli.api.inputs import SceneInput, Settings, setting_texts
from dpgcli.arrays import Array
from dpgcli.design.bodies import FRICTION, MASS, PLACES, Body, Jaws, gives_way
from dpgcli.design.outputs import Output
from dpgcli.design.scene import Held, Scene
from dpgcli.errors import Field, UsageError
from dpgcli.files.scene_file import folder_of
from dpgcli.files.scene_file.forces import with_forces
from dpgcli.files.scene_file.objects import PLACE, TABLE
from dpgcli.files.scene_file.problems import checked_object
from dpgcli.files.scene_file.settings import with_settings
from dpgcli.files.yaml_file import Document, read_document
from dpgcli.grasping.frames import begins_in_base
from dpgcli.text import number_in, shortened

SMALLEST, LARGEST = 1e-3, 1e4  # mm: of what a text says
JAW_HEIGHT = 40.0  # mm, unless the text says it
SUFFIXES = (".yaml", ".yml")
OWN = "object."  # settings of the body
NO_BODY = ": expected a body such as disc:40, here or as object in the spec"
KINDS = (
    "expected disc and its diameter in mm such as disc:40, jaws and their gap such as jaws:30 or "
    f"jaws:30x40 with their height, each from {SMALLEST:g} to {LARGEST:g}, or a .yaml file"
)


def own_settings(settings: Settings, said: str | None) -> tuple[Settings, tuple[str, ...]]:
    """The settings of a spec, and those of the body that is said instead of the spec's own.

    >>> own_settings({"finger.units": 3, "object.held": "free"}, "disc:40")
    (('finger.units=3',), ('object.held="free"',))
    """
    if said is None:
        return settings, ()
    texts = setting_texts(settings)
    of_body = tuple(text for text in texts if text.lstrip().startswith(OWN))
    return tuple(text for text in texts if text not in of_body), of_body


def with_body(
    given: SceneInput, said: str | None, at: Sequence[float] | None, settings: Sequence[str] = ()
) -> SceneInput:
    """The same with the body of these arguments, or of its own.

    A text says what it is or names a file of the keys of `object`; `at` is its place, `settings`
    are "object.key=value" texts. A gripper may go without. Raises UsageError for what is no body,
    SpecError for a wrong file.
    """
    check_texts(object=said)
    scene, known = given.scene, given.scene.body
    place = None if at is None else np.array(point("at", at))
    if said is None:
        if known is None and scene.gripper is not None and place is None:
            return given
        if known is None:
            hint = "" if scene.gripper is not None else "; two fingers, of a gripper, go without"
            raise UsageError(Field("object"), NO_BODY + hint)
        body = known if place is None else replace(known, center=place)
        return replace(given, scene=replace(scene, body=body))
    whole = _document(said)
    whole = replace(whole, data=_completed(whole.data, scene, place))
    own = (text.lstrip().removeprefix(OWN) for text in settings)
    document = with_forces(with_settings(whole, [*own]), folder_of(whole.file), TABLE)
    if PLACE not in document.data and not document.data.keys() >= {*PLACES}:
        raise UsageError(Field("at"), ": expected the place of the body in mm, such as 40,0")
    spec = checked_object(document)
    scene = replace(
        scene,
        body=_giving_way(spec.known, known),
        held=Held(spec.held) if "held" in spec.model_fields_set else scene.held,
        friction=spec.known_friction,
    )
    files = files_of(*whole.files, *document.files)
    return replace(given, scene=scene, files=(*given.files, *files))


def _document(said: str) -> Document:
    """The keys of a body: those in a file of this name, or those that a text stands for."""
    if not said.lower().endswith(SUFFIXES):
        return Document(str(Field("object")), _of_text(said), {})
    path = path_of("object", said)
    document = read_document(path)
    return replace(document, files=(path,))


def _completed(data: dict[str, Any], scene: Scene, place: Array | None) -> dict[str, Any]:
    """Keys of a body with its place; with place and friction of the scene's where it has none."""
    if place is not None:
        data = {key: value for key, value in data.items() if key not in PLACES}
        data |= {PLACE: place.tolist()}
    elif PLACE not in data and scene.body is not None:
        data = data | {PLACE: scene.body.center.tolist()}
    if scene.friction is None or FRICTION in data:
        return data
    rubs = {FRICTION: scene.friction.coefficient, MASS: scene.friction.mass}
    return rubs | data


def _giving_way(body: Body, known: Body | None) -> Body:
    """Jaws that give way as those of the spec do, unless they do so by themselves."""
    if isinstance(body, Jaws) and isinstance(known, Jaws) and not gives_way(body):
        return replace(body, stiffness=known.stiffness, curve=known.curve)
    return body


def _of_text(said: str) -> dict[str, Any]:
    """The keys that a text such as "jaws:30x40" stands for. Raises UsageError for what is none."""
    kind, _, sizes = said.partition(":")
    numbers = [number_in(size) for size in sizes.split("x")]
    is_known = len(numbers) in {"disc": (1,), "jaws": (1, 2)}.get(kind, ())
    if not is_known or not all(SMALLEST <= size <= LARGEST for size in numbers):
        raise UsageError(Field("object"), f" {shortened(said)}: {KINDS}")
    if kind == "disc":
        return {"disc": {"diameter_mm": numbers[0]}}
    gap, height = (*numbers, JAW_HEIGHT)[:2]
    return {"jaws": {"gap_mm": gap, "height_mm": height}}


def check_body(scene: Scene, body: Body | None) -> None:
    """Raise UsageError where fingers cannot meet a body, or each other: no face, or in a base."""
    if scene.layer_thickness is None:
        raise UsageError(
            "grasping needs finger.geometry.limiting_layer_thickness_mm: the face of a finger is "
            "half of it inside the lattice"
        )
    if body is None:
        _check_apart(scene)
        return
    if begins_in_base(scene, body).any():
        raise UsageError(
            Field("at"),
            f" {body.center[0]:g},{body.center[1]:g}: {body.name} there begins in the base of a "
            "finger: move it along x, or take a smaller one",
        )


def _check_apart(scene: Scene) -> None:
    """Raise UsageError for faces that are in each other at the bases."""
    assert scene.gripper is not None and scene.layer_thickness is not None, "two faces"
    spacing = float(scene.gripper.base_spacing)
    least = float(scene.layer_thickness) * math.cos(float(scene.gripper.mounting_angle))
    if spacing <= least:
        raise UsageError(
            f"gripper.base_spacing_mm: expected more than {least:g}, where the faces meet at the "
            f"bases of the fingers, found {spacing:g}"
        )


def body_lines(scene: Scene) -> Iterator[str]:
    """What is to be said of forces of jaws that do not fall as these open."""
    curve = scene.body.curve if isinstance(scene.body, Jaws) else None
    if curve is not None and (ranges := curve.not_falling):
        told = ", ".join(f"{first:g} to {last:g}" for first, last in ranges)
        yield (
            f"warning: the forces of the jaws do not fall from {told} mm: one force has several "
            "apertures there, and where the jaws rest depends on where they come from"
        )


def pressure_lines(scene: Scene) -> Iterator[str]:
    """What pressures rest on."""
    for trust in scene.trusts:
        if trust.output is Output.PRESSURES:
            yield f"pressures: {trust.basis_text}, {trust.source}; error {trust.known_error}"


def force_lines(scene: Scene) -> Iterator[str]:
    """What the forces of fingers on bodies rest on, and warnings."""
    for trust in scene.trusts:
        if trust.output is Output.FORCES:
            yield f"forces: {trust.basis_text}, {trust.source}; error {trust.known_error}"
            if trust.doubt:
                yield f"warning: {trust}"
    yield from (f"warning: {warning}" for warning in scene.warnings)
