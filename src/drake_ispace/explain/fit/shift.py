"""Where the fit of a shift in time begins: small changes of it say nothing of steps of the signal that are far off."""

import numpy as np

from drake_ispace.blocks.rates import TICK_S
from drake_ispace.explain.fit.candidates import Candidate
from drake_ispace.explain.fit.likelihood import Likelihood, Point, deviance_at
from drake_ispace.explain.predict.tracks import read_ticks
from drake_ispace.explain.threads import each


def with_best_shift(likelihood: Likelihood, point: Point, candidate: Candidate) -> Point:
    """The point with the candidate's one parameter, a shift in time, where the deviance is least; the rest stays.

    From tick to tick the shifted signal, and with it the residual, goes in a straight line, so that between two ticks
    the deviance is a parabola. There may be a dip in each of them. Those are looked at that lie within a read of the
    encoders of the best whole number of reads: from read to read the deviance has no dips of its own.
    """
    def deviance(z):
        return deviance_at(likelihood, {**point, candidate: [float(z)]})

    ((low, high),) = candidate.bounds
    read_s = min(read_ticks([track]) for track in likelihood.prediction.tracks) * TICK_S
    if read_s > TICK_S:
        reads = np.minimum(np.arange(low, high + read_s, read_s), high)
        nearest = reads[int(np.argmin(np.nan_to_num(each(deviance, reads), nan=np.inf)))]
        low, high = max(nearest - read_s, low), min(nearest + read_s, high)
    halves = np.arange(low, high + 0.25 * TICK_S, 0.5 * TICK_S)
    found = np.array(each(deviance, halves))
    before, within, after = found[:-2:2], found[1:-1:2], found[2::2]
    with np.errstate(invalid="ignore", divide="ignore"):  # infinite where the model runs away
        slope, bend = after - before, before + after - 2.0 * within
        at = np.nan_to_num(np.clip(np.where(bend > 0.0, -0.5 * slope / bend, np.sign(-slope)), -1.0, 1.0))
        lowest = np.nan_to_num(within + 0.5 * slope * at + 0.5 * bend * at**2, nan=np.inf)
    best = int(np.argmin(lowest))
    shift = float(halves[2 * best + 1] + 0.5 * TICK_S * at[best])
    return {**point, candidate: [shift]} if deviance(shift) < deviance(point[candidate][0]) else point
