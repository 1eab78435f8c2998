"""The omni-directional robot as the generator knows it: rigid body on four rollers in body axes, and its loop.

With v = [vx, vy, wz] of the robot's middle in B and p = M v the momentum of a body whose centre of gravity lies at
(cx, cy),

    M v_dot + I_w G'G v_dot = G' tau + Q - [-wz p_y, wz p_x, vx p_y - vy p_x].

The pose moves with the wheels but for slip. Runge-Kutta 4 in steps of a tenth of a tick.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from hidden.control_truth import carried_on, due, expected_friction, read_encoder, see, wrapped
from hidden.effects_truth import (
    GRAVITY,
    SLIP_BUILD_UP_S,
    Effects,
    drive,
    ground_force,
    motor_torque,
    of_one_wheel,
    rub,
    soft_sign,
    steady_slip,
    travelled,
    wheel_torque,
)
from hidden.motions import TICK_S
from hidden.noise_truth import between

SUBSTEPS = 10
STEP_S = TICK_S / SUBSTEPS
X, Y, PHI, VX, VY, WZ, SLIP, THETA, SIZE = 0, 1, 2, 3, 4, 5, 6, 8, 12  # state; SLIP: 2, THETA: 4


class Body(NamedTuple):
    """The true robot."""

    mass_kg: float
    inertia_kg_m2: float  # about the centre of gravity
    centre_m: np.ndarray  # (2,) of gravity, in B
    g: np.ndarray  # (4, 3) wheel rates from v
    m: np.ndarray  # (3, 3) of the body alone
    inverse: np.ndarray  # (3, 3) of body and wheels
    coulomb: float  # friction that the nominal robot has
    viscous: float
    steepest: float  # slope of friction that the step allows [N m s/rad]


class Law(NamedTuple):
    """The nominal controller."""

    k_p: np.ndarray  # (3, 3)
    k_d: np.ndarray  # (3, 3)
    mass: np.ndarray  # (3,)
    j: np.ndarray  # (3, 4) of (2.64), nominal
    velocity_share: float
    acceleration_share: float
    coulomb: float  # expected friction
    viscous: float
    dead_band: float
    scale: float


def inverse_kinematics(radii, lever_m, toe=0.0):
    """G (4, 3) of wheels at 0, 90, 180, 270 degrees that drive tangentially, each turned by its `toe` [rad]."""
    angle = 0.5 * np.pi * np.arange(4)
    arms = lever_m * np.cos(toe) * np.ones(4)
    return np.column_stack([-np.sin(angle + toe), np.cos(angle + toe), arms]) / np.asarray(radii)[:, None]


def true_body(plant, values: dict) -> Body:
    """From the nominal plant's parameters and the effects' `values`."""
    radii = np.full(4, plant.wheel_radius_m * (1.0 + values["wheel_radius_error"]["share"]))
    radii[int(values["single_wheel_radius_error"]["wheel"]) - 1] *= 1.0 + values["single_wheel_radius_error"]["share"]
    lever_m = 0.5 * plant.wheel_distance_m * (1.0 + values["track_error"]["share"])
    g = inverse_kinematics(radii, lever_m, of_one_wheel("omni", values["wheel_toe"], "angle_rad"))
    mass = plant.mass_kg * (1.0 + values["mass_error"]["share"])
    inertia = plant.inertia_kg_m2 * (1.0 + values["inertia_error"]["share"])
    cx, cy = values["centre_of_gravity_offset"]["x_m"], values["centre_of_gravity_offset"]["y_m"]
    m = np.array([
        [mass, 0.0, -mass * cy], [0.0, mass, mass * cx], [-mass * cy, mass * cx, inertia + mass * (cx**2 + cy**2)],
    ])
    turning = plant.wheel_inertia_kg_m2 + values["drive_inertia"]["inertia_kg_m2"]
    inverse = np.linalg.inv(m + turning * g.T @ g)
    quickest = float(np.linalg.eigvalsh(g @ inverse @ g.T)[-1])
    return Body(
        mass, inertia, np.array([cx, cy], dtype=float), g, m, inverse, plant.friction.coulomb_n_m,
        plant.friction.viscous_n_m_s, 1.2 / (STEP_S * quickest),
    )


def nominal_law(robot, gains) -> Law:
    """The controller of a scenario's `omni`, gains (K_p, K_d)."""
    plant, control, friction = robot.plant, robot.control, robot.friction_compensation
    g = inverse_kinematics(np.full(4, plant.wheel_radius_m), 0.5 * plant.wheel_distance_m)
    nominal = np.diag([plant.mass_kg, plant.mass_kg, plant.inertia_kg_m2]) + plant.wheel_inertia_kg_m2 * g.T @ g
    k_p, k_d = (np.ascontiguousarray(k, dtype=float) for k in gains)
    share = float(friction.enabled)
    return Law(
        k_p, k_d, np.diag(nominal).copy(), np.ascontiguousarray(np.linalg.pinv(g)),
        float(control.velocity_feed_forward), float(control.acceleration_feed_forward), share * friction.coulomb_n_m,
        share * friction.viscous_n_m_s, friction.dead_band_rad_s, friction.speed_scale_rad_s,
    )


