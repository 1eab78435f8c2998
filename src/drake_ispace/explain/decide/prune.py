"""Backward deletion: named effects without which the others do as well are taken away again."""

from collections.abc import Callable

import numpy as np

from drake_ispace.explain.decide.agreement import leads, scatter
from drake_ispace.explain.decide.decision import LEAST_FURTHER, MARGIN, NEXT_TO_NOTHING, Decision, least_further
from drake_ispace.explain.decide.proposals.propose import SHORTLIST, clearest_effects, fits_of, penalty
from drake_ispace.explain.decide.survey.survey import Survey, likelihood_with_flaws
from drake_ispace.explain.fit.candidates import Candidate
from drake_ispace.explain.fit.likelihood import Fit, Point, fit
from drake_ispace.explain.threads import each


def pruned(survey_at: Callable[..., Survey], decision: Decision) -> Decision:
    """The Decision with no more effects than needed, and with its `gains`.

    Fewer effects take the place of the named ones if they do as well. Else the effect whose loss the others make
    up for best is taken away, as long as the deviance hardly rises, or rises in some runs and falls in others, or what
    it explains is next to nothing beside what all of them explain of every sensor. Such a trace stays only if two runs
    show it, each by itself, and if it is no flaw in the form of the others. Nothing is named if the last effect
    explains less than its complexity penalty under the noise that it leaves.

    survey_at: `survey` of these runs, called with a point.
    """
    fewer = _fewer(decision)
    if fewer is not None:
        decision = refitted(survey_at, decision, fewer)
    while len(decision.named.point) > 1:
        rests = without_each(decision.end, decision.named)
        rises = {effect: rest.deviance - decision.named.deviance for effect, rest in rests.items()}
        needless = [
            effect for effect, rest in rests.items()
            if rises[effect] <= max(least_further(effect), MARGIN * scatter(decision.end, decision.named, rest))
        ]
        needless = needless or [e for e in _next_to_nothing(decision, rests) if not _is_shown(decision, rests[e], e)]
        if not needless:
            decision.gains = rises
            return decision
        decision = refitted(survey_at, decision, rests[min(needless, key=rises.get)].point)
    (last,) = decision.named.point
    if decision.total_gain < penalty(last):
        return decision.without_effects()
    decision.gains = {last: decision.total_gain}
    return decision


def _next_to_nothing(decision, rests) -> list[Candidate]:
    """The effects that explain next to nothing of every sensor beside what all named effects explain of it."""
    likelihood = decision.end.likelihood
    sensors = np.array([channel.partition(":")[0] for channel in decision.end.channels])
    with_all = likelihood.parts(decision.named.w)
    totals, found = _sums(likelihood.parts(likelihood.whitened({})) - with_all, sensors), []
    for effect, rest in rests.items():
        drops = _sums(likelihood.parts(rest.w) - with_all, sensors)
        shares = [drop / max(totals[sensor], drop) for sensor, drop in drops.items() if drop > LEAST_FURTHER]
        if max(shares, default=0.0) < NEXT_TO_NOTHING:
            found.append(effect)
    return found


def _is_shown(decision, rest, effect) -> bool:
    """Whether two runs show an effect, each by itself, and flaws in the form of the others do not stand for it."""
    end, named = decision.end, decision.named
    if np.sum(leads(end, named, rest) > MARGIN) < 2:
        return False
    others = {candidate: z for candidate, z in named.point.items() if candidate is not effect}
    flawed = likelihood_with_flaws(end, end.likelihood.raw(named.point), others)
    return fit(flawed, others).deviance - fit(flawed, named.point).deviance > least_further(effect)


def _sums(drops, groups):
    return {group: float(drops[groups == group].sum()) for group in dict.fromkeys(groups)}


def _fewer(decision) -> Point | None:
    """The fewest effects that do as well as all named ones; None if there are none.

    Of two wheels, one that is larger can first be named as two effects: both are larger, and the other is smaller.
    """
    start, named = decision.start, decision.named
    known = [candidate for candidate, _ in clearest_effects(start)]
    for count in range(1, len(named.point)):
        tried = start.screen.sets_of(known, count, start.products)[: 2 * SHORTLIST]
        best = min(fits_of(tried, start, decision.end.likelihood, iterations=6), key=lambda other: other.deviance)
        if best.deviance - named.deviance < LEAST_FURTHER:
            return best.point
    return None


def refitted(survey_at: Callable[..., Survey], decision: Decision, point: Point) -> Decision:
    """The Decision with the effects of `point` named instead, fitted under the noise that they leave.

    survey_at: `survey` of these runs, called with a point.
    """
    end = survey_at(point)
    best = fit(end.likelihood, point)
    return decision.with_named(end.moved(best), best)


def without_each(survey: Survey, named: Fit) -> dict[Candidate, Fit]:
    """Each effect of `named` -> the fit of all others, under the noise of `survey`."""
    rests = [{c: z for c, z in named.point.items() if c is not candidate} for candidate in named.point]
    return dict(zip(named.point, each(lambda rest: fit(survey.likelihood, rest), rests), strict=True))
