"""On-line identification in the loop: recursive least squares every tick with the regressor of Table 4.1.

Both wheels get the same torque, so only the sum of the columns of B is identifiable. The regression therefore uses the
sums over both wheels:

    [s'', theta''] = Theta' [theta, sgn w_r + sgn w_l, w_r + w_l, tau_r + tau_l].

No signal is differentiated twice. The accelerometer gives s'', after the filtered tilt has been used to remove gravity,
and a difference quotient of the gyro gives theta''. The encoder's speed is a difference quotient of the counts, which
belongs to the middle of the tick, and passes a low-pass. The tilt, the torque held over the same tick, the signs and
both accelerations pass the same low-pass, so that the linear relation holds between the filtered signals.
"""

from dataclasses import dataclass

import numpy as np

from drake_ispace.blocks.block import Block, Output, Phase, Spec, Update
from drake_ispace.blocks.functions import cos, sin
from drake_ispace.blocks.kernels import copy, kernel
from drake_ispace.blocks.messages import IMU, TILT, WHEEL_PAIR
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.control.adaptive.rwls import update
from drake_ispace.files.quantity import quantity
from drake_ispace.plants.slip import GRAVITY


@dataclass
class Identifier:
    """Settings of the on-line identifier. No command depends on the identified parameters."""

    # forgetting factor lambda of (3.21)
    forgetting: float = quantity(0.9998, above=0.0, maximum=1.0)
    # P(0) = initial_variance times the identity, for the scaled regressors
    initial_variance: float = quantity(1e4, above=0.0)
    # largest trace of P, which guards against wind-up
    trace_limit: float = quantity(1e5, above=0.0)
    # wheel speed above which the sign counts as known
    dead_band_rad_s: float = quantity(0.1, "rad/s", minimum=0.0)


TICK, GYRO, LEAN, REG, ACC, THETA = 0, 1, 2, 3, 7, 9  # x_d: tick, last gyro and tilt, filtered regressor (4) and Y (2)
ROOT, SCRATCH, SIZE = THETA + 8, THETA + 24, THETA + 28
_SIZES = np.array([0.05, 1.0, 2.0, 0.02])  # scales of the regressors, so that P(0) means the same for each


@kernel
def learn(out, first, second, forgetting, trace_limit):
    """Update Theta and the root of P inside x_d (`out`) with the innovations of s'' and theta''."""
    innovation = np.array([first, second])
    update(
        out[REG : REG + 4], innovation, forgetting, trace_limit, out[THETA : THETA + 8], out[ROOT : ROOT + 16],
        out[SCRATCH : SCRATCH + 4],
    )


@kernel
def step(xd, encoder, imu, tilt, torque, memory, forgetting, trace_limit, dead_band_rad_s, sizes, out):
    """Filter regressor and accelerations and update Theta; a sample whose tick is already stored changes nothing."""
    copy(xd, out)
    if encoder[WHEEL_PAIR.tick] == xd[TICK]:
        return
    out[TICK], out[GYRO], out[LEAN] = encoder[WHEEL_PAIR.tick], imu[IMU.wy], tilt[TILT.angle]
    if xd[TICK] < 0.0:
        return
    signs, speed = 0.0, encoder[WHEEL_PAIR.omega_r] + encoder[WHEEL_PAIR.omega_l]
    for i in range(2):
        rate = encoder[WHEEL_PAIR.omega_r + i]
        if abs(rate) > dead_band_rad_s:
            signs += np.sign(rate)
    keep, add = memory, 1.0 - memory
    out[REG] = keep * xd[REG] + add * 0.5 * (tilt[TILT.angle] + xd[LEAN]) / sizes[0]
    out[REG + 1] = keep * xd[REG + 1] + add * signs / sizes[1]
    out[REG + 2] = speed / sizes[2]
    out[REG + 3] = keep * xd[REG + 3] + add * (torque[0] + torque[1]) / sizes[3]
    level = (imu[IMU.ax] + GRAVITY * sin(tilt[TILT.angle])) / cos(tilt[TILT.angle])
    out[ACC] = keep * xd[ACC] + add * level
    out[ACC + 1] = keep * xd[ACC + 1] + add * (imu[IMU.wy] - xd[GYRO]) / TICK_S
    for j in range(2):
        predicted = 0.0
        for i in range(4):
            predicted += out[REG + i] * out[THETA + 2 * i + j]
        out[SCRATCH + j] = out[ACC + j] - predicted
    first, second = out[SCRATCH], out[SCRATCH + 1]
    learn(out, first, second, forgetting, trace_limit)


@kernel
def parameters(xd, sizes, out):
    """Write Theta (4, 2) row by row, for the regressors without scaling."""
    for i in range(4):
        for j in range(2):
            out[2 * i + j] = xd[THETA + 2 * i + j] / sizes[i]


@kernel
def friction(xd, sizes, out):
    """Write the friction coefficients of (4.8)-(4.9), the least-squares solution over both rows.

    The coefficients are zero while the identified input gains are too small to divide by.
    """
    b0, b1 = xd[THETA + 6] / sizes[3], xd[THETA + 7] / sizes[3]
    size = b0 * b0 + b1 * b1
    out[0], out[1] = 0.0, 0.0
    if size > 1.0:
        out[0] = -(b0 * xd[THETA + 2] + b1 * xd[THETA + 3]) / sizes[1] / size
        out[1] = -(b0 * xd[THETA + 4] + b1 * xd[THETA + 5]) / sizes[2] / size


class OnlineIdentifier(Block):
    """Identifies a linear model of the pendulum and its friction while the robot balances, starting from Theta = 0.

    .. pydrake_system::

        name: OnlineIdentifier
        input_ports:
        - encoder
        - imu
        - tilt
        - torque
        output_ports:
        - parameters
        - friction

    encoder (5,): tick, theta (2) [rad], low-pass filtered omega (2) [rad/s]. imu (7,): tick, specific force (3)
    [m/s^2], angular rate (3) [rad/s] in the body's axes. tilt (4,): tick, tilt [rad], rate [rad/s], gyro bias [rad/s].
    torque (2,): wheel torques held until this tick [N m]. parameters (8,): Theta (4, 2) row by row, with one row each
    for [theta, sgn, omega, tau] and one column each for s'' [m/s^2] and theta'' [rad/s^2]. friction (2,): c_cu [N m],
    c_v [N m s/rad]. Equations (3.20)-(3.26), (4.1)-(4.9), Table 4.1.

    Args:
        identifier: forgetting factor, initial variance and limits.
        filter_time_constant_s: time constant of the low-pass behind the encoder's speed.
    """

    def __init__(self, identifier: Identifier, filter_time_constant_s: float):
        start = np.zeros(SIZE)
        start[TICK] = -1.0
        start[ROOT : ROOT + 16] = np.sqrt(identifier.initial_variance) * np.eye(4).ravel()
        super().__init__(Spec(
            inputs={"encoder": len(WHEEL_PAIR), "imu": len(IMU), "tilt": len(TILT), "torque": 2},
            outputs={"parameters": Output(8, parameters), "friction": Output(2, friction)},
            parameters={
                "memory": float(np.exp(-TICK_S / filter_time_constant_s)), "forgetting": identifier.forgetting,
                "trace_limit": identifier.trace_limit, "dead_band_rad_s": identifier.dead_band_rad_s, "sizes": _SIZES,
            },
            discrete_state=start, updates=(Update(step, Phase.COMPUTE),),
        ))
