"""From the floor on the robot: slip, and forces in the wire `ground_force`.

The port holds (F_x, F_y, M) in the axes of the body, or (Q_s, Q_phi, Q_theta) of a robot that balances. Forces follow
the wheel-consistent velocity that the plant puts out.

Signs are smooth, tanh(v / v_s). The slope C / v_s takes at most a fifth of what the 5 ms Runge-Kutta step can bear, so
that room is left for the friction of the wheels, and v_s is at least what the robot moves at while its wheels turn at
0.05 rad/s.
"""

import dataclasses

import numpy as np

from drake_ispace.blocks.errors import InputError
from drake_ispace.blocks.functions import cos, sin, tanh
from drake_ispace.blocks.kernels import copy, kernel
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.effects.card import Card, Parameter
from drake_ispace.effects.effect import PlantEffect
from drake_ispace.effects.places.smooth import LEAST_SPEED_RAD_S, dry
from drake_ispace.effects.wires import GroundEffect
from drake_ispace.plants.slip import GRAVITY

_SLOPE_SHARE = 0.5  # slope times step times mobility; Runge-Kutta 3 bears 2.51, wheel friction may take 2 of it
_EDGES = ("x_min_m", "x_max_m", "y_min_m", "y_max_m")
_AXIS = {"": 0, "_x": 0, "_y": 1}


def ground_scale(body, axis: int, force: float) -> float:
    """v_s [m/s, m/s, rad/s] of a `force` [N, N, N m] along `axis` of the port that turns its sign with the velocity."""
    ways = np.abs(body.robot.effort(body.plant)).max(axis=1)
    mobility = float(np.linalg.inv(body.robot.mass_matrix(body.plant))[axis, axis])
    return max(LEAST_SPEED_RAD_S / float(ways[axis]), force * TICK_S * mobility / _SLOPE_SHARE)


def _axes(body):
    """Endings of the names of slip along x, and along y where the wheels let the robot move that way."""
    return ("",) if body.plant.geometry.holds_sideways else ("_x", "_y")


def _slip_with(plant, name, key, values):
    """The plant's slip with `values` (ratio, ratio_x, ...) added to its list `key`."""
    _check_frame(plant, name)
    numbers = list(getattr(plant.slip, key))
    stem = key.rpartition("_")[2]
    for axis, index in _AXIS.items():
        numbers[index] = numbers[index] + values.get(stem + axis, 0.0)
    if max(numbers) >= 1.0:
        raise InputError(f"{name}: makes slip.{key} {max(numbers):g}, expected less than 1")
    return dataclasses.replace(plant, slip=dataclasses.replace(plant.slip, **{key: numbers}))


def _check_frame(plant, name):
    if plant.slip.frame != "body":
        raise InputError(f"{name}: slip.frame is {plant.slip.frame}, expected body, along whose axes this effect acts")


class ConstantSlip(PlantEffect):
    """v = (1 - ratio) v_wheels along an axis of the body, added to the plant's `slip.ratio` (not to its patch).

    Raises:
        InputError: slip on the world's axes, or of 1 and more in all.
    """

    needs = ("slip",)
    kinematic = True
    card = Card(
        name="constant_slip", title="Constant slip", home="ground", equation="v = (1 - ratio) v_wheels, per body axis",
        source="(6.4), carpet under the rollers",
        signature="the camera's displacement falls short of odometry's by a fixed share, at every speed and load; the "
        "heading does not",
        look_alikes=("wheel_radius_error", "encoder_scale", "camera_scale", "wheel_slip"),
        excitation="turning: a wrong radius or encoder scales the angle turned as well, slip along x and y does not; "
        "motion along y tells the omni robot's two ratios apart and both from the camera's scale, which is one for all",
    )

    def parameters_of(self, body):
        names = [f"ratio{axis}" for axis in _axes(body)]
        return tuple(
            Parameter(name, "1", 0.0, -0.5, 0.5, (0.03, 0.1), tolerance=1e-3, sensible=(-0.01, 0.2)) for name in names
        )

    def change(self, robot, plant, values):
        return _slip_with(plant, self.name, "ratio", values)


