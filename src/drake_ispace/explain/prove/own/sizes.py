"""The sizes of an answer about a user's own plant: those of the filter, or those of free-run least squares?

A filter that the measured motion holds hardly feels what adds up over a run, such as a small flaw in the form of a
friction. But what unknown torques do adds up, too, and least squares takes it for the effect. Each run is therefore
simulated with sizes fitted to the others. The answer's are those of least squares if they come nearer by more than they
do by chance, that is where the filter's are the true ones and the rest is what unknown torques do, how strong these are
not being asked. A single run leaves none to judge by: there it is enough that they come nearer to the run itself than
they mostly do by chance. Sizes that the filter refuses more than to do without one of the effects are never the
answer's. An effect that whole runs asked for is hardly felt by the filter: sizes then count as refused where it would
rule out a rival by as much.
"""

from dataclasses import replace

import numpy as np

from drake_ispace.explain.decide.decision import MARGIN, Decision
from drake_ispace.explain.decide.proposals.detect import FALSE_ALARM_RATE
from drake_ispace.explain.fit.free_run import Sizes, error_of, errors_of, fitted, shifts_of, slopes
from drake_ispace.explain.predict.prediction import Prediction
from drake_ispace.explain.prove.errors.left_out import groups_of, sizes_without
from drake_ispace.explain.threads import each


def leads_nearer(prediction: Prediction, decision: Decision, filtered: Sizes, plain: Sizes, seed: int) -> bool:
    """Whether the sizes of least squares are the answer's.

    prediction: of the training runs. filtered, plain: sizes fitted to all of them. seed: of the draws.
    """
    likelihood = decision.end.likelihood
    if len(shifts_of(filtered.point)) == len(filtered.point):  # of which both are the same
        return False
    refused = likelihood.deviance(likelihood.whitened(plain.point)) - decision.named.deviance
    least = min(decision.gains.values())
    if not refused < (max(least, MARGIN) if decision.kept else least):  # nor where the model runs away with them
        return False
    replay, tracks = prediction.replay, prediction.tracks
    nearer = _squares_of(replay, tracks, decision, filtered, plain)
    if not replay.unknown_torque:  # nothing comes nearer by chance
        return nearer < 1.0
    as_rarely = FALSE_ALARM_RATE if len(tracks) > 1 else 0.5
    return bool(nearer < np.quantile(_by_chance(replay, tracks, filtered, seed), as_rarely))


def _squares_of(replay, tracks, decision, filtered, plain) -> float:
    """Squared errors of free runs with sizes by least squares over those with sizes of the filter.

    Each run has sizes that were fitted to the others; a single run has its own.
    """
    if len(tracks) == 1:
        return (error_of(replay, tracks, plain) / error_of(replay, tracks, filtered)) ** 2
    squares = np.zeros(2)
    for i, (point, _) in enumerate(sizes_without(decision, groups_of(decision, 1))):
        others = fitted(replay, [*tracks[:i], *tracks[i + 1 :]], point, shifts_of(point))
        for k, sizes in enumerate((others, Sizes(point, others.plant))):
            squares[k] += np.sum(errors_of(replay, [tracks[i]], sizes) ** 2)
    return float(squares[0] / squares[1])


def _by_chance(replay, tracks, filtered, seed) -> list[float]:
    """(draws,) squared errors by least squares over those by the filter, if the filter's sizes are the true ones.

    Unknown torques are then all that a free run is off by. To first order in the sizes.
    """
    moved = replace(filtered, held=shifts_of(filtered.point))
    by_size, runs = [slopes(replay, [track], moved) for track in tracks], range(len(tracks))
    at = [errors_of(replay, [track], filtered) for track in tracks]
    others = [[j for j in runs if j != i] or [i] for i in runs]
    told_by = [np.linalg.pinv(np.hstack([by_size[j] for j in those])) for those in others]

    def share(draw):
        """Squared errors of all runs by least squares over those by the filter, in one draw of unknown torques.

        Each run has sizes that were fitted to the others; a single run has its own.
        """
        changes = [
            errors_of(replay, [replay.disturbed(track, [seed, 5, draw, i])], filtered) - at[i]
            for i, track in enumerate(tracks)
        ]
        told = [np.concatenate([changes[j] for j in others[i]]) @ told_by[i] for i in runs]
        left = [changes[i] - told[i] @ by_size[i] for i in runs]
        return sum(np.sum(one**2) for one in left) / sum(np.sum(one**2) for one in changes)

    return each(share, range(round(1.0 / FALSE_ALARM_RATE)))
