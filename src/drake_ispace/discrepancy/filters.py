"""The follower's filter for each kind of robot: its linearised error system and what noise is assumed to drive it."""

from dataclasses import dataclass

import numpy as np

from drake_ispace.discrepancy.follower import Filter, design, discrete
from drake_ispace.rates import TICK_S
from drake_ispace.robots.plants import omni, pendulum
from drake_ispace.robots.plants.slip import GRAVITY
from drake_ispace.scenario import Scenario

BANDWIDTH_RAD_S = 15.0  # of the correction
CORRELATION_S = 0.05  # assumed of the forces below
#: Root mean square of unknown forces, assumed: omni x, y [N], yaw [N m]; pendulum s [N], phi, theta [N m].
FORCES = {"omni": (0.15, 0.15, 0.02), "pendulum": (0.1, 0.01, 0.003)}
_UNDRIVEN = 30.0  # times more where the command was not recorded: the motion itself is the unknown force
_ROVER_ACCELERATION = (0.5, 0.5, 1.0)  # m/s^2, m/s^2, rad/s^2 by which a rover leaves its command
_FINEST_COUNT = 2e-3  # rad
OTHER_NOISE = 4.0  # times the spectral density: how far off an assumption about noise may well be


@dataclass(frozen=True)
class ErrorSystem:
    """dx/dt = a dx - b u + w, e = c dx + d u: shapes as in `follower.design`."""

    a: np.ndarray
    b: np.ndarray
    c: np.ndarray
    d: np.ndarray


def filter_of(scenario: Scenario, robot: str, has: frozenset[str]) -> Filter:
    """The filter of that robot's replay with the channels `has`."""
    return _filter(scenario, robot, has, 0, 1.0)


def other_filters(scenario: Scenario, robot: str, has: frozenset[str]) -> list[Filter]:
    """The same for other assumptions about noise, one changed at a time: each kind of force, then the encoder."""
    return [_filter(scenario, robot, has, which, OTHER_NOISE) for which in range(4)]


def adapted(kind: str, plant) -> dict[str, np.ndarray]:
    """What of the follower's numbers goes with the plant: for a unit of error the same acceleration, and the same poles
    of the correction, whatever the plant's mass and however fast it falls. The gain on measurements stays."""
    weight = weight_of(kind, plant).ravel()
    if kind != "pendulum":
        return {"weight": weight}
    system = error_system(kind, plant)
    a, _ = discrete(system.a, system.b)
    return {"weight": weight, "a": a.ravel(), "feedback": _feedback(kind, system).ravel()}


def weight_of(kind: str, plant) -> np.ndarray:
    """(3, 3) what turns accelerations of the body into forces of the ground; for a rover velocities stay velocities."""
    if kind == "rover":
        return np.eye(3)
    return omni.mass_matrix(plant) if kind == "omni" else pendulum.linear_terms(plant)[0]


def error_system(kind: str, plant, imu_height_m: float = 0.0) -> ErrorSystem:
    """Of small differences between a robot and its model, for "omni", "pendulum" or "rover"; u: accelerations of the
    body, of a rover velocities."""
    push = np.vstack([np.zeros((3, 3)), np.eye(3)])
    if kind == "pendulum":
        a, _ = pendulum.linear_model(plant)
        r, half, kappa = plant.wheel_radius_m, plant.half_track_m, plant.inertias()["kappa"]
        c, d = np.zeros((8, 6)), np.zeros((8, 3))
        c[0, :3], c[1, :3] = (1 / r, half / r, -kappa), (1 / r, -half / r, -kappa)
        c[2] = a[3] + imu_height_m * a[5]
        c[2, 2] -= GRAVITY
        d[2] = 1.0, 0.0, imu_height_m
        c[6, 5], c[7, 4] = 1.0, 1.0
        return ErrorSystem(a, push, c, d)
    wheels = plant.geometry.inverse
    c = np.hstack([wheels, np.zeros((len(wheels), 3))])
    if kind == "omni":
        a = np.block([[np.zeros((3, 3)), np.eye(3)], [np.zeros((3, 6))]])
        return ErrorSystem(a, push, c, np.zeros((len(wheels), 3)))
    moves = np.eye(3)
    if len(plant.geometry.sideways):  # tyres hold it: it neither moves that way nor does anything show it
        moves = plant.geometry.forward @ wheels
    a = np.block([[-1e-3 * np.eye(3), moves], [np.zeros((3, 3)), -2.0 * np.eye(3)]])
    return ErrorSystem(a, np.vstack([moves, np.zeros((3, 3))]), c, np.zeros((len(wheels), 3)))


def _filter(scenario, robot, has, changed, times):
    section = getattr(scenario, robot)
    plant, counts = section.plant, section.encoder.counts_per_turn
    count = max(2.0 * np.pi / counts, _FINEST_COUNT) if counts else _FINEST_COUNT
    angle = count**2 / 12.0 if "encoder" in has else np.inf
    imu_height_m = section.imu.height_m if robot == "pendulum" else 0.0
    system = error_system(robot, plant, imu_height_m)
    p, m, n = len(system.c), system.b.shape[1], len(system.a)
    if not np.isfinite(angle):
        a, b = discrete(system.a, system.b)
        return Filter(a, b, system.c, system.d, np.zeros((n, p)), np.zeros((m, n)), weight_of(robot, plant))
    factors = np.ones(4)
    factors[changed] = times
    process, sensors = np.zeros((n, n)), np.full(p, angle * factors[3])
    process[3:, 3:] = _accelerations(robot, plant, has, factors[:3])
    if robot == "pendulum":
        gyro = section.imu.gyro_noise_density**2 / TICK_S if "imu" in has else np.inf
        sensors[2:] = np.inf
        sensors[6:] = gyro
    weight = weight_of(robot, plant)
    return design(system.a, system.b, system.c, system.d, process, sensors, _feedback(robot, system), weight)


def _accelerations(robot, plant, has, factors):
    """(3, 3) spectral density of the accelerations that unknown forces cause."""
    rms = _ROVER_ACCELERATION if robot == "rover" else FORCES[robot]
    undriven = {"omni": "torque", "pendulum": "torque", "rover": "command"}[robot] not in has
    density = np.diag(2.0 * np.square(rms) * CORRELATION_S * factors) * (_UNDRIVEN**2 if undriven else 1.0)
    if robot == "rover":
        return density
    inverse = np.linalg.inv(weight_of(robot, plant))
    return inverse @ density @ inverse.T


def _feedback(robot, system):
    """Poles at the bandwidth, the error system's own dynamics cancelled."""
    w = BANDWIDTH_RAD_S
    if robot == "rover":
        return np.hstack([w * np.eye(3), np.eye(3)])
    return np.hstack([w * w * np.eye(3), 2.0 * w * np.eye(3)]) + system.a[3:]
