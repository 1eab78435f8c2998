"""Servo control of position, (3.52)-(3.62), Fig. 3.9: state feedback and the integral of the position error."""

from dataclasses import dataclass

import numpy as np

from drake_ispace.blocks.block import Block, Output, Phase, Spec, Update
from drake_ispace.blocks.kernels import copy, kernel
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.files.quantity import quantity


@dataclass
class Servo:
    """Gains of (3.61)-(3.62), the same for both wheels: u_r = u_l, so only the sum of B's columns acts."""

    # F: s, theta, s_dot, theta_dot
    f: list[float] = quantity([6.7056, 2.1560, 6.0055, 0.6502], "N, N*m, N*s, N*m*s", length=4)
    # K_i
    k_i: float = quantity(3.5355, "N/s")


@kernel
def step(xd, state, way_point, start, out):
    """x_d = [tick, omega, s_meas, theta_meas, s_dot, theta_dot]; omega_dot = r - s, (3.58) as meant."""
    copy(xd, out)
    if state[0] == xd[0]:
        return
    r = np.cos(start[2]) * (way_point[1] - start[0]) + np.sin(start[2]) * (way_point[2] - start[1])
    if xd[0] >= 0.0 and way_point[0] >= 0.0:
        out[1] = xd[1] + TICK_S * (r - state[1])
    copy(state[1:5], out[2:6])
    out[0] = state[0]


@kernel
def feedback(xd, f, k_i, sign, out):
    u = k_i * xd[1]
    for i in range(4):
        u -= f[i] * xd[2 + i]
    out[0] = sign * u
    out[1] = sign * u


class ServoController(Block):
    """tau = sign (K_i omega - F x), omega the integral of the position error; direct feed-through within a tick.

    .. pydrake_system::

        name: ServoController
        input_ports:
        - state
        - way_point
        output_ports:
        - torque

    state (5,): tick, s [m], theta [rad], s_dot [m/s], theta_dot [rad/s]. way_point (10,): tick, x, y [m], ... as
    WayPoint. torque (2,): right, left [N m]. (3.52)-(3.62).

    Args:
        servo: gains; start: x, y [m], phi [rad] where s is zero.
        sign: 1 for the plant as printed, -1 for the derived one (docs/fidelity.md: R lost in print).
    """

    def __init__(self, servo: Servo, start=(0.0, 0.0, 0.0), sign=1.0):
        super().__init__(Spec(
            inputs={"state": 5, "way_point": 10}, outputs={"torque": Output(2, feedback)},
            parameters={
                "f": np.array(servo.f), "k_i": servo.k_i, "start": np.array(start, dtype=float), "sign": sign,
            },
            discrete_state=np.array([-1.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
            updates=(Update(step, Phase.COMPUTE, through=True),),
        ))
