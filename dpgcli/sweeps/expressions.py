"""Expressions over named numbers, evaluated without giving them Python.

`dome_height_mm - unit_separation_mm >= 1 and units < 6`: numbers, names, arithmetic,
comparisons, `and`, `or`, `not`, and a few functions. Names may be dotted. Arrays go
through elementwise.
"""

import ast
import operator
import re
from collections.abc import Callable, Mapping
from functools import reduce
from typing import Any

import numpy as np

from dpgcli.records import dataclass

MOST_CHARACTERS = 500
LARGEST_NUMBER = 1e300  # just below the largest double
MOST_LEVELS = 50  # of nesting, well below Python's own limit
DIGITS_PREFIX = "number_"  # before a part of a dotted name that is a number

Operands = Mapping[str, Any]

_ARITHMETIC: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: np.divide,
    ast.Pow: np.float_power,
    ast.Mod: np.mod,
}
_COMPARISONS: dict[type[ast.cmpop], Callable[[Any, Any], Any]] = {
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
}
_UNARY: dict[type[ast.unaryop], Callable[[Any], Any]] = {
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
    ast.Not: np.logical_not,
}
# what other languages and keyboards write, by how it looks in a text
_INSTEAD = {
    r"\^": "a power is **",
    r"&&?": "both is: and",
    r"\|\|?": "either is: or",
    r"!(?!=)|~": "the opposite is: not",
    r"//": "division is /",
    r"(?<![<>=!])=(?![=<>])": "equal is ==",
    r"<>|≠": "unequal is !=",
    r"[≤⩽]|=<": "at most is <=",
    r"[≥⩾]|=>": "at least is >=",
    r"[×·⋅]": "times is *",
    r"÷": "division is /",
    r"[−–]": "minus is -",
    r"[²³]": "a power is **",
    r"\d,\d": "a decimal point is .",
    r"\d\s*(mm|MPa|mJ|N|rad|deg)\b": "numbers have no unit",
}
_FUNCTIONS: dict[str, Callable[..., Any]] = {
    "abs": np.abs,
    "sqrt": np.sqrt,
    "log": np.log,
    "exp": np.exp,
    "min": lambda *values: reduce(np.minimum, values),
    "max": lambda *values: reduce(np.maximum, values),
}


class ExpressionError(ValueError):
    """The text is no expression of this language; the message says why."""


@dataclass(frozen=True)
class Expression:
    """A checked expression, the names it needs, and whether it is true or false."""

    text: str
    names: frozenset[str]
    is_comparison: bool

    def __call__(self, values: Operands) -> Any:
        """The value for these names, numbers or arrays.

        NaN where any part of it has no finite value, as in a division by zero: then neither a
        comparison nor its opposite holds.
        """
        undefined: list[Any] = []
        with np.errstate(all="ignore"):
            value = _value(tree(self), values, undefined)
        is_undefined = reduce(np.logical_or, undefined, np.False_)
        return np.where(is_undefined, np.nan, value) if np.any(is_undefined) else value


def expression(text: str) -> Expression:
    """Check a text once.

    >>> rule = expression("2 < a.b <= 4 and not c > 1")
    >>> sorted(rule.names), bool(rule({"a.b": 3, "c": 0}))
    (['a.b', 'c'], True)

    Raises ExpressionError for anything but the language above.
    """
    if len(text) > MOST_CHARACTERS:
        raise ExpressionError(f"longer than {MOST_CHARACTERS} characters")
    if "#" in text:
        raise ExpressionError("# would hide what stands behind it: there are no comments here")
    try:
        body = _body(text.strip())
        names = frozenset(names_in(body))
    except ExpressionError:
        raise
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise ExpressionError(f"not an expression: {text!r}{_hint(text)}") from error
    return Expression(text.strip(), names, _is_comparison(body))


def tree(rule: Expression) -> ast.expr:
    """What an expression is made of, names as `name_at` reads them."""
    return _body(rule.text)


def _body(text: str) -> ast.expr:
    return ast.parse(spelled(text), mode="eval").body


def _is_comparison(node: ast.expr) -> bool:
    """Whether a node is true or false, and not a number."""
    is_negation = isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not)
    return is_negation or isinstance(node, ast.Compare | ast.BoolOp)


def _check_truths(nodes: list[ast.expr]) -> None:
    """Refuse a number beside and, or and not: any but 0 would count as true.

    >>> expression("a == 3 or 5")
    Traceback (most recent call last):
        ...
    dpgcli.sweeps.expressions.ExpressionError: and, or and not take comparisons, found 5
    """
    for node in nodes:
        if not _is_comparison(node):
            raise ExpressionError(f"and, or and not take comparisons, found {ast.unparse(node)}")


def _hint(text: str) -> str:
    """How what is not of this language is written here, as far as one sees it.

    >>> _hint("x^2 > 1"), _hint("a > 1 && b > 2"), _hint("x >= 1")
    (' (a power is **)', ' (both is: and)', '')
    """
    for pattern, instead in _INSTEAD.items():
        if re.search(pattern, text):
            return f" ({instead})"
    return ""


