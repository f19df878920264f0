"""Bodies as arguments: texts such as "disc:40", files, places; and which of them can be grasped."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from dpgcli.api.inputs import SceneInput, check_texts, files_of, path_of, point
from dpgcli.arrays import Array
from dpgcli.design.bodies import PLACES, Body, Disc, Jaws, gives_way
from dpgcli.design.outputs import Output
from dpgcli.design.scene import Held, Scene
from dpgcli.errors import Field, UsageError
from dpgcli.files.scene_file.forces import with_forces
from dpgcli.files.scene_file.objects import TABLE, ObjectSpec
from dpgcli.files.scene_file.problems import checked_object
from dpgcli.files.yaml_file import read_document
from dpgcli.grasping.frames import begins_in_base
from dpgcli.text import number_in, shortened

SMALLEST, LARGEST = 1e-3, 1e4  # mm: of what a text says
JAW_HEIGHT = 40.0  # mm, unless the text says it
SUFFIXES = (".yaml", ".yml")
KINDS = (
    "expected disc and its diameter in mm such as disc:40, jaws and their gap such as jaws:30 or "
    f"jaws:30x40 with their height, each from {SMALLEST:g} to {LARGEST:g}, or a .yaml file"
)


def with_body(given: SceneInput, said: str | None, at: Sequence[float] | None) -> SceneInput:
    """The same with the body of these arguments, or of its own.

    A text says what it is or names a file of the keys of `object`; `at` is its place. Raises
    UsageError for what is no body, SpecError for a wrong file.
    """
    check_texts(object=said)
    scene, known = given.scene, given.scene.body
    if said is None and known is None:
        raise UsageError(
            Field("object"), ": expected a body such as disc:40, here or as object in the spec"
        )
    place = None if at is None else np.array(point("at", at))
    if known is not None and said is None:
        body = known if place is None else replace(known, center=place)
        return replace(given, scene=replace(scene, body=body))
    if known is not None and place is None:
        place = known.center
    said = str(said)
    if said.lower().endswith(SUFFIXES):
        spec, files = _of_file(said, place)
        body = spec.known if at is None else replace(spec.known, center=_known(place))
        body = _giving_way(body, known)
        held = Held(spec.held) if "held" in spec.model_fields_set else scene.held
        friction = spec.known_friction or scene.friction
        scene = replace(scene, body=body, held=held, friction=friction)
        return replace(given, scene=scene, files=(*given.files, *files))
    body = _giving_way(_of_text(said, place), known)
    return replace(given, scene=replace(scene, body=body))


def _giving_way(body: Body, known: Body | None) -> Body:
    """Jaws that give way as those of the spec do, unless they do so by themselves."""
    if isinstance(body, Jaws) and isinstance(known, Jaws) and not gives_way(body):
        return replace(body, stiffness=known.stiffness, curve=known.curve)
    return body


def _of_file(name: str, place: Array | None) -> tuple[ObjectSpec, tuple[Path, ...]]:
    """The keys in a file, which may leave its place to others, and the files that were read."""
    path = path_of("object", name)
    document = with_forces(read_document(path), path.parent, TABLE)
    if "at_mm" not in document.data:
        parts = [document.data.get(key) for key in PLACES]
        at = parts if place is None and None not in parts else _known(place).tolist()
        document = replace(document, data={**document.data, "at_mm": at})
    return checked_object(document), files_of(path, *document.files)


def _known(place: Array | None) -> Array:
    if place is None:
        raise UsageError(Field("at"), ": expected the place of the body in mm, such as 40,0")
    return place


def _of_text(said: str, place: Array | None) -> Body:
    kind, _, sizes = said.partition(":")
    numbers = [number_in(size) for size in sizes.split("x")]
    is_known = len(numbers) in {"disc": (1,), "jaws": (1, 2)}.get(kind, ())
    if not is_known or not all(SMALLEST <= size <= LARGEST for size in numbers):
        raise UsageError(Field("object"), f" {shortened(said)}: {KINDS}")
    if kind == "disc":
        return Disc(_known(place), 0.5 * numbers[0])
    gap, height = (*numbers, JAW_HEIGHT)[:2]
    return Jaws(_known(place), gap, height)


def check_body(scene: Scene, body: Body) -> None:
    """Raise UsageError where fingers cannot meet a body: no face, or one that begins in a base."""
    if scene.layer_thickness is None:
        raise UsageError(
            "grasping needs finger.geometry.limiting_layer_thickness_mm: the face of a finger is "
            "half of it inside the lattice"
        )
    if begins_in_base(scene, body).any():
        raise UsageError(
            Field("at"),
            f" {body.center[0]:g},{body.center[1]:g}: {body.name} there begins in the base of a "
            "finger: move it along x, or take a smaller one",
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
