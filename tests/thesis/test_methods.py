"""Each model structure recovers what its noise model promises, and plain least squares does not."""

import dataclasses

import numpy as np
import pytest
from scipy.signal import lfilter

import control
from drake_ispace.blocks.errors import InputError
from drake_ispace.thesis.methods.armax import armax
from drake_ispace.thesis.methods.armaxd import armaxd
from drake_ispace.thesis.methods.arx import arx, recursive_arx
from drake_ispace.thesis.methods.instrumental import instrumental, reference_instruments
from drake_ispace.thesis.methods.oe import oe, simulate_oe
from drake_ispace.thesis.structures import Problem, error_index, time_series

A, B = np.array([-1.5, 0.7]), np.array([1.0, 0.5])  # Ljung's example


def data(noise, count=20000, seed=0, c=()):
    """y of A y = B u + C e ("equation") or y = B/A u + e ("output")."""
    rng = np.random.default_rng(seed)
    u, e = rng.normal(size=count), 0.5 * rng.normal(size=count)
    clean = lfilter(np.concatenate([[0.0], B]), np.concatenate([[1.0], A]), u)
    if noise == "none":
        return clean, u
    if noise == "output":
        return clean + 2.0 * e, u
    return clean + lfilter(np.concatenate([[1.0], c]), np.concatenate([[1.0], A]), e), u


def truth():
    return np.concatenate([A, B])


def test_time_series_regressor_by_hand():
    problem = time_series(np.arange(5.0), 10.0 * np.arange(5.0), na=2, nb=1, delay=1)
    assert problem.names == ("-y1(t-1)", "-y1(t-2)", "u1(t-1)")
    assert np.array_equal(problem.regressor[0], [-1.0, -0.0, 10.0])
    assert np.array_equal(problem.target[:, 0], [2.0, 3.0, 4.0])


def test_too_few_samples_are_refused():
    with pytest.raises(InputError, match="3 samples are too few for na = 3"):
        time_series(np.zeros(3), np.zeros(3), 3, 1)


def test_arx_without_noise_is_exact():
    assert np.allclose(arx(time_series(*data("none"), 2, 2)).theta[:, 0], truth(), atol=1e-10)


def test_arx_with_white_equation_noise_lies_in_its_interval():
    low, high = arx(time_series(*data("equation"), 2, 2)).interval(0.999)
    assert np.all(low[:, 0] < truth()) and np.all(truth() < high[:, 0])


def test_recursive_arx_ends_at_the_batch():
    problem = time_series(*data("equation", 2000), 2, 2)
    assert np.allclose(recursive_arx(problem).theta, arx(problem).theta, atol=1e-5)


def test_dependent_regressors_are_reported():
    problem = time_series(*data("none", 500), 2, 2)
    twice = dataclasses.replace(
        problem, names=(*problem.names, "again"), regressor=problem.regressor[:, [0, 1, 2, 3, 0]]
    )
    assert arx(twice).notes == ("only 4 of 5 regressors are independent",)


def test_armax_finds_the_moving_average_that_biases_arx():
    problem = time_series(*data("equation", 100_000, c=[0.8]), 2, 2)
    estimate = armax(problem)
    assert np.abs(arx(problem).theta[:4, 0] - truth()).max() > 0.05
    assert np.abs(estimate.theta[:4, 0] - truth()).max() < 0.02
    assert abs(estimate.theta[estimate.names.index("e_y1(t-1)"), 0] - 0.8) < 0.05


def test_oe_is_unbiased_under_output_noise_that_biases_arx():
    y, u = data("output")
    assert np.abs(arx(time_series(y, u, 2, 2)).theta[:, 0] - truth()).max() > 0.2
    estimate = oe(y, u, 2, 2)
    assert np.abs(estimate.theta[:, 0] - truth()).max() < 0.03
    assert np.all(np.abs(estimate.theta[:, 0] - truth()) < 4.0 * estimate.std[:, 0])


def test_simulated_output_by_hand():
    # y(t) = 0.5 y(t-1) + 2 u(t-1), an impulse
    impulse = np.array([[1.0], [0], [0], [0]])
    assert np.allclose(simulate_oe(impulse, np.array([[2.0]]), np.array([-0.5])), [0, 2, 1, 0.5])


def test_arx_agrees_with_markov_parameters_of_python_control():
    y, u = data("none", 500)
    theta = arx(time_series(y, u, 2, 2)).theta[:, 0]
    impulse = np.zeros(30)
    impulse[0] = 1.0
    ours = lfilter(np.concatenate([[0.0], theta[2:]]), np.concatenate([[1.0], theta[:2]]), impulse)
    record = control.TimeResponseData(np.arange(500), y[None, :], inputs=u[None, :], issiso=True)
    theirs = np.ravel(control.markov(record, 120))
    assert np.abs(ours - theirs[:30]).max() < 1e-3


