"""Backward deletion: named effects without which the others do as well are taken away again."""

from collections.abc import Callable

import numpy as np

from drake_ispace.explain.decide.decision import LEAST_FURTHER, MARGIN, Decision
from drake_ispace.explain.decide.propose import SHORTLIST, clearest_effects
from drake_ispace.explain.decide.survey.survey import Survey
from drake_ispace.explain.fit.candidates import Candidate
from drake_ispace.explain.fit.likelihood import Fit, Point, fit

_LEAST_RISE = max(2.0 * MARGIN, LEAST_FURTHER)  # of the deviance, for which an effect is kept
_LEAST_SHARE = 0.01  # of what all named effects explain of a sensor, below which one of them is taken away


def pruned(survey_at: Callable[..., Survey], decision: Decision) -> Decision:
    """The Decision with no more effects than needed, and with its `gains`.

    A single effect takes the place of all named ones if it does as well. Else the effect whose loss the others make
    up for best is taken away, as long as the deviance hardly rises, or what it explains is next to nothing beside what
    all of them explain of every sensor: that may be a flaw of their form.

    survey_at: `survey` of these runs, called with a point.
    """
    single = _one_for_all(decision) if len(decision.named.point) > 1 else None
    if single is not None:
        decision = _with_named(survey_at, decision, single)
    while len(decision.named.point) > 1:
        rests = without_each(decision.end, decision.named)
        rises = {effect: rest.deviance - decision.named.deviance for effect, rest in rests.items()}
        shares = _shares(decision, rests)
        needless = [e for e in rises if rises[e] <= _LEAST_RISE or shares[e] < _LEAST_SHARE]
        if not needless:
            decision.gains = rises
            return decision
        decision = _with_named(survey_at, decision, rests[min(needless, key=rises.get)].point)
    decision.gains = {next(iter(decision.named.point)): decision.total_gain}
    return decision


def _shares(decision, rests) -> dict[Candidate, float]:
    """Largest share, over the sensors, that an effect has in what all named effects explain of a sensor."""
    likelihood = decision.end.likelihood
    sensors = np.array([channel.partition(":")[0] for channel in decision.end.channels])
    with_all = likelihood.parts(decision.named.w)
    totals, shares = _by_sensor(likelihood.parts(likelihood.whitened({})) - with_all, sensors), {}
    for effect, rest in rests.items():
        drops = _by_sensor(likelihood.parts(rest.w) - with_all, sensors)
        clear = [s for s in drops if drops[s] > _LEAST_RISE]
        shares[effect] = max((drops[s] / max(totals[s], drops[s]) for s in clear), default=0.0)
    return shares


def _by_sensor(drops, sensors):
    return {sensor: float(drops[sensors == sensor].sum()) for sensor in dict.fromkeys(sensors)}


def _one_for_all(decision) -> Point | None:
    """A single effect that does as well as all named ones.

    Of two wheels, one that is larger can first be named as two effects: both are larger, and the other is smaller.
    """
    start, likelihood = decision.start, decision.end.likelihood
    fits = [
        fit(likelihood, {candidate: start.screen.start(candidate, start.w)}, iterations=6)
        for candidate, _ in clearest_effects(start)[: 2 * SHORTLIST]
    ]
    best = min(fits, key=lambda single: single.deviance)
    return best.point if best.deviance - decision.named.deviance < _LEAST_RISE else None


def _with_named(survey_at, decision, point) -> Decision:
    """The Decision with the effects of `point` named instead, fitted under the noise that they leave."""
    end = survey_at(point)
    return decision.with_named(end, fit(end.likelihood, point))


def without_each(survey: Survey, named: Fit) -> dict[Candidate, Fit]:
    """Each effect of `named` -> the fit of all others, under the noise of `survey`."""
    return {
        candidate: fit(survey.likelihood, {c: z for c, z in named.point.items() if c is not candidate})
        for candidate in named.point
    }
