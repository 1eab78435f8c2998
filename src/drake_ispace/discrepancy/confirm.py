"""Stage 6, confirm: how much of the gap the named effects close on runs that they were not fitted to."""

import itertools
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from drake_ispace.discrepancy.candidates import Candidate
from drake_ispace.discrepancy.discriminate import Decision
from drake_ispace.discrepancy.explanation import Gap
from drake_ispace.discrepancy.likelihood import Fit, fit
from drake_ispace.discrepancy.localize import channel_rows, labels_of
from drake_ispace.discrepancy.predict import Prediction
from drake_ispace.discrepancy.survey import BLOCK_ROWS, survey

_LEAST_GAP = 12.0  # of misfit in a channel, below which there is no gap to speak of
_REPLICATES = 500
_WORSE = 1.02  # times the error before, from which on a channel got worse


@dataclass(frozen=True)
class Confirmation:
    """gaps: channel -> Gap where there is one; closed: share of the misfit's gap that is closed over all channels (None
    where there is no gap); warnings: in sentences."""

    gaps: dict[str, Gap]
    closed: float | None
    ci90: tuple[float, float] | None
    warnings: list[str]


def confirm(
    prediction: Prediction, decision: Decision, seed: int, pool: ThreadPoolExecutor | None = None
) -> Confirmation:
    """Predict held-out runs with the model as given, with the named effects as fitted before, and (the floor) with
    their sizes fitted to these very runs; each run's own offsets are fitted every time.

    prediction: of the held-out runs.
    """
    point = decision.named.point
    here = survey(prediction, point, list(point), pool)
    likelihood = here.likelihood
    before, after = likelihood.whitened({}), likelihood.whitened(point)
    best = fit(likelihood, point, iterations=6)
    labels, blocks = channel_rows(prediction, here), likelihood.whitening.instants(here.residuals, BLOCK_ROWS)
    errors = [likelihood.freed(w) ** 2 for w in (before, after, best.w)]
    generator = np.random.default_rng([seed, 2])
    draws = generator.integers(0, blocks[-1] + 1, size=(_REPLICATES, blocks[-1] + 1))
    sizes = _noise_sizes(prediction, here)
    gaps, warnings = {}, []
    for label in dict.fromkeys(labels):
        rows = labels == label
        sums = [np.bincount(blocks[rows], e[rows], minlength=blocks[-1] + 1) for e in errors]
        totals = [part.sum() for part in sums]
        scale = sizes.get(label, (1.0, ""))
        rms = [float(np.sqrt(total / rows.sum()) * scale[0]) for total in totals]
        if rms[1] > _WORSE * rms[0] and totals[1] - totals[0] > _LEAST_GAP:
            warnings.append(f"{label} got worse on the held-out runs: {rms[0]:.3g} -> {rms[1]:.3g} {scale[1]}")
        if totals[0] - totals[2] < _LEAST_GAP:
            continue
        gaps[label] = Gap(rms[0], rms[1], rms[2], _closed(rms), _interval(sums, draws), scale[1])
    everything = [np.bincount(blocks, e, minlength=blocks[-1] + 1) for e in errors]
    totals = [part.sum() for part in everything]
    closed, ci90 = None, None
    if totals[0] - totals[2] > _LEAST_GAP:
        closed, ci90 = _closed(np.sqrt(totals)), _interval(everything, draws)
        if closed < 0.5:
            warnings.append(f"only {100 * closed:.0f} % of the gap is closed on the held-out runs")
    return Confirmation(gaps, closed, ci90, warnings)


def drift(decision: Decision) -> list[str]:
    """Parameters that differ from run to run by more than chance, in sentences."""
    named, likelihood = decision.named, decision.end.likelihood
    slopes = likelihood.slopes(named.point, named.order, named.w)
    starts, found = likelihood.whitening.starts(decision.end.residuals), []
    for at, (candidate, i) in enumerate(named.order):
        estimates, stds = _by_run(starts, slopes[at], named.w)
        known = stds < 10.0 * np.min(stds)
        if known.sum() < 2:
            continue
        weights = 1.0 / stds[known] ** 2
        mean = np.sum(weights * estimates[known]) / weights.sum()
        excess = np.sum(weights * (estimates[known] - mean) ** 2) / (known.sum() - 1)
        spread = np.std(estimates[known]) * likelihood.sizes[candidate][i]
        value = abs(named.point[candidate][i] - candidate.neutral[i])
        if value > 0.0 and excess > 12.0 and spread > 0.2 * value:
            name = f"{candidate.parameters[i].name} of {candidate.name}"
            found.append(f"{name} drifts between runs, by {100 * spread / value:.0f} %")
    return found


def _by_run(starts, slope, w):
    estimates, stds = [], []
    for a, b in itertools.pairwise(starts):
        squared = max(float(slope[a:b] @ slope[a:b]), 1e-12)
        estimates.append(-float(slope[a:b] @ w[a:b]) / squared)
        stds.append(1.0 / np.sqrt(squared))
    return np.array(estimates), np.array(stds)


def on_bound(named: Fit, candidate: Candidate, i: int) -> bool:
    """Whether a coordinate was stopped by what is possible."""
    low, high = candidate.bounds[i]
    z = named.point[candidate][i]
    return z != candidate.neutral[i] and (z <= low or z >= high)


def _closed(e):
    before, after, floor = (float(value) ** 2 for value in e)
    return 1.0 - (after - floor) / max(before - floor, 1e-300)


def _interval(sums, draws):
    totals = [part[draws].sum(axis=1) for part in sums]
    gap = totals[0] - totals[2]
    known = gap > 0.05 * np.mean(gap)  # a draw without the blocks that show the gap says nothing
    if not known.any():
        return 0.0, 1.0
    low, high = np.quantile(1.0 - (totals[1] - totals[2])[known] / gap[known], [0.05, 0.95])
    return float(low), float(high)


def _noise_sizes(prediction, here):
    """Channel -> (standard deviation of its one-step prediction error, unit)."""
    found = {}
    units = {"wheel": "rad", "ax": "m/s^2", "ay": "m/s^2", "az": "m/s^2", "wx": "rad/s", "wy": "rad/s", "wz": "rad/s",
             "x": "m", "y": "m", "heading": "rad", "seen": "1"}
    for stream, noise in here.likelihood.whitening.noise.items():
        std = np.sqrt(np.sum(np.linalg.inv(noise.unit) ** 2, axis=1))
        for label, name, size in zip(labels_of(prediction, stream), prediction.channels[stream], std, strict=True):
            found[label] = (float(size), units[name.split()[0]])
    return found
