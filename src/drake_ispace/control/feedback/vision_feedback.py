"""Vision feedback, Fig. 6.9: PID control from the room's pose and its backward difference quotient, every 95 ms."""

import numpy as np

from drake_ispace.blocks.block import Block, Output, Phase, Spec, Update
from drake_ispace.blocks.frames import wrap
from drake_ispace.blocks.kernels import copy, kernel
from drake_ispace.blocks.messages import ESTIMATE, FIX, POSE, WAY_POINT
from drake_ispace.blocks.rates import TICK_S, VISION_TICKS

RATE, INTEGRAL = 4, 7  # x_d: the last fix with the robot seen, its difference quotient, the integral of its error


@kernel
def step(xd, fix, way_point, k_p, k_i, limit, out):
    """Update the pose, its rate and the integral of its error with a new fix.

    A fix whose tick is already stored, or in which the robot is not seen, changes nothing.
    """
    copy(xd, out)
    if not (fix[FIX.seen] > 0.0 and fix[FIX.tick] > xd[ESTIMATE.tick]):
        return
    elapsed = (fix[FIX.tick] - xd[ESTIMATE.tick]) * TICK_S
    out[ESTIMATE.tick] = fix[FIX.tick]
    for i in range(len(POSE)):
        out[ESTIMATE.x + i] = fix[FIX.x + i]
        if xd[ESTIMATE.tick] < 0.0:
            continue
        change = fix[FIX.x + i] - xd[ESTIMATE.x + i]
        error = way_point[WAY_POINT.x + i] - fix[FIX.x + i]
        if i == POSE.phi:
            change, error = wrap(change), wrap(error)
        out[RATE + i] = change / elapsed
        grown = xd[INTEGRAL + i] + error * elapsed
        # anti-windup: integrate only below the limit, or towards zero
        unlimited = abs(k_p[i] * error + k_i[i] * grown) <= limit[i]
        if unlimited or abs(grown) < abs(xd[INTEGRAL + i]):
            out[INTEGRAL + i] = grown


@kernel
def force(xd, way_point, k_p, k_i, k_d, limit, mass, velocity_share, acceleration_share, out):
    """Write the limited PID force Fx, Fy [N] and moment [N m] in W; zero before the first fix and way point."""
    for i in range(len(POSE)):
        out[i] = 0.0
        if xd[ESTIMATE.tick] >= 0.0 and way_point[WAY_POINT.tick] >= 0.0:
            error = way_point[WAY_POINT.x + i] - xd[ESTIMATE.x + i]
            if i == POSE.phi:
                error = wrap(error)
            lag = velocity_share * way_point[WAY_POINT.vx + i] - xd[RATE + i]
            push = acceleration_share * mass[i] * way_point[WAY_POINT.ax + i]
            wanted = k_p[i] * error + k_i[i] * xd[INTEGRAL + i] + k_d[i] * lag + push
            out[i] = min(max(wanted, -limit[i]), limit[i])


@kernel
def pose(xd, out):
    copy(xd[: len(ESTIMATE)], out)


class VisionFeedback(Block):
    """PID feedback of the room's pose, without odometry.

    .. pydrake_system::

        name: VisionFeedback
        input_ports:
        - fix
        - way_point
        output_ports:
        - force
        - pose

    fix (5,): tick of capture, seen, x, y [m], phi [rad] in W. way_point (10,): layout messages.WAY_POINT, pose,
    velocity and acceleration in W. force (3,): Fx, Fy [N], moment [N m] in W, zero before the first fix and way point.
    pose (4,): tick, x, y [m], phi [rad] in W of the last fix in which the robot was seen; its heading serves to convert
    the force into wheel torques. Fig. 6.9.

    Args:
        k_p, k_i, k_d: (3,) gains of x, y and phi in W; the thesis's k_i is zero.
        limit: (3,) largest force and moment [N, N, N m], also used for anti-windup.
        mass: (3,) [kg, kg, kg m^2], multiplies the acceleration fed forward.
        velocity_feed_forward, acceleration_feed_forward: whether the way point's velocity and acceleration are fed
            forward; the thesis has neither, (6.13).
    """

    def __init__(
        self, k_p, k_i, k_d, limit=(np.inf, np.inf, np.inf), mass=(0.0, 0.0, 0.0), velocity_feed_forward=False,
        acceleration_feed_forward=False,
    ):
        start = np.zeros(INTEGRAL + len(POSE))
        start[ESTIMATE.tick] = -1.0
        super().__init__(Spec(
            inputs={"fix": len(FIX), "way_point": len(WAY_POINT)},
            outputs={"force": Output(3, force), "pose": Output(len(ESTIMATE), pose)},
            parameters={
                **{
                    name: np.asarray(value, dtype=float)
                    for name, value in (("k_p", k_p), ("k_i", k_i), ("k_d", k_d), ("limit", limit), ("mass", mass))
                },
                "velocity_share": float(velocity_feed_forward), "acceleration_share": float(acceleration_feed_forward),
            },
            discrete_state=start, updates=(Update(step, Phase.COMPUTE, VISION_TICKS, through=True),),
        ))