def spelled(text: str) -> str:
    """Parts of dotted names that are numbers, `overrides.4-5.`, spelled as Python names."""

    def as_name(match: re.Match[str]) -> str:
        return f".{DIGITS_PREFIX}{match[1].replace('-', 'to')}."

    return re.sub(r"(?<=[A-Za-z_])\.(\d+(?:-\d+)?)\.(?=[A-Za-z_])", as_name, text)


def restored(text: str) -> str:
    """The same, as it was written."""
    parts = rf"\.{DIGITS_PREFIX}(\d+)(?:to(\d+))?\."
    return re.sub(parts, lambda m: f".{m[1]}-{m[2]}." if m[2] else f".{m[1]}.", text)


def names_in(node: ast.expr, depth: int = MOST_LEVELS) -> list[str]:
    """Names in an expression; refuses every node that is not in the language."""
    if depth == 0:
        raise ExpressionError(f"nested more than {MOST_LEVELS} levels deep")
    if (number := constant(node)) is not None:
        if not abs(number) < LARGEST_NUMBER:
            raise ExpressionError("a number beyond double precision")
        return []
    if name := name_at(node):
        return [name]
    return [name for part in parts_of(node) for name in names_in(part, depth - 1)]


def parts_of(node: ast.expr) -> list[ast.expr]:
    """Operands of a node of the language."""
    if isinstance(node, ast.BinOp) and type(node.op) in _ARITHMETIC:
        return [node.left, node.right]
    if isinstance(node, ast.UnaryOp) and type(node.op) in _UNARY:
        if isinstance(node.op, ast.Not):
            _check_truths([node.operand])
        return [node.operand]
    if isinstance(node, ast.BoolOp):
        _check_truths(node.values)
        return node.values
    if isinstance(node, ast.Compare) and all(type(op) in _COMPARISONS for op in node.ops):
        return [node.left, *node.comparators]
    if isinstance(node, ast.Call) and not node.keywords and isinstance(node.func, ast.Name):
        if node.func.id in _FUNCTIONS and _takes(node.func.id, len(node.args)):
            return node.args
        if node.func.id in _FUNCTIONS:
            raise ExpressionError(f"{node.func.id} does not take {len(node.args)} values")
        raise ExpressionError(f"unknown function {node.func.id}; known: {', '.join(_FUNCTIONS)}")
    if isinstance(node, ast.Constant):
        raise ExpressionError(f"only numbers can be compared, not {node.value!r}")
    raise SyntaxError(f"{type(node).__name__} is not of this language")


def constant(node: ast.expr) -> int | float | None:
    """The number that a node is; None if it is none."""
    if isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        return None if isinstance(node.value, bool) else node.value
    return None


def _takes(function: str, n_values: int) -> bool:
    return n_values > 1 if function in ("min", "max") else n_values == 1


def name_at(node: ast.expr) -> str:
    """A name, its parts joined by dots; empty if the node is none."""
    if isinstance(node, ast.Name):
        return node.id
    if isinstance(node, ast.Attribute):
        parent = name_at(node.value)
        part = (
            node.attr.removeprefix(DIGITS_PREFIX).replace("to", "-")
            if DIGITS_PREFIX in node.attr
            else node.attr
        )
        return f"{parent}.{part}" if parent else ""
    return ""


def _as_number(value: Any) -> Any:
    """Truths count as 0 and 1, and whole numbers do not overflow.

    Of a truth NumPy would find functions in half precision.
    """
    return np.multiply(value, 1.0)


def _value(node: ast.expr, values: Operands, undefined: list[Any]) -> Any:
    """The value of a node; `undefined` collects flags of finite parts without a finite value."""
    if (number := constant(node)) is not None:
        return float(number)
    if name := name_at(node):
        return values[name]
    parts = [_value(part, values, undefined) for part in parts_of(node)]
    if isinstance(node, ast.BinOp | ast.Call):
        parts = list(map(_as_number, parts))
    if isinstance(node, ast.BinOp):
        return _defined(_ARITHMETIC[type(node.op)](*parts), parts, undefined)
    if isinstance(node, ast.UnaryOp):
        operand = parts[0] if isinstance(node.op, ast.Not) else _as_number(parts[0])
        return _UNARY[type(node.op)](operand)
    if isinstance(node, ast.BoolOp):
        joined = np.logical_and if isinstance(node.op, ast.And) else np.logical_or
        return reduce(joined, parts)
    if isinstance(node, ast.Compare):
        pairs = zip(node.ops, parts[:-1], parts[1:], strict=True)
        return reduce(np.logical_and, [_COMPARISONS[type(op)](a, b) for op, a, b in pairs])
    assert isinstance(node, ast.Call) and isinstance(node.func, ast.Name), "checked before"
    return _defined(_FUNCTIONS[node.func.id](*parts), parts, undefined)


def _defined(value: Any, parts: list[Any], undefined: list[Any]) -> Any:
    are_finite = reduce(np.logical_and, map(np.isfinite, parts))
    are_numbers = ~reduce(np.logical_or, map(np.isnan, parts))
    undefined.append(are_finite & ~np.isfinite(value) | are_numbers & np.isnan(value))
    return value
