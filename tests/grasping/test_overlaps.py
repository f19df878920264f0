"""Fingers that overlap: found among those whose boxes meet; without any shapely is not loaded."""

import subprocess
import sys
from pathlib import Path

import numpy as np

from dpgcli.grasping.table import _overlaps

SQUARE = np.array([[0.0, 1.0, 1.0, 0.0], [0.0, 0.0, 1.0, 1.0]])
CORNER = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])  # below x + y = 1


def test_outlines_overlap_by_more_than_touching() -> None:
    """Apart along x, along y, touching, overlapping, and one within the other's box only."""
    away = np.array([[2.0, 0.0, 1.0, 0.9, 0.0], [0.0, -1.5, 0.0, 0.9, 0.0]])
    upper, lower = np.repeat(SQUARE[:, :, None], 5, axis=2), SQUARE[:, :, None] + away[:, None]
    upper[:, :, 4] = 4.0 * CORNER[:, [0, 1, 2, 2]]
    lower[:, :, 4] = 3.0 + 0.5 * SQUARE
    expected = [False, False, False, True, False]
    assert _overlaps(upper, lower).tolist() == expected
    assert _overlaps(lower, upper).tolist() == expected
    assert _overlaps(upper[..., :0], lower[..., :0]).tolist() == []


def test_a_disc_between_fingers_loads_no_shapely() -> None:
    spec = str(Path(__file__).parents[2] / "configs" / "gripper.yaml")
    said = (
        "import sys; from dpgcli.api.grasp import grasp;"
        f"found = grasp({spec!r}, object='disc:40', at=(40.0, 0.0), patterns=['001*']);"
        "print(len(found.rows['overlaps']), 'shapely' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", said], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["4", "False"]
