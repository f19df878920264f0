"""The law that a spec names, held against the points of the calibration behind it."""

import json
from pathlib import Path

import numpy as np
import pytest

from dpgcli.design.scene import Origin
from dpgcli.errors import SpecError
from dpgcli.files.scene_file import canonical_json, read_spec, scene_of
from dpgcli.mechanics.laws import PUBLISHED, PushOnly, Tabulated
from dpgcli.states.plan import Request
from dpgcli.states.predict import predict

SPEC = """\
finger:
  units: 3
  linear_stiffness_N_per_mm: .inf
  calibration: [dome.yaml, published]
  law: LAW
  geometry:
    dome_height_mm: 6.5
    dome_thickness_mm: 0.75
    unit_cell_mm: 22
    chamber_length_mm: 9
    channel_width_mm: 10
    limiting_layer_thickness_mm: 1.5
    unit_separation_mm: 3
    elastic_modulus_MPa: 26
"""
GEOMETRY = {
    "dome_height_mm": 6.5,
    "dome_thickness_mm": 0.75,
    "unit_separation_mm": 3.0,
    "elastic_modulus_MPa": 26.0,
}
STIFFNESS, ALPHA, TRAVEL_AT_WELL = 44.0, 0.015, 13.5


def polynomial(travel):
    """The study's law of the dome's own travel; its well by the quadratic formula below."""
    u = travel / TRAVEL_AT_WELL
    return 0.5 * STIFFNESS * travel**2 * (ALPHA + (1.0 - ALPHA) * (1.0 - u) ** 2)


BETA = 1.0 - ALPHA
WELL = TRAVEL_AT_WELL * (3.0 * BETA + np.sqrt(9.0 * BETA**2 - 8.0 * BETA)) / (4.0 * BETA)
TRAVEL = np.linspace(0.0, 15.0, 121)
FACTOR = 0.25


def calibration(travel=TRAVEL, energy=None, **changes):
    """A file of a dome, whose opening is a quarter of its travel."""
    energy = polynomial(np.asarray(travel)).tolist() if energy is None else energy
    data = {
        "calibration_version": 1,
        "made_by": "hand",
        "method": "none",
        "values": {
            "bistable_stiffness_N_per_mm": {"value": STIFFNESS / FACTOR**2},
            "stroke_mm": {"value": TRAVEL_AT_WELL * FACTOR},
        },
        "geometry": GEOMETRY,
        "curve": {
            "travel_mm": list(travel),
            "energy_mJ": list(energy),
            "opening_per_travel": FACTOR,
        },
    }
    return {key: value for key, value in {**data, **changes}.items() if value is not None}


@pytest.fixture
def scene(tmp_path, monkeypatch):
    """The scene of a law, with a calibration file beside the spec."""
    monkeypatch.chdir(tmp_path)

    def of(law, *changes, dome=None):
        Path("dome.yaml").write_text(json.dumps(dome or calibration()), encoding="utf-8")
        Path("x.yaml").write_text(SPEC.replace("LAW", law), encoding="utf-8")
        return scene_of(read_spec("x.yaml", changes))

    return of


@pytest.fixture
def problem(scene):
    def of(law, *changes, dome=None):
        with pytest.raises(SpecError) as caught:
            scene(law, *changes, dome=dome)
        (found,) = caught.value.problems
        return str(found)

    return of


def source(scene, key):
    (found,) = (s for s in scene.sources if s.key == key)
    return found


def energies(finger, extension):
    return finger.springs(np.asarray(extension)[None]).energy[0]


def test_without_a_law_it_is_the_published_one(scene):
    assert scene("published").finger.law is PUBLISHED
    assert scene("null").finger.law is PUBLISHED


def test_published_needs_the_linearity_that_a_curve_does_without(scene, problem):
    alone = ("finger.calibration=dome.yaml", "finger.lattice.hinge_stiffness_N_mm_per_rad=24.2")
    assert "finger.lattice.force_linearity: expected a value" in problem("published", *alone)
    for law in ("tabulated", "push_only"):
        found = scene(law, *alone)
        assert "force_linearity" not in [s.key for s in found.sources]


