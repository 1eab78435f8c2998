"""Data of the servo experiment of section 3.4, at an identification rate of its own.

The loop runs at 200 Hz (Table 6.1). There an 800 Hz sinusoid is a constant and no filter can cut at 740 Hz, so position
and tilt are logged faster, at 2 kHz or more. The plant is linear and its torque held over a tick: the state between the
ticks is known exactly, and the sinusoids are those of the loop, at the same phases.

Where Y = [s'', theta''] comes from is not said in the thesis; double differences of 0.05 rad at 800 Hz would be
7e5 rad/s^2. Here Y is the plant's own acceleration (section 3.4.1 puts noise on s and theta only). `filtered` is what a
robot without that knowledge would do: Y and the regressors behind the same low-pass, whose second derivative is exact.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm
from scipy.signal import cont2discrete, lfilter

from drake_ispace.blocks.messages import WAY_POINT
from drake_ispace.blocks.noise import normal, stream, uniform
from drake_ispace.blocks.rates import TICK_S, ticks_in
from drake_ispace.plants.linear_pendulum import PRINTED_INPUT, PRINTED_STATE, LinearPendulumPlant
from drake_ispace.plants.pendulum import PendulumPlantParameters
from drake_ispace.robots.pendulum import Pendulum
from drake_ispace.rollout.compile import Rollout, compile_diagram
from drake_ispace.scenario import Scenario, load_scenario
from drake_ispace.sensing.sinusoid_noise import SinusoidNoise
from drake_ispace.thesis.methods.estimate import Estimate
from drake_ispace.thesis.methods.prediction_error import prediction_error
from drake_ispace.thesis.structures import Problem, full_state
from drake_ispace.wiring.bench import Bench, Part
from drake_ispace.wiring.catalog import build_diagram

#: [A_2d B_2d]' of (3.49)-(3.50): rows s, theta, u (one column of B), columns s'', theta''.
ACTUAL = np.array([[0.0, 0.0], [PRINTED_STATE[0], PRINTED_STATE[1]], [PRINTED_INPUT[0], PRINTED_INPUT[2]]])
_ROBOT = Pendulum.name
_LOGS = {f"{_ROBOT}_{signal}": 1 for signal in ("pose", "balance", "torque", "way_point")}
_CORNER_HZ = 8.0  # of the low-pass behind which Y is differentiated


def servo_rollout(scenario: Scenario | None = None) -> Rollout:
    """The compiled Diagram `pendulum_servo` with the logs that the experiment needs."""
    return compile_diagram(build_diagram(scenario or load_scenario("pendulum_servo")), log=_LOGS)


@dataclass(frozen=True)
class ServoData:
    """One run.

    Attributes:
        rate_hz: samples a second, a multiple of the loop's 200 Hz (nominally).
        reference, torque: (N,) r [m] and u = tau_r + tau_l [N m].
        exact, measured: (N, 2) s [m] and theta [rad] without and with noise; acceleration: (N, 2) of the plant.
    """

    rate_hz: float
    reference: np.ndarray
    torque: np.ndarray
    exact: np.ndarray
    measured: np.ndarray
    acceleration: np.ndarray

    def problem(self, filtered: bool = False) -> Problem:
        """(3.63)-(3.65), Y from the plant, or Y and regressors behind a third-order low-pass at 8 Hz."""
        s, theta = self.measured.T
        if not filtered:
            return full_state(s, theta, self.torque, self.acceleration, self.rate_hz, self.reference)
        smooth, twice = _state_variable_filter(self.rate_hz)
        y = np.column_stack([twice(s), twice(theta)])
        return full_state(smooth(s), smooth(theta), smooth(self.torque), y, self.rate_hz, smooth(self.reference))


def servo_data(
    rollout: Rollout, seconds: float, seed: int, noise: SinusoidNoise, rate_hz: float = 2000.0,
) -> ServoData:
    """Run the experiment once; the controller sees the noise too, at its own 200 Hz.

    Args:
        rollout: of `servo_rollout`; seconds: length; seed: of the noise's phases.
        rate_hz: rounded to a whole number of samples a tick.
    """
    ticks = ticks_in(seconds)
    parameters = rollout.with_seed(seed)
    amplitude = np.array([noise.position_amplitude_m, noise.tilt_amplitude_rad])
    for i in range(2):
        parameters[rollout.index(f"{_ROBOT}_state.amplitude[{i}]")] = amplitude[i]
    parameters[rollout.index(f"{_ROBOT}_state.frequency_hz")] = noise.frequency_hz
    parameters[rollout.index(f"{_ROBOT}_state.white_share")] = noise.white_share
    logs = rollout.run(ticks, parameters)
    per_tick = max(round(rate_hz * TICK_S), 1)
    states, acceleration = _between(logs, per_tick)
    exact, torque = states[:, :2], states[:, 4]
    time = np.arange(len(exact)) * (TICK_S / per_tick)
    key = stream(seed, f"{_ROBOT}.sensor_noise")
    white = np.random.default_rng(seed).standard_normal((len(time), 2)) if noise.white_share else 0.0
    phase = 2.0 * np.pi * np.array([uniform(key, 0, 0), uniform(key, 0, 1)])
    wave = np.sin(2.0 * np.pi * noise.frequency_hz * time[:, None] + phase) + noise.white_share * white
    if noise.white_share:  # at the ticks it is the loop's own
        drawn = np.array([[normal(key, k, 2), normal(key, k, 3)] for k in range(ticks)])
        wave[::per_tick] += noise.white_share * (drawn - white[::per_tick])
    reference = np.repeat(logs[f"{_ROBOT}_way_point"][1:, WAY_POINT.x], per_tick)
    return ServoData(per_tick / TICK_S, reference, torque, exact, exact + amplitude * wave, acceleration)


def _between(logs, per_tick, theta=ACTUAL):
    """(N, 5) s, theta, their rates and u at `per_tick` instants of every tick, exact for a held torque, and (N, 2)
    accelerations, of the plant `theta` (3, 2)."""
    both = _state_and_torque(logs, logs[f"{_ROBOT}_torque"][1:].sum(axis=1))
    states = np.stack([both @ step.T for step in _steps(per_tick, theta)], axis=1).reshape(-1, 5)
    return states, states @ _extended(theta)[2:4].T


def _state_and_torque(logs, torque):
    return np.column_stack([logs[f"{_ROBOT}_pose"][:-1, 0], logs[f"{_ROBOT}_balance"][:-1, [0, 1, 3]], torque])


def _extended(theta):
    """(5, 5): d/dt [s, theta, s_dot, theta_dot, u] with u held."""
    block = np.zeros((5, 5))
    block[0, 2] = block[1, 3] = 1.0
    block[2:4, 1], block[2:4, 4] = theta[1], theta[2]
    return block


def _steps(per_tick, theta):
    return [expm(_extended(theta) * (TICK_S * j / per_tick)) for j in range(per_tick)]


def _state_variable_filter(rate_hz):
    w = 2.0 * np.pi * _CORNER_HZ
    denominator = np.poly([-w] * 3)
    (b0, a0, _), (b2, a2, _) = (
        cont2discrete(([w**3], denominator), 1.0 / rate_hz, "bilinear"),
        cont2discrete(([w**3, 0.0, 0.0], denominator), 1.0 / rate_hz, "bilinear"),
    )
    return (lambda x: lfilter(np.ravel(b0), a0, x)), (lambda x: lfilter(np.ravel(b2), a2, x))


def noise_free_regressors(rollout: Rollout, seconds: float, rate_hz: float, theta: np.ndarray) -> np.ndarray:
    """(N, 3) [s, theta, u] of the loop without noise, its plant at the estimate `theta` (3, 2): instruments.

    The position's own column of A, whose truth is zero, is not part of the simulated plant.
    """
    parameters = rollout.parameters.copy()
    for name, value in plant_parameters(theta).items():
        parameters[rollout.index(name)] = value
    for i in range(2):
        parameters[rollout.index(f"{_ROBOT}_state.amplitude[{i}]")] = 0.0
    logs = rollout.run(ticks_in(seconds), parameters)
    states, _ = _between(logs, max(round(rate_hz * TICK_S), 1), theta)
    return np.nan_to_num(states[:, [0, 1, 4]])


def plant_parameters(theta: np.ndarray) -> dict[str, float]:
    """Names and values of the printed plant's parameters for theta (3, 2)."""
    return {
        f"{_ROBOT}_plant.state_terms[0]": theta[1, 0], f"{_ROBOT}_plant.state_terms[1]": theta[1, 1],
        f"{_ROBOT}_plant.input_terms[0]": theta[2, 0], f"{_ROBOT}_plant.input_terms[2]": theta[2, 1],
    }


