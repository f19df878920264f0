"""`report`: a design space on one page."""

from collections.abc import Callable
from pathlib import Path

from dpgcli.api.arguments import check_flags, path_of
from dpgcli.errors import Field, UsageError
from dpgcli.files.access import writing
from dpgcli.files.content import opened
from dpgcli.files.output import Mark, is_own, whole_file
from dpgcli.files.table_reader import read_designs
from dpgcli.files.table_writer import read_metadata
from dpgcli.reports.page import html, markdown
from dpgcli.reports.space import DesignSpace
from dpgcli.reports.summary import STATUSES, ranked_metrics
from dpgcli.studies.sweep import DESIGNS, REPORT
from dpgcli.sweeps.gate import check_beyond_doubt
from dpgcli.text import quoted

PAGES = (".md", ".html")
MOST_NAMED = 3  # statuses that are none
AT_END = "<!-- written by dpg -->"

Say = Callable[[str], None]


def silent(_: str) -> None:
    """Say nothing."""


def report(folder: str | Path, *, format: str = "md", strict: bool = False) -> str:
    """Summarize the design space in a sweep's folder: what is best, what failed and why.

    A page of Markdown ("md"), or of HTML to explore the designs in, which needs no other file
    ("html"). It says what each output rests on. Raises UsageError for another format, or where the
    folder has no table of designs; where it is `strict`, also if a ranking is by what no design
    should be judged by.

    >>> report("nowhere")
    Traceback (most recent call last):
        ...
    dpgcli.errors.UsageError: cannot read nowhere/designs.parquet: No such file or directory
    """
    check_flags(strict=strict)
    if not isinstance(format, str) or f".{format}" not in PAGES:
        raise UsageError(Field("format"), f" {quoted(format)}: expected md or html")
    return page(path_of("folder", folder), f".{format}", strict=strict)[1]


def page(folder: Path, kind: str, *, strict: bool = False) -> tuple[DesignSpace, str]:
    """The design space in a folder, and its page: the same for the same table."""
    space = space_in(folder)
    if strict:
        _check_ranking(space)
    if kind == ".md":
        return space, markdown(space)
    from dpgcli.api.explorer import explored

    return space, html(space, explored(folder, space))


def space_in(folder: Path) -> DesignSpace:
    """The design space in a folder."""
    table = read_designs(folder / DESIGNS)
    if unknown := sorted({str(status) for status in table.columns["status"]} - {*STATUSES}):
        found = ", ".join(map(quoted, unknown[:MOST_NAMED]))
        raise UsageError(
            f"{folder / DESIGNS}: status: expected {', '.join(STATUSES)}, found {found}"
        )
    return DesignSpace(table.columns, table.units, read_metadata(folder / DESIGNS), table.trusts)


def _check_ranking(space: DesignSpace) -> None:
    """Raise UsageError for a ranking by what no design should be judged by."""
    if len(space.usable):  # else nothing is ranked
        check_beyond_doubt(space.trusts, ranked=ranked_metrics(space))


def summarize(folder: Path, *, is_new: bool, strict: bool = False) -> tuple[DesignSpace, str]:
    """The designs of a finished sweep and their page, written into its folder if need be.

    Where it is `strict`, raises UsageError as `report` does, with the page in its place.
    """
    space, text = page(folder, ".md")
    path = folder / REPORT
    with writing(path):
        is_there = path.exists()
    if is_new or not is_there or _is_outdated(path, text):
        write_page(path, text)
    if strict:
        _check_ranking(space)
    return space, text


def write_page(path: Path, text: str) -> None:
    """Write a page, at its end the mark by which `dpg` knows it."""
    with whole_file(path, Mark.REPORT) as temporary:
        temporary.write_bytes(_bytes(text))


def _is_outdated(path: Path, text: str) -> bool:
    """Whether a report of `dpg` says anything else, as that of tables before these."""
    content = _bytes(text)
    try:
        with opened(path) as stream:
            return stream.read(len(content) + 1) != content and is_own(path, Mark.REPORT)
    except OSError:  # whatever that is, it is no report
        return False


def _bytes(text: str) -> bytes:
    return f"{text}\n{AT_END}\n".encode(errors="backslashreplace")