def test_a_tabulated_law_has_the_files_energy_at_its_openings(scene):
    finger = scene("tabulated").finger
    assert isinstance(finger.law, Tabulated)
    assert finger.domes.contact.tolist() == [[0.0]]
    assert energies(finger, FACTOR * TRAVEL) == pytest.approx(polynomial(TRAVEL), abs=1e-9)
    assert finger.law.rests(finger.domes).well.item() == pytest.approx(FACTOR * WELL, abs=1e-4)


def test_a_tabulated_polynomial_is_the_polynomial(scene):
    """Beside the published law with the same constants."""
    table, law = scene("tabulated"), scene("published", f"finger.lattice.force_linearity={ALPHA}")
    one, other = (predict(s, Request()).arrays() for s in (table, law))
    assert (one["status"] == "stable").all()
    for name in ("tip_x_mm", "tip_y_mm", "energy_mJ"):
        assert one[name] == pytest.approx(other[name], abs=2e-3)
        assert not np.array_equal(one[name], other[name])


def test_a_table_brought_to_another_dome_keeps_its_shape(scene):
    """The rules of the single values: k_b as t^2.8 h^-0.25, d as h - s."""
    finger = scene("tabulated", "finger.geometry.dome_height_mm=7.5").finger
    stiffer, longer = (7.5 / 6.5) ** -0.25, 4.5 / 3.5
    found = energies(finger, FACTOR * longer * TRAVEL)
    assert found == pytest.approx(stiffer * longer**2 * polynomial(TRAVEL), abs=1e-9)


def test_a_dome_that_pushes_has_its_own_energy_while_it_touches(scene):
    found = scene("push_only")
    finger = found.finger
    assert isinstance(finger.law, PushOnly)
    top, well = (float(rest.item()) for rest in finger.law.rests(finger.domes))
    assert well == pytest.approx(WELL - 6.5 - 3.0, abs=1e-4)
    touching = TRAVEL[(top + 9.5 < TRAVEL) & (well + 9.5 > TRAVEL)]
    assert len(touching) > 20
    expected = polynomial(touching)
    assert energies(finger, touching - 9.5) == pytest.approx(expected, abs=1e-9)
    beyond = energies(finger, [well, well + 0.1, well + 5.0])
    assert beyond == pytest.approx(np.full(3, float(polynomial(WELL))), abs=1e-5)
    assert finger.springs(np.array([[well + 0.1]])).force.item() == 0.0


def test_the_stroke_of_a_dome_that_pushes_follows_from_its_travel(scene):
    found = source(scene("push_only"), "stroke_mm")
    assert found.value == pytest.approx(WELL - 9.5, abs=1e-4)
    assert found.origin is Origin.DERIVED
    assert found.rule.startswith("travel of the inverted dome - dome height - unit separation")


def test_higher_domes_travel_further_and_hold_more(scene):
    """By the rules found in finite elements: travel as h, inverted energy as t^2.8 h^1.75."""
    changes = ("finger.geometry.dome_height_mm=7.5", "finger.geometry.dome_thickness_mm=1")
    finger = scene("push_only", *changes).finger
    assert finger.domes.contact.item() == pytest.approx(7.5 + 3.0, rel=1e-12)
    assert finger.stroke.item() == pytest.approx(WELL * 7.5 / 6.5 - 10.5, abs=1e-3)
    inverted = energies(finger, [finger.stroke.item() + 1.0]).item()
    growth = (1.0 / 0.75) ** 2.8 * (7.5 / 6.5) ** 1.75
    assert inverted == pytest.approx(growth * float(polynomial(WELL)), rel=1e-5)


def test_a_dome_that_never_reaches_its_neighbor_is_a_problem(problem):
    said = problem("push_only", "finger.geometry.unit_separation_mm=8")
    assert "finger.geometry.dome_height_mm: expected a value from 1e-12" in said
    assert "travel of the inverted dome - dome height - unit separation (contact)" in said


