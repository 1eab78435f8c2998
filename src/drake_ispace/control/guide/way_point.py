"""The way point: the desired pose P_d[i], which the room's computer moves along a path at constant speed."""

import numpy as np

from drake_ispace.blocks.block import Block, Output, Phase, Spec, Update
from drake_ispace.blocks.functions import atan2, floor
from drake_ispace.blocks.kernels import copy, kernel
from drake_ispace.blocks.messages import WAY_POINT
from drake_ispace.blocks.rates import TICK_S, VISION_TICKS, ticks_in
from drake_ispace.control.guide.paths import ROW, Path, Trajectory


@kernel
def slide(tick, table, start_s, speed_m_s, end_m, length_m, tangent, heading_rad, first, pulse_end_s, out):
    """Compute the way point at the present tick into x_d, which is the message.

    table: the path's table, row by row; end_m: length of all laps [m]; first (2,): place of the way point before a step
    or pulse, and after a pulse, x, y [m].
    """
    out[:] = 0.0
    out[WAY_POINT.tick] = tick
    rows = table.shape[0] // len(ROW)
    time = tick * TICK_S
    if rows == 1:  # a step, or a pulse until pulse_end_s
        at_goal = start_s <= time and time < pulse_end_s
        out[WAY_POINT.x] = table[ROW.x] if at_goal else first[0]
        out[WAY_POINT.y] = table[ROW.y] if at_goal else first[1]
        out[WAY_POINT.phi] = heading_rad
        return
    travelled = min(max(speed_m_s * (time - start_s), 0.0), end_m)
    moving = start_s <= time and travelled < end_m
    arc = min(travelled, length_m)  # after the last lap the way point rests at the end, not at the start of another lap
    if moving and end_m > length_m:
        arc = travelled - length_m * floor(travelled / length_m)
    low, high = 0, rows - 1
    while high - low > 1:
        middle = (low + high) // 2
        if table[len(ROW) * middle + ROW.s] <= arc:
            low = middle
        else:
            high = middle
    a, b = len(ROW) * low, len(ROW) * high
    gap = table[b + ROW.s] - table[a + ROW.s]
    share = (arc - table[a + ROW.s]) / gap if gap > 0.0 else 0.0
    out[WAY_POINT.x] = table[a + ROW.x] + share * (table[b + ROW.x] - table[a + ROW.x])
    out[WAY_POINT.y] = table[a + ROW.y] + share * (table[b + ROW.y] - table[a + ROW.y])
    tx = table[a + ROW.tangent_x] + share * (table[b + ROW.tangent_x] - table[a + ROW.tangent_x])
    ty = table[a + ROW.tangent_y] + share * (table[b + ROW.tangent_y] - table[a + ROW.tangent_y])
    curvature = table[a + ROW.curvature] + share * (table[b + ROW.curvature] - table[a + ROW.curvature])
    out[WAY_POINT.phi] = atan2(ty, tx) if tangent > 0.0 else heading_rad
    if moving:
        out[WAY_POINT.vx], out[WAY_POINT.vy] = speed_m_s * tx, speed_m_s * ty
        out[WAY_POINT.ax] = -speed_m_s**2 * curvature * ty
        out[WAY_POINT.ay] = speed_m_s**2 * curvature * tx
        if tangent > 0.0:
            out[WAY_POINT.wz] = speed_m_s * curvature


@kernel
def message(xd, out):
    copy(xd, out)


class WayPoint(Block):
    """Moves the way point along its path, with a new sample every 95 ms, when a fix is there.

    .. pydrake_system::

        name: WayPoint
        output_ports:
        - way_point

    way_point (10,): tick, then x, y [m], phi [rad], their rates [m/s, rad/s] and accelerations [m/s^2, rad/s^2] in W.
    P_d of Fig. 6.5. Corners of a path are not rounded, so the rates jump at a corner.

    Args:
        trajectory: how the way point moves.
        path: the path of the trajectory, from `build_path`.
        first: x, y [m] in W of the way point before a step or pulse, and after a pulse.
        latency_ticks: of the room's camera: the way point is sampled when a fix is there, and goes out with it.
    """

    def __init__(self, trajectory: Trajectory, path: Path, first=(0.0, 0.0), latency_ticks: int = 0):
        laps = (trajectory.laps or np.inf) if path.closed else 1
        start = np.zeros(len(WAY_POINT))
        start[WAY_POINT.tick] = -1.0
        start_s = ticks_in(trajectory.start_s) * TICK_S  # in whole ticks; 0.95 s exactly would miss its vision tick
        pulse_s = ticks_in(trajectory.width_s) * TICK_S if trajectory.kind == "pulse" else np.inf
        super().__init__(Spec(
            outputs={"way_point": Output(len(WAY_POINT), message)},
            parameters={
                "table": path.table.ravel(), "start_s": start_s, "speed_m_s": trajectory.speed_m_s,
                "end_m": laps * path.length_m if path.length_m > 0.0 else 0.0, "length_m": path.length_m,
                "tangent": float(trajectory.heading == "tangent"), "heading_rad": trajectory.heading_rad,
                "first": np.asarray(first, dtype=float),
                "pulse_end_s": start_s + pulse_s,
            },
            discrete_state=start, updates=(Update(slide, Phase.SENSE, VISION_TICKS, latency_ticks),),
        ))
