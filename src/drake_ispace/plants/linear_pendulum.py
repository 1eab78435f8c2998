"""The linear pendulum exactly as printed, (3.40)-(3.43): the identification plant of chapter 3.

With the printed signs the pendulum *hangs* (theta_ddot = -9.87 theta). No wheel radius makes the printed numbers those
of a physical robot (docs/fidelity.md, row 5). The model shows how the printed numbers behave.
"""

import numpy as np

from drake_ispace.blocks.block import Block, Output, Spec
from drake_ispace.blocks.functions import cos, sin
from drake_ispace.blocks.kernels import kernel
from drake_ispace.plants.pendulum import (
    PHI,
    S_RATE,
    THETA_L,
    THETA_R,
    TILT,
    TILT_RATE,
    YAW_RATE,
    PendulumPlantParameters,
    X,
    Y,
    balance,
    pose,
    wheel_angle,
    wheel_rates,
)
from drake_ispace.plants.slip import GRAVITY

#: PRINTED_STATE, (3.41): s_ddot and theta_ddot per theta. PRINTED_INPUT, (3.42): s_ddot, phi_ddot and theta_ddot per
#: torque of the right wheel.
PRINTED_STATE = (1.21, -9.87)
PRINTED_INPUT = (-1.73, 101.46, 35.39)


@kernel
def accelerations(tilt, torque, state_terms, input_terms):
    """Return (s_ddot [m/s^2], phi_ddot, theta_ddot [rad/s^2]) of (3.40)-(3.43)."""
    both = torque[0] + torque[1]
    return (
        state_terms[0] * tilt + input_terms[0] * both,
        input_terms[1] * (torque[0] - torque[1]),
        state_terms[1] * tilt + input_terms[2] * both,
    )


@kernel
def derivatives(xc, torque, radius_m, half_track_m, state_terms, input_terms, out):
    out[:] = 0.0
    out[X], out[Y], out[PHI] = xc[S_RATE] * cos(xc[PHI]), xc[S_RATE] * sin(xc[PHI]), xc[YAW_RATE]
    out[TILT] = xc[TILT_RATE]
    out[S_RATE], out[YAW_RATE], out[TILT_RATE] = accelerations(xc[TILT], torque, state_terms, input_terms)
    out[THETA_R], out[THETA_L] = wheel_rates(xc[S_RATE], xc[YAW_RATE], xc[TILT_RATE], radius_m, half_track_m, 1.0)


@kernel
def wheel_rate(xc, radius_m, half_track_m, out):
    out[0], out[1] = wheel_rates(xc[S_RATE], xc[YAW_RATE], xc[TILT_RATE], radius_m, half_track_m, 1.0)


@kernel
def body_motion(xc, torque, state_terms, input_terms, imu_height_m, out):
    """Write the specific force (3) and angular rate (3) in body axes, linearised in the tilt like the plant."""
    s_acc, _, tilt_acc = accelerations(xc[TILT], torque, state_terms, input_terms)
    out[0], out[1], out[2] = s_acc + imu_height_m * tilt_acc - GRAVITY * xc[TILT], xc[S_RATE] * xc[YAW_RATE], GRAVITY
    out[3], out[4], out[5] = 0.0, xc[TILT_RATE], xc[YAW_RATE]


class LinearPendulumPlant(Block):
    """The linear pendulum as printed, (3.40)-(3.43), without slip or friction.

    .. pydrake_system::

        name: LinearPendulumPlant
        input_ports:
        - torque
        output_ports:
        - pose
        - balance
        - wheel_angle
        - wheel_rate
        - body_motion

    torque (2,): right, left, between body and wheel [N m]. pose (3,): x, y [m], phi [rad] of the axle's middle in W.
    balance (4,): tilt theta [rad] (forward positive), s_dot [m/s], phi_dot and theta_dot [rad/s]. wheel_angle,
    wheel_rate (2,): right, left, relative to the body [rad], [rad/s]. body_motion (6,): specific force [m/s^2] (gravity
    included) and angular rate [rad/s] in the body's axes at the IMU, with direct feed-through of the torque.

    Args:
        parameters: only the wheel radius and the half-track are read.
        initial_pose: x, y [m], phi [rad] in W at t = 0.
        initial_tilt_rad: tilt at t = 0.
        imu_height_m: height of the IMU above the axle, along the body.
    """

    def __init__(
        self, parameters: PendulumPlantParameters, initial_pose=(0.0, 0.0, 0.0), initial_tilt_rad=0.0, imu_height_m=0.0
    ):
        start = np.zeros(THETA_L + 1)
        start[:3], start[TILT] = initial_pose, initial_tilt_rad
        super().__init__(Spec(
            inputs={"torque": 2},
            outputs={
                "pose": Output(3, pose), "balance": Output(4, balance), "wheel_angle": Output(2, wheel_angle),
                "wheel_rate": Output(2, wheel_rate), "body_motion": Output(6, body_motion),
            },
            parameters={
                "radius_m": parameters.wheel_radius_m, "half_track_m": parameters.half_track_m,
                "state_terms": np.array(PRINTED_STATE), "input_terms": np.array(PRINTED_INPUT),
                "imu_height_m": imu_height_m,
            },
            continuous_state=start, derivatives=derivatives,
        ))
