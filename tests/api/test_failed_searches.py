"""Results where searches under pressure failed: they claim no more than was found."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import dpgcli as dpg
from dpgcli.actuation.pressed import Halt, Halted, Pressed, Shapes
from dpgcli.arrays import Array

SPEC = {
    "finger": {
        "units": 2,
        "linear_stiffness_N_per_mm": float("inf"),
        "lattice": {
            "segment_length_mm": 13.5,
            "segment_height_mm": 10.75,
            "stroke_mm": 3.5,
            "bistable_stiffness_N_per_mm": 12.84,
            "force_linearity": 0.043,
            "hinge_stiffness_N_mm_per_rad": 24.2,
        },
    },
    "pressure": {"lines": {"A": 1, "B": 2}, "effective_area_mm2": 31.6},
}


@pytest.fixture
def _lost(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """No equilibrium is found where the second line's pressure rises beyond 0.1 MPa."""
    followed = Pressed.followed

    def failing(own: Pressed, shapes: Shapes, target: Array, *others: Any) -> Halted:
        halted = followed(own, shapes, target, *others)
        is_lost = (own.finger.n_units == 2) & (target[-1] > 0.1)
        return replace(halted, reason=np.where(is_lost, Halt.FAILED, halted.reason))

    monkeypatch.setattr(Pressed, "followed", failing)
    yield


def said(lines: tuple[str, ...]) -> str:
    return "\n".join(lines)


def test_without_failures_nothing_of_them_is_said() -> None:
    found = dpg.transitions(SPEC)
    assert "not reachable from rest with these lines" in said(found.summary)
    assert "the fewest there are" in said(dpg.pulses(SPEC, end="10").summary)
    assert (dpg.lookup(SPEC).table["pattern_at_peak"] != "").all()


@pytest.mark.usefixtures("_lost")
def test_transitions_find_what_they_can() -> None:
    found = dpg.transitions(SPEC, scatter="stroke_mm=1%", draws=10)
    assert found.reachable == ("00", "10")
    text = said(found.summary)
    assert "not found to be reachable from rest: 2 states: 01, 11" in text
    assert "no certified state is found in 2 directions of pressure" in text
    assert "not reachable from rest with" not in text
    is_lost = (found.table["line"] == "B") & (found.table["direction"] == "+")
    assert (found.table["share_unknown"] == is_lost).all()
    assert (found.table["share_leaving"][is_lost] == 0.0).all()


@pytest.mark.usefixtures("_lost")
def test_pulses_are_the_fewest_found() -> None:
    text = said(dpg.pulses(SPEC, end="10").summary)
    assert "1 pulse from 00 to 10, the fewest found" in text
    text = said(dpg.pulses(SPEC, end="11").summary)
    assert "pulses up to 0.2991 MPa are found from 00 to 11: 2 states found to be reached" in text
    assert "more may be reached" in text


@pytest.mark.usefixtures("_lost")
def test_a_look_up_table_has_rows_for_what_is_not_known() -> None:
    found = dpg.lookup(SPEC)
    rows = found.table.to_pandas()
    lost = rows[rows["pattern_at_peak"] == ""]
    assert lost[["line", "direction"]].to_numpy().tolist() == [["B", "+"]]
    assert lost["to_MPa"].item() == rows["to_MPa"].max()
    assert "1 interval without patterns" in said(found.summary)


@pytest.mark.usefixtures("_lost")
@pytest.mark.slow
def test_designs_count_failed_searches_and_requirements_warn(tmp_path: Path) -> None:
    base, sweep = tmp_path / "base.yaml", tmp_path / "sweep.yaml"
    base.write_text(yaml.safe_dump(SPEC))
    sweep.write_text(
        "base: base.yaml\nspace:\n  - {key: finger.lattice.stroke_mm, values: [3.5, 3.6]}\n"
    )
    dpg.sweep(sweep, output=tmp_path / "out", executor="serial")
    (verdict,) = dpg.check(tmp_path / "out" / "designs.parquet", require=["n_reachable > 3"])
    assert len(verdict.rows) == 2
    assert any(
        "searches failed or did not decide in 2 designs" in str(warning)
        for warning in verdict.warnings
    )


@pytest.mark.parametrize(
    ("coupling", "is_closed"), [(-6.0, True), (6.0, False), (0.0, False), (-1e-9, False)]
)
def test_gaps_closed_through_domes_at_rest_are_none_under_pressure(
    coupling: float, is_closed: bool
) -> None:
    finger = {**SPEC["finger"], "law": "push_only", "hinge_coupling_N_mm_per_rad": coupling}
    spec = {**SPEC, "finger": finger}
    assert (dpg.predict(spec).to_pandas()["status"] == "stable").all()
    found = dpg.transitions(spec)
    patterns = ["00", "11"] if is_closed else ["00", "01", "10", "11"]
    assert sorted(set(found.table["pattern"])) == patterns
    text = said(found.summary)
    assert ("2 of these under pressure only: a gap is closed" in text) is is_closed
    if is_closed:
        with pytest.raises(dpg.DpgError, match="gap_closed"):
            dpg.actuate(spec, start="10", pressure={"A": [0.0, 0.1], "B": [0.0, 0.0]})
