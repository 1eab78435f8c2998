"""The two-wheeled inverted pendulum as the generator knows it: Lagrange's equations, IMU, and its loop.

Quasi-velocities v = [s', phi', theta']. Wheel i rolls at g_i v, its rotor turns at n g_i v + (1 - n) theta', so

    M = M_body(theta) + 2 m_w diag(1, b^2, 0) + sum_i I_w g_i g_i' + I_r h_i h_i',  h_i = n g_i + (1 - n) [0, 0, 1],

and the motor between body and wheel works on e_i = g_i - [0, 0, 1] ("wheel and body rotation"). The axle cannot move
sideways, but accelerates by s' phi' to its left: that moves the centre of gravity, z sin(theta) ahead of it.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from hidden.control_truth import due, expected_friction, filter_tilt, read_encoder, see, track
from hidden.effects_truth import (
    GRAVITY,
    SLIP_BUILD_UP_S,
    Effects,
    drive,
    ground_force,
    motor_torque,
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
X, Y, PHI, TILT, V, TURN, NOD, SLIP, THETA, SIZE = 0, 1, 2, 3, 4, 5, 6, 7, 8, 10  # state; NOD: tilt rate


class Body(NamedTuple):
    """The true robot."""

    body_kg: float
    total_kg: float
    z_m: float
    i_xx: float
    i_yy: float
    i_zz: float
    g: np.ndarray  # (2, 3) rolling rates from v, right then left
    wheels: np.ndarray  # (3, 3) wheels' and rotors' part of M
    coulomb: float  # friction that the nominal robot has
    viscous: float
    steepest: float  # slope of friction that the step allows [N m s/rad]


class Law(NamedTuple):
    """The nominal controller."""

    gain: np.ndarray  # (2, 6)
    radius_m: float
    half_track_m: float
    look_ahead_m: float
    hold_radius_m: float
    longest_m: float
    coulomb: float  # expected friction
    viscous: float
    dead_band: float
    scale: float
    variances: np.ndarray  # (4,) of the tilt filter
    initial: np.ndarray  # (3,) its first variances


class Imu(NamedTuple):
    """Place above and ahead of the axle, axes, bias and noise of the IMU."""

    height_m: float
    ahead_m: float
    turn: np.ndarray  # (3, 3) from the body's axes to those of the sensor
    gain: np.ndarray  # (6,)
    bias: np.ndarray  # (6,)
    noise: np.ndarray  # (ticks + 1, 6)
    lag_s: float  # time constant of its filter


def true_body(plant, values: dict) -> Body:
    """From the nominal plant's parameters and the effects' `values`."""
    radii = np.full(2, plant.wheel_radius_m * (1.0 + values["wheel_radius_error"]["share"]))
    radii[int(values["single_wheel_radius_error"]["wheel"]) - 1] *= 1.0 + values["single_wheel_radius_error"]["share"]
    b = plant.half_track_m * (1.0 + values["track_error"]["share"])
    g = np.column_stack([1.0 / radii, np.array([b, -b]) / radii, np.zeros(2)])
    n, nod = plant.gear_ratio, np.array([0.0, 0.0, 1.0])
    wheels = 2.0 * plant.wheel_mass_kg * np.diag([1.0, b * b, 0.0])
    wheels[1, 1] += 2.0 * (plant.wheel_inertia_yaw_kg_m2 + plant.rotor_inertia_yaw_kg_m2)
    for row in g:
        rotor = n * row + (1.0 - n) * nod
        wheels += plant.wheel_inertia_kg_m2 * np.outer(row, row) + plant.rotor_inertia_kg_m2 * np.outer(rotor, rotor)
        wheels += values["drive_inertia"]["inertia_kg_m2"] * np.outer(row - nod, row - nod)
    mass = plant.body_mass_kg * (1.0 + values["mass_error"]["share"])
    yaw = 1.0 + values["yaw_inertia_error"]["share"]
    body = Body(
        mass, mass + 2.0 * plant.wheel_mass_kg,
        plant.centre_of_gravity_m + values["centre_of_gravity_offset"]["height_m"],
        plant.body_inertia_roll_kg_m2 * yaw,
        plant.body_inertia_pitch_kg_m2 * (1.0 + values["inertia_error"]["share"]), plant.body_inertia_yaw_kg_m2 * yaw,
        g, wheels, plant.friction.coulomb_n_m, plant.friction.viscous_n_m_s, 1.0,
    )
    effort = (g - nod).T
    quickest = float(np.linalg.eigvalsh(effort.T @ np.linalg.solve(mass_matrix(body, 0.0), effort))[-1])
    return body._replace(steepest=1.2 / (STEP_S * quickest))


def nominal_law(robot, gain) -> Law:
    """The controller of a scenario's `pendulum` with the gain K (2, 6)."""
    tracker, friction, believed = robot.control.tracker, robot.control.friction_compensation, robot.tilt_filter
    share = float(friction.enabled)
    variances = np.array([
        (believed.angular_acceleration_rad_s2 * TICK_S) ** 2, believed.bias_walk_rad_s_per_sqrt_s**2 * TICK_S,
        believed.gyro_std_rad_s**2, believed.accelerometer_std_rad**2,
    ])
    initial = np.array([
        believed.initial_tilt_std_rad, believed.initial_rate_std_rad_s, believed.initial_bias_std_rad_s,
    ])**2
    return Law(
        np.ascontiguousarray(gain, dtype=float), robot.plant.wheel_radius_m, robot.plant.half_track_m,
        tracker.look_ahead_m, tracker.hold_radius_m, tracker.longest_error_m, share * friction.coulomb_n_m,
        share * friction.viscous_n_m_s, friction.dead_band_rad_s, friction.speed_scale_rad_s, variances, initial,
    )


