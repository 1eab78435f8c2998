"""Which effects and generic disagreements show more than noise at a survey, each by itself."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from drake_ispace.explain.decide.proposals.detect import Detection, detect, trials
from drake_ispace.explain.decide.proposals.propose import Proposal, proposals_of
from drake_ispace.explain.decide.survey.survey import (
    Survey,
    with_memory_marginalised,
    with_noise_of_nothing_more,
    with_past_speeds,
)
from drake_ispace.explain.decide.unknown import GenericProposal, believed, is_believed

_BEYOND_DOUBT = 25.0  # -log10 p, below which an alarm must hold in other surveys as well


@dataclass(frozen=True)
class Shown:
    """What shows at a survey.

    Attributes:
        detection: whether anything does. tried: effects, whether they show or not. proposals, disagreements: effects
            and generic disagreements that show, each with the least -log10 p of all surveys in which it had to.
    """

    detection: Detection
    tried: list[Proposal]
    proposals: list[Proposal]
    disagreements: list[GenericProposal]


def shown_at(survey: Survey, seed: int) -> Shown:
    """What shows at a survey; seed: of the bootstrap."""
    effects = proposals_of(survey)
    every = [*effects, *believed(survey)]
    detection, left = held(alarm_of(every, trials(survey.screen, survey.by_instant, seed)), survey, every, seed)
    proposals, disagreements = ([p for p in left if isinstance(p, kind)] for kind in (Proposal, GenericProposal))
    return Shown(detection, effects, proposals, disagreements)


def alarm_of(proposals: Sequence[Proposal | GenericProposal], largest: np.ndarray) -> Detection:
    """The Detection by the clearest of the proposals; largest: trials of noise."""
    return detect(max([proposal.minus_log10_p for proposal in proposals], default=0.0), largest)


def held(
    detection: Detection, survey: Survey, proposals: Sequence[Proposal | GenericProposal], seed: int
) -> tuple[Detection, list[Proposal | GenericProposal]]:
    """The Detection that is left of an alarm where it could be noise, and the proposals that raise it all the same.

    Where noise is far from what the filter expects, what a finite memory leaves of it can pass for an effect, and so
    can rounding where the choice of moments goes with it, and what is slow in runs so short that all effects together
    explain most of it. If the alarm is not beyond doubt, a proposal must therefore raise it by itself with the noise
    that residuals have if nothing more is missing, with its memory marginalised, and with moments chosen by past
    speeds.
    """
    if not detection.found:
        return detection, []
    left = list(proposals)
    if detection.minus_log10_p >= _BEYOND_DOUBT:
        return detection, left
    for again in _doubting(survey):
        minus_log10_p = dict(zip(again.screen.candidates, again.minus_log10_p, strict=True))
        largest = trials(again.screen, again.by_instant, seed)
        left = [replace(one, minus_log10_p=min(one.minus_log10_p, minus_log10_p[one.candidate])) for one in left]
        detection = max(detection, alarm_of(left, largest), key=lambda one: one.p_value)
        left = [p for p in left if is_believed(p.candidate, p.minus_log10_p) and detect(p.minus_log10_p, largest).found]
        if not left:
            break
    return detection, left


def _doubting(survey) -> Iterator[Survey]:
    """Surveys at the same point in which an alarm must hold."""
    with_own_noise = with_noise_of_nothing_more(survey)
    yield with_own_noise
    yield with_memory_marginalised(with_own_noise)
    yield with_past_speeds(survey)
