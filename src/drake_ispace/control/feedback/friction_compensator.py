"""Friction compensation, (3.34)-(3.38) and Fig. 4.1: the expected friction of each wheel is added to its torque."""

from dataclasses import dataclass

import numpy as np

from drake_ispace.blocks.block import Block, Output, Spec
from drake_ispace.blocks.functions import tanh
from drake_ispace.blocks.kernels import kernel
from drake_ispace.blocks.messages import ENCODER, encoder_size
from drake_ispace.files.quantity import quantity


@dataclass
class FrictionCompensation:
    """Settings of the friction compensation. The coefficients are those of the ARMAXD row of Table 4.2."""

    enabled: bool = quantity(True)
    coulomb_n_m: float = quantity(0.0061, "N*m", minimum=0.0)
    viscous_n_m_s: float = quantity(0.0106, "N*m*s/rad", minimum=0.0)
    # below this wheel speed nothing is added; a wide band smooths the torque but sustains a limit cycle at rest
    dead_band_rad_s: float = quantity(0.0, "rad/s", minimum=0.0)
    # range of wheel speed over which the sign rises to 1 beyond the dead band
    speed_scale_rad_s: float = quantity(0.02, "rad/s", above=0.0)


@kernel
def compensate(torque, encoder, coulomb_n_m, viscous_n_m_s, dead_band_rad_s, speed_scale_rad_s, out):
    """Write the torques plus the expected friction [N m]; no friction is added inside the dead band."""
    n = torque.shape[0]
    omega = ENCODER.theta + n
    steepness = 1.0 / speed_scale_rad_s
    for i in range(n):  # loops are short, so that they are unrolled
        beyond = max(abs(encoder[omega + i]) - dead_band_rad_s, 0.0)
        out[i] = tanh(beyond * steepness) if coulomb_n_m > 0.0 else 0.0  # none costs no time
    for i in range(n):
        rate = encoder[omega + i]
        moving = rate if abs(rate) > dead_band_rad_s else 0.0
        out[i] = torque[i] + coulomb_n_m * (out[i] * np.sign(rate)) + viscous_n_m_s * moving


class FrictionCompensator(Block):
    """Adds the expected friction to the wheel torques, or passes them on unchanged if compensation is not enabled.

    .. pydrake_system::

        name: FrictionCompensator
        input_ports:
        - torque
        - encoder
        output_ports:
        - torque

    torque (n,), input and output: wheel torques without and with the compensation [N m]. encoder (1 + 2 n,): tick,
    theta (n) [rad], omega (n) [rad/s]. Equations (3.34)-(3.38).

    Args:
        compensation: coefficients, dead band and whether compensation is enabled.
        wheels: number of wheels n.
    """

    def __init__(self, compensation: FrictionCompensation, wheels: int):
        share = float(compensation.enabled)
        super().__init__(Spec(
            inputs={"torque": wheels, "encoder": encoder_size(wheels)},
            outputs={"torque": Output(wheels, compensate)},
            parameters={
                "coulomb_n_m": share * compensation.coulomb_n_m, "viscous_n_m_s": share * compensation.viscous_n_m_s,
                "dead_band_rad_s": compensation.dead_band_rad_s, "speed_scale_rad_s": compensation.speed_scale_rad_s,
            },
        ))
