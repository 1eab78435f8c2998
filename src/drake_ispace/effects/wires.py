"""Effects that are a block in a wire, a base class for each wire from command to camera.

A subclass has a `card`, `parameters`, and the kernel `output`, whose last argument is the wire's signal with the effect
in it and whose other arguments are ports and parameters of the block.
"""

from collections.abc import Callable

from drake_ispace.effects.effect import BlockEffect
from drake_ispace.robots.robot import BALANCING, PLANAR


class VelocityEffect(BlockEffect):
    """Between a commanded velocity of the body and the one that the robot follows: vx, vy [m/s], wz [rad/s]."""

    wire = "velocity"


class TorqueEffect(BlockEffect):
    """Between commanded torque and wheel: a torque per wheel [N m]."""

    wire = "torque"
    general = True


class GroundEffect(BlockEffect):
    """Between floor and robot: three forces along the coordinates of `Robot.ground`.

    `planar`, `balancing`: the kernels in the place of `output` for either kind of coordinates.
    """

    wire = "ground_force"
    planar: Callable
    balancing: Callable

    def output_of(self, body):
        return {PLANAR: type(self).planar, BALANCING: type(self).balancing}[body.robot.ground]


class WheelAngleEffect(BlockEffect):
    """Between wheel and encoder: an angle per wheel [rad].

    Attributes:
        scales: whether it does nothing but multiply every angle, by the block's parameter `gain` (wheels,).
    """

    wire = "wheel_angle"
    general = True
    kinematic = True
    scales = False


class BodyMotionEffect(BlockEffect):
    """Between body and IMU: specific force [m/s^2] and angular rate [rad/s] along x, y and z of the body."""

    wire = "body_motion"


class PoseEffect(BlockEffect):
    """Between robot and camera: x, y [m] and phi [rad] of the robot in W."""

    wire = "pose"
    kinematic = True


class FixEffect(BlockEffect):
    """Between room and robot: the message of the localiser."""

    wire = "fix"
    kinematic = True
