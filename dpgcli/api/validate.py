"""`validate`: specs, sweeps and goals looked at, and nothing solved."""

from collections.abc import Iterator
from pathlib import Path

from dpgcli.api.given import any_input
from dpgcli.api.inputs import Settings, SpecInput, setting_texts
from dpgcli.errors import Problem, SpecError
from dpgcli.files.places import Location, located
from dpgcli.files.sweep_file import Sweep


def validate(*specs: SpecInput, settings: Settings = ()) -> tuple[Problem, ...]:
    """All problems of specs, sweeps and goals, none where they are right; nothing is solved.

    Those of a sweep or a goal come with those of its base, which `settings` change. A sweep without
    a design that can be solved, of a million at most, has a problem, too.

    >>> problem, = validate({"finger": {"units": 0}})[:1]
    >>> problem.key, problem.expected
    ('finger.units', 'a whole number from 1 to 64')
    >>> [problem.key for problem in validate({"base": {"finger": {"units": 0}}, "space": []})]
    ['space', 'finger.units']
    """
    texts = setting_texts(settings)
    problems: list[Problem] = []
    for spec in specs:
        try:
            given = any_input(spec, texts)
        except SpecError as error:
            problems += error.problems
        else:
            problems += _none_to_solve(given, spec)
    return tuple(problems)


def _none_to_solve(given: object, spec: SpecInput) -> Iterator[Problem]:
    """The problem of a sweep whose designs are all excluded, or cannot exist."""
    if not isinstance(given, Sweep):
        return
    from dpgcli.studies.plan import nothing_to_solve
    from dpgcli.studies.sweep import Study

    if why := nothing_to_solve(Study(given, Path())):
        place = Location(str(spec) if isinstance(spec, str | Path) else "sweep")
        found = f"none in {given.space.size:,}"
        yield located(place, "space", "a design that can be solved", found, why)
