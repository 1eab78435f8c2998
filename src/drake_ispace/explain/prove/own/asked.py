"""A further effect that free-run simulations of a user's own plant ask for.

A filter that the measured motion holds hardly feels what adds up over a run, such as a small friction of one wheel.
Each run is therefore simulated with every effect in turn, whose size is fitted to the other runs. What is left of the
error is mostly one slow motion of each wheel in each run, so that two squared errors are compared as those of so many
independent numbers.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import f as fisher

from drake_ispace.explain.decide.decision import MARGIN, Asked, Decision, Rival
from drake_ispace.explain.decide.proposals.detect import FALSE_ALARM_RATE
from drake_ispace.explain.decide.survey.view import scales_of
from drake_ispace.explain.decide.validate import start_of
from drake_ispace.explain.fit.candidates import Candidate
from drake_ispace.explain.fit.free_run import Sizes, errors_of, fitted, shifts_of
from drake_ispace.explain.fit.likelihood import deviance_at
from drake_ispace.explain.predict.own_replay import OwnReplay
from drake_ispace.explain.predict.prediction import Prediction
from drake_ispace.explain.predict.tracks import Track
from drake_ispace.explain.prove.errors.left_out import in_parts
from drake_ispace.explain.threads import each

_SHARES = (1.0, 0.25, 0.0625)  # of its largest usual size, from the best of which a fit of an effect begins


def asked_for_own(prediction: Prediction, decision: Decision, is_lacking: bool) -> Asked | None:
    """The effect beside the named ones with which the model leads nearest to runs that no size was fitted to.

    The model without it must be clearly further off, and the filter must not refuse it. Effects that neither free runs
    nor the filter can tell from it are its rivals. A single run is cut into blocks.

    Args:
        prediction: of the training runs. decision: with the named effects, if any. is_lacking: whether it is known that
            something is missing. Else an effect must be clearer, because many are tried.

    Returns:
        None where no effect is as clear, or where there is nothing to leave out.
    """
    replay, tracks = prediction.replay, in_parts(prediction).tracks
    named = {} if decision.named is None else decision.named.point
    likelihood, taken = decision.end.likelihood, {candidate.name for candidate in named}
    tried = [candidate for candidate in likelihood.sizes if candidate.name not in taken]
    if len(tracks) < 2 or not tried:
        return None
    enough_by = clearly(FALSE_ALARM_RATE / (1 if is_lacking else len(tried)), replay, tracks)
    alike = clearly(FALSE_ALARM_RATE, replay, tracks)
    base, scales = fitted(replay, tracks, named, shifts_of(named)), scales_of(prediction)
    enough = _left_out(replay, tracks, base) / enough_by
    refused = max(deviance_at(likelihood, point) for point in (named, base.point)) + MARGIN

    def found_with(candidate):
        """The Sizes with this effect, what they leave when each run is left out, and the deviance; None: no rival."""
        sizes = _fitted(replay, tracks, base, candidate, scales)
        z = sizes.point[candidate]
        if not candidate.makes_sense(z) or candidate.has_become_another(z):
            return None
        if _squared(replay, tracks, sizes) > alike * enough:  # nor will it be less with runs left out
            return None
        deviance = deviance_at(likelihood, sizes.point)
        return (sizes, _left_out(replay, tracks, sizes), deviance) if deviance < refused + MARGIN else None

    found = {c: one for c, one in zip(tried, each(found_with, tried), strict=True) if one is not None}
    nearest_first = sorted(found, key=lambda candidate: found[candidate][1])
    best = next((candidate for candidate in nearest_first if found[candidate][2] < refused), None)
    if best is None or found[best][1] >= enough:
        return None
    sizes, least, deviance = found[best]
    rivals = {}  # of an effect on one wheel, the wheel that does best
    for other in nearest_first:
        _, left, others = found[other]
        if other.name != best.name and left < alike * least and others < deviance + MARGIN:
            rivals.setdefault(other.name, Rival(other, others - deviance))
    return Asked(best, sizes.point, list(rivals.values()))


def clearly(level: float, replay: OwnReplay, tracks: Sequence[Track]) -> float:
    """The ratio of two squared errors of these runs that is exceeded by chance with the probability `level`."""
    numbers = len(tracks) * replay.body.wheels
    return float(fisher.isf(level, numbers, numbers))


def _fitted(
    replay: OwnReplay, tracks: Sequence[Track], named: Sizes, candidate: Candidate, scales: Mapping[str, float]
) -> Sizes:
    """The Sizes that come nearest with a further effect, from the best of a few sizes of either sign.

    From one that is far too large the model runs away, and dry friction can hold it on the wrong side.
    """
    usual = start_of([candidate], scales)[candidate]

    def at(share):
        """The effect at a share of its largest usual size; what gives it a shape stays."""
        z = []
        for parameter, size, neutral, (low, high) in zip(
            candidate.parameters, usual, candidate.neutral, candidate.bounds, strict=True
        ):
            z.append(size if parameter.shape else min(max(neutral + share * (size - neutral), low), high))
        return replace(named, point={**named.point, candidate: z})

    begun = [at(sign * share) for share in _SHARES for sign in (1.0, -1.0)]
    return fitted(replay, tracks, min(begun, key=lambda sizes: _squared(replay, tracks, sizes)).point, named.held)


def _left_out(replay: OwnReplay, tracks: Sequence[Track], sizes: Sizes) -> float:
    """Sum of the squared errors of all runs, each with sizes that are fitted to the others."""
    total = 0.0
    for i, track in enumerate(tracks):
        others = fitted(replay, [*tracks[:i], *tracks[i + 1 :]], sizes.point, sizes.held)
        total += _squared(replay, [track], others)
    return total


def _squared(replay: OwnReplay, tracks: Sequence[Track], sizes: Sizes) -> float:
    """Sum of the squared errors of runs."""
    return float(np.sum(errors_of(replay, tracks, sizes) ** 2))
