"""`pulses` and `lookup`: replays, reasons, heights that lead there, scatter, refusals."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dpgcli as dpg
from dpgcli.api.pulses import PulsesResult
from dpgcli.api.scatter import share_interval, spread_of
from dpgcli.design.dimensions import Tolerance
from dpgcli.errors import ActuationError, DpgError, SpecError, UsageError
from dpgcli.mechanics.finger import STUDY, uniform_finger

pytestmark = pytest.mark.slow

CONFIGS = Path(__file__).parents[2] / "configs"
GRADED, UNIFORM, EIGHT = (
    CONFIGS / f"{name}.yaml" for name in ("graded_five_unit", "five_unit", "eight_unit")
)
FITTED = {"finger.calibration": "finite_elements", "finger.law": "push_only"}
COLUMNS = [
    *("pulse", "line", "peak_pressure_MPa", "margin_MPa", "pattern_before", "pattern_at_peak"),
    *("pattern_after", "tie"),
]
SCATTER_COLUMNS = [
    *("probability", "probability_low", "probability_high", "window_from_MPa", "window_to_MPa"),
]
SCATTER = "dome_thickness_mm=1%,dome_height_mm=0.05mm"


@pytest.mark.parametrize("settings", [{}, FITTED], ids=["published", "push_only"])
@pytest.mark.parametrize("end", ["11100", "11111", "00011"])
def test_what_pulses_says_actuate_does(settings: dict[str, str], end: str) -> None:
    """Each row in turn: up to the peak, where the pattern is as printed, and back."""
    found = dpg.pulses(GRADED, end=end, settings=settings).table
    assert list(found.names) == COLUMNS
    history = [0.0]
    for peak in found["peak_pressure_MPa"]:
        history += [float(peak), 0.0]
    way = dpg.actuate(GRADED, pressure=history, settings=settings)
    assert way.pattern == end == found["pattern_after"][-1]
    steps, patterns = way.path["history_step"], way.path["pattern"]
    for k, peak in enumerate(found["pattern_at_peak"]):
        assert patterns[steps == 2 * k + 2][-1] == peak
        assert patterns[steps == 2 * k + 3][-1] == found["pattern_after"][k]
    assert found["pattern_before"].tolist() == ["0" * 5, *found["pattern_after"][:-1]]
    assert (found["margin_MPa"] > 0.0).all()


def test_ties_are_said_group_by_group() -> None:
    found = dpg.pulses(GRADED, end="00011")
    assert found.table["tie"].tolist() == ["1,2,3; 4,5", "1,2,3"]
    assert any(line.startswith("ties in pulses 1 and 2") for line in found.summary)


def test_two_lines_take_a_pulse_each() -> None:
    settings = {"pressure.lines": {"A": "1-2", "B": "3-5"}}
    found = dpg.pulses(UNIFORM, end="00111", settings=settings).table
    assert found["line"].tolist() == ["B"]
    both = dpg.pulses(UNIFORM, end="11111", settings=settings).table
    assert sorted(both["line"]) == ["A", "B"]


def test_other_states_to_start_from() -> None:
    found = dpg.pulses(GRADED, end="11100", start="11111").table
    assert found["pattern_before"].tolist() == ["11111", "00000"]
    none = dpg.pulses(GRADED, end="11100", start="11100")
    assert none.exists
    assert len(none.table) == 0
    assert none.summary[0] == "11100 is the state to start from: no pulse is needed"


@pytest.fixture(scope="module")
def missed() -> PulsesResult:
    """Equal units on one line."""
    return dpg.pulses(UNIFORM, end="10110")


def test_why_there_are_no_pulses(missed: PulsesResult) -> None:
    assert not missed.exists
    assert len(missed.table) == 0
    assert list(missed.table.names) == COLUMNS
    order, tie = missed.reasons[:2]
    assert order == (
        "line A: each of units 1,3-4 must snap before each of units 2,5, or reset after that"
    )
    assert tie.startswith("units 1 and 2 are a tie: both snap at 0.1495 MPa, reset at -0.064995")


def test_the_nearest_heights_lead_there_in_a_spec_that_has_them(missed: PulsesResult) -> None:
    """No height moves further than half of what keeps thresholds 5 % apart, p ~ h^1.2."""
    heights = missed.heights
    overrides = {
        str(unit): {"geometry": {"dome_height_mm": height}}
        for unit, height in enumerate(heights, start=1)
    }
    found = dpg.pulses(UNIFORM, end="10110", settings={"finger.overrides": overrides})
    assert found.table["pattern_after"].tolist() == ["10110"]
    assert missed.graded is not None
    assert missed.graded.sequence is not None
    assert missed.graded.sequence.pulses is not None
    assert found.table["peak_pressure_MPa"][0] == missed.graded.sequence.pulses[0].peak
    low, high = (np.array(heights)[[unit == bit for unit in "10110"]] for bit in "10")
    assert low.max() < 6.5 < high.min()
    assert (high.min() / low.max()) ** 1.2 == pytest.approx(1.05, abs=0.004)


def test_heights_that_are_changed_least_take_a_pulse_down_where_that_is_nearer() -> None:
    """On the graded finger 4 must snap before 2: they swap nothing, but 2 resets before it."""
    found = dpg.pulses(GRADED, end="10110")
    assert found.graded is not None
    assert found.graded.holds
    assert np.abs(np.array(found.heights) - [6.5, 6.5, 6.5, 7.5, 7.5]).max() < 0.4


def test_heights_of_a_finger_without_domes_are_not_known() -> None:
    found = dpg.pulses(EIGHT, end="10000000")
    assert found.heights == ()
    assert found.reasons[-1].startswith("which dome heights would is not known")
    value = dpg.pulses(UNIFORM, end="10000", settings={"pressure": {"lines": {"A": "1-5"}}})
    assert value.heights


def test_a_pattern_that_is_no_state_says_so() -> None:
    found = dpg.pulses(UNIFORM, end="11111", settings={"finger.lattice.force_linearity": 0.3})
    assert not found.exists
    assert found.reasons[0].startswith("11111 is no stable state")


def test_a_look_up_table_leads_on() -> None:
    """Each interval's middle, as a history: where it says."""
    found = dpg.lookup(GRADED, start="11100").table
    assert list(found.names) == [
        *("line", "direction", "from_MPa", "to_MPa", "pattern_at_peak", "pattern_after"),
    ]
    assert found["direction"].tolist() == ["+", "+", "-", "-"]
    for low, high, peak, after in zip(
        found["from_MPa"], found["to_MPa"], found["pattern_at_peak"], found["pattern_after"],
        strict=True,
    ):  # fmt: skip
        middle = 0.5 * float(low + high)
        assert dpg.actuate(GRADED, pressure=[0.0, middle], start="11100").pattern == peak
        assert dpg.actuate(GRADED, pressure=[0.0, middle, 0.0], start="11100").pattern == after


