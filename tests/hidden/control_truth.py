"""The nominal multi-rate controllers' parts, coded anew: encoder, camera, estimator, tracker, tilt filter."""

from typing import NamedTuple

import numpy as np
from numba import njit


class Camera(NamedTuple):
    """What the ceiling camera does to a pose. Draws are per capture."""

    pixel_x_m: float
    pixel_y_m: float
    spacing_m: float  # between the two markers
    half_width_m: float  # of the room
    half_depth_m: float
    age_ticks: float  # how much older than its stamp a pose is, below 0: younger
    scale: float
    angle_rad: float
    offset: np.ndarray  # (2,) [m]
    marker: np.ndarray  # (2,) in B [m]
    lens_per_m2: float  # radial distortion
    tilt_per_m: np.ndarray  # (2,) of the picture, not rectified
    noise: np.ndarray  # (captures, 4) [pixels]
    missed: np.ndarray  # (captures,) bool


class Encoder(NamedTuple):
    """Wheel encoders and the low-pass of their rate."""

    step_rad: float  # of one count
    memory: float  # of the low-pass
    phase: np.ndarray  # (n,) place of the wheel within a count at the start, 0..1
    dither: np.ndarray  # (ticks + 1, n) uniform 0..1, for lost counts


@njit(cache=True)
def wrapped(angle):
    """`angle` [rad] between -pi and pi."""
    return angle - 2.0 * np.pi * np.round(angle / (2.0 * np.pi))


@njit(cache=True)
def read_encoder(tick, angle, encoder, e, raw, counts, out):
    """Angles (n) [rad] that the counters show for wheel angles `angle` (n); raw, counts (n): integers as floats."""
    for i in range(angle.shape[0]):
        shown = angle[i] + e.eccentric[i, 0] * np.sin(angle[i]) + e.eccentric[i, 1] * (np.cos(angle[i]) - 1.0)
        now = np.floor(e.encoder_gain * shown / encoder.step_rad + encoder.phase[i])
        change = now - raw[i]
        raw[i] = now
        if e.lost[i] > 0.0:
            kept = np.floor((1.0 - e.lost[i]) * abs(change) + encoder.dither[tick, i])
            change = min(kept, abs(change)) * np.sign(change)
        counts[i] += change
        out[i] = encoder.step_rad * counts[i]


@njit(cache=True)
def due(tick, camera):
    """Number of the capture that reaches the robot in this tick, -1 if there is none."""
    wait = int(np.ceil(max(-camera.age_ticks, 0.0)))
    stamp = tick - wait
    return stamp // 19 if stamp >= 0 and stamp % 19 == 0 else -1


@njit(cache=True)
def pictured(x, y, camera):
    """Where a point of the floor [m] lands in a picture that lens and tilt of the camera distort [m]."""
    stretch = 1.0 + camera.lens_per_m2 * (x * x + y * y)
    depth = 1.0 - camera.tilt_per_m[0] * x - camera.tilt_per_m[1] * y
    return x * stretch / depth, y * stretch / depth


