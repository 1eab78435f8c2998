"""Velocity-controlled robot, like most commercial ones: any wheels, ideal velocity tracking, slip.

The drive turns the wheels according to the *nominal* geometry, theta_dot = G v. The robot moves according to its
*actual* wheels, v' = J' theta_dot. Here G is the inverse kinematics of the nominal wheels and J' the forward kinematics
of the actual ones. Without errors of radius or track v' = v, except along the direction that plain tyres hold. A worn
wheel therefore shows between encoder and camera, not between command and encoder.
"""

from dataclasses import dataclass, field

import numpy as np

from drake_ispace.blocks.block import Block, Output, Spec
from drake_ispace.blocks.errors import InputError
from drake_ispace.blocks.functions import cos, sin
from drake_ispace.blocks.kernels import copy, kernel
from drake_ispace.files.quantity import quantity
from drake_ispace.plants.slip import Slip, pose_rates, slip_parameters
from drake_ispace.plants.wheels import Wheel, WheelGeometry, differential, mecanum, rescaled, ring, toed

WHEELS = {"omni3": 3, "omni4": 4, "differential": 2, "mecanum": 4, "listed": None}  # kind -> number


@dataclass
class RoverPlantParameters:
    """Wheels and slip of a velocity-controlled robot. All sizes are assumed."""

    # omni3, omni4: rings of omni wheels; differential: right, left; mecanum: front left, right, rear left, right;
    # listed: as in wheel_list, which a robot file gives
    wheels: str = quantity("omni3", choices=tuple(WHEELS))
    radius_m: float = quantity(0.05, "m", above=0.0, maximum=5.0)
    # of the rings: distance from wheel to centre, and the direction of wheel 1
    centre_distance_m: float = quantity(0.18, "m", above=0.0, maximum=20.0)
    first_rad: float = quantity(np.pi / 3.0, "rad")
    # of the differential drive
    half_track_m: float = quantity(0.15, "m", above=0.0, maximum=20.0)
    # of the mecanum robot: half the distance between the axles, and half that between left and right wheels
    half_length_m: float = quantity(0.15, "m", above=0.0, maximum=20.0)
    half_width_m: float = quantity(0.15, "m", above=0.0, maximum=20.0)
    # of listed wheels: x, y [m] in B, drive direction [rad], radius [m], roller angle [rad], 1 for a tyre that cannot
    # move sideways; and their names, by which columns of recordings are found
    wheel_list: list[list[float]] = quantity([])
    wheel_names: list[str] = quantity([])
    # deviation of each wheel's radius from the nominal one that drive and odometry use, as a share; null: none
    wheel_radius_shares: list[float] | None = quantity(None, above=-1.0)
    # deviation of each omni or mecanum wheel's drive direction from the nominal one, anticlockwise; null: none
    wheel_toe_rad: list[float] | None = quantity(None, "rad", minimum=-0.5, maximum=0.5)
    # deviation of all distances of the wheels from the nominal ones, as a share
    track_share: float = quantity(0.0, above=-1.0)
    slip: Slip = field(default_factory=Slip)

    @property
    def nominal_geometry(self) -> WheelGeometry:
        """The nominal wheels, which drive and odometry use."""
        return _built(self, 1.0)

    @property
    def geometry(self) -> WheelGeometry:
        """The robot's actual wheels."""
        built = _built(self, 1.0 + self.track_share)
        none = [0.0] * len(built.wheels)
        return toed(rescaled(built, self.wheel_radius_shares or none), self.wheel_toe_rad or none)


def _built(p, scale):
    if p.wheels == "listed":
        return WheelGeometry(tuple(
            Wheel(scale * x, scale * y, drive, radius, roller, bool(holds))
            for x, y, drive, radius, roller, holds in p.wheel_list
        ))
    if p.wheels == "differential":
        return differential(p.radius_m, scale * p.half_track_m)
    if p.wheels == "mecanum":
        return mecanum(p.radius_m, scale * p.half_length_m, scale * p.half_width_m)
    return ring(WHEELS[p.wheels], p.radius_m, scale * p.centre_distance_m, p.first_rad)


