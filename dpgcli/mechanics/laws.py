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
    the opening stands for the travel. `branch` counts the stretches of a curve with ripples on
    which a dome pushes, from the last (0) back; only a dome that never pulls is on one alone.
    """

    stiffness: Array
    linearity: Array
    stroke: Array
    contact: Array
    branch: Array = np.zeros((1, 1))


class Rests(NamedTuple):
    """Extensions (mm) of an inverted dome without force: the barrier's top and the well.

    NaN for a dome without a second well.
    """

    top: Array
    well: Array


class Touching(NamedTuple):
    """The range of extensions (mm) in which a dome acts; infinite if it always does."""

    lowest: Array
    highest: Array


class Attached:
    """Base of laws that push and pull: the dome acts in any state, at any extension."""

    def acting(self, inverted: Flags) -> Array:
        """1."""
        return np.ones((1, 1))

    def branch_at(self, extension: Array, dome: Dome) -> Array:
        """0: the dome acts on all of its curve."""
        return np.zeros((1, 1))

    def touching(self, dome: Dome) -> Touching:
        """Everywhere."""
        everywhere = np.full_like(np.real(dome.stroke), np.inf)
        return Touching(-everywhere, everywhere)


class DomeLaw(Protocol):
    """A dome's law: energy, force and stiffness by the extension of its spring."""

    @property
    def description(self) -> str:
        """The law in words, for tables and summaries."""

    @property
    def curve(self) -> Curve | None:
        """The tabulated curve of the law, None for the study's polynomial."""

    def response(self, extension: Array, dome: Dome) -> Response:
        """Energy (mJ), force (N) and stiffness (N/mm) at an extension (mm)."""

    def rests(self, dome: Dome) -> Rests:
        """Extensions (mm) of the spring alone at its barrier and in its inverted well."""

    @property
    def pulling(self) -> "Published | Tabulated | Held":
        """The law of the same dome if it is attached to its neighbor."""

    def acting(self, inverted: Flags) -> Array:
        """1 for acting domes, 0 for others, (unit, batch); (1, 1) if all act in any state."""

    def branch_at(self, extension: Array, dome: Dome) -> Array:
        """The branch of its curve that an inverted dome is on at an extension (mm); see `Dome`."""

    def touching(self, dome: Dome) -> Touching:
        """The range of extensions (mm) in which a dome acts."""


class Published(Attached):
    """The study's law, `bistable`: the spring pushes and pulls."""

    description = "published law, pushing and pulling"
    curve = None

    @property
    def pulling(self) -> "Published":
        """Itself."""
        return self

    def response(self, extension: Array, dome: Dome) -> Response:
        """The study's polynomial."""
        return bistable(extension, dome.stiffness, dome.linearity, dome.stroke)

    def rests(self, dome: Dome) -> Rests:
        """u = [3β ± √(9β² − 8β)]/(4β) with β = 1 − α, for α < 1/9; the roots of F = 0.

        >>> one, zero = np.ones(()), np.zeros(())
        >>> rests = PUBLISHED.rests(Dome(one, zero, 2.0 * one, zero))  # α = 0, d = 2 mm
        >>> float(rests.top), float(rests.well)
        (1.0, 2.0)
        """
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

    @property
    def pulling(self) -> "Tabulated":
        """Itself."""
        return self

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

    Outside them dome and neighbor do not touch, the energy is constant there. A curve with ripples
    has several branches, from a top to the next well, and the dome is on one of them: what goes
    over a top has left its state. Only inverted domes act: which those are, and on which branch,
    are states of contact, given beside the energy.
    """

    def __init__(self, law: Published | Tabulated) -> None:
        self.pulling = law
        self.curve = law.curve

    @property
    def description(self) -> str:
        """The law in words, with the origin of the dome's own energy."""
        energy = self.pulling.description.split(" law")[0]
        return f"push-only law, {energy} energy of the dome"

    def response(self, extension: Array, dome: Dome) -> Response:
        """The law's response between barrier and well, no force outside.

        >>> one, zero = np.ones(()), np.zeros(())
        >>> beyond = PushOnly(PUBLISHED).response(3.0 * one, Dome(one, zero, 2.0 * one, zero))
        >>> float(beyond.force), float(beyond.stiffness)
        (0.0, 0.0)
        """
        top, well = self.touching(dome)
        place = np.real(extension)
        touches = (place > np.real(top)) & (place < np.real(well))
        apart = np.where(place < np.real(well), top, well)
        apart = np.where(np.isnan(apart), 0.0, apart)  # never inverted: never in touch
        energy, *derivatives = self.pulling.response(np.where(touches, extension, apart), dome)
        force, stiffness = (np.where(touches, values, 0.0) for values in derivatives)
        return Response(energy, force, stiffness)

    def rests(self, dome: Dome) -> Rests:
        """Those of the dome itself."""
        return self.pulling.rests(dome)

    def acting(self, inverted: Flags) -> Array:
        """1 for inverted domes, (unit, batch).

        >>> PushOnly(PUBLISHED).acting(np.array([[True], [False]])).ravel()
        array([1., 0.])
        """
        return inverted.astype(float)

    def branch_at(self, extension: Array, dome: Dome) -> Array:
        """The last one whose top lies before the extension, or the first."""
        if self.curve is None:
            return np.zeros((1, 1))
        tops = (self._opening(top, dome) for top, _ in self.curve.branches[:-1])
        behind = (np.asarray(extension <= top, float) for top in tops)
        return np.asarray(sum(behind, np.zeros((1, 1))))

    def touching(self, dome: Dome) -> Touching:
        """From the top of its barrier to its well, or of its branch; nowhere if it has none."""
        if self.curve is None or len(self.curve.branches) == 1:
            return Touching(*self.pulling.rests(dome))
        ends = np.array(self.curve.branches)[dome.branch.astype(int)]
        return Touching(self._opening(ends[..., 0], dome), self._opening(ends[..., 1], dome))

    @staticmethod
    def _opening(travel: Array | float, dome: Dome) -> Array:
        return np.asarray(travel * (dome.stroke + dome.contact) - dome.contact)


class Held(Attached):
    """A dome held about some opening: a linear spring that rests at `linearity` strokes.

    No dome does that; a search that holds domes open until bars and hinges have settled, and
    then lets go, finds wells that the domes' own softening would let it miss.
    """

    description = "domes held"
    curve = None

    @property
    def pulling(self) -> "Held":
        """Itself."""
        return self

    def response(self, extension: Array, dome: Dome) -> Response:
        """As of a linear spring of the dome's stiffness."""
        return quadratic(extension - dome.linearity * dome.stroke, dome.stiffness)

    def rests(self, dome: Dome) -> Rests:
        """None: there is one well only."""
        nowhere = np.full_like(dome.stroke, np.nan)
        return Rests(nowhere, nowhere)


PUBLISHED, HELD = Published(), Held()
