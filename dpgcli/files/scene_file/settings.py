"""Changes to a spec: "key.path=value" texts, as `--set` of the command line takes them."""

from collections.abc import Mapping, Sequence
from typing import Any

from dpgcli.errors import Field, Problem, SpecError
from dpgcli.files.places import Location, in_order, located, shown
from dpgcli.files.yaml_file import MAX_DEPTH, Document, parse_value
from dpgcli.text import KeyPath, dotted, shortened

SETTING = Location(Field("settings"))


def with_settings(document: Document, settings: Sequence[str]) -> Document:
    """The document with "key.path=value" texts put into it, the last one winning.

    Problems with the settings join those of the document; a wrong setting changes nothing.
    """
    data, places = _copied(document.data), dict(document.places)
    problems = list(document.problems)
    for text in settings:
        try:
            path, value = _parsed(text)
            _put(data, path, value)
        except SpecError as error:
            problems += error.problems
            continue
        places = {p: place for p, place in places.items() if p[: len(path)] != path}
        for length in range(1, len(path)):
            places.setdefault(path[:length], SETTING)
        places[path] = SETTING
    return Document(document.file, data, places, in_order(problems))


def changed(document: Document, changes: Mapping[str, Any]) -> Document:
    """The document with values put at dotted keys. Raises SpecError where that cannot be."""
    data = _copied(document.data)
    for key, value in changes.items():
        _put(data, tuple(key.split(".")), value)
    return Document(document.file, data, document.places, document.problems)


def _parsed(text: str) -> tuple[KeyPath, Any]:
    key, equals, value = text.partition("=")
    path = tuple(part.strip() for part in key.split("."))
    if not equals or not all(path) or len(path) > MAX_DEPTH or not key.isprintable():
        raise _refused("setting", "key.path=value", shown(text))
    try:
        return path, parse_value(value, SETTING)
    except SpecError as error:
        raise SpecError(tuple(_about(path, problem) for problem in error.problems)) from None


def _about(path: KeyPath, problem: Problem) -> Problem:
    return located(SETTING, dotted(path), problem.expected, problem.found, problem.hint)


def _put(data: dict[str, Any], path: KeyPath, value: Any) -> None:
    """Store a value, with sections for all but the last part of its path."""
    section: Any = data
    for length, part in enumerate(path[:-1], start=1):
        if section.get(part) is None:
            section[part] = {}
        section = section[part]
        if not isinstance(section, dict):
            found = f"{shown(section)} at {dotted(path[:length])}"
            raise _refused(dotted(path), "a key of a section", found)
    section[path[-1]] = value


def _refused(key: str, expected: str, found: str) -> SpecError:
    return SpecError((located(SETTING, shortened(key), expected, found),))


def _copied(data: Any) -> Any:
    """A copy of plain data whose sections can be changed."""
    if isinstance(data, dict):
        return {key: _copied(value) for key, value in data.items()}
    return data
