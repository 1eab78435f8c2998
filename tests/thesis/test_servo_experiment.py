"""The experiment of section 3.4: its data, and the error index of every method on them."""

import numpy as np
import pytest

from drake_ispace.blocks.rates import TICK_S
from drake_ispace.sensing.sinusoid_noise import SinusoidNoise
from drake_ispace.thesis.methods.armaxd import armaxd
from drake_ispace.thesis.methods.arx import arx
from drake_ispace.thesis.methods.instrumental import instrumental
from drake_ispace.thesis.servo_data import (
    ACTUAL,
    plant_rollout,
    servo_data,
    servo_prediction_error,
    servo_rollout,
    with_zero_row,
)
from drake_ispace.thesis.structures import error_index, optimised


@pytest.fixture(scope="module")
def rollout():
    return servo_rollout()


@pytest.fixture(scope="module")
def data(rollout):
    return servo_data(rollout, 20.0, 0, SinusoidNoise())


def index(theta):
    return error_index(theta[:3], ACTUAL)


def test_at_200_hz_the_noise_is_a_constant(data):
    at_ticks = (data.measured - data.exact)[:: round(data.rate_hz * TICK_S)]
    assert np.ptp(at_ticks[:, 1]) < 1e-3 * 0.05  # what the rounding of the tick leaves
    assert np.ptp((data.measured - data.exact)[:, 1]) > 0.09


def test_the_noise_has_the_printed_amplitudes(data):
    assert np.allclose((data.measured - data.exact).std(axis=0), np.array([0.001, 0.05]) / np.sqrt(2.0), rtol=1e-3)


def test_the_state_between_ticks_is_that_of_the_linear_plant(data):
    steps = 1.0 / data.rate_hz
    s = data.exact[:, 0]
    second = (s[2:] - 2.0 * s[1:-1] + s[:-2]) / steps**2
    held = np.diff(data.torque, n=2) == 0.0  # away from a step of the torque
    assert np.abs(second[held[: len(second)]] - data.acceleration[1:-1, 0][held[: len(second)]]).max() < 0.02


def test_differencing_the_measured_tilt_twice_is_useless(data):
    second = np.diff(data.measured[:, 1], n=2) * data.rate_hz**2
    # amplitude 2 (1 - cos w T) / T^2 * 0.05 rad = 7.2e5 rad/s^2, against less than 50 rad/s^2 of motion
    assert np.abs(second).max() == pytest.approx(7.2e5, rel=0.01)
    assert np.ptp(data.acceleration[:, 1]) < 50.0


def test_least_squares_is_exact_without_noise(rollout):
    quiet = servo_data(rollout, 20.0, 0, SinusoidNoise(800.0, 0.0, 0.0))
    assert index(arx(quiet.problem()).theta) < 1e-6


def test_armaxd_beats_arx_at_the_printed_noise(data):
    ordinary, separated = index(arx(data.problem()).theta), index(armaxd(data.problem(), every=1000).theta)
    assert 6.0 < ordinary < 9.0
    assert separated < 0.3 * ordinary


def test_armaxd_gains_little_where_the_noise_is_below_its_cut_off(rollout):
    problem = servo_data(rollout, 20.0, 0, SinusoidNoise(100.0, 0.005, 0.25)).problem()
    assert index(armaxd(problem, every=1000).theta) > 0.9 * index(arx(problem).theta) > 10.0


def test_armaxd_gains_nothing_on_filtered_data(rollout):
    problem = servo_data(rollout, 20.0, 0, SinusoidNoise(white_share=0.5)).problem(filtered=True)
    assert index(armaxd(problem, every=1000).theta) == pytest.approx(index(arx(problem).theta), rel=0.02)


def test_instrumental_variables_and_prediction_error_reach_5_percent(data):
    first = arx(data.problem())
    assert index(instrumental(data.problem(), spread=False).theta) < 0.1
    pem = servo_prediction_error(plant_rollout(), data, first.theta)
    assert index(with_zero_row(pem.theta)) < 0.1


def test_both_wheels_get_the_same_torque_so_only_the_sum_of_b_can_be_identified(rollout):
    torque = rollout.run(400)["pendulum_torque"]
    assert np.array_equal(torque[:, 0], torque[:, 1]) and torque.any()


def test_the_optimised_regressor_has_no_position(data):
    s, theta = data.measured.T
    problem = optimised(s, theta, data.torque, data.acceleration, data.rate_hz)
    assert problem.names == ("theta", "u") and problem.regressor.shape == (40000, 2)


@pytest.mark.parametrize("rate_hz", [2000.0, 4000.0])
def test_the_rate_can_be_chosen(rollout, rate_hz):
    data = servo_data(rollout, 2.0, 0, SinusoidNoise(), rate_hz)
    assert len(data.measured) == round(2.0 * rate_hz) and data.rate_hz == pytest.approx(rate_hz, rel=1e-6)


@pytest.mark.slow
def test_over_200_seeds_armaxd_beats_arx_every_time(rollout):
    for seed in range(200):
        problem = servo_data(rollout, 20.0, seed, SinusoidNoise()).problem()
        assert index(armaxd(problem, every=1000).theta) < 0.5 * index(arx(problem).theta)