@njit(cache=True)
def rates(time_s, z, torque, push, wander, body, e, out):
    """d/dt of the state z [x, y, phi, vx, vy, wz (B), traction slip (2), theta (4)].

    torque (4) [N m]; push (3): outer force in B [N, N, N m]; wander (3): random slip.
    """
    c, s = np.cos(z[PHI]), np.sin(z[PHI])
    vx, vy, wz = z[VX], z[VY], z[WZ]
    qx, qy, qz = push[0], push[1], push[2]
    fx = fy = 0.0
    for i in range(4):
        rate = body.g[i, 0] * vx + body.g[i, 1] * vy + body.g[i, 2] * wz
        net = wheel_torque(i, torque[i], rate, z[THETA + i], time_s, body.coulomb, body.viscous, body.steepest, e)
        qx, qy, qz = qx + body.g[i, 0] * net, qy + body.g[i, 1] * net, qz + body.g[i, 2] * net
        fx, fy = fx + body.g[i, 0] * torque[i], fy + body.g[i, 1] * torque[i]
        out[THETA + i] = rate
    out[SLIP] = (steady_slip(fx, body.mass_kg * GRAVITY, e.slip_gain[0]) - z[SLIP]) / SLIP_BUILD_UP_S
    out[SLIP + 1] = (steady_slip(fy, body.mass_kg * GRAVITY, e.slip_gain[1]) - z[SLIP + 1]) / SLIP_BUILD_UP_S
    ux = travelled(vx, e.slip_ratio[0] + wander[0], z[SLIP], z[X], z[Y], e)
    uy = travelled(vy, e.slip_ratio[1] + wander[1], z[SLIP + 1], z[X], z[Y], e)
    out[PHI] = (1.0 - wander[2]) * wz
    ux, uy = ux + e.bend_s * out[PHI] * uy, uy - e.bend_s * out[PHI] * ux
    out[X], out[Y] = c * ux - s * uy, s * ux + c * uy

    gx, gy = ground_force(z[X], z[Y], out[X], out[Y], body.mass_kg, e)
    wx, wy = c * gx + s * gy, -s * gx + c * gy
    weight_x, weight_y = -body.mass_kg * GRAVITY * e.slope[0], -body.mass_kg * GRAVITY * e.slope[1]
    weight_x, weight_y = c * weight_x + s * weight_y, -s * weight_x + c * weight_y
    qx, qy = qx + wx, qy + wy
    qz += body.centre_m[0] * weight_y - body.centre_m[1] * weight_x - e.scrub_n_m * soft_sign(wz, 0.02)
    px, py = body.mass_kg * (vx - wz * body.centre_m[1]), body.mass_kg * (vy + wz * body.centre_m[0])
    qx, qy, qz = qx + wz * py, qy - wz * px, qz - vx * py + vy * px
    for i in range(3):
        out[VX + i] = body.inverse[i, 0] * qx + body.inverse[i, 1] * qy + body.inverse[i, 2] * qz


@njit(cache=True)
def advance(time_s, z, torque, push, wander, body, e, work):
    """One Runge-Kutta 4 step of STEP_S, in place; work (5, SIZE)."""
    h = STEP_S
    rates(time_s, z, torque, push, wander, body, e, work[0])
    for stage in range(1, 4):
        share = h if stage == 3 else 0.5 * h
        for i in range(SIZE):
            work[4, i] = z[i] + share * work[stage - 1, i]
        rates(time_s, work[4], torque, push, wander, body, e, work[stage])
    for i in range(SIZE):
        z[i] += h / 6.0 * (work[0, i] + 2.0 * work[1, i] + 2.0 * work[2, i] + work[3, i])


@njit(cache=True)
def control(way_point, estimate, omega, law, out):
    """Wheel torques (4) of (6.23) and (2.65) at the estimated pose (3) and encoder rates `omega` (4)."""
    c, s = np.cos(estimate[2]), np.sin(estimate[2])
    v = law.j @ omega
    miss = np.array([way_point[1] - estimate[0], way_point[2] - estimate[1], wrapped(way_point[3] - estimate[2])])
    lag = law.velocity_share * way_point[4:7] - np.array([c * v[0] - s * v[1], s * v[0] + c * v[1], v[2]])
    force = law.k_p @ miss + law.k_d @ lag + law.acceleration_share * law.mass * way_point[7:10]
    torque = law.j.T @ np.array([c * force[0] + s * force[1], -s * force[0] + c * force[1], force[2]])
    for i in range(4):
        friction = expected_friction(omega[i], law.coulomb, law.viscous, law.dead_band, law.scale)
        out[i] = torque[i] + friction


