"""Questions to tables of numbers: conditions, orders, ties and missing values."""

import numpy as np
import pytest

from dpgcli.errors import UsageError
from dpgcli.sweeps.choice import Question, Selection, question, selected, warnings_of

NAN = float("nan")
COLUMNS = {
    "height": np.array([5.0, 6.0, 7.0, 8.0, 9.0]),
    "reach": np.array([3.0, 1.0, NAN, 1.0, 0.0]),
    "count": np.array([1, 2, 3, 4, 5]),
}
ALL = np.ones(5, bool)


def ask(
    where: str = "",
    minimize: tuple[str, ...] = (),
    maximize: tuple[str, ...] = (),
    top: int | None = None,
    usable: np.ndarray = ALL,
) -> Selection:
    asked = question([where] if where else [], minimize, maximize, top, list(COLUMNS))
    return selected(COLUMNS, usable, asked)


@pytest.mark.parametrize(
    ("found", "places"),
    [
        (ask(), [0, 1, 2, 3, 4]),
        (ask(top=2), [0, 1]),
        (ask(top=10**30), [0, 1, 2, 3, 4]),
        (ask("height > 5 and count < 4"), [1, 2]),
        (ask("reach >= 0"), [0, 1, 3, 4]),  # no value, no choice
        (ask("not reach > 2"), [1, 3, 4]),
        (ask("1 / (count - 3) < 9"), [0, 1, 3, 4]),  # nor where it is divided by zero
        (ask(minimize=("reach",)), [4, 1, 3, 0]),  # ties as in the table
        (ask(maximize=("reach",)), [0, 1, 3, 4]),
        (ask(maximize=("height",), top=2), [4, 3]),
        (ask(minimize=("reach",), maximize=("count",)), [4]),
        (ask(minimize=("height", "reach")), [0, 1, 4]),
        (ask(minimize=("height", "reach"), top=2), [0, 1]),
        (ask(minimize=("reach",), usable=COLUMNS["count"] < 3), [1, 0]),
    ],
)
def test_what_is_chosen(found: Selection, places: list[int]) -> None:
    assert found.places.tolist() == places


def test_each_condition_is_counted_alone_and_all_together() -> None:
    found = ask("height > 6 and reach < 2 and count < 4")
    assert [*found.lines("design")] == [
        "height > 6: met by 3 of 5 designs; all others by 1",
        "reach < 2: met by 3 of 5 designs (1 without a value); all others by 1",
        "count < 4: met by 3 of 5 designs; all others by 2",
        "all of them: met by 0 designs",
    ]


def test_what_has_no_value_of_an_objective_is_counted() -> None:
    found = ask("height > 5", minimize=("reach", "height"), top=1)
    assert [*found.lines("design")] == [
        "height > 5: met by 4 of 5 designs",
        "reach: 1 design left out without a value",
        "Pareto front: 2 designs; the first 1 of them by reach",
    ]


def test_conditions_are_the_parts_that_and_joins() -> None:
    asked = question(
        ["height > 1 and (count > 2 or reach > 3)", "count < 9"], (), (), None, COLUMNS
    )
    texts = [rule.text for rule in asked.conditions]
    assert texts == ["height > 1", "count > 2 or reach > 3", "count < 9"]
    dotted = "finger.overrides.4-5.geometry.dome_height_mm"
    rules = question([f"{dotted} > 6 and 2 < {dotted} < 8"], (), (), None, [dotted]).conditions
    assert [rule.text for rule in rules] == [f"{dotted} > 6", f"2 < {dotted} < 8"]


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ({"where": ["hight > 1"]}, "where 'hight > 1': no column hight .* nearest is height"),
        ({"where": ["height"]}, "where 'height': expected a comparison"),
        ({"minimize": ["hight"]}, "minimize hight: no column .* nearest is height"),
        ({"maximize": ["couns"]}, "maximize couns: no column .* nearest is count"),
        ({"minimize": ["count"], "maximize": ["count"]}, "count: expected one objective once"),
        ({"top": 0}, "top 0: expected a whole number from 1 on"),
        ({"top": -5}, "top -5: expected"),
    ],
)
def test_what_is_no_question_is_refused(asked: dict[str, list[str]], message: str) -> None:
    words = {"where": [], "minimize": [], "maximize": [], "top": None, **asked}
    with pytest.raises(UsageError, match=message):
        question(**words, numbers=list(COLUMNS))  # type: ignore[arg-type]


def test_a_question_says_what_it_asks_for() -> None:
    asked = question(["count > 1"], ("reach",), ("height",), 3, list(COLUMNS))
    assert asked.names == ("reach", "height", "count")
    assert asked.record == {
        "where": ["count > 1"], "minimize": ["reach"], "maximize": ["height"], "top": 3,
    }  # fmt: skip
    assert not Question(minimize=("reach",)).is_front


def test_what_is_not_known_is_not_chosen_by_it() -> None:
    """And a choice by largest values that may be larger is warned of."""
    columns = {
        "contact_max_N": np.array([1.0, 2.0, 3.0]),
        "n_unknown_grasps": np.array([0, 4, 0]),
    }
    asked = question(["contact_max_N < 2.5"], [], ["contact_max_N"], None, list(columns))
    assert selected(columns, np.ones(3, bool), asked).places.tolist() == [0]
    found = "searches failed or did not decide in 1 design (n_unknown_grasps): more states"
    where, maximize = map(str, warnings_of(asked, columns, {}))
    assert where.startswith("where 'contact_max_N < 2.5': " + found)
    assert maximize.startswith("maximize: " + found)
