"""`dpg.landscape`: values in, values out, errors that name arguments."""

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from typer.testing import CliRunner

import dpgcli as dpg
from dpgcli.cli.main import app
from dpgcli.mechanics.finger import STUDY, uniform_finger


def test_values_data_and_paths_are_specs(folder: Path, study: dict[str, Any]) -> None:
    ways = [
        dpg.landscape(spec, start="000", end="011", via="001").to_pandas()
        for spec in ("study.yaml", Path("study.yaml"), study)
    ]
    assert ways[0].equals(ways[1])
    assert ways[0].equals(ways[2])
    assert ways[0]["pattern"].tolist() == ["000", "00?", "001", "0?1", "011"]
    finger = uniform_finger(3, **STUDY, linear_stiffness=1e4)
    found = dpg.landscape(finger, start="000", end="011", via=["001"])
    assert found.table["energy_mJ"] == pytest.approx(ways[0]["energy_mJ"], rel=1e-9, abs=1e-9)


def test_the_result_has_units_ties_and_the_way(folder: Path) -> None:
    found = dpg.landscape("study.yaml", start="000", end="111")
    assert found.n_ways == 6
    assert found.table.units["barrier_mJ"] == "mJ"
    np.testing.assert_allclose(found.landscape.barrier, 6.038224, atol=1e-6)
    assert found.to_arrow().num_rows == 7
    assert "6 paths are as good" in "\n".join(found.summary)


def test_files_are_those_of_the_command(folder: Path) -> None:
    found = dpg.landscape("study.yaml", start="000", end="111")
    found.save("python.parquet")
    found.draw("python.svg")
    way = ("landscape", "study.yaml", "--from", "000", "--to", "111", "-q")
    CliRunner().invoke(app, [*way, "-o", "command.parquet", "--plot", "command.svg"])
    for kind in ("parquet", "svg"):
        own, other = (Path(f"{name}.{kind}").read_bytes() for name in ("python", "command"))
        assert own == other
    assert pq.read_table("python.parquet").num_rows == 7


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"start": "00", "end": "111"}, "start 00: expected 3 digits"),
        ({"start": "000", "end": "112"}, "end 112: expected 3 digits"),
        ({"start": "000", "end": "111", "via": ("0",)}, "via 0: expected 3 digits"),
        ({"start": 0, "end": "111"}, "start"),
        ({"start": "000", "end": "111", "settings": {"finger.units": 13}}, "13 units"),
    ],
)
def test_wrong_arguments_are_named(folder: Path, arguments: Any, words: str) -> None:
    with pytest.raises(dpg.UsageError, match=words):
        dpg.landscape("study.yaml", **arguments)


def test_a_table_goes_nowhere_else(folder: Path) -> None:
    found = dpg.landscape("study.yaml", start="000", end="001")
    for name in ("study.yaml", "way.csv"):
        with pytest.raises((dpg.UsageError, dpg.OutputError)):
            found.save(name)
    with pytest.raises(dpg.UsageError):
        found.draw("way.pdf")


def test_barriers_from_python(folder: Path) -> None:
    states = dpg.predict("study.yaml", columns="barriers").to_pandas()
    assert states["least_robust_unit"].tolist()[:2] == ["1,2,3", "3"]
    assert states["barrier_1_mJ"][0] == pytest.approx(6.0382, abs=1e-4)
