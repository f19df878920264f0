"""YAML read safely: plain data, where every key stands, and all problems of form."""

import math
import os
import re
import sys
import warnings
from collections.abc import Iterator
from dataclasses import field
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.composer import MaxDepthExceededError
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.nodes import MappingNode, Node, SequenceNode
from ruamel.yaml.reader import ReaderError

from dpgcli.errors import Field, Problem, SpecError
from dpgcli.files.content import MAX_BYTES, bounded, content_of, decoded
from dpgcli.files.places import Location, in_order, located, shown
from dpgcli.records import dataclass
from dpgcli.text import MAX_SHOWN, KeyPath, dotted, shortened

MAX_NODES = 10_000
MAX_DEPTH = 20

FREE = "x-"  # begins keys of the top level that are the user's, such as those for anchors
_TAG = "tag:yaml.org,2002:"
_MERGE = f"{_TAG}merge"
_TYPED = frozenset(_TAG + name for name in ("null", "bool", "int", "float"))
_TEXT = frozenset(_TAG + name for name in ("str", "timestamp", "value", "merge"))
# What ruamel.yaml is known to let through on malformed input, besides its own errors.
_LEAKS = (ValueError, LookupError, AttributeError, TypeError, AssertionError, OverflowError)

NAMED = re.compile(r"\b(alias|handle) '.*'")  # what ruamel.yaml quotes of a file, but characters


@dataclass(frozen=True)
class Document:
    """The data of one YAML file, keys as text, with the place of each key and problems so far.

    `files` are others whose content is in the data; `prefix` is where a section stands in its
    file.
    """

    file: str
    data: dict[str, Any]
    places: dict[KeyPath, Location]
    problems: tuple[Problem, ...] = ()
    files: tuple[Path, ...] = ()
    prefix: KeyPath = ()

    def place(self, path: KeyPath) -> Location:
        """Where the key stands, or the nearest section around it."""
        for length in range(len(path), -1, -1):
            if place := self.places.get(path[:length]):
                return place
        return Location(self.file)

    def section(self, path: KeyPath, data: dict[str, Any]) -> "Document":
        """A section as a document of its own, whose keys still have their full names."""
        length = len(path)
        inner = {p[length:]: place for p, place in self.places.items() if p[:length] == path}
        places = {(): self.place(path), **inner}
        return Document(self.file, data, places, prefix=(*self.prefix, *path))

    def problem(self, path: KeyPath, expected: str, found: str, hint: str = "") -> Problem:
        """A problem with the value at a key path, which may be missing."""
        return located(self.place(path), dotted((*self.prefix, *path)), expected, found, hint)

    def empty(self) -> list[KeyPath]:
        """Keys that stand there without a value, as the last one of a file that was cut off."""
        return list(_empty(self.data, ()))


def _empty(value: Any, path: KeyPath) -> Iterator[KeyPath]:
    if value is None:
        yield path
    items = value.items() if isinstance(value, dict) else ()
    for key, part in enumerate(value) if isinstance(value, list) else items:
        yield from _empty(part, (*path, key))


def read_document(path: str | os.PathLike[str]) -> Document:
    """Read a YAML file whose top level is a mapping; "-" reads standard input.

    Problems that leave the rest of the file readable (repeated keys, foreign tags) are kept in the
    document, the others raise SpecError.
    """
    return parse_document(*read_text(path))


def read_text(path: str | os.PathLike[str]) -> tuple[str, str]:
    """Name of a YAML file in messages, and its text. Raises SpecError for what is none."""
    name = os.fspath(path)
    place = Location("<stdin>" if name == "-" else shortened(name, 4096))
    return place.file, decoded(_content(name, place), place)


def parse_document(file: str, text: str) -> Document:
    """The document in a text; `file` is its name in messages."""
    walk = _Walk(Location(file))
    start, data = walk.read(text)
    if not isinstance(data, dict):
        wrong = located(start, "document", "a mapping of keys to values", _kind(data))
        raise SpecError(in_order([*walk.problems, wrong]))
    own = without_free_keys(data)
    return Document(file, own, {(): start, **walk.places}, in_order(walk.problems))