@njit(cache=True)
def mass_matrix(body, tilt):
    """M (3, 3) at a tilt [rad]."""
    c, s = np.cos(tilt), np.sin(tilt)
    lifted = body.body_kg * body.z_m
    m = body.wheels.copy()
    m[0, 0] += body.body_kg
    m[0, 2] += lifted * c
    m[2, 0] += lifted * c
    m[1, 1] += (lifted * body.z_m + body.i_xx) * s * s + body.i_zz * c * c
    m[2, 2] += lifted * body.z_m + body.i_yy
    return m


@njit(cache=True)
def accelerations(z, effort, body):
    """(s'', phi'', theta'') under the generalised forces `effort` (3), gravity on level floor included."""
    c, s = np.cos(z[TILT]), np.sin(z[TILT])
    lifted = body.body_kg * body.z_m
    squash = (lifted * body.z_m + body.i_xx - body.i_zz) * s * c  # half of d m22 / d theta
    q0 = effort[0] + lifted * s * (z[NOD] ** 2 + z[TURN] ** 2)
    q1 = effort[1] - 2.0 * squash * z[NOD] * z[TURN] - lifted * s * z[V] * z[TURN]
    q2 = effort[2] + squash * z[TURN] ** 2 + lifted * GRAVITY * s
    m00, m11, m22 = body.wheels[0, 0] + body.body_kg, body.wheels[1, 1], body.wheels[2, 2]
    m11 = m11 + (lifted * body.z_m + body.i_xx) * s * s + body.i_zz * c * c
    m22 = m22 + lifted * body.z_m + body.i_yy
    m01, m12 = body.wheels[0, 1], body.wheels[1, 2]
    m02 = body.wheels[0, 2] + lifted * c
    # Cholesky of the symmetric 3 x 3
    l00 = np.sqrt(m00)
    l10, l20 = m01 / l00, m02 / l00
    l11 = np.sqrt(m11 - l10 * l10)
    l21 = (m12 - l20 * l10) / l11
    l22 = np.sqrt(m22 - l20 * l20 - l21 * l21)
    y0 = q0 / l00
    y1 = (q1 - l10 * y0) / l11
    y2 = (q2 - l20 * y0 - l21 * y1) / l22
    a2 = y2 / l22
    a1 = (y1 - l21 * a2) / l11
    return (y0 - l10 * a1 - l20 * a2) / l00, a1, a2


