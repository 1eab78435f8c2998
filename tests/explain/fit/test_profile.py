"""Ends of an interval, on deviances whose shape is known."""

import numpy as np
import pytest

from drake_ispace.explain.fit.likelihood import Likelihood, fit
from drake_ispace.explain.fit.profile import profile_intervals
from stand_ins.dense import Dense
from stand_ins.tried import candidate

RISE = 1.645**2


class Toy(Likelihood):
    """Residuals that are a given function of all coordinates together."""

    def __init__(self, candidate, residuals):
        super().__init__(None, None, Dense(np.empty((0, 3))), {candidate: [1.0] * len(candidate.parameters)})
        self.of = residuals

    def whitened(self, point):
        (z,) = point.values()
        return self.of(np.array(z))


def interval(name, residuals, start, i=0, size=1.0):
    """(low, best, high) of coordinate i; size: natural one of each."""
    tried = candidate(name)
    toy = Toy(tried, residuals)
    toy.sizes[tried] = [size] * len(start)
    best = fit(toy, {tried: start}, iterations=30, tolerance=1e-9)
    low, high = profile_intervals(toy, best, tried, RISE)[i]
    return low, best.point[tried][i], high


def test_of_a_linear_model_it_is_the_normal_interval_others_fitted_anew():
    slopes = np.array([[30.0, 10.0], [0.0, 20.0], [5.0, -5.0]])
    low, best, high = interval("floor_tilt", lambda z: slopes @ (z - [0.02, -0.01]), [0.0, 0.0])
    half = 1.645 * np.sqrt(np.linalg.inv(slopes.T @ slopes)[0, 0])
    assert best == pytest.approx(0.02, abs=1e-6)
    assert (best - low, high - best) == pytest.approx((half, half), rel=0.04)


def test_of_a_bent_model_its_sides_differ():
    def residuals(z):
        return 5.0 * (np.exp(z[0] * 40.0) - np.exp(0.4)) * np.ones(3)

    low, best, high = interval("viscous_friction", residuals, [0.005])
    steep, flat = (np.log(np.exp(0.4) + sign * 1.645 / np.sqrt(75.0)) / 40.0 for sign in (1.0, -1.0))
    assert best == pytest.approx(0.01, rel=1e-3)
    assert (low, high) == pytest.approx((flat, steep), rel=0.04)


def test_it_ends_at_a_bound_where_nothing_objects():
    low, _, high = interval("wheel_slip", lambda z: 0.5 * (z[0] - 0.3) * np.ones(3), [0.2, 0.2])
    assert (low, high) == candidate("wheel_slip").bounds[0]


def test_it_goes_on_where_the_deviance_is_level_around_the_best():
    """As an edge of a patch that lies where no run went: it may be anywhere from there on."""
    def residuals(z):
        return 100.0 * np.minimum(z[0] - 0.4, 0.0) * np.ones(3)

    low, best, high = interval("wheel_slip", residuals, [0.6, 0.2])
    assert (best, high) == (0.6, candidate("wheel_slip").bounds[0][1])
    assert low == pytest.approx(0.4 - 1.645 / np.sqrt(3.0) / 100.0, abs=0.01)


def test_a_model_that_runs_away_ends_it():
    def residuals(z):
        return np.full(3, np.nan) if z[0] > 0.0105 else 20.0 * (z[0] - 0.01) * np.ones(3)

    low, best, high = interval("viscous_friction", residuals, [0.005])
    assert low < best <= high <= 0.0106


def saturating(z, most):
    """Residuals of slope 100 at 0.01 whose squares add up to less than most^2."""
    away = z[0] - 0.01
    return most / np.sqrt(3.0) * away * 100.0 / (most + abs(away) * 100.0) * np.ones(3)


def test_an_end_beyond_the_first_guess_is_found():
    low, best, high = interval("torque_gain_error", lambda z: saturating(z, 2.0), [0.01])
    distance = 2.0 * 1.645 / (2.0 - 1.645) / 100.0  # more than five times that of a parabola
    assert best == pytest.approx(0.01, abs=1e-6)
    assert (best - low, high - best) == pytest.approx((distance, distance), rel=0.05)


def test_a_model_that_never_objects_enough_ends_it_after_so_many_doublings():
    low, best, high = interval("torque_gain_error", lambda z: saturating(z, 1.0), [0.01])
    parabola = 1.645 / 100.0
    assert (best - low, high - best) == pytest.approx((32.0 * parabola, 32.0 * parabola), rel=0.1) or (
        low, high) == candidate("torque_gain_error").bounds[0]


@pytest.mark.filterwarnings("error")
def test_an_interval_ends_where_residuals_have_no_squares_any_more():
    """From 0.05 on they are 1e200, whatever the other coordinate, and the fit of that cannot begin."""
    def residuals(z):
        return np.array([20.0 * (z[0] - 0.01), 20.0 * z[1], 1e200 * (z[0] > 0.05)])

    low, best, high = interval("floor_tilt", residuals, [0.0, 0.0], size=0.01)
    assert best == pytest.approx(0.01, abs=1e-4) and low == pytest.approx(0.01 - 0.0823, rel=0.04)
    assert 0.047 <= high <= 0.05
