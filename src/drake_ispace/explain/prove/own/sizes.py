"""The sizes of an answer about a user's own plant: those of the filter, or those of free-run least squares?

A filter that the measured motion holds hardly feels what adds up over a run, such as a small flaw in the form of a
friction. But what unknown torques do adds up, too, and least squares takes it for the effect. Each run is therefore
simulated with sizes fitted to the others: those that come nearer are the answer's. A single run leaves none to judge
by. There least squares must take a larger share of the errors away than it mostly takes of what unknown torques do, how
strong these are not being asked. Sizes that the filter refuses more than to do without one of the effects are never
the answer's. An effect that whole runs asked for is hardly felt by the filter: sizes then count as refused where it
would rule out a rival by as much.
"""

from dataclasses import replace

import numpy as np
from scipy.signal import lfilter

from drake_ispace.blocks.rates import TICK_S
from drake_ispace.explain.decide.decision import MARGIN, Decision
from drake_ispace.explain.decide.proposals.detect import FALSE_ALARM_RATE
from drake_ispace.explain.fit.free_run import Sizes, error_of, errors_of, fitted, shifts_of, slopes
from drake_ispace.explain.predict.filters import CORRELATION_S
from drake_ispace.explain.predict.own_replay import OwnReplay
from drake_ispace.explain.predict.prediction import Prediction
from drake_ispace.explain.predict.tracks import Track
from drake_ispace.explain.prove.errors.left_out import groups_of, sizes_without


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
    if len(prediction.tracks) == 1:
        return _beats_chance(prediction, filtered, plain, seed)
    replay, tracks, squares = prediction.replay, prediction.tracks, np.zeros(2)
    for i, (point, _) in enumerate(sizes_without(decision, groups_of(decision, 1))):
        others = fitted(replay, [*tracks[:i], *tracks[i + 1 :]], point, shifts_of(point))
        for k, sizes in enumerate((others, Sizes(point, others.plant))):
            squares[k] += np.sum(errors_of(replay, [tracks[i]], sizes) ** 2)
    return bool(squares[0] < squares[1])


def _beats_chance(prediction, filtered, plain, seed) -> bool:
    """Whether least squares leaves a smaller share of the errors than of most draws of what unknown torques do."""
    replay, (track,) = prediction.replay, prediction.tracks
    at, shares = errors_of(replay, [track], filtered), []
    moved = replace(filtered, held=shifts_of(filtered.point))
    basis = np.linalg.svd(slopes(replay, [track], moved), full_matrices=False)[2]
    for draw in range(round(1.0 / FALSE_ALARM_RATE)):
        change = errors_of(replay, [pushed(replay, track, [seed, 5, draw])], filtered) - at
        shares.append(1.0 - np.sum((basis @ change) ** 2) / np.sum(change**2))
    return error_of(replay, [track], plain) ** 2 < np.median(shares) * np.mean(at**2)


def pushed(replay: OwnReplay, track: Track, seed: list[int]) -> Track:
    """The run with a draw of unknown torques, as strong as the model assumes, on every wheel."""
    keep = np.exp(-TICK_S / CORRELATION_S)
    white = np.random.default_rng(seed).standard_normal(track.command.shape)
    torque = replay.unknown_torque * lfilter([np.sqrt(1.0 - keep**2)], [1.0, -keep], white, axis=0)
    torque[: int(np.argmax(np.any(track.command != 0.0, axis=1)))] = 0.0  # a run begins with the first torque
    return replace(track, command=track.command + torque)
