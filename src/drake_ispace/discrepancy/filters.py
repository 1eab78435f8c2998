"""The follower's filter for each kind of robot: its linearised error system and what noise is assumed to drive it."""

import numpy as np

from drake_ispace.discrepancy.follower import Filter, design
from drake_ispace.rates import TICK_S
from drake_ispace.robots import omni, pendulum
from drake_ispace.robots.slip import GRAVITY
from drake_ispace.scenario import Scenario
from drake_ispace.wiring.pendulum import pendulum_gain

_BANDWIDTH_RAD_S = 15.0  # of the correction
_CORRELATION_S = 0.05  # assumed of the forces below
_OMNI_FORCES = (0.15, 0.15, 0.02)  # N, N, N m, root mean square, assumed
_PENDULUM_FORCES = (0.1, 0.01, 0.003)  # of s [N], phi, theta [N m]
_UNDRIVEN = 30.0  # times more where the command was not recorded: the motion itself is the unknown force
_BASE_ACCELERATION = (0.5, 0.5, 1.0)  # m/s^2, m/s^2, rad/s^2 by which a base leaves its command
_FINEST_COUNT = 2e-3  # rad


def filter_of(scenario: Scenario, robot: str, has: frozenset[str]) -> Filter:
    """The filter of that robot's replay with the channels `has`."""
    section = getattr(scenario, robot)
    counts = section.encoder.counts_per_turn
    count = max(2.0 * np.pi / counts, _FINEST_COUNT) if counts else _FINEST_COUNT
    angle = count**2 / 12.0 if "encoder" in has else np.inf
    return {"omni": _omni, "pendulum": _pendulum, "base": _base}[robot](section, angle, has)


def _density(rms):
    return np.diag(2.0 * np.square(rms) * _CORRELATION_S)


def _omni(section, angle, has):
    plant = section.plant
    wheels, mass = plant.geometry.inverse, omni.mass_matrix(plant)
    n = len(wheels)
    effort = np.linalg.solve(mass, wheels.T)
    a = np.block([[np.zeros((3, 3)), np.eye(3)], [np.zeros((3, 6))]])
    b = np.vstack([np.zeros((3, n)), effort])
    c = np.hstack([wheels, np.zeros((n, 3))])
    forces = np.array(_OMNI_FORCES) * (1.0 if "torque" in has else _UNDRIVEN)
    inverse = np.linalg.inv(mass)
    process = np.zeros((6, 6))
    process[3:, 3:] = inverse @ _density(forces) @ inverse.T
    if not np.isfinite(angle):
        return Filter(np.eye(6), b * TICK_S, c, np.zeros((n, n)), np.zeros((6, n)), np.zeros((n, 6)))
    w = _BANDWIDTH_RAD_S
    feedback = plant.geometry.forward.T @ mass @ np.hstack([w * w * np.eye(3), 2.0 * w * np.eye(3)])
    return design(a, b, c, np.zeros((n, n)), process, np.full(n, angle), feedback)


def _pendulum(section, angle, has):
    plant, imu = section.plant, section.imu
    a, b = pendulum.linear_model(plant)
    mass, _, _ = pendulum.linear_terms(plant)
    r, half, kappa = plant.wheel_radius_m, plant.half_track_m, plant.inertias()["kappa"]
    c, d = np.zeros((8, 6)), np.zeros((8, 2))
    c[0, :3], c[1, :3] = (1 / r, half / r, -kappa), (1 / r, -half / r, -kappa)
    c[2] = a[3] + imu.height_m * a[5]
    c[2, 2] -= GRAVITY
    d[2] = b[3] + imu.height_m * b[5]
    c[6, 5], c[7, 4] = 1.0, 1.0
    gyro = (imu.gyro_noise_density**2 / TICK_S) if "imu" in has else np.inf
    sensors = np.array([angle, angle, np.inf, np.inf, np.inf, np.inf, gyro, gyro])
    forces = np.array(_PENDULUM_FORCES) * (1.0 if "torque" in has else _UNDRIVEN)
    inverse = np.linalg.inv(mass)
    process = np.zeros((6, 6))
    process[3:, 3:] = inverse @ _density(forces) @ inverse.T
    # DLQR's gain holds K (x - x_ref) at zero; the model is steered towards the robot
    return design(a, b, c, d, process, sensors, pendulum_gain(section))


def _base(section, angle, has):
    wheels = section.plant.geometry.inverse
    n = len(wheels)
    a = np.block([[np.zeros((3, 3)), np.eye(3)], [np.zeros((3, 3)), -2.0 * np.eye(3)]])
    b = np.vstack([np.eye(3), np.zeros((3, 3))])
    c = np.hstack([wheels, np.zeros((n, 3))])
    process = np.zeros((6, 6))
    process[3:, 3:] = _density(np.array(_BASE_ACCELERATION) * (1.0 if "command" in has else 4.0))
    if not np.isfinite(angle):
        return Filter(np.eye(6), b * TICK_S, c, np.zeros((n, 3)), np.zeros((6, n)), np.zeros((3, 6)))
    feedback = np.hstack([_BANDWIDTH_RAD_S * np.eye(3), np.eye(3)])
    return design(a, b, c, np.zeros((n, 3)), process, np.full(n, angle), feedback)
