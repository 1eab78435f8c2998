"""Plant of the two-wheeled inverted pendulum, fully non-linear, (2.48) as corrected (docs/fidelity.md, rows 1 to 4).

Let v = [s_dot, phi_dot, theta_dot]. The thesis's motion counts wheel *and* body rotation, (2.37)-(2.39), kappa = 1. The
literature's counts wheel rotation only, (2.34)-(2.36), kappa = 0. Then

    theta_wb_dot = (s_dot +- b phi_dot)/r - kappa theta_dot
    m11 = m_b + 2 m_w + 2 (I_w + n^2 I_r)/r^2
    m13 = m_b z cos(theta) + 2 ((1 - kappa) I_w + n (1 - n kappa) I_r)/r
    m33 = m_b z^2 + I_yy + 2 (1 - kappa)^2 I_w + 2 (1 - n kappa)^2 I_r
    m22 = (m_b z^2 + I_xx) sin^2 + I_zz cos^2 + 2 (I_wz + I_rz) + 2 m_w b^2 + 2 (b/r)^2 (I_w + n^2 I_r)

The inertia J of what turns with a wheel against the body, which the thesis does not have, adds J theta_wb_dot^2 / 2 of
each wheel: J to I_w + n^2 I_r, -kappa J to (1 - kappa) I_w + n (1 - n kappa) I_r, and 2 kappa^2 J to m33.

The tests derive the same matrix from the energies (`tests/robots/pendulum_lagrangian.py`). For wheels of different
radii r_R and r_L, 2/r^2 becomes 1/r_R^2 + 1/r_L^2, 2/r becomes 1/r_R + 1/r_L, and yaw is coupled to the other motions
by

    m12 = b (I_w + n^2 I_r) (1/r_R^2 - 1/r_L^2),    m23 = b ((1 - kappa) I_w + n (1 - n kappa) I_r) (1/r_R - 1/r_L).

The sideways slant of a robot on unequal wheels is neglected.
"""

from dataclasses import dataclass, field

import numpy as np

from drake_ispace.blocks.block import Block, Output, Spec
from drake_ispace.blocks.functions import cos, sin
from drake_ispace.blocks.kernels import copy, kernel
from drake_ispace.blocks.noise import stream
from drake_ispace.files.quantity import quantity
from drake_ispace.plants.contact import NORMAL_L, contact_forces, contact_parameters
from drake_ispace.plants.friction import Friction, friction_parameters, friction_torque
from drake_ispace.plants.slip import (
    CORNERING,
    FRAME,
    GRAVITY,
    RELAXATION,
    Slip,
    axis_acceleration,
    axis_rate,
    pose_rates,
    slip_parameters,
    traction_rate,
    traction_slip,
)
from drake_ispace.plants.tick_memory import deflection, remember, slip_noise, tick_memory
from drake_ispace.plants.wheels import WheelGeometry, differential, rescaled

MOTIONS = ("wheel_only", "wheel_and_body")


