"""Named effects resolve a generic disagreement if they explain as much as it, whatever the noise was learned with."""

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


def likelihood(runs: Linear, early: float, late: float) -> Likelihood:
    """Under noise of so many standard deviations."""
    weights = np.tile(EARLY / early + (1.0 - EARLY) / late, 2)
    whitening = lambda residuals: weights * np.concatenate([run["room"][:, 0] for run in residuals])  # noqa: E731
    return Likelihood(runs, whitening, Dense(np.empty((0, len(weights)))), {TILT: [1.0]})


@pytest.mark.parametrize("near_late, resolved", [(1.0, True), (20.0, False)])
def test_what_counts_is_the_mean_under_the_noise_without_and_with_the_effects(near_late, resolved):
    runs = Linear(noise() + EFFECT + 0.6 * OTHER, {"tilt": EFFECT})
    far, near = likelihood(runs, 1.0, 20.0), likelihood(runs, 1.0, near_late)
    (signature,) = generics_of("time", OTHER)(None, None, None)
    start = SimpleNamespace(point={}, likelihood=far, view=SimpleNamespace(signatures=[signature]))
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
