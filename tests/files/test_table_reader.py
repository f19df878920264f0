"""Tables of designs of whatever origin, and facts of runs."""

import datetime
import io
import subprocess
import sys
import tracemalloc
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from dpgcli.arrays import Columns
from dpgcli.errors import UsageError
from dpgcli.files.table_reader import designs_in, read_designs, read_record

N = 4
COLUMNS: dict[str, Any] = {
    "design": [0, 1, 2, 3],
    "height_mm": [4.5, 5.5, 6.5, 7.5],
    "calibration": ["given"] * N,
    "status": ["stable", "stable", "stable", "invalid"],
    "reason": ["", "", "", "no such finger"],
    "n_stable": [8, 8, 8, 0],
    "reach_max_mm": [40.0, 41.0, 42.0, None],
}
NOT_NUMBERS = {
    "text": pa.array(["1"] * N),
    "binary": pa.array([b"\xff"] * N),
    "dates": pa.array([datetime.date(2020, 1, 1)] * N),
    "lists": pa.array([[1.0]] * N),
    "structs": pa.array([{"a": 1}] * N),
    "categories": pa.array(["a"] * N).dictionary_encode(),
}
NOT_WHOLE = {
    **NOT_NUMBERS,
    "fractions": pa.array([0.5] * N),
    "gaps": pa.array([1, None, 3, 4]),
    "nan": pa.array([np.nan] * N),
    "inf": pa.array([np.inf] * N),
    "beyond 63 bits": pa.array([2**63] * N, pa.uint64()),
    "nothing": pa.nulls(N),
}
NOT_TEXT = {
    **{name: NOT_NUMBERS[name] for name in ("binary", "dates", "lists", "structs")},
    "numbers": pa.array([1.0, np.nan, 2.0, 3.0]),
    "flags": pa.array([True] * N),
}


def read(tmp_path: Path, **changes: Any) -> Columns:
    pq.write_table(pa.table({**COLUMNS, **changes}), tmp_path / "t.parquet")
    return read_designs(tmp_path / "t.parquet")[0]


@pytest.mark.parametrize(
    ("column", "kind", "values"),
    [("design", "whole numbers", v) for v in NOT_WHOLE.items()]
    + [("n_stable", "whole numbers", v) for v in NOT_WHOLE.items()]
    + [("height_mm", "numbers", v) for v in NOT_NUMBERS.items()]
    + [("status", "text", v) for v in NOT_TEXT.items()]
    + [("reason", "text", v) for v in NOT_TEXT.items()],
)
def test_a_column_of_another_type_is_named(
    tmp_path: Path, column: str, kind: str, values: tuple[str, Any]
) -> None:
    with pytest.raises(UsageError, match=f"column {column}: expected {kind}, found "):
        read(tmp_path, **{column: values[1]})


@pytest.mark.parametrize(
    "values",
    [
        pa.array([1, 2, 3, 4], pa.uint8()),
        pa.array([1, 2, 3, 4], pa.uint64()),
        pa.array([1.0, 2.0, 3.0, 4.0], pa.float32()),
        pa.array(np.array([1, 2, 3, 4], np.float16)),
        pa.array([Decimal("1.00"), Decimal(2), Decimal(3), Decimal(4)]),
        pa.array([1, 2, 3, 4]).dictionary_encode(),
    ],
    ids=lambda values: str(values.type),
)
def test_numbers_are_numbers_however_they_are_stored(tmp_path: Path, values: Any) -> None:
    found = read(tmp_path, **dict.fromkeys(("design", "height_mm", "n_stable", "own"), values))
    for column in ("design", "height_mm", "n_stable", "own"):
        assert found[column].tolist() == [1, 2, 3, 4]
    assert found["design"].dtype == np.int64


def test_whole_numbers_of_64_bits_keep_their_sign(tmp_path: Path) -> None:
    found = read(tmp_path, own=pa.array([2**64 - 1] * N, pa.uint64()))
    assert found["own"].tolist() == [2.0**64] * N


KINDS_OF_TEXT = [
    pa.string(),
    pa.large_string(),
    pa.string_view(),
    pa.binary(),
    pa.large_binary(),
    pa.binary_view(),
]


@pytest.mark.parametrize("kind", [*KINDS_OF_TEXT, pa.dictionary("int8", "string")], ids=str)
def test_text_is_text_and_nothing_is_empty(tmp_path: Path, kind: Any) -> None:
    values = pa.array(["a", None, "", "ü"]).cast(kind)
    found = read(tmp_path, reason=values)
    assert found["reason"].tolist() == ["a", "", "", "ü"]
    of_memory = designs_in(pa.table({**COLUMNS, "reason": values}), "t").columns
    assert of_memory["reason"].tolist() == ["a", "", "", "ü"]


