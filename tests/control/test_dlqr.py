"""Discretisation and discrete LQR, with numbers by hand. The robots' own gains are in their plants' tests."""

import numpy as np
import pytest

from drake_ispace.control.feedback.dlqr import dlqr, spectral_radius, zero_order_hold

T = 0.005
DOUBLE_INTEGRATOR = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [2.0]])


def test_zero_order_hold_of_a_double_integrator():
    a_d, b_d = zero_order_hold(*DOUBLE_INTEGRATOR, T)
    np.testing.assert_allclose(a_d, [[1.0, T], [0.0, 1.0]], rtol=1e-14)
    np.testing.assert_allclose(b_d, [[T**2], [2.0 * T]], rtol=1e-14)


def test_zero_order_hold_of_an_unstable_pole():
    # dx/dt = 26 x + u: A_d = e^{26 T}, B_d = (e^{26 T} - 1)/26
    a_d, b_d = zero_order_hold(np.array([[26.0]]), np.array([[1.0]]), T)
    assert (a_d[0, 0], b_d[0, 0]) == pytest.approx((np.exp(0.13), (np.exp(0.13) - 1.0) / 26.0), rel=1e-14)


def test_holding_twice_is_holding_for_twice_as_long():
    a, b = np.random.default_rng(0).normal(size=(4, 4)), np.random.default_rng(1).normal(size=(4, 2))
    a_d, b_d = zero_order_hold(a, b, 0.1)
    a_2, b_2 = zero_order_hold(a, b, 0.2)
    np.testing.assert_allclose(a_2, a_d @ a_d, rtol=1e-12)
    np.testing.assert_allclose(b_2, a_d @ b_d + b_d, rtol=1e-12)


def test_dlqr_of_an_integrator_by_hand():
    # x+ = x + T u: p = (q + sqrt(q^2 + 4 q r/T^2))/2, k = p T/(r + p T^2)
    q, r = 3.0, 0.01
    p = (q + np.sqrt(q**2 + 4.0 * q * r / T**2)) / 2.0
    gain = dlqr(np.array([[0.0]]), np.array([[1.0]]), [q], [r], T)
    assert gain.shape == (1, 1)
    assert gain[0, 0] == pytest.approx(p * T / (r + p * T**2), rel=1e-10)


def test_weights_may_be_diagonals_or_matrices():
    by_diagonal = dlqr(*DOUBLE_INTEGRATOR, [3.0, 1.0], [0.1], T)
    by_matrix = dlqr(*DOUBLE_INTEGRATOR, np.diag([3.0, 1.0]), np.array([[0.1]]), T)
    np.testing.assert_array_equal(by_diagonal, by_matrix)


def test_no_neighbouring_gain_costs_less():
    q, r, start = np.array([3.0, 1.0]), 0.1, np.array([1.0, -0.5])
    a_d, b_d = zero_order_hold(*DOUBLE_INTEGRATOR, 0.1)

    def cost(gain):
        x, total = start, 0.0
        for _ in range(500):
            u = -gain @ x
            total += x @ (q * x) + r * u @ u
            x = a_d @ x + b_d @ u
        return total

    best = dlqr(*DOUBLE_INTEGRATOR, q, [r], 0.1)
    for change in ([0.05, 0.0], [-0.05, 0.0], [0.0, 0.05], [0.0, -0.05]):
        assert cost(best + change) > cost(best)


def test_spectral_radius_of_a_deadbeat_loop_is_zero():
    # x+ = x + T u with u = -x/T
    radius = spectral_radius(np.array([[0.0]]), np.array([[1.0]]), np.array([[1.0 / T]]), T)
    assert radius == pytest.approx(0.0, abs=1e-15)


def test_spectral_radius_without_feedback_is_the_plants_own():
    radius = spectral_radius(np.array([[26.0]]), np.array([[1.0]]), np.array([[0.0]]), T)
    assert radius == pytest.approx(np.exp(0.13), rel=1e-14)


def test_a_gain_of_the_wrong_sign_is_unstable():
    gain = dlqr(*DOUBLE_INTEGRATOR, [3.0, 1.0], [0.1], T)
    assert spectral_radius(*DOUBLE_INTEGRATOR, gain, T) < 1.0
    assert spectral_radius(*DOUBLE_INTEGRATOR, -gain, T) > 1.0
