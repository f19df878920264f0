"""The laws of single springs: energy, force and stiffness of one spring, elementwise.

Every function takes arrays of any shape that broadcast, in any consistent units
(mm, N and mJ elsewhere in this package). A dome answers by one of three laws: the study's,
a tabulated one, or either of them where the dome pushes but never pulls.
"""

from typing import NamedTuple, Protocol

import numpy as np

from dpgcli.arrays import Array, Flags
from dpgcli.equilibrium.contracts import Response
from dpgcli.mechanics.curve import Curve


def quadratic(coordinate: Array, stiffness: Array) -> Response:
    """Respond as a linear or torsional spring: E = ½ k q².

    >>> import numpy as np
    >>> quadratic(np.array(2.0), np.array(3.0))[:2]
    (np.float64(6.0), np.float64(6.0))
    """
    force = stiffness * coordinate
    return Response(0.5 * force * coordinate, force, stiffness)


def bistable(extension: Array, stiffness: Array, linearity: Array, stroke: Array) -> Response:
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
    return Response(
        0.5 * pull * extension * (linearity + softening * remaining * remaining),
        pull * (linearity + softening * remaining * (remaining - relative)),
        stiffness * (1.0 - 6.0 * softening * relative * remaining),
    )


class Dome(NamedTuple):
    """The constants of the domes, arrays that broadcast.

    `stiffness` k_b at rest (N/mm), `linearity` α (1), `stroke` d (mm) and `contact` c (mm), the
    travel of the dome's pole at which it touches its neighbor in the straight finger; 0 where
    the opening stands for the travel.
    """

    stiffness: Array
    linearity: Array
    stroke: Array
    contact: Array


class Rests(NamedTuple):
    """Extensions (mm) at which an inverted dome exerts no force: barrier top and well.

    NaN where there is no inverted well.
    """

    top: Array
    well: Array


class Touching(NamedTuple):
    """Extensions (mm) between which a dome acts; infinite where it does at any."""

    lowest: Array
    highest: Array


class Attached:
    """What a dome that pushes and pulls has in common: it acts in any state, at any extension."""

    def acting(self, inverted: Flags) -> Array:
        """1."""
        return np.ones((1, 1))

    def touching(self, dome: Dome) -> Touching:
        """Everywhere."""
        everywhere = np.full_like(np.real(dome.stroke), np.inf)
        return Touching(-everywhere, everywhere)


class Law(Protocol):
    """How a dome answers to the extension of its spring."""

    @property
    def description(self) -> str:
        """What tables and summaries say stiffness figures come from."""

    @property
    def curve(self) -> Curve | None:
        """The table behind the law; none where the study's polynomial is."""

    def response(self, extension: Array, dome: Dome) -> Response:
        """Energy (mJ), force (N) and stiffness (N/mm) at an extension (mm)."""

    def rests(self, dome: Dome) -> Rests:
        """Where the spring alone is at rest when inverted."""

    def acting(self, inverted: Flags) -> Array:
        """1 where a dome acts on its neighbor, else 0; (1, 1) where it does in any state."""

    def touching(self, dome: Dome) -> Touching:
        """Between which extensions (mm) a dome acts."""


class Published(Attached):
    """The study's law, `bistable`: the spring pushes and pulls."""

    description = "published law, pushing and pulling"
    curve = None

    def response(self, extension: Array, dome: Dome) -> Response:
        """The study's polynomial."""
        return bistable(extension, dome.stiffness, dome.linearity, dome.stroke)

    def rests(self, dome: Dome) -> Rests:
        """u = [3β ± √(9β² − 8β)]/(4β) with β = 1 − α, for α < 1/9."""
        beta = 1.0 - dome.linearity
        squared = 9.0 * beta * beta - 8.0 * beta
        is_bistable = np.real(squared) > 0.0
        root = np.sqrt(np.where(is_bistable, squared, np.nan))
        quarter = dome.stroke / np.where(is_bistable, 4.0 * beta, 1.0)
        return Rests((3.0 * beta - root) * quarter, (3.0 * beta + root) * quarter)


class Tabulated(Attached):
    """A law from a curve: E = k_b D² ê((x + c)/D) with D = d + c (our normalization).

    The dimensionless ê is a twice continuously differentiable spline through calibrated points.
    """

    description = "tabulated law, pushing and pulling"

    def __init__(self, curve: Curve) -> None:
        self.curve = curve

    def response(self, extension: Array, dome: Dome) -> Response:
        """The spline and its derivatives, in mm and N."""
        travel = dome.stroke + dome.contact
        energy, slope, bend = self.curve((extension + dome.contact) / travel)
        force = dome.stiffness * travel
        return Response(force * travel * energy, force * slope, dome.stiffness * bend)

    def rests(self, dome: Dome) -> Rests:
        """Those of the curve."""
        travel = dome.stroke + dome.contact
        top, well = (np.asarray(rest * travel - dome.contact) for rest in self.curve.rests)
        return Rests(top, well)


class PushOnly:
    """A dome that pushes its neighbor but never pulls it: F = min(0, E') between its rests.

    Outside them dome and neighbor do not touch, the energy is constant there. So it is where a
    curve with ripples would pull, from a lesser well to the next top: the dome stays in that well.
    Only inverted domes act: which those are is a state of contact, given beside the energy.
    """

    def __init__(self, law: Published | Tabulated) -> None:
        self.law = law
        self.curve = law.curve

    @property
    def description(self) -> str:
        """What the dome's own energy comes from."""
        energy = self.law.description.split(" law")[0]
        return f"push-only law, {energy} energy of the dome"

    def response(self, extension: Array, dome: Dome) -> Response:
        """The law's own response where dome and neighbor touch."""
        top, well = self.law.rests(dome)
        place = np.real(extension)
        touches = (place > np.real(top)) & (place < np.real(well))
        apart = np.where(place < np.real(well), top, well)
        apart = np.where(np.isnan(apart), 0.0, apart)  # never inverted: never in touch
        travel = dome.stroke + dome.contact
        for ripple in self.curve.ripples if self.curve is not None else ():
            lower, upper = (rest * travel - dome.contact for rest in ripple)
            lets_go = (place > np.real(lower)) & (place < np.real(upper))
            touches, apart = touches & ~lets_go, np.where(lets_go, lower, apart)
        energy, *derivatives = self.law.response(np.where(touches, extension, apart), dome)
        force, stiffness = (np.where(touches, values, 0.0) for values in derivatives)
        return Response(energy, force, stiffness)

    def rests(self, dome: Dome) -> Rests:
        """Those of the dome itself."""
        return self.law.rests(dome)

    def acting(self, inverted: Flags) -> Array:
        """1 where a dome is inverted."""
        return inverted.astype(float)

    def touching(self, dome: Dome) -> Touching:
        """From the top of its barrier to its well; nowhere if it has none."""
        top, well = self.law.rests(dome)
        return Touching(top, well)


class Held(Attached):
    """A dome held about some opening: a linear spring that rests at `linearity` strokes.

    No dome does that; a search that holds domes open until bars and hinges have settled, and
    then lets go, finds wells that the domes' own softening would let it miss.
    """

    description = "domes held"
    curve = None

    def response(self, extension: Array, dome: Dome) -> Response:
        """As of a linear spring of the dome's stiffness."""
        return quadratic(extension - dome.linearity * dome.stroke, dome.stiffness)

    def rests(self, dome: Dome) -> Rests:
        """None: there is one well only."""
        nowhere = np.full_like(dome.stroke, np.nan)
        return Rests(nowhere, nowhere)


PUBLISHED, HELD = Published(), Held()
