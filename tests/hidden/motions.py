"""Reference motions: way points every 95 ms along the package's paths, at speeds that vary."""

import numpy as np

from drake_ispace.control.guide.paths import Path, Trajectory, build_path

MOTIONS = ("square", "circle", "eight", "back_and_forth", "spin")
TICK_S = 0.004999999997380655
VISION_TICKS = 19
_FINE_S = 1e-3  # of the table that way points are read from
_START_S = 0.5  # at rest until then

_PATHS = {
    "square": {"kind": "square", "side_m": 1.2},
    "circle": {"kind": "circle", "radius_m": 0.6},
    "eight": {"kind": "figure_eight", "radius_m": 0.45},
}
_OMNI_PATHS = _PATHS | {
    "back_and_forth": {"kind": "line", "centre_m": [-0.55, -0.35], "goal_m": [0.55, 0.35]},
    "spin": {"kind": "circle", "radius_m": 0.4},
}
_PENDULUM_PATHS = _PATHS | {
    "back_and_forth": {"kind": "line", "centre_m": [-0.65, -0.1], "goal_m": [0.65, 0.1]},
    "spin": {"kind": "circle", "radius_m": 0.32},
}
_SPEED = {"square": 0.25, "circle": 0.26, "eight": 0.25, "back_and_forth": 0.28, "spin": 0.2}


def path_of(robot: str, motion: str) -> Path:
    """The path on the floor."""
    if motion not in MOTIONS:
        raise ValueError(f"motion is {motion!r}, expected one of {MOTIONS}")
    paths = _OMNI_PATHS if robot == "omni" else _PENDULUM_PATHS
    return build_path(Trajectory(**paths[motion]), motion)


def way_points(robot: str, motion: str, ticks: int) -> np.ndarray:
    """(m, 10) way points at ticks 0, 19, ...: tick, x, y, phi, their rates and accelerations, SI units, in W."""
    path = path_of(robot, motion)
    time = np.arange(0.0, ticks * TICK_S + 0.2, _FINE_S)
    since = np.maximum(time - _START_S, 0.0)
    if motion == "back_and_forth":
        speed = _shuttle(since, path.length_m, _SPEED[motion])
    else:
        ramp = _smooth(since / 1.0)
        speed = _SPEED[motion] * ramp * (1.0 + 0.3 * np.sin(1.7 * since))
    arc = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * _FINE_S)])
    change = np.gradient(speed, _FINE_S)
    heading, turn, twist = _heading(robot, motion, since)

    stamp = np.arange(0, ticks + 1, VISION_TICKS)
    at = np.rint(stamp * TICK_S / _FINE_S).astype(int)
    rows = np.zeros((len(stamp), 10))
    rows[:, 0] = stamp
    for row, i in zip(rows, at, strict=True):
        x, y, tx, ty, curvature = _place(path, arc[i])
        v, a = speed[i], change[i]
        row[1], row[2], row[3] = x, y, heading[i]
        row[4], row[5], row[6] = v * tx, v * ty, turn[i]
        row[7], row[8] = a * tx - v * v * curvature * ty, a * ty + v * v * curvature * tx
        row[9] = twist[i]
        if robot == "pendulum":
            row[3], row[6] = np.arctan2(ty, tx), v * curvature
    return rows


def _smooth(share):
    """0 to 1 with the slope 0 at both ends."""
    share = np.clip(share, 0.0, 1.0)
    return 0.5 - 0.5 * np.cos(np.pi * share)


def _shuttle(since, length_m, speed_m_s):
    """Signed speed of going `length_m` there and back, 0.8 s to speed up and slow down, 0.7 s rests."""
    ramp_s, rest_s = 0.8, 0.7
    going_s = length_m / speed_m_s + ramp_s
    phase = since % (going_s + rest_s)
    shape = np.minimum(_smooth(phase / ramp_s), _smooth((going_s - phase) / ramp_s))
    way = np.where((since // (going_s + rest_s)) % 2 == 0, 1.0, -1.0)
    return way * speed_m_s * np.where(phase < going_s, shape, 0.0)


def _heading(robot, motion, since):
    """Heading of the omni robot [rad], its rate and acceleration; zeros for the pendulum, which faces its path."""
    zero = np.zeros_like(since)
    ramp = _smooth(since / 2.0)
    if robot == "pendulum" or motion in ("square", "back_and_forth"):
        return zero, zero, zero
    if motion == "circle":
        rate = 0.25 * ramp
    elif motion == "eight":
        rate = 0.5 * ramp * np.cos(0.9 * since)
    else:
        rate = 0.8 * ramp * (1.0 + 0.4 * np.sin(1.1 * since))
    angle = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * _FINE_S)])
    return angle, rate, np.gradient(rate, _FINE_S)


def _place(path, arc):
    """x, y, tangent (2), curvature of the path at arc length `arc`, laps taken off."""
    table = path.table
    arc = arc % path.length_m if path.closed else min(max(arc, 0.0), path.length_m)
    low = min(max(int(np.searchsorted(table[:, 0], arc, side="right")) - 1, 0), len(table) - 2)
    gap = table[low + 1, 0] - table[low, 0]
    share = (arc - table[low, 0]) / gap if gap > 0.0 else 0.0
    return table[low, 1:] + share * (table[low + 1, 1:] - table[low, 1:])