@njit(cache=True)
def see(capture, poses, camera, out):
    """Pose (3) that the room reports for a capture, into `out`; False if it does not see the robot.

    poses (ticks + 1, 3): true ones so far.
    """
    when = max(19.0 * capture - camera.age_ticks, 0.0)
    row = int(np.floor(when))
    share = when - row
    x, y, phi = poses[row, 0], poses[row, 1], poses[row, 2]
    if share > 0.0:
        x += share * (poses[row + 1, 0] - x)
        y += share * (poses[row + 1, 1] - y)
        phi += share * (poses[row + 1, 2] - phi)
    if camera.missed[capture] or abs(x) > camera.half_width_m or abs(y) > camera.half_depth_m:
        return False
    c, s = np.cos(phi), np.sin(phi)
    x, y = x + c * camera.marker[0] - s * camera.marker[1], y + s * camera.marker[0] + c * camera.marker[1]
    half, noise = 0.5 * camera.spacing_m, camera.noise[capture]
    front_x, front_y = pictured(x + half * c, y + half * s, camera)
    rear_x, rear_y = pictured(x - half * c, y - half * s, camera)
    front_x = camera.pixel_x_m * (np.floor(front_x / camera.pixel_x_m + noise[0]) + 0.5)
    front_y = camera.pixel_y_m * (np.floor(front_y / camera.pixel_y_m + noise[1]) + 0.5)
    rear_x = camera.pixel_x_m * (np.floor(rear_x / camera.pixel_x_m + noise[2]) + 0.5)
    rear_y = camera.pixel_y_m * (np.floor(rear_y / camera.pixel_y_m + noise[3]) + 0.5)
    x, y = 0.5 * camera.scale * (front_x + rear_x), 0.5 * camera.scale * (front_y + rear_y)
    c, s = np.cos(camera.angle_rad), np.sin(camera.angle_rad)
    out[0] = c * x - s * y + camera.offset[0]
    out[1] = s * x + c * y + camera.offset[1]
    out[2] = wrapped(np.arctan2(front_y - rear_y, front_x - rear_x) + camera.angle_rad)
    return True


@njit(cache=True)
def carried_on(fix, then, now, out):
    """A fix (3) carried on by odometry from `then` (3), of its capture, to `now` (3); (6.6) with its rotation."""
    turn = fix[2] - then[2]
    c, s = np.cos(turn), np.sin(turn)
    dx, dy = now[0] - then[0], now[1] - then[1]
    out[0], out[1], out[2] = fix[0] + c * dx - s * dy, fix[1] + s * dx + c * dy, wrapped(fix[2] + now[2] - then[2])


@njit(cache=True)
def track(fix, way_point, look_ahead_m, hold_radius_m, longest_m, out):
    """Tracking error (3) in the robot's own coordinates: s_e [m], phi_h [rad], speed fed forward [m/s]; (6.28)-(6.31).

    The robot keeps `look_ahead_m` behind a moving way point and backs up to one that lies behind it.
    """
    dx, dy = way_point[1] - fix[0], way_point[2] - fix[1]
    distance = np.hypot(dx, dy)
    bearing = wrapped(np.arctan2(dy, dx) - fix[2])
    speed = np.hypot(way_point[4], way_point[5])
    backwards = abs(bearing) > 0.5 * np.pi
    fold = bearing - np.pi * np.sign(bearing) if backwards else bearing
    side = -1.0 if backwards else 1.0
    ahead = side * look_ahead_m if speed > 0.0 else 0.0
    out[0] = min(max(distance * np.cos(bearing) - ahead, -longest_m), longest_m)
    out[1] = fold * min(1.0, distance / hold_radius_m)
    out[2] = side * speed if ahead != 0.0 else 0.0


@njit(cache=True)
def filter_tilt(first, imu, tick_s, variances, x, p):
    """One step of the tilt filter in matrix form: x (3) tilt, rate, gyro bias; p (3, 3) its covariance.

    imu (6): specific force and rate. variances (4): rate walk and bias walk per tick, gyro, direction of the force.
    """
    if not first:
        f = np.eye(3)
        f[0, 1] = tick_s
        x[:] = f @ x
        p[:] = f @ p @ f.T
        p[1, 1] += variances[0]
        p[2, 2] += variances[1]
    h = np.array([0.0, 1.0, 1.0])
    for measurement in range(2):
        value, variance = imu[4], variances[2]
        if measurement == 1:
            h[:] = 0.0
            h[0] = 1.0
            value, variance = np.arctan2(-imu[0], imu[2]), variances[3]
        ph = p @ h
        gain = ph / (h @ ph + variance)
        x += gain * (value - h @ x)
        p -= np.outer(gain, ph)


@njit(cache=True)
def expected_friction(rate, coulomb, viscous, dead_band, scale):
    """Torque [N m] that the controller adds for friction at an encoder `rate` [rad/s]; (3.34)-(3.38)."""
    beyond = max(abs(rate) - dead_band, 0.0)
    if beyond == 0.0:
        return 0.0
    return coulomb * np.tanh(beyond / scale) * np.sign(rate) + viscous * rate