def test_a_stroke_fitted_elsewhere_comes_before_that_of_contact(scene):
    """The dome travels as far as before, so that it touches earlier; `with_values` agrees."""
    head = {"calibration_version": 1, "made_by": "hand", "method": "none"}
    stroke = {**head, "values": {"stroke_mm": {"value": 3.0, "standard_error": 0.1}}}
    Path("stroke.yaml").write_text(json.dumps(stroke), encoding="utf-8")
    found = scene("push_only", "finger.calibration=[stroke.yaml, dome.yaml, published]")
    assert source(found, "stroke_mm").value == 3.0
    assert found.finger.domes.contact.item() == pytest.approx(WELL - 3.0, abs=1e-4)
    assert found.uncertainty is not None
    changed = scene("push_only").finger.with_values({"stroke_mm": 3.0})
    assert changed.domes.contact.item() == found.finger.domes.contact.item()


@pytest.mark.parametrize("law", ["published", "tabulated", "push_only"])
def test_what_measures_a_curve_is_no_uncertainty_of_the_finger(scene, law):
    """k_b and d of the curve's own file cancel: with others the finger is the same."""
    values = calibration()["values"]
    off = {k: {"value": 1.3 * v["value"], "standard_error": 0.1} for k, v in values.items()}
    one, other = (scene(law, dome=calibration(values=v)) for v in (values, off))
    opening = np.linspace(0.5, 4.0, 8)
    same = np.allclose(energies(one.finger, opening), energies(other.finger, opening), rtol=1e-12)
    assert same == (law != "published")
    assert (other.uncertainty is None) == (law != "published")


@pytest.mark.parametrize("law", ["tabulated", "push_only"])
@pytest.mark.parametrize("section", ["lattice", "overrides.2.lattice"])
def test_a_curve_has_no_force_linearity(problem, law, section):
    said = problem(law, f"finger.{section}.force_linearity=0.05")
    assert f"finger.{section}.force_linearity: expected none beside law: {law}, found 0.05" in said


def test_units_with_domes_of_their_own_push_each_in_its_way(scene):
    graded = scene("push_only", "finger.overrides.2.geometry.dome_height_mm=7.5")
    same = scene("push_only"), scene("push_only", "finger.geometry.dome_height_mm=7.5")
    turns = [_turns(s, "100")[0] for s in same]
    found = _turns(graded, "111")
    assert graded.finger.domes.contact[:, 0] == pytest.approx([9.5, 10.5, 9.5])
    assert found == pytest.approx([turns[0], turns[1], turns[0]], rel=1e-10)


def _turns(scene, pattern):
    """Rotation of each unit, from its opening: x = 2 H sin(turn/2) for rigid bars."""
    rows = predict(scene, Request((pattern,), ("pattern", "status", "openings"))).arrays()
    assert rows["status"].tolist() == ["stable"]
    openings = [rows[f"opening_{i}_mm"][0] for i in range(1, len(pattern) + 1)]
    return [2.0 * np.arcsin(x / 21.5) for x in openings]


def test_twenty_units_that_push_turn_each_by_the_same(scene):
    long = scene("push_only", "finger.units=20", "finger.calibration=published")
    patterns = ("1" * 20, "10" * 10, "0" * 20)
    request = Request(patterns, ("pattern", "status", "tip_angle_rad"))
    rows = predict(long, request).arrays()
    assert (rows["status"] == "stable").all()
    turn = np.radians(17.36175941)  # of one unit of the study with rigid bars
    counts = np.array([pattern.count(b"1") for pattern in rows["pattern"].astype("S")])
    assert rows["tip_angle_rad"] == pytest.approx(-turn * counts, rel=1e-9)


def test_gaps_are_bridged_so_that_the_well_is_where_the_data_have_it(scene):
    """A rise and a parabola around the well, nothing between them."""
    rise, around = np.linspace(0.0, 1.8, 19), np.linspace(13.4, 14.6, 13)
    travel = [*rise.tolist(), *around.tolist()]
    energy = [*(20.0 * rise**2 - 3.0 * rise**3).tolist(), *(68.0 + 20.0 * (around - 14.0) ** 2)]
    dome = calibration(travel, energy)

    def well(unsampled):
        curve = {**dome["curve"], "unsampled_mm": unsampled}
        finger = scene("push_only", dome={**dome, "curve": curve}).finger
        return float(finger.law.rests(finger.domes).well.item()) + 9.5

    assert well([[1.8, 13.4]]) == pytest.approx(14.0, abs=1e-6)
    assert abs(well([]) - 14.0) > 1e-6, "without bridges the gap bends the well's own piece"


