"""Manufacturing scatter: what the user says of it, and fingers drawn by it."""

from collections.abc import Iterator, Mapping
from difflib import get_close_matches
from typing import TypeAlias

from dpgcli.actuation.pressed import Pressed
from dpgcli.api.arguments import as_texts, check_whole
from dpgcli.api.inputs import by_text, plain
from dpgcli.api.pressure import PressedInput
from dpgcli.arrays import Indices
from dpgcli.design.dimensions import LARGEST, Tolerance, unit_of
from dpgcli.design.scatter import OF_UNITS, SCATTERED, Scattered, scatter_issues, scattered
from dpgcli.errors import Field, Problem, SpecError, UsageError
from dpgcli.files.places import shown
from dpgcli.files.scene_file.pressure import NUMBER
from dpgcli.files.scene_file.tolerances import beyond, share_of
from dpgcli.records import dataclass
from dpgcli.states.units import UnitSolutions
from dpgcli.text import counted

ScatterInput: TypeAlias = Mapping[str, str | float] | str
"""Standard deviations by key of a spec: "dome_height_mm=0.1mm,dome_thickness_mm=2%"."""

FIELD = Field("scatter")
GRIPPERS = ("base_spacing_mm", "mounting_angle_deg")
DRAWS, SEED = 1000, 1  # unless others are asked for
MOST_DRAWS = 100_000
CONFIDENCE = 0.95
SHARE = 0.95  # of draws that do what a pulse is for, within its window


@dataclass(frozen=True)
class Draws:
    """Fingers drawn around a spec: how they were asked for, and what came of it."""

    spread: Mapping[str, Tolerance]
    seed: int
    n_draws: int
    scattered: Scattered

    def batches(self) -> Iterator[tuple[Indices, Pressed]]:
        """Draws that are fingers, under pressure, by their places."""
        for draws, scene, finger in self.scattered.batches():
            assert scene.pressure is not None, "asked for pressures"
            pressed = Pressed.of(UnitSolutions.of(scene.finger), scene.pressure)
            if finger is not scene.finger:
                pressed = Pressed(UnitSolutions.of(finger), pressed.volumes)
            yield draws, pressed

    @property
    def lines(self) -> Iterator[str]:
        """What was drawn, and how many draws are no fingers."""
        parts = [f"{key} {tolerance.text(key)}" for key, tolerance in self.spread.items()]
        common = [key for key in self.spread if key not in OF_UNITS]
        units = f", {', '.join(common)} the same in all units of a finger" if common else ""
        drawn = counted(self.n_draws, "finger")
        yield f"{drawn} drawn, seed {self.seed}: normal, {', '.join(parts)}{units}"
        if n_wrong := int(self.scattered.are_wrong.sum()):
            yield f"{counted(n_wrong, 'draw')} make no finger, and count as failures"


def drawn_by(
    given: PressedInput, scatter: ScatterInput | None, draws: int | None, seed: int | None
) -> Draws | None:
    """Fingers drawn around a spec by standard deviations of its values, if these are given.

    Raises SpecError with all that is wrong with these, UsageError for other wrong choices, and
    where no draw is a finger.
    """
    if scatter is None:
        for field, value in (("draws", draws), ("seed", seed)):
            if value is not None:
                raise UsageError(Field(field), " goes with ", FIELD)
        return None
    draws, seed = DRAWS if draws is None else draws, SEED if seed is None else seed
    check_draws(draws, seed)
    spec = given.given.spec
    if spec is None:
        raise UsageError(FIELD, " changes a spec, not a finger's values")
    spread = spread_of(scatter)
    issues = [*scatter_issues(spec.design, spread)]
    if issues:
        raise SpecError(tuple(_problem(str(issue.path[-1]), *issue[1:]) for issue in issues))
    found = scattered(spec.design, spread, draws, seed)
    if found.are_wrong.all():
        issues = found.resolution.problems.of(0)
        why = issues[0].statement if issues else "their values are impossible"
        raise UsageError(FIELD, f": no draw is a finger: {why}")
    return Draws(spread, seed, draws, found)


