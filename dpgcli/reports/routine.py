"""A routine as a strip of figures, a panel for each step."""

from pathlib import Path

from dpgcli.arrays import Columns
from dpgcli.grasping.routine import FINE, Stage
from dpgcli.grasping.steps import Routine, joined
from dpgcli.grasping.table import grasp_rows
from dpgcli.reports.fingers import signed
from dpgcli.reports.grasp import draw_panels


def draw_routine(routine: Routine, rows: Columns, path: Path) -> None:
    """Draw the steps of a routine to an SVG or PNG file, the same bytes each time."""
    found, task = joined(routine), routine.task
    other_end = {Stage.APPROACH: task.begin, Stage.WITHDRAW: task.body.center}
    ghosts = {
        place: other_end[step.stage]
        for place, step in enumerate(routine.steps)
        if step.stage in other_end
    }
    titles = [_title(rows, place) for place in range(len(routine.steps))]
    draw_panels(found, grasp_rows(found), path, ("Routine", "\n".join(titles)), titles, ghosts)


def _title(rows: Columns, place: int) -> str:
    """Such as "3 close: A 0.165 MPa → 11111"."""
    step, status, pattern = (str(rows[name][place]) for name in ("step", "status", "pattern_after"))
    said = f"{place + 1} {step}"
    if rows["line"][place]:
        peak = signed(f"{rows['peak_pressure_MPa'][place]:.3g}")
        said = f"{said}: {rows['line'][place]} {peak} MPa"
    if status not in FINE:
        return f"{said} {status.replace('_', ' ')}"
    return f"{said} → {pattern}" if rows["line"][place] else f"{said} {pattern}"
