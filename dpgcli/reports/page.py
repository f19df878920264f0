"""A design space on one page, as Markdown or as HTML that needs no other file."""

import re
from collections.abc import Sequence

from dpgcli.reports.summary import (
    MOST_ROWS,
    DesignSpace,
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
STYLE = """
:root { color-scheme: light dark; --text: #1a1a1a; --page: #fff; --line: #ccc; }
@media (prefers-color-scheme: dark) { :root { --text: #e6e6e6; --page: #16181c; --line: #444; } }
body { font: 16px/1.5 system-ui, sans-serif; color: var(--text); background: var(--page);
  max-width: 75rem; margin: 2rem auto; padding: 0 1rem; }
div { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: 0.9rem; }
th, td { text-align: left; padding: 0.25rem 0.75rem; border-bottom: 1px solid var(--line); }
figure { margin: 1rem 0; padding: 0.5rem; background: #fff; }
svg { max-width: 100%; height: auto; }
"""


def markdown(space: DesignSpace) -> str:
    """A design space as GitHub-flavored Markdown."""
    return _markdown(sections(space))


def html(space: DesignSpace) -> str:
    """The same as a page of HTML that needs no other file, with figures if Matplotlib is there.

    The best designs come first, then the figures.
    """
    from dpgcli.reports.maps import figures

    parts = _html(_markdown(sections(space))).split("<h2>", 2)
    body = "<h2>".join((*parts[:2], f"Figures</h2>\n{figures(space)}\n", *parts[2:]))
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width">\n<title>Design space</title>\n'
        f"<style>{STYLE}</style>\n</head>\n<body>\n{body}</body>\n</html>\n"
    )


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