@pytest.fixture(scope="module")
def scattered() -> PulsesResult:
    """The study's intermediate state, with little scatter."""
    return dpg.pulses(GRADED, end="11100", scatter=SCATTER, draws=300)


def test_scatter_adds_columns(scattered: PulsesResult) -> None:
    table = scattered.table
    assert list(table.names) == [*COLUMNS, *SCATTER_COLUMNS]
    assert scattered.scattered is not None
    assert table["probability"][-1] == scattered.scattered.probability
    assert 0.95 < table["probability"][0] < 1.0
    low, high = table["window_from_MPa"][0], table["window_to_MPa"][0]
    assert 0.1495 < low < table["peak_pressure_MPa"][0] < high < 0.1775
    assert any("300 fingers drawn, seed 1: normal" in line for line in scattered.summary)


def test_the_same_seed_draws_the_same(scattered: PulsesResult) -> None:
    spread = {"dome_height_mm": 0.05, "dome_thickness_mm": "1 %"}
    again = dpg.pulses(GRADED, end="11100", scatter=spread, draws=300)
    other = dpg.pulses(GRADED, end="11100", scatter=spread, draws=300, seed=2)
    for name in SCATTER_COLUMNS:
        assert again.table[name].tolist() == scattered.table[name].tolist()
    assert other.table["window_from_MPa"][0] != again.table["window_from_MPa"][0]


