"""`validate`: specs and sweeps looked at, and nothing solved."""

from dpgcli.api.given import scene_or_sweep
from dpgcli.api.inputs import Settings, SpecInput
from dpgcli.errors import Problem, SpecError


def validate(*specs: SpecInput, settings: Settings = ()) -> tuple[Problem, ...]:
    """All problems of specs and sweeps, none where they are right; nothing is solved.

    Those of a sweep come with those of its base, which `settings` change.

    >>> problem, = validate({"finger": {"units": 0}})[:1]
    >>> problem.key, problem.expected
    ('finger.units', 'a whole number from 1 to 64')
    >>> [problem.key for problem in validate({"base": {"finger": {"units": 0}}, "space": []})]
    ['space', 'finger.units']
    """
    problems: list[Problem] = []
    for spec in specs:
        try:
            scene_or_sweep(spec, settings)
        except SpecError as error:
            problems += error.problems
    return tuple(problems)
