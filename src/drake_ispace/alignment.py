"""From a simulated run to a recording: the one place that aligns logs.

A log shows the value *before* the updates of its instant (docs/semantics.md): row k of a sampled signal holds the
sample of tick k - 1. Messages carry the tick of their sample, so they are placed by their stamp; the torque or body
velocity commanded on [t_k, t_k+1) is what row k + 1 shows; the truth in row k is the state at t_k.
"""

import numpy as np

from drake_ispace.blocks.messages import ENCODER, FIX, IMU, TICK, WAY_POINT, wheels_in
from drake_ispace.blocks.rates import TICK_S, VISION_S
from drake_ispace.files.recording import Channel, Recording
from drake_ispace.robots.library import robots
from drake_ispace.scenario import difference
from drake_ispace.simulation import Run


def to_recording(run: Run, robot: str) -> Recording:
    """The recording of the robot called `robot` in `run`, truth included; channels without a sample left out."""
    own = f"{robot}_"
    signal = {name.removeprefix(own): rows for name, rows in run.signals.items() if name.startswith(own)}
    n = wheels_in(signal["encoder"].shape[1])
    wheels = robots()[robot].wheel_names or tuple(str(i) for i in range(1, n + 1))
    known = robots()[robot].truth
    ticks = np.arange(len(signal["pose"]))
    channels = {"reference": _stamped(signal["way_point"], WAY_POINT.x, ("x", "y", "phi"), VISION_S)}
    for name, columns in (("torque", tuple(f"tau_{w}" for w in wheels)), ("command", ("vx", "vy", "wz"))):
        if name in signal:
            channels[name] = _channel(ticks[:-1], signal[name][1:], columns, TICK_S)
    channels["encoder"] = _stamped(signal["encoder"], ENCODER.theta, tuple(f"theta_{w}" for w in wheels), TICK_S)
    channels["kinect"] = _kinect(signal["fix"])
    if "imu" in signal:
        channels["imu"] = _stamped(signal["imu"], IMU.ax, ("ax", "ay", "az", "wx", "wy", "wz"), TICK_S)
    channels["truth"] = Channel(
        _time(ticks), ("x", "y", "phi", *known.columns), np.hstack([signal["pose"], signal[known.signal]]),
        dict(zip(known.columns, known.units, strict=True)), round(TICK_S, 6),
    )
    channels = {name: channel for name, channel in channels.items() if len(channel.t)}
    notes = f"simulated, seed {run.scenario.seed}"
    return Recording(robot, run.scenario.diagram, channels, notes, settings=difference(run.scenario))


def _time(ticks):
    """Seconds to the microsecond: 20.0 for tick 4000, whose exact time is 19.99999998952262 s."""
    return np.round(np.asarray(ticks) * TICK_S, 6)


def _channel(ticks, values, columns, period_s):
    return Channel(_time(ticks), columns, values, {}, round(period_s, 6))


def _new_rows(messages):
    """The first row of every message, those before the first sample left out."""
    stamps = messages[:, TICK]
    return np.flatnonzero((stamps >= 0.0) & (np.diff(stamps, prepend=-1.0) != 0.0))


def _stamped(messages, first, columns, period_s):
    """The channel of what `messages` hold from the index `first` on, under the names `columns`."""
    rows = _new_rows(messages)
    return _channel(messages[rows, TICK], messages[rows, first : first + len(columns)], columns, period_s)


def _kinect(fixes):
    rows = _new_rows(fixes)
    rows = rows[fixes[rows, FIX.seen] > 0.0]
    captured = fixes[rows, FIX.tick]
    arrived = np.maximum(rows - 1, captured)  # row k first shows what arrived at tick k - 1; a clock may be ahead
    values = np.column_stack([fixes[rows, FIX.x : FIX.phi + 1], _time(arrived)])
    return Channel(_time(captured), ("x", "y", "phi", "t_received"), values, {}, round(VISION_S, 6))
