"""Which designs meet a threshold, and what is said of those that do not."""

from math import nan

import numpy as np
import pytest

from dpgcli.arrays import Columns
from dpgcli.errors import NothingSelectedError, UsageError
from dpgcli.sweeps.comparisons import ends_tell
from dpgcli.sweeps.expressions import Expression
from dpgcli.sweeps.gate import (
    check_requirements,
    failing,
    holds,
    number_columns,
    requirement,
    swept_names,
)

DESIGNS: Columns = {
    name: np.array(values, object if isinstance(values[0], str) else None)
    for name, values in {
        "design": [10, 11, 12, 13, 14, 15],
        "height_mm": [4.0, 4.5, 5.0, 5.5, 6.0, 6.5],
        "units": [3, 3, 3, 4, 4, 4],
        "calibration": ["given"] * 4 + ["", ""],
        "status": ["stable", "stable", "partly_stable", "partly_stable", "invalid", "excluded"],
        "reason": ["", "", "", "", "too tall, found 6", ""],
        "n_stable": [8, 8, 5, 0, 0, 0],
        "area_mm2": [1.0, 2.0, 3.0, nan, nan, nan],
        "gap_mm": [1.0, nan, 1.0, nan, nan, nan],
    }.items()
}
COLUMNS = number_columns(DESIGNS)


def rows(chosen: slice) -> Columns:
    return {name: column[chosen] for name, column in DESIGNS.items()}


def test_swept_values_stand_between_the_number_and_the_calibration() -> None:
    assert swept_names(DESIGNS) == ["height_mm", "units"]


def test_columns_of_text_are_no_numbers() -> None:
    assert COLUMNS == ["design", "height_mm", "units", "n_stable", "area_mm2", "gap_mm"]


@pytest.mark.parametrize(
    ("text", "rows"),
    [
        ("area_mm2 >= 1", [3, 4]),
        ("area_mm2 > 1", [0, 3, 4]),
        ("not area_mm2 > 2.5", [2, 3, 4]),  # a NaN is not "not larger"
        ("area_mm2 > 0 or gap_mm > 0", [1, 3, 4]),  # one known value does not do
        ("height_mm > 0", [3, 4]),  # without a state nothing is met
        ("n_stable == 0", [0, 1, 2, 3, 4]),
        ("units == 3 and n_stable ** 2 > 30", [2, 3, 4]),
    ],
)
def test_rows_that_fail(text: str, rows: list[int]) -> None:
    assert failing(DESIGNS, requirement(text, COLUMNS)).tolist() == rows


def test_checking_leaves_the_table_as_it_was() -> None:
    before = {name: column.tolist() for name, column in DESIGNS.items()}
    check_requirements(DESIGNS, [requirement("abs(area_mm2 - gap_mm) < 1", COLUMNS)])
    assert str({name: column.tolist() for name, column in DESIGNS.items()}) == str(before)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("area_mm > 1", "no column area_mm of numbers; the nearest is area_mm2"),
        ("status == 1", "no column status of numbers"),
        ("area_mm2", "expected a comparison, found a number"),
        ("area_mm2 >", "not an expression"),
        ("", "not an expression"),
        ("__import__('os')", "unknown function __import__"),
        ("abs(area_mm2, height_mm) > 1", "does not take 2 values"),
        ("sqrt(1, 2) > 1", "does not take 2 values"),
        ("-" * 498 + "1", ""),
        ("x" * 501, "longer than 500"),
    ],
)
def test_what_is_no_requirement_is_refused(text: str, said: str) -> None:
    with pytest.raises(UsageError, match=r"^require ") as caught:
        requirement(text, COLUMNS)
    assert said in str(caught.value)