class CorneringSlip(PlantEffect):
    """v = v_wheels - time (wz x v_wheels): in a bend the robot slides outwards; added to `slip.cornering_s`.

    Raises:
        InputError: slip on the world's axes.
    """

    needs = ("slip",)
    kinematic = True
    card = Card(
        name="cornering_slip", title="Sideways slip in bends", home="ground",
        equation="v = v_wheels - time_s (wz x v_wheels)", source="tyres and rollers that creep under a sideways force",
        signature="the camera sees the robot slide outwards in bends, in proportion to speed times turning rate, and "
        "not at all on a straight line or on the spot; the heading is right",
        look_alikes=("marker_offset", "camera_latency", "clock_offset", "constant_slip"),
        excitation="bends at several speeds, both ways, ahead and back: what a marker aside seems to slide goes with "
        "the turning rate alone; a late camera errs along the path, this across it",
    )
    parameters = (
        Parameter("time_s", "s", 0.0, -0.5, 0.5, (0.01, 0.05), tolerance=2e-3, sensible=(-0.01, 0.5)),
    )

    def change(self, robot, plant, values):
        _check_frame(plant, self.name)
        slip = dataclasses.replace(plant.slip, cornering_s=plant.slip.cornering_s + values["time_s"])
        return dataclasses.replace(plant, slip=slip)


class WheelSlip(PlantEffect):
    """s = gain F / (mu m g): the robot lags while driven, slides on while braked; added to `slip.traction_gain`.

    Raises:
        InputError: slip on the world's axes, or a gain of 1 and more in all.
    """

    needs = ("traction",)
    card = Card(
        name="wheel_slip", title="Slip under traction", home="ground",
        equation="v = v_wheels - s |v_wheels|, s = gain F / (mu m g), |s| <= gain",
        source="traction-dependent reading of (6.4)",
        signature="odometry runs ahead of the camera while accelerating and falls behind while braking; the two nearly "
        "cancel over a start and a stop",
        look_alikes=("constant_slip", "camera_latency", "clock_offset"),
        excitation="hard acceleration and braking at speed: a clock error goes with speed, this with force times speed",
    )

    def parameters_of(self, body):
        return tuple(Parameter(f"gain{axis}", "1", 0.0, 0.0, 0.999, (0.1, 0.4), tolerance=0.02) for axis in _axes(body))

    def change(self, robot, plant, values):
        return _slip_with(plant, self.name, "traction_gain", values)


@kernel
def scrubbed_planar(ground_force, velocity, moment_n_m, scale_rad_s, out):
    out[0], out[1] = ground_force[0], ground_force[1]
    out[2] = ground_force[2] - dry(moment_n_m, velocity[2], scale_rad_s)


@kernel
def scrubbed_balancing(ground_force, balance, moment_n_m, scale_rad_s, out):
    out[0], out[2] = ground_force[0], ground_force[2]
    out[1] = ground_force[1] - dry(moment_n_m, balance[2], scale_rad_s)


class TurnScrub(GroundEffect):
    """M_z = -M sign(wz): the contact patches are twisted on the spot."""

    card = Card(
        name="turn_scrub", title="Scrub while turning", home="ground", equation="M_z = -M tanh(wz / w_s)",
        source="width of the tyres, rollers on carpet",
        signature="an unmodelled yaw moment of constant size against the turning, none while driving straight",
        look_alikes=("coulomb_friction", "inertia_error", "yaw_inertia_error", "weak_motor"),
        excitation="turning on the spot both ways at several speeds, and straight driving: wheel friction brakes both",
    )
    parameters = (Parameter("moment_n_m", "N*m", 0.0, 0.0, 2.0, (0.01, 0.1), tolerance=1e-3),)
    planar, balancing = scrubbed_planar, scrubbed_balancing

    def block_parameters(self, body, values):
        moment = values["moment_n_m"]
        return {"moment_n_m": moment, "scale_rad_s": ground_scale(body, body.robot.ground.turn, moment)}


@kernel
def resisted_planar(ground_force, pose, velocity, force_n, scale_m_s, out):
    copy(ground_force, out)
    if force_n == 0.0:
        return
    c, s = cos(pose[2]), sin(pose[2])
    speed = np.sqrt(velocity[0] * velocity[0] + velocity[1] * velocity[1] + 1e-18)
    brake = dry(force_n, speed, scale_m_s) / speed
    out[0] = ground_force[0] - brake * (c * velocity[0] + s * velocity[1])
    out[1] = ground_force[1] - brake * (-s * velocity[0] + c * velocity[1])


@kernel
def resisted_balancing(ground_force, balance, force_n, scale_m_s, out):
    out[0] = ground_force[0] - dry(force_n, balance[1], scale_m_s)
    out[1], out[2] = ground_force[1], ground_force[2]