@dataclass
class PendulumPlantParameters:
    """Parameters of the pendulum: Table 2.1. Values that the thesis does not give are marked as assumed."""

    # m_b
    body_mass_kg: float = quantity(3.5, "kg", above=0.0)
    # m_w, of each wheel
    wheel_mass_kg: float = quantity(0.25, "kg", minimum=0.0)
    # I_yy
    body_inertia_pitch_kg_m2: float = quantity(8.5e-4, "kg*m^2", above=0.0)
    # I_zz
    body_inertia_yaw_kg_m2: float = quantity(0.0255, "kg*m^2", above=0.0)
    # I_xx, assumed equal to I_zz
    body_inertia_roll_kg_m2: float = quantity(0.0255, "kg*m^2", above=0.0)
    # I_w about the axle
    wheel_inertia_kg_m2: float = quantity(0.0013, "kg*m^2", minimum=0.0)
    # I_wz, assumed I_w / 2 (a thin disk)
    wheel_inertia_yaw_kg_m2: float = quantity(0.00065, "kg*m^2", minimum=0.0)
    # I_r
    rotor_inertia_kg_m2: float = quantity(1.6e-5, "kg*m^2", minimum=0.0)
    # I_rz, assumed equal to I_r
    rotor_inertia_yaw_kg_m2: float = quantity(1.6e-5, "kg*m^2", minimum=0.0)
    # of gears and rotors, seen at each wheel, besides n^2 I_r: J (wheel rate against the body)^2 / 2
    drive_inertia_kg_m2: float = quantity(0.0, "kg*m^2", minimum=0.0)
    # z, axle to centre of gravity
    centre_of_gravity_m: float = quantity(0.04, "m", above=0.0)
    # b of (2.36) is half of Table 2.1's width 0.4
    half_track_m: float = quantity(0.2, "m", above=0.0, maximum=20.0)
    # r_w
    wheel_radius_m: float = quantity(0.08, "m", above=0.0, maximum=5.0)
    # deviation of the right and left wheel's radius from r_w, as a share of r_w; odometry uses r_w for both
    wheel_radius_shares: list[float] = quantity([0.0, 0.0], above=-0.9, length=2)
    # n, rotor speed over wheel speed as the thesis writes it
    gear_ratio: float = quantity(1.0 / 400.0, minimum=0.0)
    # (2.37)-(2.39), or the literature's (2.34)-(2.36)
    motion: str = quantity("wheel_and_body", choices=MOTIONS)
    friction: Friction = field(default_factory=lambda: Friction(coulomb_n_m=0.0061, viscous_n_m_s=0.0106))
    slip: Slip = field(default_factory=Slip)
    # slope of the floor along x and y of W, uphill positive, in the IMU's signal only: the force of gravity along the
    # slope comes from the block of the effect floor_tilt
    slope_rad: list[float] = quantity([0.0, 0.0], "rad", minimum=-0.1, maximum=0.1, length=2)

    @property
    def geometry(self) -> WheelGeometry:
        return rescaled(differential(self.wheel_radius_m, self.half_track_m), self.wheel_radius_shares)

    def inertias(self) -> dict[str, float]:
        """Return the parameter group `body`: constants of the mass matrix [kg, kg m, kg m^2], kappa and mass [kg]."""
        n, b = self.gear_ratio, self.half_track_m
        right, left = (1.0 / wheel.radius_m for wheel in self.geometry.wheels)
        kappa = float(MOTIONS.index(self.motion))
        drive = self.drive_inertia_kg_m2
        rolling = self.wheel_inertia_kg_m2 + n * n * self.rotor_inertia_kg_m2 + drive
        leaning = (1.0 - kappa) * self.wheel_inertia_kg_m2 + n * (1.0 - n * kappa) * self.rotor_inertia_kg_m2
        leaning -= kappa * drive
        lifted = self.body_mass_kg * self.centre_of_gravity_m
        wheels_yaw = self.wheel_inertia_yaw_kg_m2 + self.rotor_inertia_yaw_kg_m2 + self.wheel_mass_kg * b * b
        return {
            "m11": self.body_mass_kg + 2.0 * self.wheel_mass_kg + rolling * (right**2 + left**2),
            "m_b_z": lifted,
            "m13_rotors": leaning * (right + left),
            "m33": lifted * self.centre_of_gravity_m + self.body_inertia_pitch_kg_m2
            + 2.0 * (1.0 - kappa) ** 2 * self.wheel_inertia_kg_m2
            + 2.0 * (1.0 - n * kappa) ** 2 * self.rotor_inertia_kg_m2 + 2.0 * kappa**2 * drive,
            "yaw_lying": lifted * self.centre_of_gravity_m + self.body_inertia_roll_kg_m2,
            "yaw_upright": self.body_inertia_yaw_kg_m2,
            "yaw_wheels": 2.0 * wheels_yaw + b * b * rolling * (right**2 + left**2),
            "m12": b * rolling * (right**2 - left**2),
            "m23": b * leaning * (right - left),
            "kappa": kappa,
            "mass": self.body_mass_kg + 2.0 * self.wheel_mass_kg,
        }


