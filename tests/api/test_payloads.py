"""Payloads of grasps and of sweeps: what friction bears of the body's weight."""

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dpgcli as dpg
from dpgcli.errors import SpecError

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
DISC = {"disc": {"diameter_mm": 20.0}, "at_mm": [32.0, 0.0], "friction": 0.8}
SPEC = {
    "finger": FINGER,
    "gripper": {"base_spacing_mm": 30.0, "mounting_angle_deg": 5.0},
    "object": DISC,
}
CAN = {"disc": {"diameter_mm": 30.0}, "at_mm": [28.0, 0.0], "friction": 0.3}
WIDE = {
    "finger": FINGER,
    "gripper": {"base_spacing_mm": 30.0, "mounting_angle_deg": 0.0},
    "object": CAN,
}


def with_object(spec: dict[str, Any], **keys: Any) -> dict[str, Any]:
    return {**spec, "object": {**spec["object"], **keys}}


@pytest.mark.parametrize("way", ["x", "-x"])
def test_one_place_of_each_finger_in_closed_form(way: str) -> None:
    """2 (μ |F_y| ± F_x), if friction keeps the disc: each finger pushes with N (−sin φ, −cos φ).

    Pulled out the fingers hold; pulled on, to where they push anyway, they give way a little.
    """
    n_held, sign = 0, 1.0 if way == "x" else -1.0
    for friction in (0.2, 0.8):
        spec = {**with_object(SPEC, friction=friction), "loads": {"gravity_direction": way}}
        rows = dpg.grasp(spec, patterns=["10*"]).rows
        is_one = (rows["status"] == 0) & (rows["n_contacts"] == 2)
        x, y = (rows[f"finger_force_{axis}_N"][is_one] for axis in "xy")
        is_kept = np.abs(x) <= friction * np.abs(y)
        expected = np.where(is_kept, 2.0 * (friction * np.abs(y) - sign * x), 0.0)
        own = rows["payload_N"][is_one]
        assert set(rows["fails_first"][is_one]) == {"slip"} and (x < 0.0).all()
        if way == "x":
            assert own == pytest.approx(expected, abs=1e-8)
        else:
            assert (own <= expected + 1e-8).all() and (own >= 0.7 * expected).all()
        n_held += int((expected > 0.0).sum())
    assert n_held >= 2


def test_gravity_is_that_of_a_finger_that_points_up_unless_it_is_said() -> None:
    few: dict[str, Any] = {"patterns": ["10*"]}
    towards = dpg.grasp({**SPEC, "loads": {"gravity_direction": "-x"}}, **few)
    unsaid = dpg.grasp(SPEC, **few)
    assert towards.rows["payload_N"].tolist() == unsaid.rows["payload_N"].tolist()
    assert any("pull along -x" in line for line in unsaid.summary)


def test_bodies_off_the_axis_are_mirrored() -> None:
    own = []
    for y in (0.1, -0.1):
        spec = with_object(SPEC, at_mm=[32.0, y], friction=1.5)
        own.append(dpg.grasp(spec, patterns=["10*"]).rows["payload_N"])
    assert own[0] == pytest.approx(own[1], rel=1e-8, abs=1e-9) and own[0].min() > 0.1


@pytest.mark.slow
def test_a_little_beside_the_axis_is_a_little_less() -> None:
    """The forces of a body that is kept beside it do not balance: what gives way makes them."""
    own = []
    for y in (0.0, 1e-4):
        spec = with_object(SPEC, at_mm=[32.0, y])
        own.append(dpg.grasp(spec, patterns=["10*"]).rows["payload_N"])
    assert own[0] == pytest.approx(own[1], rel=5e-3) and own[0].min() > 0.1


