"""`dpg help`: the manual that ships, in the terminal."""

import re
import sys
from difflib import get_close_matches
from importlib.resources import files
from typing import Annotated

import typer

from dpgcli.cli.streams import put
from dpgcli.errors import UsageError

TOPICS = (  # in the order in which one reads them
    *("tutorial", "spec", "columns", "sweeps", "choosing", "designing", "pressure", "loads"),
    *("grasping", "routines", "barriers", "calibration", "laws", "trust", "accuracy", "stress"),
    *("files", "python", "glossary"),
)
LINK_TO_PAGE = re.compile(r"\[([^]]+)\]\((\w+)\.md(#[\w-]+)?\)")


def help(
    topic: Annotated[
        str | None, typer.Argument(metavar="TOPIC", help="A page  [default: list them]")
    ] = None,
) -> None:
    """Show a page of the manual."""
    if topic is None:
        _list_topics()
    else:
        _show(page(topic))


def page(topic: str) -> str:
    """The Markdown of a page.

    >>> page("glossary").splitlines()[0]
    '# Glossary'
    """
    if topic not in TOPICS:
        raise UsageError(f"TOPIC: expected a page of the manual, found {topic} ({_hint(topic)})")
    return (files("dpgcli") / "manual" / f"{topic}.md").read_text(encoding="utf-8")


def _hint(word: str) -> str:
    """What may have been meant."""
    from dpgcli.cli.main import NAMES

    if word in NAMES:
        return f"a command: dpg {word} --help"
    close = get_close_matches(word.lower(), TOPICS, n=1)
    return f"did you mean {close[0]}?" if close else f"there are {', '.join(TOPICS)}"


def _list_topics() -> None:
    for topic in TOPICS:
        put(f"{topic:<12} {page(topic).splitlines()[2]}")  # the first sentence below the title
    put("\ndpg help TOPIC shows a page, dpg COMMAND --help the options of a command")


def _show(text: str) -> None:
    """Rendered on a terminal; its source, which is plain text, where nobody looks at it."""
    if not sys.stdout.isatty():
        sys.stdout.write(text)
        return
    from rich.console import Console
    from rich.markdown import Markdown
    from rich.theme import Theme

    console = Console(theme=Theme({"markdown.code": "bold cyan"}))  # on any background
    named = LINK_TO_PAGE.sub(r"\1 (dpg help \2)", text)
    console.print(Markdown(named, code_theme="ansi_dark", hyperlinks=False))
