"""Torque actuator: D/A converter, torque limit, driver M(q) and noise e1 (Fig. 2.1b, Fig. 3.8b, (3.27))."""

from dataclasses import dataclass

import numpy as np

from drake_ispace.blocks.block import Block, Output, Phase, Spec, Update
from drake_ispace.blocks.functions import floor
from drake_ispace.blocks.kernels import copy, kernel
from drake_ispace.blocks.noise import normal, stream
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.files.quantity import quantity


@dataclass
class Actuator:
    """Settings of the torque actuator.

    By default the actuator is ideal, because the thesis gives no torque limit, converter or driver.
    """

    # largest wheel torque; null: no limit
    limit_n_m: float | None = quantity(None, "N*m", above=0.0)
    # step of the D/A converter; 0: no quantisation
    resolution_n_m: float = quantity(0.0, "N*m", minimum=0.0)
    # time constant of the first-order driver M(q); 0: no lag
    time_constant_s: float = quantity(0.0, "s", minimum=0.0)
    # standard deviation of e1, white noise drawn every tick
    noise_std_n_m: float = quantity(0.0, "N*m", minimum=0.0)


@kernel
def hold(tick, xd, command, limit_n_m, resolution_n_m, memory, noise_std_n_m, noise_stream, out):
    """Sample the command and step the driver: x_d = [held command (n), driver's state (n), torque (n)] [N m]."""
    n = command.shape[0]
    for i in range(n):
        held = command[i]
        if resolution_n_m > 0.0:
            held = resolution_n_m * floor(held / resolution_n_m + 0.5)
        held = min(max(held, -limit_n_m), limit_n_m)
        driven = held if memory == 0.0 else memory * xd[n + i] + (1.0 - memory) * held
        out[i], out[n + i], out[2 * n + i] = held, driven, driven
        if noise_std_n_m > 0.0:
            out[2 * n + i] += noise_std_n_m * normal(noise_stream, tick, i)


@kernel
def held_command(xd, out):
    copy(xd[: out.shape[0]], out)


@kernel
def torque(xd, out):
    copy(xd[2 * out.shape[0] :], out)


class TorqueActuator(Block):
    """Zero-order hold of the wheel torques: the torque commanded at t_k acts on [t_k, t_k+1).

    .. pydrake_system::

        name: TorqueActuator
        input_ports:
        - command
        output_ports:
        - torque
        - held_command

    command (n,): wheel torques [N m], sampled in the compute phase of every tick. torque (n,): torques that act on the
    wheels [N m]. held_command (n,): the command after converter and limit, before driver and noise [N m]; recordings
    store it as the channel `torque`. Equation (3.27).

    Args:
        actuator: limit, converter, driver and noise.
        wheels: number of wheels n.
        seed: seed of the noise, which is drawn from the random stream named `where`.
        where: name of the random stream.
    """

    def __init__(self, actuator: Actuator, wheels: int, seed=0, where="actuator"):
        time_constant = actuator.time_constant_s
        super().__init__(Spec(
            inputs={"command": wheels},
            outputs={"torque": Output(wheels, torque), "held_command": Output(wheels, held_command)},
            parameters={
                "limit_n_m": np.inf if actuator.limit_n_m is None else actuator.limit_n_m,
                "resolution_n_m": actuator.resolution_n_m,
                "memory": float(np.exp(-TICK_S / time_constant)) if time_constant > 0.0 else 0.0,
                "noise_std_n_m": actuator.noise_std_n_m, "noise_stream": stream(seed, where),
            },
            noise_stream=where, discrete_state=np.zeros(3 * wheels), updates=(Update(hold, Phase.COMPUTE),),
        ))
