"""`validate`: specs looked at, and nothing solved."""

from dpgcli.api.inputs import Settings, SpecInput, scene_input
from dpgcli.errors import Problem, SpecError


def validate(*specs: SpecInput, settings: Settings = ()) -> tuple[Problem, ...]:
    """All problems of specs, none where they are right; nothing is solved.

    >>> problem, = validate({"finger": {"units": 0}})[:1]
    >>> problem.key, problem.expected
    ('finger.units', 'a whole number from 1 to 64')
    """
    problems: list[Problem] = []
    for spec in specs:
        try:
            scene_input(spec, settings)
        except SpecError as error:
            problems += error.problems
    return tuple(problems)