X, Y, PHI, TILT, S_RATE, YAW_RATE, TILT_RATE, LAG, THETA_R, THETA_L = 0, 1, 2, 3, 4, 5, 6, 7, 9, 10  # x_c
M11, M_B_Z, M13_ROTORS, M33, YAW_LYING, YAW_UPRIGHT, YAW_WHEELS, M12, M23, KAPPA, MASS = range(11)


@kernel
def accelerations(tilt, s_rate, yaw_rate, tilt_rate, tau_r, tau_l, ground_force, radius, half_track, body):
    """Return (s_ddot [m/s^2], phi_ddot, theta_ddot [rad/s^2]) of (2.48).

    tau_r, tau_l: torques between body and wheels [N m]; ground_force (3,): generalised force of s [N], phi and theta
    [N m]; radius (2,): right, left [m].
    """
    c, s = cos(tilt), sin(tilt)
    right, left = tau_r / radius[0], tau_l / radius[1]
    m11, m12, m23, m33 = body[M11], body[M12], body[M23], body[M33]
    m13 = body[M_B_Z] * c + body[M13_ROTORS]
    m22 = body[YAW_LYING] * s * s + body[YAW_UPRIGHT] * c * c + body[YAW_WHEELS]
    shape = s * c * (body[YAW_LYING] - body[YAW_UPRIGHT])
    push = right + left + body[M_B_Z] * s * (tilt_rate * tilt_rate + yaw_rate * yaw_rate) + ground_force[0]
    lean = -body[KAPPA] * (tau_r + tau_l) + shape * yaw_rate * yaw_rate + body[M_B_Z] * GRAVITY * s + ground_force[2]
    turn = half_track * (right - left) - (2.0 * shape * tilt_rate + body[M_B_Z] * s * s_rate) * yaw_rate
    turn += ground_force[1]
    k11, k12, k13 = m22 * m33 - m23 * m23, m13 * m23 - m12 * m33, m12 * m23 - m13 * m22
    k22, k23, k33 = m11 * m33 - m13 * m13, m12 * m13 - m11 * m23, m11 * m22 - m12 * m12
    determinant = m11 * k11 + m12 * k12 + m13 * k13
    return (
        (k11 * push + k12 * turn + k13 * lean) / determinant,
        (k12 * push + k22 * turn + k23 * lean) / determinant,
        (k13 * push + k23 * turn + k33 * lean) / determinant,
    )


@kernel
def wheel_rates(s_rate, yaw_rate, tilt_rate, radius, half_track, kappa):
    """Return (right, left) theta_wb_dot [rad/s] of two wheels of equal `radius` [m], from (2.38)-(2.39)."""
    forward, turn = s_rate / radius - kappa * tilt_rate, half_track * yaw_rate / radius
    return forward + turn, forward - turn


@kernel
def own_rates(xc, radius_m, half_track_m, body):
    """Return (right, left) theta_wb_dot [rad/s] of two wheels with the radii `radius_m` (2,) [m]."""
    turn, lean = half_track_m * xc[YAW_RATE], body[KAPPA] * xc[TILT_RATE]
    return (xc[S_RATE] + turn) / radius_m[0] - lean, (xc[S_RATE] - turn) / radius_m[1] - lean


@kernel
def net_torques(xc, xd, torque, radius_m, half_track_m, body, friction):
    """Return (right, left) torque between body and wheel after friction [N m]."""
    right, left = own_rates(xc, radius_m, half_track_m, body)
    tau_r = torque[0] - friction_torque(right, deflection(xc[THETA_R], xd, 0), friction)
    tau_l = torque[1] - friction_torque(left, deflection(xc[THETA_L], xd, 1), friction)
    return tau_r, tau_l


