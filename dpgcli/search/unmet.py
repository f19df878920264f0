"""What a design does not meet and why: bounds in the way, and wishes that contradict."""

from collections.abc import Iterator, Sequence

import numpy as np

from dpgcli.arrays import Array, Flags
from dpgcli.records import dataclass
from dpgcli.search.designs import Designs
from dpgcli.search.goal import Goal
from dpgcli.search.maps import COUNTS, MapEvaluation
from dpgcli.search.targets import TargetEvaluation
from dpgcli.sweeps.comparisons import margins
from dpgcli.sweeps.evaluation import short_names
from dpgcli.text import enumerated

SHARE = 0.1  # of a range, by which a bound is moved in words
AGAINST = -0.5  # cosine of two wishes' slopes, below which they pull against each other
ON_BOUND = 1e-9  # of the box
ON_LIMIT = 1e-5  # of the size of what a constraint is about


@dataclass(frozen=True)
class Wish:
    """A target or a constraint, in words, and how one design does.

    `lack` is by how much a target is missed, or a constraint is from holding, below zero where it
    holds with something left; `slopes` (range,) are its own by the ranges' widths.
    """

    name: str
    lack: float
    unit: str
    slopes: Array
    is_met: bool
    is_active: bool

    def amount(self, lack: float) -> str:
        """So much of it, in words."""
        return f"{lack:.4g} {self.unit}".rstrip()


