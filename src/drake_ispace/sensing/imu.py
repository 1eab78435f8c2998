"""A low-cost IMU: 3-axis accelerometer (specific force, gravity included) and 3-axis gyro, fixed to the body."""

from dataclasses import dataclass

import numpy as np

from drake_ispace.blocks.block import Block, Output, Phase, Spec, Update
from drake_ispace.blocks.kernels import copy, kernel
from drake_ispace.blocks.messages import IMU
from drake_ispace.blocks.noise import normal, stream
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.files.quantity import quantity


@dataclass
class Imu:
    """Noise, bias and place of the IMU.

    The thesis only says "low-cost", so noise typical of a consumer MEMS part is assumed.
    """

    accelerometer_noise_density: float = quantity(3e-3, "m/s^2/sqrt(Hz)", minimum=0.0)
    gyro_noise_density: float = quantity(1.5e-4, "rad/s/sqrt(Hz)", minimum=0.0)
    accelerometer_bias_m_s2: list[float] = quantity([0.0, 0.0, 0.0], "m/s^2", length=3)
    gyro_bias_rad_s: list[float] = quantity([0.0, 0.0, 0.0], "rad/s", length=3)
    # above the axle, along the body; assumed
    height_m: float = quantity(0.0, "m")


@kernel
def sample(tick, body_motion, bias, noise_std, noise_stream, out):
    """Sample the body's motion into x_d, which is the message."""
    out[IMU.tick] = tick
    for i in range(6):
        out[IMU.ax + i] = body_motion[i] + bias[i]
        if noise_std[i] > 0.0:
            out[IMU.ax + i] += noise_std[i] * normal(noise_stream, tick, i)


@kernel
def message(xd, out):
    copy(xd, out)


class InertialSensor(Block):
    """Samples the body's motion in the sensing phase of every tick, before the torque of that tick acts.

    .. pydrake_system::

        name: InertialSensor
        input_ports:
        - body_motion
        output_ports:
        - message

    body_motion (6,): specific force [m/s^2] and angular rate [rad/s] in the body's axes.
    message (7,): tick of the sample (-1 before the first), then the same six quantities with bias and noise. White
    noise of density d has the standard deviation d / sqrt(T_u) per sample.

    Args:
        imu: noise and bias.
        seed: seed of the noise, which is drawn from the random stream named `where`.
        where: name of the random stream.
    """

    def __init__(self, imu: Imu, seed=0, where="imu"):
        densities = [imu.accelerometer_noise_density] * 3 + [imu.gyro_noise_density] * 3
        start = np.zeros(len(IMU))
        start[IMU.tick] = -1.0
        super().__init__(Spec(
            inputs={"body_motion": 6}, outputs={"message": Output(len(IMU), message)},
            parameters={
                "bias": np.array([*imu.accelerometer_bias_m_s2, *imu.gyro_bias_rad_s]),
                "noise_std": np.array(densities) / np.sqrt(TICK_S), "noise_stream": stream(seed, where),
            },
            noise_stream=where, discrete_state=start, updates=(Update(sample, Phase.SENSE),),
        ))
