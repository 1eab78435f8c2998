"""Name the effects that the model lacks, the one that explains most first.

Further effects are added one at a time, fitted together with those named before, as long as one is detected and lowers
the deviance enough. They are taken away again where the others suffice. Every comparison is one of deviances under the
same noise, which is learned anew with each effect: what a large effect explains says nothing of a small one.

An effect that does nearly as well as a named one is its rival. Where a generic disagreement does better than every
single effect, effects are tried all the same: first those that do best under the noises that they leave themselves,
then several together. If they do no better, the verdict is "unknown"; if they do, "unknown" is kept as the answer
should they not suffice on unseen runs.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from drake_ispace.explain.decide.decision import Decision, least_clear
from drake_ispace.explain.decide.left_over import left_over
from drake_ispace.explain.decide.proposals.propose import Proposal, penalty
from drake_ispace.explain.decide.prune import pruned, refitted, without_each
from drake_ispace.explain.decide.rivals import with_rivals
from drake_ispace.explain.decide.shown import shown_at
from drake_ispace.explain.decide.survey.generic import Generics, generic_signatures
from drake_ispace.explain.decide.survey.survey import Survey, fit_with_noise, survey
from drake_ispace.explain.decide.unknown import Doubt, believed, better_than
from drake_ispace.explain.fit.candidates import Candidate
from drake_ispace.explain.fit.likelihood import Fit, fit
from drake_ispace.explain.predict.prediction import Prediction
from drake_ispace.explain.threads import each
from drake_ispace.robots.robot import TORQUE

MOST_EFFECTS = 6
_NEAR_GAIN = 0.4  # share of the leader's, from which on another effect comes near
_MOST_NEAR = 2  # effects besides the leader that are followed


def decide(
    prediction: Prediction, candidates: Sequence[Candidate], seed: int,
    tell: Callable[[str], None] = lambda text: None, generics: Generics = generic_signatures,
) -> Decision:
    """Name effects until what remains is noise, or no effect explains it.

    Args:
        prediction: model and runs. candidates: effects to try. seed: of the bootstrap. tell: called with a sentence at
            every step. generics: signatures of generic disagreements.
    """
    survey_at = partial(survey, prediction, candidates=candidates, generics=generics)
    near_best = partial(survey_at, near=True)
    tell("looking at every effect")
    current = survey_at({})
    decision, doubt, settled = None, None, None
    while True:
        tell(f"fitting the leaders{' for what is left' if current.point else ''}")
        shown = shown_at(current, seed)
        decision = decision or Decision(shown.detection, current, current)
        unknown = better_than(shown.proposals, shown.disagreements)
        if unknown is not None and doubt is None:
            doubt = Doubt(decision, current, unknown, _leader(shown.proposals))
            if (known := _settled(near_best, doubt, shown.proposals, tell)) is not None:
                settled, doubt, shown, decision, current = doubt, None, None, known, known.end
                continue
        is_further = bool(current.point) or doubt is not None
        leader = _leader([p for p in shown.proposals if not is_further or p.minus_log10_p >= least_clear(p.candidate)])
        if leader is None or len(current.point) == MOST_EFFECTS:
            break
        if doubt is None:
            point = _best_near(current, shown.proposals, leader).point
            tell(f"looking again with {', '.join(candidate.label for candidate in point)}")
            decision, current = decision.light(), None  # two surveys at once would take twice the memory
            decision = refitted(near_best, decision, point)
        else:  # far from the best point, where the past of the residuals is mostly effects and not the noise's memory
            tell(f"looking again with {', '.join(candidate.label for candidate in leader.fit.point)}")
            decision = decision.with_named(*_far(survey_at, leader.fit.point))
        shown, current = None, decision.end
    if doubt is None or doubt.is_resolved_by(decision):
        finished = _finished(decision, near_best if doubt is None else survey_at, seed, shown)
    else:
        leaders = [] if doubt.leader is None else [doubt.leader]
        known = replace(shown, tried=leaders, proposals=leaders) if doubt.before.named is None else None
        finished = _finished(doubt.decided, near_best, seed, known)
    first = settled or doubt
    finished.otherwise = first.otherwise if first is not None and finished.named is not None else None
    return finished


def _leader(proposals) -> Proposal | None:
    """The proposal that gains most for its complexity."""
    return max(proposals, key=lambda proposal: proposal.penalised_gain, default=None)


def _far(survey_at, point) -> tuple[Survey, Fit]:
    """The survey at the fit of the effects of `point` under the noise that they leave there, and the fit."""
    before = survey_at(point)
    best = fit(before.likelihood, point)
    return survey_at(best.point, whitening=before.likelihood.whitening), best


def _settled(near_best, doubt, proposals, tell) -> Decision | None:
    """The Decision that names the effect that does best under the noises that effects leave, if that ends the doubt.

    None if it does not, or if the doubt is beside effects that are named already. Noise that was learned while an
    effect was missing may have swallowed most of it, and a disagreement with a memory of its own takes up what is left.
    """
    if doubt.leader is None or doubt.before.named is not None:
        return None
    point = _best_near(doubt.survey, proposals, doubt.leader, 0.0).point
    tell(f"looking again with {', '.join(candidate.label for candidate in point)}")
    decision = refitted(near_best, doubt.before, point)
    return decision if not believed(decision.end) and doubt.is_resolved_by(decision) else None


def _finished(decision, survey_at, seed, shown=None) -> Decision:
    """The Decision with no more effects than needed, their rivals, and what is left; shown: at its end, if known."""
    decision.naming = partial(_naming, survey_at, seed)
    if decision.named is None:
        return _with_further(decision, shown)
    end, decision = decision.end, pruned(survey_at, decision)
    if decision.named is None:
        return decision
    decision = with_rivals(decision)
    return _with_what_is_left(decision, seed, shown if decision.end is end else None)


def _with_what_is_left(decision, seed, shown=None) -> Decision:
    """The Decision with what shows beside the named effects; shown: at its end, if known."""
    shown = shown or shown_at(decision.end, seed)
    decision.left_over = left_over(decision, seed, shown)
    return _with_further(decision, shown)


def _with_further(decision, shown) -> Decision:
    """The Decision with effects to try should the named ones not suffice.

    An effect that does not show may do so on other runs. Of a single run under torque, which shows in every sample what
    is missing, how well its parts are predicted is no evidence of another kind.
    """
    prediction = decision.end.view.prediction
    is_alone = len(prediction.tracks) == 1 and prediction.replay.body.robot.driven == TORQUE
    clearest_first = sorted(shown.proposals if is_alone else shown.tried, key=lambda one: -one.minus_log10_p)
    decision.further = [p.fit.point for p in clearest_first if len(p.fit.point) <= MOST_EFFECTS]
    return decision


def _naming(survey_at, seed, decision, point) -> Decision:
    """The Decision that names the effects of `point` instead, whatever each explains."""
    other = replace(refitted(survey_at, decision, point), unknown=None, rivals={}, further=[])
    rests = without_each(other.end, other.named)
    other.gains = {effect: rest.deviance - other.named.deviance for effect, rest in rests.items()}
    return _with_what_is_left(with_rivals(other), seed)


def _best_near(
    current: Survey, proposals: Sequence[Proposal], leader: Proposal, least: float = _NEAR_GAIN
) -> Fit:
    """The fit of the leader, or of a proposal near it that does better under the noises that all of these leave.

    Under noise that was learned while an effect was missing, a look-alike may gain more than the effect. Where the
    effect is large, so is what that noise adds up to along it, by which its gain is divided: one that fits better than
    the leader is near, too. least: share of the leader's gain from which on a proposal is near.
    """
    def deviance(proposal):
        return proposal.fit.deviance + penalty(proposal.candidate)

    def is_better(proposal):
        return deviance(proposal) < deviance(leader)

    better = sorted(filter(is_better, proposals), key=deviance)
    near = [
        proposal for proposal in sorted(proposals, key=lambda proposal: -proposal.penalised_gain)
        if proposal is not leader and not is_better(proposal)
        and proposal.penalised_gain > least * leader.penalised_gain
    ]
    followed = [leader, *[*better, *near][:_MOST_NEAR]]
    settled = [fit_with_noise(current.view, proposal.fit.point) for proposal in followed]
    if len(followed) == 1:
        return settled[0][1]
    pairs = [(likelihood, own.point) for _, own in settled for likelihood, _ in settled]
    deviances = each(lambda pair: fit(*pair, iterations=4).deviance, pairs)
    means = np.reshape(deviances, (len(settled), -1)).mean(axis=1)
    best = np.argmin(means + [penalty(proposal.candidate) for proposal in followed])
    return settled[best][1]
