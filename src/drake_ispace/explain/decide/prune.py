"""Backward deletion: named effects without which the others do as well are taken away again."""

from collections.abc import Callable

from drake_ispace.explain.decide.decision import LEAST_FURTHER, MARGIN, Decision
from drake_ispace.explain.decide.propose import SHORTLIST, clearest_effects
from drake_ispace.explain.decide.survey.survey import Survey
from drake_ispace.explain.fit.candidates import Candidate
from drake_ispace.explain.fit.likelihood import Fit, Point, fit

_LEAST_RISE = max(2.0 * MARGIN, LEAST_FURTHER)  # of the deviance, for which an effect is kept


def pruned(survey_at: Callable[..., Survey], decision: Decision) -> Decision:
    """The Decision with no more effects than needed, and with its `gains`.

    A single effect takes the place of all named ones if it does as well. Else the effect whose loss the others make
    up for best is taken away, as long as the deviance hardly rises. What may be a flaw of their form is marginalised.

    survey_at: `survey` of these runs, called with a point.
    """
    single = _one_for_all(decision) if len(decision.named.point) > 1 else None
    if single is not None:
        decision = _with_named(survey_at, decision, single)
    while len(decision.named.point) > 1:
        rests = without_each(decision.end, decision.named)
        rises = {effect: rest.deviance - decision.named.deviance for effect, rest in rests.items()}
        needless = [effect for effect, rise in rises.items() if rise <= _LEAST_RISE]
        if not needless:
            decision.gains = rises
            return decision
        decision = _with_named(survey_at, decision, rests[min(needless, key=rises.get)].point)
    decision.gains = {next(iter(decision.named.point)): decision.total_gain}
    return decision


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
