"""What typer refuses, in the form of our own refusals."""

from typing import Any

import typer


def refusal(error: typer.TyperException) -> str:
    """One line: what is wrong, what was expected, and which help says more."""
    context: typer.Context | None = getattr(error, "ctx", None)
    help_of = f" (see {context.command_path} --help)" if context is not None else ""
    return f"{_wrong(error)}{help_of}"


def _wrong(error: Any) -> str:
    parameter = getattr(error, "param", None)
    if parameter is None:
        message = str(getattr(error, "message", error)).rstrip(".")
        near = getattr(error, "possibilities", None)
        meant = f"; did you mean {' or '.join(near)}?" if near else ""
        return f"{message[:1].lower()}{message[1:]}{_key_of_a_spec(error) or meant}"
    name = parameter.metavar if parameter.param_type_name == "argument" else parameter.opts[-1]
    if type(error).__name__ == "MissingParameter":
        return f"{name} is missing"
    if error.__cause__ is None:
        return f"{name} {error.message}"
    (first, *_) = error.__cause__.errors()  # of pydantic
    return f"{name} {first['input']}: expected {_expected(error.message)}"


def _key_of_a_spec(error: Any) -> str:
    """How to say what is no option of a command, but a key of the spec that the command changes."""
    from dpgcli.files.scene_file.models import FingerSpec

    key = getattr(error, "option_name", "").lstrip("-").replace("-", "_")
    context = getattr(error, "ctx", None)
    options = [option for p in context.command.params for option in p.opts] if context else []
    is_key = key in FingerSpec.model_fields and "--set" in options
    return f"; a key of the spec: --set finger.{key}=VALUE" if is_key else ""


def _expected(message: str) -> str:
    """What pydantic or typer expected, the rest of the sentence left out.

    >>> _expected("Value error, 'x' is not one of 'table', 'json'")
    "one of 'table', 'json'"
    >>> _expected("Input should be a valid integer, unable to parse string as an integer")
    'a valid integer'
    >>> _expected("Input should be greater than or equal to 1")
    'a number greater than or equal to 1'
    """
    if "is not one of" in message:
        return f"one of{message.partition('is not one of')[2].rstrip('.')}"
    should = message.removeprefix("Input should be ").partition(", ")[0]
    return f"a number {should}" if should.startswith(("greater", "less")) else should
