"""Where each number lies in the messages between blocks: `fix[FIX.phi]`, in kernels as in plain Python.

A message begins with the tick of its sample, -1 before the first; `len(FIX)` is its size. Numba compiles the names to
constants.
"""

from collections import namedtuple


def layout(name: str, fields: str):
    """A named tuple that holds, under each of `fields` (names with blanks between), the index of that field."""
    names = fields.split()
    return namedtuple(name, names)(*range(len(names)))


TICK = 0  # in every message

#: A robot as the room sees it: tick of capture, seen (1 or 0), x, y [m], phi [rad] in W; zeros where it is not seen.
FIX = layout("Fix", "tick seen x y phi")

#: The pose that odometry or an estimator believes: x, y [m], phi [rad] in W.
ESTIMATE = layout("Estimate", "tick x y phi")

#: Odometry along the robot's own path: arc length s [m], heading phi [rad].
PATH = layout("Path", "tick s phi")

#: Where the robot shall be: x, y [m], phi [rad], their rates [m/s, rad/s] and accelerations [m/s^2, rad/s^2] in W.
WAY_POINT = layout("WayPoint", "tick x y phi vx vy wz ax ay yaw_acceleration")

#: The error to the way point as the room sees it, (6.28): tick of the fix it refers to, tick of the way point, s_e [m]
#: along the robot's heading, bearing phi_h [rad], speed to feed forward [m/s].
TRACKING_ERROR = layout("TrackingError", "tick way_point_tick s_e phi_h speed")

#: Specific force [m/s^2] and angular rate [rad/s] in the body's axes.
IMU = layout("Imu", "tick ax ay az wx wy wz")

#: The filtered tilt of the body: angle [rad], forward positive, its rate [rad/s], the gyro's bias [rad/s].
TILT = layout("Tilt", "tick angle rate bias")

#: What the servo of section 3.4 feeds back: s [m], theta [rad] and their rates [m/s, rad/s].
STATE = layout("State", "tick s theta s_dot theta_dot")

#: Wheel angles theta (n) [rad] relative to the body, then wheel speeds omega (n) [rad/s], which begin at
#: `ENCODER.theta + n`; n is the robot's, so is the size: `encoder_size(n)`.
ENCODER = layout("Encoder", "tick theta")

#: The encoder message of a right and a left wheel.
WHEEL_PAIR = layout("WheelPair", "tick theta_r theta_l omega_r omega_l")

# Not messages, for they have no tick: what blocks within a tick, or the truth, are made of.

#: x, y [m], phi [rad] in W.
POSE = layout("Pose", "x y phi")

#: The error within a tick: s_e [m], phi_h [rad], speed to feed forward [m/s].
ERROR = layout("Error", "s_e phi_h speed")


def encoder_size(wheels: int) -> int:
    """The size of an encoder message of a robot with that many wheels."""
    return ENCODER.theta + 2 * wheels


def wheels_in(size: int) -> int:
    """How many wheels an encoder message of that size is of."""
    return (size - ENCODER.theta) // 2
