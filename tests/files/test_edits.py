"""Specs that people edited are told from those that are as they were written."""

from pathlib import Path

import pytest

from dpgcli.files.edits import is_edited, sealed

WRITTEN = sealed("# dpg design 7", "finger:\n  units: 3\n")


def test_what_is_as_it_was_written_is_not_edited(tmp_path: Path) -> None:
    path = tmp_path / "spec.yaml"
    for text in (WRITTEN, ""):
        path.write_text(text, encoding="utf-8")
        assert not is_edited(path)


@pytest.mark.parametrize("line", range(4))
@pytest.mark.parametrize("note", ["{} # leaks", "# leaks {}", "# leaks\n{}", ""])
def test_a_note_in_any_line_is_an_edit(tmp_path: Path, line: int, note: str) -> None:
    lines = WRITTEN.splitlines()
    lines[line] = note.format(lines[line])
    path = tmp_path / "spec.yaml"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    assert is_edited(path)
