"""The forces between the floor and the pendulum's two wheels, (2.45)-(2.47).

Along the floor they are the multipliers -lambda of the rolling constraints (2.40), which (2.47) cancels: a wheel's
forward force from the torque that is left after its own spin, the sideways force from the acceleration of all masses
along the axle. The constraints (2.40) have one sideways row, so how both wheels share that force stays open. The normal
forces, which the thesis leaves out because its wheels never leave the floor, follow from all masses' vertical
acceleration and their angular momentum about the direction of travel. The floor counts as level; with wheels of two
radii its lever is their mean.
"""

import numpy as np

from drake_ispace.blocks.functions import cos, sin
from drake_ispace.blocks.kernels import kernel
from drake_ispace.plants.slip import GRAVITY

FORWARD_R, FORWARD_L, SIDEWAYS, NORMAL_R, NORMAL_L = range(5)
_PITCHING, _WHEEL, _ROTOR, _GEAR, _DRIVE = range(5)


def contact_parameters(parameters) -> dict[str, float]:
    """Return the parameter group `contact` of a PendulumPlantParameters: what the group `body` lacks [kg m^2, 1]."""
    lifted = parameters.body_mass_kg * parameters.centre_of_gravity_m
    return {
        "pitching": lifted * parameters.centre_of_gravity_m + parameters.body_inertia_pitch_kg_m2,
        "wheel_inertia": parameters.wheel_inertia_kg_m2, "rotor_inertia": parameters.rotor_inertia_kg_m2,
        "gear_ratio": parameters.gear_ratio, "drive_inertia": parameters.drive_inertia_kg_m2,
    }


@kernel
def contact_forces(
    balance, accelerations, wheel_rates, torque, radius_m, half_track_m, mass, lifted, turning, kappa, contact, out
):
    """Write forward force of the right and the left wheel, sideways force of both (left positive), normal force of the
    right and the left wheel [N], each from the floor on the robot.

    balance (4,): tilt [rad], s_dot [m/s], phi_dot, tilt rate [rad/s]; accelerations (3,): of s, phi and tilt;
    wheel_rates (2,): relative to the body [rad/s]; torque (2,): between body and wheel, after friction [N m]; mass
    [kg]: of the robot; lifted [kg m]: m_b z; turning [kg m^2]: m_b z^2 + I_xx - I_zz.
    """
    tilt, speed, turn, lean = balance[0], balance[1], balance[2], balance[3]
    s_acc, yaw_acc, tilt_acc = accelerations
    c, s = cos(tilt), sin(tilt)
    n, rotor, wheel, drive = contact[_GEAR], contact[_ROTOR], contact[_WHEEL], contact[_DRIVE]
    along = 0.0
    for i in range(2):
        side = 1.0 - 2.0 * i
        wheel_acc = (s_acc + side * half_track_m * yaw_acc) / radius_m[i] - kappa * tilt_acc
        spin_up = wheel * (wheel_acc + tilt_acc) + n * rotor * (n * wheel_acc + tilt_acc) + drive * wheel_acc
        out[FORWARD_R + i] = (torque[i] - spin_up) / radius_m[i]
        along += wheel * (wheel_rates[i] + lean) + rotor * (n * wheel_rates[i] + lean)
    out[SIDEWAYS] = mass * speed * turn + lifted * (yaw_acc * s + 2.0 * turn * lean * c)
    normal = mass * GRAVITY - lifted * (tilt_acc * s + lean * lean * c)
    # d/dt of the angular momentum about the direction of travel, at the middle of the axle, in axes that yaw along
    roll = -turning * ((c * c - s * s) * lean * turn + s * c * yaw_acc)
    roll -= turn * (contact[_PITCHING] * lean + along) + lifted * c * speed * turn
    more = (roll - 0.5 * (radius_m[0] + radius_m[1]) * out[SIDEWAYS]) / half_track_m
    out[NORMAL_R], out[NORMAL_L] = 0.5 * (normal - more), 0.5 * (normal + more)


def grip_used(contact: np.ndarray, friction_coefficient: float) -> np.ndarray:
    """Return (n, 2) the share of its grip that each wheel (right, left) uses: above 1 it slips, at inf it has lifted.

    Each wheel is taken to carry the sideways force by its share of the weight.

    Args:
        contact: (n, 5) values of the pendulum's port `contact` [N].
        friction_coefficient: of the wheels on the floor.
    """
    normal = np.clip(contact[:, NORMAL_R:], 0.0, None)
    with np.errstate(divide="ignore", invalid="ignore"):
        sideways = contact[:, [SIDEWAYS]] * normal / normal.sum(axis=1, keepdims=True)
        used = np.hypot(contact[:, :SIDEWAYS], sideways) / (friction_coefficient * normal)
    return np.where(normal > 0.0, used, np.inf)
