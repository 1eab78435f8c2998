"""Parameters that are not the same in every run, or at every time of a run."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import f

from drake_ispace.explain.decide.decision import Decision
from drake_ispace.explain.decide.survey.survey import Survey, blocks_of
from drake_ispace.explain.fit.likelihood import Fit
from drake_ispace.explain.levels import CHANCE, LEAST_SPREAD

_BY_RUN, _BY_HALF = "between runs", "between the halves of runs"


def drift(decision: Decision) -> list[str]:
    """A sentence for each parameter that differs by more than chance from run to run, or with time in all of them."""
    named, likelihood, residuals = decision.named, decision.end.likelihood, decision.end.residuals
    slopes = likelihood.slopes(named.point, named.order, named.w)
    marginalised = likelihood.marginalised(slopes)  # what slow forces explain of a run is no other size there
    lengths = np.diff(likelihood.whitening.starts(residuals))
    blocks = blocks_of(decision.end.view.prediction, likelihood.whitening, residuals)
    groups = {_BY_RUN: np.repeat(np.arange(len(lengths)), lengths), _BY_HALF: likelihood.whitening.late(residuals)}
    sentences = []
    for what, group in groups.items():
        parts = [group == number for number in np.unique(group)]
        sizes = [_Sizes.of(blocks[own], slopes[:, own], marginalised[:, own], named.w[own]) for own in parts]
        sentences += _in_words(sizes, named, likelihood, what)
    return sentences


def drift_by_half(named: Fit, halves: Sequence[Survey]) -> list[str]:
    """As `drift`, between the halves of all runs, by the Survey of each near the named effects.

    Each half has a noise and nuisances of its own.
    """
    sizes = []
    for half in halves:
        likelihood = half.likelihood
        slopes = likelihood.slopes(named.point, named.order, half.w)
        blocks = blocks_of(half.view.prediction, likelihood.whitening, half.residuals)
        sizes.append(_Sizes.of(blocks, slopes, likelihood.marginalised(slopes), half.w))
    return _in_words(sizes, named, halves[0].likelihood, _BY_HALF)


def _in_words(sizes, named, likelihood, what) -> list[str]:
    """A sentence for each parameter whose sizes in parts of the runs differ by more than chance."""
    sentences = []
    for k, (candidate, i) in enumerate(named.order):
        spread = _spread(*(np.array([getattr(one, of)[k] for one in sizes]) for of in ("move", "variance", "freedom")))
        value = _length(named.point[candidate], candidate, likelihood)
        if value > 0.0 and spread > LEAST_SPREAD * value:
            name = f"{candidate.parameters[i].name} of {candidate.name}"
            sentences.append(f"{name} drifts {what}, by {100 * spread / value:.0f} %")
    return sentences


def _length(z, candidate, likelihood) -> float:
    """Length of an effect's coordinates, in natural sizes: one of several may be next to nothing."""
    return float(np.linalg.norm((np.array(z) - candidate.neutral) / likelihood.sizes[candidate]))


@dataclass(frozen=True)
class _Sizes:
    """Sizes of all parameters in a part of the runs, (k,) each.

    Attributes:
        move: from the sizes in all runs, in natural sizes. variance: of it. freedom: degrees of freedom of that; 0:
            nobody knows it.
    """

    move: np.ndarray
    variance: np.ndarray
    freedom: np.ndarray

    @staticmethod
    def of(blocks, slopes, marginalised, w) -> "_Sizes":
        """By a fit of all together, as they are fitted to all runs.

        How uncertain a size is shows in what each block of rows leaves by itself: a flaw of the model, or noise that
        remembers, is the same for many rows.

        blocks: (rows,) number of each. slopes, marginalised: (k, rows) changes of the whitened residuals `w`, whole and
        without what nuisances explain of them.
        """
        inverse = np.linalg.pinv(slopes @ marginalised.T, rcond=1e-9)
        move = -inverse @ (marginalised @ w)
        firsts = np.flatnonzero(np.diff(blocks, prepend=-1))
        sums = inverse @ np.add.reduceat(marginalised * (w + move @ slopes), firsts, axis=1)
        # a parameter that only the camera shows has as many blocks as tell of it
        telling = np.add.reduceat(marginalised**2, firsts, axis=1)
        count = telling.sum(axis=1) ** 2 / np.maximum((telling**2).sum(axis=1), 1e-300)
        freedom = np.maximum(count - len(sums), 0.0)
        known = freedom > 0.0
        variance = np.divide(np.sum(sums**2, axis=1) * count, freedom, out=np.zeros(len(freedom)), where=known)
        return _Sizes(move, variance, freedom)


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
