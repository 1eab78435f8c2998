"""A further effect that free-run simulations of a user's own plant ask for.

A filter that the measured motion holds hardly feels what adds up over a run, such as a small constant torque beside
slow noise. Each run is therefore simulated with every effect in turn, whose size is fitted to the other runs. What is
left of the error is mostly one slow motion of each wheel in each run, so that two squared errors are compared as those
of so many independent numbers.
"""

from collections.abc import Sequence

import numpy as np
from scipy.stats import f as fisher

from drake_ispace.explain.decide.decision import MARGIN, Asked, Decision, Rival
from drake_ispace.explain.decide.detect import FALSE_ALARM_RATE
from drake_ispace.explain.decide.survey.view import scales_of
from drake_ispace.explain.decide.validate import start_of
from drake_ispace.explain.fit.candidates import Candidate
from drake_ispace.explain.fit.free_run import Sizes, errors_of, fitted
from drake_ispace.explain.fit.likelihood import deviance_at
from drake_ispace.explain.predict.own_replay import OwnReplay
from drake_ispace.explain.predict.prediction import Prediction
from drake_ispace.explain.predict.tracks import Track
from drake_ispace.explain.prove.left_out import in_parts
from drake_ispace.explain.threads import each

_SHARES = (1.0, 0.25, 0.0625)  # of its largest usual size, from which a fit of an effect may begin


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
    if len(tracks) < 2:
        return None
    named = {} if decision.named is None else decision.named.point
    likelihood, taken = decision.end.likelihood, {candidate.name for candidate in named}
    tried = [candidate for candidate in likelihood.sizes if candidate.name not in taken]
    numbers = len(tracks) * replay.body.wheels
    level = FALSE_ALARM_RATE if is_lacking else FALSE_ALARM_RATE / max(len(tried), 1)
    clearly, alike = fisher.isf([level, FALSE_ALARM_RATE], numbers, numbers)  # ratios of squared errors
    base = fitted(replay, tracks, named)
    before, refused = _left_out(replay, tracks, base), deviance_at(likelihood, named) + MARGIN
    scales = scales_of(prediction)

    def found_with(candidate):
        """The Sizes with this effect, what they leave when each run is left out, and the deviance; None: no answer."""
        sizes = _fitted(replay, tracks, base, candidate, scales)
        z = sizes.point[candidate]
        if not candidate.makes_sense(z) or candidate.has_become_another(z):
            return None
        if clearly * _squared(replay, tracks, sizes) > before:  # nor will it with runs left out
            return None
        deviance = deviance_at(likelihood, sizes.point)
        return (sizes, _left_out(replay, tracks, sizes), deviance) if deviance < refused else None

    found = {c: one for c, one in zip(tried, each(found_with, tried), strict=True) if one is not None}
    best = min(found, key=lambda candidate: found[candidate][1], default=None)
    if best is None or clearly * found[best][1] > before:
        return None
    sizes, least, deviance = found[best]
    rivals = {}  # of an effect on one wheel, the wheel that does best
    for other in sorted(found, key=lambda candidate: found[candidate][1]):
        if found[other][1] < alike * least and found[other][2] < deviance + MARGIN and other.name != best.name:
            rivals.setdefault(other.name, Rival(other, found[other][2] - deviance))
    return Asked(best, sizes.point, list(rivals.values()))


def _fitted(replay, tracks, named, candidate: Candidate, scales) -> Sizes:
    """The Sizes that come nearest with a further effect, from the best of a few sizes: from one that is far too large
    the model runs away, and dry friction can hold it on the wrong side."""
    start, neutral, bounds = start_of([candidate], scales)[candidate], candidate.neutral, candidate.bounds

    def at(share):
        """The effect at a share of its largest usual size, the shape of it as it is there."""
        moved = [z if p.shape else n + share * (z - n) for z, n, p in zip(start, neutral, candidate.parameters, strict=True)]
        within = [min(max(z, low), high) for z, (low, high) in zip(moved, bounds, strict=True)]
        return Sizes({**named.point, candidate: within}, named.plant)

    tried = [at(sign * share) for share in _SHARES for sign in (1.0, -1.0)]
    best = min(tried, key=lambda sizes: _squared(replay, tracks, sizes))
    return fitted(replay, tracks, best.point)


def _left_out(replay: OwnReplay, tracks: Sequence[Track], sizes: Sizes) -> float:
    """Sum of the squared errors of all runs, each with sizes that are fitted to the others."""
    total = 0.0
    for i, track in enumerate(tracks):
        others = fitted(replay, [*tracks[:i], *tracks[i + 1 :]], sizes.point)
        total += _squared(replay, [track], others)
    return total


def _squared(replay: OwnReplay, tracks: Sequence[Track], sizes: Sizes) -> float:
    """Sum of the squared errors of runs."""
    return float(np.sum(errors_of(replay, tracks, sizes) ** 2))