@pytest.mark.parametrize("pressure", [{"effective_area_mm2": 31.61}, {"snap_pressure_MPa": 0.1495}])
def test_a_probability_by_a_closed_form(pressure: dict[str, float]) -> None:
    """One unit, its area fixed: it snaps below the peak if its force does, nearly as k_b goes.

    Hinges yield little: at 2 % of k_b the peak 10 % above is 5 deviations away, at 10 % one.
    """
    finger = {
        "units": 1,
        "linear_stiffness_N_per_mm": float("inf"),
        "lattice": {f"{name}": value for name, value in LATTICE.items()},
    }
    spec = {"finger": finger, "pressure": pressure}
    key = "bistable_stiffness_N_per_mm"
    found = dpg.pulses(spec, end="1", scatter={key: "10%"}, draws=4000)
    assert found.scattered is not None
    low, high = found.scattered.interval
    domes = 12.84 / snap_share()
    expected = normal(domes)
    assert low < expected < high
    sure = dpg.pulses(spec, end="1", scatter={key: "1%"}, draws=1000)
    assert sure.scattered is not None
    assert sure.scattered.probability == 1.0


LATTICE = {
    "segment_length_mm": 13.5,
    "segment_height_mm": 10.75,
    "stroke_mm": 3.5,
    "bistable_stiffness_N_per_mm": 12.84,
    "force_linearity": 0.043,
    "hinge_stiffness_N_mm_per_rad": 24.2,
}


def snap_share() -> float:
    """By how much k_b has to rise for the snap force to rise by 10 %, as a share of k_b, inverse.

    F(k_b) is linear in k_b but for the hinge; its slope by two fingers.
    """
    from dpgcli.states.wells import inverted_wells

    forces = [
        float(
            inverted_wells(uniform_finger(1, **{**STUDY, "bistable_stiffness": k})).snap_force[0, 0]
        )
        for k in (12.84, 14.124)
    ]
    return 12.84 * (forces[1] / forces[0] - 1.0) / 0.1


def normal(ratio: float) -> float:
    """The probability that a normal deviate lies below 10 % over 10 %, times that ratio."""
    from math import erf, sqrt

    return 0.5 * (1.0 + erf(ratio / sqrt(2.0)))


def test_shares_have_the_confidence_interval_of_clopper_and_pearson() -> None:
    """Tails of binomials: 2.5 % each."""
    from math import comb

    low, high = share_interval(7, 20)
    above = sum(comb(20, k) * low**k * (1 - low) ** (20 - k) for k in range(7, 21))
    below = sum(comb(20, k) * high**k * (1 - high) ** (20 - k) for k in range(8))
    assert above == pytest.approx(0.025, rel=1e-9)
    assert below == pytest.approx(0.025, rel=1e-9)
    assert share_interval(0, 20)[0] == 0.0
    assert share_interval(20, 20)[1] == 1.0


def test_scatter_is_read_as_tolerances_are() -> None:
    texts = ("stroke_mm=2%", "stroke_mm = 0.1 mm", "stroke_mm=0.1", "elastic_modulus_MPa=1MPa")
    sizes = [next(iter(spread_of(text).values())) for text in texts]
    assert sizes == [
        Tolerance(0.02, True), Tolerance(0.1, False), Tolerance(0.1, False), Tolerance(1.0, False),
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("scatter", "message"),
    [
        ("dome_hight_mm=1%", "did you mean dome_height_mm?"),
        ("base_spacing_mm=1", "it moves no threshold"),
        ("dome_height_mm=1%,dome_height_mm=2%", "expected each key once"),
        ("dome_height_mm", "expected a percentage such as 2%, or a number in mm, found nothing"),
        ("dome_height_mm=1kN", 'found "1kN"'),
        ("dome_height_mm=-1", 'found "-1" (at least 0)'),
        ("dome_height_mm=nan", 'found "nan"'),
        ("dome_height_mm=101%", 'found "101%" (at most 100%)'),
        ("dome_height_mm=2e12mm", 'found "2e12mm" (at most 1e+12 in size)'),
        ("dome_height_mm=9", "expected less than 6.5, the value, found 9 mm"),
        ("wall_compliance_mm_per_N=2%", "walls are rigid"),
        ("=2%", "expected a key of the finger that scatters"),
    ],
)
def test_wrong_scatter_is_refused(scatter: str, message: str) -> None:
    with pytest.raises(SpecError) as caught:
        dpg.pulses(GRADED, end="11100", scatter=scatter)
    assert message in str(caught.value)
    assert str(caught.value).startswith("scatter: ")


