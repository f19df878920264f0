"""The laws of single springs: energy, force and stiffness of one spring, elementwise.

Every function takes arrays of any shape that broadcast, in any consistent units
(mm, N and mJ elsewhere in this package).
"""

from typing import NamedTuple

from dpgcli.arrays import Array


class SpringResponse(NamedTuple):
    """Energy, its first and its second derivative by the spring's own coordinate."""

    energy: Array
    force: Array
    stiffness: Array


def quadratic(coordinate: Array, stiffness: Array) -> SpringResponse:
    """Respond as a linear or torsional spring: E = ½ k q².

    >>> import numpy as np
    >>> quadratic(np.array(2.0), np.array(3.0))[:2]
    (np.float64(6.0), np.float64(6.0))
    """
    force = stiffness * coordinate
    return SpringResponse(0.5 * force * coordinate, force, stiffness)


def bistable(extension: Array, stiffness: Array, linearity: Array, stroke: Array) -> SpringResponse:
    """Respond as the study's bistable spring, E = ½ k_b x² [1 + (1−α)(x²/d² − 2x/d)].

    With u = x/d and β = 1−α, written so that nothing cancels near the wells:
    E = ½ k_b x² [α + β(1−u)²], F = k_b x [α + β(1−u)(1−2u)], K = k_b [1 + 6βu(u−1)].
    Published law; the brackets are read so that α = 1 is a linear spring.

    Parameters are the extension x (mm), k_b (N/mm), α (1) and the stroke d (mm);
    the response is in mJ, N and N/mm.

    >>> import numpy as np
    >>> well = bistable(np.array(3.5), np.array(12.84), np.array(0.043), np.array(3.5))
    >>> round(float(well.energy), 8)  # ½ α k_b d²
    3.381735
    """
    softening = 1.0 - linearity
    relative = extension / stroke
    remaining = 1.0 - relative
    pull = stiffness * extension
    return SpringResponse(
        0.5 * pull * extension * (linearity + softening * remaining * remaining),
        pull * (linearity + softening * remaining * (remaining - relative)),
        stiffness * (1.0 - 6.0 * softening * relative * remaining),
    )
