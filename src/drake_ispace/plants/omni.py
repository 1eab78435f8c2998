"""Plant of the omni-directional robot, (2.73)-(2.76), for any wheels that allow motion in all three directions.

Let a and w be the world acceleration and the world velocity in body components. Then S' M S dv/dt + S' M dS/dt v =
S' E tau with theta_dot = G R(phi)' v becomes

    M_b a - m phi_dot wz [c_x, c_y, 0] + N (a + phi_dot [w_y, -w_x, 0]) = G' (tau - friction),    N = I_w G' G.

For the thesis's wheels N is diag(2/r^2, 2/r^2, b^2/r^2) I_w, and the equation is (2.74)-(2.76) with V = 2 I_w/r^2
phi_dot [y_dot, -x_dot, 0]. Here a and w belong to the robot's middle. For a centre of gravity c beside the middle,

    M_b = [m, 0, -m c_y; 0, m, m c_x; -m c_y, m c_x, I_phi + m c'c].
"""

from dataclasses import dataclass, field

import numpy as np

from drake_ispace.blocks.block import Block, Output, Spec
from drake_ispace.blocks.functions import cos, sin
from drake_ispace.blocks.kernels import copy, kernel
from drake_ispace.blocks.noise import stream
from drake_ispace.files.quantity import quantity
from drake_ispace.plants.friction import Friction, friction_parameters, friction_torque
from drake_ispace.plants.slip import RELAXATION, Slip, pose_rates, slip_parameters, traction_rate, traction_slip
from drake_ispace.plants.tick_memory import deflection, remember, slip_noise, tick_memory
from drake_ispace.plants.wheels import WheelGeometry, omni4, rescaled, toed


@dataclass
class OmniPlantParameters:
    """Parameters of the omni-directional robot: Table 2.2 with corrected yaw inertia (docs/fidelity.md, row 12)."""

    # M_t, body and wheels
    mass_kg: float = quantity(7.31, "kg", above=0.0)
    # I_phi about the centre of gravity; Table 2.2 prints 7.29e-5, which no robot of this size and mass can have
    inertia_kg_m2: float = quantity(7.29e-2, "kg*m^2", above=0.0)
    # I_w, with gears and rotor as seen at the wheel
    wheel_inertia_kg_m2: float = quantity(0.1e-5, "kg*m^2", minimum=0.0)
    # r_w
    wheel_radius_m: float = quantity(0.024, "m", above=0.0, maximum=5.0)
    # b, the full distance between opposite wheels
    wheel_distance_m: float = quantity(0.36, "m", above=0.0, maximum=20.0)
    # x, y of the centre of gravity in B, from the robot's middle
    centre_of_gravity_m: list[float] = quantity([0.0, 0.0], "m", length=2)
    # deviation of each wheel's radius from r_w, as a share of r_w
    wheel_radius_shares: list[float] = quantity([0.0, 0.0, 0.0, 0.0], above=-0.9, length=4)
    # deviation of each wheel's drive direction from the tangent, anticlockwise
    wheel_toe_rad: list[float] = quantity([0.0, 0.0, 0.0, 0.0], "rad", minimum=-0.5, maximum=0.5, length=4)
    # none by default, because the coefficients of (3.35) are those of the pendulum
    friction: Friction = field(default_factory=Friction)
    slip: Slip = field(default_factory=Slip)

    @property
    def geometry(self) -> WheelGeometry:
        nominal = omni4(self.wheel_radius_m, self.wheel_distance_m)
        return toed(rescaled(nominal, self.wheel_radius_shares), self.wheel_toe_rad)


X, Y, PHI, VX, VY, WZ, LAG, THETA = 0, 1, 2, 3, 4, 5, 6, 9  # continuous state; LAG: 3 lagged traction slips


