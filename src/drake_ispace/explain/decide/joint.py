"""Name all effects that the runs support, where a model lacks several of very different size.

`decide` stops at the first remainder that is small beside what it has named. That is right where one effect is missing:
what remains then is a flaw of its fit. Somebody else's model mostly lacks several effects. `decide_jointly` adds
effects as long as any is detected, learning the noise anew after each. It then weighs each against all others together,
and takes away those that are not needed.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial

from drake_ispace.explain.decide.decision import MARGIN, Decision
from drake_ispace.explain.decide.detect import detect, trials
from drake_ispace.explain.decide.left_over import left_over
from drake_ispace.explain.decide.propose import proposals_of
from drake_ispace.explain.decide.prune import without_each
from drake_ispace.explain.decide.rivals import rivals_of
from drake_ispace.explain.decide.survey.generic import Generics, generic_signatures
from drake_ispace.explain.decide.survey.survey import Survey, survey
from drake_ispace.explain.fit.candidates import Candidate
from drake_ispace.explain.fit.likelihood import Fit, fit
from drake_ispace.explain.predict.prediction import Prediction

_MOST_EFFECTS = 6
_LEAST_SHARE = 0.01  # of what all effects explain, below which one of them is taken away again


def decide_jointly(
    prediction: Prediction, candidates: Sequence[Candidate], seed: int, pool: ThreadPoolExecutor | None,
    tell: Callable[[str], None] = lambda text: None, generics: Generics = generic_signatures,
) -> Decision:
    """Name all effects that these runs support together. What remains detectable is `left_over`, never "unknown".

    Args:
        prediction: model and runs. candidates: effects to try. seed: of the bootstrap. pool: threads that predictions
            may use. tell: called with a sentence at every step. generics: signatures of generic disagreements.
    """
    survey_at = partial(survey, prediction, candidates=candidates, pool=pool, generics=generics)
    tell("looking at every effect")
    start = current = survey_at({})
    first, named = None, None
    while len(current.point) < _MOST_EFFECTS:
        largest = trials(current.screen, current.noise, current.instants, seed)
        proposals = proposals_of(current)
        detection = detect(max((proposal.minus_log10_p for proposal in proposals), default=0.0), largest)
        first = first or detection
        leader = max(proposals, key=lambda proposal: proposal.penalised_gain, default=None)
        if leader is None or not detection.found or leader.penalised_gain < 2.0 * MARGIN:
            break
        current, named = _fitted(survey_at, leader.fit.point)
        tell(f"found {', '.join(candidate.label for candidate in named.point)}")
    if named is None:
        return Decision(first, start, start)
    decision = Decision(first, start, current, named)
    _thin(survey_at, decision, tell)
    decision.rivals = rivals_of(decision)
    decision.left_over = left_over(decision, seed)
    return decision


def _thin(survey_at, decision, tell) -> None:
    """Take effects away that the others make up for, the weakest first, and set the gains of the rest."""
    while True:
        end, named = decision.end, decision.named
        decision.total_gain = end.likelihood.deviance(end.likelihood.whitened({})) - named.deviance
        rests = without_each(end, named)
        decision.gains = {effect: rest.deviance - named.deviance for effect, rest in rests.items()}
        weakest = min(decision.gains, key=decision.gains.get)
        least = max(2.0 * MARGIN, _LEAST_SHARE * decision.total_gain)
        if len(decision.gains) == 1 or decision.gains[weakest] > least:
            return
        tell(f"taking {weakest.label} away again")
        decision.end, decision.named = _fitted(survey_at, rests[weakest].point)


def _fitted(survey_at, point) -> tuple[Survey, Fit]:
    """The effects of `point` fitted under the noise at `point`, and the survey at the fit under that noise."""
    before = survey_at(point)
    best = fit(before.likelihood, point)
    return survey_at(best.point, whitening=before.likelihood.whitening), best
