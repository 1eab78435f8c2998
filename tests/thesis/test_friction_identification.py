"""Friction coefficients that hide in the plant, from closed-loop runs with sensor noise."""

import dataclasses

import numpy as np
import pytest

from drake_ispace.blocks.errors import InputError
from drake_ispace.blocks.rates import ticks_in
from drake_ispace.files.recording import Channel
from drake_ispace.scenario import load_scenario
from drake_ispace.thesis.friction_coefficients import (
    FrictionCoefficients,
    friction_coefficients,
    over_compensated,
)
from drake_ispace.thesis.friction_data import (
    COEFFICIENTS,
    following_rollout,
    friction_estimates,
    friction_prediction_error,
    friction_rollout,
    run_recording,
)
from drake_ispace.thesis.identify import identify_run
from drake_ispace.thesis.methods.estimate import Estimate
from drake_ispace.thesis.structures import friction_problem

TRUTH = np.array([0.0061, 0.0106])


@pytest.fixture(scope="module")
def scenario():
    return load_scenario("pendulum_friction_excitation")


@pytest.fixture(scope="module")
def rollout(scenario):
    return friction_rollout(scenario)


@pytest.fixture(scope="module")
def recording(scenario, rollout):
    return run_recording(rollout, scenario, ticks_in(60.0), rollout.with_seed(0))


@pytest.fixture(scope="module")
def follower(scenario):
    return following_rollout(scenario)


@pytest.mark.parametrize("method", ["arx", "armax", "armaxd", "iv"])
def test_regression_finds_both_coefficients(recording, method):
    found = friction_coefficients(friction_estimates(friction_problem(recording), every=1000)[method])
    tolerance = 0.15 if method == "iv" else 0.03  # the reference is a weak instrument here
    assert np.abs(np.array([found.coulomb_n_m, found.viscous_n_m_s]) / TRUTH - 1.0).max() < tolerance


def test_prediction_error_finds_both_coefficients_from_half_to_twice_the_truth(recording, scenario, follower):
    ends = [friction_prediction_error(follower, scenario, recording, start).theta[:, 0]
            for start in ((0.003, 0.005), (0.012, 0.02))]
    for end in ends:
        assert np.abs(end / TRUTH - 1.0).max() < 0.01


def test_prediction_error_finds_other_coefficients_too(scenario, rollout, follower):
    parameters = rollout.with_seed(1)
    for name, value in zip(COEFFICIENTS, (0.004, 0.015), strict=True):
        parameters[rollout.index(name)] = value
    other = run_recording(rollout, scenario, ticks_in(60.0), parameters)
    found = friction_prediction_error(follower, scenario, other).theta[:, 0]
    assert np.abs(found / [0.004, 0.015] - 1.0).max() < 0.03


def test_the_tilt_stays_where_the_linear_model_holds(recording):
    assert np.abs(recording.channels["truth"].column("tilt")).max() < 0.2


def test_an_input_matrix_that_is_badly_known_is_not_trusted():
    theta = np.array([[1.0, 1.0], [-0.1, -0.1], [-0.2, -0.2], [10.0, 10.0]])
    std = np.full((4, 2), 8.0)
    names = ("theta", "sgn", "omega", "tau")
    found = friction_coefficients(Estimate("", names, ("s", "t"), theta, std, np.empty((0, 2)), np.empty((0, 4))))
    assert found.coulomb_n_m == pytest.approx(0.01) and not found.trustworthy


@pytest.mark.parametrize(("multiple", "over"), [(0.5, False), (1.0, False), (1.5, True)])
def test_over_compensation_is_detected(multiple, over):
    found = FrictionCoefficients(0.0061, 0.0106, 1e-5, 1e-5, 1.0, 0.01)
    verdict = over_compensated(found, multiple * 0.0061, multiple * 0.0106)
    assert verdict["over"] is over and verdict["coulomb_ratio"] == pytest.approx(multiple)


@pytest.mark.parametrize("name", ["torque", "encoder", "imu"])
def test_a_run_without_a_channel_is_refused(recording, name):
    channels = {key: value for key, value in recording.channels.items() if key != name}
    with pytest.raises(InputError, match=f"no channel {name}"):
        friction_problem(dataclasses.replace(recording, channels=channels))


def test_a_run_with_a_gap_is_refused(recording):
    imu = recording.channels["imu"]
    keep = np.arange(len(imu.t)) != 700
    gap = Channel(imu.t[keep], imu.columns, imu.values[keep])
    with pytest.raises(InputError, match="channel imu: expected at least 400 samples, one every 5 ms"):
        friction_problem(dataclasses.replace(recording, channels={**recording.channels, "imu": gap}))


def test_another_robot_is_refused(recording):
    with pytest.raises(InputError, match="expected pendulum"):
        friction_problem(dataclasses.replace(recording, robot="omni"))


def test_a_robot_that_rests_is_refused(recording):
    def still(channel):
        return Channel(channel.t, channel.columns, np.zeros_like(channel.values))

    channels = {name: still(recording.channels[name]) for name in ("torque", "encoder", "imu")}
    with pytest.raises(InputError, match="does not excite"):
        identify_run(dataclasses.replace(recording, channels=channels), "arx")


def test_a_gyro_bias_does_not_move_the_coefficients(recording):
    imu = recording.channels["imu"]
    biased = Channel(imu.t, imu.columns, imu.values + np.array([0, 0, 0, 0, 0.02, 0]))
    with_bias = dataclasses.replace(recording, channels={**recording.channels, "imu": biased})
    assert np.allclose(friction_problem(with_bias).regressor, friction_problem(recording).regressor, atol=1e-9)
