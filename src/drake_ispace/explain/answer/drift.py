"""Parameters that are not the same in every run, or at every time of a run."""

import numpy as np
from scipy.stats import f

from drake_ispace.explain.decide.decision import Decision
from drake_ispace.explain.decide.survey.survey import blocks_of
from drake_ispace.explain.levels import CHANCE, LEAST_SPREAD


def drift(decision: Decision) -> list[str]:
    """A sentence for each parameter that differs by more than chance from run to run, or with time in all of them."""
    named, likelihood, residuals = decision.named, decision.end.likelihood, decision.end.residuals
    slopes = likelihood.slopes(named.point, named.order, named.w)
    marginalised = likelihood.marginalised(slopes)  # what slow forces explain of a run is no other size there
    lengths = np.diff(likelihood.whitening.starts(residuals))
    blocks = blocks_of(decision.end.view.prediction, likelihood.whitening, residuals)
    groups = {
        "between runs": np.repeat(np.arange(len(lengths)), lengths),
        "between the halves of runs": likelihood.whitening.late(residuals).astype(int),
    }
    sentences = []
    for what, group in groups.items():
        spreads = _spreads(group, blocks, slopes, marginalised, named.w)
        for (candidate, i), spread in zip(named.order, spreads, strict=True):
            value = _length(named.point[candidate], candidate, likelihood)
            if value > 0.0 and spread > LEAST_SPREAD * value:
                name = f"{candidate.parameters[i].name} of {candidate.name}"
                sentences.append(f"{name} drifts {what}, by {100 * spread / value:.0f} %")
    return sentences


def _length(z, candidate, likelihood) -> float:
    """Length of an effect's coordinates, in natural sizes: one of several may be next to nothing."""
    return float(np.linalg.norm((np.array(z) - candidate.neutral) / likelihood.sizes[candidate]))


def _spreads(group, blocks, slopes, marginalised, w):
    """(k,) standard deviation of each parameter over the groups, each fitted for itself; 0 where chance makes as much.

    All parameters are fitted together, as they are in all runs. How uncertain an estimate is shows in what each block
    of rows leaves by itself: a flaw of the model, or noise that remembers, is the same for many rows.

    group, blocks: (rows,) number of each. slopes, marginalised: (k, rows) changes of the whitened residuals `w`, whole
    and without what nuisances explain of them.
    """
    moves, variances, freedoms = [], [], []
    for number in range(int(group.max()) + 1):
        own = group == number
        slope, change, rest = slopes[:, own], marginalised[:, own], w[own]
        inverse = np.linalg.pinv(slope @ change.T, rcond=1e-9)
        moves.append(-inverse @ (change @ rest))
        firsts = np.flatnonzero(np.diff(blocks[own], prepend=-1))
        sums = inverse @ np.add.reduceat(change * (rest + moves[-1] @ slope), firsts, axis=1)
        # a parameter that only the camera shows has as many blocks as tell of it
        telling = np.add.reduceat(change**2, firsts, axis=1)
        count = telling.sum(axis=1) ** 2 / np.maximum((telling**2).sum(axis=1), 1e-300)
        free = np.maximum(count - len(sums), 0.0)
        freedoms.append(free)
        variances.append(np.divide(np.sum(sums**2, axis=1) * count, free, out=np.zeros(len(free)), where=free > 0.0))
    columns = (np.transpose(one) for one in (moves, variances, freedoms))
    return [_spread(*each) for each in zip(*columns, strict=True)]


def _spread(estimates, variances, freedoms):
    """Standard deviation of what is estimated, by the method of moments of DerSimonian and Laird; 0 where chance makes
    as much, by Welch's analysis of variance.

    freedoms: degrees of freedom of each variance; 0: nobody knows it.
    """
    known = (freedoms > 0.0) & (variances > 0.0)
    if known.sum() < 2:
        return 0.0
    weights, estimates, freedoms = 1.0 / variances[known], estimates[known], freedoms[known]
    groups, by_chance = len(weights), len(weights) - 1
    squares = np.sum(weights * (estimates - np.average(estimates, weights=weights)) ** 2)
    doubt = np.sum((1.0 - weights / weights.sum()) ** 2 / freedoms) / (groups**2 - 1.0)
    ratio = squares / by_chance / (1.0 + 2.0 * (groups - 2.0) * doubt)
    if f.sf(ratio, by_chance, 1.0 / (3.0 * doubt)) >= CHANCE:
        return 0.0
    variance = (squares - by_chance) / np.sum(weights * (1.0 - weights / weights.sum()))
    return float(np.sqrt(variance * by_chance / groups))