@kernel
def derivatives(
    xc, xd, torque, ground_force, mass_kg, inertia_kg_m2, centre_of_gravity_m, wheel_inertia_kg_m2, wheels, friction,
    slip, out,
):
    """Write d/dt of [x, y, phi, vx, vy, wz, traction slip (3), theta_1..n], (2.73) with slip (6.4)."""
    c, s = cos(xc[PHI]), sin(xc[PHI])
    wx, wy, wz = c * xc[VX] + s * xc[VY], -s * xc[VX] + c * xc[VY], xc[WZ]
    fx, fy, moment = 0.0 * wx + ground_force[0], 0.0 * wx + ground_force[1], 0.0 * wx + ground_force[2]
    drive_x, drive_y, drive_moment = 0.0 * wx, 0.0 * wx, 0.0 * wx  # traction from the motor torques only
    nxx, nxy, nyy, nxz, nyz, nzz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(torque.shape[0]):  # loops are short, so that they are unrolled
        rate = wheels[3 * i] * wx + wheels[3 * i + 1] * wy + wheels[3 * i + 2] * wz
        net = torque[i] - friction_torque(rate, deflection(xc[THETA + i], xd, i), friction)
        out[THETA + i] = net  # until the next loop
    for i in range(torque.shape[0]):
        gx, gy, gz, net = wheels[3 * i], wheels[3 * i + 1], wheels[3 * i + 2], out[THETA + i]
        fx, fy, moment = fx + gx * net, fy + gy * net, moment + gz * net
        drive_x, drive_y = drive_x + gx * torque[i], drive_y + gy * torque[i]
        drive_moment = drive_moment + gz * torque[i]
        nxx, nxy, nyy = nxx + gx * gx, nxy + gx * gy, nyy + gy * gy
        nxz, nyz, nzz = nxz + gx * gz, nyz + gy * gz, nzz + gz * gz
        out[THETA + i] = gx * wx + gy * wy + gz * wz

    # traction slip: immediate, or lagged over the relaxation length
    t0 = traction_slip(0, drive_x, mass_kg, slip)
    t1 = traction_slip(1, drive_y, mass_kg, slip)
    t2 = traction_slip(2, drive_moment, mass_kg, slip)
    out[LAG] = traction_rate(0, t0, xc[LAG], wx, slip)
    out[LAG + 1] = traction_rate(1, t1, xc[LAG + 1], wy, slip)
    out[LAG + 2] = traction_rate(2, t2, xc[LAG + 2], wz, slip)
    traction = (t0, t1, t2)
    if slip[RELAXATION] > 0.0:
        traction = (xc[LAG], xc[LAG + 1], xc[LAG + 2])
    noise = (slip_noise(xd, 0), slip_noise(xd, 1), slip_noise(xd, 2))
    pose_rates(wx, wy, wz, (xc[X], xc[Y], xc[PHI]), traction, noise, slip, out)

    turn = out[PHI]
    cx, cy = turn * wy, -turn * wx
    i_w, away_x, away_y = wheel_inertia_kg_m2, mass_kg * centre_of_gravity_m[0], mass_kg * centre_of_gravity_m[1]
    b0 = fx - i_w * (nxx * cx + nxy * cy) + away_x * wz * turn
    b1 = fy - i_w * (nxy * cx + nyy * cy) + away_y * wz * turn
    b2 = moment - i_w * (nxz * cx + nyz * cy)
    # symmetric 3 x 3 solve of (M_b + N) a = b
    m00, m01, m02 = mass_kg + i_w * nxx, i_w * nxy, i_w * nxz - away_y
    m11, m12 = mass_kg + i_w * nyy, i_w * nyz + away_x
    m22 = inertia_kg_m2 + away_x * centre_of_gravity_m[0] + away_y * centre_of_gravity_m[1] + i_w * nzz
    k00, k01, k02 = m11 * m22 - m12 * m12, m02 * m12 - m01 * m22, m01 * m12 - m02 * m11
    k11, k12, k22 = m00 * m22 - m02 * m02, m01 * m02 - m00 * m12, m00 * m11 - m01 * m01
    determinant = m00 * k00 + m01 * k01 + m02 * k02
    share = 1.0 / determinant
    ax = (k00 * b0 + k01 * b1 + k02 * b2) * share
    ay = (k01 * b0 + k11 * b1 + k12 * b2) * share
    out[VX] = c * ax - s * ay
    out[VY] = s * ax + c * ay
    out[WZ] = (k02 * b0 + k12 * b1 + k22 * b2) * share


@kernel
def tick_update(tick, xc, xd, noise_stream, friction, slip, out):
    remember(tick, xc[THETA:], xd, noise_stream, friction, slip, out)


@kernel
def pose(xc, out):
    copy(xc[X : PHI + 1], out)


@kernel
def velocity(xc, out):
    copy(xc[VX : WZ + 1], out)


@kernel
def wheel_angle(xc, out):
    copy(xc[THETA:], out)


@kernel
def wheel_rate(xc, wheels, out):
    """Write the wheel speeds theta_dot = G R(phi)' v (n) [rad/s]; wheels: G (n, 3), row by row."""
    c, s = cos(xc[PHI]), sin(xc[PHI])
    wx, wy = c * xc[VX] + s * xc[VY], -s * xc[VX] + c * xc[VY]
    for i in range(out.shape[0]):
        out[i] = wheels[3 * i] * wx + wheels[3 * i + 1] * wy + wheels[3 * i + 2] * xc[WZ]


