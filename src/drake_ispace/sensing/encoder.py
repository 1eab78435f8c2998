"""Rotary encoders: the wheel angle relative to the body in counts, and the wheel speed derived from the counts."""

from dataclasses import dataclass

import numpy as np

from drake_ispace.blocks.block import Block, Output, Phase, Spec, Update
from drake_ispace.blocks.functions import floor
from drake_ispace.blocks.kernels import copy, kernel
from drake_ispace.blocks.messages import ENCODER, encoder_size
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.files.quantity import quantity

VELOCITIES = ("filtered", "raw", "exact")


@dataclass
class Encoder:
    """Settings of the encoders: resolution and how the wheel speed is obtained."""

    # 12 pulses times gear 9 for the omni robot (Table 2.2); 2000 assumed for the pendulum; 0: no quantisation
    counts_per_turn: int = quantity(108, "counts per wheel turn", minimum=0)
    # filtered: low-pass of the difference quotient of the counts; raw: the difference quotient itself; exact: the wheel
    # speed of the plant
    velocity: str = quantity("filtered", choices=VELOCITIES)
    # of the low-pass; one count of the omni robot in one tick is 0.28 m/s, which is too coarse for feedback
    filter_time_constant_s: float = quantity(0.02, "s", above=0.0)


@kernel
def sample(tick, xd, wheel_angle, wheel_rate, counts_per_turn, velocity_mode, memory, out):
    """Sample the wheels into x_d, which is the message."""
    n = wheel_angle.shape[0]
    theta, omega = ENCODER.theta, ENCODER.theta + n
    for i in range(n):
        angle = wheel_angle[i]
        if counts_per_turn > 0.0:
            step = 2.0 * np.pi / counts_per_turn
            angle = step * floor(angle / step + 0.5)  # the wheel starts in the middle of a count
        difference = 0.0 if xd[ENCODER.tick] < 0.0 else (angle - xd[theta + i]) / TICK_S
        out[theta + i] = angle
        if velocity_mode == 0.0:
            out[omega + i] = memory * xd[omega + i] + (1.0 - memory) * difference
        elif velocity_mode == 1.0:
            out[omega + i] = difference
        else:
            out[omega + i] = wheel_rate[i]
    out[ENCODER.tick] = tick


@kernel
def message(xd, out):
    copy(xd, out)


@kernel
def clock(xd, out):
    out[0] = xd[ENCODER.tick]


class WheelEncoder(Block):
    """Samples the wheel angles in the sensing phase of every tick and derives the wheel speeds.

    .. pydrake_system::

        name: WheelEncoder
        input_ports:
        - wheel_angle
        - wheel_rate
        output_ports:
        - message
        - tick

    wheel_angle, wheel_rate (n,): relative to the body [rad], [rad/s]; the rate is used only if `velocity` is exact.
    message (1 + 2 n,): tick of the sample (-1 before the first), theta (n) [rad], omega (n) [rad/s].
    tick (1,): the same tick, as the robot's clock for blocks that receive no other sample from the robot.

    Args:
        encoder: resolution and wheel speed.
        wheels: number of wheels n.
    """

    def __init__(self, encoder: Encoder, wheels: int):
        start = np.zeros(encoder_size(wheels))
        start[ENCODER.tick] = -1.0
        super().__init__(Spec(
            inputs={"wheel_angle": wheels, "wheel_rate": wheels},
            outputs={"message": Output(len(start), message), "tick": Output(1, clock)},
            parameters={
                "counts_per_turn": float(encoder.counts_per_turn),
                "velocity_mode": float(VELOCITIES.index(encoder.velocity)),
                "memory": float(np.exp(-TICK_S / encoder.filter_time_constant_s)),
            },
            discrete_state=start, updates=(Update(sample, Phase.SENSE),),
        ))
