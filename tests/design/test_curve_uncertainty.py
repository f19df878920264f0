"""Errors of calibration files in the tips of fingers with a curve, or walls: files changed."""

from dataclasses import replace

import numpy as np
import pytest

from dpgcli.arrays import Array
from dpgcli.design.calibrations import PUBLISHED, Calibration, DomeCurve, Fitted
from dpgcli.design.dimensions import Design, GivenValues, Tolerance
from dpgcli.design.resolve import resolve
from dpgcli.design.scene import Scene
from dpgcli.errors import UsageError
from dpgcli.mechanics.terms import chain_potential
from dpgcli.states.plan import Request
from dpgcli.states.predict import predict
from dpgcli.states.settle import settle
from dpgcli.states.tip import tip
from dpgcli.states.units import UnitSolutions

STIFFNESS, STROKE = "bistable_stiffness_N_per_mm", "stroke_mm"
HINGE, WALL = "hinge_stiffness_N_mm_per_rad", "wall_compliance_mm_per_N"
SIZES = {
    "dome_height_mm": 6.5,
    "dome_thickness_mm": 0.75,
    "chamber_width_mm": 20.0,
    "chamber_length_mm": 9.0,
    "channel_width_mm": 10.0,
    "limiting_layer_thickness_mm": 1.5,
    "unit_separation_mm": 3.0,
    "elastic_modulus_MPa": 26.0,
}
GEOMETRY = {key: np.array([size]) for key, size in SIZES.items()}
PATTERNS = ("011", "100", "111")
UNCERTAIN = ("tip_x_uncertainty_mm", "tip_y_uncertainty_mm", "tip_angle_uncertainty_rad")
TRAVEL = np.linspace(0.0, 15.0, 121)
U = TRAVEL / 13.5
CURVE = DomeCurve(TRAVEL, 15.0 * (16.0 * U**2 * (1.0 - U) ** 2 + 0.3 * U**2), 0.25)
DOME = Calibration(
    "dome.yaml",
    {STIFFNESS: Fitted(14.0, 0.5), STROKE: Fitted(3.375, 0.05), HINGE: Fitted(24.0, 1.5)},
    SIZES,
    ((1.0, -0.6, 0.2), (-0.6, 1.0, 0.4), (0.2, 0.4, 1.0)),
    curve=CURVE,
)
OTHER_STROKE = Calibration("stroke.yaml", {STROKE: Fitted(3.1, 0.1)}, {})
OTHER_STIFFNESS = Calibration("push.yaml", {STIFFNESS: Fitted(13.0, 0.6)}, SIZES)
BASE = Design(
    3,
    GivenValues(GEOMETRY),
    calibrations=(DOME, PUBLISHED),
    linear_stiffness=np.array([1e4]),
)


def lattice(**values: float) -> GivenValues:
    return GivenValues(GEOMETRY, {key: np.array([value]) for key, value in values.items()})


HIGHER = GivenValues({**GEOMETRY, "dome_height_mm": np.array([7.0])})
DESIGNS = {
    "stroke given": replace(BASE, finger=lattice(stroke_mm=3.0)),
    "stiffness given": replace(BASE, finger=lattice(bistable_stiffness_N_per_mm=12.0)),
    "both given": replace(BASE, finger=lattice(stroke_mm=3.0, bistable_stiffness_N_per_mm=12.0)),
    "stroke of another file": replace(BASE, calibrations=(OTHER_STROKE, DOME, PUBLISHED)),
    "stiffness of another file": replace(BASE, calibrations=(OTHER_STIFFNESS, DOME, PUBLISHED)),
    "stiffness published": replace(BASE, calibrations=(PUBLISHED, DOME)),
    "both of the file": BASE,
    "both scaled": replace(BASE, finger=HIGHER),
    "scaled, stroke given": replace(
        BASE, finger=replace(HIGHER, lattice={STROKE: np.array([3.2])})
    ),
    "stroke given of one unit": replace(
        BASE, overrides={"2": GivenValues(lattice={STROKE: np.array([3.0])})}
    ),
    "one unit scaled": replace(
        BASE, overrides={"1": GivenValues({"dome_height_mm": np.array([6.8])})}
    ),
    "walls": replace(
        BASE, finger=lattice(bistable_stiffness_N_per_mm=12.0, wall_compliance_mm_per_N=0.004)
    ),
}
LAWS = pytest.mark.parametrize("law", ["tabulated", "push_only"])


