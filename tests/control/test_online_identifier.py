"""The identifier in the loop: from zero knowledge, at every tick, for ever."""

import numba
import numpy as np
import pytest

from drake_ispace.blocks.rates import ticks_in
from drake_ispace.control.adaptive import online_identifier
from drake_ispace.control.adaptive.online_identifier import ROOT, SCRATCH, Identifier, OnlineIdentifier
from drake_ispace.scenario import load_scenario
from drake_ispace.thesis.friction_data import friction_rollout


@pytest.fixture(scope="module")
def logs():
    scenario = load_scenario("pendulum_friction_excitation")
    rollout = friction_rollout(scenario)
    return rollout.run(ticks_in(60.0), rollout.with_seed(0))


def test_it_starts_from_zero(logs):
    assert not logs["pendulum_parameters"][0].any() and not logs["pendulum_friction"][0].any()


def test_it_converges_while_the_robot_balances(logs):
    assert np.abs(logs["pendulum_friction"][-1] / [0.0061, 0.0106] - 1.0).max() < 0.15


def test_the_signs_of_the_input_matrix_are_the_plants(logs):
    s_ddot, theta_ddot = logs["pendulum_parameters"][-1, 6:]
    assert s_ddot > 0.0 > theta_ddot


def test_listening_changes_nothing():
    def pose(overrides):
        rollout = friction_rollout(load_scenario("pendulum_friction_excitation", overrides))
        return rollout.run(400)["pendulum_pose"]

    assert np.array_equal(pose([]), pose(["pendulum.identifier.forgetting=0.9"]))


def test_without_forgetting_it_is_least_squares_of_its_own_regressors():
    rng = np.random.default_rng(0)
    block = OnlineIdentifier(Identifier(forgetting=1.0, initial_variance=1e10, trace_limit=1e12), 0.02)
    p, xd = block.spec.parameters, block.spec.discrete_state.copy()
    values = [p[name] for name in ("memory", "forgetting", "trace_limit", "dead_band_rad_s", "sizes")]
    rows, targets, out = [], [], xd.copy()
    for tick in range(400):
        wheels, imu, tilt = rng.normal(size=4), rng.normal(size=6), 0.1 * rng.normal(size=3)
        imu[2] = 9.81
        online_identifier.step(
            xd, np.array([tick, *wheels]), np.array([tick, *imu]), np.array([tick, *tilt]), 0.1 * rng.normal(size=2),
            *values, out
        )
        xd = out.copy()
        if tick:
            rows.append(xd[online_identifier.REG : online_identifier.ACC])
            targets.append(xd[online_identifier.ACC : online_identifier.THETA])
    expected = np.linalg.lstsq(np.array(rows), np.array(targets), rcond=None)[0]
    assert np.allclose(xd[online_identifier.THETA : ROOT].reshape(4, 2), expected, atol=1e-6)


@numba.njit
def _rest(step, xd, encoder, imu, tilt, torque, memory, forgetting, trace_limit, dead_band, sizes, out, ticks):
    for tick in range(ticks):
        encoder[0] = tick
        step(xd, encoder, imu, tilt, torque, memory, forgetting, trace_limit, dead_band, sizes, out)
        xd[:] = out


@pytest.mark.slow
def test_a_million_ticks_without_excitation_stay_finite():
    block = OnlineIdentifier(Identifier(forgetting=0.99), 0.02)
    p, xd = block.spec.parameters, block.spec.discrete_state.copy()
    imu = np.array([0.0, 0.0, 0.0, 9.81, 0.0, 0.0, 0.0])
    _rest(online_identifier.step, xd, np.zeros(5), imu, np.zeros(4), np.zeros(2), p["memory"], p["forgetting"],
          p["trace_limit"], p["dead_band_rad_s"], p["sizes"], xd.copy(), 1_000_000)
    assert np.isfinite(xd).all()
    assert xd[ROOT:SCRATCH] @ xd[ROOT:SCRATCH] <= p["trace_limit"] * (1.0 + 1e-9)