class SoftFloor(GroundEffect):
    """F = -F_roll v/|v| on the robot's middle; of the pendulum on Q_s alone."""

    card = Card(
        name="soft_floor", title="Rolling resistance of a soft floor", home="ground",
        equation="F = -F_roll tanh(|v| / v_s) v/|v|", source="Fig. 6.3, carpet",
        signature="an unmodelled force of constant size against the motion, the same in every direction, no yaw moment",
        look_alikes=("coulomb_friction", "viscous_friction", "load_dependent_friction", "floor_tilt"),
        excitation="turning on the spot, where it is absent and friction of the wheels is not; the omni robot also on "
        "the diagonal, where its wheels' friction adds up otherwise; the pendulum's tilt, since friction of the wheels "
        "turns its body too",
    )
    parameters = (Parameter("force_n", "N", 0.0, 0.0, 20.0, (0.2, 1.5), tolerance=0.02),)
    planar, balancing = resisted_planar, resisted_balancing

    def block_parameters(self, body, values):
        return {"force_n": values["force_n"], "scale_m_s": ground_scale(body, 0, values["force_n"])}


@kernel
def inside(pose, edges_m, edge_m):
    """1 within a rectangle of the floor, 0 outside of it, and between them within `edge_m` of its edges.

    edges_m: x_min, x_max, y_min, y_max in W.
    """
    x = tanh((pose[0] - edges_m[0]) / edge_m) + tanh((edges_m[1] - pose[0]) / edge_m)
    y = tanh((pose[1] - edges_m[2]) / edge_m) + tanh((edges_m[3] - pose[1]) / edge_m)
    return 0.25 * max(x, 0.0) * max(y, 0.0)


@kernel
def resisted_on_patch_planar(ground_force, pose, velocity, force_n, edges_m, edge_m, scale_m_s, out):
    here = force_n * inside(pose, edges_m, edge_m) if force_n != 0.0 else 0.0
    resisted_planar(ground_force, pose, velocity, here, scale_m_s, out)


@kernel
def resisted_on_patch_balancing(ground_force, pose, balance, force_n, edges_m, edge_m, scale_m_s, out):
    here = force_n * inside(pose, edges_m, edge_m) if force_n != 0.0 else 0.0
    resisted_balancing(ground_force, balance, here, scale_m_s, out)


class SoftPatch(GroundEffect):
    """F = -F_roll v/|v| on the robot's middle while it is on a rectangle of the floor; of the pendulum on Q_s alone.

    Along the edges the force grows over twice `edge_m`, as one wheel after the other gets onto the patch.
    """

    is_local = True
    card = Card(
        name="soft_patch", title="Patch of a softer floor", home="ground",
        equation="F = -F_roll tanh(|v| / v_s) v/|v| for x_min < x < x_max, y_min < y < y_max",
        source="Fig. 6.3, carpet",
        signature="an unmodelled force of constant size against the motion in one part of the room, none elsewhere",
        look_alikes=("soft_floor", "floor_tilt", "coulomb_friction"),
        excitation="the same motion in several parts of the room, and each part several times: what wears off with "
        "time is gone when the robot comes back",
    )

    def parameters_of(self, body):
        half = [0.5 * size for size in body.room_m]
        edges = [
            Parameter(name, "m", side * half[axis], -half[axis], half[axis], (-0.1 * side,), shape=True)
            for name, side, axis in zip(_EDGES, (-1.0, 1.0, -1.0, 1.0), (0, 0, 1, 1), strict=True)
        ]
        softness = Parameter("edge_m", "m", 0.05, 0.005, 0.5, shape=True)
        return (Parameter("force_n", "N", 0.0, 0.0, 20.0, (0.2, 1.5)), *edges, softness)

    def starts(self, body):
        """Each ninth of the room, and each four of them around an inner corner."""
        x, y = (np.linspace(-0.5 * size, 0.5 * size, 4).tolist() for size in body.room_m)
        return tuple(
            dict(zip(_EDGES, (x[i], x[i + n], y[j], y[j + n]), strict=True))
            for n in (1, 2) for i in range(4 - n) for j in range(4 - n)
        )

    planar, balancing = resisted_on_patch_planar, resisted_on_patch_balancing

    def block_parameters(self, body, values):
        force, edges = values["force_n"], np.array([values[name] for name in _EDGES])
        scale = ground_scale(body, 0, force)
        return {"force_n": force, "edges_m": edges, "edge_m": values["edge_m"], "scale_m_s": scale}


@kernel
def dragged_planar(ground_force, pose, velocity, coefficient_n_s2_m2, out):
    copy(ground_force, out)
    if coefficient_n_s2_m2 == 0.0:
        return
    c, s = cos(pose[2]), sin(pose[2])
    brake = coefficient_n_s2_m2 * np.sqrt(velocity[0] * velocity[0] + velocity[1] * velocity[1])
    out[0] = ground_force[0] - brake * (c * velocity[0] + s * velocity[1])
    out[1] = ground_force[1] - brake * (-s * velocity[0] + c * velocity[1])


