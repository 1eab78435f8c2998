"""A robot that takes a body-velocity command, as most bought ones do: any wheels, ideal tracking, slip.

Its drive turns the wheels as the geometry it was *told* says, theta_dot = G v, and the robot moves as the wheels that
it *has* make it, v' = J' theta_dot (wheels.py). Without errors of radius or track both agree, and v' = v but for the
direction that plain tyres hold. So a worn wheel shows between encoder and camera, not between command and encoder.
"""

from dataclasses import dataclass, field

import numpy as np

from drake_ispace.blocks.block import Block, Output, Spec
from drake_ispace.blocks.errors import InputError
from drake_ispace.blocks.kernels import copy, kernel
from drake_ispace.files.quantity import quantity
from drake_ispace.plants.slip import Slip, pose_rates, slip_parameters
from drake_ispace.plants.wheels import WheelGeometry, differential, mecanum, rescaled, ring

WHEELS = {"omni3": 3, "omni4": 4, "differential": 2, "mecanum": 4}


@dataclass
class RoverPlantParameters:
    """Wheels and slip of a velocity-controlled robot; sizes assumed."""

    # omni3, omni4: rings of omni wheels; differential: right, left; mecanum: front left, right, rear left, right
    wheels: str = quantity("omni3", choices=tuple(WHEELS))
    radius_m: float = quantity(0.05, "m", above=0.0)
    # of the rings: wheel to centre, and the direction of wheel 1
    centre_distance_m: float = quantity(0.18, "m", above=0.0)
    first_rad: float = quantity(np.pi / 3.0, "rad")
    # of the differential drive
    half_track_m: float = quantity(0.15, "m", above=0.0)
    # of the mecanum robot: half the distance between axles, and between left and right wheels
    half_length_m: float = quantity(0.15, "m", above=0.0)
    half_width_m: float = quantity(0.15, "m", above=0.0)
    # by how much each wheel's radius is larger than the drive and odometry believe; null: as believed
    wheel_radius_shares: list[float] | None = quantity(None, above=-1.0)
    # the same for the distances of the wheels
    track_share: float = quantity(0.0, above=-1.0)
    slip: Slip = field(default_factory=Slip)

    @property
    def nominal_geometry(self) -> WheelGeometry:
        """The wheels that drive and odometry believe in."""
        return _built(self, 1.0)

    @property
    def geometry(self) -> WheelGeometry:
        """The wheels that the robot has."""
        built = _built(self, 1.0 + self.track_share)
        return built if self.wheel_radius_shares is None else rescaled(built, self.wheel_radius_shares)


def _built(p, scale):
    if p.wheels == "differential":
        return differential(p.radius_m, scale * p.half_track_m)
    if p.wheels == "mecanum":
        return mecanum(p.radius_m, scale * p.half_length_m, scale * p.half_width_m)
    return ring(WHEELS[p.wheels], p.radius_m, scale * p.centre_distance_m, p.first_rad)


X, Y, PHI, THETA = 0, 1, 2, 3  # continuous state


@kernel
def derivatives(xc, velocity, wheels, projection, slip, out):
    """d/dt of [x, y, phi, theta_1..n]; projection: J' G (3, 3), row by row."""
    for i in range(xc.shape[0] - THETA):
        out[THETA + i] = wheels[3 * i] * velocity[0] + wheels[3 * i + 1] * velocity[1] + wheels[3 * i + 2] * velocity[2]
    vx = projection[0] * velocity[0] + projection[1] * velocity[1] + projection[2] * velocity[2]
    vy = projection[3] * velocity[0] + projection[4] * velocity[1] + projection[5] * velocity[2]
    wz = projection[6] * velocity[0] + projection[7] * velocity[1] + projection[8] * velocity[2]
    none = (0.0 * vx, 0.0 * vx, 0.0 * vx)
    pose_rates(vx, vy, wz, (xc[X], xc[Y], xc[PHI]), none, none, slip, out)


