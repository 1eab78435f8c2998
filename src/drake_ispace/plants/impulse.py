"""Torque pulse on all wheels: the disturbance of section 4.3, from 1.2 to 1.6 s."""

from dataclasses import dataclass

import numpy as np

from drake_ispace.blocks.block import Block, Output, Phase, Spec, Update
from drake_ispace.blocks.kernels import kernel
from drake_ispace.blocks.rates import ticks_in
from drake_ispace.files.quantity import quantity


@dataclass
class Impulse:
    """Size and time of the disturbance. Section 4.3 gives only the time."""

    # torque on each wheel, assumed; 0: no disturbance
    torque_n_m: float = quantity(0.0, "N*m")
    # from the text on Fig. 4.4
    start_s: float = quantity(1.2, "s", minimum=0.0)
    end_s: float = quantity(1.6, "s", minimum=0.0)


@kernel
def switch(tick, impulse_n_m, start_tick, end_tick, out):
    """Set x_d = [disturbance torque held until the next tick] [N m]."""
    out[0] = impulse_n_m if start_tick <= tick and tick < end_tick else 0.0


@kernel
def pushed(xd, torque, out):
    for i in range(out.shape[0]):
        out[i] = torque[i] + xd[0]


class TorqueImpulse(Block):
    """Adds the disturbance torque to the torque of every wheel, between actuator and plant.

    .. pydrake_system::

        name: TorqueImpulse
        input_ports:
        - torque
        output_ports:
        - torque

    torque (n,), input and output: wheel torques without and with the disturbance [N m]. Section 4.3, Figs. 4.4 and
    4.5.

    Args:
        impulse: size and time of the disturbance.
        wheels: number of wheels n.
    """

    def __init__(self, impulse: Impulse, wheels: int):
        super().__init__(Spec(
            inputs={"torque": wheels}, outputs={"torque": Output(wheels, pushed)},
            parameters={
                "impulse_n_m": impulse.torque_n_m, "start_tick": float(ticks_in(impulse.start_s)),
                "end_tick": float(ticks_in(impulse.end_s)),
            },
            discrete_state=np.zeros(1), updates=(Update(switch, Phase.COMPUTE),),
        ))
