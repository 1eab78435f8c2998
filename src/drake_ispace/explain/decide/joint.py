"""Stage 4 for robots whose model lacks several effects of very different size at once, as somebody else's mostly does.

`decide` stops at the first remainder that is small beside what it has found, which is right where one effect is
missing: the rest are then flaws of its fit. Here effects are added as long as they are detected at all, noise being
learned anew after each, and only then taken away again, each weighed against all others together.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial

from drake_ispace.explain.decide.decide import MARGIN, Decision, compare, leaders, left_over, without_each
from drake_ispace.explain.decide.detect import detect, trials
from drake_ispace.explain.decide.generic import generics
from drake_ispace.explain.decide.survey import Survey, Unnamed, survey
from drake_ispace.explain.fit.candidates import Candidate
from drake_ispace.explain.fit.likelihood import fit
from drake_ispace.explain.predict.prediction import Prediction

_MOST_EFFECTS = 6
_LEAST_SHARE = 0.01  # of what all explain, below which one is taken away again


def decide_jointly(
    prediction: Prediction, tried: Sequence[Candidate], seed: int, pool: ThreadPoolExecutor | None,
    tell: Callable[[str], None] = lambda text: None, unnamed: Unnamed = generics,
) -> Decision:
    """All effects that these runs support together; arguments as `decide`. What remains detectable is `left_over`, it
    does not change the verdict."""
    look = partial(survey, prediction, tried=tried, pool=pool, unnamed=unnamed)
    tell("looking at every effect")
    start = here = look({})
    first, best = None, None
    while len(here.point) < _MOST_EFFECTS:
        limit = trials(here.screen, here.noise, here.instants, seed)
        tries = leaders(here)
        found = detect(max((t.minus_log10_p for t in tries), default=0.0), limit)
        first = first or found
        leader = max(tries, key=lambda t: t.penalised_gain, default=None)
        if leader is None or not found.found or leader.penalised_gain < 2.0 * MARGIN:
            break
        here, best = _at(look, leader.fit.point)
        tell(f"found {', '.join(c.label for c in best.point)}")
    if best is None:
        return Decision(first, start, start)
    return _thinned(look, Decision(first, start, here, best), seed, tell)


def _at(look, point) -> tuple[Survey, object]:
    """Noise and fit at the point, found in turn."""
    here = look(point)
    best = fit(here.likelihood, point)
    return look(best.point, whitening=here.likelihood.whitening), best


def _thinned(look, decision, seed, tell):
    """Backward deletion, then the rivals of what is left."""
    while True:
        here, named = decision.end, decision.named
        likelihood = here.likelihood
        decision.total_gain = likelihood.deviance(likelihood.whitened({})) - named.deviance
        rests = without_each(here, named)
        costs = {c: rest.deviance - named.deviance for c, rest in rests.items()}
        weakest = min(costs, key=costs.get)
        if len(costs) == 1 or costs[weakest] > max(2.0 * MARGIN, _LEAST_SHARE * decision.total_gain):
            break
        tell(f"taking {weakest.label} away again")
        decision.end, decision.named = _at(look, rests[weakest].point)
    decision.gains = costs
    compare(decision)
    decision.left_over = left_over(decision, seed)
    return decision
