"""The keys of a goal file and their meaning.

Each description says what is expected: it is what a wrong value is answered with.
"""

from typing import Any

from pydantic import Field

from dpgcli.files.sweep_file.models import Part

MOST_TARGETS = 100
VARIED = "a list of numbers, or a range such as {from: 4.5, to: 7.5}"


class GoalSpec(Part):
    """A base spec, what may vary around it, and what states should be like."""

    base: str = Field(description="the path of a spec, from this file's folder")
    vary: dict[str, Any] = Field(
        description="keys of the spec, each with a list of numbers or a range"
    )
    targets: list[Any] = Field(description="a list of targets")
