"""Generic disagreements against the effects of the library: where one explains more, the verdict is "unknown"."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from drake_ispace.explain.decide.decision import MARGIN, Decision
from drake_ispace.explain.decide.proposals.detect import CLEAR_MINUS_LOG10_P
from drake_ispace.explain.decide.proposals.propose import Proposal, penalty
from drake_ispace.explain.decide.survey.generic import Generic
from drake_ispace.explain.decide.survey.survey import Survey
from drake_ispace.explain.fit.candidates import Candidate
from drake_ispace.explain.fit.directions import amounts_of
from drake_ispace.explain.fit.likelihood import Likelihood, fit

_RELATIVE_MARGIN = 0.03  # of what the best effect, or disagreement, explains


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
    return [other for other in generic_proposals(survey) if is_believed(other.candidate, other.minus_log10_p)]


def is_believed(candidate: Candidate, minus_log10_p: float) -> bool:
    """Whether so clear a test of a candidate is believed: noise can show a generic disagreement, which has no form."""
    return not isinstance(candidate.effect, Generic) or minus_log10_p > CLEAR_MINUS_LOG10_P


def generic_proposals(survey: Survey) -> list[GenericProposal]:
    """All generic disagreements, the largest gain first."""
    screen = survey.screen
    proposals = []
    for candidate, minus_log10_p in zip(screen.candidates, survey.minus_log10_p, strict=True):
        if isinstance(candidate.effect, Generic):
            drop = screen.joint_drop(candidate, survey.products)
            gain = drop / screen.overdispersion_of(candidate)
            penalised_drop = drop - 2.0 * candidate.effect.columns
            proposals.append(GenericProposal(candidate, gain, penalised_drop, minus_log10_p))
    return sorted(proposals, key=lambda proposal: -proposal.gain)


@dataclass(frozen=True)
class Doubt:
    """A generic disagreement that explains more than every single effect.

    Attributes:
        before: the Decision until then. survey: at its effects. unknown: the disagreement. leader: the effect that
            explains most.
    """

    before: Decision
    survey: Survey
    unknown: GenericProposal
    leader: Proposal | None

    @property
    def decided(self) -> Decision:
        """The Decision until then, and the disagreement as the answer where nothing is named."""
        if self.before.named is not None:
            return self.before
        nearest = None if self.leader is None else (self.leader.candidate, self.leader.gain)
        return replace(self.before, unknown=(self.unknown.generic, self.unknown.gain), nearest=nearest)

    @property
    def otherwise(self) -> Decision | None:
        """The disagreement as the answer should effects that end the doubt not suffice; None where some were named."""
        return self.decided if self.before.named is None else None

    def is_resolved_by(self, decision: Decision) -> bool:
        """Whether the effects that `decision` names explain as much.

        Noise that was learned without effects forgets too little where these are large, and noise that was learned with
        them favours them. The effects count under whichever of both makes the runs likelier with them, and so does the
        disagreement in their place.
        """
        added = [] if decision.named is None else [c for c in decision.named.point if c not in self.survey.point]
        if not added:
            return False
        first, last = self.survey.likelihood, decision.end.likelihood
        both = [_scoring_as(first, last), _scoring_as(last, first)]
        totals = np.array([self._totals(one, decision.named.point) for one in both])
        named, generic = totals[:, 1:].min(axis=0)
        drop = np.ptp(totals[totals[:, 1].argmin(), :2])
        named += sum(penalty(c) for c in added)
        generic += 2.0 * self.unknown.generic.columns
        return bool(named <= generic + max(MARGIN, _RELATIVE_MARGIN * drop))

    def _totals(self, likelihood, named) -> np.ndarray:
        """-2 log likelihood of the runs before, with the effects of `named`, and with the disagreement in their place.
        """
        w = likelihood.whitening(self.survey.residuals)
        signatures = [s for s in self.survey.view.signatures if s.candidate == self.unknown.candidate]
        changes = [likelihood.whitening(s.change) for s in signatures]
        gram = likelihood.products(np.vstack([changes, w]))
        drop = float(gram[:-1, -1] @ amounts_of(gram[:-1, :-1], gram[:-1, -1]))
        before, after = likelihood.deviance(w), fit(likelihood, named).deviance
        constant = likelihood.log_determinant + likelihood.whitening.log_volume(self.survey.residuals)
        return constant + np.array([before, after, before - drop])


def _scoring_as(likelihood, other) -> Likelihood:
    """The Likelihood on what `other` scores as well, with the memory of the noise left in."""
    whitening = likelihood.whitening.scoring_as(other.whitening)
    return replace(likelihood, whitening=whitening, offsets=replace(likelihood.offsets, whitening=whitening), memory=())


def better_than(
    proposals: Sequence[Proposal], disagreements: Sequence[GenericProposal]
) -> GenericProposal | None:
    """The first generic disagreement that explains more than every proposed effect; None if none does.

    One with fewer amplitudes that explains nearly as much stands in its place.
    """
    best = max([proposal.penalised_drop for proposal in proposals], default=0.0)
    least = best + max(MARGIN, _RELATIVE_MARGIN * best)
    clear = [other for other in disagreements if other.penalised_drop > least]
    near = [other for other in clear if other.gain >= (1.0 - _RELATIVE_MARGIN) * clear[0].gain]
    return min(near, key=lambda other: other.generic.columns, default=None)