def test_arx_agrees_with_sysidentpy():
    pytest.importorskip("sysidentpy", reason="the extra [describe] is not installed")
    from sysidentpy.basis_function import Polynomial
    from sysidentpy.model_structure_selection import FROLS
    from sysidentpy.parameter_estimation import LeastSquares

    y, u = data("equation", 1000)
    model = FROLS(
        order_selection=False, n_terms=4, ylag=2, xlag=2, basis_function=Polynomial(degree=1), estimator=LeastSquares()
    )
    model.fit(X=u[:, None], y=y[:, None])
    ours = np.abs(arx(time_series(y, u, 2, 2)).theta[:, 0])
    assert np.allclose(np.sort(np.abs(np.ravel(model.theta))), np.sort(ours), atol=1e-6)


def closed_loop(count=40000, seed=0):
    """x' = -x + 2 u under u = r - 3 (x + n): the measured x carries the noise that u answers to. Truth: (-1, 2)."""
    rng = np.random.default_rng(seed)
    dt, x = 0.01, 0.0
    r = np.sign(np.sin(2.0 * np.pi * np.arange(count) * dt / 5.0))
    noise = 0.3 * rng.normal(size=count)
    rows = np.empty((count, 3))
    for k in range(count):
        u = r[k] - 3.0 * (x + noise[k])
        slope = -x + 2.0 * u
        rows[k] = x + noise[k], u, slope
        x += dt * slope
    return Problem(("x", "u"), ("x_dot",), rows[:, :2], rows[:, 2:], 1.0 / dt, r)


def test_instrumental_variables_are_unbiased_in_closed_loop_where_least_squares_is_not():
    problem, actual = closed_loop(), np.array([-1.0, 2.0])
    assert np.abs(arx(problem).theta[:, 0] - actual).max() > 0.1
    estimate = instrumental(problem)
    assert np.abs(estimate.theta[:, 0] - actual).max() < 0.05
    assert np.all(np.abs(estimate.theta[:, 0] - actual) < 4.0 * estimate.std[:, 0])


def test_instrumental_intervals_cover():
    inside = []
    for seed in range(12):
        low, high = instrumental(closed_loop(5000, seed)).interval(0.95)
        inside.append((low[:, 0] < [-1.0, 2.0]) & ([-1.0, 2.0] < high[:, 0]))
    assert np.mean(inside) > 0.8


def test_a_reference_that_rests_is_refused():
    with pytest.raises(InputError, match="need a reference that moves"):
        instrumental(dataclasses.replace(closed_loop(1000), reference=np.zeros(1000)))


def test_a_regressor_that_the_reference_does_not_move_is_reported():
    problem = closed_loop(4000)
    noise = np.random.default_rng(5).normal(size=(4000, 1))
    more = dataclasses.replace(problem, names=("x", "u", "n"), regressor=np.hstack([problem.regressor, noise]))
    assert any("weak instrument" in note and note.endswith("of n") for note in instrumental(more).notes)


def test_instruments_are_a_function_of_the_reference_alone():
    r = np.array([0.0, 1.0, 1.0])
    assert reference_instruments(r, 100.0, (0.1,)).shape == (3, 3)
    assert np.array_equal(reference_instruments(r, 100.0, (0.1,))[0], [1.0, 0.0, 0.0])


def test_a_separator_above_half_the_rate_is_refused():
    with pytest.raises(InputError, match="a cut-off of 740 Hz needs more than 1480 samples a second"):
        armaxd(Problem(("a",), ("b",), np.ones((9, 1)), np.ones((9, 1)), 200.0))


def test_armaxd_without_noise_is_exact():
    rng = np.random.default_rng(0)
    phi = np.cumsum(rng.normal(size=(20000, 2)), axis=0) * 0.01
    theta = np.array([[1.0, -3.0], [2.0, 0.5]])
    estimate = armaxd(Problem(("a", "b"), ("y", "z"), phi, phi @ theta, 2000.0))
    assert np.allclose(estimate.theta[:2], theta, atol=1e-3)


def test_error_index_takes_one_where_the_truth_is_zero():
    assert error_index([0.02, 1.1, 1.0], [0.0, 1.0, 1.0]) == pytest.approx((2.0 + 10.0 + 0.0) / 3.0)


PRINTED = {  # (3.69)-(3.72)
    "arx": ([[0.0173, 1.166], [1.262, -12.71]], [-1.672, 37.71]),
    "armaxd": ([[0.0172, 1.169], [1.255, -12.48]], [-1.697, 36.08]),
}


@pytest.mark.parametrize(("method", "six", "eight"), [("arx", 28.4, 22.5), ("armaxd", 26.8, 20.6)])
def test_printed_matrices_do_not_give_the_printed_index(method, six, eight):
    a, b = PRINTED[method]
    found, actual, actual_b = [*np.ravel(a), *b], [0.0, 1.21, 0.0, -9.87, -1.73, 35.39], [-1.73, 35.39]
    assert error_index(found, actual) == pytest.approx(six, abs=0.06)
    assert error_index([*found, *b], [*actual, *actual_b]) == pytest.approx(eight, abs=0.06)
