"""Where the fit of several limits begins: none of them alone may lower the deviance."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from drake_ispace.effects.card import Parameter
from drake_ispace.explain.fit.candidates import Candidate
from drake_ispace.explain.fit.limits import has_several_limits, with_best_limits
from stand_ins.linear import Made


def limit(name):
    return Parameter(name, "m/s", math.inf, 0.0, math.inf, reciprocal=True)


LIMITS = Candidate(Made("limits", 0.0), (), (limit("first"), limit("second")))
PROBES = [[0.1, 0.0], [0.0, 0.5], [0.2, 0.0]]


def best(deviance, start):
    """The coordinates at which the fit begins; deviance: of both."""
    likelihood = SimpleNamespace(whitened=lambda point: np.array(point[LIMITS]), deviance=lambda w: deviance(*w))
    return with_best_limits(likelihood, {LIMITS: start}, LIMITS, PROBES)[LIMITS]


def test_two_limits_that_help_only_together_are_found():
    assert best(lambda a, b: 5.0 - 4.0 * (a == 1.0 and b == 1.5) + (a > 0.0) + (b > 0.0), [0.0, 0.0]) == [1.0, 1.5]


def test_a_start_that_is_better_than_what_is_tried_stays():
    assert best(lambda a, b: abs(a - 0.7) + b, [0.7, 0.0]) == [0.7, 0.0]


def test_between_what_is_tried_first_the_best_is_come_near_to():
    first, second = best(lambda a, b: abs(np.log(a / 0.17)) + abs(np.log(b / 3.3)) if a * b else 9.0, [0.0, 0.0])
    assert first == pytest.approx(0.17, rel=0.06) and second == pytest.approx(3.3, rel=0.06)


def test_where_the_model_runs_away_no_fit_begins():
    assert best(lambda a, b: np.inf if a else 15.0 - b, [0.0, 0.0]) == [0.0, 15.0]


def test_one_limit_alone_needs_no_such_start():
    assert has_several_limits(LIMITS)
    assert not has_several_limits(Candidate(Made("limit", 0.0), (), (limit("first"), Parameter("size", "s"))))