def test_a_curve_that_begins_after_rest_begins_at_rest(scene):
    dome = calibration(TRAVEL[1:].tolist())
    assert energies(scene("tabulated", dome=dome).finger, [0.0]).item() == 0.0
    finger = scene("push_only", dome=dome).finger
    assert finger.law.rests(finger.domes).well.item() == pytest.approx(WELL - 9.5, abs=1e-3)


@pytest.mark.parametrize("law", ["tabulated", "push_only"])
@pytest.mark.parametrize("first", [-2.0, -1.95, 0.0])
def test_energies_are_counted_from_rest_wherever_a_curve_begins(scene, law, first):
    """100 mJ more everywhere are the same dome, and pattern 0 is straight."""
    travel = np.concatenate((np.arange(first, 0.0, 0.125), TRAVEL[first < 0.0 :]))
    energy = (polynomial(travel) + 100.0).tolist()
    found = scene(law, dome=calibration(travel.tolist(), energy))
    patterns, columns = ("000", "111"), ("status", "energy_mJ", "openings")
    one, other = (predict(s, Request(patterns, columns)).arrays() for s in (found, scene(law)))
    assert one["status"].tolist() == ["stable"] * 2
    assert one["energy_mJ"][0] == 0.0
    assert one["opening_1_mm"][0] == 0.0
    for name in ("energy_mJ", "opening_1_mm"):
        assert one[name] == pytest.approx(other[name], rel=1e-3)


@pytest.mark.parametrize("law", ["tabulated", "push_only"])
@pytest.mark.parametrize("offset", [-100.0, 30.0, 100.0])
def test_an_energy_that_no_dome_has_so_near_rest_is_not_counted_from_there(problem, law, offset):
    travel = TRAVEL[3:]
    said = problem(law, dome=calibration(travel.tolist(), (polynomial(travel) + offset).tolist()))
    assert said.startswith(
        "x.yaml:5:3: finger.law: expected a curve that begins at rest, travel 0, or whose "
        f"energies are counted from there, found {polynomial(0.375) + offset:g} mJ at 0.375 mm"
    )
    assert said.endswith("in dome.yaml (add the point at travel 0 to the curve)")


@pytest.mark.parametrize("law", ["tabulated", "push_only"])
@pytest.mark.parametrize("start", [1e-4, 0.01, 0.125])
@pytest.mark.parametrize("offset", [-300.0, -0.3, 0.01, 0.3, 3.0, 300.0])
def test_close_to_rest_it_does_not_matter_what_energies_are_counted_from(scene, law, start, offset):
    """Nor for any force: at the first point a dome has next to none."""
    travel = np.append(start, TRAVEL[2:])
    dome = calibration(travel.tolist(), (polynomial(travel) + offset).tolist())
    found, expected = scene(law, dome=dome).finger, scene(law).finger
    places = FACTOR * np.linspace(0.0, 14.0, 200)
    one, other = (f.springs(places[None]) for f in (found, expected))
    scale = np.abs(other.force).max()
    assert np.abs(one.energy - other.energy).max() < 1e-3 * np.abs(other.energy).max()
    assert np.abs(one.force - other.force).max() < 0.01 * scale


@pytest.mark.parametrize("start", [1, 4, 16, 40])
def test_records_that_begin_after_rest_and_are_counted_from_it_are_taken(scene, start):
    """Up to travels where the dome is softening, and with energies known to some percent."""
    noise = np.random.default_rng(start).normal(0.0, 0.3, len(TRAVEL) - start)
    energy = polynomial(TRAVEL[start:]) + noise
    scene("tabulated", dome=calibration(TRAVEL[start:].tolist(), energy.tolist()))


