"""Searches that each ask for one point at a time, answered together: one batch for all of them.

SciPy's minimizers call a function with one point. Here each runs in a thread of its own and waits
for an answer; once all of them wait, all points are evaluated in one batch. Which thread is first
changes nothing: points are in the order of their searches.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from queue import SimpleQueue
from typing import Generic, TypeVar

import numpy as np

from dpgcli.arrays import Array, Indices

Answer = TypeVar("Answer")
Found = TypeVar("Found")
Ask = Callable[[Array], Answer]


class _StoppedError(Exception):
    """There are no more answers: somebody who gave them stopped."""


class _Asker(Generic[Answer]):
    """One search's way to ask."""

    def __init__(self, number: int, asked: "SimpleQueue[tuple[int, Array | None]]") -> None:
        self.number, self.asked = number, asked
        self.answer: SimpleQueue[Answer | None] = SimpleQueue()

    def __call__(self, point: Array) -> Answer:
        self.asked.put((self.number, point))
        found = self.answer.get()
        if found is None:
            raise _StoppedError
        return found


def in_lockstep(
    search: Callable[[int, Ask[Answer]], Found],
    n_searches: int,
    evaluate: Callable[[Array, Indices], Sequence[Answer]],
) -> list[Found]:
    """What searches number 0 … n − 1 come to; `evaluate` answers points (coordinate, search).

    >>> def search(number, ask):
    ...     return ask(np.array([float(number)])) + ask(np.array([10.0]))
    >>> in_lockstep(search, 3, lambda points, _: (2.0 * points[0]).tolist())
    [20.0, 22.0, 24.0]
    """
    asked: SimpleQueue[tuple[int, Array | None]] = SimpleQueue()
    askers = [_Asker[Answer](number, asked) for number in range(n_searches)]

    def run(number: int) -> Found:
        try:
            return search(number, askers[number])
        finally:
            asked.put((number, None))

    with ThreadPoolExecutor(max(n_searches, 1)) as pool:
        try:  # a signal may come while threads are started, too
            running = [pool.submit(run, number) for number in range(n_searches)]
            _answer_all(askers, asked, evaluate)
        except BaseException:
            for asker in askers:  # so that no thread waits for good
                asker.answer.put(None)
            raise
        return [each.result() for each in running]


def _answer_all(
    askers: Sequence[_Asker[Answer]],
    asked: "SimpleQueue[tuple[int, Array | None]]",
    evaluate: Callable[[Array, Indices], Sequence[Answer]],
) -> None:
    under_way = len(askers)
    while under_way:
        waiting: dict[int, Array] = {}
        while len(waiting) < under_way:
            number, point = asked.get()
            if point is None:
                under_way -= 1
            else:
                waiting[number] = point
        if waiting:
            numbers = sorted(waiting)
            points = np.stack([waiting[number] for number in numbers], axis=1)
            for number, answer in zip(numbers, evaluate(points, np.array(numbers)), strict=True):
                askers[number].answer.put(answer)