@kernel
def tractions(torque, radius_m, half_track_m, body, slip):
    """Return the steady (forward, yaw) traction slip under the held motor torques."""
    right, left = torque[0] / radius_m[0], torque[1] / radius_m[1]
    drive, turn = right + left, half_track_m * (right - left)
    return traction_slip(0, drive, body[MASS], slip), traction_slip(2, turn, body[MASS], slip)


@kernel
def derivatives(xc, xd, torque, ground_force, radius_m, half_track_m, body, friction, slip, out):
    """Write d/dt of [x, y, phi, tilt, s_rate, yaw_rate, tilt_rate, traction slip (2), theta_r, theta_l]."""
    tau_r, tau_l = net_torques(xc, xd, torque, radius_m, half_track_m, body, friction)
    out[S_RATE], out[YAW_RATE], out[TILT_RATE] = accelerations(
        xc[TILT], xc[S_RATE], xc[YAW_RATE], xc[TILT_RATE], tau_r, tau_l, ground_force, radius_m,
        half_track_m, body,
    )
    out[TILT] = xc[TILT_RATE]
    out[THETA_R], out[THETA_L] = own_rates(xc, radius_m, half_track_m, body)
    t0, t2 = tractions(torque, radius_m, half_track_m, body, slip)
    out[LAG] = traction_rate(0, t0, xc[LAG], xc[S_RATE], slip)
    out[LAG + 1] = traction_rate(2, t2, xc[LAG + 1], half_track_m * xc[YAW_RATE], slip)
    if slip[RELAXATION] > 0.0:
        t0, t2 = xc[LAG], xc[LAG + 1]
    pose_rates(
        xc[S_RATE], 0.0, xc[YAW_RATE], (xc[X], xc[Y], xc[PHI]), (t0, 0.0, t2),
        (slip_noise(xd, 0), slip_noise(xd, 1), slip_noise(xd, 2)), slip, out,
    )


@kernel
def tick_update(tick, xc, xd, noise_stream, friction, slip, out):
    remember(tick, xc[THETA_R:], xd, noise_stream, friction, slip, out)


@kernel
def pose(xc, out):
    copy(xc[X : PHI + 1], out)


@kernel
def balance(xc, out):
    copy(xc[TILT : TILT_RATE + 1], out)


@kernel
def wheel_angle(xc, out):
    copy(xc[THETA_R : THETA_L + 1], out)


@kernel
def wheel_rate(xc, radius_m, half_track_m, body, out):
    out[0], out[1] = own_rates(xc, radius_m, half_track_m, body)


