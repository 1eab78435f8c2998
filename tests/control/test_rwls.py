"""Recursive weighted least squares: equal to the batch, safe in floating point, calm without excitation."""

import numpy as np
import pytest

from drake_ispace.control.adaptive.rwls import recursive_least_squares, update


@pytest.fixture
def record():
    rng = np.random.default_rng(0)
    phi = rng.normal(size=(500, 3))
    theta = np.array([[1.0, -2.0], [0.5, 0.0], [3.0, 7.0]])
    return phi, phi @ theta + 0.1 * rng.normal(size=(500, 2)), theta


def test_without_forgetting_it_is_batch_least_squares(record):
    phi, y, _ = record
    theta, p, _ = recursive_least_squares(phi, y, initial_variance=1e9)
    assert np.allclose(theta, np.linalg.lstsq(phi, y, rcond=None)[0], atol=1e-8)
    assert np.allclose(p, np.linalg.inv(phi.T @ phi), rtol=1e-6)


def test_with_forgetting_it_is_least_squares_weighted_by_lambda_to_the_age(record):
    phi, y, _ = record
    # (3.21) with the weights lambda^(N - k)
    theta, _, _ = recursive_least_squares(phi, y, 0.9, initial_variance=1e9)
    weights = np.sqrt(0.9 ** np.arange(len(phi) - 1, -1, -1))[:, None]
    expected = np.linalg.lstsq(weights * phi, weights * y, rcond=None)[0]
    assert np.allclose(theta, expected, atol=1e-3)


def test_3_24_as_printed_is_no_inverse_of_the_weighted_sum():
    # [P + lambda phi phi'] against [lambda P^-1 + phi phi']^-1 for P = 1, phi = 1, lambda = 0.5
    printed, corrected = 1.0 / (1.0 + 0.5), 1.0 / (0.5 + 1.0)
    weighted_sum = 1.0 / (0.5 * 1.0 / 2.0 + 1.0)  # P(N-1) = 2
    assert 1.0 / (2.0 + 0.5) != weighted_sum
    assert printed == corrected  # only P = 1 hides it


def test_3_26_as_printed_lacks_the_innovation(record):
    phi, _, theta = record
    p, estimate = 1e3 * np.eye(3), np.zeros((3, 2))
    for row in phi:
        gain = p @ row / (1.0 + row @ p @ row)
        estimate += gain[:, None]  # as printed
        p -= np.outer(gain, row @ p)
    assert np.abs(estimate - theta).max() > 1.0


def test_scaled_regressors_give_the_same_parameters(record):
    phi, y, _ = record
    scale = np.array([1.0, 1e-3, 1e4])
    theta, p, _ = recursive_least_squares(phi * scale, y, initial_variance=1e9, scale=scale)
    assert np.allclose(theta * scale[:, None], np.linalg.lstsq(phi, y, rcond=None)[0], atol=1e-8)
    assert np.allclose(p, np.linalg.inv((phi * scale).T @ (phi * scale)), rtol=1e-6)


def test_the_covariance_stays_symmetric_and_positive_over_collinear_samples():
    rng = np.random.default_rng(1)
    common = rng.normal(size=(20000, 1))
    phi = np.hstack([common, common + 1e-9 * rng.normal(size=(20000, 1))])
    _, p, _ = recursive_least_squares(phi, common, 0.99, initial_variance=1e12, trace_limit=1e30)
    assert np.array_equal(p, p.T)
    assert np.linalg.eigvalsh(p).min() >= -1e-12 * np.trace(p)


def idle(ticks, phi):
    theta, root, scratch = np.zeros(2), np.eye(2).ravel().copy(), np.zeros(2)
    from numba import njit

    @njit
    def loop(theta, root, scratch):
        innovation = np.zeros(1)
        for _ in range(ticks):
            update(phi, innovation, 0.99, 100.0, theta, root, scratch)

    loop(theta, root, scratch)
    return root


def test_without_excitation_nothing_is_forgotten():
    assert np.array_equal(idle(100_000, np.zeros(2)), np.eye(2).ravel())


def test_with_excitation_in_one_direction_the_trace_stays_bounded():
    root = idle(100_000, np.array([1.0, 0.0]))
    assert np.isfinite(root).all() and root @ root <= 100.0 + 1e-9


def test_it_follows_a_parameter_that_changes():
    phi = np.random.default_rng(2).normal(size=(2000, 1))
    y = np.where(np.arange(2000)[:, None] < 1000, 1.0, 5.0) * phi
    theta, _, history = recursive_least_squares(phi, y, 0.98)
    assert abs(history[999, 0, 0] - 1.0) < 1e-6
    assert abs(theta[0, 0] - 5.0) < 1e-6
