"""The follower's filter for a robot: its linearised error system, and the noise that is assumed to drive it."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial

import numpy as np
from scipy.linalg import block_diag, null_space

from drake_ispace.blocks.rates import TICK_S
from drake_ispace.explain.predict.follower import Filter, design, discrete
from drake_ispace.robots.robot import COMMAND, ErrorSystem, Robot
from drake_ispace.scenario import Scenario

BANDWIDTH_RAD_S = 15.0  # of the correction that holds the model on the measurements
CORRELATION_S = 0.05  # of unknown forces, assumed
_UNDRIVEN = 30.0  # times larger unknown forces where no command was recorded: the motion itself is then unknown
_FINEST_COUNT = 2e-3  # rad: an encoder that is finer, or exact, counts as one of this
OTHER_NOISE = 4.0  # times the spectral density or variance: how wrong an assumption about noise may well be
ASSUMED = ("force 1", "force 2", "force 3", "rounding")  # each of which may be wrong by that


def filters_of(
    scenario: Scenario, robot: Robot, has: frozenset[str], ticks: int = 1, count_rad: float = 0.0
) -> Callable[..., Filter]:
    """A function of a plant, which may be another than the scenario's, that gives the filter for it.

    Of a robot with dynamics of its own all of the filter follows the plant: a gain that was found for another weight
    need not hold an unstable model. Elsewhere only the weight does, so that the same error causes the same acceleration
    whatever the mass.

    Its second argument is the number of the assumption among ASSUMED that is wrong by OTHER_NOISE: unknown forces along
    each of the three coordinates, or the encoder's rounding; None, the default: none is.

    Args:
        has: channels of the runs. ticks: from one read of the encoders to the next. count_rad: of the encoders, where
            the runs show a coarser one than the scenario says.
    """
    settings = getattr(scenario, robot.name)
    if robot.own_dynamics:
        return partial(_filter, robot, settings, has, ticks, count_rad)
    nominal = cache(partial(_filter, robot, settings, has, ticks, count_rad, settings.plant))
    return lambda plant, changed=None: replace(nominal(changed), weight=robot.mass_matrix(plant))


def _filter(robot, settings, has, ticks, count_rad, plant, changed=None):
    counts = settings.encoder.counts_per_turn
    count = max(2.0 * np.pi / counts if counts else 0.0, count_rad, _FINEST_COUNT)
    system, slips = _with_slips(robot.error_system(plant, settings.imu.height_m if robot.has_imu else 0.0), plant)
    weight = robot.mass_matrix(plant)
    p, m, n = len(system.c), system.b.shape[1], len(system.a)
    if "encoder" not in has:
        a, b = discrete(system.a, system.b)
        return Filter(a, b, system.c, system.d, np.zeros((n, p)), np.zeros((m, n)), weight, slips)
    factors = np.ones(len(ASSUMED))
    if changed is not None:
        factors[changed] = OTHER_NOISE
    process, sensors = np.zeros((n, n)), np.full(p, count**2 / 12.0 * factors[3])
    process[3:6, 3:6] = _accelerations(robot, weight, has, factors[:3])
    process[6:, 6:] = _slipping(robot, plant) * np.eye(slips)
    if robot.has_imu:
        wheels = len(plant.geometry.wheels)
        sensors[wheels:] = np.inf
        sensors[wheels + 4 :] = settings.imu.gyro_noise_density**2 / TICK_S if "imu" in has else np.inf
    feedback = np.hstack([_feedback(robot, system.a[3:6, :6]), np.zeros((m, slips))])
    return design(system.a, system.b, system.c, system.d, process, sensors, feedback, weight, ticks, slips)


def _with_slips(system: ErrorSystem, plant) -> tuple[ErrorSystem, int]:
    """The error system with the angles by which wheels slip against each other, and the number of these.

    More wheels than the body has ways to move cannot all roll: what no motion of the body makes of their angles is
    their own, and stays when they stop.
    """
    wheels = plant.geometry.inverse
    apart = null_space(wheels.T)
    slips, others = apart.shape[1], len(system.c) - len(wheels)
    return ErrorSystem(
        block_diag(system.a, np.zeros((slips, slips))), np.vstack([system.b, np.zeros((slips, system.b.shape[1]))]),
        np.hstack([system.c, np.vstack([apart, np.zeros((others, slips))])]), system.d,
    ), slips


def _slipping(robot, plant):
    """Spectral density of a wheel's rate of slip [rad^2/s], at a metre a second."""
    return robot.unknown_slip[0] ** 2 * float(np.mean(np.sum(plant.geometry.inverse[:, :2] ** 2, axis=1)))


def _accelerations(robot, weight, has, factors):
    """(3, 3) spectral density of the accelerations that unknown forces cause; factors (3,) on those of the forces."""
    density = np.diag(2.0 * np.square(robot.unknown_forces) * CORRELATION_S * factors)
    inverse = np.linalg.inv(weight)
    return inverse @ (density * (1.0 if robot.driven in has else _UNDRIVEN**2)) @ inverse.T


def _feedback(robot: Robot, own: np.ndarray) -> np.ndarray:
    """K (3, 6): poles at the bandwidth, the error system's own dynamics (3, 6) cancelled."""
    w = BANDWIDTH_RAD_S
    if robot.driven == COMMAND:
        return np.hstack([w * np.eye(3), np.eye(3)])
    return np.hstack([w * w * np.eye(3), 2.0 * w * np.eye(3)]) + own