@pytest.mark.parametrize("kind", [pa.large_string(), pa.binary(), pa.large_binary()], ids=str)
def test_dictionaries_of_any_text_are_text(kind: Any) -> None:
    values = pa.array(["a", None, "", "b"]).cast(kind).dictionary_encode()
    found = designs_in(pa.table({**COLUMNS, "reason": values}), "t").columns
    assert found["reason"].tolist() == ["a", "", "", "b"]


@pytest.mark.parametrize(
    ("column", "values", "found"),
    [
        ("n_stable", pa.nulls(N), "no value in any row"),
        ("n_stable", pa.nulls(N, pa.float64()), "no value in any row"),
        ("height_mm", pa.nulls(N), "no value in any row"),
        ("n_stable", NOT_WHOLE["gaps"], "1 row without one"),
        ("n_stable", NOT_WHOLE["beyond 63 bits"], "uint64 beyond 63 bits"),
        ("n_stable", NOT_WHOLE["fractions"], "others as well"),
        ("status", NOT_WHOLE["beyond 63 bits"], "uint64"),
    ],
)
def test_what_a_column_has_is_said(tmp_path: Path, column: str, values: Any, found: str) -> None:
    with pytest.raises(UsageError, match=f"column {column}: expected .*, found {found}$"):
        read(tmp_path, **{column: values})


def test_columns_that_nobody_can_use_are_left_out(tmp_path: Path) -> None:
    found = read(tmp_path, **NOT_NUMBERS)
    assert list(found) == list(COLUMNS)


@pytest.mark.parametrize(
    "order",
    [
        sorted(COLUMNS),
        list(reversed(COLUMNS)),
        ["status", "design", "n_stable", "calibration", "height_mm", "reason", "reach_max_mm"],
    ],
)
def test_columns_may_stand_in_any_order(tmp_path: Path, order: list[str]) -> None:
    pq.write_table(pa.table(COLUMNS).select(order), tmp_path / "t.parquet")
    found = read_designs(tmp_path / "t.parquet")[0]
    assert list(found)[:3] == ["design", "height_mm", "calibration"]
    assert found.keys() == COLUMNS.keys()
    with_notes = pa.table({**COLUMNS, "notes": ["a"] * N}).select([*reversed(order), "notes"])
    assert list(designs_in(with_notes, "t").columns)[:3] == ["design", "height_mm", "calibration"]


@pytest.mark.parametrize("reasons", [["", "", "", "no such finger"], [""] * N])
@pytest.mark.parametrize("with_index", [False, True])
def test_a_table_that_went_through_csv_is_the_same(
    tmp_path: Path, reasons: list[str], with_index: bool
) -> None:
    """Where empty text comes back as NaN."""
    expected = read(tmp_path, reason=reasons)
    text = pd.DataFrame(expected).to_csv(index=with_index)
    pd.read_csv(io.StringIO(text), index_col=0 if with_index else None).to_parquet(
        tmp_path / "t.parquet"
    )
    found = read_designs(tmp_path / "t.parquet")[0]
    assert list(found) == list(expected)
    for name, column in found.items():
        np.testing.assert_array_equal(column, expected[name], strict=True)


def test_a_text_that_repeats_takes_no_room(tmp_path: Path) -> None:
    """4 GB of it: known columns are read as dictionaries, others not at all."""
    n_rows, text = 4_000_000, pa.array(["x" * 1000])
    repeated = pa.DictionaryArray.from_arrays(pa.array(np.zeros(n_rows, np.int8)), text)
    numbers = pa.array(np.zeros(n_rows, np.int8))
    columns = {**dict.fromkeys(COLUMNS, numbers), "status": repeated, "calibration": repeated}
    table = pa.table({**columns, "reason": repeated.slice(0, n_rows), "note": repeated})
    pq.write_table(table, tmp_path / "t.parquet", store_schema=False)
    assert (tmp_path / "t.parquet").stat().st_size < 1e7
    before = pa.default_memory_pool().max_memory()
    tracemalloc.start()
    designs = read_designs(tmp_path / "t.parquet").columns
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak + pa.default_memory_pool().max_memory() - before < 1e9
    assert designs["reason"][-1] == "x" * 1000
    assert "note" not in designs


ENCODINGS = ("PLAIN", "DELTA_BYTE_ARRAY", "DELTA_LENGTH_BYTE_ARRAY")


