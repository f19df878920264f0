"""Omissions of a plan, and their reasons."""

from typing import TYPE_CHECKING

from dpgcli.design.scene import Scene
from dpgcli.records import dataclass
from dpgcli.states.accuracy import Exactness
from dpgcli.states.units import UnitSolutions
from dpgcli.text import enumerated

if TYPE_CHECKING:
    from dpgcli.states.pairs.halves import Split


@dataclass(frozen=True)
class Omission:
    """Something left out, and why; `keep` is the name by which a benchmark puts it back."""

    what: str
    why: str
    keep: str = ""


def omissions(
    scene: Scene, units: UnitSolutions, split: "Split | None", n_solves: int, exactness: Exactness
) -> tuple[Omission, ...]:
    """Omitted terms, unknowns and solves of a scene."""
    finger = units.finger
    n = finger.n_units
    left_out: list[Omission] = []
    is_there = {
        "loads": finger.is_loaded,
        "pressure": scene.pressure is not None,
        "contact": scene.body is not None,
    }
    if missing := [name for name, has in is_there.items() if not has]:
        left_out.append(Omission(enumerated(missing), "the spec has none"))
    if scene.body is not None:
        left_out.append(Omission("contact", "states are those without the body: dpg grasp"))
    if scene.pressure is not None:
        left_out.append(Omission("pressure", "states are those at 0 MPa"))
    if not finger.has_walls:
        left_out.append(Omission(f"walls and {n} unknowns of them", "the walls are rigid"))
    if finger.is_rigid:
        why = "the target error allows it" if exactness.drops_bars else "k_L is infinite"
        if not finger.is_coupled:
            why += (
                "; units do not feel each other, "
                "so the guess is the solution and Newton only certifies it"
            )
        what = f"bar terms and {2 * n} bar extensions of {4 * n} unknowns"
        left_out.append(Omission(what, why, "bars"))
    if not finger.hinge_stiffness.any():
        left_out.append(Omission("hinge terms", "the hinge stiffness is zero", "hinges"))
    if units.wells.exists.size < n:
        left_out.append(
            Omission(f"{n - 1} of {n} unit wells", "all are equal: one is solved", "every-unit")
        )
    if split is not None:
        left_out.append(
            Omission(
                f"{2**n - n_solves:,} of {2**n:,} finger solves",
                f"states are pairs of {split.n_inner}- and {split.n_outer}-unit halves, each "
                f"solved with {split.context} units of the other; every pair is certified",
                "whole-fingers",
            )
        )
    if scene.gripper is not None:
        left_out.append(
            Omission("the second finger", "a mirror image: solved once", "second-finger")
        )
    return tuple(left_out)
