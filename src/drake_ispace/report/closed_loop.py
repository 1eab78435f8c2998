"""The model driven along the reference that a run was recorded with, its own controller in the loop."""

from dataclasses import replace

import numpy as np

from drake_ispace.alignment import to_recording
from drake_ispace.blocks.errors import InputError
from drake_ispace.blocks.frames import wrap
from drake_ispace.blocks.rates import TICK_S, ticks_in
from drake_ispace.explain.predict.tracks import nearest_ticks
from drake_ispace.files.recording import Channel, Recording
from drake_ispace.files.reference import direction_of, turn_of
from drake_ispace.rollout.compile import compile_diagram
from drake_ispace.scenario import Scenario
from drake_ispace.simulation import first_divergence, make_run
from drake_ispace.wiring.catalog import build_diagram

_SAME_RAD = 0.02
_AT_REST_M_S = 1e-200  # a way point at rest still has a heading; too slow to matter for anything else


def closed_loop(model: Scenario, robot: str, recording: Recording) -> Channel | None:
    """Simulate what the camera would have seen if the robot were as `model` says.

    Returns:
        The channel "kinect" of the simulated run. None where the reference cannot be followed again: the recording has
        no reference, the heading is neither fixed nor along the path, or the model refuses the path.
    """
    reference = recording.channels.get("reference")
    if reference is None or len(reference.t) < 4 or "kinect" not in recording.channels:
        return None
    heading = _heading(reference)
    if heading is None:
        return None
    table = _table(reference, heading == "tangent")
    scenario = _scenario(model, robot, reference, heading, len(table) // 2 + 1)
    scenario = replace(scenario, seconds=float(recording.channels["kinect"].t[-1]))
    try:
        diagram = build_diagram(scenario)
    except InputError:  # a reference that begins outside of the space
        return None
    return to_recording(_followed(scenario, diagram, robot, table), robot).channels.get("kinect")


def _scenario(model, robot, reference, heading, points):
    """`model` with a polyline of so many points, so that the table of its way point is as large as it must be.

    The points lie anywhere: the numbers in the table are replaced afterwards.
    """
    section = getattr(model, robot)
    trajectory = replace(
        section.trajectory, kind="polyline", csv=None, heading=heading, heading_rad=float(reference.column("phi")[0]),
        points_m=[[0.1 * share, 0.0] for share in np.linspace(0.0, 1.0, points).tolist()],
    )
    start = [float(reference.column(name)[0]) for name in ("x", "y", "phi")]
    section = replace(section, trajectory=trajectory, initial_pose=start)
    return replace(model, **{robot: section})


def _followed(scenario, diagram, robot, table):
    rollout = compile_diagram(diagram)
    block, end_s = f"{robot}_way_point", float(table[-1, 0])
    values = {"speed_m_s": 1.0, "start_s": 0.0, "end_m": end_s, "length_m": end_s}  # seconds instead of metres
    values |= {f"table[{i}]": value for i, value in enumerate(table.ravel())}
    parameters = rollout.with_parameters({f"{block}.{name}": value for name, value in values.items()})
    logs = rollout.run(ticks_in(scenario.seconds), parameters)
    return make_run(scenario, logs, first_divergence(logs, scenario.space), 0.0)


def _heading(reference):
    """How the reference turns: "fixed", "tangent" to the path, or None for anything else."""
    phi, direction, speed = np.unwrap(reference.column("phi")), *direction_of(reference)
    if np.ptp(phi) < _SAME_RAD:
        return "fixed"
    off = np.abs(wrap(phi - direction))[speed > 0.5 * speed.max()]
    return "tangent" if np.quantile(off, 0.9) < 0.1 else None


def _table(reference, tangent):
    """(even number of rows, 6) table of the way point, with time [s] in the place of arc length [m].

    Columns: time [s], x, y [m], rates of x and y [m/s], turning rate.
    """
    direction, speed = direction_of(reference)
    if tangent:
        direction = np.unwrap(reference.column("phi"))
    turn, corner = turn_of(reference, direction, speed)
    speed = np.maximum(speed, _AT_REST_M_S)
    ticks = nearest_ticks(reference.t)
    table = np.column_stack([
        ticks * TICK_S, reference.values[:, :2], speed * np.cos(direction), speed * np.sin(direction),
        np.where(corner, 0.0, turn),
    ])
    last = table[-1:] + [[1.0, 0.0, 0.0, 0.0, 0.0, 0.0]]
    return np.vstack([table, last, last + [[1.0, 0.0, 0.0, 0.0, 0.0, 0.0]]][: 3 - len(table) % 2])
