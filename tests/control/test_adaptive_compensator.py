"""The adaptive compensator: V decreases, coefficients converge under excitation, nothing moves at rest."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from drake_ispace.blocks.rates import TICK_S, ticks_in
from drake_ispace.control.adaptive.adaptive_compensator import (
    Adaptation,
    AdaptiveCompensator,
    faded_sign,
    lyapunov_matrix,
)
from drake_ispace.control.feedback.balance_gains import balance_gain, linearised
from drake_ispace.plants.pendulum import PendulumPlantParameters
from drake_ispace.scenario import load_scenario
from drake_ispace.thesis.friction_data import friction_rollout

C = np.array([0.0061, 0.0106])


@pytest.fixture(scope="module")
def model():
    scenario = load_scenario("pendulum_friction_compensation")
    a, b = linearised(scenario.pendulum.plant)
    return a, b, balance_gain(scenario.pendulum.plant, scenario.pendulum.control)


def wheels(plant):
    """(2, 6): wheel rates from the state."""
    r, h = plant.wheel_radius_m, plant.half_track_m
    return np.array([[0, 0, 0, 1 / r, h / r, -1.0], [0, 0, 0, 1 / r, -h / r, -1.0]])


def closed_loop(model, start, seconds, rates=(2e-3, 2e-3)):
    """V (k,), |x| and coefficients of the module's equations, continuous in time, friction's sign faded (a smooth
    right-hand side, the same in plant and compensation)."""
    a, b, gain = model
    adaptation = Adaptation()
    p = lyapunov_matrix(a, b, gain, adaptation.q)
    rows = wheels(PendulumPlantParameters())
    g = np.array(rates)

    def phi(x):
        w = rows @ x
        return np.column_stack([np.tanh(w / 0.05), w])

    def rates_of(_, z):
        x, c = z[:6], z[6:]
        return np.concatenate([(a - b @ gain) @ x + b @ phi(x) @ (c - C), -g * (phi(x).T @ b.T @ p @ x)])

    times = np.linspace(0.0, seconds, 400)
    z = solve_ivp(
        rates_of, (0.0, seconds), np.concatenate([start, [0.0, 0.0]]), "LSODA", times, rtol=1e-7, atol=1e-10
    ).y.T
    x, c = z[:, :6], z[:, 6:]
    v = np.einsum("ki,ij,kj->k", x, p, x) + ((c - C) ** 2 / g).sum(axis=1)
    return v, x, c


def test_v_decreases(model):
    v, _, _ = closed_loop(model, np.array([0.1, 0.05, 0.02, 0.0, 0.0, 0.0]), 6.0)
    assert np.diff(v).max() < 1e-6 * v[0]
    assert v[-1] < v[0]


def test_the_state_goes_to_zero_whatever_the_friction(model):
    _, x, _ = closed_loop(model, np.array([0.1, 0.05, 0.02, 0.0, 0.0, 0.0]), 20.0)
    assert np.abs(x[-1]).max() < 0.2 * np.abs(x).max()


def test_p_solves_the_lyapunov_equation(model):
    a, b, gain = model
    p = lyapunov_matrix(a, b, gain, [1, 2, 3, 4, 5, 6])
    closed = a - b @ gain
    assert np.allclose(closed.T @ p + p @ closed, -np.diag([1, 2, 3, 4, 5, 6]), atol=1e-6)
    assert np.linalg.eigvalsh(p).min() > 0.0


def test_a_feedback_that_does_not_stabilise_is_refused(model):
    a, b, gain = model
    with pytest.raises(ValueError, match="does not stabilise"):
        lyapunov_matrix(a, b, 0.0 * gain, [1] * 6)


@pytest.fixture
def block(model):
    return AdaptiveCompensator(Adaptation(coulomb_n_m=0.004, viscous_n_m_s=0.01), *model, 0.1, 0.2)


def inputs(tick, rate, s_error):
    return {"torque": [0.1, 0.2], "encoder": [tick, 0, 0, rate, rate], "error": [s_error, 0, 0],
            "tilt": [tick, 0, 0, 0], "velocity": [0, 0]}


def test_it_adds_the_expected_friction(drive, block):
    (torque,) = drive(block, "torque", [inputs(0, 10.0, 0.0)])
    assert torque == pytest.approx([0.1 + 0.004 + 0.1, 0.2 + 0.004 + 0.1])


def test_it_adds_nothing_inside_the_dead_band(drive, block):
    assert np.array_equal(drive(block, "torque", [inputs(0, 0.09, 0.0)])[0], [0.1, 0.2])


def test_nothing_adapts_near_the_equilibrium(drive, block):
    coefficients = drive(block, "coefficients", [inputs(tick, 5.0, 1e-4) for tick in range(5)])
    assert np.array_equal(coefficients[-1, :2], [0.004, 0.01])


def test_one_step_of_the_law_by_hand(drive, block, model):
    a, b, gain = model
    p = lyapunov_matrix(a, b, gain, Adaptation().q)
    x = np.array([-0.2, 0, 0, 0, 0, 0])
    pull = b.T @ p @ x
    expected = 0.004 - TICK_S * 2e-3 * pull.sum() * np.tanh(4.9 / 0.2)
    coefficients = drive(block, "coefficients", [inputs(0, 5.0, 0.2)])
    assert coefficients[0, 0] == pytest.approx(np.clip(expected, 0.0, 0.02), rel=1e-9)
    assert coefficients[0, 2] == pytest.approx(x @ p @ x)


def test_coefficients_stay_within_their_bounds(drive, block):
    rows = drive(block, "coefficients", [inputs(tick, 20.0, 5.0) for tick in range(200)])
    rows = np.vstack([rows, drive(block, "coefficients", [inputs(tick, -20.0, 5.0) for tick in range(200)])])
    assert rows[:, :2].min() >= 0.0 and (rows[:, :2] <= [0.02, 0.03]).all()


def test_faded_sign():
    assert faded_sign(0.1, 0.1, 0.2) == 0.0
    assert faded_sign(-5.0, 0.1, 0.2) == pytest.approx(-1.0)


def test_from_zero_it_finds_the_friction_of_a_robot_that_drives():
    scenario = load_scenario("pendulum_friction_excitation", ["pendulum.adaptation.enabled=true"])
    rollout = friction_rollout(scenario)
    found = rollout.run(ticks_in(60.0), rollout.with_seed(0))["pendulum_coefficients"]
    assert not found[0, :2].any()
    assert np.abs(found[-1, :2] / C - 1.0).max() < 0.25
