"""Does a parameter differ between groups by more than chance?"""

from types import SimpleNamespace

import numpy as np
import pytest

from drake_ispace.explain.answer.drift import _spread, drift_by_half
from drake_ispace.explain.decide.survey.survey import survey
from stand_ins.linear import Linear, made, no_generics, noise, pattern


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


@pytest.mark.parametrize(("sizes", "are_told"), [((1.0, 0.2), True), ((0.6, 0.6), False), ((0.65, 0.55), False)])
def test_a_size_that_is_another_in_the_second_half_is_told(sizes, are_told):
    (slip,) = made("slip")
    named = SimpleNamespace(point={slip: [0.6]}, order=[(slip, 0)])
    halves = [Linear(size * pattern(1) + noise(k), {"slip": pattern(1)}) for k, size in enumerate(sizes)]
    surveys = [survey(half, named.point, [slip], generics=no_generics) for half in halves]
    assert [said.split(",")[0] for said in drift_by_half(named, surveys)] == are_told * [
        "size of slip drifts between the halves of runs"
    ]
