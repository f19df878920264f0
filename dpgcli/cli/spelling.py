"""Fields as the command line spells them: each by its option."""

from dataclasses import replace

from dpgcli.errors import Problem, respelled

# where it is not the field's own name
OPTIONS = {
    "settings": "--set",
    "setting": "-s",
    "patterns": "--pattern",
    "start": "--from",
    "end": "--to",
    "gaps": "--jaws",
}


def option_of(field: str) -> str:
    """The option of a field.

    >>> option_of("target_error"), option_of("settings")
    ('--target-error', '--set')
    """
    return OPTIONS.get(field, f"--{field.replace('_', '-')}")


def with_options(text: str) -> str:
    """A text with options in the place of its fields."""
    return respelled(text, option_of)


def problem_with_options(problem: Problem) -> Problem:
    """A problem with options in the place of the fields that it names."""
    return replace(
        problem,
        file=with_options(problem.file),
        key=with_options(problem.key),
        hint=with_options(problem.hint),
    )
