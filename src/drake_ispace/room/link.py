"""The radio link from the room to a robot: framed serial messages that are delayed by the line and sometimes lost.

The block models whether a frame arrives, and when. The rounding of the payload to 32-bit floats (below 1e-7 m) is not
modelled.
"""

from dataclasses import dataclass

import numpy as np

from drake_ispace.blocks.block import Block, Output, Phase, Spec, Update
from drake_ispace.blocks.errors import InputError
from drake_ispace.blocks.kernels import copy, kernel
from drake_ispace.blocks.messages import FIX, TICK
from drake_ispace.blocks.noise import stream, uniform
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.files.quantity import quantity


@dataclass
class Link:
    """The serial radio link from the room to a robot (RS-232 in the thesis)."""

    # bit rate of the line, with 10 bits per byte; 0: no delay
    baud_rate: int = quantity(0, "bit/s", minimum=0)
    # additional delay of the radio
    delay_ticks: int = quantity(0, "ticks of 5 ms", minimum=0, maximum=2000)
    # share of frames that never arrive
    loss: float = quantity(0.0, minimum=0.0, maximum=1.0)
    # share of frames that arrive damaged and are dropped because of their checksum
    corruption: float = quantity(0.0, minimum=0.0, maximum=1.0)


_FRAME_BYTES = 2 + 1 + 4 + 2  # start, count of values, tick of sending, checksum
_VALUE_BYTES = 4
_BITS_PER_BYTE = 10  # with start and stop bit


def delay_ticks(link: Link, order_size: int) -> int:
    """Return the delay in whole ticks of a frame that carries a fix and an order of `order_size` numbers.

    Raises:
        InputError: the line is so slow that a frame takes longer than a second.
    """
    if link.baud_rate == 0:
        return link.delay_ticks
    bits = _BITS_PER_BYTE * (_FRAME_BYTES + _VALUE_BYTES * (len(FIX) + order_size))
    if bits > link.baud_rate:
        raise InputError(
            f"space.link.baud_rate: {link.baud_rate} bit/s, expected at least {bits} (a frame a second) or 0"
        )
    return link.delay_ticks + int(np.ceil(bits / link.baud_rate / TICK_S))


CLOCK = 0  # x_d = [robot's tick, last sent (m), delivered (m), queue of (tick of departure, m), oldest first]


@kernel
def step(xd, fix, order, robot_tick, delay, loss, noise_stream, out):
    """Queue a frame if fix or order has changed, and deliver the newest frame that is due.

    If the robot's tick has not advanced since the last call, nothing changes.
    """
    copy(xd, out)
    tick = robot_tick[0]
    if tick == xd[CLOCK]:
        return
    out[CLOCK] = tick
    n = fix.shape[0]
    m = n + order.shape[0]
    is_new = False
    for i in range(m):
        value = fix[i] if i < n else order[i - n]
        if value != xd[1 + i]:
            is_new = True
        out[1 + i] = value
    queue = 1 + 2 * m
    if is_new and not (loss > 0.0 and uniform(noise_stream, tick, 0) < loss):
        for i in range(queue, out.shape[0] - 1 - m):
            out[i] = xd[i + 1 + m]
        start = out.shape[0] - 1 - m
        out[start] = tick
        for i in range(m):
            out[start + 1 + i] = out[1 + i]
    for start in range(queue, out.shape[0], 1 + m):
        if 0.0 <= out[start] and out[start] + delay <= tick:
            for i in range(m):
                out[1 + m + i] = out[start + 1 + i]


@kernel
def delivered_fix(xd, fix, order, out):
    m = fix.shape[0] + order.shape[0]
    copy(xd[1 + m : 1 + m + fix.shape[0]], out)


@kernel
def delivered_order(xd, fix, order, out):
    m = fix.shape[0] + order.shape[0]
    copy(xd[1 + m + fix.shape[0] : 1 + 2 * m], out)


class RoomLink(Block):
    """Carries the room's fix and order (way point or tracking error) to the robot, in the same tick if undelayed.

    .. pydrake_system::

        name: RoomLink
        input_ports:
        - fix
        - order
        - robot_tick
        output_ports:
        - fix
        - order

    fix (5,), input and output: tick of capture, seen, x, y [m], phi [rad] in W. order (m,), input and output: a way
    point or a tracking error. robot_tick (1,): the robot's clock. Outputs hold the newest frame that has arrived, and
    tick -1 and zeros before the first one. A frame is sent when fix or order changes; a lost frame is not repeated.

    Args:
        link: bit rate, delay and losses.
        order_size: size m of an order.
        seed: seed of the losses, which are drawn from the random stream named `where`.
        where: name of the random stream.

    Raises:
        InputError: the line is so slow that a frame takes longer than a second.
    """

    def __init__(self, link: Link, order_size: int, seed=0, where="link"):
        m = len(FIX) + order_size
        delay = delay_ticks(link, order_size)
        empty = np.zeros(m)
        empty[FIX.tick] = empty[len(FIX) + TICK] = -1.0
        queue = np.tile(np.concatenate([[-1.0], empty]), delay + 1)
        super().__init__(Spec(
            inputs={"fix": len(FIX), "order": order_size, "robot_tick": 1},
            outputs={"fix": Output(len(FIX), delivered_fix), "order": Output(order_size, delivered_order)},
            parameters={
                "delay": float(delay), "loss": 1.0 - (1.0 - link.loss) * (1.0 - link.corruption),
                "noise_stream": stream(seed, where),
            },
            noise_stream=where, discrete_state=np.concatenate([[-1.0], empty, empty, queue]),
            updates=(Update(step, Phase.COMPUTE, through=True),),
        ))
