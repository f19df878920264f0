"""What grasps will take, before the work: time and memory, to a factor of two or three."""

from collections.abc import Sequence

import numpy as np

from dpgcli.design.bodies import Body, Disc, Jaws, Polygon, gives_way
from dpgcli.design.scene import Held, Scene
from dpgcli.grasping.approach import Way
from dpgcli.grasping.grasp import BLOCK, LANE
from dpgcli.records import dataclass

# Measured on one core of a 2020s server, in seconds, times the square of the number of units.
STATE_SECONDS = {Way.PLACE: 1.5e-4, Way.INSERT: 7.5e-4}
RAMP_SECONDS = 3e-4  # of a state of a routine, each time that pressures change
STEP_SECONDS = 0.015  # of pressures that close fingers, however many states and units
CLOSING_SECONDS = 0.5  # of what happens on their way, likewise
CLOSED_SECONDS, CHANGE_SECONDS = 5e-3, 2.4e-5  # of a state, and at each step, times the units
MOVING_SECONDS = {Disc: 3e-3, Jaws: 1.7e-2, Polygon: 3e-3}  # of a row whose body is let go of
PULLED_SECONDS = 6e-4  # of a row whose body is pulled on
PAIR_SECONDS = 3.5e-3  # of two fingers in different states that come together
JOINED_SECONDS = 2e-2  # of two that touch a body as well, with their margins
PULSE_SECONDS = 0.1  # of a pulse, however many states go through it, times the number of units
JAW_SECONDS = 0.03  # of a state at all apertures
BODIES = {Disc: 1.0, Jaws: 2.0, Polygon: 8.0}  # times as long: a polygon's corners take most
CURVE = 10.0  # times as long with a calibration's curve
WITHOUT_MARGINS = 0.5
START_SECONDS, ROW_SECONDS = 1.0, 3e-5
LIBRARY_BYTES = 2**26
KEPT_BYTES, ROW_BYTES = 200, 180  # of a finger and of a row, times the number of units
PAIR_BYTES = 800  # of a pair, times the square of its units: what is kept
PAIR_LANE = 2500  # the same while it is worked on, times their third power


@dataclass(frozen=True)
class Work:
    """Seconds and bytes of so many rows, of states of the upper and the lower finger.

    In `n_pairs` of the rows both fingers are unknown and come together, `pair_seconds` each.
    """

    n_states: int
    n_rows: int
    n_units: int
    n_fingers: int
    is_moving: bool
    way: Way = Way.PLACE
    n_ramps: int = 0
    has_friction: bool = False
    effort: float = 1.0  # times that of a disc and the published law
    n_pairs: int = 0
    pair_seconds: float = PAIR_SECONDS  # times the square of the number of units
    moving_seconds: float = MOVING_SECONDS[Disc]  # likewise

    @property
    def seconds(self) -> float:
        """Of one core.

        >>> round(Work(1024, 1024, 10, 1, False).seconds)
        16
        """
        square = self.n_units**2
        steps = self.n_ramps * STEP_SECONDS
        let_go = self.n_rows * self.moving_seconds * square if self.is_moving else 0.0
        pulled = self.n_rows * PULLED_SECONDS * square if self.has_friction else 0.0
        met = self._placed + let_go + pulled + self.n_pairs * self.pair_seconds * square
        return START_SECONDS + steps + self.effort * met + self.n_rows * ROW_SECONDS

    @property
    def _placed(self) -> float:
        """Seconds until fingers touch a disc, with the published law."""
        if self.way is not Way.CLOSE:
            return self.n_states * STATE_SECONDS[self.way] * self.n_units**2
        each = CLOSED_SECONDS + self.n_ramps * CHANGE_SECONDS
        return CLOSING_SECONDS + self.n_states * self.n_units * each

    @property
    def peak_bytes(self) -> int:
        """Libraries, a block of states, what is kept of fingers, and the rows.

        >>> Work(2**14, 2**14, 14, 1, False).peak_bytes < 2**29
        True
        """
        block = min(self.n_states * LANE * self.n_units**2, BLOCK)
        n_kept = self.n_fingers * (self.n_rows if self.is_moving else self.n_states)
        of_pairs = self.n_pairs * PAIR_BYTES * self.n_units**2
        block += min(self.n_pairs * PAIR_LANE * self.n_units**3, BLOCK)
        return (
            LIBRARY_BYTES
            + block
            + of_pairs
            + self.n_units * (KEPT_BYTES * n_kept + ROW_BYTES * self.n_rows)
        )


def effort(scene: Scene, body: Body | None) -> float:
    """How many times as long a body, or none, takes as a disc does with the published law."""
    return (1.0 if body is None else BODIES[type(body)]) * _of_law(scene)


def is_moving(scene: Scene) -> bool:
    """Whether the scene's body is let go of once it is in its place."""
    return scene.held is not Held.FIXED or gives_way(scene.body)


def design_seconds(scene: Scene) -> float:
    """Seconds of one core for a state of a design with the scene's body, by its units squared."""
    assert scene.body is not None, "a scene with a body"
    n_fingers = 1 if scene.gripper is None or bool(np.all(scene.body.is_mirrored)) else 2
    let_go = MOVING_SECONDS[type(scene.body)] if is_moving(scene) else 0.0
    pulled = PULLED_SECONDS if scene.friction is not None else 0.0
    placed = n_fingers * STATE_SECONDS[Way.PLACE]
    return effort(scene, scene.body) * (WITHOUT_MARGINS * (placed + let_go) + pulled)


def jaw_seconds(scene: Scene, n_states: int) -> float:
    """Seconds of one core for states at jaws that open and close."""
    return START_SECONDS + n_states * JAW_SECONDS * scene.finger.n_units**2 * _of_law(scene)


def routine_seconds(scene: Scene, body: Body, rounds: Sequence[Sequence[int]]) -> float:
    """Seconds of one core for routines, by the pulses of each plan in each round of plans.

    Plans of a round are followed at once, the best once more, and as many pulses let go.
    """
    n_units, n_fingers = scene.finger.n_units, 1 if bool(np.all(body.is_mirrored)) else 2
    steps = sum(max(plans) for plans in rounds)
    at_once = 4 * steps * PULSE_SECONDS * n_units * np.sqrt(_of_law(scene))
    ramps = 6 * sum(map(sum, rounds))
    each = ramps * RAMP_SECONDS * n_units**2 * BODIES[type(body)]
    return START_SECONDS + n_fingers * float(at_once + each)


def _of_law(scene: Scene) -> float:
    return 1.0 if scene.finger.law.curve is None else CURVE
