"""The keys of a goal file and their meaning.

Each description says what is expected: it is what a wrong value is answered with.
"""

from typing import Any

from pydantic import Field

from dpgcli.files.sweep_file.models import Part

MOST_ASKED = 100
ASKED = ("targets", "constraints", "minimize", "maximize")
VARIED = "a list of numbers, or a range such as {from: 4.5, to: 7.5}"


class GoalSpec(Part):
    """A base spec, what may vary around it, and what is asked of states and of whole maps."""

    base: str = Field(description="the path of a spec, from this file's folder")
    vary: dict[str, Any] = Field(
        description="keys of the spec, each with a list of numbers or a range"
    )
    targets: list[Any] = Field(default=[], description="a list of targets")
    constraints: list[Any] = Field(
        default=[], description="a list of comparisons, such as min_barrier_mJ > 1"
    )
    minimize: list[Any] = Field(default=[], description="a list of columns of designs, or keys")
    maximize: list[Any] = Field(default=[], description="a list of columns of designs, or keys")
