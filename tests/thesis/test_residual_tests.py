"""Tests of residuals: white noise passes, anything else does not."""

import numpy as np
import pytest
from scipy.signal import lfilter

from drake_ispace.thesis.methods.arx import arx
from drake_ispace.thesis.methods.residual_tests import ljung_box, residual_tests
from drake_ispace.thesis.structures import Problem


def problem(noise, seed=0, quadratic=0.0):
    rng = np.random.default_rng(seed)
    u = rng.normal(size=(5000, 1))
    e = noise(rng.normal(size=5000))
    lagged = np.concatenate([[0.0], u[:-1, 0]])
    return Problem(("u",), ("y",), u, (2.0 * u[:, 0] + e + quadratic * lagged)[:, None], 1.0)


def white(e):
    return e


def test_white_residuals_pass_both_tests():
    (test,) = residual_tests(arx(problem(white)))
    assert test.white and test.independent


def test_coloured_residuals_are_not_white():
    (test,) = residual_tests(arx(problem(lambda e: lfilter([1.0], [1.0, -0.5], e))))
    assert not test.white and test.independent


def test_a_delayed_influence_that_the_model_lacks_correlates():
    (test,) = residual_tests(arx(problem(white, quadratic=0.5)))
    assert not test.independent


def test_one_in_a_hundred_is_refused_wrongly():
    p = [ljung_box(np.random.default_rng(seed).normal(size=500), 10)[1] for seed in range(400)]
    assert np.mean(np.array(p) < 0.01) < 0.03 and 0.4 < np.mean(p) < 0.6


def test_ljung_box_by_hand():
    # [1, -1, 1, -1]: r_1 = -3/4, Q = 4 * 6 * (9/16) / 3
    assert ljung_box(np.array([1.0, -1.0, 1.0, -1.0]), 1)[0] == pytest.approx(4.5)


def test_ljung_box_agrees_with_statsmodels():
    diagnostic = pytest.importorskip("statsmodels.stats.diagnostic", reason="statsmodels is not installed")
    residual = np.random.default_rng(3).normal(size=300)
    theirs = diagnostic.acorr_ljungbox(residual, lags=[10])
    q, p = ljung_box(residual, 10)
    assert (q, p) == pytest.approx((theirs.lb_stat.iloc[0], theirs.lb_pvalue.iloc[0]))
