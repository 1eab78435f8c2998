"""tau = J' F, (2.65): a force on the robot as wheel torques, at the estimated heading."""

import numpy as np

from drake_ispace.blocks.block import Block, Output, Spec
from drake_ispace.blocks.kernels import kernel
from drake_ispace.blocks.messages import ESTIMATE
from drake_ispace.plants.wheels import WheelGeometry


@kernel
def wheel_torques(force, estimate, jacobian, out):
    n = out.shape[0]
    c, s = np.cos(estimate[ESTIMATE.phi]), np.sin(estimate[ESTIMATE.phi])
    fx, fy = c * force[0] + s * force[1], -s * force[0] + c * force[1]
    for i in range(n):
        out[i] = jacobian[i] * fx + jacobian[n + i] * fy + jacobian[2 * n + i] * force[2]


class JacobianTranspose(Block):
    """Wheel torques that push the robot with a given force.

    .. pydrake_system::

        name: JacobianTranspose
        input_ports:
        - force
        - estimate
        output_ports:
        - torque

    force (3,): Fx, Fy [N], moment [N m] in W. estimate (4,): tick, x, y [m], phi [rad]. torque (n,) [N m]. (2.65).
    """

    def __init__(self, geometry: WheelGeometry):
        n = len(geometry.wheels)
        super().__init__(Spec(
            inputs={"force": 3, "estimate": len(ESTIMATE)}, outputs={"torque": Output(n, wheel_torques)},
            parameters={"jacobian": geometry.forward.ravel()},
        ))