def plant_rollout() -> Rollout:
    """The printed plant alone, its torque an input: for simulation error from the torque that was recorded.

    From the reference through the noise-free loop it errs: at 200 Hz the loop's 800 Hz noise is a constant that the
    real loop feels."""
    bench = Bench()
    part = Part(bench, _ROBOT)
    part.add("plant", LinearPendulumPlant(PendulumPlantParameters()))
    bench.let_in(torque=part.block("plant.torque"))
    part.show(pose="plant.pose", balance="plant.balance")
    return compile_diagram(bench.build("printed_plant"))


def servo_prediction_error(plant: Rollout, data: ServoData, start: np.ndarray) -> Estimate:
    """The printed plant's four coefficients by simulation error from the guess `start` (3, 2), `plant` of
    `plant_rollout`. What is compared is s and theta averaged over each tick.

    theta is (4, 1): of theta in s'' and theta'', of u in s'' and theta''; s has no coefficient by structure.
    """
    per_tick = max(round(data.rate_hz * TICK_S), 1)
    held = data.torque[::per_tick]
    base, names = plant.parameters.copy(), plant_parameters(start)
    index = [plant.index(name) for name in names]
    torque = np.column_stack([held, held]) / 2.0

    def simulate(values):
        base[index] = values
        logs = plant.run(len(held), base, inputs={"torque": torque})
        steps = _steps(per_tick, with_zero_row(values))
        return (_state_and_torque(logs, held) @ np.mean(steps, axis=0).T)[:, :2]

    measured = data.measured.reshape(-1, per_tick, 2).mean(axis=1)
    weights = 1.0 / np.maximum((measured - simulate(list(names.values()))).std(axis=0), 1e-9)
    return prediction_error(simulate, names, measured, weights)


def with_zero_row(values: np.ndarray) -> np.ndarray:
    """theta (3, 2) from the four coefficients (4,) or (4, 1) of `servo_prediction_error`."""
    return np.vstack([np.zeros(2), np.ravel(values).reshape(2, 2)])
