"""Servo control of position, (3.52)-(3.62), Fig. 3.9: state feedback plus the integral of the position error."""

from dataclasses import dataclass

import numpy as np

from drake_ispace.blocks.block import Block, Output, Phase, Spec, Update
from drake_ispace.blocks.functions import cos, sin
from drake_ispace.blocks.kernels import copy, kernel
from drake_ispace.blocks.messages import POSE, STATE, WAY_POINT
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.files.quantity import quantity


@dataclass
class Servo:
    """Gains of (3.61)-(3.62). Both wheels get the same torque, so only the sum of the columns of B acts."""

    # F: gains of s, theta, s_dot, theta_dot
    f: list[float] = quantity([6.7056, 2.1560, 6.0055, 0.6502], "N, N*m, N*s, N*m*s", length=4)
    # K_i: gain of the integral
    k_i: float = quantity(3.5355, "N/s")


TICK, INTEGRAL, MEASURED = 0, 1, 2  # x_d: tick of the last sample, omega, s, theta, s_dot, theta_dot


@kernel
def step(xd, state, way_point, start, out):
    """Integrate omega_dot = r - s, (3.58) corrected; a sample whose tick is already stored changes nothing."""
    copy(xd, out)
    if state[STATE.tick] == xd[TICK]:
        return
    dx, dy = way_point[WAY_POINT.x] - start[POSE.x], way_point[WAY_POINT.y] - start[POSE.y]
    r = cos(start[POSE.phi]) * dx + sin(start[POSE.phi]) * dy
    if xd[TICK] >= 0.0 and way_point[WAY_POINT.tick] >= 0.0:
        out[INTEGRAL] = xd[INTEGRAL] + TICK_S * (r - state[STATE.s])
    copy(state[STATE.s :], out[MEASURED:])
    out[TICK] = state[STATE.tick]


@kernel
def feedback(xd, f, k_i, sign, out):
    """Write the same torque sign (K_i omega - F x) [N m] for both wheels."""
    u = k_i * xd[INTEGRAL]
    for i in range(4):
        u -= f[i] * xd[MEASURED + i]
    out[0] = sign * u
    out[1] = sign * u


class ServoController(Block):
    """Computes tau = sign (K_i omega - F x), where omega is the integral of the position error.

    The measured state has direct feed-through within a tick.

    .. pydrake_system::

        name: ServoController
        input_ports:
        - state
        - way_point
        output_ports:
        - torque

    state (5,): tick, s [m], theta [rad], s_dot [m/s], theta_dot [rad/s]. way_point (10,): layout messages.WAY_POINT, of
    which tick and x, y [m] in W are used. torque (2,): right, left [N m], always equal. Equations (3.52)-(3.62).

    Args:
        servo: gains.
        start: x, y [m], phi [rad] in W of the pose at which s is zero.
        sign: 1 for the plant as printed, -1 for the plant derived from the physical parameters.
    """

    def __init__(self, servo: Servo, start=(0.0, 0.0, 0.0), sign=1.0):
        super().__init__(Spec(
            inputs={"state": len(STATE), "way_point": len(WAY_POINT)}, outputs={"torque": Output(2, feedback)},
            parameters={
                "f": np.array(servo.f), "k_i": servo.k_i, "start": np.array(start, dtype=float), "sign": sign,
            },
            discrete_state=np.array([-1.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
            updates=(Update(step, Phase.COMPUTE, through=True),),
        ))