@kernel
def body_motion(
    xc, xd, torque, ground_force, radius_m, half_track_m, body, friction, slip, imu_height_m, slope_rad, out
):
    """Write the specific force (3) [m/s^2] and angular rate (3) [rad/s] in body axes, `imu_height_m` above the axle.

    The axle moves relative to the floor, that is, with slip. The slip is taken as constant over the tick.
    """
    tau_r, tau_l = net_torques(xc, xd, torque, radius_m, half_track_m, body, friction)
    s_acc, yaw_acc, tilt_acc = accelerations(
        xc[TILT], xc[S_RATE], xc[YAW_RATE], xc[TILT_RATE], tau_r, tau_l, ground_force, radius_m,
        half_track_m, body,
    )
    t0, t2 = tractions(torque, radius_m, half_track_m, body, slip)
    if slip[RELAXATION] > 0.0:
        t0, t2 = xc[LAG], xc[LAG + 1]
    x, y, n0, n2 = xc[X], xc[Y], slip_noise(xd, 0), slip_noise(xd, 2)
    yaw_rate = axis_rate(2, xc[YAW_RATE], t2, n2, x, y, slip)
    yaw_acc = axis_acceleration(2, xc[YAW_RATE], yaw_acc, t2, n2, x, y, slip)
    if slip[FRAME] == 0.0:
        forward_acc = axis_acceleration(0, xc[S_RATE], s_acc, t0, n0, x, y, slip)
        forward = axis_rate(0, xc[S_RATE], t0, n0, x, y, slip)
        sideways_acc = forward * yaw_rate - slip[CORNERING] * (forward_acc * yaw_rate + forward * yaw_acc)
        forward_acc = forward_acc + slip[CORNERING] * forward * yaw_rate * yaw_rate
    else:  # slip on the world's axes scales the acceleration in the same way as the velocity
        noise = (n0, slip_noise(xd, 1), n2)
        pose_rates(s_acc, xc[S_RATE] * yaw_rate, 0.0, (x, y, xc[PHI]), (0.0, 0.0, 0.0), noise, slip, out)
        c, s = cos(xc[PHI]), sin(xc[PHI])
        forward_acc, sideways_acc = c * out[0] + s * out[1], -s * out[0] + c * out[1]
    c, s, rate, l = cos(xc[TILT]), sin(xc[TILT]), xc[TILT_RATE], imu_height_m
    c_phi, s_phi = cos(xc[PHI]), sin(xc[PHI])
    forward_acc = forward_acc + GRAVITY * (c_phi * slope_rad[0] + s_phi * slope_rad[1])
    sideways_acc = sideways_acc + GRAVITY * (c_phi * slope_rad[1] - s_phi * slope_rad[0])
    ax = forward_acc + l * (tilt_acc * c - rate * rate * s) - yaw_rate * yaw_rate * l * s
    ay = sideways_acc + yaw_acc * l * s + 2.0 * yaw_rate * l * c * rate
    az = -l * (tilt_acc * s + rate * rate * c) + GRAVITY
    out[0], out[1], out[2] = c * ax - s * az, ay, s * ax + c * az
    out[3], out[4], out[5] = -s * yaw_rate, rate, c * yaw_rate


@kernel
def contact(xc, xd, torque, ground_force, radius_m, half_track_m, body, friction, contact, out):
    net = net_torques(xc, xd, torque, radius_m, half_track_m, body, friction)
    accelerated = accelerations(
        xc[TILT], xc[S_RATE], xc[YAW_RATE], xc[TILT_RATE], net[0], net[1], ground_force, radius_m, half_track_m, body,
    )
    contact_forces(
        xc[TILT : TILT_RATE + 1], accelerated, own_rates(xc, radius_m, half_track_m, body), net, radius_m, half_track_m,
        body[MASS], body[M_B_Z], body[YAW_LYING] - body[YAW_UPRIGHT], body[KAPPA], contact, out,
    )


class PendulumPlant(Block):
    """Dynamics of the two-wheeled inverted pendulum on carpet.

    .. pydrake_system::

        name: PendulumPlant
        input_ports:
        - torque
        - ground_force
        output_ports:
        - pose
        - balance
        - wheel_angle
        - wheel_rate
        - body_motion
        - contact

    torque (2,): right, left, between body and wheel [N m]. ground_force (3,), only with `ground`: generalised force of
    s [N], phi and theta [N m], from the floor or a push. pose (3,): x, y [m], phi [rad] of the axle's middle in W.
    balance (4,): tilt [rad] (forward positive), wheel-consistent s_dot [m/s], phi_dot and tilt rate [rad/s].
    wheel_angle, wheel_rate (2,): right, left, relative to the body [rad], [rad/s]. body_motion (6,): specific force
    [m/s^2] (gravity included) and angular rate [rad/s] in the body's axes at the IMU, with direct feed-through of the
    torque. Equations (2.37)-(2.48), (6.4).

    Args:
        parameters: masses, wheels, friction and slip.
        initial_pose: x, y [m], phi [rad] in W at t = 0.
        initial_tilt_rad: tilt at t = 0.
        imu_height_m: height of the IMU above the axle, along the body.
        seed: seed of the slip noise, which is drawn from the random stream `{where}/slip`.
        where: path of the parameters in the scenario, for messages.
        ground: whether the block has the input port `ground_force`; without the port the force is zero.

    Raises:
        InputError: the friction is too steep for the 5 ms step, there is traction slip in a world frame, or a slip
            ratio in the body frame is 1 or more.
    """

    def __init__(
        self, parameters: PendulumPlantParameters, initial_pose=(0.0, 0.0, 0.0), initial_tilt_rad=0.0,
        imu_height_m=0.0, seed=0, where="plant", ground=False,
    ):
        start = np.zeros(THETA_L + 1)
        start[:3], start[TILT] = initial_pose, initial_tilt_rad
        super().__init__(Spec(
            inputs={"torque": 2} | ({"ground_force": 3} if ground else {}),
            outputs={
                "pose": Output(3, pose), "balance": Output(4, balance), "wheel_angle": Output(2, wheel_angle),
                "wheel_rate": Output(2, wheel_rate), "body_motion": Output(6, body_motion),
                "contact": Output(NORMAL_L + 1, contact),
            },
            parameters=block_parameters(parameters, where)
            | {"imu_height_m": imu_height_m, "noise_stream": stream(seed, f"{where}/slip")}
            | ({} if ground else {"ground_force": np.zeros(3)}),
            continuous_state=start, derivatives=derivatives,
            noise_stream=f"{where}/slip", **tick_memory(parameters.slip, parameters.friction, tick_update, 2),
        ))


