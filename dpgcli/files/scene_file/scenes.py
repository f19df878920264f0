"""From a spec to a scene, and what is wrong between the keys of its data."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from typing import Any

from pydantic import ValidationError

from dpgcli.design.dimensions import MAX_UNITS, range_issues
from dpgcli.design.lines import line_issues
from dpgcli.design.problems import Issue
from dpgcli.design.scene import Held, Scene
from dpgcli.errors import SpecError
from dpgcli.files.places import Location, located
from dpgcli.files.scene_file.models import Spec
from dpgcli.files.scene_file.objects import ObjectSpec
from dpgcli.files.scene_file.pressure import PressureSpec
from dpgcli.text import dotted


def scene_of(spec: Spec) -> Scene:
    """The scene that a spec describes. Raises SpecError, without lines, if keys disagree."""
    resolution = spec.resolution
    if found := [*resolution.problems.of(0), *body_issues(spec.object)]:
        place = Location("spec")
        raise SpecError(tuple(located(place, dotted(issue.path), *issue[1:]) for issue in found))
    scene = resolution.scene()
    if spec.object is None:
        return scene
    held, friction = Held(spec.object.held), spec.object.known_friction
    return replace(scene, body=spec.object.known, held=held, friction=friction)


def body_issues(spec: ObjectSpec | None) -> list[Issue]:
    """What is wrong between the keys of an object, if there is one."""
    own = [] if spec is None else spec.issues
    return [issue._replace(path=("object", *issue.path)) for issue in own]


def early_issues(data: Any) -> list[Issue]:
    """Cross-key problems of data whose keys are not all right by themselves."""
    if not isinstance(data, dict):
        return []
    of_body = _early_body_issues(data.get("object"))
    finger = data.get("finger")
    if not isinstance(finger, dict):
        return of_body
    overrides, units = finger.get("overrides"), finger.get("units")
    known: int | None = None
    if isinstance(units, int) and not isinstance(units, bool) and 1 <= units <= MAX_UNITS:
        known = units
    largest = known or MAX_UNITS  # the largest allowed one as long as it is not known
    found = range_issues(largest, map(str, overrides)) if isinstance(overrides, dict) else []
    return [*found, *of_body, *(_line_issues(data.get("pressure"), known) if known else ())]


def _early_body_issues(said: Any) -> list[Issue]:
    with suppress(ValidationError):
        return [] if said is None else body_issues(ObjectSpec.model_validate(said))
    return []


def _line_issues(pressure: Any, n_units: int) -> Iterator[Issue]:
    """What is wrong between lines and history, as far as they are right by themselves."""
    said = pressure if isinstance(pressure, dict) else {}
    parts = {key: said.get(key) for key in ("lines", "history")}
    for kept in (parts, {**parts, "history": None}):
        with suppress(ValidationError):
            yield from line_issues(PressureSpec.model_validate(kept).known, n_units)
            return