@kernel
def dragged_balancing(ground_force, balance, coefficient_n_s2_m2, out):
    out[0] = ground_force[0] - coefficient_n_s2_m2 * abs(balance[1]) * balance[1]
    out[1], out[2] = ground_force[1], ground_force[2]


class QuadraticDrag(GroundEffect):
    """F = -k |v| v on the robot's middle; of the pendulum on Q_s alone."""

    card = Card(
        name="quadratic_drag", title="Drag with the square of speed", home="ground", equation="F = -k |v| v",
        source="grass, long pile, water or air in the way of the body",
        signature="an unmodelled force against the motion that grows with the square of the speed, no yaw moment",
        look_alikes=("wheel_drag", "viscous_friction", "soft_floor"),
        excitation="slow and fast runs, and turning on the spot, where it is absent and drag of the wheels is not",
    )
    parameters = (Parameter("coefficient_n_s2_m2", "N*s^2/m^2", 0.0, 0.0, 500.0, (1.0, 10.0)),)
    planar, balancing = dragged_planar, dragged_balancing


@kernel
def tilted_planar(ground_force, pose, downhill_m_s2, mass_kg, centre_of_gravity_m, out):
    copy(ground_force, out)
    if downhill_m_s2[0] == 0.0 and downhill_m_s2[1] == 0.0:
        return
    c, s = cos(pose[2]), sin(pose[2])
    fx = mass_kg * (c * downhill_m_s2[0] + s * downhill_m_s2[1])
    fy = mass_kg * (-s * downhill_m_s2[0] + c * downhill_m_s2[1])
    out[0], out[1] = ground_force[0] + fx, ground_force[1] + fy
    out[2] = ground_force[2] + centre_of_gravity_m[0] * fy - centre_of_gravity_m[1] * fx


@kernel
def tilted_balancing(ground_force, pose, balance, downhill_m_s2, mass_kg, lifted_kg_m, out):
    """Minus the gradient of g (m_total slope.p + m_b z sin(theta) slope.(cos phi, sin phi)) along s, phi, theta."""
    copy(ground_force, out)
    if downhill_m_s2[0] == 0.0 and downhill_m_s2[1] == 0.0:
        return
    c, s = cos(pose[2]), sin(pose[2])
    along = c * downhill_m_s2[0] + s * downhill_m_s2[1]
    across = -s * downhill_m_s2[0] + c * downhill_m_s2[1]
    out[0] = ground_force[0] + mass_kg * along
    out[1] = ground_force[1] + lifted_kg_m * sin(balance[0]) * across
    out[2] = ground_force[2] + lifted_kg_m * cos(balance[0]) * along


class FloorTilt(GroundEffect, PlantEffect):
    """Gravity along a floor that rises by slope_x, slope_y along x, y of W, to first order, by the nominal masses.

    Q_s = -m_total g a, Q_theta = -m_b g z a cos(theta), Q_phi = -m_b g z a' sin(theta) with the slopes a along and a'
    to the left of the heading. The tilt is relative to the floor's normal; the IMU feels gravity as it is: +g a, +g a'.
    """

    card = Card(
        name="floor_tilt", title="Tilted floor", home="ground", equation="F_W = -m g (slope_x, slope_y)",
        source="(2.25) with gravity off the floor's normal",
        signature="an unmodelled force that is constant in the room's axes, whichever way the robot moves or heads",
        look_alikes=("soft_floor", "centre_of_gravity_offset", "weak_motor", "accelerometer_bias"),
        excitation="both directions along a line, and several headings: resistance turns with the motion, a weak motor "
        "with the body, the slope with neither",
    )
    parameters = tuple(
        Parameter(f"slope_{axis}_rad", "rad", 0.0, -0.1, 0.1, (0.005, 0.02), tolerance=5e-4) for axis in "xy"
    )
    planar, balancing = tilted_planar, tilted_balancing

    def change(self, robot, plant, values):
        return robot.on_slope(plant, values["slope_x_rad"], values["slope_y_rad"])

    def block_parameters(self, body, values):
        downhill = -GRAVITY * np.array([values["slope_x_rad"], values["slope_y_rad"]])
        return {"downhill_m_s2": downhill} | body.robot.weight(body.plant)


EFFECTS = (
    ConstantSlip(), CorneringSlip(), WheelSlip(), TurnScrub(), SoftFloor(), SoftPatch(), QuadraticDrag(), FloorTilt(),
)
