"""Rivals: look-alikes that these runs cannot tell from a named effect."""

from dataclasses import replace

from drake_ispace.explain.decide.agreement import scatter
from drake_ispace.explain.decide.decision import MARGIN, NEXT_TO_NOTHING, Decision, Rival, margin
from drake_ispace.explain.decide.proposals.propose import clearest_effects, fits_beside, penalty
from drake_ispace.explain.decide.survey.survey import fit_with_noise
from drake_ispace.explain.fit.candidates import Candidate
from drake_ispace.explain.fit.likelihood import Fit, fit

_LEAST_LIKENESS = 0.6  # |cosine| of signatures, below which an effect is no look-alike


def with_rivals(decision: Decision) -> Decision:
    """The Decision with the rivals of its named effects.

    Each look-alike is fitted in the place of a named effect, with the others, under the noise of the end. How far it is
    behind counts in units of how its lead scatters over the runs, or as a share of what the named effect explains
    beside the others. All look-alikes share the level, for the named effect is the best of them. The noise of the end
    was learned with the named effect and favours it: one that is less than twice as far behind as this level is
    compared under the noise that it leaves itself, too, and the mean counts. One whose best size makes no sense counts
    at the nearest size that does, unless the named effect's size makes none either. A rival whose best size makes sense
    takes the place of a named effect whose size makes none, of one that does no better with more parameters, and of one
    that becomes the rival at some value of its shape. An effect that was asked for stays, and has the rivals of what
    asked for it.

    How alike two effects are is known under noise that was learned while all were missing, which may hide it. Of a
    plant of the user's own, which few effects suit, all others are fitted: one that is no further behind than noise
    makes it is a rival, too.
    """
    for effect in decision.named.point:
        if (known := decision.kept.get(effect)) is not None:
            named = {candidate.name for candidate in decision.named.point}
            decision.rivals[effect] = [rival for rival in known if rival.candidate.name not in named]
            continue
        fits_of = _rivals(decision, effect)
        decision.rivals[effect] = [rival for rival, _ in fits_of]
        if effect in decision.kept:
            continue
        better = [one for one in fits_of if one[0].candidate.makes_sense(one[1].point[one[0].candidate])]
        if effect.makes_sense(decision.named.point[effect]):
            better = [
                one for one in better if effect.generalises(one[0].candidate)
                or (one[0].behind <= 0.0 and len(one[0].candidate.parameters) < len(effect.parameters))
            ]
        if better:
            best, fitted = min(better, key=lambda one: one[0].behind)
            return with_rival_named(decision, effect, best.candidate, fitted)
    return decision


def with_rival_named(decision: Decision, effect: Candidate, rival: Candidate, fitted: Fit) -> Decision:
    """The Decision that names a rival in the place of an effect, under the same noise; fitted: with the others."""
    gains = {rival if c is effect else c: gain for c, gain in decision.gains.items()}
    return with_rivals(replace(decision.with_named(decision.end, fitted), rivals={}, gains=gains))


def _rivals(decision, effect) -> list[tuple[Rival, Fit]]:
    """The rivals of a named effect, each with its best fit, the nearest first."""
    start, named, screen = decision.start, decision.named, decision.start.screen
    rest = {c: z for c, z in named.point.items() if c is not effect}
    taken = {c.name for c in named.point}
    others = [
        other for other, _ in clearest_effects(start)
        if other.name not in taken and screen.knows(effect) and not other.generalises(effect)
    ]
    alike = [
        other for other in others
        if _changes_shape(effect, other) or screen.alike(effect, other, list(rest)) >= _LEAST_LIKENESS
    ]
    tried = alike if start.view.prediction.replay.body.robot.in_room else others
    likelihood, rivals, makes_sense = decision.end.likelihood, [], effect.makes_sense(named.point[effect])
    least = margin(len(alike))
    for other, best in zip(tried, fits_beside(rest, tried, start, likelihood, iterations=6), strict=True):
        fitted = _sensible(likelihood, other, best) if makes_sense else best
        simpler = penalty(effect) - penalty(other)
        behind, limit = fitted.deviance - named.deviance - simpler, MARGIN
        if other in alike:
            limit = max(least * scatter(decision.end, named, fitted), NEXT_TO_NOTHING * decision.gains[effect])
            if fitted is best and limit <= behind < 2.0 * least:
                limit += (behind - _behind_under_its_noise(decision, fitted) + simpler) / 2.0
        if behind < limit:
            rivals.append((Rival(other, behind, fitted.point), best))
    nearest: dict[str, tuple[Rival, Fit]] = {}  # of one effect on several wheels the best
    for one in sorted(rivals, key=lambda one: one[0].behind):
        nearest.setdefault(one[0].candidate.name, one)
    return list(nearest.values())


def _behind_under_its_noise(decision, rival) -> float:
    """By how much the deviance is larger with a rival, a Fit, than with the named effects under the noise it leaves."""
    likelihood, own = fit_with_noise(decision.end.view, rival.point)
    return own.deviance - fit(likelihood, decision.named.point).deviance


def _changes_shape(effect, other) -> bool:
    """Whether the other is a look-alike on the card of an effect that may look otherwise than when it was screened."""
    return any(p.shape for p in effect.parameters) and other.name in effect.effect.card.look_alikes


def _sensible(likelihood, candidate, best) -> Fit:
    """The fit with the candidate at the nearest size that makes sense."""
    if candidate.makes_sense(best.point[candidate]):
        return best
    point = {**best.point, candidate: candidate.sensible(best.point[candidate])}
    w = likelihood.whitened(point)
    return replace(best, point=point, deviance=likelihood.deviance(w), w=w)
