"""Options of fits, by name; imports nothing heavy, so that `--help` stays fast."""

from enum import StrEnum

STIFFNESS, LINEARITY, STROKE = LAW_KEYS = (
    "bistable_stiffness_N_per_mm",
    "force_linearity",
    "stroke_mm",
)

MOST_RESAMPLES = 100_000  # of a bootstrap: minutes
HINGES = "hinge_stiffness_N_mm_per_rad"
WALLS = "wall_compliance_mm_per_N"
COUPLING = "hinge_coupling_N_mm_per_rad"
LEVER = "segment_height_mm"
FITTED_BY_DEFAULT = LEVER  # what is fitted to known states if nothing is named


class Loss(StrEnum):
    """Loss functions: linear is plain least squares, the others limit outliers."""

    LINEAR = "linear"
    SOFT_L1 = "soft_l1"
    HUBER = "huber"
    CAUCHY = "cauchy"


class CurveQuantity(StrEnum):
    """The measured quantity that a bistable law is fitted to."""

    ENERGY = "energy"
    FORCE = "force"
    PRESSURE = "pressure"
    WORK = "work"


class Branches(StrEnum):
    """The part of a record that is fitted: both ways of the travel, one of them, or slow pieces."""

    BOTH = "both"
    LOADING = "loading"
    UNLOADING = "unloading"
    QUASI_STATIC = "quasi-static"


class Rule(StrEnum):
    """The mapping from a dome's travel to its opening."""

    EQUAL = "equal"
    PROPORTIONAL = "proportional"
    STROKE = "stroke"


class GridMethod(StrEnum):
    """The method between the geometries of a grid."""

    SCALING = "scaling"
    INTERPOLATION = "interpolation"


class Target(StrEnum):
    """The quantity of known states that a finger is fitted to."""

    TIPS = "tips"
    ANGLES = "angles"
    OPENINGS = "openings"
    PUSHES = "pushes"
