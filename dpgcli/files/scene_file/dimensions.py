"""The dimensions of a molded finger that a spec gives, for those who build it."""

from collections.abc import Sequence

from dpgcli.design.dimensions import sizes_of
from dpgcli.errors import Problem, SpecError
from dpgcli.files.places import Location, located
from dpgcli.files.scene_file.models import Spec
from dpgcli.files.sections import expected_of


def dimensions(spec: Spec, file: str, keys: Sequence[str], purpose: str) -> dict[str, float]:
    """The values of keys of the finger's geometry, those of overrides left out.

    The width of the chamber also follows from that of the unit cell. Raises SpecError that names
    every missing key.
    """
    given = sizes_of(spec.design.finger.geometry)
    missing = [key for key in keys if key not in given]
    if missing:
        raise SpecError(tuple(_problem(file, key, purpose) for key in missing))
    return {key: given[key].item() for key in keys}


def overridden(spec: Spec, keys: Sequence[str]) -> tuple[str, ...]:
    """Units, as the spec writes them, for which an override changes one of the keys."""
    changed = {
        units: set(override.geometry.given())
        for units, override in (spec.finger.overrides or {}).items()
        if override is not None and override.geometry is not None
    }
    return tuple(units for units, names in changed.items() if names & set(keys))


def _problem(file: str, key: str, purpose: str) -> Problem:
    hint = f"or unit_cell_mm; {purpose}" if key == "chamber_width_mm" else purpose
    return located(Location(file), f"finger.geometry.{key}", expected_of(key), "nothing", hint)
