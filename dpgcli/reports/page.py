"""A design space on one page, as Markdown or as HTML that needs no other file."""

import re
from collections.abc import Iterator, Sequence

from dpgcli.reports.explorer import explorer, policy, style
from dpgcli.reports.explorer.content import Explored, shown_rows
from dpgcli.reports.explorer.drawings import best_designs
from dpgcli.reports.space import DesignSpace
from dpgcli.reports.summary import (
    MOST_ROWS,
    PageSection,
    PageTable,
    sections,
    shortened,
)
from dpgcli.sweeps.gate import RequirementVerdict
from dpgcli.text import printable

# what would be markup: an underscore inside a word is not, nor is & alone
MARKDOWN_SPECIALS = re.compile(r"([\\`*|<>\[\]]|(?<![^\W_])_|_(?![^\W_])|&(?=#?\w+;))")
TAGS = {  # a table that is too wide is scrolled alone; a head is told to be one of a column
    "<table>": "<div><table>",
    "</table>": "</table></div>",
    "<th>": '<th scope="col">',
}


def markdown(space: DesignSpace) -> str:
    """A design space as GitHub-flavored Markdown."""
    return _markdown(sections(space.narrowed))


def html(space: DesignSpace, explored: Explored | None = None) -> str:
    """A page of HTML that needs no other file, with figures if Matplotlib is there.

    The best designs come first and the explorer, where there is anything to explore, then the same
    as in Markdown, and the figures.
    """
    from dpgcli.reports.maps import figures

    space = space.narrowed
    head, *tables = _html(_markdown(sections(space))).split("<h2>")
    drawn = f"Figures</h2>\n{figures(space)}\n"
    body = "<h2>".join((head, *_explorer(space, explored), *tables[:1], drawn, *tables[1:]))
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{policy()}">\n'
        '<meta name="viewport" content="width=device-width">\n<title>Design space</title>\n'
        f"<style>{style()}</style>\n</head>\n<body>\n{body}</body>\n</html>\n"
    )


def _explorer(space: DesignSpace, explored: Explored | None) -> Iterator[str]:
    if not len(space):
        return
    shown = explored or Explored(shown_rows(space))
    if best := best_designs(space, shown.best, shown.rows.tolist()):
        yield f"The best designs</h2>\n{best}"
    yield f"Explorer</h2>\n{explorer(space, shown)}"


def verdicts_markdown(verdicts: Sequence[RequirementVerdict]) -> str:
    """Verdicts on requirements as Markdown, with the first designs that fail each."""
    lines: list[str | PageTable] = []
    for verdict in verdicts:
        lines.append(str(verdict))
        lines += [f"Warning: {warning}." for warning in verdict.warnings]
        if not verdict.is_met:
            failures = [[str(failure)] for failure in verdict.failures(MOST_ROWS)]
            lines += shortened(PageTable(("first that fail",), failures), len(verdict.rows))
    return _markdown([PageSection("Requirements", lines)])


def _markdown(shown: Sequence[PageSection]) -> str:
    parts = []
    for place, section in enumerate(shown):
        parts.append(f"{'##' if place else '#'} {section.title}")
        parts += [
            _escaped(block) if isinstance(block, str) else _markdown_table(block)
            for block in section.blocks
        ]
    return "\n\n".join(parts) + "\n"


def _markdown_table(table: PageTable) -> str:
    rows = [table.head, ["---"] * len(table.head), *table.rows]
    lines = [" | ".join(c if c == "---" else _escaped(c) for c in row) for row in rows]
    return "\n".join(f"| {line} |" for line in lines)


def _escaped(text: str) -> str:
    return MARKDOWN_SPECIALS.sub(r"\\\1", printable(" ".join(text.split())))


def _html(text: str) -> str:
    """Markdown as HTML; whatever looks like a tag in the text is none in the page."""
    from markdown_it import MarkdownIt

    page: str = MarkdownIt("commonmark", {"html": False}).enable("table").render(text)
    for tag, instead in TAGS.items():
        page = page.replace(tag, instead)
    return page
