"""From certified states to the columns of a table, named as in `columns`."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dpgcli.arrays import Array, Flags, total
from dpgcli.design.scene import Gripper, Uncertainty
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.formulation import Formulation, Stations
from dpgcli.states.certify import Batch, States, Status, certify
from dpgcli.states.columns import Column, Group, Kind
from dpgcli.states.gripper import grip
from dpgcli.states.patterns import texts
from dpgcli.states.sensitivities import sensitivities
from dpgcli.states.solve import solve
from dpgcli.states.tip import Tip, min_eigenvalues, tip
from dpgcli.states.units import Units

Columns = dict[str, NDArray[Any]]


def as_text(column: Column, values: NDArray[Any]) -> NDArray[Any]:
    """Patterns and statuses as strings; all else unchanged."""
    if column.kind is Kind.PATTERN:
        return np.asarray(values.astype(str))
    if column.kind is Kind.STATUS:
        return np.asarray(np.array([status.text for status in Status])[values])
    return values


def _is_state(status: NDArray[np.uint8]) -> Flags:
    """Where there is an equilibrium of the row's own pattern to speak of."""
    return np.asarray((status == Status.STABLE) | (status == Status.MARGINAL))


def state_columns(states: States) -> Columns:
    """What every method knows; numbers of a pattern that has no state are NaN."""
    is_state = _is_state(states.status)
    energies = states.energies
    numbers = {
        "tip_x_mm": states.pose[0],
        "tip_y_mm": states.pose[1],
        "tip_angle_rad": states.pose[2],
        "energy_mJ": sum(energies.values()),
        "tip_error_mm": states.tip_error,
        **{f"{kind}_energy_mJ": part for kind, part in energies.items()},
    }
    return {
        "pattern": texts(states.inverted),
        "status": states.status,
        **{name: np.where(is_state, values, np.nan) for name, values in numbers.items()},
        "residual_N": states.residual,
        "reached_pattern": texts(states.reached),
    }


@dataclass(frozen=True)
class Wanted:
    """What rows are to hold and how exactly: what `plan` decides for all batches of a scene.

    The gripper's values, the layer's thickness (mm) and the error of the tip (mm) by what the
    units lack of the scene are numbers, or arrays by lane.
    """

    formulate: Callable[[Finger], Formulation]
    tolerance: float
    groups: frozenset[Group]
    gripper: Gripper | None = None
    layer_thickness: float | Array = 0.0
    dropped_error: float | Array = 0.0
    uncertainty: Uncertainty | None = None


def solved_rows(units: Units, inverted: Flags, wanted: Wanted) -> Columns:
    """Rows of these patterns, (unit, state), each solved and certified as a whole finger.

    The units have one design, or one for each state.
    """
    batch = solve(units, wanted.formulate, inverted, wanted.tolerance)
    status = certify(batch, units, wanted.tolerance)
    at_tip = tip(batch, with_compliance=Group.STIFFNESS in wanted.groups)
    states = States(
        inverted,
        batch.reached,
        status,
        at_tip.pose,
        at_tip.error + wanted.dropped_error,
        batch.equilibrium.energies,
        batch.equilibrium.residual,
    )
    return state_columns(states) | _batch_columns(wanted, batch, at_tip, status)


def _batch_columns(wanted: Wanted, batch: Batch, at_tip: Tip, status: NDArray[np.uint8]) -> Columns:
    """What only a solve of the whole finger knows, for the groups that are wanted."""
    groups = wanted.groups
    columns: Columns = {}
    if Group.EIGENVALUE in groups:
        columns["min_eigenvalue_N_per_mm"] = min_eigenvalues(batch)
    if at_tip.compliance is not None and at_tip.stiffness is not None:
        columns |= _stiffness_columns(at_tip.compliance, at_tip.stiffness)
    if wanted.uncertainty is not None and Group.UNCERTAINTY in groups:
        columns |= _uncertainty_columns(batch, wanted.uncertainty)
    coordinates = batch.equilibrium.coordinates
    if Group.OPENINGS in groups:
        openings = batch.formulation.openings(coordinates)
        columns |= {f"opening_{i}_mm": x for i, x in enumerate(openings, start=1)}
    if Group.GRIPPER in groups or Group.NODES in groups:
        columns |= _shape_columns(wanted, batch.formulation, coordinates)
    is_state = _is_state(status)
    return {
        name: values & is_state if values.dtype == bool else np.where(is_state, values, np.nan)
        for name, values in columns.items()
    }


def _stiffness_columns(compliance: Array, stiffness: Array) -> Columns:
    xx, xy, yy, x_angle, y_angle, angle = compliance
    return {
        "tip_stiffness_min_N_per_mm": stiffness[0],
        "tip_stiffness_max_N_per_mm": stiffness[1],
        "tip_compliance_xx_mm_per_N": xx,
        "tip_compliance_xy_mm_per_N": xy,
        "tip_compliance_yy_mm_per_N": yy,
        "tip_compliance_x_angle_rad_per_N": x_angle,
        "tip_compliance_y_angle_rad_per_N": y_angle,
        "tip_compliance_angle_rad_per_N_mm": angle,
    }


def _uncertainty_columns(batch: Batch, uncertainty: Uncertainty) -> Columns:
    """σ² = s C sᵀ with s the tip's derivatives by fitted values and C their covariance."""
    slopes = sensitivities(batch, uncertainty.directions).pose
    terms = [
        covariance * slopes[:, k] * slopes[:, m]
        for (k, m), covariance in np.ndenumerate(uncertainty.covariance)
    ]
    x, y, angle = np.sqrt(np.maximum(total(np.stack(terms)), 0.0))
    return {
        "tip_x_uncertainty_mm": x,
        "tip_y_uncertainty_mm": y,
        "tip_angle_uncertainty_rad": angle,
    }


def _shape_columns(wanted: Wanted, formulation: Formulation, coordinates: Array) -> Columns:
    """Node positions with the clamped ones, of the finger or of the gripper's two."""
    nodes = _with_base(formulation.stations(coordinates), formulation.finger.segment_height)
    if wanted.gripper is None:
        return _node_columns("", nodes, 1.0)
    gripped = grip(wanted.gripper, wanted.layer_thickness, nodes)
    upper = gripped.upper
    return {
        "aperture_mm": gripped.aperture,
        "fingers_overlap": gripped.overlaps,
        "upper_tip_x_mm": upper.base_x[-1],
        "upper_tip_y_mm": upper.base_y[-1],
        "lower_tip_x_mm": upper.base_x[-1],
        "lower_tip_y_mm": -upper.base_y[-1],
        **_node_columns("upper_", upper, 1.0),
        **_node_columns("lower_", upper, -1.0),
    }


def _with_base(stations: Stations, height: Array) -> Stations:
    origin = np.zeros_like(stations.base_x[:1])
    clamped = (origin, origin, origin, origin + height)
    return Stations(
        *(np.concatenate((row, rows)) for row, rows in zip(clamped, stations, strict=True))
    )


def _node_columns(prefix: str, nodes: Stations, mirror: float) -> Columns:
    columns: Columns = {}
    for i in range(len(nodes.base_x)):
        columns[f"{prefix}B{i}_x_mm"] = nodes.base_x[i]
        columns[f"{prefix}B{i}_y_mm"] = mirror * nodes.base_y[i]
        columns[f"{prefix}T{i}_x_mm"] = nodes.top_x[i]
        columns[f"{prefix}T{i}_y_mm"] = mirror * nodes.top_y[i]
    return columns
