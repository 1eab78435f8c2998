"""Parameters that are not the same in every run."""

import itertools

import numpy as np

from drake_ispace.explain.decide.decision import Decision

_LEAST_EXCESS = 12.0  # variance between runs over what chance makes of it
_LEAST_SPREAD = 0.2  # of the value itself
_MOST_STD = 10.0  # times the least, up to which a run's estimate counts


def drift(decision: Decision) -> list[str]:
    """A sentence for each parameter of the named effects that differs from run to run by more than chance."""
    named, likelihood = decision.named, decision.end.likelihood
    slopes = likelihood.slopes(named.point, named.order, named.w)
    marginalised = likelihood.marginalised(slopes)  # what slow forces explain of a run is no other size there
    starts, sentences = likelihood.whitening.starts(decision.end.residuals), []
    for at, (candidate, i) in enumerate(named.order):
        estimates, stds = _by_run(starts, slopes[at], marginalised[at], named.w)
        known = stds < _MOST_STD * np.min(stds)
        if known.sum() < 2:
            continue
        weights = 1.0 / stds[known] ** 2
        mean = np.sum(weights * estimates[known]) / weights.sum()
        excess = np.sum(weights * (estimates[known] - mean) ** 2) / (known.sum() - 1)
        spread = np.std(estimates[known]) * likelihood.sizes[candidate][i]
        value = abs(named.point[candidate][i] - candidate.neutral[i])
        if value > 0.0 and excess > _LEAST_EXCESS and spread > _LEAST_SPREAD * value:
            name = f"{candidate.parameters[i].name} of {candidate.name}"
            sentences.append(f"{name} drifts between runs, by {100 * spread / value:.0f} %")
    return sentences


def _by_run(starts, slope, marginalised, w):
    """(runs,) estimates of a parameter by each run for itself, less that of all runs, and their standard deviations.

    slope, marginalised: (rows,) change of the whitened residuals `w`, whole and without what nuisances explain of it.
    """
    estimates, stds = [], []
    for a, b in itertools.pairwise(starts):
        squared = max(float(slope[a:b] @ marginalised[a:b]), 1e-12)
        estimates.append(-float(marginalised[a:b] @ w[a:b]) / squared)
        stds.append(1.0 / np.sqrt(squared))
    return np.array(estimates), np.array(stds)
