"""Dataclasses that are made quickly: a prediction needs two hundred before it begins.

The standard library writes and compiles every method of every class, half a millisecond for a
frozen one: for all that a prediction needs, as long as NumPy takes to be imported. Here they share
all methods but `__init__`. They are dataclasses all the same, for `dataclasses.replace`, `fields`
and pickles; type checkers see the standard one.
"""

import dataclasses
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dataclasses import dataclass as dataclass  # for those that import it from here
else:

    def dataclass(cls=None, /, *, frozen=False, eq=True, repr=True):
        """As `dataclasses.dataclass`, which explains the choices.

        >>> @dataclass(frozen=True)
        ... class Place:
        ...     x_mm: float
        ...     y_mm: float = 0.0
        >>> Place(1.0), Place(1.0) == Place(1.0, 0.0)
        (Place(x_mm=1.0, y_mm=0.0), True)
        """
        if cls is None:
            return lambda cls: dataclass(cls, frozen=frozen, eq=eq, repr=repr)
        shared = {"__repr__": _shown} if repr else {}
        if eq:
            shared |= {"__eq__": _is_equal, "__hash__": _hash if frozen else None}
        if frozen:
            shared |= {"__setattr__": _set_once, "__delattr__": _refuse}
        for name in shared.keys() - cls.__dict__.keys():
            setattr(cls, name, shared[name])
        return dataclasses.dataclass(eq=False, repr=False)(cls)


def _values(record: Any) -> tuple[Any, ...]:
    return tuple(getattr(record, name) for name in record.__dataclass_fields__)


def _shown(record: Any) -> str:
    values = ", ".join(f"{name}={getattr(record, name)!r}" for name in record.__dataclass_fields__)
    return f"{type(record).__qualname__}({values})"


def _is_equal(record: Any, other: object) -> Any:
    return _values(record) == _values(other) if type(other) is type(record) else NotImplemented


def _hash(record: Any) -> int:
    return hash(_values(record))


def _set_once(record: Any, name: str, value: object) -> None:
    """Set a field for the first time, as `__init__` does."""
    if name in record.__dict__ or name not in record.__dataclass_fields__:
        raise dataclasses.FrozenInstanceError(f"cannot assign to field {name!r}")
    record.__dict__[name] = value


def _refuse(_: object, name: str) -> None:
    raise dataclasses.FrozenInstanceError(f"cannot delete field {name!r}")
