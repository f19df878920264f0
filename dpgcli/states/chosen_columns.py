"""Which of the columns that a scene can have a request gets."""

from collections.abc import Sequence

from dpgcli.errors import Field, Message
from dpgcli.states.columns import Group
from dpgcli.states.omissions import Omission
from dpgcli.states.quantities import Quantity, named

ON_REQUEST = (Group.BARRIERS, Group.NODES, Group.UNCERTAINTY, Group.SHARES)
MOST_STATES_WITH = {
    Group.EIGENVALUE: 2**10,
    Group.STIFFNESS: 2**16,
    Group.ENERGIES: 2**16,
    Group.OPENINGS: 2**16,
}


def chosen_columns(
    available: tuple[Quantity, ...], names: Sequence[str], n_states: int, *, has_bars: bool
) -> tuple[tuple[Quantity, ...], tuple[Omission, ...]]:
    """Columns asked for; by default all but nodes and what is costly in a large map."""
    wanted: set[str] = {"pattern", "status", *names} - {"default", "all"}
    left_out: tuple[Omission, ...] = ()
    groups = list(dict.fromkeys(c.group for c in available))
    if "all" in names:
        wanted |= set(groups)
    elif "default" in names:
        cheap = [
            g
            for g in groups
            if g not in ON_REQUEST
            and n_states <= MOST_STATES_WITH.get(g, n_states)
            and (has_bars or g is not Group.STIFFNESS)
        ]
        left_out = tuple(
            Omission(f"{g} columns", _why_left_out(g, n_states), "every-column")
            for g in groups
            if g not in {*cheap, *names}
        )
        wanted |= set(cheap)
    return named(available, sorted(wanted)), left_out


def _why_left_out(group: Group, n_states: int) -> str:
    if group in (Group.BARRIERS, Group.SHARES):  # they have no option of their own
        return Message("given on request: ", Field("columns"), f" {group}")
    if group in ON_REQUEST:
        return Message("given on request: ", Field(group))
    if n_states <= MOST_STATES_WITH[group]:
        return "the target error drops the bars, without which they would be wrong"
    most = f"left out above {MOST_STATES_WITH[group]:,} states"
    return Message(most, ": ", Field("columns"), f" default,{group}")