def _kind(data: Any) -> str:
    """What stands where keys should, not quoted: it may be a password, and messages are in logs."""
    if isinstance(data, str):
        return "text without keys"
    return shown(data) if data is None or isinstance(data, list) else "a single value"


def without_free_keys(data: dict[str, Any]) -> dict[str, Any]:
    """The top level without the keys that are the user's own, as in Compose files.

    >>> without_free_keys({"x-soft": {"elastic_modulus_MPa": 1}, "finger": {}})
    {'finger': {}}
    """
    return {key: value for key, value in data.items() if not key.startswith(FREE)}


def parse_value(text: str, place: Location) -> Any:
    """One value, such as the right side of a setting, by the rules of the files."""
    walk = _Walk(place)
    _, data = walk.read(text)
    if walk.problems:
        raise SpecError(in_order(walk.problems))
    return data


def _content(name: str, place: Location) -> bytes:
    """The bytes of a file or of standard input, never more than the limit."""
    hint = "a spec is short text"
    if name == "-":
        return bounded(sys.stdin.buffer, place, MAX_BYTES, hint)
    return content_of(Path(name), place, MAX_BYTES, hint)


@dataclass
class _Walk:
    """Turns the node graph of one text into plain data; cycles and alias bombs meet its limits."""

    start: Location
    places: dict[KeyPath, Location] = field(default_factory=dict)
    problems: list[Problem] = field(default_factory=list)
    n_visited: int = 0

    def __post_init__(self) -> None:
        self.yaml = YAML(typ="safe", pure=True)
        self.yaml.max_depth = MAX_DEPTH + 1

    def read(self, text: str) -> tuple[Location, Any]:
        """Where the text's value starts, and the value; an empty text is None."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            node = self.composed(text)
            if node is None:
                return self.at(0, 0), None
            return self.marked(node), self.value(node)

    def marked(self, node: Node) -> Location:
        """Where a node starts, if its text has lines of its own."""
        return self.at(node.start_mark.line, node.start_mark.column)

    def at(self, line: int, column: int) -> Location:
        """A place in the text from line and column counted from 0."""
        if isinstance(self.start.file, Field):  # which has no lines
            return self.start
        return Location(self.start.file, line + 1, column + 1)

    def composed(self, text: str) -> Node | None:
        """The root node of a text, none if it is empty."""
        try:
            root: Node | None = self.yaml.compose(text)
            return root
        except (MaxDepthExceededError, RecursionError) as error:
            raise SpecError((self.too_deep(_mark(error)),)) from None
        except ReaderError as error:
            raise SpecError((self.unprintable(text, error.position),)) from None
        except (YAMLError, *_LEAKS) as error:
            raise SpecError((self.malformed(error),)) from None

    def too_deep(self, mark: Any) -> Problem:
        place = self.at(mark.line, mark.column) if mark else self.start
        return located(place, "document", f"at most {MAX_DEPTH} levels", "deeper nesting")

    def unprintable(self, text: str, position: int) -> Problem:
        before = text[:position]
        place = self.at(before.count("\n"), position - (before.rfind("\n") + 1))
        found = ascii(text[position : position + 1])
        return located(place, "syntax", "printable characters", found)

    def malformed(self, error: Exception) -> Problem:
        """A syntax error in one line."""
        mark = _mark(error)
        place = self.at(mark.line, mark.column) if mark else self.start
        problem = getattr(error, "problem", None) or type(error).__name__
        wanted, _, found = " ".join(problem.split()).rpartition("but ")
        around = [getattr(error, "context", None), wanted.rstrip(", ")]
        where = ", ".join(" ".join(part.split()) for part in around if part)
        found = NAMED.sub(r"\1", re.sub("^(found|got) ", "", found))
        said = found + (f" ({where})" if where else "")
        return located(place, "syntax", "valid YAML", shortened(said, 120))

    def value(self, node: Node, path: KeyPath = (), depth: int = 0) -> Any:
        """The plain value of a node: dict, list, text, number, truth or None."""
        self.n_visited += 1
        if self.n_visited > MAX_NODES:
            few = located(self.marked(node), dotted(path), f"at most {MAX_NODES} values", "more")
            raise SpecError((*self.problems, few))
        if depth > MAX_DEPTH:
            raise SpecError((*self.problems, self.too_deep(node.start_mark)))
        if isinstance(node, MappingNode) and node.tag == f"{_TAG}map":
            return self.mapping(node, path, depth)
        if isinstance(node, SequenceNode) and node.tag == f"{_TAG}seq":
            return self.sequence(node, path, depth)
        return self.scalar(node, path)

    def sequence(self, node: SequenceNode, path: KeyPath, depth: int) -> list[Any]:
        items = []
        for index, item in enumerate(node.value):
            self.places.setdefault((*path, index), self.marked(item))
            items.append(self.value(item, (*path, index), depth + 1))
        return items

    def mapping(self, node: MappingNode, path: KeyPath, depth: int) -> dict[str, Any]:
        """Own keys first, so that they win over merged ones in data and in places."""
        lines: dict[str, Location] = {}
        own: dict[str, Any] = {}
        merged: Node | None = None
        for key_node, value_node in node.value:
            key = self.key(key_node, path)
            if key is None or self.is_repeated(key, key_node, path, lines):
                continue
            if key_node.tag == _MERGE:
                merged = value_node
                continue
            self.places.setdefault((*path, key), lines[key])
            own[key] = self.value(value_node, (*path, key), depth + 1)
        return own if merged is None else {**self.merged(merged, path, depth + 1), **own}

    def merged(self, node: Node, path: KeyPath, depth: int) -> dict[str, Any]:
        """The keys that `<<` brings in from one mapping or several, earlier ones winning."""
        brought: dict[str, Any] = {}
        for part in node.value if isinstance(node, SequenceNode) else [node]:
            data = self.value(part, path, depth) if isinstance(part, MappingNode) else None
            if isinstance(data, dict):
                brought = {**data, **brought}
            else:
                place = self.marked(part)
                self.wrong(place, (*path, "<<"), "mappings to merge", "something else")
        return brought

    def key(self, node: Node, path: KeyPath) -> str | None:
        """A key as text; whole numbers in their plain form, so that 4 and "4" are one key."""
        name = node.value if isinstance(node.value, str) else ""
        if node.tag == f"{_TAG}int":
            number = self.scalar(node, path)
            name = str(number) if isinstance(number, int) and number < 10**9 else name
        if not name or not name.isprintable() or len(name) > 10 * MAX_SHOWN:
            found = shown(name) if name else "something else"
            self.wrong(self.marked(node), path, "a name as key", found)
            return None
        return name

    def is_repeated(self, key: str, node: Node, path: KeyPath, lines: dict[str, Location]) -> bool:
        place = self.marked(node)
        if key not in lines:
            lines[key] = place
            return False
        first = lines[key]
        found = f"it again, first on line {first.line}" if first.line else "it again"
        self.problems.append(located(place, dotted((*path, key)), "each key once", found))
        return True

    def scalar(self, node: Node, path: KeyPath) -> Any:
        """A number, truth, nothing or text; anything else is a foreign tag."""
        place = self.places.get(path) or self.marked(node)
        if isinstance(node.value, str) and node.tag in _TEXT:
            return node.value
        if not isinstance(node.value, str) or node.tag not in _TYPED:
            found = f"the tag {shortened(str(node.tag))}" if path else "a tag"
            self.wrong(place, path, "plain values", found)
            return None
        try:
            number = self.yaml.constructor.construct_object(node)
        except (YAMLError, *_LEAKS):
            self.wrong(place, path, f"a value that fits {node.tag}", shown(node.value))
            return None
        if isinstance(number, float) and math.isinf(number) and "inf" not in node.value.lower():
            self.wrong(place, path, "a number below 1e308", shown(node.value))
        return number

    def wrong(self, place: Location, path: KeyPath, expected: str, found: str) -> None:
        self.problems.append(located(place, dotted(path), expected, found))


def _mark(error: Exception) -> Any:
    """The place that an error of ruamel.yaml carries, none if it carries none."""
    if not isinstance(error, MarkedYAMLError):
        return None
    return error.problem_mark or error.context_mark
