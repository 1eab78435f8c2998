"""Generic disagreements against the effects of the library: where one explains more, the verdict is "unknown"."""

from collections.abc import Sequence
from dataclasses import dataclass

from drake_ispace.explain.decide.decision import MARGIN
from drake_ispace.explain.decide.propose import Proposal
from drake_ispace.explain.decide.survey.generic import Generic
from drake_ispace.explain.decide.survey.survey import Survey
from drake_ispace.explain.fit.candidates import Candidate

_LEAST_GAIN = 60.0  # of a generic disagreement, its complexity penalty taken off
_LEAST_LOCAL_GAIN = 120.0  # the same where it has an amplitude for every part of the room
_LEAST_MINUS_LOG10_P = 6.0  # beside named effects
_RELATIVE_MARGIN = 0.03  # of what the best effect explains


@dataclass(frozen=True)
class GenericProposal:
    """A generic disagreement that could explain the runs.

    Attributes:
        candidate: with the disagreement as its effect. gain: drop in deviance over the overdispersion; noise alone
            gains about 1 per amplitude. penalised_drop: drop in deviance less the complexity penalty, 2 per amplitude;
            to compare with an effect. minus_log10_p: of its score test.
    """

    candidate: Candidate
    gain: float
    penalised_drop: float
    minus_log10_p: float

    @property
    def generic(self) -> Generic:
        return self.candidate.effect


def believed(survey: Survey) -> list[GenericProposal]:
    """The generic disagreements that are clear enough to be believed, the largest gain first."""
    def is_clear(proposal):
        if survey.point:
            return proposal.minus_log10_p > _LEAST_MINUS_LOG10_P
        generic = proposal.generic
        return proposal.gain - 2.0 * generic.columns > (_LEAST_LOCAL_GAIN if generic.is_local else _LEAST_GAIN)

    return [proposal for proposal in generic_proposals(survey) if is_clear(proposal)]


def generic_proposals(survey: Survey) -> list[GenericProposal]:
    """All generic disagreements, the largest gain first."""
    screen = survey.screen
    proposals = []
    for candidate, minus_log10_p in zip(screen.candidates, survey.minus_log10_p, strict=True):
        if isinstance(candidate.effect, Generic):
            drop = screen.joint_drop(candidate, survey.w)
            gain = drop / screen.overdispersion_of(candidate)
            penalised_drop = drop - 2.0 * candidate.effect.columns
            proposals.append(GenericProposal(candidate, gain, penalised_drop, minus_log10_p))
    return sorted(proposals, key=lambda proposal: -proposal.gain)


def better_than(
    proposals: Sequence[Proposal], disagreements: Sequence[GenericProposal]
) -> tuple[Generic, float] | None:
    """The first generic disagreement that explains more than every proposed effect, and its gain; None if none does."""
    best = max([proposal.penalised_drop for proposal in proposals], default=0.0)
    least = best + max(MARGIN, _RELATIVE_MARGIN * best)
    return next(((other.generic, other.gain) for other in disagreements if other.penalised_drop > least), None)