def test_all_problems_of_scatter_come_at_once() -> None:
    with pytest.raises(SpecError) as caught:
        dpg.pulses(GRADED, end="11100", scatter="a=1,dome_height_mm=x,b=2%")
    assert len(caught.value.problems) == 3


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"end": "10"}, "end 10: expected 5 digits, 0 or 1"),
        ({"end": "1x1x1"}, "end 1x1x1: expected 5 digits"),
        ({"end": "11100", "start": "111000"}, "start 111000: expected 5 digits"),
        ({"end": "11100", "scatter": SCATTER, "draws": 0}, "draws 0: expected 1 to 100,000"),
        ({"end": "11100", "scatter": SCATTER, "draws": 1.5}, "draws 1.5: expected a whole number"),
        ({"end": "11100", "scatter": SCATTER, "draws": 100_001}, "expected 1 to 100,000"),
        (
            {"end": "11100", "scatter": SCATTER, "seed": -1},
            "seed -1: expected a whole number from 0 on",
        ),
        ({"end": "11100", "scatter": ""}, "scatter: expected KEY=SIZE"),
        ({"end": "11100", "scatter": 5}, "scatter 5: expected a text"),
        ({"end": "11100", "draws": 5}, "draws goes with scatter"),
        ({"end": 11100}, "end 11100: expected a text"),
        (
            {"end": "0" * 5, "start": "11111", "settings": {"finger.lattice.force_linearity": 0.3}},
            "start 11111: expected a stable state",
        ),
    ],
)
def test_wrong_choices_are_refused(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(UsageError) as caught:
        dpg.pulses(GRADED, **arguments)
    assert message in str(caught.value)


def test_values_without_a_spec_have_no_scatter() -> None:
    from dpgcli.files.scene_file import read_spec, scene_of

    scene = scene_of(read_spec(GRADED, ["pressure={}"]))
    assert dpg.pulses(scene, end="11100").exists
    with pytest.raises(UsageError, match="scatter changes a spec"):
        dpg.pulses(scene, end="11100", scatter="stroke_mm=1%")
    missed = dpg.pulses(scene, end="10110")
    assert missed.reasons[-1].startswith("which dome heights would is not known")


def test_draws_none_of_which_is_a_finger_say_why() -> None:
    """Heights that are hardly more than the separation, and some of them less, which no dome is."""
    spec = {"finger.geometry.dome_height_mm": 3.001, "finger.overrides": None}
    with pytest.raises(UsageError, match="no draw is a finger: their values are impossible"):
        dpg.pulses(GRADED, end="11111", scatter="dome_height_mm=3mm", settings=spec, draws=1)


def test_too_many_units_are_refused() -> None:
    settings = {"finger.units": 17}
    with pytest.raises(UsageError, match="at most 16"):
        dpg.pulses(EIGHT, end="1" * 17, settings=settings)


def test_a_replay_that_does_not_hold_is_no_result(monkeypatch: pytest.MonkeyPatch) -> None:
    """As if the graph had been wrong: another peak than the one that leads there."""
    from dpgcli.actuation import sequences

    def wrong(*arguments: Any) -> Any:
        (pulse,) = shortest(*arguments)
        return (type(pulse)(**{**vars(pulse), "peak": 2.0 * pulse.peak}),)

    shortest = sequences.shortest
    monkeypatch.setattr(sequences, "shortest", wrong)
    with pytest.raises(ActuationError, match="does not hold: pulse 1 ends in 11111") as caught:
        dpg.pulses(GRADED, end="11100")
    assert isinstance(caught.value, DpgError)
