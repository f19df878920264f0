"""Dome heights with which pulses lead where they do not lead with the given ones."""

import numpy as np

from dpgcli.actuation.grading import HEIGHT, SEPARATION, nearest_heights
from dpgcli.actuation.pressed import Pressed
from dpgcli.actuation.sequences import PulseSequence, pulse_sequence
from dpgcli.api.pressure import PressedInput
from dpgcli.design.by_unit import size_by_unit, with_sizes
from dpgcli.design.resolve import resolve
from dpgcli.records import dataclass
from dpgcli.states.patterns import inverted_units
from dpgcli.states.units import UnitSolutions


@dataclass(frozen=True)
class Graded:
    """Heights (mm) by unit, and what was found of the finger that has them.

    There are none, and no sequence, where heights are not known or none of them would do; `text`
    says so.
    """

    text: tuple[str, ...]
    heights: tuple[float, ...] = ()
    sequence: PulseSequence | None = None

    @property
    def holds(self) -> bool:
        """Whether the finger with these heights is led there, and its replay says so."""
        return self.sequence is not None and self.sequence.holds


def graded_for(given: PressedInput, missed: PulseSequence) -> Graded:
    """The nearest heights that lead to the target of a sequence that does not exist.

    The spec with these heights is resolved anew, and its pulses are searched and replayed.
    """
    spec, line_of = given.given.spec, given.pressure.line_of
    if spec is None or size_by_unit(spec.design, HEIGHT) is None:
        return Graded((f"which dome heights would is not known: no {HEIGHT} of all units",))
    n_units = given.pressed.finger.n_units
    inverted = inverted_units(np.array([missed.target], np.uint64), n_units)[:, 0]
    heights = nearest_heights(spec.design, line_of, inverted)
    if heights is None:
        return Graded(("no dome heights were found with which one pulse up and one down would",))
    resolution = resolve(with_sizes(spec.design, HEIGHT, heights[:, None]))
    known, names = tuple(heights.tolist()), ", ".join(f"{height:g}" for height in heights)
    if resolution.are_wrong[0]:
        return Graded((f"heights of {names} mm would, but make no finger",), known)
    scene = resolution.batch(np.zeros(1, np.int64))
    assert scene.pressure is not None, "the spec has it"
    pressed = Pressed.of(UnitSolutions.of(scene.finger), scene.pressure)
    found = pulse_sequence(pressed, line_of, missed.start, missed.target)
    return Graded((_text(given, names, found),), known, found)


def _text(given: PressedInput, heights: str, found: PulseSequence) -> str:
    """What was found of the finger with other heights."""
    units = f"dome heights of {heights} mm (units 1 to {given.pressed.finger.n_units})"
    if not found.holds or found.pulses is None:
        return f"{units} would by the units' own thresholds, but the finger with them does not"
    lines = given.pressure.lines
    peaks = ", ".join(f"{lines[pulse.line]} {pulse.peak:.4g} MPa" for pulse in found.pulses)
    return (
        f"{units} are the nearest found that lead there, thresholds {SEPARATION:.0%} apart: by "
        f"pulses of {peaks}, replayed"
    )
