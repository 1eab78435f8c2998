"""Tracking error of a robot that moves along a straight line, Fig. 4.1: way point minus odometry, at fixed heading."""

import numpy as np

from drake_ispace.blocks.block import Block, Output, Spec
from drake_ispace.blocks.functions import cos, sin
from drake_ispace.blocks.kernels import kernel
from drake_ispace.blocks.messages import ERROR, PATH, POSE, WAY_POINT


@kernel
def straight(path, way_point, start, out):
    """Write s_e [m], phi_h [rad] and the way point's speed [m/s] along the line through `start` (x, y, phi in W)."""
    c, s = cos(start[POSE.phi]), sin(start[POSE.phi])
    out[:] = 0.0
    if way_point[WAY_POINT.tick] >= 0.0:
        dx, dy = way_point[WAY_POINT.x] - start[POSE.x], way_point[WAY_POINT.y] - start[POSE.y]
        out[ERROR.s_e] = c * dx + s * dy - path[PATH.s]
        out[ERROR.phi_h] = start[POSE.phi] - path[PATH.phi]
        out[ERROR.speed] = c * way_point[WAY_POINT.vx] + s * way_point[WAY_POINT.vy]


class StraightError(Block):
    """Computes the tracking error s_e, phi_h along the straight line through the start pose.

    .. pydrake_system::

        name: StraightError
        input_ports:
        - path
        - way_point
        output_ports:
        - error

    path (3,): tick, s [m], phi [rad] of odometry. way_point (10,): layout messages.WAY_POINT, of which tick, position
    [m] and velocity [m/s] in W are used. error (3,): s_e [m], phi_h [rad], speed of the way point along the line [m/s];
    zero before the first way point. Fig. 4.1.

    Args:
        start: x, y [m], phi [rad] in W of the pose at which odometry's s is zero.
    """

    def __init__(self, start=(0.0, 0.0, 0.0)):
        super().__init__(Spec(
            inputs={"path": len(PATH), "way_point": len(WAY_POINT)},
            outputs={"error": Output(len(ERROR), straight)},
            parameters={"start": np.array(start, dtype=float)},
        ))