@pytest.mark.parametrize("kind", [pa.string(), pa.large_string()])
@pytest.mark.parametrize("encoding", ENCODINGS)
def test_text_however_it_is_encoded(
    tmp_path: Path, encoding: str, kind: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of some encodings pyarrow makes no dictionaries, and they are read by hand."""
    monkeypatch.setattr("dpgcli.files.table_reader.ROWS_AT_ONCE", 3)
    texts = {name: pa.array(COLUMNS[name], kind) for name in ("calibration", "status")}
    reasons = pa.array(["", None, "", "no such finger"], kind)
    table = pa.table({**COLUMNS, **texts, "reason": reasons})
    encodings = dict.fromkeys(("calibration", "status", "reason"), encoding)
    options: dict[str, Any] = {"use_dictionary": False, "column_encoding": encodings}
    pq.write_table(table, tmp_path / "t.parquet", row_group_size=2, **options)
    columns = read_designs(tmp_path / "t.parquet").columns
    for name in ("calibration", "status", "reason"):
        assert columns[name].tolist() == COLUMNS[name], name
    assert list(columns) == list(COLUMNS)
    pq.write_table(table.slice(0, 0), tmp_path / "t.parquet", **options)
    assert len(read_designs(tmp_path / "t.parquet").columns["status"]) == 0


def test_a_text_that_repeats_in_another_encoding_takes_no_room(tmp_path: Path) -> None:
    """40 MB in each column; the memory is looked at in a process that has not had more before."""
    n_rows, texts = 40_000, ("calibration", "status", "reason")
    columns: dict[str, Any] = dict.fromkeys(COLUMNS, pa.array(np.zeros(n_rows, np.int8)))
    columns |= dict.fromkeys(texts, pa.array(["x" * 1000] * n_rows))
    options: dict[str, Any] = {"column_encoding": dict.fromkeys(texts, "DELTA_BYTE_ARRAY")}
    pq.write_table(pa.table(columns), tmp_path / "t.parquet", use_dictionary=False, **options)
    program = (
        "import pyarrow, sys; from pathlib import Path; "
        "from dpgcli.files.table_reader import read_designs; "
        "assert read_designs(Path(sys.argv[1])).columns['reason'][-1] == 'x' * 1000; "
        "print(pyarrow.default_memory_pool().max_memory())"
    )
    peak = subprocess.check_output([sys.executable, "-c", program, tmp_path / "t.parquet"])
    assert int(peak) < 1e7


def test_what_pyarrow_cannot_decode_is_not_called_damaged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for error in (OSError, pa.ArrowNotImplementedError):

        def reading(*_: Any, error: type[Exception] = error, **__: Any) -> None:
            raise error("Not yet implemented: such an encoding")

        monkeypatch.setattr(pq.ParquetFile, "read", reading)
        with pytest.raises(UsageError, match=r"(?i)t\.parquet: not yet implemented: such an enc"):
            read(tmp_path)


def test_what_memory_cannot_hold_is_not_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("os.sysconf", lambda name: 10)
    with pytest.raises(UsageError, match=r"t\.parquet: its columns take .* GB of memory"):
        read(tmp_path)


@pytest.mark.parametrize("error", [MemoryError, pa.ArrowMemoryError])
def test_too_little_memory_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: type[Exception]
) -> None:
    def reading(*_: Any, **__: Any) -> None:
        raise error("malloc of size 1234 failed")

    monkeypatch.setattr(pq.ParquetFile, "read", reading)
    with pytest.raises(UsageError, match="it takes more memory than there is"):
        read(tmp_path)


def test_what_the_system_refuses_says_nothing_of_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def reading(*_: Any, **__: Any) -> None:
        raise pa.ArrowException("Unknown error: Failed to launch worker thread")

    monkeypatch.setattr(pq.ParquetFile, "read", reading)
    with pytest.raises(UsageError, match=r"t\.parquet: unknown error: failed to launch worker"):
        read(tmp_path)


def test_a_column_twice(tmp_path: Path) -> None:
    table = pa.table(COLUMNS)
    pq.write_table(table.append_column("n_stable", table["n_stable"]), tmp_path / "t.parquet")
    with pytest.raises(UsageError, match="expected each column once, found n_stable again"):
        read_designs(tmp_path / "t.parquet")


@pytest.mark.parametrize("depth", [8, 200, 990, 100_000])
@pytest.mark.parametrize("level", ['{"a": ', "["])
def test_facts_that_are_nested_deeply(tmp_path: Path, level: str, depth: int) -> None:
    end = "]" if level == "[" else "}"
    (tmp_path / "run.json").write_text('{"rows": ' + level * depth + "1" + end * depth + "}")
    with pytest.raises(UsageError, match=r"run\.json"):
        read_record(tmp_path / "run.json")
