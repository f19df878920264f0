"""Ctrl-C, SIGTERM and a closed terminal, at any time: no broken file, a plain message."""

import resource
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from dpgcli.cli.exits import ExitCode

SIGNALS = [
    (signal.SIGINT, ExitCode.INTERRUPTED, "interrupted"),
    (signal.SIGTERM, ExitCode.TERMINATED, "terminated"),
]
SIGINT, SIGTERM = SIGNALS
SLOW = pytest.mark.slow
WRITING = ("predict", "twenty_unit.yaml", "-o", "states.parquet")


def wait_until(happened: Callable[[], bool], process: "subprocess.Popen[bytes]") -> None:
    end = time.monotonic() + 30
    while not happened():
        assert process.poll() is None, "ended too early"
        assert time.monotonic() < end
        time.sleep(0.002)


def is_writing(folder: Path) -> Callable[[], bool]:
    """Whether the table is being written; the trial before the work stays empty."""

    def happened() -> bool:
        sizes = []
        for path in folder.glob(".states.parquet.*.tmp"):
            try:
                sizes.append(path.stat().st_size)
            except FileNotFoundError:
                continue
        return any(sizes)

    return happened


@pytest.mark.parametrize(
    ("number", "code", "word"), [*SIGNALS, (signal.SIGHUP, ExitCode.TERMINATED, "terminated")]
)
@pytest.mark.parametrize("is_ignored", [False, True], ids=["", "ignored"])
def test_a_signal_while_the_program_is_still_loading(
    tmp_path: Path, number: signal.Signals, code: int, word: str, is_ignored: bool
) -> None:
    program = """
import os, signal, sys
class Interrupting:
    def find_spec(self, name, path=None, target=None):
        if name == "typer":
            os.kill(os.getpid(), NUMBER)
sys.meta_path.insert(0, Interrupting())
if IGNORED:
    signal.signal(NUMBER, signal.SIG_IGN)
from dpgcli.__main__ import main
sys.argv[1:] = ["--version"]
main()
""".replace("NUMBER", str(int(number))).replace("IGNORED", str(is_ignored))
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    said = f"dpg: {word}; nothing half-written is left\n"
    assert (done.returncode, done.stderr) == ((0, "") if is_ignored else (code, said))


CONVERTING = """
try:
    os.kill(os.getpid(), signal.{name})
    sum(map(abs, range(99)))
except BaseException as error:
    raise ImportError("failed to import") from error
"""
CONVERTING_LATER = """
def convert():
    try:
        os.kill(os.getpid(), signal.{name})
        sum(map(abs, range(99)))
    except BaseException as error:
        raise ValueError("building a validator: KeyboardInterrupt") from None
"""
DESTROYED = """
class Last:
    def __del__(self):
        os.kill(os.getpid(), signal.{name})
        sum(map(abs, range(99)))
last = [Last()]
"""


@pytest.mark.parametrize(
    "place",
    [CONVERTING, CONVERTING_LATER, DESTROYED],
    ids=["import", "extension", "destructor"],
)
@pytest.mark.parametrize(("number", "code", "word"), SIGNALS)
def test_an_interrupt_where_others_would_catch_it(
    tmp_path: Path, place: str, number: signal.Signals, code: int, word: str
) -> None:
    """As extension modules do that start, and Python itself where nothing can be raised."""
    (tmp_path / "odd.py").write_text("import os, signal\n" + place.format(name=number.name))
    program = """
import time, typer
from dpgcli.cli.exits import command, run_and_exit
app = typer.Typer()
@app.command()
@command
def work():
    import odd
    getattr(odd, "convert", int)()
    getattr(odd, "last", []).clear()
    time.sleep(20)
    print("went on")
run_and_exit(app)
"""
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout) == (code, "")
    assert done.stderr == f"dpg: {word}; nothing half-written is left\n"


@pytest.mark.slow
@pytest.mark.parametrize(("number", "code", "word"), [SIGTERM, pytest.param(*SIGINT, marks=SLOW)])
def test_an_interrupt_while_nobody_reads(
    start: Any, number: signal.Signals, code: int, word: str
) -> None:
    """A reader that is there and never reads keeps nobody from ending."""
    process = start("predict", "twenty_unit.yaml", "--format", "csv")
    with select.epoll() as poll:
        poll.register(process.stdout, select.EPOLLIN)
        assert poll.poll(30)
    time.sleep(0.5)  # until the pipe is full
    process.send_signal(number)
    assert process.wait(10) == code
    assert process.stderr.read().decode() == f"dpg: {word}; nothing half-written is left\n"