class Loop(NamedTuple):
    """What sensors and controller keep from tick to tick."""

    commanded: np.ndarray  # (ticks, 4)
    held: np.ndarray  # (ticks, 4)
    angles: np.ndarray  # (ticks + 1, 4)
    poses: np.ndarray  # (ticks + 1, 3)
    truth: np.ndarray  # (ticks + 1, 6)
    odometry: np.ndarray  # (ticks + 1, 3)
    fixes: np.ndarray  # (captures, 5)
    seen: np.ndarray  # (1,) number of fixes
    raw: np.ndarray  # (4,), as the following
    counts: np.ndarray
    omega: np.ndarray
    slewed: np.ndarray
    lagged: np.ndarray
    gap: np.ndarray
    turned: np.ndarray
    bent: np.ndarray
    fix: np.ndarray  # (3,), as the following
    then: np.ndarray
    estimate: np.ndarray


@njit(cache=True)
def fresh(ticks, told, encoder):
    """A loop before its first tick; odometry is told `told` (3)."""
    loop = Loop(
        np.zeros((ticks, 4)), np.zeros((ticks, 4)), np.zeros((ticks + 1, 4)), np.zeros((ticks + 1, 3)),
        np.zeros((ticks + 1, 6)), np.zeros((ticks + 1, 3)), np.zeros((ticks // 19 + 1, 5)), np.zeros(1, np.int64),
        np.floor(encoder.phase), np.zeros(4), np.zeros(4), np.zeros(4), np.zeros(4), np.zeros(4), np.zeros(4),
        np.zeros(4), told.copy(), told.copy(), np.zeros(3),
    )
    loop.odometry[0] = told
    return loop


@njit(cache=True)
def sense_and_command(tick, z, shown, loop, way_points, law, encoder, camera, e):
    """What sensors and controller do in a tick; False: the run is over.

    z: the state, or its first six numbers. shown (4): angles behind the wheels' play.
    """
    angles, odometry = loop.angles, loop.odometry
    c, s = np.cos(z[PHI]), np.sin(z[PHI])
    loop.poses[tick] = z[:3]
    loop.truth[tick, :3] = z[:3]
    loop.truth[tick, 3] = c * z[VX] - s * z[VY]
    loop.truth[tick, 4], loop.truth[tick, 5] = s * z[VX] + c * z[VY], z[WZ]
    read_encoder(tick, shown, encoder, e, loop.raw, loop.counts, angles[tick])
    if tick > 0:
        moved = law.j @ (angles[tick] - angles[tick - 1])
        for i in range(4):
            rate = (angles[tick, i] - angles[tick - 1, i]) / TICK_S
            loop.omega[i] = encoder.memory * loop.omega[i] + (1.0 - encoder.memory) * rate
        middle = odometry[tick - 1, 2] + 0.5 * moved[2]
        c, s = np.cos(middle), np.sin(middle)
        odometry[tick, 0] = odometry[tick - 1, 0] + c * moved[0] - s * moved[1]
        odometry[tick, 1] = odometry[tick - 1, 1] + s * moved[0] + c * moved[1]
        odometry[tick, 2] = odometry[tick - 1, 2] + moved[2]
    capture = due(tick, camera)
    if capture >= 0 and see(capture, loop.poses, camera, loop.fix):
        loop.then[:] = odometry[19 * capture]
        loop.fixes[loop.seen[0], 0], loop.fixes[loop.seen[0], 1] = 19 * capture, tick
        loop.fixes[loop.seen[0], 2:] = loop.fix
        loop.seen[0] += 1
    if tick == len(loop.commanded):
        return False
    carried_on(loop.fix, loop.then, odometry[tick], loop.estimate)
    control(way_points[tick // 19], loop.estimate, loop.omega, law, loop.commanded[tick])
    drive(tick, loop.commanded[tick], loop.slewed, TICK_S, e, loop.held[tick])
    return True


@njit(cache=True)
def run(ticks, start, told, way_points, push, wander, body, law, encoder, camera, e: Effects):
    """The closed loop for `ticks` ticks from the pose `start` (3); odometry is told `told` (3).

    push, wander (ticks + 1, 3): outer force in B and random slip at each tick, linear in between.
    Returns torque (ticks, 4), encoder (ticks + 1, 4), fixes (k, 5: capture, tick of arrival, pose), truth
    (ticks + 1, 6: pose, wheel-consistent velocity in W).
    """
    z, work, loop = np.zeros(SIZE), np.zeros((5, SIZE)), fresh(ticks, told, encoder)
    z[:3] = start
    torque, force, slip = np.zeros(4), np.zeros(3), np.zeros(3)
    for tick in range(ticks + 1):
        if not sense_and_command(tick, z, z[THETA:] + loop.gap, loop, way_points, law, encoder, camera, e):
            break
        for step in range(SUBSTEPS):
            share = (step + 0.5) / SUBSTEPS
            time_s = (tick + share) * TICK_S
            between(push, tick, share, force)
            between(wander, tick, share, slip)
            motor_torque(loop.held, time_s, STEP_S, TICK_S, e, loop.lagged, loop.gap, torque)
            rub(z[THETA:], loop.turned, loop.bent, e, torque)
            advance(time_s, z, torque, force, slip, body, e, work)
    return loop.commanded, loop.angles, loop.fixes[: loop.seen[0]], loop.truth
