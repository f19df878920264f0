"""The study's finger and a profile of Hypothesis whose examples repeat."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import settings

from dpgcli.mechanics.finger import Finger, uniform_finger

settings.register_profile("repeatable", derandomize=True, database=None, deadline=None)
settings.load_profile("repeatable")


@pytest.fixture(scope="session")
def reference_finger() -> Callable[..., Finger]:
    def build(n_units: int, linear_stiffness: float = np.inf) -> Finger:
        return uniform_finger(
            n_units,
            segment_length=13.5,
            segment_height=10.75,
            stroke=3.5,
            bistable_stiffness=12.84,
            force_linearity=0.043,
            hinge_stiffness=24.2,
            linear_stiffness=linear_stiffness,
        )

    return build
