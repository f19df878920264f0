"""Sweeps of bodies and of fingers that meet one."""

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dpgcli as dpg
from dpgcli.api.sweep import SweepResult, study_of
from dpgcli.arrays import Codes, Columns
from dpgcli.errors import SpecError
from dpgcli.states.certify import Status
from dpgcli.sweeps import grasps
from dpgcli.sweeps.grasps import NAMES

FORCES = ("squeeze_N", "max_contact_N")

LATTICE = {
    "segment_length_mm": 13.5,
    "segment_height_mm": 10.75,
    "stroke_mm": 3.5,
    "bistable_stiffness_N_per_mm": 12.84,
    "force_linearity": 0.043,
    "hinge_stiffness_N_mm_per_rad": 24.2,
}
FINGER = {
    "units": 3,
    "linear_stiffness_N_per_mm": float("inf"),
    "lattice": LATTICE,
    "geometry": {"limiting_layer_thickness_mm": 1.5},
}
GRIPPER = {"base_spacing_mm": 30.0, "mounting_angle_deg": 5.0}
BODY = {"disc": {"diameter_mm": 20.0}, "at_mm": [32.0, 0.0]}
SPEC = {"finger": FINGER, "gripper": GRIPPER, "object": BODY}
WIDE = {"finger": FINGER, "gripper": {"base_spacing_mm": 30.0, "mounting_angle_deg": 0.0}}
CAN = {"disc": {"diameter_mm": 30.0}, "at_mm": [28.0, 0.0]}
ALONE = {"finger": FINGER, "object": {"disc": {"diameter_mm": 12.0}, "at_mm": [30.0, -9.0]}}


def swept(base: dict[str, Any], *axes: tuple[str, list[float]], **more: Any) -> SweepResult:
    space = [{"key": key, "values": values} for key, values in axes]
    return dpg.sweep({"base": base, "space": space}, executor="serial", **more)


@pytest.mark.parametrize(
    ("base", "axes"),
    [
        (SPEC, {"object.disc.diameter_mm": [12.0, 20.0, 24.0], "object.at_x_mm": [28.0, 34.0]}),
        (SPEC, {"object.at_y_mm": [0.0, -2.5, 3.0], "gripper.base_spacing_mm": [26.0, 30.0]}),
        (SPEC, {"gripper.mounting_angle_deg": [0.0, 8.0], "finger.lattice.stroke_mm": [3.0, 3.5]}),
        pytest.param(
            WIDE | {"object": CAN | {"held": "guided"}},
            {"object.disc.diameter_mm": [30.0], "object.at_x_mm": [27.0, 28.0]},
            marks=pytest.mark.slow,
        ),
        pytest.param(
            WIDE | {"object": CAN | {"held": "free"}},
            {"object.at_y_mm": [0.0, 0.5], "gripper.base_spacing_mm": [30.0]},
            marks=pytest.mark.slow,
        ),
        (ALONE, {"object.at_y_mm": [-9.0, -7.5], "object.disc.diameter_mm": [10.0, 12.0]}),
    ],
)
def test_states_are_those_of_each_design_by_itself(
    base: dict[str, Any], axes: dict[str, list[float]]
) -> None:
    found = swept(base, *axes.items()).states
    (first, ones), (second, others) = axes.items()
    place, n_touching = 0, 0
    for one in ones:
        for other in others:
            alone = dpg.grasp(base, settings={first: one, second: other}).rows
            rows = slice(place, place + 8)
            place += 8
            for name in (name for name in NAMES if name in alone):
                own = found[name][rows]
                if alone[name].dtype.kind == "f":
                    assert own == pytest.approx(alone[name], abs=1e-9, nan_ok=True), name
                else:
                    assert own.tolist() == alone[name].tolist(), name
            statuses = ["stable" if code == 0 else "?" for code in alone["status"]]
            assert [s if s == "stable" else "?" for s in found["grasp_status"][rows]] == statuses
            n_touching += int((alone["n_contacts"] > 0).sum())
    assert place == len(found) and n_touching >= 4


def test_metrics_are_those_of_states_that_hold() -> None:
    result = swept(SPEC, ("object.disc.diameter_mm", [1.0, 20.0]))
    states = result.states
    is_second = states["design"] == 1
    assert result.designs["n_grasps"].tolist() == [
        0,
        int((states["n_contacts"][is_second] > 0).sum()),
    ]
    for name, over in (("squeeze_max_N", "squeeze_N"), ("contact_max_N", "max_contact_N")):
        expected = [0.0, np.nanmax(states[over][is_second])]
        assert result.designs[name].tolist() == expected and expected[1] > 0.01


