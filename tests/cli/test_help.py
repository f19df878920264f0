"""`dpg help`: the manual in the terminal."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

import dpgcli
from dpgcli.cli.help import TOPICS
from dpgcli.cli.main import app

MANUAL = Path(dpgcli.__file__).parent / "manual"
run = CliRunner().invoke


def test_every_page_is_a_topic() -> None:
    assert sorted(TOPICS) == sorted(path.stem for path in MANUAL.glob("*.md"))


def test_topics_are_listed_on_a_line_each() -> None:
    lines = run(app, ["help"]).stdout.splitlines()
    assert [line.split()[0] for line in lines[: len(TOPICS)]] == list(TOPICS)
    assert all(len(line) <= 80 for line in lines)


@pytest.mark.parametrize("topic", TOPICS)
def test_a_page_begins_with_what_the_list_says(topic: str) -> None:
    title, empty, sentence, after = run(app, ["help", topic]).stdout.splitlines()[:4]
    assert title.startswith("# ")
    assert sentence.endswith(".")
    assert sentence in run(app, ["help"]).stdout
    assert (empty, after) == ("", "")


@pytest.mark.parametrize("topic", TOPICS)
def test_a_pipe_gets_the_page_as_it_is(topic: str) -> None:
    assert run(app, ["help", topic]).stdout == (MANUAL / f"{topic}.md").read_text("utf-8")


@pytest.mark.parametrize(
    ("word", "meant"),
    [
        ("sweep", "a command: dpg sweep --help"),
        ("predict", "a command: dpg predict --help"),
        ("swepes", "did you mean sweeps?"),
        ("LAWS", "did you mean laws?"),
        ("calibrate", "did you mean calibration?"),
        ("zzz", "there are tutorial, spec, columns"),
    ],
)
def test_an_unknown_topic_names_the_nearest(word: str, meant: str) -> None:
    result = run(app, ["help", word])
    assert result.exit_code == 2
    assert result.stdout == ""
    assert f"expected a page of the manual, found {word} (" in result.stderr
    assert meant in result.stderr
