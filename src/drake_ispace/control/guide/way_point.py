"""The way point: desired position P_d[i], slid along a path at constant speed by the room's computer."""

import numpy as np

from drake_ispace.blocks.block import Block, Output, Phase, Spec, Update
from drake_ispace.blocks.kernels import copy, kernel
from drake_ispace.blocks.messages import WAY_POINT
from drake_ispace.blocks.rates import TICK_S, VISION_TICKS, ticks_in
from drake_ispace.control.guide.paths import Path, Trajectory

_COLUMNS = 6


@kernel
def slide(tick, table, start_s, speed_m_s, end_m, length_m, tangent, heading_rad, first, pulse_end_s, out):
    """x_d = the message. `first` (2,): where the way point rests before a step or pulse."""
    out[:] = 0.0
    out[0] = tick
    rows = table.shape[0] // _COLUMNS
    time = tick * TICK_S
    if rows == 1:  # a step, or a pulse until pulse_end_s
        at_goal = start_s <= time and time < pulse_end_s
        out[1], out[2] = (table[1], table[2]) if at_goal else (first[0], first[1])
        out[3] = heading_rad
        return
    travelled = min(max(speed_m_s * (time - start_s), 0.0), end_m)
    moving = start_s <= time and travelled < end_m
    arc = min(travelled, length_m)  # at the end of the last lap, not at the start of another
    if moving and end_m > length_m:
        arc = travelled - length_m * np.floor(travelled / length_m)
    low, high = 0, rows - 1
    while high - low > 1:
        middle = (low + high) // 2
        if table[_COLUMNS * middle] <= arc:
            low = middle
        else:
            high = middle
    a, b = _COLUMNS * low, _COLUMNS * high
    gap = table[b] - table[a]
    share = (arc - table[a]) / gap if gap > 0.0 else 0.0
    out[1] = table[a + 1] + share * (table[b + 1] - table[a + 1])
    out[2] = table[a + 2] + share * (table[b + 2] - table[a + 2])
    tx = table[a + 3] + share * (table[b + 3] - table[a + 3])
    ty = table[a + 4] + share * (table[b + 4] - table[a + 4])
    curvature = table[a + 5] + share * (table[b + 5] - table[a + 5])
    out[3] = np.arctan2(ty, tx) if tangent > 0.0 else heading_rad
    if moving:
        out[4], out[5] = speed_m_s * tx, speed_m_s * ty
        out[7], out[8] = -speed_m_s**2 * curvature * ty, speed_m_s**2 * curvature * tx
        if tangent > 0.0:
            out[6] = speed_m_s * curvature


@kernel
def message(xd, out):
    copy(xd, out)


class WayPoint(Block):
    """The way point in force, renewed every 95 ms.

    .. pydrake_system::

        name: WayPoint
        output_ports:
        - way_point

    way_point (10,): tick, then x, y [m], phi [rad], their rates [m/s, rad/s] and accelerations [m/s^2, rad/s^2] in W.
    P_d of Fig. 6.5. Corners of a path are not rounded: there the rates jump.

    Args:
        trajectory: how the way point moves; path: of `build_path`; first: where it rests before a step or pulse [m].
    """

    def __init__(self, trajectory: Trajectory, path: Path, first=(0.0, 0.0)):
        laps = (trajectory.laps or np.inf) if path.closed else 1
        start = np.zeros(WAY_POINT)
        start[0] = -1.0
        start_s = ticks_in(trajectory.start_s) * TICK_S  # whole ticks, or 0.95 s would wait for the camera after it
        pulse_s = ticks_in(trajectory.width_s) * TICK_S if trajectory.kind == "pulse" else np.inf
        super().__init__(Spec(
            outputs={"way_point": Output(WAY_POINT, message)},
            parameters={
                "table": path.table.ravel(), "start_s": start_s, "speed_m_s": trajectory.speed_m_s,
                "end_m": laps * path.length_m if path.length_m > 0.0 else 0.0, "length_m": path.length_m,
                "tangent": float(trajectory.heading == "tangent"), "heading_rad": trajectory.heading_rad,
                "first": np.asarray(first, dtype=float),
                "pulse_end_s": start_s + pulse_s,
            },
            discrete_state=start, updates=(Update(slide, Phase.SENSE, VISION_TICKS),),
        ))