def poses(scene: Scene) -> Array:
    """Tips of the patterns, solved anew, (3, pattern)."""
    inverted = np.array([[digit == "1" for digit in pattern] for pattern in PATTERNS]).T
    settled = settle(UnitSolutions.of(scene.finger), chain_potential, inverted, 1e-13)
    return tip(settled, with_compliance=False).pose


def with_value(design: Design, file: Calibration, key: str, value: float) -> Design:
    """The design with a file that says another value, as if it had been edited."""
    values = {**file.values, key: file.values[key]._replace(value=value)}
    edited = replace(file, values=values)
    return replace(
        design, calibrations=tuple(edited if c is file else c for c in design.calibrations)
    )


def slope(design: Design, file: Calibration, key: str) -> Array:
    """Change of tips by one standard error of a file's value, by fourth-order differences."""
    value, error = file.values[key]
    assert error is not None

    def at(share: float) -> Array:
        return poses(resolve(with_value(design, file, key, value + share * error)).scene())

    return (8.0 * (at(0.01) - at(-0.01)) - (at(0.02) - at(-0.02))) / 0.12


def by_edited_files(design: Design) -> Array:
    """Standard uncertainties by finite changes of all values of all files, (3, pattern)."""
    variance = np.zeros((3, len(PATTERNS)))
    for file in design.calibrations:
        if not isinstance(file, Calibration):
            continue
        slopes = np.array([slope(design, file, key) for key in file.values])
        correlation = np.eye(len(slopes)) if file.correlation is None else file.correlation
        variance += np.einsum("i...,ij,j...->...", slopes, np.array(correlation), slopes)
    return np.sqrt(np.maximum(variance, 0.0))


def stated(design: Design) -> Array:
    """What `predict` says, (3, pattern)."""
    request = Request(patterns=PATTERNS, columns=("pattern", "uncertainty"))
    rows = predict(resolve(design).scene(), request).arrays()
    assert rows["pattern"].tolist() == [*PATTERNS]
    return np.stack([rows[name] for name in UNCERTAIN])


@LAWS
@pytest.mark.parametrize("name", DESIGNS)
def test_it_is_what_files_do_whose_values_are_changed(law: str, name: str) -> None:
    """As far as the curve's bends, which are piecewise straight, let differences be exact."""
    design = replace(DESIGNS[name], law=law)
    truth = by_edited_files(design)
    assert truth.max() > 1e-3
    assert stated(design) == pytest.approx(truth, rel=1e-5, abs=1e-9)


@pytest.mark.parametrize(
    ("law", "name", "counts"),
    [
        ("tabulated", "stroke given", True),
        ("tabulated", "both of the file", False),
        ("tabulated", "both scaled", False),
        ("push_only", "stroke given", False),
        ("push_only", "stiffness given", True),
    ],
)
def test_where_nothing_else_has_an_error(law: str, name: str, counts: bool) -> None:
    """Of the curve's own file; where its values are the finger's, no change of them does."""
    bare = replace(DOME, values={k: v for k, v in DOME.values.items() if k != HINGE})
    design = replace(DESIGNS[name], law=law, calibrations=(bare, PUBLISHED))
    at = poses(resolve(design).scene())
    edited = replace(bare, values={STIFFNESS: Fitted(15.0, 0.5), STROKE: Fitted(3.5, 0.05)})
    changed = replace(design, calibrations=(edited, PUBLISHED))
    moves = np.abs(poses(resolve(changed).scene()) - at).max() > 1e-9
    assert moves == counts
    assert (resolve(design).scene().uncertainty is not None) == counts


def test_where_all_errors_cancel_that_is_said() -> None:
    bare = replace(DOME, values={k: v for k, v in DOME.values.items() if k != HINGE})
    design = replace(BASE, law="tabulated", calibrations=(bare, PUBLISHED))
    said = f"no value of the spec has a standard error but {STROKE} and {STIFFNESS}: it cancels"
    with pytest.raises(UsageError, match=said):
        stated(design)
    silent = {key: Fitted(fitted.value) for key, fitted in bare.values.items()}
    without = replace(design, calibrations=(replace(bare, values=silent), PUBLISHED))
    with pytest.raises(UsageError, match="has a standard error; calibrate it"):
        stated(without)


