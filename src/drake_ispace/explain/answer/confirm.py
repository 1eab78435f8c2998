"""Stage 6, confirm: how much of the gap the named effects close on runs that they were not fitted to."""

import itertools
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from drake_ispace.explain.answer.explanation import Gap
from drake_ispace.explain.answer.localize import channel_rows
from drake_ispace.explain.decide.decision import Decision
from drake_ispace.explain.decide.survey import BLOCK_ROWS, survey
from drake_ispace.explain.decide.view import without
from drake_ispace.explain.fit.candidates import Candidate
from drake_ispace.explain.fit.likelihood import Fit, fit
from drake_ispace.explain.predict.prediction import Prediction

_LEAST_GAP = 12.0  # of deviance, below which there is no gap to speak of
_REPLICATES = 500
_WORSE = 1.02  # times the error before, from which on a channel got worse
_CLEAR = 0.01  # share of the draws of a bootstrap that may say the contrary
_UNITS = {
    "wheel": "rad", "ax": "m/s^2", "ay": "m/s^2", "az": "m/s^2", "wx": "rad/s", "wy": "rad/s", "wz": "rad/s", "x": "m",
    "y": "m", "heading": "rad", "seen": "1",
}


@dataclass(frozen=True)
class Confirmation:
    """gaps: channel -> Gap where there is one; closed: share of the deviance's gap that is closed over all channels (None
    where there is no gap); warnings: in sentences."""

    gaps: dict[str, Gap]
    closed: float | None
    ci90: tuple[float, float] | None
    warnings: list[str]


def confirm(
    prediction: Prediction, decision: Decision, seed: int, pool: ThreadPoolExecutor | None = None
) -> Confirmation:
    """Predict held-out runs with the model as given, with the named effects as fitted before, and (the floor) with
    their sizes fitted to these very runs. To count what is closed in all, each run's own offsets are fitted every time.

    prediction: of the held-out runs.
    """
    point = decision.named.point
    here = survey(prediction, point, list(point), pool)
    likelihood = here.likelihood
    raw = [likelihood.raw({}), likelihood.raw(point), likelihood.raw(fit(likelihood, point, iterations=6).point)]
    blocks = likelihood.whitening.instants(here.residuals, BLOCK_ROWS)

    def sums(e, rows=slice(None)):
        return np.bincount(blocks[rows], np.nan_to_num(e[rows]) ** 2, minlength=blocks[-1] + 1)

    generator = np.random.default_rng([seed, 2])
    draws = generator.integers(0, blocks[-1] + 1, size=(_REPLICATES, blocks[-1] + 1))
    gaps, warnings = {}, []
    left, labels = _left(here, raw), channel_rows(prediction, here)
    for label in dict.fromkeys(labels):
        rows = labels == label
        own, unit = [sums(e, rows) for e in left], _UNITS[label.split()[1]]
        scored = np.isfinite(left[0][rows]).sum()
        before, after, floor = (float(np.sqrt(part.sum() / max(scored, 1))) for part in own)
        if after > _WORSE * before and _is_clear(own[1] - own[0], draws):
            warnings.append(f"{label} got worse on the held-out runs: {before:.3g} -> {after:.3g} {unit}")
        if _is_clear(own[0] - own[2], draws):
            gaps[label] = Gap(before, after, floor, closed_share(own), bootstrap_interval(own, draws), unit)
    everything = [sums(likelihood.marginalised(likelihood.whitening(residuals))) for residuals in raw]
    closed, ci90 = None, None
    if everything[0].sum() - everything[2].sum() > _LEAST_GAP:
        closed, ci90 = closed_share(everything), bootstrap_interval(everything, draws)
        if closed < 0.5:
            warnings.append(f"only {100 * closed:.0f} % of the gap is closed on the held-out runs")
    return Confirmation(gaps, closed, ci90, warnings)


def _left(here, raw):
    """(rows,) of each, residuals in the channels' own units (NaN where they are not scored), less the runs' offsets as
    the last one shows them. Those of a model without the effect stand in for it, and spoil the channels that it leaves
    alone."""
    whitening, view = here.likelihood.whitening, here.view
    amounts = here.likelihood.offsets_in(whitening(raw[-1]))
    return [whitening.plain(without(residuals, amounts, view.tolerated, view.offsets)) for residuals in raw]


def _is_clear(difference, draws):
    """Whether a sum over blocks is positive beyond what the choice of blocks can do."""
    return np.quantile(difference[draws].sum(axis=1), _CLEAR) > 0.0


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


def closed_share(sums: Sequence[np.ndarray]) -> float:
    """Share of the gap that is closed; sums: (blocks,) of squared errors, before, after and at the floor."""
    before, after, floor = (float(part.sum()) for part in sums)
    return 1.0 - (after - floor) / max(before - floor, 1e-300)


def bootstrap_interval(sums: Sequence[np.ndarray], draws: np.ndarray) -> tuple[float, float]:
    """90 % interval of `closed_share`; draws: (replicates, blocks) numbers of blocks."""
    totals = [part[draws].sum(axis=1) for part in sums]
    gap = totals[0] - totals[2]
    known = gap > 0.05 * np.mean(gap)  # a draw without the blocks that show the gap says nothing
    if not known.any():
        return 0.0, 1.0
    low, high = np.quantile(1.0 - (totals[1] - totals[2])[known] / gap[known], [0.05, 0.95])
    return float(low), float(high)
