"""YAML read safely: values, places, and every kind of malformed file."""

import io
import math
from pathlib import Path

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from dpgcli.errors import Field, SpecError
from dpgcli.files.places import Location, shown
from dpgcli.files.yaml_file import MAX_BYTES, parse_document, parse_value, read_document
from dpgcli.text import shortened


def problems_of(text):
    with pytest.raises(SpecError) as caught:
        parse_document("a.yaml", text)
    return [str(problem) for problem in caught.value.problems]


def file_problem(path):
    with pytest.raises(SpecError) as caught:
        read_document(path)
    (problem,) = caught.value.problems
    return problem


def test_values_follow_yaml_1_2():
    text = (
        "a: 1e6\nb: on\nc: 010\nd: .inf\ne: -3\nf: true\ng: ~\nh: '1'\ni: [1, 2.5]\nj: 2020-01-01"
    )
    document = parse_document("a.yaml", text)
    assert document.data == {
        "a": 1e6,
        "b": "on",
        "c": 10,
        "d": math.inf,
        "e": -3,
        "f": True,
        "g": None,
        "h": "1",
        "i": [1, 2.5],
        "j": "2020-01-01",
    }
    assert type(document.data["a"]) is float and type(document.data["f"]) is bool


def test_places_are_those_of_the_keys_counted_from_one():
    document = parse_document("a.yaml", "# top\na:\n  b: {c: 1,  d: 2}\n  4-5: x\n")
    assert document.place(("a",)) == Location("a.yaml", 2, 1)
    assert document.place(("a", "b", "d")) == Location("a.yaml", 3, 14)
    assert document.place(("a", "4-5")) == Location("a.yaml", 4, 3)


def test_the_place_of_a_missing_key_is_its_section():
    document = parse_document("a.yaml", "a: 1\nb:\n  c: 2\n")
    assert document.place(("b", "missing", "deeper")) == Location("a.yaml", 2, 1)
    assert document.place(("missing",)) == Location("a.yaml", 1, 1)


def test_numbers_as_keys_become_text():
    assert parse_document("a.yaml", "4: x\n0x10: y\n4.5: z\n").data == {
        "4": "x",
        "16": "y",
        "4.5": "z",
    }


def test_anchors_and_merge_keys():
    text = "a: &a {x: 1, y: 2}\nb:\n  <<: *a\n  y: 3\nc: {<<: [{x: 7}, {x: 8, z: 9}]}\nd: *a\n"
    document = parse_document("a.yaml", text)
    assert document.data["b"] == {"x": 1, "y": 3}
    assert document.data["c"] == {"x": 7, "z": 9}
    assert document.data["d"] == {"x": 1, "y": 2}
    assert document.place(("b", "x")) == Location("a.yaml", 1, 8)
    assert document.place(("b", "y")) == Location("a.yaml", 4, 3)


def test_every_repeated_key_is_reported_with_both_lines():
    document = parse_document("a.yaml", "a: 1\nb:\n  c: 1\n  c: 2\na: 2\n4: x\n'4': y\n")
    assert [str(problem) for problem in document.problems] == [
        "a.yaml:4:3: b.c: expected each key once, found it again, first on line 3",
        "a.yaml:5:1: a: expected each key once, found it again, first on line 1",
        "a.yaml:7:1: 4: expected each key once, found it again, first on line 6",
    ]
    assert document.data["a"] == 1


def test_foreign_tags_are_refused_and_not_constructed():
    document = parse_document("a.yaml", "a: !!python/object/apply:os.system [ls]\nb: 2\nc: !x 3\n")
    assert [(p.line, p.column, p.key) for p in document.problems] == [(1, 1, "a"), (3, 1, "c")]
    assert document.data == {"a": None, "b": 2, "c": None}


@pytest.mark.parametrize(
    ("text", "start"),
    [
        ("a: b: c", "a.yaml:1:5: syntax: expected valid YAML"),
        ("a: [1,\nb: 2", "a.yaml:2:5: syntax: expected valid YAML"),
        ("a: 1\n---\nb: 2\n", "a.yaml:2:1: syntax: expected valid YAML, found another document"),
        ("a: *b", "a.yaml:1:4: syntax: expected valid YAML, found undefined alias"),
        ("a: 1\nb: \x00", "a.yaml:2:4: syntax: expected printable characters, found '\\x00'"),
        ("", "a.yaml:1:1: document: expected a mapping of keys to values, found nothing"),
        ("# only\n", "a.yaml:1:1: document: expected a mapping of keys to values, found nothing"),
        ("[1]", "a.yaml:1:1: document: expected a mapping of keys to values, found a list of 1"),
        ("\n5", "a.yaml:2:1: document: expected a mapping of keys to values, found a single value"),
        ("%YAML 3.1\n---\na: 1", "a.yaml:1:1: syntax: expected valid YAML"),
    ],
)
def test_a_file_that_is_no_mapping_has_one_problem_with_its_place(text, start):
    (problem,) = problems_of(text)
    assert problem.startswith(start)


@pytest.mark.parametrize(
    "text",
    [
        "hunter2",
        "hunter2\nAWS_KEY=hunter2",
        "- hunter2",
        "'hunter2",
        "*hunter2",
        "!hunter2 x",
        "!hunter2!x y",
        "&hunter2\n&hunter2 x",
        "a: 1\n*hunter2",
        "a: *hunter2",
        "{hunter2: {a",
        "%hunter2",
        '"\\hunter2"',
        "hunter2\n: [",
        "2020-99-99 hunter2",
        "root:hunter2:0:0:/root",
    ],
)
def test_what_is_no_yaml_mapping_is_not_quoted(text):
    assert "hunter" not in " ".join(problems_of(text))