@pytest.mark.slow
def test_it_is_the_scatter_of_files_that_are_drawn() -> None:
    """Strokes of two files and k_b, 200 drawn: a standard deviation is known to 5 %."""
    design = replace(DESIGNS["stroke of another file"], law="tabulated")
    random = np.random.default_rng(3)
    drawn = []
    for _ in range(200):
        changed = design
        errors = np.linalg.cholesky(DOME.correlation) @ random.normal(size=3)
        files = ((OTHER_STROKE, random.normal(size=1)), (DOME, errors))
        for file, off in files:
            edited = {
                key: fitted._replace(value=fitted.value + of * (fitted.standard_error or 0.0))
                for (key, fitted), of in zip(file.values.items(), off, strict=True)
            }
            other = replace(file, values=edited)
            calibrations = tuple(other if c is file else c for c in changed.calibrations)
            changed = replace(changed, calibrations=calibrations)
        drawn.append(poses(resolve(changed).scene()))
    assert stated(design) == pytest.approx(np.std(drawn, axis=0), rel=0.15)


def walled(fitted: Fitted, own: float | None, law: str | None = None) -> Design:
    """A finger whose walls' compliance comes from a file, but for that of the second unit."""
    file = Calibration("wall.yaml", {WALL: fitted}, {})
    given = {} if own is None else {"2": GivenValues(lattice={WALL: np.array([own])})}
    calibrations = (
        file,
        replace(DOME, values={k: Fitted(v.value) for k, v in DOME.values.items()}),
    )
    return replace(
        BASE,
        calibrations=(*calibrations, PUBLISHED),
        law=law,
        overrides=given,
    )


def by_walls(design: Design, units: tuple[int, ...], error: float) -> Array:
    """Changes of tips by those of the walls of some units, (3, pattern): differences, one-sided."""
    finger = resolve(design).scene().finger
    start = np.broadcast_to(finger.wall_compliance, (3, 1))

    def at(step: float) -> Array:
        more = np.zeros((3, 1))
        more[[unit - 1 for unit in units]] = step
        scene = Scene(finger.changed(wall_compliance=start + more), ())
        return poses(scene)

    h = 1e-6
    return np.asarray(error * np.abs(4.0 * at(h) - 3.0 * at(0.0) - at(2.0 * h)) / (2.0 * h))


@pytest.mark.parametrize(
    ("law", "own", "value"),
    [
        (None, 0.003, 0.0),
        (None, 0.0, 0.1),
        ("tabulated", None, 0.002),
        ("tabulated", 0.0, 0.0),
        ("tabulated", 0.003, 0.1),
        ("push_only", None, 0.0),
        ("push_only", 0.003, 0.002),
    ],
)
def test_walls_errors_reach_the_tips(law: str | None, own: float | None, value: float) -> None:
    """Rigid walls too: √(c k_b) has no slope there, what a wall yields has."""
    design = walled(Fitted(value, 5e-4), own, law=law)
    units = (1, 2, 3) if own is None else (1, 3)
    truth = by_walls(design, units, 5e-4)
    assert truth.max() > 1e-4
    assert stated(design) == pytest.approx(truth, rel=1e-4, abs=1e-9)


@pytest.mark.parametrize("value", [0.0, 0.002])
def test_walls_tolerances_reach_the_tips(value: float) -> None:
    """In all units, those whose walls are given as rigid among them."""
    tolerance = Tolerance(2e-4, False)
    for design in (
        replace(BASE, finger=lattice(wall_compliance_mm_per_N=value)),
        walled(Fitted(value), 0.0),
    ):
        bare = replace(design, calibrations=(PUBLISHED,)) if not design.overrides else design
        tolerated = replace(bare, tolerances={WALL: tolerance})
        truth = by_walls(bare, (1, 2, 3), tolerance.size)
        assert stated(tolerated) == pytest.approx(truth, rel=1e-4, abs=1e-9)


def test_a_tolerance_of_walls_that_nobody_names_is_a_problem() -> None:
    design = replace(BASE, calibrations=(PUBLISHED,), tolerances={WALL: Tolerance(1e-3, False)})
    (issue,) = resolve(design).problems.of(0)
    assert issue.statement.endswith(
        "(walls are rigid: give finger.wall_compliance_mm_per_N, 0 perhaps)"
    )


def test_what_is_known_of_the_model_is_so_with_a_tolerance_of_rigid_walls() -> None:
    rigid = replace(BASE, calibrations=(PUBLISHED,), finger=lattice(wall_compliance_mm_per_N=0.0))
    tolerated = replace(rigid, tolerances={WALL: Tolerance(1e-3, False)})
    assert resolve(tolerated).model_error == resolve(rigid).model_error
