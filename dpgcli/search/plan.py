"""What a search will do, before any of it is done."""

from collections.abc import Mapping

from dpgcli.design.outputs import Trust
from dpgcli.records import dataclass
from dpgcli.search.goal import Goal
from dpgcli.search.maps import COUNTS, MapEvaluation
from dpgcli.search.search import MOST_CHOICES, STARTS
from dpgcli.search.slopes import EXACT
from dpgcli.search.targets import TargetEvaluation


@dataclass(frozen=True)
class GoalPlan:
    """How a goal will be searched for: `base` is the name of its base.

    `trusts` are what the outputs of the base rest on, `warnings` those of its calibrations.
    """

    goal: Goal
    base: str
    trusts: tuple[Trust, ...]
    warnings: tuple[str, ...]

    @property
    def n_choices(self) -> int:
        """Combinations of listed values."""
        return self.goal.n_choices

    @property
    def are_all_tried(self) -> bool:
        """Whether each of them is; else a population finds which are."""
        return self.n_choices <= MOST_CHOICES

    @property
    def n_starts(self) -> int:
        """Of each combination, in a search without limits."""
        return STARTS if self.goal.ranges else 1

    @property
    def most_states(self) -> int:
        """States of a design among which the nearest to a target is looked for."""
        return TargetEvaluation(self.goal).most_states if self.goal.of_states else 0

    @property
    def slopes(self) -> Mapping[str, str]:
        """How each column that is asked for is followed, by its name."""
        targets, maps = TargetEvaluation(self.goal), MapEvaluation(self.goal)
        stepwise = {*targets.stepwise, *(maps.names & COUNTS)}
        names = dict.fromkeys([*targets.columns, *sorted(maps.names)])
        return {
            name: "none" if name in stepwise else "exact" if name in EXACT else "differences"
            for name in names
        }