@njit(cache=True)
def rates(time_s, z, torque, push, wander, body, e, out):
    """d/dt of the state z [x, y, phi, tilt, s', phi', tilt rate, traction slip, theta right, left].

    torque (2) [N m]; push (3): outer force along s, yaw and pitch moment [N, N m, N m]; wander (2): random slip of s
    and yaw.
    """
    c, s = np.cos(z[PHI]), np.sin(z[PHI])
    effort = push.copy()
    drive_n = 0.0
    for i in range(2):
        rate = body.g[i, 0] * z[V] + body.g[i, 1] * z[TURN] - z[NOD]
        net = wheel_torque(i, torque[i], rate, z[THETA + i], time_s, body.coulomb, body.viscous, body.steepest, e)
        effort[0] += body.g[i, 0] * net
        effort[1] += body.g[i, 1] * net
        effort[2] -= net
        drive_n += body.g[i, 0] * torque[i]
        out[THETA + i] = rate
    out[SLIP] = (steady_slip(drive_n, body.total_kg * GRAVITY, e.slip_gain[0]) - z[SLIP]) / SLIP_BUILD_UP_S
    u = travelled(z[V], e.slip_ratio[0] + wander[0], z[SLIP], z[X], z[Y], e)
    out[PHI], out[TILT] = (1.0 - wander[1]) * z[TURN], z[NOD]
    aside = -e.bend_s * u * out[PHI]
    out[X], out[Y] = c * u - s * aside, s * u + c * aside
    gx, gy = ground_force(z[X], z[Y], out[X], out[Y], body.total_kg, e)
    lifted = body.body_kg * body.z_m * GRAVITY
    effort[0] += c * gx + s * gy
    effort[1] -= e.scrub_n_m * soft_sign(z[TURN], 0.02)
    effort[1] -= lifted * np.sin(z[TILT]) * (c * e.slope[1] - s * e.slope[0])
    effort[2] -= lifted * np.cos(z[TILT]) * (c * e.slope[0] + s * e.slope[1])
    out[V], out[TURN], out[NOD] = accelerations(z, effort, body)


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
def read_imu(tick, z, velocity, change, imu, slope, readings):
    """Specific force and rate in the sensor's axes, into row `tick` of `readings` (ticks + 1, 6).

    velocity (4): along x of B, phi', tilt rate, along y of B, as the room sees them; change (4): their rates of change.
    """
    c, s, l = np.cos(z[TILT]), np.sin(z[TILT]), imu.height_m
    uphill = np.cos(z[PHI]) * slope[0] + np.sin(z[PHI]) * slope[1]
    aside = -np.sin(z[PHI]) * slope[0] + np.cos(z[PHI]) * slope[1]
    v, turn, nod, side = velocity
    ax = change[0] - side * turn + l * (change[2] * c - nod * nod * s) - turn * turn * l * s + GRAVITY * uphill
    ay = change[3] + v * turn + change[1] * l * s + 2.0 * turn * l * c * nod + GRAVITY * aside
    az = GRAVITY - l * (change[2] * s + nod * nod * c)
    # a point ahead of it on the body: d(rates)/dt x arm + rates x (rates x arm)
    p, r, far = -s * turn, c * turn, imu.ahead_m
    r_change = c * change[1] - s * nod * turn
    felt = np.array([
        c * ax - s * az - far * (nod * nod + r * r), ay + far * (r_change + p * nod),
        s * ax + c * az + far * (p * r - change[2]),
    ])
    as_read(tick, felt, np.array([-s * turn, nod, c * turn]), imu, readings)


