"""Odometry: pose from wheel rotation alone, P_lo of Fig. 6.5, direct feed-through within a tick."""

import numpy as np

from drake_ispace.blocks.block import Block, Output, Phase, Spec, Update
from drake_ispace.blocks.kernels import copy, kernel
from drake_ispace.plants.wheels import WheelGeometry

TICK, X, Y, PHI, PATH, BEFORE = 0, 1, 2, 3, 4, 5  # x_d; BEFORE: wheel angles (and tilt) of the last sample


@kernel
def advance(xd, forward, side, turn, out):
    """Move the pose by a body displacement [m, m, rad], along the heading half-way through the turn."""
    heading = xd[PHI] + 0.5 * turn
    c, s = np.cos(heading), np.sin(heading)
    out[X] = xd[X] + c * forward - s * side
    out[Y] = xd[Y] + s * forward + c * side
    out[PHI] = xd[PHI] + turn
    out[PATH] = xd[PATH] + forward


@kernel
def omni_step(xd, encoder, jacobian, out):
    """x_d = [tick, x, y, phi, path, theta (n)]; jacobian: J in frame B (3, n), row by row."""
    copy(xd, out)
    if encoder[0] == xd[TICK]:
        return
    n = xd.shape[0] - BEFORE
    dx, dy, turn = 0.0, 0.0, 0.0
    if xd[TICK] >= 0.0:
        for i in range(n):
            change = encoder[1 + i] - xd[BEFORE + i]
            dx, dy, turn = dx + jacobian[i] * change, dy + jacobian[n + i] * change, turn + jacobian[2 * n + i] * change
    advance(xd, dx, dy, turn, out)
    out[TICK] = encoder[0]
    copy(encoder[1 : 1 + n], out[BEFORE:])


@kernel
def omni_velocity(encoder, jacobian, out):
    n = (encoder.shape[0] - 1) // 2
    for axis in range(3):
        out[axis] = 0.0
        for i in range(n):
            out[axis] += jacobian[axis * n + i] * encoder[1 + n + i]


@kernel
def pendulum_step(xd, encoder, tilt, radius_m, half_track_m, body_share, out):
    """x_d = [tick, x, y, phi, path, theta_r, theta_l, theta_b], (2.37)-(2.39)."""
    copy(xd, out)
    if encoder[0] == xd[TICK]:
        return
    if xd[TICK] >= 0.0:
        right, left = encoder[1] - xd[BEFORE], encoder[2] - xd[BEFORE + 1]
        leaned = body_share * (tilt[1] - xd[BEFORE + 2])
        forward = 0.5 * radius_m * (right + left + 2.0 * leaned)
        advance(xd, forward, 0.0, 0.5 * radius_m / half_track_m * (right - left), out)
    out[TICK] = encoder[0]
    out[BEFORE], out[BEFORE + 1], out[BEFORE + 2] = encoder[1], encoder[2], tilt[1]


@kernel
def pendulum_velocity(encoder, tilt, radius_m, half_track_m, body_share, out):
    out[0] = 0.5 * radius_m * (encoder[3] + encoder[4] + 2.0 * body_share * tilt[2])
    out[1] = 0.5 * radius_m / half_track_m * (encoder[3] - encoder[4])


@kernel
def pose(xd, out):
    copy(xd[: PHI + 1], out)


@kernel
def path(xd, out):
    out[0], out[1], out[2] = xd[TICK], xd[PATH], xd[PHI]


def _start(initial_pose, remembered):
    start = np.zeros(BEFORE + remembered)
    start[TICK], start[X : PHI + 1] = -1.0, initial_pose
    return start


class OmniOdometry(Block):
    """P_lo and body velocity of a robot with any wheels, v = J theta_dot (2.64).

    .. pydrake_system::

        name: OmniOdometry
        input_ports:
        - encoder
        output_ports:
        - pose
        - body_velocity

    encoder (1 + 2 n,): tick, theta (n) [rad], omega (n) [rad/s]. pose (4,): tick, x, y [m], phi [rad], not wrapped.
    body_velocity (3,): vx, vy [m/s], wz [rad/s] in B.

    Args:
        geometry: of the wheels; initial_pose: where the robot is told to start.
    """

    def __init__(self, geometry: WheelGeometry, initial_pose=(0.0, 0.0, 0.0)):
        n = len(geometry.wheels)
        super().__init__(Spec(
            inputs={"encoder": 1 + 2 * n},
            outputs={"pose": Output(4, pose), "body_velocity": Output(3, omni_velocity)},
            parameters={"jacobian": geometry.forward.ravel()},
            discrete_state=_start(initial_pose, n), updates=(Update(omni_step, Phase.COMPUTE, through=True),),
        ))


class PendulumOdometry(Block):
    """P_lo of the pendulum: counts wheel *and* body rotation, s_dot = r/2 (th_r + th_l + 2 th_b), (2.38).

    .. pydrake_system::

        name: PendulumOdometry
        input_ports:
        - encoder
        - tilt
        output_ports:
        - pose
        - path
        - velocity

    encoder (5,): tick, theta_r, theta_l [rad], omega_r, omega_l [rad/s]. tilt (4,): tick, tilt [rad], rate [rad/s],
    gyro bias [rad/s]. pose (4,): tick, x, y [m], phi [rad], not wrapped. path (3,): tick, s [m], phi [rad], P_r of
    (6.32). velocity (2,): s_dot [m/s], phi_dot [rad/s].

    Args:
        radius_m: r_w; half_track_m: b of (2.36); initial_pose: where the robot is told to start.
        body_share: 1 for (2.38), 0 for the literature's (2.35), which mistakes leaning for driving: an error of
            r * tilt in s, 7 mm at 5 degrees.
    """

    def __init__(self, radius_m: float, half_track_m: float, initial_pose=(0.0, 0.0, 0.0), body_share=1.0):
        super().__init__(Spec(
            inputs={"encoder": 5, "tilt": 4},
            outputs={"pose": Output(4, pose), "path": Output(3, path), "velocity": Output(2, pendulum_velocity)},
            parameters={"radius_m": radius_m, "half_track_m": half_track_m, "body_share": body_share},
            discrete_state=_start(initial_pose, 3), updates=(Update(pendulum_step, Phase.COMPUTE, through=True),),
        ))