@kernel
def pose(xc, out):
    copy(xc[: PHI + 1], out)


@kernel
def world_velocity(xc, velocity, projection, out):
    vx = projection[0] * velocity[0] + projection[1] * velocity[1] + projection[2] * velocity[2]
    vy = projection[3] * velocity[0] + projection[4] * velocity[1] + projection[5] * velocity[2]
    c, s = np.cos(xc[PHI]), np.sin(xc[PHI])
    out[0] = c * vx - s * vy
    out[1] = s * vx + c * vy
    out[2] = projection[6] * velocity[0] + projection[7] * velocity[1] + projection[8] * velocity[2]


@kernel
def wheel_angle(xc, out):
    copy(xc[THETA:], out)


@kernel
def wheel_rate(velocity, wheels, out):
    for i in range(out.shape[0]):
        out[i] = wheels[3 * i] * velocity[0] + wheels[3 * i + 1] * velocity[1] + wheels[3 * i + 2] * velocity[2]


class RoverPlant(Block):
    """A robot whose body follows the commanded velocity at once.

    .. pydrake_system::

        name: RoverPlant
        input_ports:
        - velocity
        output_ports:
        - pose
        - velocity
        - wheel_angle
        - wheel_rate

    velocity (3,), input: command vx, vy [m/s], wz [rad/s] in B. pose (3,): x, y [m], phi [rad] of B in W. velocity
    (3,), output: wheel-consistent v_WB [m/s, m/s, rad/s] in W; without slip the rate of the pose. wheel_angle,
    wheel_rate (n,): theta [rad], theta_dot [rad/s]. theta_dot = G v, then v' = J' theta_dot with slip (6.4); what a
    plain tyre holds sideways is left out of both.

    Args:
        parameters: wheels and slip.
        initial_pose: x, y [m], phi [rad] at t = 0.
        where: the scenario's name of the section, for messages.

    Raises:
        InputError: a radius share too few or too many; slip that follows from forces or is random, which this has not.
    """

    def __init__(self, parameters: RoverPlantParameters, initial_pose=(0.0, 0.0, 0.0), where="plant"):
        values = block_parameters(parameters, where)
        n = len(parameters.geometry.wheels)
        start = np.zeros(THETA + n)
        start[:3] = initial_pose
        super().__init__(Spec(
            inputs={"velocity": 3},
            outputs={
                "pose": Output(3, pose), "velocity": Output(3, world_velocity), "wheel_angle": Output(n, wheel_angle),
                "wheel_rate": Output(n, wheel_rate),
            },
            parameters=values, continuous_state=start, derivatives=derivatives,
        ))


def block_parameters(parameters: RoverPlantParameters, where: str = "plant") -> dict:
    """The block's parameters that follow from wheels and slip.

    Raises:
        InputError: as RoverPlant.
    """
    check(parameters, where)
    told, real = parameters.nominal_geometry, parameters.geometry
    lever_m = float(np.mean([np.hypot(w.x_m, w.y_m) for w in real.wheels]))
    return {
        "wheels": told.inverse.ravel(), "projection": (real.forward @ told.inverse).ravel(),
        "slip": slip_parameters(parameters.slip, lever_m, f"{where}.slip"),
    }


def check(parameters: RoverPlantParameters, where: str) -> None:
    """Raise InputError for values of which each alone is allowed; `where` names the section."""
    shares, n = parameters.wheel_radius_shares, WHEELS[parameters.wheels]
    if shares is not None and len(shares) != n:
        raise InputError(
            f"{where}.wheel_radius_shares: expected {n} values for {parameters.wheels} or null, got {shares}"
        )
    slip = parameters.slip
    for key, value in (("traction_gain", slip.traction_gain), ("noise_std", slip.noise_std)):
        if any(value):
            raise InputError(f"{where}.slip.{key}: expected zeros, this robot has slip by ratio and patch only")
