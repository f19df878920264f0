"""Whether the shape that a way ends in is a stable state, or an equilibrium under its pressures."""

from dpgcli.actuation.pressed import LARGEST_RESIDUAL, Pressed, Shapes
from dpgcli.actuation.readings import Readings
from dpgcli.actuation.rest import at_rest, is_same
from dpgcli.mechanics.finger import Finger
from dpgcli.records import dataclass
from dpgcli.states.certify import MARGINAL_CURVATURE, Status
from dpgcli.states.solved import ALONE


@dataclass(frozen=True)
class Certificate:
    """What is known of a shape: whether it is certified, and that in words.

    `residual` is the largest unbalanced force, N; `pivot` the smallest of the Hessian, scaled.
    """

    is_certified: bool
    text: str
    residual: float
    pivot: float


def certificate(pressed: Pressed, shapes: Shapes) -> Certificate:
    """Certify one shape: without pressure beside the stable state of its pattern.

    Under pressure there is no such state to compare with: residual and curvature count.

    >>> import numpy as np
    >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
    >>> from dpgcli.mechanics.pressure import DomeVolumes
    >>> from dpgcli.states.units import UnitSolutions
    >>> units = UnitSolutions.of(uniform_finger(2, **STUDY))
    >>> pressed = Pressed(units, DomeVolumes(np.array([[31.61]])))
    >>> shapes, _ = at_rest(pressed, np.array([[True], [False]]))
    >>> certificate(pressed, shapes).text
    'certified: the stable state of its pattern'
    """
    balance = Readings(pressed, shapes, ALONE).balance
    residual, pivot = float(balance.residual[0]), float(balance.curvature[0])
    is_balanced = float(balance.relative_residual[0]) <= LARGEST_RESIDUAL
    is_sound, text = is_balanced and pivot > MARGINAL_CURVATURE, _under_pressure(is_balanced, pivot)
    if not shapes.pressure.any():
        state, settled = at_rest(pressed, shapes.inverted)
        status = Status(settled.status[0])
        is_that = bool(is_same(pressed, shapes, state)[0])
        is_sound = is_sound and is_that and status is Status.STABLE
        text = _at_rest(status, pressed.finger, is_that=is_that)
    return Certificate(is_sound, text, residual, pivot)


def _under_pressure(is_balanced: bool, pivot: float) -> str:
    if not is_balanced:
        return "not certified: forces are left"
    if pivot <= MARGINAL_CURVATURE:
        return "not certified: at a fold, where it is about to lose its balance"
    return "certified: a stable equilibrium under its pressures"


def _at_rest(status: Status, finger: Finger, *, is_that: bool) -> str:
    if status is not Status.STABLE:
        return f"not certified: {status.text}, {status.meaning_for(finger)}"
    if not is_that:
        return "not certified: another shape than the stable state of its pattern"
    return "certified: the stable state of its pattern"