@dataclass(frozen=True)
class Standing:
    """How one design stands: what it meets, what it does not, and what holds it back."""

    goal: Goal
    design: Designs
    units: Sequence[str]  # of the targets

    @property
    def bounds(self) -> Flags:
        """Ranges that the design is at an end of; of those beside targets alone, that matter."""
        points = self.design.points[:, 0]
        at_end = (points <= ON_BOUND) | (points >= 1.0 - ON_BOUND)
        return at_end if self.goal.has_maps else self.design.held[:, 0]

    @property
    def wishes(self) -> list[Wish]:
        """The targets and the constraints."""
        return [*self._targets(), *self._constraints()]

    @property
    def active(self) -> str:
        """The bounds and constraints that hold it back, in words."""
        bounds = [self._bound(k) for k in np.flatnonzero(self.bounds).tolist()]
        return ", ".join([*bounds, *(wish.name for wish in self.wishes if wish.is_active)])

    def lines(self) -> Iterator[str]:
        """What is not met, by how much, and what is in the way."""
        wishes = self.wishes
        unmet = [wish for wish in wishes if not wish.is_met]
        if not unmet:
            return
        targets = iter(self.goal.targets)
        for wish in wishes[: len(self.goal.targets)]:
            tolerance = wish.amount(next(targets).tolerance)
            if not wish.is_met:
                yield f"{wish.name} is missed by {wish.amount(wish.lack)}, tolerance {tolerance}"
        for wish in wishes[len(self.goal.targets) :]:
            if not wish.is_met:
                by = f": it lacks {wish.amount(wish.lack)}" if wish.lack > 0.0 else ""
                yield f"{wish.name} does not hold{by}"
        in_the_way = [line for wish in unmet for line in self._in_the_way(wish)]
        yield from in_the_way
        if pair := self._contradiction(wishes):
            yield f"{pair[0]} and {pair[1]} pull against each other: what helps one harms the other"
        elif not in_the_way:
            is_finished = bool(self.design.are_finished[0])
            ended = "this is a local optimum" if is_finished else "the limit ended the search"
            yield f"no bound is in the way: {ended}, and further starts may find a better one"

    def _targets(self) -> Iterator[Wish]:
        residuals, slopes = self.design.residuals
        pairs = zip(self.goal.targets, self.goal.parts, strict=True)
        for number, (target, part) in enumerate(pairs):
            size = float(np.linalg.norm(residuals[part, 0]))
            way = (slopes[part, :, 0] * residuals[part, :1]).sum(axis=0) / max(size, 1e-300)
            name, miss = f"target {number + 1} ({target.text})", size * target.tolerance
            is_met = size <= 1.0
            is_active = bool(self.goal.objectives) and is_met and size >= 1.0 - ON_LIMIT
            unit = self.units[number]
            yield Wish(name, miss, unit, way * target.tolerance, is_met, is_active)

    def _constraints(self) -> Iterator[Wish]:
        if not self.goal.constraints:
            return
        values = self.goal.values(self.design.choice, self.design.points)
        maps = MapEvaluation(self.goal)
        known, slopes = maps.columns(values), maps(values).margin_slopes[..., 0]
        every = {margin.text: k for k, margin in enumerate(maps.smooth)}
        for rule, holds in zip(self.goal.constraints, self.design.hold[:, 0], strict=True):
            own = [margin for margin in margins(rule) if margin.text in every]
            found = [float(np.asarray(margin(known)).ravel()[0]) for margin in own]
            lack, way, least = np.nan, np.zeros(len(self.goal.ranges)), 0
            if own:
                least = int(np.argmin(found))
                lack, way = -found[least], -slopes[every[own[least].text]]
            sizes = [abs(float(np.asarray(known[name]).ravel()[0])) for name in rule.names]
            sizes.append(float(np.abs(way).sum()))  # from end to end of the ranges
            is_active = bool(holds) and abs(lack) <= ON_LIMIT * max(sizes)
            unit = maps.unit(own[least]) if own else ""
            yield Wish(rule.text, float(lack), unit, way, bool(holds), is_active)

    def _bound(self, k: int) -> str:
        each, is_high = self.goal.ranges[k], self.design.points[k, 0] > 0.5
        name = short_names(self.goal.keys)[each.key]
        return f"{name} {'<' if is_high else '>'}= {each.high if is_high else each.low:g}"

    def _in_the_way(self, wish: Wish) -> Iterator[str]:
        """The bound beyond which a wish would lack least, and how much, to first order."""
        outward = np.where(self.design.points[:, 0] > 0.5, 1.0, -1.0)
        gain = np.where(self.bounds, -SHARE * outward * wish.slopes, 0.0)
        if not gain.size or not gain.max() > 0.0:
            return
        k = int(gain.argmax())
        each = self.goal.ranges[k]
        end = (each.high if outward[k] > 0.0 else each.low) + SHARE * each.width * outward[k]
        left = wish.lack - float(gain[k])
        lacking = f"would lack about {wish.amount(left)} instead of {wish.amount(wish.lack)}"
        what = "could be met" if left <= 0.0 else lacking
        yield f"in the way: {self._bound(k)}; with {end:.4g} {wish.name} {what}"

    def _contradiction(self, wishes: Sequence[Wish]) -> tuple[str, str] | None:
        """What pulls most against something that is not met, within the bounds."""
        slopes = np.stack([np.where(self.bounds, 0.0, wish.slopes) for wish in wishes])
        sizes = np.linalg.norm(slopes, axis=1)
        with np.errstate(invalid="ignore", divide="ignore"):
            cosines = np.nan_to_num(slopes @ slopes.T / np.outer(sizes, sizes))
        counts = np.array([wish.is_active or not wish.is_met for wish in wishes])
        unmet = np.array([not wish.is_met for wish in wishes])
        cosines[~(unmet[:, None] & counts)] = 0.0
        if cosines.min() > AGAINST:
            return None
        first, second = np.unravel_index(int(cosines.argmin()), cosines.shape)
        return wishes[int(first)].name, wishes[int(second)].name


def how_slopes_are_found(goal: Goal) -> Iterator[str]:
    """Which slopes are not exact, and what has none."""
    maps = MapEvaluation(goal)
    targets = TargetEvaluation(goal)
    names = [*targets.by_differences, *sorted(maps.sloped - COUNTS)]
    if names := [*dict.fromkeys(names)]:
        yield f"slopes of {enumerated(names)} by central differences: there are no exact ones"
    if counts := sorted({*targets.stepwise, *(maps.names & COUNTS)}):
        kept = "searches do not follow what changes in steps, but stay where it holds"
        yield f"{enumerated(counts)}: {kept}"