def test_a_verdict_names_designs_values_and_what_was_found() -> None:
    (verdict,) = check_requirements(DESIGNS, [requirement("area_mm2 > 2", COLUMNS)])
    assert (verdict.n_checked, verdict.is_met) == (5, False)
    assert str(verdict) == "not met: area_mm2 > 2: 4 of 5 designs"
    assert list(map(str, verdict.failures())) == [
        "design 10 (height_mm = 4, units = 3): area_mm2 = 1",
        "design 11 (height_mm = 4.5, units = 3): area_mm2 = 2",
        "design 13 (height_mm = 5.5, units = 4): partly_stable: no stable state",
        "design 14 (height_mm = 6, units = 4): invalid: too tall, found 6",
    ]
    assert [failure.design for failure in verdict.failures(2)] == [10, 11]


def test_a_requirement_that_all_meet() -> None:
    (verdict,) = check_requirements(rows(slice(3)), [requirement("area_mm2 >= 1", COLUMNS)])
    assert verdict.is_met
    assert str(verdict) == "met: area_mm2 >= 1: all 3 designs"


@pytest.mark.parametrize("designs", [rows(slice(5, 6)), rows(slice(0))])
def test_an_empty_space_meets_nothing(designs: Columns) -> None:
    """Of no rows none is said to be excluded."""
    found = "1, all of them excluded" if len(designs["design"]) else "no rows"
    with pytest.raises(NothingSelectedError, match=f"no design to check: the table has {found}$"):
        check_requirements(designs, [requirement("area_mm2 > 0", COLUMNS)])


SEARCHED: Columns = {
    **rows(slice(3)),
    "n_stable": np.array([8, 8, 8]),
    "n_unknown_states": np.array([0, 0, 1]),
    "n_unknown_grasps": np.array([0, 2, 0]),
    "n_unknown_directions": np.array([1, 0, 0]),
    "reach_min_mm": np.array([5.0, 5.0, 5.0]),
    "reach_max_mm": np.array([9.0, 9.0, 9.0]),
    "n_grasps": np.array([4, 4, 4]),
    "squeeze_max_N": np.array([1.0, 1.0, 1.0]),
    "contact_max_N": np.array([2.0, 2.0, 2.0]),
    "n_reachable": np.array([4, 4, 4]),
}


@pytest.mark.parametrize(
    ("text", "rows"),
    [
        ("contact_max_N < 3", [1]),
        ("contact_max_N > 1", []),  # whatever else is there
        ("0 < squeeze_max_N < 3", [1]),
        ("n_grasps <= 4", [1]),
        ("n_grasps >= 4", []),
        ("not n_grasps > 4", [1]),
        ("squeeze_max_N < contact_max_N", [1]),  # either may be larger
        ("squeeze_max_N < 0.5 or contact_max_N > 1", []),
        ("reach_max_mm < 10", [2]),
        ("reach_max_mm > 8", []),
        ("reach_min_mm > 4", [2]),
        ("reach_min_mm < 6", []),
        ("n_stable == 8", [2]),
        ("n_reachable < 5 and reach_max_mm < 10", [0, 2]),
        ("gap_mm < 3", [1]),  # a NaN, and no bound
        ("n_stable != 9", [2]),  # one more may be there
        ("not (8.5 < n_stable < 9.5)", [2]),
        ("reach_min_mm < 2 or reach_min_mm > 4", [2]),
        ("abs(reach_min_mm - 2) > 1", [2]),
        ("(reach_min_mm - 2) ** 2 > 1", [2]),
        ("1 / reach_min_mm > 0.1", [2]),
        ("n_stable % 9 > 0", [2]),
        ("reach_max_mm - min(reach_max_mm, 5) > 2", [2]),  # so it is, but is not seen to be
        ("area_mm2 < 4", []),
    ],
)
def test_what_is_not_known_meets_no_bound(text: str, rows: list[int]) -> None:
    """Of states that are not found the extremes are bounds on one side."""
    rule = requirement(text, number_columns(SEARCHED))
    assert failing(SEARCHED, rule).tolist() == rows


