"""Goals around the study's fingers."""

from collections.abc import Callable
from pathlib import Path

import pytest

from dpgcli.files.goal_file import goal_in
from dpgcli.files.yaml_file import parse_document
from dpgcli.search.goal import Goal

CONFIGS = Path(__file__).parents[2] / "configs"
Make = Callable[..., Goal]


@pytest.fixture
def goal() -> Make:
    """A goal of these lines around a spec in configs; settings change the spec."""

    def made(lines: str, *settings: str, base: str = "five_unit") -> Goal:
        document = parse_document("goal.yaml", f"base: {base}.yaml\n{lines}")
        return goal_in(document, CONFIGS, settings).goal

    return made
