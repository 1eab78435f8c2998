"""Rivals: look-alikes that these runs cannot tell from a named effect."""

from drake_ispace.explain.decide.agreement import scatter
from drake_ispace.explain.decide.decision import MARGIN, Decision, Rival
from drake_ispace.explain.decide.propose import LEAST_MINUS_LOG10_P, clearest_effects, penalty, start_of
from drake_ispace.explain.fit.candidates import Candidate
from drake_ispace.explain.fit.likelihood import fits

_RELATIVE_MARGIN = 0.01  # of the total gain, which is as good as a model can be
_LEAST_LIKENESS = 0.6  # |cosine| of signatures, below which an effect is no look-alike


def rivals_of(decision: Decision) -> dict[Candidate, list[Rival]]:
    """Named effect -> its rivals. Each look-alike is fitted in its place, with the other named effects, under the noise
    of the end. How far it is behind counts in units of how its lead scatters over the runs."""
    return {effect: _rivals(decision, effect) for effect in decision.named.point}


def _rivals(decision, effect) -> list[Rival]:
    start, named, screen = decision.start, decision.named, decision.start.screen
    rest = {c: z for c, z in named.point.items() if c is not effect}
    taken = {c.name for c in named.point}
    others = [
        other for other, minus_log10_p in clearest_effects(start)
        if other.name not in taken and minus_log10_p >= LEAST_MINUS_LOG10_P
        and screen.knows(effect) and screen.alike(effect, other) >= _LEAST_LIKENESS
    ]
    starts = [{**rest, other: start_of(start, other)} for other in others]
    rivals = []
    for other, fitted in zip(others, fits(decision.end.likelihood, starts, iterations=6), strict=True):
        behind = fitted.deviance - named.deviance + penalty(other) - penalty(effect)
        limit = max(MARGIN * scatter(decision.end, named, fitted), _RELATIVE_MARGIN * decision.total_gain)
        if behind < limit and all(rival.candidate.name != other.name for rival in rivals):
            rivals.append(Rival(other, behind))
    return rivals