@pytest.mark.parametrize(
    "text",
    [
        "2 < a < 4 and a > b",
        "not (2 < a < 4)",
        "a < 1 or a > 2",
        "a > 1 or b > 1",
        "a * b > 1 and b > 0",
        "a * a > 4",
        "b - a > -3",
        "b / a > 1",
        "a / b > -1",
        "abs(a) > 1",
        "not max(a, b) > 3",
        "a == 2",
        "exp(a) - 2 * log(b) < 9",
        "a ** 2 > 1",
        "a % 2 < 1",
    ],
)
def test_a_rule_that_holds_at_both_ends_holds_between(text: str) -> None:
    """Where it is said to, by trying all between; where it is not, it need not."""
    rule = requirement(text, ["a", "b"])
    between = np.linspace(0.0, 1.0, 41)
    starts, ends, others = np.meshgrid(*[np.linspace(-5.0, 5.0, 21)] * 3)
    first, last = (np.asarray(rule({"a": end, "b": others})) == 1.0 for end in (starts, ends))
    held = [np.asarray(rule({"a": starts + (ends - starts) * t, "b": others})) for t in between]
    holds = (np.array(held) == 1.0).all(axis=0)
    assert (first & last).any()
    assert ends_tell(rule, "a") <= holds[first & last].all()


def test_a_comparison_of_no_column_is_none() -> None:
    with pytest.raises(UsageError, match=r"'1 < 2': expected a comparison of columns, found none"):
        requirement("1 < 2", COLUMNS)


@pytest.mark.parametrize("count", [np.nan, -1.0, np.inf])
def test_a_count_that_is_none_is_not_known(count: float) -> None:
    """As a join of tables leaves it: that row may have states that nobody has found."""
    designs = SEARCHED | {"n_unknown_states": np.array([0.0, count, 0.0])}
    rule = requirement("reach_max_mm < 20 and n_stable <= 8", number_columns(SEARCHED))
    (verdict,) = check_requirements(designs, [rule])
    assert verdict.rows.tolist() == [1]
    assert "searches failed or did not decide in 1 design" in str(verdict.warnings[0])


def test_a_table_without_a_count_is_warned_of() -> None:
    rule = requirement("reach_max_mm < 20", number_columns(SEARCHED))
    some = {name: values for name, values in SEARCHED.items() if name != "n_unknown_states"}
    (verdict,) = check_requirements(some, [rule])
    (warning,) = map(str, verdict.warnings)
    assert verdict.is_met
    assert warning.endswith("not known: the table has no column n_unknown_states")


def test_joined_comparisons_take_no_more_than_each(monkeypatch: pytest.MonkeyPatch) -> None:
    """All ends of all of them at once would be two to the power of their number."""
    bounds = ["reach_max_mm < 20", "n_grasps < 9", "squeeze_max_N < 9", "contact_max_N < 9"]
    rule = requirement(" and ".join([*bounds, "n_reachable < 9"]), number_columns(SEARCHED))
    looks, evaluated = [], Expression.__call__

    def counted(own: Expression, values: Columns) -> object:
        looks.append(own.text)
        return evaluated(own, values)

    monkeypatch.setattr(Expression, "__call__", counted)
    assert not holds(rule, SEARCHED).any()
    assert len(looks) <= 4 * len(bounds) + 4


def test_failed_searches_are_warned_of_and_shown() -> None:
    rule = requirement("contact_max_N + reach_max_mm < 20", number_columns(SEARCHED))
    (verdict,) = check_requirements(SEARCHED, [rule])
    grasps, states = map(str, verdict.warnings)
    assert (
        "searches failed or did not decide in 1 design (n_unknown_states): there may be more states"
        in states
    )
    assert (
        "searches failed or did not decide in 1 design (n_unknown_grasps): more states may touch"
        in grasps
    )
    found = [failure.found for failure in verdict.failures()]
    assert [own["n_unknown_grasps"] for own in found] == [2, 0]
    (verdict,) = check_requirements(SEARCHED, [requirement("area_mm2 < 9", COLUMNS)])
    assert verdict.warnings == ()
