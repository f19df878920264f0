"""What all tests need."""

import signal
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import settings

from dpgcli.mechanics.finger import STUDY, Finger, uniform_finger

# A shell that starts the tests in the background makes them, and what they start, deaf to
# Ctrl-C; a handler of our own is reset to the default in every program that a test starts.
signal.signal(signal.SIGINT, signal.default_int_handler)
signal.signal(signal.SIGHUP, signal.SIG_DFL)  # which nohup would have ignored

settings.register_profile("repeatable", derandomize=True, database=None, deadline=None)
settings.load_profile("repeatable")


@pytest.fixture(scope="session")
def reference_finger() -> Callable[..., Finger]:
    """The study's finger with changes: `reference_finger(n, linear_stiffness, stroke=1.0)`."""

    def build(n_units: int, linear_stiffness: float = np.inf, **changes: float) -> Finger:
        return uniform_finger(n_units, **{**STUDY, **changes}, linear_stiffness=linear_stiffness)

    return build