def block_parameters(parameters: PendulumPlantParameters, where: str = "plant") -> dict:
    """Return the parameters of PendulumPlant that follow from masses, wheels, friction and slip.

    Raises:
        InputError: the friction is too steep for the 5 ms step, there is traction slip in a world frame, or a slip
            ratio in the body frame is 1 or more.
    """
    return {
        "slope_rad": np.array(parameters.slope_rad),
        "radius_m": np.array([wheel.radius_m for wheel in parameters.geometry.wheels]),
        "half_track_m": parameters.half_track_m, "body": parameters.inertias(),
        "contact": contact_parameters(parameters),
        "friction": friction_parameters(parameters.friction, mobility(parameters), f"{where}.friction"),
        "slip": slip_parameters(parameters.slip, parameters.half_track_m, f"{where}.slip"),
    }


def linear_model(parameters: PendulumPlantParameters) -> tuple[np.ndarray, np.ndarray]:
    """Return (A (6, 6), B (6, 2)) of (2.54)-(2.57), corrected, for x = [s, phi, theta, s_dot, phi_dot, theta_dot]."""
    mass, gravity, effort = linear_terms(parameters)
    a = np.zeros((6, 6))
    a[:3, 3:] = np.eye(3)
    a[3:, :3] = -np.linalg.solve(mass, gravity)
    return a, np.vstack([np.zeros((3, 2)), np.linalg.solve(mass, effort)])


def linear_terms(parameters: PendulumPlantParameters) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (M_L (3, 3), G_L (3, 3), E (3, 2)) of (2.51)-(2.53), corrected, without friction."""
    i = parameters.inertias()
    m13 = i["m_b_z"] + i["m13_rotors"]
    m12, m22, m23 = i["m12"], i["yaw_upright"] + i["yaw_wheels"], i["m23"]
    mass = np.array([[i["m11"], m12, m13], [m12, m22, m23], [m13, m23, i["m33"]]])
    gravity = np.diag([0.0, 0.0, -i["m_b_z"] * GRAVITY])
    (right, left), b = (wheel.radius_m for wheel in parameters.geometry.wheels), parameters.half_track_m
    effort = np.array([[1 / right, 1 / left], [b / right, -b / left], [-i["kappa"], -i["kappa"]]])
    return mass, gravity, effort


def mobility(parameters: PendulumPlantParameters) -> np.ndarray:
    """Return E' M^-1 E (2, 2) of the upright robot: wheel acceleration [rad/s^2] per wheel torque [N m]."""
    mass, _, effort = linear_terms(parameters)
    return effort.T @ np.linalg.solve(mass, effort)
