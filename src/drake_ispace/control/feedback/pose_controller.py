"""State feedback for the omni robot, (6.23): the force from the estimated pose and the velocity of odometry."""

import numpy as np

from drake_ispace.blocks.block import Block, Output, Spec
from drake_ispace.blocks.frames import wrap
from drake_ispace.blocks.functions import cos, sin
from drake_ispace.blocks.kernels import kernel
from drake_ispace.blocks.messages import ESTIMATE, WAY_POINT


@kernel
def force(estimate, body_velocity, way_point, k_p, k_d, mass, velocity_share, acceleration_share, out):
    """Write F = K_p (P_d - P_es) - K_d (v - v_d) + M a_d in W; zero before the first way point.

    k_p, k_d: (9,) row by row; mass: (3,) diagonal of M.
    """
    if way_point[WAY_POINT.tick] < 0.0:
        out[:] = 0.0
        return
    phi = estimate[ESTIMATE.phi]
    c, s = cos(phi), sin(phi)
    e0 = way_point[WAY_POINT.x] - estimate[ESTIMATE.x]
    e1 = way_point[WAY_POINT.y] - estimate[ESTIMATE.y]
    e2 = wrap(way_point[WAY_POINT.phi] - phi)
    v0 = velocity_share * way_point[WAY_POINT.vx] - (c * body_velocity[0] - s * body_velocity[1])
    v1 = velocity_share * way_point[WAY_POINT.vy] - (s * body_velocity[0] + c * body_velocity[1])
    v2 = velocity_share * way_point[WAY_POINT.wz] - body_velocity[2]
    for i in range(3):
        out[i] = (
            k_p[3 * i] * e0 + k_p[3 * i + 1] * e1 + k_p[3 * i + 2] * e2
            + k_d[3 * i] * v0 + k_d[3 * i + 1] * v1 + k_d[3 * i + 2] * v2
            + acceleration_share * mass[i] * way_point[WAY_POINT.ax + i]
        )


class PoseController(Block):
    """Linear feedback of pose and velocity, Fig. 6.5.

    .. pydrake_system::

        name: PoseController
        input_ports:
        - estimate
        - body_velocity
        - way_point
        output_ports:
        - force

    estimate (4,): tick, x, y [m], phi [rad] in W. body_velocity (3,): vx, vy [m/s], wz [rad/s] in B, which the block
    rotates to W by the estimated heading. way_point (10,): layout messages.WAY_POINT, pose, velocity and acceleration
    in W. force (3,): Fx, Fy [N], moment [N m] in W, zero before the first way point. Equation (6.23) with P_es.

    Args:
        k_p, k_d: (3, 3) gains from errors in W [m, rad], [m/s, rad/s] to force [N, N, N m].
        mass: (3,) [kg, kg, kg m^2], multiplies the acceleration fed forward.
        velocity_feed_forward, acceleration_feed_forward: whether the way point's velocity and acceleration are fed
            forward; the thesis has neither, (6.13).
    """

    def __init__(self, k_p, k_d, mass, velocity_feed_forward=False, acceleration_feed_forward=False):
        super().__init__(Spec(
            inputs={"estimate": len(ESTIMATE), "body_velocity": 3, "way_point": len(WAY_POINT)},
            outputs={"force": Output(3, force)},
            parameters={
                "k_p": np.asarray(k_p, dtype=float).ravel(), "k_d": np.asarray(k_d, dtype=float).ravel(),
                "mass": np.asarray(mass, dtype=float), "velocity_share": float(velocity_feed_forward),
                "acceleration_share": float(acceleration_feed_forward),
            },
        ))
