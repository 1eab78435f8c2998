"""Body-velocity command for a velocity-controlled robot, with a zero-order hold over a tick."""

from dataclasses import dataclass

import numpy as np

from drake_ispace.blocks.block import Block, Output, Phase, Spec, Update
from drake_ispace.blocks.frames import wrap
from drake_ispace.blocks.functions import cos, sin
from drake_ispace.blocks.kernels import copy, kernel
from drake_ispace.blocks.messages import ESTIMATE, WAY_POINT
from drake_ispace.files.quantity import quantity


@dataclass
class VelocityControl:
    """Gains of the proportional correction, assumed. They are small because the robot's drive tracks the velocity."""

    position_per_s: float = quantity(1.5, "1/s", minimum=0.0, maximum=100.0)
    heading_per_s: float = quantity(3.0, "1/s", minimum=0.0, maximum=100.0)
    # turn towards the path per metre of sideways error and metre driven; only for wheels that hold sideways
    side_rad_m2: float = quantity(30.0, "rad/m^2", minimum=0.0, maximum=1e4)


@kernel
def command(estimate, way_point, position_per_s, heading_per_s, side_rad_m2, free_sideways, out):
    """Set x_d = [v, w] in B: v = R(phi)' (v_d + k (p_d - p)), w = w_d + k_phi (phi_d - phi).

    If `free_sideways` is 0, v_y is 0 and w has the further term k_side v_x e_y, which steers back to the path; e_y is
    the sideways error in B. The command is zero before the first way point or estimate.
    """
    if way_point[WAY_POINT.tick] < 0.0 or estimate[ESTIMATE.tick] < 0.0:
        out[:] = 0.0
        return
    phi = estimate[ESTIMATE.phi]
    c, s = cos(phi), sin(phi)
    ex, ey = way_point[WAY_POINT.x] - estimate[ESTIMATE.x], way_point[WAY_POINT.y] - estimate[ESTIMATE.y]
    vx, vy = way_point[WAY_POINT.vx] + position_per_s * ex, way_point[WAY_POINT.vy] + position_per_s * ey
    out[0] = c * vx + s * vy
    out[1] = free_sideways * (-s * vx + c * vy)
    out[2] = way_point[WAY_POINT.wz] + heading_per_s * wrap(way_point[WAY_POINT.phi] - phi)
    if free_sideways == 0.0:
        out[2] += side_rad_m2 * out[0] * (-s * ex + c * ey)


@kernel
def velocity(xd, out):
    copy(xd, out)


class VelocityCommand(Block):
    """Feed-forward of the way point's velocity plus a proportional correction of the pose.

    The velocity commanded at t_k acts on [t_k, t_k+1).

    .. pydrake_system::

        name: VelocityCommand
        input_ports:
        - estimate
        - way_point
        output_ports:
        - velocity

    estimate (4,): tick, x, y [m], phi [rad] in W. way_point (10,): layout messages.WAY_POINT, of which tick, pose and
    velocity in W are used. velocity (3,): vx, vy [m/s], wz [rad/s] in B, zero before the first way point or estimate;
    recordings store it as the channel `command`.

    Args:
        control: the gains.
        holds_sideways: whether the robot has plain tyres, so that it cannot move sideways.
    """

    def __init__(self, control: VelocityControl, holds_sideways: bool = False):
        super().__init__(Spec(
            inputs={"estimate": len(ESTIMATE), "way_point": len(WAY_POINT)},
            outputs={"velocity": Output(3, velocity)},
            parameters={
                "position_per_s": control.position_per_s, "heading_per_s": control.heading_per_s,
                "side_rad_m2": control.side_rad_m2, "free_sideways": 0.0 if holds_sideways else 1.0,
            },
            discrete_state=np.zeros(3), updates=(Update(command, Phase.COMPUTE),),
        ))
