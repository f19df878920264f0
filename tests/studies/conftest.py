"""Small studies in a folder of their own."""

from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest

from dpgcli.files.sweep_file import read_sweep
from dpgcli.studies import sweep as studies
from dpgcli.studies.sweep import Study
from dpgcli.sweeps.executors import serial

CONFIGS = Path(__file__).parents[2] / "configs"
Make = Callable[..., Study]
Tables = Callable[[Study], "tuple[pd.DataFrame, pd.DataFrame]"]


@pytest.fixture
def study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Make:
    """A study of some axes around a spec, in small chunks."""
    monkeypatch.setattr(studies, "STATES_PER_CHUNK", 64)

    def made(*axes: str, base: str = "three_unit", rules: str = "[]", folder: str = "out") -> Study:
        lines = [f"base: {CONFIGS / base}.yaml", "space:", *(f"  - {axis}" for axis in axes)]
        path = tmp_path / f"{folder}.yaml"
        path.write_text("\n".join([*lines, f"constraints: {rules}", ""]), encoding="utf-8")
        return Study(read_sweep(path), tmp_path / folder)

    return made


@pytest.fixture
def tables() -> Tables:
    """Compute a study here and read its states and designs."""

    def computed(study: Study) -> tuple[pd.DataFrame, pd.DataFrame]:
        study.compute(serial(), lambda _: None)
        study.assemble()
        states, designs = (
            pd.read_parquet(study.folder / name) for name in (studies.STATES, studies.DESIGNS)
        )
        return states, designs

    return computed