def test_twenty_levels_are_read_and_one_more_is_refused():
    def nested(levels):
        return "a: " + "[" * (levels - 1) + "]" * (levels - 1)

    assert parse_document("a.yaml", nested(20)).data["a"] is not None
    (problem,) = problems_of(nested(22))
    assert problem == "a.yaml:1:24: document: expected at most 20 levels, found deeper nesting"


@pytest.mark.parametrize("text", ["a: &a [*a]", "a: &a {<<: *a}", "a: &a {b: *a}"])
def test_cycles_are_refused(text):
    assert "expected at most 20 levels" in problems_of(text)[-1]


def test_alias_bombs_are_refused():
    rows = ["l0: &l0 [1, 1, 1, 1, 1, 1, 1, 1, 1]"]
    rows += [f"l{i}: &l{i} [{', '.join([f'*l{i - 1}'] * 9)}]" for i in range(1, 12)]
    assert "expected at most 10000 values, found more" in problems_of("\n".join(rows))[-1]


def test_numbers_that_overflow_are_not_taken_for_infinity():
    (problem,) = parse_document("a.yaml", "a: 1e400").problems
    assert (problem.line, problem.column) == (1, 1)
    assert problem.found == '"1e400"'


def test_files_that_cannot_be_read(tmp_path):
    assert file_problem(tmp_path).found == "a directory"
    assert file_problem(tmp_path / "no.yaml").found == "no such file or directory"
    assert file_problem("a\0b").file == "a\\x00b"
    (tmp_path / "latin.yaml").write_bytes("a: 1\nb: Länge".encode("latin-1"))
    latin = file_problem(tmp_path / "latin.yaml")
    assert (latin.line, latin.column, latin.found) == (2, 5, "byte 0xe4")


def test_the_size_is_checked_before_reading(tmp_path, monkeypatch):
    path = tmp_path / "large.yaml"
    path.write_bytes(b"#" * MAX_BYTES)
    with pytest.raises(SpecError, match="found nothing"):
        read_document(path)
    path.write_bytes(b"#" * (MAX_BYTES + 1))
    monkeypatch.setattr("pathlib.Path.open", None)
    problem = file_problem(path)
    assert (problem.expected, problem.found) == ("at most 256 KiB", f"{MAX_BYTES + 1} bytes")


def test_endless_files_are_read_no_further_than_the_limit():
    if not Path("/dev/zero").exists():
        pytest.skip("no /dev/zero here")
    assert file_problem("/dev/zero").found == "more"


def test_standard_input_and_byte_order_marks(monkeypatch):
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(b"\xef\xbb\xbfa: 1\n")))
    document = read_document("-")
    assert (document.file, document.data) == ("<stdin>", {"a": 1})


def test_single_values():
    place = Location(Field("settings"))
    assert parse_value("1e4", place) == 1e4
    assert parse_value("{a: [1]}", place) == {"a": [1]}
    assert parse_value("", place) is None
    with pytest.raises(SpecError) as caught:
        parse_value("{a: 1, a: 2}", place)
    assert str(caught.value) == "settings: a: expected each key once, found it again"


def test_found_values_are_short_and_printable():
    assert len(shown("x" * 1000)) == 60 and len(shortened("\n" * 1000)) == 60
    assert shown("a\nb\ud800") == '"a\\nb\\ud800"'
    assert shown(10**5000) == "a number of more than 60 digits"
    assert shown(float("nan")) == ".nan" and shown(-math.inf) == "-.inf"


YAML_TEXT = st.text(alphabet=" \n\t:-[]{},&*!#|>'\"%@`?<~=_.ab01eEx+\\\x85\ufeff\0é", max_size=60)


def parses_or_refuses(text):
    try:
        parse_document("a.yaml", text)
    except SpecError as error:
        assert error.problems
        str(error).encode()


@settings(max_examples=300, deadline=None)
@given(YAML_TEXT)
@example("!!int ''")
@example("a: !!int ''")
@example("a: !!bool x")
@example("a: !!float x")
@example("a: 0x_")
@example("a: __")
@example("a: !!null [1]")
@example("? [a]\n: 1")
@example("<<: 3")
@example("<<: [3]")
@example('"\\ud800": 1')
@example("a: &a 1\nb: &a 2")
@example("%YAML 1.9\n---\na: 1_0:1")
@example("%YAML 1.1\n---\na: 1e5")
@example("%TAG ! tag:yaml.org,2002:\n---\na: !int x")
@example(f"a: {'9' * 5000}")
@example(f"{'9' * 5000}: a")
@example(f"0x{'f' * 5000}: 0x{'f' * 5000}")
def test_no_text_gets_past_the_reader(text):
    parses_or_refuses(text)


@settings(max_examples=200, deadline=None)
@given(st.binary(max_size=60))
def test_no_bytes_get_past_the_reader(tmp_path_factory, content):
    path = tmp_path_factory.getbasetemp() / "fuzz.yaml"
    path.write_bytes(content)
    try:
        read_document(path)
    except SpecError as error:
        assert error.problems


@pytest.mark.parametrize(
    "part", ["[", "- ", "? ", "a: {", "'", "&a ", "!!", "a:\n ", "\t", "a: b: "]
)
def test_large_files_of_one_part_are_refused(part):
    parses_or_refuses(part * (20_000 // len(part)))
