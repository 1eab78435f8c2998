"""The error of a robot that moves along one straight line, Fig. 4.1: way point minus odometry, heading held."""

import numpy as np

from drake_ispace.blocks.block import Block, Output, Spec
from drake_ispace.blocks.kernels import kernel


@kernel
def straight(path, way_point, start, out):
    c, s = np.cos(start[2]), np.sin(start[2])
    out[0], out[1], out[2] = 0.0, 0.0, 0.0
    if way_point[0] >= 0.0:
        out[0] = c * (way_point[1] - start[0]) + s * (way_point[2] - start[1]) - path[1]
        out[1] = start[2] - path[2]
        out[2] = c * way_point[4] + s * way_point[5]


class StraightError(Block):
    """s_e and phi_h for motion along the line through the start.

    .. pydrake_system::

        name: StraightError
        input_ports:
        - path
        - way_point
        output_ports:
        - error

    path (3,): tick, s [m], phi [rad] of odometry. way_point (10,): as WayPoint. error (3,): s_e [m], phi_h [rad],
    speed of the way point [m/s], zero before the first way point. Fig. 4.1.

    Args:
        start: x, y [m], phi [rad] where odometry's s is zero.
    """

    def __init__(self, start=(0.0, 0.0, 0.0)):
        super().__init__(Spec(
            inputs={"path": 3, "way_point": 10}, outputs={"error": Output(3, straight)},
            parameters={"start": np.array(start, dtype=float)},
        ))
