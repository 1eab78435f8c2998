"""In the wire `body_motion`, between the body and its IMU: another place, turned axes, a scale, a constant added,
a low-pass.

body_motion = (ax, ay, az, wx, wy, wz): specific force [m/s^2], gravity included, and angular rate [rad/s] in the body's
axes, x ahead, y left, z up along the body. Noise comes later, in the IMU itself.
"""

import math

import numpy as np

from drake_ispace.blocks.kernels import kernel
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.effects.card import Card, Parameter
from drake_ispace.effects.wires import BodyMotionEffect


@kernel
def turned(body_motion, axes, out):
    """Both vectors in the axes whose matrix is `axes` (9,), row by row."""
    for half in (0, 3):
        x, y, z = body_motion[half], body_motion[half + 1], body_motion[half + 2]
        for i in range(3):
            out[half + i] = axes[3 * i] * x + axes[3 * i + 1] * y + axes[3 * i + 2] * z


@kernel
def scaled(body_motion, gain, out):
    for i in range(6):
        out[i] = gain[i] * body_motion[i]


@kernel
def biased(body_motion, bias, out):
    for i in range(6):
        out[i] = body_motion[i] + bias[i]


@kernel
def elsewhere(body_motion, xd, ahead_m, above_m, out):
    """Felt `ahead_m` and `above_m` of the believed place; x_d: rates of the tick before, and 1 once there are some."""
    wx, wy, wz = body_motion[3], body_motion[4], body_motion[5]
    tx = ty = tz = 0.0  # angular acceleration
    if xd[3] > 0.0:
        tx, ty, tz = (wx - xd[0]) / TICK_S, (wy - xd[1]) / TICK_S, (wz - xd[2]) / TICK_S
    along = wx * ahead_m + wz * above_m
    square = wx * wx + wy * wy + wz * wz
    out[0] = body_motion[0] + ty * above_m + wx * along - square * ahead_m
    out[1] = body_motion[1] + tz * ahead_m - tx * above_m + wy * along
    out[2] = body_motion[2] - ty * ahead_m + wz * along - square * above_m
    for i in range(3, 6):
        out[i] = body_motion[i]


@kernel
def remember_rates(body_motion, out):
    for i in range(3):
        out[i] = body_motion[3 + i]
    out[3] = 1.0


def rotation(vector) -> np.ndarray:
    """(3, 3) matrix of a rotation vector [rad]; the identity, bit for bit, of the vector 0."""
    angle = float(np.linalg.norm(vector))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = np.asarray(vector, dtype=float) / angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross


class ImuOffset(BodyMotionEffect):
    """Readings at another place of the body: a + dw/dt x r + w x (w x r), r = (ahead, 0, above)."""

    card = Card(
        name="imu_offset", title="IMU offset", home="imu",
        equation="a' = a + dw/dt x r + w x (w x r), r = (ahead_m, 0, above_m), dw/dt over the last tick",
        source="an IMU that sits elsewhere on the body than the model says; the thesis does not say where",
        signature="above: ax in step with the tilt's acceleration; ahead: az in step with it, ay with that of the yaw "
        "rate; nothing of the gyro, and nothing at rest or at steady turning but a constant",
        look_alikes=("inertia_error", "centre_of_gravity_offset", "accelerometer_scale", "motor_lag"),
        excitation="fast rocking on the spot, where the axle hardly accelerates; an inertia also changes how fast the "
        "body tilts, which the gyro shows",
    )
    parameters = tuple(
        Parameter(f"{name}_m", "m", 0.0, -0.5, 0.5, (0.01, 0.05), tolerance=1e-3) for name in ("ahead", "above")
    )
    output, update = elsewhere, remember_rates

    def memory_size(self, body):
        return 4


class ImuMisalignment(BodyMotionEffect):
    """Readings in the axes of an IMU that is turned on the body: R' a and R' w, R = exp(r x), r = (x, 0, z)."""

    card = Card(
        name="imu_misalignment", title="IMU misalignment", home="imu",
        equation="a' = R^T a, w' = R^T w, R the rotation by the vector (about_x, 0, about_z)",
        source="an IMU glued on askew",
        signature="about z: a share of the pitch rate reads as roll rate, and of ax as ay; about x: pitch reads as yaw "
        "and yaw as pitch, and gravity as ay",
        look_alikes=("gyro_scale", "accelerometer_scale", "gyro_bias", "accelerometer_bias"),
        excitation="pitching without yawing (driving straight to and fro) and yawing without pitching (turning on the "
        "spot): only a turned IMU couples them",
    )
    parameters = tuple(
        Parameter(f"about_{axis}_rad", "rad", 0.0, -0.5, 0.5, (0.006, 0.05), tolerance=6e-3) for axis in "xz"
    )
    output = turned

    def block_parameters(self, body, values):
        return {"axes": rotation([values["about_x_rad"], 0.0, values["about_z_rad"]]).T.ravel()}