@njit(cache=True)
def as_read(tick, force, turned, imu, readings):
    """What the IMU makes of a specific force (3) and a rate (3) in the body's axes, into row `tick` of `readings`.

    Its filter acts on noise as well.
    """
    out = readings[tick]
    force, turned = imu.turn @ force, imu.turn @ turned
    for i in range(3):
        out[i] = imu.gain[i] * force[i] + imu.bias[i] + imu.noise[tick, i]
        out[3 + i] = imu.gain[3 + i] * turned[i] + imu.bias[3 + i] + imu.noise[tick, 3 + i]
    if imu.lag_s > 0.0 and tick > 0:
        kept = np.exp(-TICK_S / imu.lag_s)
        for i in range(6):
            out[i] += kept * (readings[tick - 1, i] - out[i])


@njit(cache=True)
def seen_velocity(z, slip, e):
    """Forward speed, turning rate, tilt rate and speed to the left (4) of the robot on the floor, slip taken off."""
    u = travelled(z[V], e.slip_ratio[0] + slip[0], z[SLIP], z[X], z[Y], e)
    turn = (1.0 - slip[1]) * z[TURN]
    return np.array([u, turn, z[NOD], -e.bend_s * u * turn])


class Loop(NamedTuple):
    """What sensors and controller keep from tick to tick."""

    commanded: np.ndarray  # (ticks, 2)
    held: np.ndarray  # (ticks, 2)
    angles: np.ndarray  # (ticks + 1, 2)
    felt: np.ndarray  # (ticks + 1, 6)
    poses: np.ndarray  # (ticks + 1, 3)
    truth: np.ndarray  # (ticks + 1, 7)
    path: np.ndarray  # (ticks + 1, 2) of odometry: s, phi
    fixes: np.ndarray  # (captures, 5)
    numbers: np.ndarray  # (3,) fixes so far, tick of the last one's capture, tilt at the last tick
    raw: np.ndarray  # (2,), as the following
    counts: np.ndarray
    omega: np.ndarray
    slewed: np.ndarray
    lagged: np.ndarray
    gap: np.ndarray
    turned: np.ndarray
    bent: np.ndarray
    fix: np.ndarray  # (3,)
    error: np.ndarray  # (3,)
    then: np.ndarray  # (2,)
    tilt: np.ndarray  # (3,)
    p: np.ndarray  # (3, 3)


