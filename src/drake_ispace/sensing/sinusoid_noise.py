"""Measured state of the servo experiment of section 3.4.1: position and tilt, each disturbed by a fast sinusoid."""

from dataclasses import dataclass

import numpy as np

from drake_ispace.blocks.block import Block, Output, Phase, Spec, Update
from drake_ispace.blocks.functions import cos, sin
from drake_ispace.blocks.kernels import copy, kernel
from drake_ispace.blocks.messages import POSE, STATE
from drake_ispace.blocks.noise import normal, stream, uniform
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.files.quantity import quantity


@dataclass
class SinusoidNoise:
    """Noise of position and tilt, section 3.4.1. Sampled at 200 Hz, an 800 Hz sinusoid aliases to a constant."""

    # of position and tilt
    frequency_hz: float = quantity(800.0, "Hz", minimum=0.0)
    position_amplitude_m: float = quantity(0.001, "m", minimum=0.0)
    tilt_amplitude_rad: float = quantity(0.05, "rad", minimum=0.0)
    # standard deviation of additional white noise as a share of the amplitudes; none in the thesis's simulation
    white_share: float = quantity(0.0, minimum=0.0)


@kernel
def noise_at(time_s, index, channel, frequency_hz, white_share, noise_stream):
    """Return the noise of a channel (0 position, 1 tilt) in units of its amplitude.

    The phase of the sinusoid is drawn from the noise stream. time_s: time of the sample; index: integer >= 0 that
    selects the draw of the white noise.
    """
    phase = 2.0 * np.pi * uniform(noise_stream, 0, channel)
    value = sin(2.0 * np.pi * frequency_hz * time_s + phase)
    if white_share > 0.0:
        value += white_share * normal(noise_stream, index, 2 + channel)
    return value


@kernel
def sample(tick, pose, balance, start, amplitude, frequency_hz, white_share, noise_stream, out):
    """Sample the state with its noise into x_d, which is the message."""
    out[STATE.tick] = tick
    dx, dy = pose[POSE.x] - start[POSE.x], pose[POSE.y] - start[POSE.y]
    out[STATE.s] = cos(start[POSE.phi]) * dx + sin(start[POSE.phi]) * dy
    out[STATE.theta], out[STATE.s_dot], out[STATE.theta_dot] = balance[0], balance[1], balance[3]
    for i in range(2):
        if amplitude[i] > 0.0:
            out[STATE.s + i] += amplitude[i] * noise_at(tick * TICK_S, tick, i, frequency_hz, white_share, noise_stream)


@kernel
def message(xd, out):
    copy(xd, out)


class NoisyState(Block):
    """Samples [s, theta, s_dot, theta_dot] in the sensing phase of every tick, with noise on s and theta.

    .. pydrake_system::

        name: NoisyState
        input_ports:
        - pose
        - balance
        output_ports:
        - message

    pose (3,): x, y [m], phi [rad] in W. balance (4,): tilt [rad], s_dot [m/s], phi_dot, tilt rate [rad/s].
    message (5,): tick of the sample (-1 before the first), s [m] from the start pose along its heading, theta [rad],
    s_dot [m/s], theta_dot [rad/s]. Section 3.4.1, Fig. 3.9.

    Args:
        noise: amplitudes and frequency.
        start: x, y [m], phi [rad] in W of the start pose.
        seed: seed of phases and white noise, which are drawn from the random stream named `where`.
        where: name of the random stream.
    """

    def __init__(self, noise: SinusoidNoise, start=(0.0, 0.0, 0.0), seed=0, where="sensor_noise"):
        memory = np.zeros(len(STATE))
        memory[STATE.tick] = -1.0
        super().__init__(Spec(
            inputs={"pose": len(POSE), "balance": 4}, outputs={"message": Output(len(STATE), message)},
            parameters={
                "start": np.array(start, dtype=float),
                "amplitude": np.array([noise.position_amplitude_m, noise.tilt_amplitude_rad]),
                "frequency_hz": noise.frequency_hz, "white_share": noise.white_share,
                "noise_stream": stream(seed, where),
            },
            noise_stream=where, discrete_state=memory, updates=(Update(sample, Phase.SENSE),),
        ))
