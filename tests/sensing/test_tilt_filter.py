"""Tilt filter: converges, finds the gyro's bias, ignores repeated samples, and is good enough to drive on."""

import numpy as np
import pytest

from drake_ispace.blocks.kernels import arguments
from drake_ispace.plants.slip import GRAVITY
from drake_ispace.scenario import load_scenario
from drake_ispace.sensing.tilt_filter import TiltFilter, TiltKalmanFilter, step
from drake_ispace.simulation import simulate


def message(tick, tilt=0.0, rate=0.0):
    """A noise-free IMU on a body that does not accelerate."""
    return np.array([tick, -GRAVITY * np.sin(tilt), 0.0, GRAVITY * np.cos(tilt), 0.0, rate, 0.0])


def filtered(believed, samples, initial_tilt=0.0):
    """tick, tilt, rate, bias after all samples."""
    spec = TiltKalmanFilter(believed, initial_tilt).spec
    variances = [spec.parameters[name] for name in arguments(step)[2:]]
    state = spec.discrete_state
    for sample in samples:
        after = np.empty(len(state))
        step(state, sample, *variances, after)
        state = after
    return state[:4]


def test_a_sample_acts_in_its_tick_and_once_only(drive):
    ticks = [{"imu": message(k, rate=0.1 * k)} for k in range(20)]
    rows = drive(TiltKalmanFilter(TiltFilter()), "tilt", ticks)
    assert list(rows[:, 0]) == list(range(20))
    assert rows[1, 2] > 0.05
    assert rows[-1] == pytest.approx(filtered(TiltFilter(), [tick["imu"] for tick in ticks]), abs=1e-15)


def test_a_tilt_held_before_the_start_is_known(drive):
    row = drive(TiltKalmanFilter(TiltFilter(), 0.1), "tilt", [{"imu": message(0, 0.1)}])[0]
    assert row[1] == pytest.approx(0.1, abs=1e-12)


def test_tilt_follows_a_turning_body():
    # 0.2 s at rest, then 0.5 rad/s for 1 s
    rest, turn = [message(k) for k in range(40)], [message(40 + k, 0.0025 * k, 0.5) for k in range(201)]
    _, tilt, rate, _ = filtered(TiltFilter(), rest + turn)
    assert tilt == pytest.approx(0.5, abs=0.01)
    assert rate == pytest.approx(0.5, abs=0.01)


def test_a_wrong_start_is_forgotten():
    _, tilt, _, _ = filtered(TiltFilter(accelerometer_std_rad=0.1), [message(k, 0.05) for k in range(6000)])
    assert tilt == pytest.approx(0.05, abs=1e-3)


def test_a_constant_gyro_bias_is_found():
    _, tilt, rate, bias = filtered(TiltFilter(), [message(k, 0.0, 0.02) for k in range(6000)])
    assert bias == pytest.approx(0.02, abs=1e-3)
    assert rate == pytest.approx(0.0, abs=1e-3)
    assert abs(np.degrees(tilt)) < 0.5


def test_tilt_stays_within_half_a_degree_on_a_square():
    run = simulate(load_scenario("pendulum_multirate", ["seconds=22"]))
    truth, estimate = run.signals["pendulum_balance"][:-1, 0], run.signals["pendulum_tilt"][1:, 1]
    assert np.degrees(np.abs(truth).max()) > 2.0
    assert np.degrees(np.abs(estimate - truth).max()) < 0.5
