"""The keys of a sweep file, their types and their meaning.

Each description says what is expected: it is what a wrong value is answered with.
"""

import math
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

MOST_DESIGNS = 10**10 - 1  # as the names of parts count them
MOST_POINTS = 10_000_000  # of an axis
MOST_NUMBERS = 25_000_000  # of all axes: they are held in memory, 8 bytes each
MOST_KEYS = 256  # each of which is a column of both tables
MOST_AXES = 64  # as many dimensions as an array may have
MOST_BYTES = 2**29  # of a table as text
Bound = Annotated[float, Field(ge=-1e18, le=1e18)]


class Part(BaseModel):
    """A mapping whose keys are all known."""

    model_config = ConfigDict(
        strict=True, frozen=True, extra="forbid", allow_inf_nan=False, populate_by_name=True
    )


class Between(Part):
    """Values from one number to another, both included."""

    first: Bound = Field(alias="from", description="the first value, a number")
    last: Bound = Field(alias="to", description="the last value, a number")
    count: Annotated[int, Field(ge=2, le=MOST_POINTS)] = Field(
        description=f"how many values, a whole number from 2 to {MOST_POINTS:,}"
    )


class SampleRange(Part):
    """Bounds of a sampled key."""

    first: Bound = Field(alias="from", description="the lower bound, a number")
    last: Bound = Field(alias="to", description="the upper bound, a number")
    scale: Literal["linear", "log"] = Field(default="linear", description="linear or log")


class Sample(Part):
    """Seeded samples of a box."""

    method: Literal["sobol", "latin_hypercube"] = Field(description="sobol or latin_hypercube")
    count: Annotated[int, Field(ge=1, le=MOST_POINTS)] = Field(
        description=f"how many samples, a whole number from 1 to {MOST_POINTS:,}"
    )
    seed: Annotated[int, Field(ge=0)] = Field(default=0, description="a whole number from 0")
    ranges: Annotated[dict[str, SampleRange], Field(min_length=1)] = Field(
        description="bounds by key of the spec"
    )


Whole = Annotated[int, Field(ge=-(2**63), le=2**63 - 1)]
Number = Whole | Annotated[float, Field(allow_inf_nan=True, ge=-math.inf)]  # .inf: rigid bars
NumberList = Annotated[list[Number], Field(min_length=1, max_length=MOST_POINTS)]


class AxisSpec(Part):
    """One axis of the space: exactly one kind."""

    key: str | None = Field(default=None, description="a key of the spec, parts joined by dots")
    values: NumberList | None = Field(default=None, description="a list of numbers")
    linear: Between | None = Field(default=None, description="from, to and count")
    log: Between | None = Field(default=None, description="from, to and count, above zero")
    paired: Annotated[dict[str, NumberList], Field(min_length=1)] | None = Field(
        default=None, description="lists of numbers by key, equally long"
    )
    sample: Sample | None = Field(default=None, description="method, count, seed and ranges")
    table: str | None = Field(
        default=None, description="a CSV or Parquet file whose columns are keys of the spec"
    )


class SweepSpec(Part):
    """A base spec and the space of designs around it."""

    base: str = Field(description="the path of a spec, from this file's folder")
    space: Annotated[list[AxisSpec], Field(min_length=1, max_length=MOST_AXES)] = Field(
        description=f"a list of 1 to {MOST_AXES} axes"
    )
    constraints: list[str] | None = Field(
        default=None, description="a list of expressions over keys, such as units < 6"
    )


ONE_KEY = ("values", "linear", "log")
MANY_KEYS = ("paired", "sample", "table")
