"""Slopes and fits of the likelihood: at bounds, with several effects, where the model runs away."""

from dataclasses import replace

import numpy as np
import pytest

from drake_ispace.explain.fit.candidates import Candidate
from drake_ispace.explain.fit.likelihood import Likelihood, covariance_of, fit
from drake_ispace.explain.fit.whitening import Whitening
from stand_ins.dense import Dense
from stand_ins.linear import Linear, Made, made, noise, pattern, streams

SHAPES = {"tilt": pattern(3), "drag": pattern(5)}
TILT, DRAG = made(*SHAPES)


def likelihood(measured, shapes=SHAPES, sizes=1.0, candidates=(TILT, DRAG), **changes):
    prediction = replace(Linear(measured, shapes), **changes)
    whitening = Whitening(prediction.residuals({}), [{}, {}])
    none = Dense(np.empty((0, len(whitening(prediction.residuals({}))))))
    return Likelihood(prediction, whitening, none, {candidate: [sizes] for candidate in candidates})


def between(low, high):
    """The effect "tilt" with these bounds."""
    effect = Made("tilt", low)
    effect.parameters = (replace(effect.parameters[0], high=high),)
    return Candidate(effect, (), effect.parameters)


def test_a_slope_is_the_change_per_natural_size():
    found = likelihood(noise(), sizes=3.0)
    w = found.whitened({TILT: [0.0]})
    (slope,) = found.slopes({TILT: [0.0]}, [(TILT, 0)], w)
    assert slope == pytest.approx(3.0 * (found.whitened({TILT: [1.0]}) - w), abs=1e-9)


@pytest.mark.parametrize("low, high, at", [
    (-100.0, 100.0, 0.0), (0.0, 100.0, 0.0), (-100.0, 0.5, 0.5), (0.0, 0.01, 0.0), (0.0, 0.01, 0.01), (-0.01, 0.0, 0.0),
    (-0.01, 0.005, 0.0),
])
def test_a_slope_stays_within_bounds(low, high, at):
    tilt, seen = between(low, high), []
    found = likelihood(noise(), candidates=(tilt,))
    straight = found.whitened({TILT: [at + 1.0]}) - found.whitened({TILT: [at]})
    whitened = found.whitened
    found.whitened = lambda point: seen.append(point[tilt][0]) or whitened(point)
    (slope,) = found.slopes({tilt: [at]}, [(tilt, 0)], whitened({tilt: [at]}))
    assert all(low <= z <= high and z != at for z in seen)
    assert slope == pytest.approx(straight, abs=1e-6)


def test_nothing_moved_has_no_slope():
    found = likelihood(noise())
    w = found.whitened({})
    assert found.slopes({}, [], w).shape == (0, len(w))


def test_a_slope_goes_the_other_way_where_the_model_runs_away():
    found = likelihood(noise())
    whitened = found.whitened
    found.whitened = lambda point: whitened(point) * (np.nan if point[TILT][0] > 0.0 else 1.0)
    w = whitened({TILT: [0.0]})
    (slope,) = found.slopes({TILT: [0.0]}, [(TILT, 0)], w)
    assert slope == pytest.approx(whitened({TILT: [1.0]}) - w, abs=1e-9)


def test_two_sizes_are_fitted_together():
    found = likelihood(noise() + 0.7 * SHAPES["tilt"] - 0.4 * SHAPES["drag"])
    best = fit(found, {TILT: [0.0], DRAG: [0.0]})
    assert best.point[TILT][0] == pytest.approx(0.7, abs=0.1) and best.point[DRAG][0] == pytest.approx(-0.4, abs=0.1)
    assert best.deviance == pytest.approx(found.deviance(found.whitened(best.point)))
    assert best.deviance < fit(found, {TILT: [0.0]}).deviance - 50.0


def test_the_uncertainty_is_that_of_least_squares():
    found = likelihood(noise() + 0.7 * SHAPES["tilt"], sizes=2.0)
    ((variance,),) = covariance_of(found, fit(found, {TILT: [0.1]}))
    size = np.sqrt(1.0 + 0.7**2)  # of the noise that was learned while the effect was missing
    assert 2.0 * np.sqrt(variance) == pytest.approx(size / np.sqrt(noise().size), rel=0.1)


def test_a_size_that_is_held_stays():
    found = likelihood(noise() + 0.7 * SHAPES["tilt"])
    best = fit(found, {TILT: [0.2], DRAG: [0.0]}, held=(TILT, 0))
    assert best.point[TILT] == [0.2] and best.point[DRAG][0] != 0.0


def test_a_size_that_changes_nothing_stays():
    """Next to nothing, as rounding has it, such as the gain of a motion sideways that no run has."""
    found = likelihood(noise() + 0.7 * SHAPES["tilt"], SHAPES | {"drag": 1e-7 * pattern(5)})
    best = fit(found, {TILT: [0.0], DRAG: [0.2]})
    assert best.point[TILT][0] == pytest.approx(0.7, abs=0.1) and best.point[DRAG] == [0.2]


class Clipped(Linear):
    """A limit of `tilt` that changes something below 2 only."""

    def residuals(self, values):
        size = values.get("tilt", {"size": np.inf})["size"]
        return streams(self.measured - max(2.0 - size, 0.0) * self.shapes["tilt"])


def test_a_limit_that_no_run_reaches_finds_back():
    effect = Made("tilt", 0.0)
    effect.parameters = (replace(effect.parameters[0], neutral=np.inf, high=np.inf, reciprocal=True),)
    limit = Candidate(effect, (), effect.parameters)
    prediction = Clipped(noise() + 0.7 * SHAPES["tilt"], SHAPES)
    found = replace(likelihood(noise()), prediction=prediction, sizes={limit: [0.2]})
    assert 1.0 / fit(found, {limit: [0.0]}).point[limit][0] == pytest.approx(1.3, abs=0.1)
    assert fit(replace(found, prediction=replace(prediction, measured=noise())), {limit: [0.0]}).point[limit][0] < 0.55


@pytest.mark.parametrize("low, high, at", [(0.0, 0.3, 0.3), (0.9, 5.0, 0.9)])
def test_a_fit_ends_on_the_bound_that_stops_it(low, high, at):
    tilt = between(low, high)
    found = likelihood(noise() + 0.7 * SHAPES["tilt"], candidates=(tilt, DRAG))
    best = fit(found, {tilt: [0.5 * (low + high)], DRAG: [0.0]})
    assert best.point[tilt] == [at] and abs(best.point[DRAG][0]) < 0.15


def test_a_start_at_which_the_model_runs_away_is_drawn_in():
    found = likelihood(noise() + 0.7 * SHAPES["tilt"])
    whitened = found.whitened
    found.whitened = lambda point: whitened(point) * (np.nan if point[TILT][0] > 3.0 else 1.0)
    assert fit(found, {TILT: [20.0]}).point[TILT][0] == pytest.approx(0.7, abs=0.1)


def test_a_deviance_and_a_log_determinant_are_those_of_noise_and_offsets_together():
    """-2 log of the density of white noise and of offsets that each have a standard deviation of one."""
    random = np.random.default_rng(4)
    found = likelihood(noise())
    w = random.standard_normal(len(found.whitened({})))
    offsets = random.standard_normal((3, len(w)))
    found = replace(found, offsets=Dense(offsets))
    covariance = np.eye(len(w)) + offsets.T @ offsets
    squares = w @ np.linalg.solve(covariance, w)
    assert found.deviance(w) == pytest.approx(squares)
    assert found.log_determinant == pytest.approx(np.linalg.slogdet(covariance)[1])
