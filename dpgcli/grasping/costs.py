"""What grasps will take, before the work: time and memory, to a factor of two or three."""

from dataclasses import dataclass

from dpgcli.grasping.approach import Way
from dpgcli.grasping.grasp import BLOCK, LANE

# Measured on one core of a 2020s server, in seconds, times the square of the number of units.
STATE_SECONDS = {Way.PLACE: 6e-5, Way.CLOSE: 6e-5, Way.INSERT: 3e-4}
RAMP_SECONDS = 3e-4  # of a state, each time that pressures change
MOVING_SECONDS = 3e-3  # of a row whose body is let go of
PULLED_SECONDS = 6e-4  # of a row whose body is pulled on
JAW_SECONDS = 0.03  # of a state at all apertures; with a calibration's curve several times as much
START_SECONDS, ROW_SECONDS = 1.0, 3e-5
LIBRARY_BYTES = 2**26
KEPT_BYTES, ROW_BYTES = 200, 180  # of a finger and of a row, times the number of units


@dataclass(frozen=True)
class Work:
    """Seconds and bytes of so many rows, of states of the upper and the lower finger."""

    n_states: int
    n_rows: int
    n_units: int
    n_fingers: int
    is_moving: bool
    way: Way = Way.PLACE
    n_ramps: int = 0
    has_friction: bool = False

    @property
    def seconds(self) -> float:
        """Of one core.

        >>> round(Work(1024, 1024, 10, 1, False).seconds)
        7
        """
        square = self.n_units**2
        let_go = self.n_rows * MOVING_SECONDS * square if self.is_moving else 0.0
        one = STATE_SECONDS[self.way] + self.n_ramps * RAMP_SECONDS
        placed = self.n_states * one * square
        pulled = self.n_rows * PULLED_SECONDS * square if self.has_friction else 0.0
        return START_SECONDS + placed + let_go + pulled + self.n_rows * ROW_SECONDS

    @property
    def peak_bytes(self) -> int:
        """Libraries, a block of states, what is kept of fingers, and the rows.

        >>> Work(2**14, 2**14, 14, 1, False).peak_bytes < 2**29
        True
        """
        block = min(self.n_states * LANE * self.n_units**2, BLOCK)
        n_kept = self.n_fingers * (self.n_rows if self.is_moving else self.n_states)
        return (
            LIBRARY_BYTES + block + self.n_units * (KEPT_BYTES * n_kept + ROW_BYTES * self.n_rows)
        )


def jaw_seconds(n_states: int, n_units: int) -> float:
    """Seconds of one core for states at jaws that open and close.

    >>> round(jaw_seconds(32, 5))
    25
    """
    return START_SECONDS + n_states * JAW_SECONDS * n_units**2
