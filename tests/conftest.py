"""What all tests need."""

import compileall
import signal
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings

import dpgcli
from dpgcli.arrays import Array
from dpgcli.mechanics.finger import STUDY, Finger, uniform_finger

# A shell that starts the tests in the background makes them, and what they start, deaf to
# Ctrl-C; a handler of our own is reset to the default in every program that a test starts.
signal.signal(signal.SIGINT, signal.default_int_handler)
signal.signal(signal.SIGHUP, signal.SIG_DFL)  # which nohup would have ignored

settings.register_profile("repeatable", derandomize=True, database=None, deadline=None)
settings.load_profile("repeatable")


def pytest_configure(config: pytest.Config) -> None:
    """Compile the package once: where Python writes no bytecode, each of many processes would."""
    if not hasattr(config, "workerinput"):
        compileall.compile_dir(Path(dpgcli.__file__).parent, quiet=2)


@pytest.fixture(scope="session")
def reference_finger() -> Callable[..., Finger]:
    """The study's finger with changes: `reference_finger(n, linear_stiffness, stroke=1.0)`."""

    def build(n_units: int, linear_stiffness: float = np.inf, **changes: float) -> Finger:
        return uniform_finger(n_units, **{**STUDY, **changes}, linear_stiffness=linear_stiffness)

    return build


@pytest.fixture(scope="session")
def graded_finger() -> Callable[..., Finger]:
    """Other values in each unit, within 30 % of the study's; changes override them."""

    def build(
        n_units: int, seed: int, linear_stiffness: float = 1e4, **changes: Array | float
    ) -> Finger:
        random = np.random.default_rng(seed)
        values = {
            name: value * random.uniform(0.7, 1.3, (n_units, 1)) for name, value in STUDY.items()
        }
        values["segment_height"] = values["segment_height"][:1]
        values |= {name: np.reshape(value, (-1, 1)) for name, value in changes.items()}
        return Finger(n_units, **values, linear_stiffness=np.array([[linear_stiffness]]))

    return build


@pytest.fixture(scope="session")
def dense() -> Callable[[Array], Array]:
    """The full matrix of the first lane of a band of `equilibrium.banded`."""

    def unfold(band: Array) -> Array:
        size = band.shape[1]
        full = np.zeros((size, size))
        for depth in range(min(len(band), size)):
            columns = np.arange(size - depth)
            full[columns + depth, columns] = band[depth, : size - depth, 0]
            full[columns, columns + depth] = band[depth, : size - depth, 0]
        return full

    return unfold