def check_draws(draws: int, seed: int) -> None:
    """Raise UsageError for a number of draws, or a seed, that is none; or for too many draws."""
    check_whole(draws=draws, seed=seed)
    if not 1 <= draws <= MOST_DRAWS:
        raise UsageError(Field("draws"), f" {draws}: expected 1 to {MOST_DRAWS:,}")
    if seed < 0:
        raise UsageError(Field("seed"), f" {seed}: expected a whole number from 0 on")


def spread_of(scatter: ScatterInput) -> dict[str, Tolerance]:
    """Standard deviations by key. Raises SpecError with all problems.

    >>> spread_of("dome_height_mm=0.1mm, dome_thickness_mm=2%")["dome_thickness_mm"]
    Tolerance(size=0.02, is_relative=True)
    """
    found: dict[str, Tolerance] = {}
    problems = []
    for key, said in _pairs(scatter):
        size = _size(key, said)
        if key not in SCATTERED:
            problems.append(_problem(key, *_unknown(key)))
        elif key in found:
            problems.append(_problem(key, "each key once", "it again"))
        elif size is None:
            unit = unit_of(key)
            expected = f"a percentage such as 2%, or a number{f' in {unit}' if unit else ''}"
            found_there = shown(said) if said else "nothing"
            problems.append(_problem(key, expected, found_there, _bound(key, said)))
        found[key] = size or Tolerance(0.0, False)
    if problems:
        raise SpecError(tuple(problems))
    if not found:
        raise UsageError(FIELD, ": expected KEY=SIZE, such as dome_height_mm=0.1mm")
    return found


def _pairs(scatter: ScatterInput) -> Iterator[tuple[str, str]]:
    """Keys and what is said of them."""
    if isinstance(scatter, Mapping):
        yield from ((key, str(plain(said))) for key, said in by_text("scatter", scatter).items())
        return
    for text in as_texts("scatter", scatter):
        for part in text.split(","):
            key, _, said = part.partition("=")
            if part.strip():
                yield key.strip(), said.strip()


def _size(key: str, said: str) -> Tolerance | None:
    """A percentage, or a number with or without the unit of its key; None for anything else."""
    share = share_of(said)
    if share is not None:
        return Tolerance(share, True)
    number = _number(key, said)
    if number is None or not 0.0 <= number <= LARGEST:
        return None
    return Tolerance(number, False)


def _number(key: str, said: str) -> float | None:
    """A number without the unit of its key."""
    number = said.removesuffix(unit_of(key)).strip()
    return float(number) if NUMBER.fullmatch(number) else None


def _bound(key: str, said: str) -> str:
    """The bound that a size is beyond, in words."""
    number = _number(key, said)
    if number is not None and number < 0.0:
        return "at least 0"
    return beyond(said if number is None else number)


def _unknown(key: str) -> tuple[str, str, str]:
    """Words for a key that nothing here is scattered by."""
    close = get_close_matches(key, SCATTERED, n=1)
    hint = f"did you mean {close[0]}?" if close else ", ".join(SCATTERED)
    if key in GRIPPERS:
        hint = "it moves no threshold"
    return "a key of the finger that scatters", shown(key) if key else "none", hint


def _problem(key: str, expected: str, found: str, hint: str = "") -> Problem:
    return Problem(FIELD, None, None, key or "key", expected, found, hint)


def share_interval(n_done: int, n_draws: int) -> tuple[float, float]:
    """Shares that a count does not speak against: Clopper and Pearson (1934), 95 %.

    >>> [round(float(end), 4) for end in share_interval(95, 100)]
    [0.8872, 0.9836]
    """
    from scipy.special import betaincinv

    tail = 0.5 * (1.0 - CONFIDENCE)
    low = betaincinv(n_done, n_draws - n_done + 1, tail) if n_done else 0.0
    high = betaincinv(n_done + 1, n_draws - n_done, 1.0 - tail) if n_done < n_draws else 1.0
    return float(low), float(high)