def test_units_that_reset_before_a_body_slips() -> None:
    base = {**SPEC, "gripper": {"base_spacing_mm": 30.0, "mounting_angle_deg": 0.0}}
    spec = {
        **with_object(base, friction=5.0, at_mm=[30.0, 0.0]),
        "loads": {"gravity_direction": "x"},
    }
    (row,) = dpg.grasp(spec, patterns=["101"]).table.to_arrow().to_pylist()
    assert row["fails_first"] == "reset" and row["payload_N"] == pytest.approx(4.791, abs=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("held", ["guided", "free"])
def test_bodies_that_rest_without_friction_bear_more_with_it(held: str) -> None:
    few: dict[str, Any] = {"patterns": ["000", "001"] if held == "free" else ["001"]}
    rows = dpg.grasp(with_object(WIDE, held=held), **few).rows
    is_there = rows["status"] == 0
    assert is_there.any() and np.isnan(rows["payload_N"][~is_there]).all()
    assert (rows["payload_N"][is_there] > 0.0).all()
    assert (rows["fails_first"] != "").tolist() == is_there.tolist()
    without = dpg.grasp(with_object(WIDE, held=held, friction=0.0), **few).rows
    # places on both sides of the middle: those that push against the pull bear some
    assert (without["payload_N"] < rows["payload_N"])[is_there].all()


def test_the_weight_that_is_borne() -> None:
    few: dict[str, Any] = {"patterns": ["10*"]}
    known = dpg.grasp(SPEC, **few)
    most = known.rows["payload_N"].max()
    assert any(f"largest payload {most:.4g} N, in 101" in line for line in known.summary)
    for share, word in ((0.99, "none"), (1.01, "slip")):
        mass = share * most / 9.80665e-3
        found = dpg.grasp(with_object(SPEC, mass_g=mass), **few)
        assert found.rows["fails_first"].tolist() == ["slip", word]
        told = " ".join(found.summary)
        assert f"{1.0 / share:.3g} times the weight of {share * most:.4g} N" in told
        n_less = "1 state" if word == "none" else "2 states"
        assert f"{n_less} not bearing the weight" in told
        assert "rests on the friction of 0.8 that is given" in told


def test_bodies_that_all_get_away() -> None:
    found = dpg.grasp(with_object(WIDE, held="free"), patterns=["000"])
    assert np.isnan(found.rows["payload_N"]).all() and found.rows["fails_first"].tolist() == [""]
    assert "payload: pull along -x" in " ".join(found.summary)


def test_a_finger_alone_holds_nothing() -> None:
    alone = {
        "finger": FINGER,
        "object": {"disc": {"diameter_mm": 12.0}, "at_mm": [30.0, -9.0], "friction": 2.0},
    }
    rows = dpg.grasp(alone).rows
    assert (rows["n_contacts"] > 0).any() and (rows["payload_N"] == 0.0).all()


@pytest.mark.parametrize(
    ("base", "axes"),
    [
        (SPEC, {"object.friction": [1.5], "object.at_y_mm": [0.0, -0.1]}),
        pytest.param(
            WIDE,
            {"object.friction": [0.2, 0.5], "object.disc.diameter_mm": [29.0, 30.0]},
            marks=pytest.mark.slow,
        ),
    ],
)
@pytest.mark.parametrize("held", ["fixed", pytest.param("free", marks=pytest.mark.slow)])
@pytest.mark.slow
def test_sweeps_have_what_each_design_has_by_itself(
    base: dict[str, Any], axes: dict[str, list[float]], held: str
) -> None:
    is_held = base is WIDE or held == "fixed"  # let go of, the disc of the other gets away
    base = with_object(base, held=held, mass_g=5.0)
    space = [{"key": key, "values": values} for key, values in axes.items()]
    found = dpg.sweep(
        {"base": base, "space": space}, executor="serial", require="payload_max_N > 1e3"
    )
    states, designs, place = found.states, found.designs, 0
    (first, ones), (second, others) = axes.items()
    for one in ones:
        for other in others:
            alone = dpg.grasp(base, settings={first: one, second: other}).rows
            rows = slice(place, place + 8)
            own, failing = states["payload_N"][rows], states["fails_first"][rows]
            assert own == pytest.approx(alone["payload_N"], abs=1e-9, nan_ok=True)
            assert failing.tolist() == alone["fails_first"].tolist()
            most = np.nan if np.isnan(own).all() else np.nanmax(own)
            assert designs["payload_max_N"][place // 8] == pytest.approx(most, nan_ok=True)
            place += 8
    assert (np.nanmax(states["payload_N"], initial=0.0) > 0.0) == is_held
    assert not found.verdicts[0].is_met
    assert any("payload_max_N rests on forces" in str(text) for text in found.warnings)


def test_masses_of_a_sweep() -> None:
    base = with_object(SPEC, mass_g=1.0)
    space = [{"key": "object.mass_g", "values": [1.0, 1e4]}]
    states = dpg.sweep({"base": base, "space": space}, executor="serial").states
    is_there = ~np.isnan(states["payload_N"])
    light, heavy = (
        set(states["fails_first"][is_there & (states["mass_g"] == m)]) for m in (1, 1e4)
    )
    assert "none" in light and heavy == {"slip"}


@pytest.mark.parametrize("key", ["friction", "mass_g"])
def test_a_sweep_of_friction_needs_it_in_the_base(key: str) -> None:
    bare = {name: value for name, value in DISC.items() if name != "friction"}
    space = [{"key": f"object.{key}", "values": [0.3, 0.5]}]
    with pytest.raises(SpecError, match=rf"the base has no object\.{key}"):
        dpg.sweep({"base": {**SPEC, "object": bare}, "space": space}, executor="serial")


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"friction": -0.1}, "object.friction: expected a coefficient >= 0, such as 0.5"),
        ({"friction": "much"}, "object.friction: expected a coefficient >= 0, such as 0.5"),
        ({"mass_g": 0.0}, "object.mass_g: expected a mass > 0 in g, found 0"),
        ({"mass_g": -3.0}, "object.mass_g: expected a mass > 0 in g, found -3"),
        (
            {"mass_g": 3.0, "friction": None},
            "object.mass_g: expected friction beside it, which bears the weight, found none "
            "(give one such as friction: 0.5)",
        ),
    ],
)
def test_what_is_no_friction_and_no_mass(keys: dict[str, Any], words: str) -> None:
    with pytest.raises(SpecError) as caught:
        dpg.grasp(with_object(SPEC, **keys))
    assert words in str(caught.value)


