"""What a requirement says of its numbers: the comparisons it joins, their margins and bounds."""

import ast
from typing import NamedTuple

import numpy as np

from dpgcli.sweeps.expressions import (
    Expression,
    constant,
    expression,
    name_at,
    names_in,
    parts_of,
    restored,
    spelled,
    tree,
)


def conjuncts(rule: Expression) -> list[Expression]:
    """The parts of an expression that all have to hold, those that `and` joins.

    >>> [part.text for part in conjuncts(expression("a > 1 and (b < 2 and not (c > 3 and d > 4))"))]
    ['a > 1', 'b < 2', 'not (c > 3 and d > 4)']
    """
    text = spelled(rule.text)
    texts = (ast.get_source_segment(text, node) for node in _joined(tree(rule)))
    return [expression(restored(text or "")) for text in texts]


def _joined(node: ast.expr) -> list[ast.expr]:
    if isinstance(node, ast.BoolOp) and isinstance(node.op, ast.And):
        return [part for value in node.values for part in _joined(value)]
    return [node]


def margins(rule: Expression) -> tuple[Expression, ...]:
    """What has to be above zero for a comparison to hold, or at zero; none where that does not say.

    As of `or`, `not`, `==` and `!=`.

    >>> [margin.text for margin in margins(expression("2 < a.b <= 4 and c > 1"))]
    ['a.b - 2', '4 - a.b', 'c - 1']
    >>> margins(expression("a > 1 or b > 1"))
    ()
    """
    found: list[ast.expr] = []
    for part in _joined(tree(rule)):
        own = _margins(part)
        if not own:
            return ()
        found += own
    return tuple(expression(restored(ast.unparse(node))) for node in found)


def ends_tell(rule: Expression, name: str) -> bool:
    """Whether a rule that holds at both ends of a range of one name holds in between.

    As far as one sees it: where each comparison that has to hold has the name on one side, once,
    and that side only grows or only falls with it.

    >>> [ends_tell(expression(text), "a") for text in ("2 < a < 4 and a > b", "a > 1 or b > 1")]
    [True, True]
    >>> [ends_tell(expression(text), "a") for text in ("a != 4", "a < 1 or a > 2", "abs(a) > 1")]
    [False, False, False]
    """
    parts = _joined(tree(rule))
    return all(_is_monotone(each, name) for part in parts for each in _margins(part) or [part])


def _is_monotone(node: ast.expr, name: str) -> bool:
    """Whether a value only grows, or only falls, with a name, the others being what they are."""
    if constant(node) is not None or name_at(node):
        return True
    with_it = [part for part in parts_of(node) if name in names_in(part)]
    if not with_it:
        return True
    is_bent = (
        (
            isinstance(node, ast.Compare)
            and (isinstance(node.ops[0], ast.Eq | ast.NotEq) or node.ops[1:])
        )
        or (isinstance(node, ast.Call) and name_at(node.func) == "abs")
        or (isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow | ast.Mod))
        or (
            isinstance(node, ast.BinOp)
            and isinstance(node.op, ast.Div)
            and with_it[0] is node.right
        )
    )
    return len(with_it) == 1 and not is_bent and _is_monotone(with_it[0], name)


class Bounds(NamedTuple):
    """Between what numbers a name has to be; whether it may be these themselves."""

    low: float = -np.inf
    high: float = np.inf
    has_low: bool = True
    has_high: bool = True

    @property
    def are_met(self) -> bool:
        """Whether any number is between them."""
        return self.low < self.high or (self.low == self.high and self.has_low and self.has_high)

    def within(self, other: "Bounds") -> "Bounds":
        """Those of what is within both."""
        low, high = max(self.low, other.low), min(self.high, other.high)
        has_low = all(each.has_low for each in (self, other) if each.low == low)
        has_high = all(each.has_high for each in (self, other) if each.high == high)
        return Bounds(low, high, has_low, has_high)


def bounds(rule: Expression) -> tuple[str, Bounds] | None:
    """The name that a comparison is about, and its bounds; None where these are not plain to see.

    >>> bounds(expression("2 < a <= 4"))
    ('a', Bounds(low=2.0, high=4.0, has_low=False, has_high=True))
    >>> bounds(expression("a > 1 or a < 0")), bounds(expression("a * a > 1"))
    (None, None)
    """
    if len(rule.names) != 1:
        return None
    (name,) = rule.names
    found, parts = Bounds(), margins(rule)
    for margin in parts:
        at = [float(margin({name: x})) for x in (0.0, 1.0, 2.0)]
        slope = at[1] - at[0]
        if abs(slope) != 1.0 or at[2] - at[1] != slope:  # no bound of the name itself
            return None
        end = -at[0] / slope
        own = Bounds(low=end) if slope > 0.0 else Bounds(high=end)
        found = found.within(own)
    ends = [bool(rule({name: end})) if np.isfinite(end) else True for end in found[:2]]
    return (name, Bounds(found.low, found.high, *ends)) if parts else None


def keeps_unit(rule: Expression) -> bool:
    """Whether an expression of names of one unit has that unit: a sum of them, and of numbers.

    >>> [keeps_unit(expression(text)) for text in ("a - 2 * b", "min(a, b) / 2", "a * b", "log(a)")]
    [True, True, False, False]
    """
    return _keeps_unit(tree(rule))


def _keeps_unit(node: ast.expr) -> bool:
    if constant(node) is not None or name_at(node):
        return True
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult | ast.Div):
        first, second = node.left, node.right
        is_times = isinstance(node.op, ast.Mult) and constant(first) is not None
        return (is_times or constant(second) is not None) and all(map(_keeps_unit, parts_of(node)))
    is_sum = isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add | ast.Sub)
    is_same = isinstance(node, ast.UnaryOp) and not isinstance(node.op, ast.Not)
    is_one_of = isinstance(node, ast.Call) and name_at(node.func) in ("min", "max", "abs")
    return (is_sum or is_same or is_one_of) and all(map(_keeps_unit, parts_of(node)))


def _margins(node: ast.expr) -> list[ast.expr]:
    """Those of a comparison; none where it says nothing of above or below."""
    if not isinstance(node, ast.Compare):
        return []
    sides = zip(node.ops, [node.left, *node.comparators[:-1]], node.comparators, strict=True)
    found: list[ast.expr] = []
    for op, left, right in sides:
        if isinstance(op, ast.Lt | ast.LtE):
            found.append(ast.BinOp(right, ast.Sub(), left))
        elif isinstance(op, ast.Gt | ast.GtE):
            found.append(ast.BinOp(left, ast.Sub(), right))
        else:
            return []
    return found