X, Y, PHI, THETA = 0, 1, 2, 3  # continuous state


@kernel
def derivatives(xc, velocity, wheels, projection, slip, out):
    """Write d/dt of [x, y, phi, theta_1..n]. projection: J' G (3, 3), row by row; wheels: G (n, 3), row by row."""
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
    """Write the wheel-consistent velocity in W: R(phi) J' G v; projection: J' G (3, 3), row by row."""
    vx = projection[0] * velocity[0] + projection[1] * velocity[1] + projection[2] * velocity[2]
    vy = projection[3] * velocity[0] + projection[4] * velocity[1] + projection[5] * velocity[2]
    c, s = cos(xc[PHI]), sin(xc[PHI])
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
    """Kinematics of a robot whose wheels follow the commanded body velocity at once.

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
    (3,), output: wheel-consistent v_WB [m/s, m/s, rad/s] in W, which without slip is the rate of the pose. wheel_angle,
    wheel_rate (n,): theta [rad], theta_dot [rad/s]. The nominal wheels give theta_dot = G v, the actual wheels
    v' = J' theta_dot, and slip acts by (6.4). A commanded velocity across plain tyres moves neither wheels nor robot.

    Args:
        parameters: wheels and slip.
        initial_pose: x, y [m], phi [rad] in W at t = 0.
        where: path of the parameters in the scenario, for messages.

    Raises:
        InputError: the number of radius shares or toe angles is not that of the wheels, tyres that hold sideways have
            toe angles, a slip ratio in the body frame is 1 or more, or there is traction slip or slip noise, which this
            plant does not model.
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
    """Return the parameters of RoverPlant that follow from wheels and slip.

    Raises:
        InputError: as RoverPlant.
    """
    check(parameters, where)
    nominal, actual = parameters.nominal_geometry, parameters.geometry
    lever_m = float(np.mean([np.hypot(w.x_m, w.y_m) for w in actual.wheels]))
    return {
        "wheels": nominal.inverse.ravel(), "projection": (actual.forward @ nominal.inverse).ravel(),
        "slip": slip_parameters(parameters.slip, lever_m, f"{where}.slip"),
    }


def check(parameters: RoverPlantParameters, where: str) -> None:
    """Check the settings that depend on each other or are not modelled for this robot.

    Raises:
        InputError: the number of radius shares or toe angles is not that of the wheels, tyres that hold sideways have
            toe angles, or there is traction slip or slip noise; the message begins with `where`, the path of the
            parameters in the scenario.
    """
    n = WHEELS[parameters.wheels] or len(parameters.wheel_list)
    if parameters.wheels == "listed":
        _check_list(parameters, where)
    for key in ("wheel_radius_shares", "wheel_toe_rad"):
        values = getattr(parameters, key)
        if values is not None and len(values) != n:
            raise InputError(f"{where}.{key}: expected {n} values for {parameters.wheels} or null, got {values}")
    if any(parameters.wheel_toe_rad or ()) and len(parameters.nominal_geometry.sideways):
        raise InputError(
            f"{where}.wheel_toe_rad: expected null, the tyres of {parameters.wheels} wheels cannot move sideways"
        )
    slip = parameters.slip
    for key, value in (("traction_gain", slip.traction_gain), ("noise_std", slip.noise_std)):
        if any(value):
            raise InputError(f"{where}.slip.{key}: expected zeros, this robot supports slip by ratio and patch only")


def _check_list(parameters, where):
    for i, wheel in enumerate(parameters.wheel_list):
        if len(wheel) != 6:
            raise InputError(
                f"{where}.wheel_list[{i}]: expected x, y, drive direction, radius, roller angle and 1 or 0, got {wheel}"
            )
    try:
        _built(parameters, 1.0)
    except ValueError as error:
        raise InputError(f"{where}.wheel_list: {error}") from None
    names = parameters.wheel_names
    if names and (len(names) != len(parameters.wheel_list) or len(set(names)) < len(names)):
        raise InputError(f"{where}.wheel_names: expected a name of its own for each wheel, got {names}")
