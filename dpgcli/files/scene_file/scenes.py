"""From a spec to a scene, and what is wrong between the keys of its data."""

from typing import Any

from dpgcli.design.dimensions import MAX_UNITS, range_issues
from dpgcli.design.problems import Issue
from dpgcli.design.scene import Scene
from dpgcli.errors import SpecError
from dpgcli.files.places import Location, located
from dpgcli.files.scene_file.models import Spec
from dpgcli.text import dotted


def scene_of(spec: Spec) -> Scene:
    """The scene that a spec describes. Raises SpecError, without lines, if keys disagree."""
    resolution = spec.resolution
    if found := resolution.problems.of(0):
        place = Location("spec")
        raise SpecError(tuple(located(place, dotted(issue.path), *issue[1:]) for issue in found))
    return resolution.scene()


def early_issues(data: Any) -> list[Issue]:
    """Cross-key problems of data whose keys are not all right by themselves."""
    finger = data.get("finger") if isinstance(data, dict) else None
    if not isinstance(finger, dict):
        return []
    overrides, units = finger.get("overrides"), finger.get("units")
    if not isinstance(overrides, dict):
        return []
    if not isinstance(units, int) or isinstance(units, bool) or not 1 <= units <= MAX_UNITS:
        units = MAX_UNITS  # the largest allowed one as long as it is not known
    return range_issues(units, map(str, overrides))
