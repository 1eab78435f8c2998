"""Dead reckoning by odometry: the pose from wheel rotation (and tilt), P_lo of Fig. 6.5."""

import numpy as np

from drake_ispace.blocks.block import Block, Output, Phase, Spec, Update
from drake_ispace.blocks.functions import cos, sin
from drake_ispace.blocks.kernels import copy, kernel
from drake_ispace.blocks.messages import ENCODER, ESTIMATE, PATH, TILT, WHEEL_PAIR, encoder_size
from drake_ispace.plants.wheels import WheelGeometry

S, BEFORE = len(ESTIMATE), len(ESTIMATE) + 1  # x_d: the estimate, s, then wheel angles (and tilt) of the last sample


@kernel
def advance(xd, forward, side, turn, out):
    """Advance the pose and s by a body displacement forward, sideways [m] and turn [rad], at the mean heading."""
    heading = xd[ESTIMATE.phi] + 0.5 * turn
    c, s = cos(heading), sin(heading)
    out[ESTIMATE.x] = xd[ESTIMATE.x] + c * forward - s * side
    out[ESTIMATE.y] = xd[ESTIMATE.y] + s * forward + c * side
    out[ESTIMATE.phi] = xd[ESTIMATE.phi] + turn
    out[S] = xd[S] + forward


@kernel
def omni_step(xd, encoder, jacobian, out):
    """Advance x_d = [tick, x, y, phi, s, theta (n)] by one sample; jacobian: J in frame B (3, n), row by row."""
    copy(xd, out)
    if encoder[ENCODER.tick] == xd[ESTIMATE.tick]:
        return
    n = xd.shape[0] - BEFORE
    dx, dy, turn = 0.0, 0.0, 0.0
    if xd[ESTIMATE.tick] >= 0.0:
        for i in range(n):
            change = encoder[ENCODER.theta + i] - xd[BEFORE + i]
            dx, dy, turn = dx + jacobian[i] * change, dy + jacobian[n + i] * change, turn + jacobian[2 * n + i] * change
    advance(xd, dx, dy, turn, out)
    out[ESTIMATE.tick] = encoder[ENCODER.tick]
    copy(encoder[ENCODER.theta :], out[BEFORE:])


@kernel
def omni_velocity(encoder, jacobian, out):
    """Write the body velocity J theta_dot: vx, vy [m/s], wz [rad/s] in B; jacobian: J (3, n), row by row."""
    n = jacobian.shape[0] // 3
    omega = ENCODER.theta + n
    for axis in range(3):
        out[axis] = 0.0
        for i in range(n):
            out[axis] += jacobian[axis * n + i] * encoder[omega + i]


@kernel
def pendulum_step(xd, encoder, tilt, radius_m, half_track_m, body_share, out):
    """Advance x_d = [tick, x, y, phi, s, theta_r, theta_l, theta_b] by one sample, (2.37)-(2.39)."""
    copy(xd, out)
    if encoder[WHEEL_PAIR.tick] == xd[ESTIMATE.tick]:
        return
    theta_r, theta_l, theta_b = encoder[WHEEL_PAIR.theta_r], encoder[WHEEL_PAIR.theta_l], tilt[TILT.angle]
    if xd[ESTIMATE.tick] >= 0.0:
        right, left = theta_r - xd[BEFORE], theta_l - xd[BEFORE + 1]
        leaned = body_share * (theta_b - xd[BEFORE + 2])
        forward = 0.5 * radius_m * (right + left + 2.0 * leaned)
        advance(xd, forward, 0.0, 0.5 * radius_m / half_track_m * (right - left), out)
    out[ESTIMATE.tick] = encoder[WHEEL_PAIR.tick]
    out[BEFORE], out[BEFORE + 1], out[BEFORE + 2] = theta_r, theta_l, theta_b


@kernel
def pendulum_velocity(encoder, tilt, radius_m, half_track_m, body_share, out):
    """Write s_dot [m/s] and phi_dot [rad/s], (2.38)-(2.39)."""
    omega_r, omega_l = encoder[WHEEL_PAIR.omega_r], encoder[WHEEL_PAIR.omega_l]
    out[0] = 0.5 * radius_m * (omega_r + omega_l + 2.0 * body_share * tilt[TILT.rate])
    out[1] = 0.5 * radius_m / half_track_m * (omega_r - omega_l)


@kernel
def pose(xd, out):
    copy(xd[: len(ESTIMATE)], out)


@kernel
def path(xd, out):
    out[PATH.tick], out[PATH.s], out[PATH.phi] = xd[ESTIMATE.tick], xd[S], xd[ESTIMATE.phi]


def _start(initial_pose, remembered):
    start = np.zeros(BEFORE + remembered)
    start[ESTIMATE.tick], start[ESTIMATE.x : S] = -1.0, initial_pose
    return start


class OmniOdometry(Block):
    """Dead reckoning of pose P_lo and body velocity for a robot with any wheels, v = J theta_dot, (2.64).

    The encoder has direct feed-through within a tick.

    .. pydrake_system::

        name: OmniOdometry
        input_ports:
        - encoder
        output_ports:
        - pose
        - body_velocity

    encoder (1 + 2 n,): tick, theta (n) [rad], omega (n) [rad/s]. pose (4,): tick, x, y [m], phi [rad] in W, not
    wrapped. body_velocity (3,): vx, vy [m/s], wz [rad/s] in B.

    Args:
        geometry: the wheels that odometry assumes.
        initial_pose: x, y [m], phi [rad] in W that odometry assumes at the first sample.
    """

    def __init__(self, geometry: WheelGeometry, initial_pose=(0.0, 0.0, 0.0)):
        n = len(geometry.wheels)
        super().__init__(Spec(
            inputs={"encoder": encoder_size(n)},
            outputs={"pose": Output(len(ESTIMATE), pose), "body_velocity": Output(3, omni_velocity)},
            parameters={"jacobian": geometry.forward.ravel()},
            discrete_state=_start(initial_pose, n), updates=(Update(omni_step, Phase.COMPUTE, through=True),),
        ))


class PendulumOdometry(Block):
    """Dead reckoning of the pendulum's pose P_lo, path and velocity from wheel *and* body rotation.

    s_dot = r/2 (theta_r_dot + theta_l_dot + 2 theta_b_dot), (2.38). The inputs have direct feed-through within a tick.

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
    gyro bias [rad/s]. pose (4,): tick, x, y [m], phi [rad] in W, not wrapped. path (3,): tick, s [m], phi [rad], P_r of
    (6.32). velocity (2,): s_dot [m/s], phi_dot [rad/s].

    Args:
        radius_m: wheel radius r_w.
        half_track_m: b of (2.36).
        initial_pose: x, y [m], phi [rad] in W that odometry assumes at the first sample.
        body_share: 1 for (2.38), 0 for the literature's (2.35). The latter mistakes leaning for driving, an error of
            r * tilt in s: 7 mm at 5 degrees.
    """

    def __init__(self, radius_m: float, half_track_m: float, initial_pose=(0.0, 0.0, 0.0), body_share=1.0):
        super().__init__(Spec(
            inputs={"encoder": len(WHEEL_PAIR), "tilt": len(TILT)},
            outputs={
                "pose": Output(len(ESTIMATE), pose), "path": Output(len(PATH), path),
                "velocity": Output(2, pendulum_velocity),
            },
            parameters={"radius_m": radius_m, "half_track_m": half_track_m, "body_share": body_share},
            discrete_state=_start(initial_pose, 3), updates=(Update(pendulum_step, Phase.COMPUTE, through=True),),
        ))