@pytest.mark.parametrize(("number", "code", "word"), [SIGINT, pytest.param(*SIGTERM, marks=SLOW)])
def test_an_interrupt_while_writing_leaves_nothing(
    start: Any, folder: Path, number: int, code: int, word: str
) -> None:
    process = start(*WRITING)
    wait_until(is_writing(folder), process)
    process.send_signal(number)
    _, errors = process.communicate(timeout=30)
    assert process.returncode == code
    assert errors.decode().splitlines() == [f"dpg: {word}; nothing half-written is left"]
    assert not list(folder.glob("*states*")) + list(folder.glob(".states*"))


@pytest.mark.slow
@pytest.mark.parametrize(("number", "code", "word"), [SIGTERM, pytest.param(*SIGINT, marks=SLOW)])
def test_an_interrupt_leaves_the_old_table_as_it_was(
    start: Any, folder: Path, number: int, code: int, word: str
) -> None:
    old = b"PAR1 a table, dpg.file_sha256\x18@ of it"
    (folder / "states.parquet").write_bytes(old)
    process = start(*WRITING)
    wait_until(is_writing(folder), process)
    process.send_signal(number)
    process.communicate(timeout=30)
    assert process.returncode == code
    assert (folder / "states.parquet").read_bytes() == old
    assert not list(folder.glob(".states*"))


@pytest.mark.slow
def test_a_closed_terminal_leaves_nothing(start: Any, folder: Path) -> None:
    process = start(*WRITING)
    wait_until(is_writing(folder), process)
    process.send_signal(signal.SIGHUP)
    process.communicate(timeout=30)
    assert process.returncode != 0
    assert not list(folder.glob(".states*"))


@pytest.mark.slow
@pytest.mark.parametrize("form", ["json", pytest.param("csv", marks=pytest.mark.slow)])
def test_an_interrupt_while_printing(start: Any, form: str) -> None:
    process = start("predict", "twenty_unit.yaml", "--format", form)
    assert process.stdout.readline()
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=30)
    assert process.returncode == ExitCode.INTERRUPTED
    assert b"dpg: interrupted" in errors
    assert b"Traceback" not in errors


def limited(n_bytes: int) -> Callable[[], None]:
    """Files of the child end at so many bytes, as on a full disk."""
    return lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (n_bytes, n_bytes))


@pytest.mark.parametrize(
    ("arguments", "name", "n_bytes"),
    [
        (("predict", "-q", "twenty_unit.yaml", "-o", "states.parquet"), "states.parquet", 100_000),
        (("predict", "-q", "three_unit.yaml", "-o", "states.parquet"), "states.parquet", 0),
        (("predict", "-q", "three_unit.yaml", "-o", "states.parquet"), "states.parquet", 1000),
        (("predict", "-q", "three_unit.yaml", "--plot", "states.svg"), "states.svg", 2000),
        (("init", "--force", "states.yaml"), "states.yaml", 1000),
    ],
)
def test_a_full_disk_leaves_the_old_file_and_nothing_else(
    run: Any, folder: Path, arguments: tuple[str, ...], name: str, n_bytes: int
) -> None:
    (folder / name).write_bytes(b"old")
    result = run(*arguments, preexec_fn=limited(n_bytes))
    assert result.returncode == ExitCode.USAGE
    assert result.stderr.startswith(f"dpg: cannot write {name}: ")
    assert "Traceback" not in result.stderr
    assert (folder / name).read_bytes() == b"old"
    assert [p.name for p in folder.glob("*states*")] == [name]
    assert not list(folder.glob(".states*"))


def test_ctrl_c_while_typer_is_at_work_is_said() -> None:
    """It makes an exit code of the interrupt, without a word."""
    program = (
        "import os, signal, typer; from dpgcli.cli.exits import run_and_exit; app = typer.Typer(); "
        "app.command()(lambda: os.kill(os.getpid(), signal.SIGINT)); run_and_exit(app)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert (done.returncode, done.stderr.split(";")[0]) == (130, "dpg: interrupted")