def test_a_place_by_its_parts() -> None:
    by_parts = {**BODY, "at_mm": [1.0, 1.0], "at_x_mm": 32.0, "at_y_mm": 0.0}
    found = [dpg.grasp({**SPEC, "object": body}).rows["squeeze_N"] for body in (BODY, by_parts)]
    assert found[0].tolist() == found[1].tolist()


def test_bodies_that_begin_in_a_base_are_no_designs() -> None:
    designs = swept(SPEC, ("object.at_x_mm", [2.0, 32.0]), ("object.at_y_mm", [15.0])).designs
    assert designs["status"].tolist() == ["invalid", "stable"]
    assert "begins in the base of a finger: move it along x" in designs["reason"][0]
    assert np.isnan(designs["squeeze_max_N"][0])


def test_a_body_needs_a_face() -> None:
    bare = {key: value for key, value in FINGER.items() if key != "geometry"}
    designs = swept({**SPEC, "finger": bare}, ("object.at_x_mm", [30.0, 32.0])).designs
    assert set(designs["status"]) == {"invalid"}
    assert "limiting_layer_thickness_mm" in designs["reason"][0]


def test_keys_of_a_body_need_a_body_in_the_base() -> None:
    bare = {key: value for key, value in SPEC.items() if key != "object"}
    with pytest.raises(SpecError, match="the base has no object"):
        swept(bare, ("object.disc.diameter_mm", [20.0, 30.0]))


JAWS = {"jaws": {"gap_mm": 20.0, "height_mm": 12.0}, "at_mm": [32.0, 0.0]}
TABLE = {"jaw_gap_mm": [10.0, 20.0], "force_N": [0.5, 0.0]}
MECHANISM = {**JAWS, "compliance": {"table": TABLE}}
WEDGE = {"polygon": [[-8.0, 0.0], [8.0, -10.0], [8.0, 10.0]], "at_mm": [32.0, 0.0]}


@pytest.mark.parametrize(
    ("body", "key"),
    [
        (BODY, "object.jaws.gap_mm"),
        (BODY, "object.compliance.stiffness_N_per_mm"),
        (JAWS, "object.disc.diameter_mm"),
        (JAWS, "object.compliance.stiffness_N_per_mm"),
        (MECHANISM, "object.compliance.stiffness_N_per_mm"),
        (WEDGE, "object.disc.diameter_mm"),
        (WEDGE, "object.jaws.height_mm"),
    ],
)
def test_keys_of_another_body_are_refused(body: dict[str, Any], key: str) -> None:
    with pytest.raises(SpecError, match=f"the base has no {key.rpartition('.')[0]}"):
        swept({**SPEC, "object": body}, (key, [20.0, 25.0]))


def test_gaps_beyond_a_table_have_no_answer() -> None:
    """No rest there is known, whatever fingers do."""
    result = swept({**SPEC, "object": MECHANISM}, ("object.jaws.gap_mm", [18.0, 22.0]))
    told = result.designs.to_pandas()
    assert told["n_unknown_grasps"].tolist() == [0, 8]
    assert told["squeeze_max_N"][0] > 0.0 and np.isnan(told["squeeze_max_N"][1])


def test_requirements_by_forces_are_warned_of() -> None:
    result = swept(SPEC, ("object.disc.diameter_mm", [20.0, 22.0]), require="squeeze_max_N > 0.01")
    assert result.verdicts[0].is_met
    (warning,) = [text for text in result.warnings if str(text).startswith("require")]
    assert "rests on forces (" in str(warning)
    with pytest.raises(dpg.UsageError, match="squeeze_max_N rests on forces"):
        swept(
            SPEC,
            ("object.disc.diameter_mm", [20.0, 22.0]),
            require="squeeze_max_N > 0.01",
            strict=True,
        )