def test_the_first_file_with_a_curve_gives_it(scene):
    Path("values.yaml").write_text(json.dumps(calibration(curve=None)), encoding="utf-8")
    found = scene("tabulated", "finger.calibration=[values.yaml, dome.yaml, published]").finger
    assert energies(found, [FACTOR * 2.0]) == pytest.approx([polynomial(2.0)], abs=1e-4)


def test_pushing_by_the_published_law_needs_no_curve(scene):
    finger = scene("push_only", "finger.calibration=published").finger
    assert finger.law.description == "push-only law, published energy of the dome"
    assert (finger.stroke.item(), finger.domes.contact.item()) == (3.5, 0.0)
    assert source(scene("push_only", "finger.calibration=published"), "force_linearity")


def test_a_kept_law_is_the_same_law(scene):
    for law in ("tabulated", "push_only"):
        finger = scene(law).finger
        Path("kept.json").write_text(
            canonical_json(read_spec("x.yaml", ["finger.linear_stiffness_N_per_mm=1e4"])),
            encoding="utf-8",
        )
        Path("dome.yaml").unlink()
        again = scene_of(read_spec("kept.json")).finger
        x = np.linspace(-1.0, 5.0, 31)
        assert energies(again, x).tolist() == energies(finger, x).tolist()


HINT = "(dpg fit bistable writes one)"


@pytest.mark.parametrize(
    ("law", "changes", "dome", "said"),
    [
        (
            "tabulated",
            ["finger.calibration=published"],
            None,
            f"expected a calibration with a curve beside law: tabulated, found none {HINT}",
        ),
        (
            "tabulated",
            [],
            calibration([0.0, 1.0, 2.0]),
            f"expected a curve of 4 points or more, found 3 in dome.yaml {HINT}",
        ),
        (
            "tabulated",
            [],
            calibration([-2.0, -1.0, 0.0, 1.0, 2.0]),
            f"expected a curve of 4 points or more, found 3 from rest on in dome.yaml {HINT}",
        ),
        (
            "push_only",
            [],
            calibration([-5.0, -4.0, -3.0, -2.0, -1.0]),
            f"expected a curve of 4 points or more, found 1 from rest on in dome.yaml {HINT}",
        ),
        (
            "push_only",
            [],
            calibration(values={"stroke_mm": {"value": 3.5}}),
            "expected bistable_stiffness_N_per_mm and stroke_mm beside the curve, "
            f"found not both in dome.yaml {HINT}",
        ),
        (
            "push_only",
            [],
            calibration(energy=(TRAVEL**2).tolist()),
            f"expected a curve with an inverted well, found none in dome.yaml {HINT}",
        ),
        (
            "push_only",
            [],
            calibration(energy=(-(TRAVEL**2)).tolist()),
            f"expected a curve with an inverted well, found none in dome.yaml {HINT}",
        ),
    ],
)
def test_what_a_law_lacks(problem, law, changes, dome, said):
    assert problem(law, *changes, dome=dome) == f"x.yaml:5:3: finger.law: {said}"


@pytest.mark.parametrize("law", ["3", "spline", "[tabulated]", "{}", "true"])
def test_what_is_no_law(problem, law):
    said = problem(law)
    assert said.startswith(
        'x.yaml:5:3: finger.law: expected "published", "tabulated" or "push_only", found '
    )
    assert not said.endswith("linear stiffness)")


@pytest.mark.parametrize("energy", [TRAVEL**2, -TRAVEL, TRAVEL**3 - 1e-3 * TRAVEL], ids=str)
@pytest.mark.parametrize("law", ["tabulated", "push_only"])
def test_a_table_without_a_second_well_is_refused(scene, law, energy):
    with pytest.raises(SpecError, match="expected a curve with an inverted well"):
        scene(law, dome=calibration(energy=energy.tolist()))


def test_a_calibration_in_the_spec_is_named_by_its_key(problem):
    inline = json.dumps(calibration(energy=(TRAVEL**2).tolist()))
    said = problem("tabulated", f"finger.calibration={inline}")
    assert "a curve with an inverted well, found none in finger.calibration" in said
