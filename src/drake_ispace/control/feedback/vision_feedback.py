"""Vision feedback, Fig. 6.9: PID on the room's pose and its backward difference, at 95 ms only."""

import numpy as np

from drake_ispace.blocks.block import Block, Output, Phase, Spec, Update
from drake_ispace.blocks.frames import wrap
from drake_ispace.blocks.kernels import copy, kernel
from drake_ispace.blocks.messages import ESTIMATE, FIX, POSE, WAY_POINT
from drake_ispace.blocks.rates import TICK_S, VISION_TICKS

RATE, INTEGRAL = 4, 7  # x_d: the last seen fix as an estimate, its backward difference, the integral of its error


@kernel
def step(xd, fix, way_point, k_p, k_i, limit, out):
    """Take in a new fix; one seen before changes nothing, nor does one in which the robot is not seen."""
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
        # anti-windup: integrate only what the limit lets through, or what leads out of it
        unlimited = abs(k_p[i] * error + k_i[i] * grown) <= limit[i]
        if unlimited or abs(grown) < abs(xd[INTEGRAL + i]):
            out[INTEGRAL + i] = grown


@kernel
def force(xd, way_point, k_p, k_i, k_d, limit, mass, velocity_share, acceleration_share, out):
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
    """PID feedback from the room's pose only.

    .. pydrake_system::

        name: VisionFeedback
        input_ports:
        - fix
        - way_point
        output_ports:
        - force
        - pose

    fix (5,): tick of capture, seen, x, y [m], phi [rad]. way_point (10,): messages.WAY_POINT. force (3,): Fx, Fy
    [N], moment [N m] in W. pose (4,): tick, x, y [m], phi [rad] of the last seen fix, at whose heading the force is
    applied.

    Args:
        k_p, k_i, k_d: (3,) gains; the thesis's k_i is zero. limit: (3,) largest force, for anti-windup.
        mass: (3,) for the fed-forward acceleration.
        velocity_feed_forward, acceleration_feed_forward: of the way point; the thesis has neither, (6.13).
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
