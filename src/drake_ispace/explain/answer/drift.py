"""Parameters that are not the same in every run, or at every time of a run."""

import numpy as np

from drake_ispace.explain.decide.decision import Decision

_LEAST_EXCESS = 12.0  # variance of the estimates over what chance makes of it
_LEAST_SPREAD = 0.2  # of the value itself
_MOST_STD = 10.0  # times the least, up to which an estimate counts


def drift(decision: Decision) -> list[str]:
    """A sentence for each parameter that differs by more than chance from run to run, or with time in all of them."""
    named, likelihood, residuals = decision.named, decision.end.likelihood, decision.end.residuals
    slopes = likelihood.slopes(named.point, named.order, named.w)
    marginalised = likelihood.marginalised(slopes)  # what slow forces explain of a run is no other size there
    lengths = np.diff(likelihood.whitening.starts(residuals))
    groups = {
        "between runs": np.repeat(np.arange(len(lengths)), lengths),
        "between the halves of runs": likelihood.whitening.late(residuals).astype(int),
    }
    sentences = []
    for at, (candidate, i) in enumerate(named.order):
        value = abs(named.point[candidate][i] - candidate.neutral[i])
        for what, group in groups.items():
            spread = _spread(group, slopes[at], marginalised[at], named.w) * likelihood.sizes[candidate][i]
            if value > 0.0 and spread > _LEAST_SPREAD * value:
                name = f"{candidate.parameters[i].name} of {candidate.name}"
                sentences.append(f"{name} drifts {what}, by {100 * spread / value:.0f} %")
    return sentences


def _spread(group, slope, marginalised, w):
    """Standard deviation of a parameter's estimates by each group of rows for itself; 0 where chance makes as much.

    group: (rows,) number of each. slope, marginalised: (rows,) change of the whitened residuals `w`, whole and without
    what nuisances explain of it.
    """
    squared = np.maximum(np.bincount(group, slope * marginalised), 1e-12)
    estimates, stds = -np.bincount(group, marginalised * w) / squared, 1.0 / np.sqrt(squared)
    known = stds < _MOST_STD * np.min(stds)
    if known.sum() < 2:
        return 0.0
    weights, estimates = squared[known], estimates[known]
    mean = np.sum(weights * estimates) / weights.sum()
    excess = np.sum(weights * (estimates - mean) ** 2) / (known.sum() - 1)
    return float(np.std(estimates)) if excess > _LEAST_EXCESS else 0.0
