"""Does a parameter differ between groups by more than chance?"""

import numpy as np
import pytest

from drake_ispace.explain.answer.drift import _spread, drift
from drake_ispace.explain.decide.decide import decide
from stand_ins.linear import ROWS, Linear, made, no_generics, noise, pattern


@pytest.mark.parametrize(("sizes", "said"), [
    (np.array([[1.0], [2.0]]), "size of tilt drifts between runs, by"),
    (np.repeat([1.0, 2.0], ROWS // 2), "size of tilt drifts between the halves of runs, by"),
], ids=["runs", "halves"])
def test_a_size_that_is_not_the_same_in_all_rows_is_told(sizes, said):
    """With runs of a robot: test_verdict.py."""
    shapes = {"tilt": pattern(3), "drag": pattern(5)}
    runs = (Linear(noise() + size * shapes["tilt"], shapes) for size in (sizes, 1.5))
    drifting, steady = (decide(each, made(*shapes), 0, generics=no_generics) for each in runs)
    (sentence,) = drift(drifting)
    assert sentence.startswith(said) and drift(steady) == []


@pytest.mark.first_case
@pytest.mark.parametrize("freedoms", [np.full(10, 4.0), np.array([38.0] * 6 + [2.0, 1.0]), np.full(3, 40.0)])
def test_groups_that_differ_by_chance_alone_hardly_ever_do_so_by_more(freedoms):
    """Each with a variance of its own, which so few numbers tell."""
    generator, found = np.random.default_rng(0), 0
    for _ in range(1000):
        estimates = generator.standard_normal(len(freedoms))
        found += _spread(estimates, generator.chisquare(freedoms) / freedoms, freedoms) > 0.0
    assert found <= 40


def test_groups_that_differ_spread_as_far_as_they_do():
    true = np.array([-1.0, 0.0, 1.0, 2.0])
    estimates = true + 0.01 * np.random.default_rng(1).standard_normal(4)
    assert _spread(estimates, np.full(4, 1e-4), np.full(4, 30.0)) == pytest.approx(np.std(true), rel=0.05)


def test_a_group_whose_variance_nobody_knows_says_nothing():
    assert _spread(np.array([0.0, 100.0]), np.array([1.0, 0.0]), np.array([30.0, 0.0])) == 0.0


def test_a_group_that_outweighs_all_others_does_not_hide_that_they_differ():
    spread = _spread(np.array([0.0, 3.0, 5.0]), np.array([1e-40, 1.0, 1.0]), np.full(3, 30.0))
    assert spread == pytest.approx(np.sqrt((3.0**2 + 5.0**2 - 2.0) / 3.0))
