"""How well a run followed its reference."""

import math
from dataclasses import asdict, dataclass, fields

import numpy as np

from drake_ispace.blocks.messages import POSE, WAY_POINT
from drake_ispace.blocks.rates import TICK_S, VISION_TICKS, ticks_in
from drake_ispace.control.guide.paths import build_path
from drake_ispace.simulation import Run

_ARRIVED_M = 0.02  # close enough to the end of the trajectory
_SETTLED = 0.02  # of a step's length


@dataclass(frozen=True)
class Metrics:
    """Numbers of one robot's run, from the moment its way point starts. None: the run has no such number.

    Attributes:
        rms_position_error_m, max_position_error_m: distance to the way point.
        rms_cross_track_m: distance to the path, whatever the way point does.
        mean_lag_m: along the path behind where the way point should be by now (it is renewed every 95 ms only).
        rms_heading_error_rad: to the way point's heading; where that is along the path, only while it moves.
        overshoot_percent: of a step, beyond its goal.
        settling_time_s: after the way point's last move, until within 2 % of a step (20 mm of a path's end) for good.
        time_to_end_s: from the way point's start until first within 20 mm of its end.
        iae_m_s: integral of the position error.
        control_effort: integral of the squared wheel torques [N^2 m^2 s]; None for a robot without torques.
        final_error_m: distance to the way point in the last row.
        diverged, diverged_at_s: whether and when the robot fell or was lost; the numbers above end there.
    """

    rms_position_error_m: float | None
    max_position_error_m: float | None
    rms_cross_track_m: float | None
    mean_lag_m: float | None
    rms_heading_error_rad: float | None
    overshoot_percent: float | None
    settling_time_s: float | None
    time_to_end_s: float | None
    iae_m_s: float | None
    control_effort: float | None
    final_error_m: float | None
    diverged: bool
    diverged_at_s: float | None

    def to_data(self) -> dict:
        """By name; None for what is no finite number, which JSON cannot hold."""
        return {
            name: value if value is None or math.isfinite(value) else None for name, value in asdict(self).items()
        }


def measure(run: Run, robot: str) -> Metrics:
    """The metrics of the robot called `robot` in `run`."""
    trajectory = getattr(run.scenario, robot).trajectory
    start_s = ticks_in(trajectory.start_s) * TICK_S
    rows = (run.time_s >= start_s) & (run.signals[f"{robot}_way_point"][:, WAY_POINT.tick] >= 0.0)
    if not rows.any():
        return _lost_before_the_start(run)
    time = run.time_s[rows] - start_s
    pose = run.signals[f"{robot}_pose"][rows]
    way_point = run.signals[f"{robot}_way_point"][rows]
    torque = run.signals.get(f"{robot}_torque")
    aim, place = way_point[:, WAY_POINT.x : WAY_POINT.y + 1], pose[:, POSE.x : POSE.y + 1]
    error = np.linalg.norm(aim - place, axis=1)
    path = build_path(trajectory, f"{robot}.trajectory")
    start, end = run.signals[f"{robot}_pose"][0, POSE.x : POSE.y + 1], path.points_m[-1]
    is_step = trajectory.kind == "step"
    moving = np.linalg.norm(way_point[:, WAY_POINT.vx : WAY_POINT.vy + 1], axis=1) > 0.0
    if path.length_m == 0.0:  # a step or pulse goes straight from the start
        cross_track = _distance_to_line(place, start, end)
    else:
        cross_track, _ = path.nearest(place)
    scored = moving if trajectory.heading == "tangent" else np.ones(len(time), bool)
    turned = np.angle(np.exp(1j * (pose[:, POSE.phi] - way_point[:, WAY_POINT.phi])))[scored]

    step_m = float(np.linalg.norm(end - start))
    tolerance = _SETTLED * step_m if is_step and step_m > 0.0 else _ARRIVED_M
    has_end = trajectory.kind != "pulse" and (trajectory.laps > 0 or not path.closed)
    resting = has_end & ~moving & (np.linalg.norm(aim - end, axis=1) < 1e-9)
    # A closed path also rests at its end before it starts.
    resting &= time >= (path.length_m * (trajectory.laps if path.closed else 1)) / trajectory.speed_m_s
    overshoot = None
    if is_step and step_m > 0.0:
        beyond = (place - end) @ (end - start) / step_m
        overshoot = 100.0 * max(float(beyond.max()), 0.0) / step_m
    return Metrics(
        rms_position_error_m=_rms(error), max_position_error_m=float(error.max()), rms_cross_track_m=_rms(cross_track),
        mean_lag_m=_mean_lag(path, trajectory, time, place, moving),
        rms_heading_error_rad=_rms(turned) if len(turned) else None,
        overshoot_percent=overshoot, settling_time_s=_settling_time(time, error, resting, tolerance),
        time_to_end_s=_first(time, resting & (error <= _ARRIVED_M)), iae_m_s=float(error.sum() * TICK_S),
        control_effort=None if torque is None else float((torque[rows]**2).sum() * TICK_S),
        final_error_m=float(error[-1]),
        diverged=run.diverged_s is not None, diverged_at_s=run.diverged_s,
    )


def _lost_before_the_start(run):
    """There is nothing to measure but the loss."""
    numbers = dict.fromkeys((f.name for f in fields(Metrics)), None)
    return Metrics(**numbers | {"diverged": run.diverged_s is not None, "diverged_at_s": run.diverged_s})


def _rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def _first(time, condition):
    return float(time[np.argmax(condition)]) if condition.any() else None


def _mean_lag(path, trajectory, time, points, moving):
    """Arc length between the moving way point and the place on the path that the robot has come to."""
    if not moving.any():
        return None
    rows = np.arange(0, len(time), VISION_TICKS)  # the way point is renewed only that often
    rows = rows[moving[rows]]
    return float(np.mean(trajectory.speed_m_s * time[rows] - path.follow(points[rows])))


def _settling_time(time, error, resting, tolerance):
    if not resting.any() or error[-1] > tolerance:
        return None
    outside = np.flatnonzero(resting & (error > tolerance))
    settled = outside[-1] + 1 if len(outside) else np.argmax(resting)
    return float(time[settled] - time[np.argmax(resting)])


def _distance_to_line(points, start, end):
    along = end - start
    length = float(np.linalg.norm(along))
    if length == 0.0:
        return np.linalg.norm(points - end, axis=1)
    along = along / length
    offset = points - start
    return np.abs(offset[:, 0] * along[1] - offset[:, 1] * along[0])
