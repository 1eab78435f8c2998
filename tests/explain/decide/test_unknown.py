"""Named effects resolve a generic disagreement if they explain as much under the noise that makes runs likeliest."""

from types import SimpleNamespace

import numpy as np
import pytest

from drake_ispace.explain.decide.survey.generic import Generic
from drake_ispace.explain.decide.unknown import Doubt, better_than
from drake_ispace.explain.fit.likelihood import Likelihood, fit
from stand_ins.dense import Dense
from stand_ins.linear import ROWS, Linear, generics_of, made, noise, pattern

EARLY = np.where(np.arange(ROWS) < ROWS // 2, 1.0, 0.0)
EFFECT, OTHER = pattern(1) * (1.0 - EARLY), pattern(2) * EARLY  # what the effect does late, and what it does not early
(TILT,) = made("tilt")


class Weighted:
    """Independent noise of so many standard deviations, early and late."""

    def __init__(self, early: float, late: float):
        self.weights = np.tile(EARLY / early + (1.0 - EARLY) / late, 2)

    def __call__(self, residuals):
        return self.weights * np.concatenate([run["room"][:, 0] for run in residuals])

    def scoring_as(self, other):
        return self

    def log_volume(self, residuals):
        return -2.0 * np.sum(np.log(self.weights))


def likelihood(runs: Linear, early: float, late: float) -> Likelihood:
    """Under noise of so many standard deviations."""
    whitening = Weighted(early, late)
    return Likelihood(runs, whitening, Dense(np.empty((0, 2 * ROWS)), whitening), {TILT: [1.0]})


@pytest.mark.parametrize("near_late, resolved", [(1.0, True), (20.0, False)])
def test_what_counts_is_the_noise_under_which_the_runs_are_likeliest(near_late, resolved):
    runs = Linear(noise() + EFFECT + 0.6 * OTHER, {"tilt": EFFECT})
    far, near = likelihood(runs, 1.0, 20.0), likelihood(runs, 1.0, near_late)
    (signature,) = generics_of("time", OTHER)(None, None, None)
    view = SimpleNamespace(signatures=[signature])
    start = SimpleNamespace(point={}, likelihood=far, residuals=runs.residuals({}), view=view)
    unknown = SimpleNamespace(candidate=signature.candidate, generic=signature.candidate.effect)
    decided = SimpleNamespace(named=fit(near, {TILT: [0.5]}), end=SimpleNamespace(likelihood=near))
    assert Doubt(None, start, unknown, None).is_resolved_by(decided) == resolved


def test_no_effect_resolves_nothing():
    start = SimpleNamespace(point={})
    assert not Doubt(None, start, None, None).is_resolved_by(SimpleNamespace(named=None))


@pytest.mark.parametrize("gain, said", [(990.0, "heading"), (900.0, "place")])
def test_a_simpler_disagreement_that_explains_nearly_as_much_is_said(gain, said):
    disagreements = [
        SimpleNamespace(generic=Generic(driver, "force", driver, columns), gain=drop, penalised_drop=drop)
        for driver, columns, drop in (("place", 3, 1000.0), ("heading", 2, gain))
    ]
    assert better_than([], disagreements).generic.driver == said