@pytest.mark.slow
def test_friction_of_a_file_of_a_body(tmp_path: Path) -> None:
    body = tmp_path / "can.yaml"
    body.write_text("disc: {diameter_mm: 20}\nfriction: 0.4\n", encoding="utf-8")
    of_file = dpg.grasp(SPEC, object=str(body), patterns="10*").rows["payload_N"]
    said = dpg.grasp(with_object(SPEC, friction=0.4), patterns="10*").rows["payload_N"]
    assert of_file.tolist() == pytest.approx(said.tolist(), nan_ok=True)
    body.write_text("disc: {diameter_mm: 20}\n", encoding="utf-8")
    kept = dpg.grasp(SPEC, object=str(body), patterns="10*").rows["payload_N"]
    own = dpg.grasp(SPEC, object="disc:20", patterns="10*").rows["payload_N"]
    expected = dpg.grasp(SPEC, patterns="10*").rows["payload_N"]
    assert kept.tolist() == own.tolist() == expected.tolist()


def test_nothing_of_payloads_is_there_without_friction(tmp_path: Path) -> None:
    bare = {name: value for name, value in DISC.items() if name != "friction"}
    lines = [
        "import sys, dpgcli as dpg",
        f"spec = {{**{ ({**SPEC, 'object': bare})!r}}}".replace("inf", "float('inf')"),
        "found = dpg.grasp(spec, patterns='0*')",
        "space = [{'key': 'object.disc.diameter_mm', 'values': [19.0, 20.0]}]",
        "swept = dpg.sweep({'base': spec, 'space': space}, executor='serial')",
        "names = (*found.table.names, *swept.states.names, *swept.designs.names)",
        "print([name for name in sys.modules if 'payload' in name])",
        "print([name for name in names if 'payload' in name or 'fails' in name])",
        "print([line for line in found.summary if 'payload' in line])",
    ]
    (tmp_path / "run.py").write_text("\n".join(lines), encoding="utf-8")
    ran = subprocess.run(
        [sys.executable, "run.py"], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert ran.stdout.splitlines() == ["[]", "[]", "[]"]


def test_less_friction_bears_no_more() -> None:
    """Down to none, with which a body that is pushed along its pull gets away at once."""
    sizes = {"dome_height_mm": 6.5, "dome_thickness_mm": 0.75, "unit_cell_mm": 22}
    sizes |= {"chamber_length_mm": 9, "channel_width_mm": 10, "limiting_layer_thickness_mm": 1.5}
    sizes |= {"unit_separation_mm": 3, "elastic_modulus_MPa": 26}
    finger = {"units": 3, "calibration": "published", "geometry": sizes}
    can = {"disc": {"diameter_mm": 26}, "at_mm": [35, 0], "friction": 0.5}
    spec = {"finger": finger, "gripper": {"base_spacing_mm": 34}, "object": can}
    spec |= {"loads": {"gravity_direction": "x"}}
    borne = []
    for friction in (0.0, 1e-12, 1e-9, 1e-6, 1e-4, 1e-2, 0.3, 0.6):
        found = dpg.grasp(spec, patterns="011", settings={"object.friction": friction})
        borne.append(found.table.to_pandas().payload_N.item())
        failing = found.table.to_pandas().fails_first.item()
        assert failing == "slip" or friction > 0.3
    assert borne[:-1] == [0.0] * 7
    assert borne[-1] > 0.5
