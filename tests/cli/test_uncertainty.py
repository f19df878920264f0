"""What is off, said the right way round: the model's error in every summary, tables that fit."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

Call = Callable[..., Any]
CONFIGS = Path(__file__).parents[2] / "configs"
SPECS = sorted([*CONFIGS.glob("*.yaml"), CONFIGS / "calibration" / "three_gap_finger.yaml"])
TOLERANCES = (
    "-s",
    "uncertainty={dome_height_mm: 0.1, elastic_modulus_MPa: 10%}",
    "-s",
    "model_error=5%",
    "--uncertainty",
)
COVERS = "tolerances of dome_height_mm and elastic_modulus_MPa, model error of 5 %"


@pytest.mark.parametrize("more", [(), TOLERANCES], ids=["plain", "uncertain"])
@pytest.mark.parametrize("spec", SPECS, ids=lambda path: path.stem)
def test_a_table_is_at_most_100_characters_wide(call: Call, spec: Path, more: Any) -> None:
    if more and spec.stem == "eight_unit":  # it has no geometry
        more = ("-s", "uncertainty={stroke_mm: 0.1}", "--uncertainty")
    elif more and spec.stem == "three_gap_finger":  # its domes are of a file
        more = ("-s", "uncertainty={stroke_mm: 0.1}", "-s", "model_error=5%", "--uncertainty")
    some = "1" * 18 + "??" if spec.stem == "twenty_unit" else "*11"  # of a million too many
    result = call("predict", str(spec), "--pattern", some, *more)
    assert result.exit_code == 0
    lines = result.stdout.splitlines()
    assert max(map(len, lines)) <= 100
    head = " ".join(lines[: next(i for i, line in enumerate(lines) if "stable" in line)])
    assert not {"residual", "min_eigenvalue"} & {*head.replace("_", " ").split()}
    assert len([line for line in lines if "stable" in line]) >= 2
    if more:
        assert head.count("uncertainty_") >= 2


def test_a_table_too_wide_says_what_it_leaves_out(call: Call) -> None:
    result = call("predict", "gripper.yaml")
    assert "no room for numerical_error_mm" in result.stderr
    assert "fingers_overlap" in result.stdout
    explicit = call("predict", "gripper.yaml", "--columns", "states,gripper")
    assert "numerical_error_mm" in explicit.stdout.splitlines()[0]


@pytest.mark.parametrize("name", ["three_unit.yaml", "gripper.yaml"])
def test_a_summary_ends_with_what_is_known_of_the_model(call: Call, name: str) -> None:
    assert call("predict", name).stderr.splitlines()[-1] == (
        "the model's own error: shapes curl 13–24 % too far against finite elements; "
        "calibrate: dpg help calibration"
    )
    lever = ("-s", "finger.geometry=null", "-s", "finger.calibration=null")
    lattice = json.dumps(
        {
            "segment_length_mm": 13.5,
            "segment_height_mm": 13.0,
            "stroke_mm": 3.5,
            "bistable_stiffness_N_per_mm": 12.84,
            "force_linearity": 0.043,
            "hinge_stiffness_N_mm_per_rad": 24.2,
        }
    )
    other = call("predict", name, *lever, "-s", f"finger.lattice={lattice}")
    assert other.exit_code == 0
    assert (
        "the model's own error: unknown for this law and these values"
        in other.stderr.splitlines()[-1]
    )


def test_what_uncertainties_cover_is_said_on_every_output(call: Call, folder: Path) -> None:
    result = call("predict", "gripper.yaml", *TOLERANCES, "-o", "u.parquet")
    assert f"uncertainties cover: {COVERS}\n" in result.stderr
    assert COVERS not in result.stdout  # the table leaves it to the summary
    metadata = pq.read_metadata(folder / "u.parquet").metadata
    assert metadata[b"dpg.uncertainty"].decode() == COVERS
    assert metadata[b"dpg.model_error"].decode() == "5 % of the deflection, as the spec says"
    table = pd.read_parquet(folder / "u.parquet")
    assert set(table["uncertainty_covers"]) == {COVERS}
    for form in ("json", "csv"):
        assert COVERS in call("predict", "-q", "gripper.yaml", *TOLERANCES, "--format", form).stdout
    facts = json.loads((folder / "u.run.json").read_text())
    told = facts["uncertainty"]
    assert (facts["model_error"], told["covers"]) == (
        "5 % of the deflection, as the spec says",
        COVERS,
    )
    totals = np.hypot(table["tip_x_uncertainty_mm"], table["tip_y_uncertainty_mm"])
    assert told["largest_tip_mm"] == pytest.approx(totals.max(), rel=1e-12)
    assert told["pattern"] == table["pattern"][totals.argmax()] == "11111"
    squares = sum(share**2 for share in told["tip_by_cause_mm"].values())
    assert squares == pytest.approx(told["largest_tip_mm"] ** 2, rel=1e-12)
    assert "the least certain tip, of 11111: ± " in result.stderr
    assert list(told["tip_by_cause_mm"]) == ["dome_height_mm", "elastic_modulus_MPa", "model_error"]


def test_without_the_option_nothing_is_said_of_it(call: Call, folder: Path) -> None:
    result = call("predict", "three_unit.yaml", *TOLERANCES[:-1], "-o", "u.parquet")
    assert "uncertainties cover" not in result.stderr
    assert b"dpg.uncertainty" not in pq.read_metadata(folder / "u.parquet").metadata
    assert "uncertainty" not in json.loads((folder / "u.run.json").read_text())


def test_explain_says_what_may_be_off(call: Call) -> None:
    text = call("explain", "three_unit.yaml", *TOLERANCES).stdout
    _, _, section = text.partition("\nUncertainty\n")
    lines = [" ".join(line.split()) for line in section.splitlines()[:4]]
    assert lines == [
        "the model itself 5 % of the deflection, as the spec says",
        "dome_height_mm ± 0.1 mm, the same error in all units",
        "elastic_modulus_MPa ± 10 %, the same error in all units",
        f"counted in by --uncertainty {COVERS}",
    ]
    facts = json.loads(call("explain", "three_unit.yaml", *TOLERANCES, "--format", "json").stdout)
    assert facts["uncertainty"] == {
        "covers": COVERS,
        "tolerances": {"dome_height_mm": "0.1 mm", "elastic_modulus_MPa": "10 %"},
        "model_error": 0.05,
    }
    plain = json.loads(call("explain", "three_unit.yaml", "--format", "json").stdout)
    assert plain["uncertainty"] is None
    assert plain["model_error"].startswith("shapes curl 13–24 % too far")


def test_a_long_finger_is_solved_whole_for_it(call: Call) -> None:
    """Pairs of half-fingers have no uncertainties: the plan solves each state."""
    long = ("twenty_unit.yaml", "-s", "finger.units=13")
    plan = json.loads(call("explain", *long, *TOLERANCES, "--format", "json").stdout)
    assert plan["method"] == "direct"


def test_nothing_to_count_in_says_what_there_could_be(call: Call) -> None:
    result = call("predict", "three_unit.yaml", "--uncertainty")
    assert result.exit_code == 2
    assert "uncertainty (tolerances by key) or model_error in the spec" in result.stderr


def test_bars_that_nobody_gives_are_said_to_be_assumed(call: Call) -> None:
    assert "1 assumed" in call("predict", "three_unit.yaml").stderr
    text = call("explain", "three_unit.yaml").stdout
    (line,) = [line for line in text.splitlines() if "  linear_stiffness_N_per_mm" in line]
    assert line.split()[:5] == ["linear_stiffness_N_per_mm", "10000", "units", "1-3", "assumed"]
    given = call("explain", "three_unit.yaml", "-s", "finger.linear_stiffness_N_per_mm=1e4").stdout
    assert not [line for line in given.splitlines() if "stiffness" in line and "assumed" in line]


def test_in_a_sweep_it_changes_nothing(call: Call, folder: Path) -> None:
    """As errors of fits do not: the tables have no uncertainties, and no axis is one."""
    space = "space: [{key: finger.geometry.dome_height_mm, values: [6, 7]}]\n"
    (folder / "a.yaml").write_text(f"base: three_unit.yaml\n{space}")
    done = call("sweep", "a.yaml", "-o", "out", "-q", "--executor", "serial", *TOLERANCES[:-1])
    assert done.exit_code == 0
    assert not [n for n in pq.read_schema(folder / "out/states.parquet").names if "uncert" in n]
    (folder / "b.yaml").write_text(
        "base: three_unit.yaml\nspace: [{key: uncertainty.dome_height_mm, values: [0.1, 0.2]}]\n"
    )
    refused = call("sweep", "b.yaml", "-o", "out")
    assert refused.exit_code == 2
    assert "expected a key that designs can differ in, found uncertainty.dome_height_mm" in (
        refused.stderr
    )
