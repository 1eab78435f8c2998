"""Kalman filter for tilt, tilt rate and gyro bias from the IMU. Section 2.2.1 names the filter without an equation.

The state is [theta, theta_dot, b]. The tilt rate is a random walk driven by white angular acceleration, and the bias b
is a slow random walk. There are two measurements. The gyro's y axis gives theta_dot + b. The direction of the specific
force gives atan2(-f_x, f_z), which is theta for a body that does not accelerate. Because the robot does accelerate, the
measurement noise of the direction is set large, so that only the long-term mean of the direction counts.
"""

from dataclasses import dataclass

import numpy as np

from drake_ispace.blocks.block import Block, Output, Phase, Spec, Update
from drake_ispace.blocks.functions import atan2
from drake_ispace.blocks.kernels import copy, kernel
from drake_ispace.blocks.messages import IMU, TILT
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.files.quantity import quantity


@dataclass
class TiltFilter:
    """Standard deviations of process noise, measurement noise and initial state that the filter assumes."""

    # process noise: constant over a tick, independent from tick to tick
    angular_acceleration_rad_s2: float = quantity(30.0, "rad/s^2", above=0.0)
    bias_walk_rad_s_per_sqrt_s: float = quantity(1e-4, "rad/s/sqrt(s)", above=0.0)
    # measurement noise, per sample
    gyro_std_rad_s: float = quantity(0.003, "rad/s", above=0.0)
    # measurement noise, per sample; large, because the robot's own acceleration tilts the specific force
    accelerometer_std_rad: float = quantity(1.0, "rad", above=0.0)
    initial_bias_std_rad_s: float = quantity(0.01, "rad/s", above=0.0)
    initial_tilt_std_rad: float = quantity(0.01, "rad", above=0.0)
    # small, because the body is held still before t = 0
    initial_rate_std_rad_s: float = quantity(0.01, "rad/s", above=0.0)


P = len(TILT)  # x_d = [the message, then from P on p00 p01 p02 p11 p12 p22]


@kernel
def step(xd, imu, rate_variance, bias_variance, gyro_variance, accelerometer_variance, out):
    """Predict over one tick and update with both measurements; a sample that is already stored changes nothing."""
    copy(xd, out)
    if imu[IMU.tick] == xd[TILT.tick]:
        return
    h = TICK_S
    tilt, rate, bias = xd[TILT.angle], xd[TILT.rate], xd[TILT.bias]
    p00, p01, p02, p11, p12, p22 = xd[P], xd[P + 1], xd[P + 2], xd[P + 3], xd[P + 4], xd[P + 5]
    if xd[TILT.tick] >= 0.0:
        tilt = tilt + h * rate
        p00, p01, p02 = p00 + 2.0 * h * p01 + h * h * p11, p01 + h * p11, p02 + h * p12
        p11, p22 = p11 + rate_variance, p22 + bias_variance

    # gyro: H = [0, 1, 1]
    c0, c1, c2 = p01 + p02, p11 + p12, p12 + p22
    spread = c1 + c2 + gyro_variance
    innovation = imu[IMU.wy] - rate - bias
    tilt, rate, bias = tilt + c0 / spread * innovation, rate + c1 / spread * innovation, bias + c2 / spread * innovation
    p00, p01, p02 = p00 - c0 * c0 / spread, p01 - c0 * c1 / spread, p02 - c0 * c2 / spread
    p11, p12, p22 = p11 - c1 * c1 / spread, p12 - c1 * c2 / spread, p22 - c2 * c2 / spread

    # direction of the specific force: H = [1, 0, 0]
    spread = p00 + accelerometer_variance
    innovation = atan2(-imu[IMU.ax], imu[IMU.az]) - tilt
    k0, k1, k2 = p00 / spread, p01 / spread, p02 / spread
    out[TILT.tick] = imu[IMU.tick]
    out[TILT.angle], out[TILT.rate] = tilt + k0 * innovation, rate + k1 * innovation
    out[TILT.bias] = bias + k2 * innovation
    out[P], out[P + 1], out[P + 2] = p00 - k0 * p00, p01 - k0 * p01, p02 - k0 * p02
    out[P + 3], out[P + 4], out[P + 5] = p11 - k1 * p01, p12 - k1 * p02, p22 - k2 * p02


@kernel
def estimate(xd, out):
    copy(xd[: P], out)


class TiltKalmanFilter(Block):
    """Estimates the tilt from the IMU by a Kalman filter, with direct feed-through within a tick.

    .. pydrake_system::

        name: TiltKalmanFilter
        input_ports:
        - imu
        output_ports:
        - tilt

    imu (7,): tick, specific force (3) [m/s^2], angular rate (3) [rad/s] in the body's axes.
    tilt (4,): tick, tilt theta [rad] (forward positive), its rate [rad/s], gyro bias [rad/s].

    Args:
        believed: standard deviations of noise and initial state.
        initial_tilt_rad: initial estimate of the tilt, the angle at which the robot is held before t = 0.
    """

    def __init__(self, believed: TiltFilter, initial_tilt_rad=0.0):
        start = np.zeros(P + 6)
        start[TILT.tick], start[TILT.angle] = -1.0, initial_tilt_rad
        start[P], start[P + 3], start[P + 5] = (
            believed.initial_tilt_std_rad**2, believed.initial_rate_std_rad_s**2, believed.initial_bias_std_rad_s**2,
        )
        super().__init__(Spec(
            inputs={"imu": len(IMU)}, outputs={"tilt": Output(len(TILT), estimate)},
            parameters={
                "rate_variance": (believed.angular_acceleration_rad_s2 * TICK_S) ** 2,
                "bias_variance": believed.bias_walk_rad_s_per_sqrt_s**2 * TICK_S,
                "gyro_variance": believed.gyro_std_rad_s**2,
                "accelerometer_variance": believed.accelerometer_std_rad**2,
            },
            discrete_state=start, updates=(Update(step, Phase.COMPUTE, through=True),),
        ))