class GyroScale(BodyMotionEffect):
    """(1 + share) w, all three axes."""

    card = Card(
        name="gyro_scale", title="Gyro scale", home="imu", equation="w' = (1 + share) w",
        source="sensitivity of the part, typically within 3 %, and its drift with temperature",
        signature="an error of the rates in proportion to them: nothing while standing; turning on the spot, the gyro "
        "and the room disagree about the angle by the share",
        look_alikes=("gyro_bias", "track_error", "encoder_scale", "imu_misalignment"),
        excitation="turning both ways at several speeds: a bias does not change its sign with the turn",
    )
    parameters = (Parameter("share", "1", 0.0, -0.5, 0.5, (0.01, 0.05), tolerance=1e-3),)
    output = scaled

    def block_parameters(self, body, values):
        return {"gain": np.repeat([1.0, 1.0 + values["share"]], 3)}


class AccelerometerScale(BodyMotionEffect):
    """(1 + share) a, all three axes."""

    card = Card(
        name="accelerometer_scale", title="Accelerometer scale", home="imu", equation="a' = (1 + share) a",
        source="sensitivity of the part, typically within 3 %",
        signature="gravity reads too large or too small, so az is off by a constant while standing; the tilt found "
        "from the direction of gravity stays right",
        look_alikes=("accelerometer_bias", "imu_misalignment", "centre_of_gravity_offset"),
        excitation="large tilts and accelerations to and fro: ax then grows with the motion, a bias does not",
    )
    parameters = (Parameter("share", "1", 0.0, -0.5, 0.5, (0.01, 0.05), tolerance=1e-3),)
    output = scaled

    def block_parameters(self, body, values):
        return {"gain": np.repeat([1.0 + values["share"], 1.0], 3)}


class GyroBias(BodyMotionEffect):
    """A constant added to wy (pitch) and wz (yaw)."""

    card = Card(
        name="gyro_bias", title="Gyro bias", home="imu", equation="wy' = wy + pitch, wz' = wz + yaw",
        source="zero-rate level of the part and its drift with temperature",
        signature="constant rates while the robot stands: the tilt estimate is off by a constant and the robot leans "
        "or creeps to balance it; integrated, the yaw rate leaves the room's heading in proportion to time",
        look_alikes=("gyro_scale", "accelerometer_bias", "centre_of_gravity_offset", "imu_misalignment"),
        excitation="standing still before and after moving: the bias is there, a scale error is not",
    )
    parameters = tuple(Parameter(f"{name}_rad_s", "rad/s", 0.0, -0.5, 0.5, (0.005, 0.03)) for name in ("pitch", "yaw"))
    output = biased

    def block_parameters(self, body, values):
        return {"bias": np.array([0.0, 0.0, 0.0, 0.0, values["pitch_rad_s"], values["yaw_rad_s"]])}


class AccelerometerBias(BodyMotionEffect):
    """A constant added to ax and az."""

    card = Card(
        name="accelerometer_bias", title="Accelerometer bias", home="imu", equation="ax' = ax + x, az' = az + z",
        source="zero-g level of the part; x in m/s^2 looks like a tilt of x / 9.81 rad",
        signature="x: the tilt from gravity is off by x / g, and the robot leans or creeps; z: gravity off by a "
        "constant",
        look_alikes=("accelerometer_scale", "imu_misalignment", "centre_of_gravity_offset", "floor_tilt", "gyro_bias"),
        excitation="turning on the spot by half a turn: a bias turns with the robot, a tilted floor stays with the "
        "room; large tilts to tell z from a scale error",
    )
    parameters = tuple(Parameter(f"{axis}_m_s2", "m/s^2", 0.0, -3.0, 3.0, (0.05, 0.3)) for axis in "xz")
    output = biased

    def block_parameters(self, body, values):
        return {"bias": np.array([values["x_m_s2"], 0.0, values["z_m_s2"], 0.0, 0.0, 0.0])}


@kernel
def lagged(xd, body_motion, memory, out):
    fresh = memory if xd[6] > 0.0 else 0.0  # the first reading stands as it is
    for i in range(6):
        out[i] = body_motion[i] + fresh * (xd[i] - body_motion[i])


@kernel
def remember_lagged(xd, body_motion, memory, out):
    lagged(xd, body_motion, memory, out)
    out[6] = 1.0


class ImuLag(BodyMotionEffect):
    """All readings behind a low-pass of first order, a step a tick."""

    card = Card(
        name="imu_lag", title="Low-pass of the IMU", home="imu",
        equation="a'_k = m a'_k-1 + (1 - m) a_k, m = exp(-T / time_constant), and the same of w",
        source="the digital filter that most parts have, and that is often left at its default",
        signature="rates and accelerations lag behind what wheels and torque say, the faster the motion the more",
        look_alikes=("motor_lag", "command_delay", "imu_offset", "gyro_scale"),
        excitation="fast rocking and quick starts of a turn: a slow motor delays the encoders as well",
    )
    parameters = (Parameter("time_constant_s", "s", 0.0, 0.0, 0.3, (0.003, 0.02), tolerance=5e-4),)
    output, update = lagged, remember_lagged

    def memory_size(self, body):
        return 7

    def block_parameters(self, body, values):
        time_constant_s = values["time_constant_s"]
        return {"memory": math.exp(-TICK_S / time_constant_s) if time_constant_s > 0.0 else 0.0}


#: In the order in which a reading comes about: place, axes, sensitivity, zero level, filter.
EFFECTS = (
    ImuOffset(), ImuMisalignment(), GyroScale(), AccelerometerScale(), GyroBias(), AccelerometerBias(), ImuLag(),
)
