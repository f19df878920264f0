"""What a fit can be asked for; names only, so that a command line can offer them at once."""

from enum import StrEnum

STIFFNESS, LINEARITY, STROKE = LAW_KEYS = (
    "bistable_stiffness_N_per_mm",
    "force_linearity",
    "stroke_mm",
)

LEVER = "segment_height_mm"  # what is fitted to known states by default


class Loss(StrEnum):
    """How a residual counts: linear is plain least squares, the others limit outliers."""

    LINEAR = "linear"
    SOFT_L1 = "soft_l1"
    HUBER = "huber"
    CAUCHY = "cauchy"


class Quantity(StrEnum):
    """What the law is fitted to."""

    ENERGY = "energy"
    FORCE = "force"
    PRESSURE = "pressure"
    WORK = "work"


class Branches(StrEnum):
    """Which part of a record counts."""

    ALL = "all"
    QUASI_STATIC = "quasi-static"


class Rule(StrEnum):
    """How the opening follows from the travel."""

    EQUAL = "equal"
    PROPORTIONAL = "proportional"
    STROKE = "stroke"


class Method(StrEnum):
    """The way between geometries."""

    SCALING = "scaling"
    INTERPOLATION = "interpolation"


class Target(StrEnum):
    """What of known states is met."""

    TIPS = "tips"
    ANGLES = "angles"
