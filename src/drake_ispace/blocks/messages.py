"""Layouts of the messages between blocks: the index of each field, used as `fix[FIX.phi]`.

A message begins with the tick of its sample, which is -1 before the first sample. The length of a layout, `len(FIX)`,
is the size of the message. Numba compiles the field names to constants.
"""

from collections import namedtuple


def layout(name: str, fields: str):
    """Return a named tuple that maps each of `fields` (names separated by blanks) to its index in the message."""
    names = fields.split()
    return namedtuple(name, names)(*range(len(names)))


TICK = 0  # the index of the tick in every message

#: A robot's pose as measured by the room: tick of capture, seen (1 or 0), x, y [m], phi [rad] in W. If the robot is not
#: seen, x, y and phi are zero.
FIX = layout("Fix", "tick seen x y phi")

#: The pose estimated by odometry or an estimator: x, y [m], phi [rad] in W.
ESTIMATE = layout("Estimate", "tick x y phi")

#: Odometry along the robot's own path: arc length s [m], heading phi [rad] in W.
PATH = layout("Path", "tick s phi")

#: The desired motion: x, y [m], phi [rad], their rates [m/s, rad/s] and accelerations [m/s^2, rad/s^2] in W.
WAY_POINT = layout("WayPoint", "tick x y phi vx vy wz ax ay yaw_acceleration")

#: The tracking error as measured by the room, (6.28): tick of capture of the fix, tick of the way point, error s_e [m]
#: along the robot's heading, bearing error phi_h [rad], speed to feed forward [m/s].
TRACKING_ERROR = layout("TrackingError", "tick way_point_tick s_e phi_h speed")

#: Specific force [m/s^2] and angular rate [rad/s] in the axes of the tilting body.
IMU = layout("Imu", "tick ax ay az wx wy wz")

#: The estimated tilt of the body: angle [rad], forward positive, its rate [rad/s], the gyro's bias [rad/s].
TILT = layout("Tilt", "tick angle rate bias")

#: The state that the servo of section 3.4 feeds back: s [m], theta [rad] and their rates [m/s, rad/s].
STATE = layout("State", "tick s theta s_dot theta_dot")

#: Wheel angles theta (n) [rad] relative to the body, then wheel speeds omega (n) [rad/s]. The speeds begin at
#: `ENCODER.theta + n`, where n is the robot's number of wheels. The size of the message is `encoder_size(n)`.
ENCODER = layout("Encoder", "tick theta")

#: The encoder message of a right and a left wheel.
WHEEL_PAIR = layout("WheelPair", "tick theta_r theta_l omega_r omega_l")

# The layouts below are not messages, because they have no tick: signals within a tick, and true values.

#: A true pose: x, y [m], phi [rad] in W.
POSE = layout("Pose", "x y phi")

#: The tracking error at the present tick: s_e [m], phi_h [rad], speed to feed forward [m/s].
ERROR = layout("Error", "s_e phi_h speed")


def encoder_size(wheels: int) -> int:
    """Return the size of the encoder message of a robot with `wheels` wheels."""
    return ENCODER.theta + 2 * wheels


def wheels_in(size: int) -> int:
    """Return the number of wheels of the robot whose encoder message has `size` entries."""
    return (size - ENCODER.theta) // 2
