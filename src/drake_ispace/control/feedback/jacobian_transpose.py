"""Wheel torques from a desired force on the robot, tau = J' F, (2.65), at the estimated heading."""


from drake_ispace.blocks.block import Block, Output, Spec
from drake_ispace.blocks.functions import cos, sin
from drake_ispace.blocks.kernels import kernel
from drake_ispace.blocks.messages import ESTIMATE
from drake_ispace.plants.wheels import WheelGeometry


@kernel
def wheel_torques(force, estimate, jacobian, out):
    """Write J' F [N m] with F rotated from W to B by the estimated heading; jacobian: J in B (3, n), row by row."""
    n = out.shape[0]
    c, s = cos(estimate[ESTIMATE.phi]), sin(estimate[ESTIMATE.phi])
    fx, fy = c * force[0] + s * force[1], -s * force[0] + c * force[1]
    for i in range(n):
        out[i] = jacobian[i] * fx + jacobian[n + i] * fy + jacobian[2 * n + i] * force[2]


class JacobianTranspose(Block):
    """Converts a desired force and moment on the robot into wheel torques.

    .. pydrake_system::

        name: JacobianTranspose
        input_ports:
        - force
        - estimate
        output_ports:
        - torque

    force (3,): Fx, Fy [N], moment [N m] in W. estimate (4,): tick, x, y [m], phi [rad] in W, of which phi is used.
    torque (n,): wheel torques [N m]. Equation (2.65).

    Args:
        geometry: the robot's wheels.
    """

    def __init__(self, geometry: WheelGeometry):
        n = len(geometry.wheels)
        super().__init__(Spec(
            inputs={"force": 3, "estimate": len(ESTIMATE)}, outputs={"torque": Output(n, wheel_torques)},
            parameters={"jacobian": geometry.forward.ravel()},
        ))
