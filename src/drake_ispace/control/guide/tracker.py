"""Trajectory tracker for a robot that cannot move sideways, (6.28)-(6.31), on the room's computer.

Let d be the distance to the way point and phi_h = phi_T - phi_r the bearing error. The tracker has three modes:

* corrected (default): s_e = d cos(phi_h) - look_ahead, limited. The bearing error phi_h is folded into +-90 degrees, so
  that the robot backs up to a way point behind it. It is also scaled by min(1, d / hold_radius), so that it fades at
  the way point instead of changing its sign. The look-ahead acts while the way point moves; when the way point stops,
  the robot closes up to it. The way point's speed is fed forward only with look-ahead, because otherwise the robot
  would overtake the way point and spin.
* as_printed: (6.31) mixes dx, dy in W with cos(phi_h), sin(phi_h). A robot that faces y with the way point straight
  ahead gets s_e = 0.
* jacobian: s_e = d without look-ahead or limit. This is a reading of the blue line of Fig. 6.2, "position feedback with
  Jacobian matrix".
"""

from dataclasses import dataclass

import numpy as np

from drake_ispace.blocks.block import Block, Output, Phase, Spec, Update
from drake_ispace.blocks.frames import wrap
from drake_ispace.blocks.functions import atan2, cos, sin
from drake_ispace.blocks.kernels import copy, kernel
from drake_ispace.blocks.messages import FIX, TRACKING_ERROR, WAY_POINT
from drake_ispace.blocks.rates import VISION_TICKS
from drake_ispace.files.quantity import quantity

MODES = ("corrected", "as_printed", "jacobian")


@dataclass
class Tracker:
    """Settings of the trajectory tracker."""

    mode: str = quantity("corrected", choices=MODES)
    look_ahead_m: float = quantity(0.2, "m", minimum=0.0)
    feed_forward: bool = quantity(True)
    # distance from the way point within which the bearing error fades out
    hold_radius_m: float = quantity(0.1, "m", above=0.0)
    # limit of s_e
    longest_error_m: float = quantity(0.5, "m", above=0.0)


@kernel
def step(xd, fix, way_point, out):
    """Set x_d to the last fix in which the robot was seen."""
    copy(fix if fix[FIX.seen] > 0.0 else xd, out)


@kernel
def tracking_error(xd, way_point, mode, look_ahead_m, feed_forward, hold_radius_m, longest_error_m, out):
    """Write the tracking error; all but the ticks is zero before the first fix and way point. mode: index in MODES."""
    out[:] = 0.0
    out[TRACKING_ERROR.tick], out[TRACKING_ERROR.way_point_tick] = xd[FIX.tick], way_point[WAY_POINT.tick]
    if xd[FIX.tick] < 0.0 or way_point[WAY_POINT.tick] < 0.0:
        return
    dx, dy = way_point[WAY_POINT.x] - xd[FIX.x], way_point[WAY_POINT.y] - xd[FIX.y]
    distance = np.sqrt(dx * dx + dy * dy)
    bearing = atan2(dy, dx) - xd[FIX.phi]
    if mode == 1.0:
        c, s = cos(bearing), sin(bearing)
        out[TRACKING_ERROR.s_e] = c * np.sqrt((dx * c) ** 2 + (dy * s) ** 2)
        out[TRACKING_ERROR.phi_h] = bearing
        return
    bearing = wrap(bearing)
    if mode == 2.0:
        out[TRACKING_ERROR.s_e], out[TRACKING_ERROR.phi_h] = distance, bearing
        return
    speed = np.sqrt(way_point[WAY_POINT.vx] ** 2 + way_point[WAY_POINT.vy] ** 2)
    side, folded = 1.0, bearing  # side -1: the way point lies behind and the robot backs up to it
    if bearing > 0.5 * np.pi:
        side, folded = -1.0, bearing - np.pi
    elif bearing < -0.5 * np.pi:
        side, folded = -1.0, bearing + np.pi
    ahead = side * look_ahead_m if speed > 0.0 else 0.0
    error = distance * cos(bearing) - ahead
    out[TRACKING_ERROR.s_e] = min(max(error, -longest_error_m), longest_error_m)
    out[TRACKING_ERROR.phi_h] = folded * min(1.0, distance / hold_radius_m)
    out[TRACKING_ERROR.speed] = side * speed if feed_forward > 0.0 and ahead != 0.0 else 0.0


class TrajectoryTracker(Block):
    """Computes the tracking error from the room's fix and the way point every 95 ms.

    .. pydrake_system::

        name: TrajectoryTracker
        input_ports:
        - fix
        - way_point
        output_ports:
        - error

    fix (5,): tick of capture, seen, x, y [m], phi [rad] in W; while the robot is not seen, the block uses the last fix
    in which it was. way_point (10,): layout messages.WAY_POINT, of which tick, position and velocity in W are used.
    error (5,): tick of capture of the fix, tick of the way point, error s_e [m] along the robot's heading, bearing
    error phi_h [rad], speed to feed forward [m/s]. P_e of (6.28).

    Args:
        tracker: mode and parameters.
        latency_ticks: of the room's camera: the error is computed when a fix is there.
    """

    def __init__(self, tracker: Tracker, latency_ticks: int = 0):
        start = np.zeros(len(FIX))
        start[FIX.tick] = -1.0
        super().__init__(Spec(
            inputs={"fix": len(FIX), "way_point": len(WAY_POINT)},
            outputs={"error": Output(len(TRACKING_ERROR), tracking_error)},
            parameters={
                "mode": float(MODES.index(tracker.mode)), "look_ahead_m": tracker.look_ahead_m,
                "feed_forward": float(tracker.feed_forward), "hold_radius_m": tracker.hold_radius_m,
                "longest_error_m": tracker.longest_error_m,
            },
            discrete_state=start, updates=(Update(step, Phase.COMPUTE, VISION_TICKS, latency_ticks, through=True),),
        ))
