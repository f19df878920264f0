"""Dependency files: what `make` itself makes of names with every special character."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

from dpgcli.cli.depfile import Depfile, depfile_text
from dpgcli.errors import UsageError
from dpgcli.files.sweep_file import read_sweep

CONFIGS = Path(__file__).parents[2] / "configs"
SPECIALS = "#$%:*?[]~!@^+-,'\"`<>{}()& é."
NAMES = [
    *(f"a{character}b.csv" for character in SPECIALS),
    *(f"{character}b.csv" for character in SPECIALS if character != "~"),
    *(f"a{character}" for character in SPECIALS if character not in " &"),
    "a  b c.csv",
    *(f"a{character}b%c.csv" for character in SPECIALS if character not in "*?["),
    "a: b#c$d*e?f[g].csv",
    "a(b).csv",
    "define x.csv",
    "include",
    ".designs.csv",
    "a\udcff.csv",  # a byte that is no UTF-8
]
UNFIT = {
    "a\nb:;touch pwned": r'"\n"',
    "a\tb": r'"\t"',
    "a\rb": r'"\r"',
    "a\x1bb": r'"\u001b"',
    "a\x85b": r'"\x85"',
    "a=b.csv": '"="',
    "a;b.csv": '";"',
    "a|b.csv": '"|"',
    "a\\b.csv": r'"\\"',
    "~root": '"~"',
    "~": '"~"',
    "-lm": '"-l"',
    ".IGNORE": '".IGNORE"',
    ".DELETE_ON_ERROR": '".DELETE_ON_ERROR"',
    "a(b)": '"(b)"',
    "$(shell touch pwned)": '"(shell touch pwned)"',
    "a ": '" "',
    "a&": '"&"',
    "a%b*c": '"%b*"',
    "a?b%c": '"?b%"',
    "a[b]%": '"[b]%"',
}
OLD, CHANGED, NEW = 1_000_000_000, 1_500_000_000, 1_400_000_000  # seconds
needs_make = pytest.mark.skipif(shutil.which("make") is None, reason="needs make")


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def depend(folder: str, *files: str) -> None:
    """A depfile of tables in a folder, made from these files."""
    text = depfile_text(folder, ("states.parquet", "designs.parquet"), map(Path, files))
    Path(folder).mkdir(parents=True, exist_ok=True)
    Depfile(Path("sweep.d"), text).beside(lambda work: bool(work() or True), lambda: None)


def make() -> str:
    """What Make does about the first target of the depfile."""
    rules = Path("sweep.d").read_bytes().split(b"\n", 1)[1]
    targets = rules.split(b".parquet", 1)[0] + b".parquet"
    rule = b"all: " + targets.replace(rb"\%", b"%") + b"\n\n" + targets + b":\n\t@echo again\n\n"
    Path("Makefile").write_bytes(rule + b"include sweep.d\n")
    done = subprocess.run(
        ["make", "--no-print-directory"],
        env={"PATH": os.environ["PATH"], "LC_ALL": "C"},
        capture_output=True,
        text=True,
        check=False,
    )
    return done.stdout + done.stderr


def aged(path: Path, seconds: float) -> None:
    os.utime(path, (seconds, seconds))


@needs_make
@pytest.mark.parametrize("name", NAMES, ids=ascii)
def test_make_reads_the_name_of_a_file_that_is_read(here: Path, name: str) -> None:
    (here / name).touch()
    (here / "other.csv").touch()
    depend("out", "other.csv", name)
    (here / "out" / "states.parquet").touch()
    for each, seconds in ((name, OLD), ("other.csv", OLD), ("out/states.parquet", NEW)):
        aged(here / each, seconds)
    assert make() == "make: Nothing to be done for 'all'.\n"
    aged(here / name, CHANGED)
    assert make() == "again\n"
    (here / name).unlink()
    assert make() == "again\n"


@needs_make
@pytest.mark.parametrize("name", NAMES, ids=ascii)
def test_make_reads_the_name_of_the_folder(here: Path, name: str) -> None:
    (here / "read.csv").touch()
    depend(name, "read.csv")
    assert make() == "again\n"
    table = here / name / "states.parquet"
    table.touch()
    aged(here / "read.csv", OLD)
    assert make() == "make: Nothing to be done for 'all'.\n"
    aged(table, OLD - 1.0)
    assert make() == "again\n"


@needs_make
@pytest.mark.parametrize(
    "folder", ["g", "g/", "g//h", "./g", ".//g", "g/.", "a/../g", "linked/../g", "{}/../{}/g", "."]
)
def test_make_knows_the_tables_as_its_rule_spells_them(here: Path, folder: str) -> None:
    (here / "a").mkdir()
    (here / "b").mkdir()
    (here / "linked").symlink_to(here / "b")
    (here / "read.csv").touch()
    folder = folder.format(here, here.name)
    depend(folder, "read.csv")
    rule = f"OUT := {folder}\n$(OUT)/states.parquet:\n\t@echo again\n\ninclude sweep.d\n"
    Path("Makefile").write_text(rule, encoding="utf-8")
    table = Path(folder) / "states.parquet"
    table.touch()
    aged(here / "read.csv", OLD)
    command = ["make", "--no-print-directory", f"{folder}/states.parquet"]
    assert b"up to date" in subprocess.run(command, capture_output=True, check=True).stdout
    aged(table, OLD - 1.0)
    assert subprocess.run(command, capture_output=True, check=True).stdout == b"again\n"


@needs_make
def test_what_leads_back_from_a_linked_folder_is_named_as_it_is(here: Path) -> None:
    """What the kernel reads lies beside the folder that is linked to."""
    (here / "elsewhere" / "sweeps").mkdir(parents=True)
    (here / "sweeps").symlink_to(here / "elsewhere" / "sweeps")
    for name in ("elsewhere/three_unit.yaml", "three_unit.yaml"):
        (here / name).touch()
        aged(here / name, OLD)
    depend("out", "sweeps/../three_unit.yaml", "elsewhere/sweeps/../three_unit.yaml")
    (here / "out" / "states.parquet").touch()
    aged(here / "out" / "states.parquet", NEW)
    first = Path("sweep.d").read_text(encoding="utf-8").splitlines()[1].split(": ")[1]
    assert first == "sweeps/../three_unit.yaml elsewhere/three_unit.yaml"
    aged(here / "three_unit.yaml", CHANGED)
    assert make() == "make: Nothing to be done for 'all'.\n"
    aged(here / "elsewhere" / "three_unit.yaml", CHANGED)
    assert make() == "again\n"


@pytest.mark.parametrize("folder", ["./~root", ".//-lm", "./"])
def test_what_make_drops_from_a_name_hides_nothing(here: Path, folder: str) -> None:
    names = ("a",) if folder != "./" else (".IGNORE",)
    with pytest.raises(UsageError, match="Make cannot take"):
        depfile_text(folder, names, ())


@pytest.mark.parametrize("name", UNFIT, ids=ascii)
def test_what_make_cannot_take_is_named(here: Path, name: str) -> None:
    with pytest.raises(UsageError) as raised:
        depend("out", "other.csv", name)
    assert str(raised.value).startswith(f"--depfile: Make cannot take {UNFIT[name]} in the name")
    assert not list(here.iterdir())


@needs_make
@pytest.mark.parametrize(
    "character", [c for c in map(chr, range(1, 128)) if not c.isalnum() and c != "/"]
)
def test_every_character_is_spelled_or_refused(here: Path, character: str) -> None:
    """Wherever it stands, and nothing is ever run by it."""
    for name in (f"a{character}touch pwned", f"{character}touch pwned", f"touch pwned{character}"):
        (here / "out").mkdir(exist_ok=True)
        (here / "out" / "states.parquet").touch()
        (here / name).touch()
        aged(here / name, OLD)
        try:
            depend("out", name)
        except UsageError:
            continue
        assert make() == "make: Nothing to be done for 'all'.\n", name
        (here / name).unlink()
        assert make() == "again\n", name
        assert not (here / "pwned").exists()


def test_a_name_with_a_control_character_is_refused_in_a_sweep(here: Path) -> None:
    name = "\n.DEFAULT_GOAL:=x\nx:;touch\tpwned\nz:=1"
    (here / name).write_text("finger.units\n3\n", encoding="utf-8")
    (here / "base.yaml").write_bytes((CONFIGS / "three_unit.yaml").read_bytes())
    table = name.replace("\n", "\\n").replace("\t", "\\t")
    said = f'base: base.yaml\nspace: [{{table: "{table}"}}]\n'
    (here / "sweep.yaml").write_text(said, encoding="utf-8")
    with pytest.raises(Exception, match=r"table: expected .*, found .n in it"):
        read_sweep(here / "sweep.yaml")


@needs_make
@pytest.mark.parametrize(
    "name", ["finger", "f`touch pwned`", "f$(touch pwned)", "f.o", "f'; touch pwned'"]
)
def test_make_s_own_rules_remake_nothing_that_was_read(here: Path, name: str) -> None:
    """They write `finger` from `finger.sh` or RCS, and run what stands in the names."""
    try:
        depend("out", name)
    except UsageError:
        return
    (here / name).write_text("finger: {}\n", encoding="utf-8")
    (here / "RCS").mkdir()
    for source in (f"{name}.sh", f"{name}.c", f"{Path(name).stem}.c", f"{name},v", f"RCS/{name},v"):
        (here / source).write_text("other words\n", encoding="utf-8")
    (here / "out" / "states.parquet").touch()
    aged(here / name, OLD)
    aged(here / "out" / "states.parquet", NEW)
    assert make() == "make: Nothing to be done for 'all'.\n"
    (here / name).unlink()
    assert make() == "again\n"
    assert not (here / name).exists()
    assert not (here / "pwned").exists()


@needs_make
@pytest.mark.parametrize("rule", ["dome.yaml: dome.csv", "%.yaml: %.csv"])
@pytest.mark.parametrize("is_first", [False, True])
def test_a_rule_that_makes_what_was_read_stays_one(here: Path, rule: str, is_first: bool) -> None:
    """A calibration that is fitted again when its data change, and then swept again."""
    depend("out", "dome.yaml")
    for name, seconds in (("dome.csv", OLD), ("dome.yaml", OLD), ("out/states.parquet", NEW)):
        (here / name).touch()
        aged(here / name, seconds)
    first, last = ("include sweep.d\n", "") if is_first else ("", "include sweep.d\n")
    rules = f"out/states.parquet:\n\t@echo swept; touch $@\n\n{rule}\n\t@echo fitted; touch $@\n"
    Path("Makefile").write_text(f"all: out/states.parquet\n\n{first}{rules}{last}")
    command = ["make", "--no-print-directory"]
    assert b"Nothing" in subprocess.run(command, capture_output=True, check=True).stdout
    aged(here / "dome.csv", CHANGED)
    done = subprocess.run(command, capture_output=True, check=True)
    assert (done.stdout, done.stderr) == (b"fitted\nswept\n", b"")


PARENTHESES = [
    *(
        (names, True)
        for names in ("a(b c)", "a( b)", "a(b x c)", "a(b)c d)", "a(b.csv (c)", "./a(b c)")
    ),
    *(
        (names, False)
        for names in ("(a b)", "c) a(b", "a(b.csv c)d", "ab d)", "(x)y d)", "./(a b)")
    ),
]


@needs_make
@pytest.mark.parametrize(("names", "is_archive"), PARENTHESES)
def test_names_that_make_takes_for_members_of_an_archive(
    here: Path, names: str, is_archive: bool
) -> None:
    """A parenthesis in one name and one that closes it at the end of a later one."""
    files = names.split()
    if is_archive:
        with pytest.raises(UsageError, match=r"Make cannot take the names \S*a\("):
            depend("out", *files)
        return
    for name in files:
        (here / name).touch()
        aged(here / name, OLD)
    depend("out", *files)
    (here / "out" / "states.parquet").touch()
    aged(here / "out" / "states.parquet", NEW)
    assert make() == "make: Nothing to be done for 'all'.\n"
    for name in files:
        aged(here / name, CHANGED)
        assert make() == "again\n"
        aged(here / name, OLD)