class OmniPlant(Block):
    """Dynamics of the omni-directional robot on carpet.

    .. pydrake_system::

        name: OmniPlant
        input_ports:
        - torque
        - ground_force
        output_ports:
        - pose
        - velocity
        - wheel_angle
        - wheel_rate

    torque (n,): wheel torques [N m]. ground_force (3,), only with `ground`: force [N, N] and moment about the robot's
    middle [N m] that the floor or a push exerts on the body, in B. pose (3,): x, y [m], phi [rad] of B in W.
    velocity (3,): wheel-consistent v_WB [m/s, m/s, rad/s] in W, which without slip is the rate of the pose.
    wheel_angle, wheel_rate (n,): theta [rad], theta_dot [rad/s], relative to the body. Equations (2.73)-(2.76), (6.4).

    Args:
        parameters: masses, wheels, friction and slip.
        initial_pose: x, y [m], phi [rad] in W at t = 0.
        seed: seed of the slip noise, which is drawn from the random stream `{where}/slip`.
        where: path of the parameters in the scenario, for messages.
        ground: whether the block has the input port `ground_force`; without the port the force is zero.

    Raises:
        InputError: the friction is too steep for the 5 ms step, there is traction slip in a world frame, or a slip
            ratio in the body frame is 1 or more.
        ValueError: the wheels hold sideways.
    """

    def __init__(
        self, parameters: OmniPlantParameters, initial_pose=(0.0, 0.0, 0.0), seed=0, where="plant", ground=False,
    ):
        geometry = parameters.geometry
        if len(geometry.sideways):
            raise ValueError("an OmniPlant moves in all three directions, expected wheels that do not hold sideways")
        wheels = geometry.inverse
        n = len(wheels)
        start = np.zeros(THETA + n)
        start[:3] = initial_pose
        super().__init__(Spec(
            inputs={"torque": n} | ({"ground_force": 3} if ground else {}),
            outputs={
                "pose": Output(3, pose), "velocity": Output(3, velocity), "wheel_angle": Output(n, wheel_angle),
                "wheel_rate": Output(n, wheel_rate),
            },
            parameters=block_parameters(parameters, where) | {"noise_stream": stream(seed, f"{where}/slip")}
            | ({} if ground else {"ground_force": np.zeros(3)}),
            continuous_state=start, derivatives=derivatives,
            noise_stream=f"{where}/slip", **tick_memory(parameters.slip, parameters.friction, tick_update, n),
        ))


def block_parameters(parameters: OmniPlantParameters, where: str = "plant") -> dict:
    """Return the parameters of OmniPlant that follow from masses, wheels, friction and slip.

    Raises:
        InputError: the friction is too steep for the 5 ms step, there is traction slip in a world frame, or a slip
            ratio in the body frame is 1 or more.
    """
    geometry = parameters.geometry
    lever_m = float(np.mean([np.hypot(w.x_m, w.y_m) for w in geometry.wheels]))
    return {
        "mass_kg": parameters.mass_kg, "inertia_kg_m2": parameters.inertia_kg_m2,
        "centre_of_gravity_m": np.array(parameters.centre_of_gravity_m),
        "wheel_inertia_kg_m2": parameters.wheel_inertia_kg_m2, "wheels": geometry.inverse.ravel(),
        "friction": friction_parameters(parameters.friction, mobility(parameters), f"{where}.friction"),
        "slip": slip_parameters(parameters.slip, lever_m, f"{where}.slip"),
    }


def mass_matrix(parameters: OmniPlantParameters) -> np.ndarray:
    """Return M_bar (3, 3) of (2.74) in body axes [kg, kg m, kg m^2]."""
    wheels = parameters.geometry.inverse
    m, (x, y) = parameters.mass_kg, parameters.centre_of_gravity_m
    turning = parameters.inertia_kg_m2 + m * (x * x + y * y)
    body = np.array([[m, 0.0, -m * y], [0.0, m, m * x], [-m * y, m * x, turning]])
    return body + parameters.wheel_inertia_kg_m2 * wheels.T @ wheels


def mobility(parameters: OmniPlantParameters) -> np.ndarray:
    """Return E' M^-1 E (n, n): wheel acceleration [rad/s^2] per wheel torque [N m]."""
    wheels = parameters.geometry.inverse
    return wheels @ np.linalg.solve(mass_matrix(parameters), wheels.T)
