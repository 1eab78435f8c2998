"""From commanded to real wheel torque: limit, D/A converter, driver M(q), noise e1 (Fig. 2.1b, Fig. 3.8b, (3.27))."""

from dataclasses import dataclass

import numpy as np

from drake_ispace.blocks.block import Block, Output, Phase, Spec, Update
from drake_ispace.blocks.kernels import copy, kernel
from drake_ispace.blocks.noise import normal, stream
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.files.quantity import quantity


@dataclass
class Actuator:
    """Neutral by default: the thesis gives neither torque limit nor converter nor driver."""

    # largest wheel torque; null: none
    limit_n_m: float | None = quantity(None, "N*m", above=0.0)
    # step of the D/A converter; 0: none
    resolution_n_m: float = quantity(0.0, "N*m", minimum=0.0)
    # of the first-order driver M(q); 0: none
    time_constant_s: float = quantity(0.0, "s", minimum=0.0)
    # e1, white, drawn every tick
    noise_std_n_m: float = quantity(0.0, "N*m", minimum=0.0)


@kernel
def hold(tick, xd, command, limit_n_m, resolution_n_m, memory, noise_std_n_m, noise_stream, out):
    """x_d = [held command (n), driver's state (n), torque (n)]."""
    n = command.shape[0]
    for i in range(n):
        held = command[i]
        if resolution_n_m > 0.0:
            held = resolution_n_m * np.floor(held / resolution_n_m + 0.5)
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
    """The torque hold: what is commanded at t_k acts on [t_k, t_k+1).

    .. pydrake_system::

        name: TorqueActuator
        input_ports:
        - command
        output_ports:
        - torque
        - held_command

    command (n,): wheel torques [N m], sampled in the compute phase every tick. torque (n,): what the wheels get.
    held_command (n,): after limit and converter, before driver and noise; a recording's channel `torque`.

    Args:
        actuator: limits and imperfections; wheels: n; seed: of the noise, stream `{where}`.
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
