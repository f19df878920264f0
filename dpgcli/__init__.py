"""Stable shapes of multistable soft grippers, predicted by a lumped spring lattice.

Its functions do what the commands of `dpg` do, with values, paths or data frames in and values
out. Each is loaded when it is first asked for, so that no command waits for another's libraries.

>>> import dpgcli as dpg
>>> finger = dpg.uniform_finger(
...     3, segment_length=13.5, segment_height=10.75, stroke=3.5,
...     bistable_stiffness=12.84, force_linearity=0.043, hinge_stiffness=24.2)
>>> states = dpg.predict(finger, patterns="1*1").to_pandas()
>>> states["tip_y_mm"].round(2).tolist()
[-11.99, -17.24]
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from dpgcli.api.actuate import actuate
    from dpgcli.api.bench import bench
    from dpgcli.api.check import check
    from dpgcli.api.compare import compare
    from dpgcli.api.explain import explain
    from dpgcli.api.finger import uniform_finger
    from dpgcli.api.fits.bistable import fit_bistable
    from dpgcli.api.fits.finger import fit_finger
    from dpgcli.api.fits.grid import fit_grid
    from dpgcli.api.fits.hinge import fit_hinge
    from dpgcli.api.fits.unit import fit_unit
    from dpgcli.api.grasp import grasp
    from dpgcli.api.inverse_design import inverse_design
    from dpgcli.api.jaws import jaws
    from dpgcli.api.landscape import landscape
    from dpgcli.api.lookup import lookup
    from dpgcli.api.pick import pick
    from dpgcli.api.predict import predict
    from dpgcli.api.pulses import pulses
    from dpgcli.api.report import report
    from dpgcli.api.routine import routine
    from dpgcli.api.stress import stress
    from dpgcli.api.sweep import merge, sweep
    from dpgcli.api.transitions import transitions
    from dpgcli.api.validate import validate
    from dpgcli.errors import (
        ActuationError,
        DpgError,
        FitError,
        NothingSelectedError,
        OutputError,
        SpecError,
        UsageError,
    )
    from dpgcli.files.calibration import read_calibration

__all__ = [
    "ActuationError",
    "DpgError",
    "FitError",
    "NothingSelectedError",
    "OutputError",
    "SpecError",
    "UsageError",
    "__version__",
    "actuate",
    "bench",
    "check",
    "compare",
    "explain",
    "fit_bistable",
    "fit_finger",
    "fit_grid",
    "fit_hinge",
    "fit_unit",
    "grasp",
    "inverse_design",
    "jaws",
    "landscape",
    "lookup",
    "merge",
    "pick",
    "predict",
    "pulses",
    "read_calibration",
    "report",
    "routine",
    "stress",
    "sweep",
    "transitions",
    "uniform_finger",
    "validate",
]

_HOMES = {
    "actuate": "api.actuate",
    "bench": "api.bench",
    "check": "api.check",
    "compare": "api.compare",
    "explain": "api.explain",
    "fit_bistable": "api.fits.bistable",
    "fit_finger": "api.fits.finger",
    "fit_grid": "api.fits.grid",
    "fit_hinge": "api.fits.hinge",
    "fit_unit": "api.fits.unit",
    "grasp": "api.grasp",
    "inverse_design": "api.inverse_design",
    "jaws": "api.jaws",
    "landscape": "api.landscape",
    "lookup": "api.lookup",
    "merge": "api.sweep",
    "pick": "api.pick",
    "predict": "api.predict",
    "pulses": "api.pulses",
    "read_calibration": "files.calibration",
    "report": "api.report",
    "routine": "api.routine",
    "stress": "api.stress",
    "sweep": "api.sweep",
    "transitions": "api.transitions",
    "uniform_finger": "api.finger",
    "validate": "api.validate",
}


def __getattr__(name: str) -> Any:
    """Load a public name when it is first asked for."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_HOMES.get(name, 'errors')}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