@njit(cache=True)
def fresh(ticks, law, encoder):
    """A loop before its first tick."""
    return Loop(
        np.zeros((ticks, 2)), np.zeros((ticks, 2)), np.zeros((ticks + 1, 2)), np.zeros((ticks + 1, 6)),
        np.zeros((ticks + 1, 3)), np.zeros((ticks + 1, 7)), np.zeros((ticks + 1, 2)), np.zeros((ticks // 19 + 1, 5)),
        np.array([0.0, -1.0, 0.0]), np.floor(encoder.phase), np.zeros(2), np.zeros(2), np.zeros(2), np.zeros(2),
        np.zeros(2), np.zeros(2), np.zeros(2), np.zeros(3), np.zeros(3), np.zeros(2), np.zeros(3), np.diag(law.initial),
    )


@njit(cache=True)
def sense_and_command(tick, z, shown, loop, way_points, law, encoder, camera, e):
    """What sensors and controller do in a tick, after the IMU's row of it is in the loop; False: the run is over.

    z: the state, or its first seven numbers. shown (2): angles behind the wheels' play.
    """
    angles, path, tilt, then, numbers = loop.angles, loop.path, loop.tilt, loop.then, loop.numbers
    loop.poses[tick] = z[:3]
    loop.truth[tick] = z[:7]
    read_encoder(tick, shown, encoder, e, loop.raw, loop.counts, angles[tick])
    filter_tilt(tick == 0, loop.felt[tick], TICK_S, law.variances, tilt, loop.p)
    r, b = law.radius_m, law.half_track_m
    if tick > 0:
        right, left = angles[tick] - angles[tick - 1]
        path[tick, 0] = path[tick - 1, 0] + 0.5 * r * (right + left + 2.0 * (tilt[0] - numbers[2]))
        path[tick, 1] = path[tick - 1, 1] + 0.5 * r / b * (right - left)
        loop.omega[0] = encoder.memory * loop.omega[0] + (1.0 - encoder.memory) * right / TICK_S
        loop.omega[1] = encoder.memory * loop.omega[1] + (1.0 - encoder.memory) * left / TICK_S
    numbers[2] = tilt[0]
    capture = due(tick, camera)
    if capture >= 0 and see(capture, loop.poses, camera, loop.fix):
        seen = int(numbers[0])
        numbers[0], numbers[1] = seen + 1.0, 19.0 * capture
        loop.fixes[seen, 0], loop.fixes[seen, 1] = 19 * capture, tick
        loop.fixes[seen, 2:] = loop.fix
    if tick == len(loop.commanded) or abs(z[TILT]) > 1.5 or not np.isfinite(z[V]):
        return False
    if numbers[1] >= 0.0 and (capture >= 0 or tick % 19 == 0):
        track(loop.fix, way_points[tick // 19], law.look_ahead_m, law.hold_radius_m, law.longest_m, loop.error)
        then[:] = path[int(numbers[1])]
    miss_s, miss_phi = loop.error[0] + then[0] - path[tick, 0], loop.error[1] + then[1] - path[tick, 1]
    speed = 0.5 * r * (loop.omega[0] + loop.omega[1] + 2.0 * tilt[1])
    state = np.array([
        -miss_s, -miss_phi, tilt[0], speed - loop.error[2], 0.5 * r / b * (loop.omega[0] - loop.omega[1]), tilt[1],
    ])
    feedback = -law.gain @ state
    for i in range(2):
        friction = expected_friction(loop.omega[i], law.coulomb, law.viscous, law.dead_band, law.scale)
        loop.commanded[tick, i] = feedback[i] + friction
    drive(tick, loop.commanded[tick], loop.slewed, TICK_S, e, loop.held[tick])
    return True


@njit(cache=True)
def run(ticks, start, way_points, push, wander, body, law, encoder, imu, camera, e: Effects):
    """The closed loop for `ticks` ticks from the pose `start` (3), upright.

    push (ticks + 1, 3), wander (ticks + 1, 2): outer force and random slip at each tick, linear in between.
    Returns torque (ticks, 2), encoder (ticks + 1, 2), imu (ticks + 1, 6), fixes (k, 5: capture, tick of arrival, pose),
    truth (ticks + 1, 7: pose, tilt, s', phi', tilt rate). Stops where the body falls.
    """
    z, work, loop = np.zeros(SIZE), np.zeros((5, SIZE)), fresh(ticks, law, encoder)
    z[:3] = start
    torque, force, slip = np.zeros(2), np.zeros(3), np.zeros(2)
    velocity, before, change = np.zeros(4), np.zeros(4), np.zeros(4)
    for tick in range(ticks + 1):
        read_imu(tick, z, velocity, change, imu, e.slope, loop.felt)
        if not sense_and_command(tick, z, z[THETA:] + loop.gap, loop, way_points, law, encoder, camera, e):
            break
        for step in range(SUBSTEPS):
            share = (step + 0.5) / SUBSTEPS
            time_s = (tick + share) * TICK_S
            between(push, tick, share, force)
            between(wander, tick, share, slip)
            motor_torque(loop.held, time_s, STEP_S, TICK_S, e, loop.lagged, loop.gap, torque)
            rub(z[THETA:], loop.turned, loop.bent, e, torque)
            before[:] = seen_velocity(z, slip, e)
            advance(time_s, z, torque, force, slip, body, e, work)
            velocity[:] = seen_velocity(z, slip, e)
            for i in range(4):
                change[i] = (velocity[i] - before[i]) / STEP_S
    return loop.commanded, loop.angles, loop.felt, loop.fixes[: int(loop.numbers[0])], loop.truth
