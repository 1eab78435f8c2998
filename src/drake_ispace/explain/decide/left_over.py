"""The test for a disagreement that is still detectable once effects are named."""

from drake_ispace.explain.decide.decision import Decision, LeftOver
from drake_ispace.explain.decide.proposals.detect import detect, trials
from drake_ispace.explain.decide.shown import Shown
from drake_ispace.explain.decide.survey.generic import Generic
from drake_ispace.explain.decide.survey.survey import with_flaws
from drake_ispace.explain.decide.unknown import generic_proposals


def left_over(decision: Decision, seed: int, shown: Shown) -> LeftOver | None:
    """The clearest of what shows beside the named effects; None where noise shows as much.

    seed: of the bootstrap. shown: at the end.
    """
    every = [*shown.proposals, *shown.disagreements]
    if not every:
        return None
    clearest = max(every, key=lambda proposal: proposal.minus_log10_p)
    generic = clearest.candidate.effect
    is_more = isinstance(generic, Generic) and _is_found(with_flaws(decision.end), generic, seed)
    return LeftOver(clearest.candidate, clearest.gain, shown.detection.p_value, is_more)


def _is_found(survey, generic, seed) -> bool:
    """Whether this generic disagreement is detectable in a Survey."""
    found = [p.minus_log10_p for p in generic_proposals(survey) if p.generic.name == generic.name]
    return bool(found) and detect(found[0], trials(survey.screen, survey.by_instant, seed)).found