def test_nothing_of_grasping_is_loaded_without_a_body(tmp_path: Path) -> None:
    lines = [
        "import sys, dpgcli as dpg",
        f"finger = {{**{FINGER!r}}}".replace("inf", "float('inf')"),
        "space = [{'key': 'finger.lattice.stroke_mm', 'values': [3.0, 3.5]}]",
        "found = dpg.sweep({'base': {'finger': finger}, 'space': space}, executor='serial')",
        "print([name for name in sys.modules if 'grasp' in name or 'contact' in name])",
        "print([name for name in found.states.names if name in ('grasp_status', 'squeeze_N')])",
        "print([name for name in found.designs.names if 'squeeze' in name or 'grasp' in name])",
    ]
    (tmp_path / "run.py").write_text("\n".join(lines), encoding="utf-8")
    ran = subprocess.run(
        [sys.executable, "run.py"], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert ran.stdout.splitlines() == ["[]", "[]", "[]"]


def test_rigid_and_elastic_bars_meet_a_body_in_one_sweep() -> None:
    disc = {"disc": {"diameter_mm": 12.0}, "at_mm": [4.0, 0.0]}
    bars = ("finger.linear_stiffness_N_per_mm", [1e4, float("inf")])
    places = ("object.at_y_mm", [-9.0, 0.0])  # the second is in the base
    found = swept(ALONE | {"object": disc}, places, bars)
    assert [status == "invalid" for status in found.designs["status"]] == [False, False, True, True]


def test_grasps_that_are_not_found_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    """They are no answer: no bound on forces is met by them."""
    rows_of = grasps.grasp_rows

    def losing(own: grasps.Encounter, codes: Codes) -> Columns:
        rows = rows_of(own, codes)
        is_lost = codes == 7
        rows["grasp_status"] = np.where(is_lost, Status.NOT_CONVERGED, rows["grasp_status"])
        lost = {name: np.where(is_lost, np.nan, rows[name]) for name in FORCES}
        return {**rows, **lost, "n_contacts": np.where(is_lost, 0, rows["n_contacts"])}

    monkeypatch.setattr(grasps, "grasp_rows", losing)
    axis = ("object.disc.diameter_mm", [1.0, 20.0])
    result = swept(SPEC, axis, require=["contact_max_N < 100", "contact_max_N > 0.01"])
    assert result.designs["n_unknown_grasps"].tolist() == [1, 1]
    assert result.designs["n_unknown_states"].tolist() == [0, 0]
    assert [verdict.rows.tolist() for verdict in result.verdicts] == [[0, 1], [0]]
    assert "searches failed or did not decide in 2 designs (n_unknown_grasps)" in result.report
    assert any(
        "searches failed or did not decide in 2 designs" in str(line) for line in result.warnings
    )


def test_payloads_that_are_not_found_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    """The largest of the others is no upper bound."""
    rows_of = grasps.grasp_rows

    def losing(own: grasps.Encounter, codes: Codes) -> Columns:
        rows = rows_of(own, codes)
        is_best = rows["payload_N"] == np.nanmax(rows["payload_N"])
        return {**rows, "payload_N": np.where(is_best, np.nan, rows["payload_N"])}

    base = {**SPEC, "object": {**BODY, "friction": 0.5}}
    axis, asked = ("object.disc.diameter_mm", [20.0]), ["payload_max_N < 100", "n_grasps > 0"]
    found = swept(base, axis, require=asked)
    assert found.designs["n_unknown_grasps"].tolist() == [0]
    assert [len(verdict.rows) for verdict in found.verdicts] == [0, 0]
    monkeypatch.setattr(grasps, "grasp_rows", losing)
    lost = swept(base, axis, require=asked)
    assert 0.0 <= lost.designs["payload_max_N"][0] < found.designs["payload_max_N"][0]
    assert lost.designs["n_unknown_grasps"][0] > 0
    assert [len(verdict.rows) for verdict in lost.verdicts] == [1, 0]


def test_chunks_of_bodies_take_seconds(folder: Path) -> None:
    """So that there is parallel work to do, something to resume, and a time to say."""
    axis = {"key": "object.at_x_mm", "linear": {"from": 30.0, "to": 34.0, "count": 1000}}
    bare = {key: value for key, value in SPEC.items() if key != "object"}
    bodies = {"base": SPEC, "space": [axis]}
    width = {"key": "gripper.base_spacing_mm", "linear": {"from": 30.0, "to": 34.0, "count": 1000}}
    met, without = (study_of(found, folder) for found in (bodies, {"base": bare, "space": [width]}))
    assert met.extent.seconds > 5.0 * without.extent.seconds
    n_chunks = 1000 / met.chunk_size
    assert n_chunks > 1.0 and 1.0 < met.extent.seconds / n_chunks < 10.0
