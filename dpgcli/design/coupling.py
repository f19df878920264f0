"""How hinges turn their neighbors: the coupling of a design, and what no finger can have.

With hinges of k_θ and the energy −κ θ θ' of neighbors, ½ k_θ Σ θ² − κ Σ θ θ' has no bottom in a
long finger where |κ| is half of k_θ or more.
"""

from collections.abc import Sequence

import numpy as np

from dpgcli.arrays import Array, Flags
from dpgcli.design.calibrations import Calibration
from dpgcli.design.dimensions import HINGE_COUPLING, Design, UnitGroup, unit_text
from dpgcli.design.fitted import from_file
from dpgcli.design.problems import Issue, Problems, number, of_design
from dpgcli.design.rules import COUPLING, Value, all_by
from dpgcli.design.scene import Origin


def coupling_of(
    design: Design,
    base: UnitGroup,
    hinges: Sequence[tuple[UnitGroup, Value]],
    problems: Problems,
) -> Value | None:
    """The coupling as it is given or fitted, None without one; problems beside the hinges."""
    value = _known(design, base, problems)
    if value is None:
        return None
    for group, hinge in hinges:
        _check(value, group, hinge, problems)
    return value


def is_bounded(coupling: Array, hinge_stiffness: Array) -> Flags:
    """Where hinges and their neighbors do not run away together: |κ| < k_θ/2, or no coupling.

    >>> is_bounded(np.array([0.0, -12.0, 12.1]), np.array([0.0, 24.2, 24.2])).tolist()
    [True, True, False]
    """
    size = np.abs(np.real(coupling))
    return np.asarray((size == 0.0) | (size < 0.5 * np.real(hinge_stiffness)))


def _known(design: Design, base: UnitGroup, problems: Problems) -> Value | None:
    if design.hinge_coupling is not None:
        return all_by(design.hinge_coupling, Origin.GIVEN, "as given")
    for place, calibration in enumerate(base.calibrations):
        if isinstance(calibration, Calibration) and calibration.has(HINGE_COUPLING):
            return from_file(COUPLING, base, calibration, place, problems)
    return None


def _check(coupling: Value, group: UnitGroup, hinge: Value, problems: Problems) -> None:
    def issue(design: int) -> Issue:
        least = number(0.5 * of_design(hinge.numbers, design))
        return Issue(
            ("finger", HINGE_COUPLING),
            f"less than half the hinge stiffness, {least} N mm/rad",
            number(of_design(coupling.numbers, design)),
            f"of units {unit_text(group.units)}: else the energy has no bottom",
        )

    problems.add(~is_bounded(coupling.numbers, hinge.numbers), issue)
