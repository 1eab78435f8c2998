"""Kernels that delay, lag or scale a command which is held over a tick, be it torque or velocity.

A kernel's argument names are its wiring, so every wire has kernels of its own; they call the helpers here, in which
`held` is the command of the tick.

Memory is kept in the sensing phase: at t_k+1 it stores what went through on [t_k, t_k+1), before the next command
acts. So the output follows the command of its own tick, and nothing is a tick late. A command is constant over a tick;
what changes within one enters with its mean.
"""

import math
from collections.abc import Mapping

import numpy as np

from drake_ispace.blocks.kernels import copy, kernel
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.effects.effect import BlockEffect, Body

LEAST_LIMIT = 1e-6  # smallest limit that a scenario may set
_WRITTEN_S = 0.005  # a tick as people write it: TICK_S is that but for its last bits


@kernel
def held_before(xd, held, age, i):
    """The command that was held `age` ticks ago; x_d as in `keep`."""
    if age == 0:
        return held[i]
    n, last = held.shape[0], xd.shape[0] - 1
    at = int(xd[last]) - (age - 1) * n
    return xd[at + i if at >= 0 else at + last + i]


@kernel
def shift(xd, held, delay_ticks, out):
    """The command of `delay_ticks` ago; for a part of a tick the mean of the two that fall into the tick."""
    whole = int(delay_ticks)
    share = delay_ticks - whole
    for i in range(out.shape[0]):
        newer, older = held_before(xd, held, whole, i), held_before(xd, held, whole + 1, i)
        out[i] = (1.0 - share) * newer + share * older


@kernel
def keep(xd, held, out):
    """x_d = [commands held on the last ticks (n each), one behind the other and begun anew at the end; where the newest
    lies].

    Nothing is moved on: a memory of a second would cost more than all else that happens in a tick. What lies where is a
    number of x_d itself, so that a block with it has no symbolic form.
    """
    n, last = held.shape[0], xd.shape[0] - 1
    copy(xd, out)
    newest = int(xd[last]) + n
    newest = newest if newest < last else 0
    for i in range(n):
        out[newest + i] = held[i]
    out[last] = newest


class Delay(BlockEffect):
    """A delay of the held command by its one parameter, `delay_s`: `output` calls `shift`, `update` calls `keep`."""

    in_place = True

    def memory_size(self, body):
        (delay,) = self.parameters
        return (math.ceil(delay.high / TICK_S) + 1) * super().memory_size(body) + 1

    def block_parameters(self, body, values):
        # no coarser than that: a fit looks at changes by a hundred millionth
        return {"delay_ticks": round(values["delay_s"] / _WRITTEN_S, 12)}


@kernel
def mix(xd, held, share, out):
    """A `share` of the state (n), the rest of the command."""
    for i in range(out.shape[0]):
        out[i] = share * xd[i] + (1.0 - share) * held[i]


class Lag(BlockEffect):
    """A first-order lag of the held command by `time_constant_s`, x_d = [what it reaches at the end of the tick (n)].

    `update` mixes with the share `memory`: y_k = a y_k-1 + (1 - a) u_k, a = exp(-T/time_constant). `output` gives the
    mean over the tick, it mixes with the share `blend`: b y_k-1 + (1 - b) u_k, b = (1 - a) time_constant/T. (The value
    at the end would come half a tick early: a lag of 5 ms would pass for one of 7 ms.)
    """

    def block_parameters(self, body, values):
        time_constant_s = values["time_constant_s"]
        memory = math.exp(-TICK_S / time_constant_s) if time_constant_s > 0.0 else 0.0
        return {"memory": memory, "blend": (1.0 - memory) * time_constant_s / TICK_S}


@kernel
def scale(held, gain, out):
    for i in range(out.shape[0]):
        out[i] = gain[i] * held[i]


def one_wheel(body: Body, values: Mapping[str, float], own: float, others: float = 1.0) -> np.ndarray:
    """(n,) a number for each wheel: `own` for the one that the choice `wheel` names, `others` for all others."""
    numbers = np.full(body.wheels, others)
    numbers[int(values["wheel"]) - 1] = own
    return numbers


def tolerated(body: Body, share: float) -> float:
    """The tolerance of a constant or one-sided torque, a share of the usual one; 0 for a plant of the user's own.

    Nothing calls such a plant back, and what makes a sound one look lossy, as small errors in time do, is alike for
    both directions and all wheels.
    """
    return share if body.robot.in_room else 0.0
