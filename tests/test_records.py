"""Dataclasses that share their methods are those of the standard library in all else."""

import copy
import dataclasses
import pickle
from collections.abc import Callable
from dataclasses import FrozenInstanceError, dataclass, field, fields, replace
from functools import cached_property
from typing import Any

import pytest

from dpgcli import records


def place(make: Callable[..., Any]) -> Any:
    """A class with fields of each kind, a rule, and a value that is computed once."""

    @make(frozen=True)
    class Place:
        x: float
        parts: list[int] = field(default_factory=list)
        text: str = "none"
        hidden: int = field(init=False, default=3)

        def __post_init__(self) -> None:
            if self.x < 0:
                raise ValueError("below zero")

        @cached_property
        def doubled(self) -> float:
            return 2 * self.x

    return Place


@records.dataclass(frozen=True)
class Point:
    """One that processes find by its name."""

    x: float
    y: float = 0.0


@records.dataclass
class Count:
    """One that changes."""

    n: int = 0


Ours, Theirs = place(records.dataclass), place(dataclass)


@pytest.mark.parametrize(
    "use",
    [
        lambda c: repr(c(1.0)),
        lambda c: repr(c(x=1.0, parts=[1], text="a")),
        lambda c: c(1.0) == c(1.0),
        lambda c: c(1.0) != c(1.0, text="b"),
        lambda c: c(1.0) == 1.0,
        lambda c: c(2.0).doubled,
        lambda c: repr(replace(c(1.0), x=2.0)),
        lambda c: [f.name for f in fields(c)],
        lambda c: dataclasses.asdict(c(1.0, [2])),
        lambda c: repr(copy.deepcopy(c(1.0, [2]))),
        lambda c: c(1.0).parts is c(1.0).parts,
        lambda c: c.__match_args__,
    ],
)
def test_all_else_is_as_in_the_standard_library(use: Callable[[Any], Any]) -> None:
    assert use(Ours) == use(Theirs)


@pytest.mark.parametrize(
    "use",
    [
        lambda c: c(),
        lambda c: c(1.0, y=2.0),
        lambda c: c(-1.0),
        lambda c: setattr(c(1.0), "x", 2.0),
        lambda c: setattr(c(1.0), "text", "a"),
        lambda c: setattr(c(1.0), "other", 2.0),
        lambda c: delattr(c(1.0), "x"),
        lambda c: hash(c(1.0)),  # of a list
    ],
)
def test_what_is_refused_is_refused_likewise(use: Callable[[Any], Any]) -> None:
    said = []
    for cls in (Ours, Theirs):
        with pytest.raises((TypeError, ValueError, FrozenInstanceError)) as caught:
            use(cls)
        said.append((caught.type, str(caught.value)))
    assert said[0] == said[1]


def test_values_are_hashed_by_their_fields_and_pickled() -> None:
    assert {Point(1.0), Point(1.0, 0.0)} == {Point(1.0)}
    assert pickle.loads(pickle.dumps(Point(1.0, 2.0))) == Point(1.0, 2.0)


def test_one_that_is_not_frozen_changes_and_has_no_hash() -> None:
    count = Count()
    count.n += 1
    assert count == Count(1)
    with pytest.raises(TypeError, match="unhashable"):
        hash(count)


def test_arrays_as_fields_need_no_equality() -> None:
    made = records.dataclass(frozen=True, eq=False)(type("Named", (), {"__annotations__": {}}))
    assert made() != made()
    assert len({made(), made()}) == 2
