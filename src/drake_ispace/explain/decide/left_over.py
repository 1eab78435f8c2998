"""The test for a disagreement that is still detectable once effects are named."""

from collections.abc import Sequence

import numpy as np

from drake_ispace.explain.decide.decision import Decision, LeftOver
from drake_ispace.explain.decide.detect import detect, trials
from drake_ispace.explain.decide.propose import Proposal
from drake_ispace.explain.decide.survey.generic import Generic
from drake_ispace.explain.decide.survey.survey import with_flaws
from drake_ispace.explain.decide.unknown import believed, generic_proposals


def left_over(
    decision: Decision, seed: int, proposals: Sequence[Proposal], largest: np.ndarray | None = None
) -> LeftOver | None:
    """The clearest effect, or generic disagreement as improbable as a further effect must be, beside the named ones.

    None where noise shows as much.

    Args:
        seed: of the bootstrap. proposals: effects at the end. largest: `trials` of noise at the end, where they are
            known already.
    """
    end = decision.end
    clearest = max([*proposals, *believed(end)], key=lambda proposal: proposal.minus_log10_p, default=None)
    if clearest is None:
        return None
    largest = trials(end.screen, end.by_instant, seed) if largest is None else largest
    detection = detect(clearest.minus_log10_p, largest)
    if not detection.found:
        return None
    generic = clearest.candidate.effect
    is_more = isinstance(generic, Generic) and _is_found(with_flaws(end), generic, seed)
    return LeftOver(clearest.candidate, clearest.gain, detection.p_value, is_more)


def _is_found(survey, generic, seed) -> bool:
    """Whether this generic disagreement is detectable in a Survey."""
    found = [p.minus_log10_p for p in generic_proposals(survey) if p.generic.name == generic.name]
    return bool(found) and detect(found[0], trials(survey.screen, survey.by_instant, seed)).found
