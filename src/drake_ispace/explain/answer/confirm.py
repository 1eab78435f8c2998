"""Stage 4, proof: how much of the gap the named effects close on held-out runs, to which they were not fitted.

Three models predict the held-out runs: the model as given ("before"), the model with the effects in the sizes fitted to
the training runs ("after"), and the model with the same effects refitted to the held-out runs ("refitted"). The gap is
the part of the squared error that these effects can take away on the held-out runs at all, from "before" to
"refitted". The share of it that "after" takes away is closed:

    closed = 1 - (after^2 - refitted^2) / (before^2 - refitted^2)

What no size of these effects explains is in "refitted" too, and therefore not in the gap.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from drake_ispace.explain.answer.explanation import Explanation, Gap
from drake_ispace.explain.answer.localize import channel_rows
from drake_ispace.explain.decide.decision import Decision
from drake_ispace.explain.decide.survey.survey import BLOCK_ROWS, survey
from drake_ispace.explain.decide.survey.view import without
from drake_ispace.explain.decide.validate import Choice
from drake_ispace.explain.fit.free_run import channel_of, errors, fitted, rms, unit_of
from drake_ispace.explain.fit.likelihood import fit, merged
from drake_ispace.explain.predict.case import Case

_LEAST_GAP = 12.0  # drop in deviance below which there is no gap to speak of
_REPLICATES = 500
_WORSE = 1.02  # ratio of the error after to the error before, above which a channel got worse
_CLEAR = 0.01  # share of the bootstrap's draws that may say the contrary
_LEAST_CLOSED = 0.5  # share below which the answer warns
_UNITS = {
    "wheel": "rad", "ax": "m/s^2", "ay": "m/s^2", "az": "m/s^2", "wx": "rad/s", "wy": "rad/s", "wz": "rad/s", "x": "m",
    "y": "m", "heading": "rad", "seen": "1",
}


def confirm(
    answer: Explanation, case: Case, decision: Decision | Choice, seed: int, pool: ThreadPoolExecutor | None = None
) -> None:
    """Add the gap on the held-out runs to the answer: by channel, the share closed over all, and warnings.

    seed: of the bootstrap.
    """
    if isinstance(decision, Choice):
        _confirm_free_runs(answer, case, decision, seed)
    else:
        _confirm_innovations(answer, case, decision, seed, pool)


def _confirm_innovations(answer, case, decision, seed, pool):
    """The gap between innovations: errors of prediction from one sample to the next.

    The whitened residuals of all channels decide how much is closed over all; each model's offsets of a run (of its
    IMU, say) are marginalised there.
    """
    prediction, point = case.held_out, decision.named.point
    at_end = survey(prediction, point, list(point), pool)
    likelihood = at_end.likelihood
    raw = [likelihood.raw({}), likelihood.raw(point), likelihood.raw(fit(likelihood, point, iterations=6).point)]
    blocks = likelihood.whitening.instants(at_end.residuals, BLOCK_ROWS)

    def sums(e, rows=slice(None)):
        return np.bincount(blocks[rows], np.nan_to_num(e[rows]) ** 2, minlength=blocks[-1] + 1)

    generator = np.random.default_rng([seed, 2])
    draws = generator.integers(0, blocks[-1] + 1, size=(_REPLICATES, blocks[-1] + 1))
    warnings = []
    plain, labels = _in_units(at_end, raw), channel_rows(prediction, at_end)
    for label in dict.fromkeys(labels):
        rows = labels == label
        own, unit = [sums(e, rows) for e in plain], _UNITS[label.split()[1]]
        scored = np.isfinite(plain[0][rows]).sum()
        before, after, refitted = (float(np.sqrt(part.sum() / max(scored, 1))) for part in own)
        if after > _WORSE * before and _is_clear(own[1] - own[0], draws):
            warnings.append(f"{label} got worse on the held-out runs: {before:.3g} -> {after:.3g} {unit}")
        if _is_clear(own[0] - own[2], draws):
            interval = bootstrap_interval(own, draws)
            answer.gap[label] = Gap(before, after, refitted, closed_share(own), interval, unit)
    everything = [sums(likelihood.marginalised(likelihood.whitening(residuals))) for residuals in raw]
    if everything[0].sum() - everything[2].sum() > _LEAST_GAP:
        answer.closed = closed_share(everything)
        if answer.closed < _LEAST_CLOSED:
            warnings.append(f"only {100 * answer.closed:.0f} % of the gap is closed on the held-out runs")
    answer.warnings = warnings + answer.warnings


def _in_units(at_end, raw):
    """(rows,) residuals of each model in the channels' own units, less the runs' offsets; NaN where not scored.

    The offsets are those that the refitted model shows. The offsets of a model without the effect would stand in for
    the effect, and spoil the channels that the effect does not touch.
    """
    whitening, view = at_end.likelihood.whitening, at_end.view
    amounts = at_end.likelihood.offsets_in(whitening(raw[-1]))
    return [whitening.plain(without(residuals, amounts, view.tolerated, view.offsets)) for residuals in raw]


def _is_clear(difference, draws):
    """Whether a sum over blocks is positive beyond what the choice of blocks can do."""
    return np.quantile(difference[draws].sum(axis=1), _CLEAR) > 0.0


def _confirm_free_runs(answer, case, choice, seed):
    """The gap between free-run simulations of a plant of the user's own; none where the effects do not help at all.

    To refit is to fit the effects and the plant's free parameters to the held-out runs. The bootstrap draws runs.
    """
    replay, tracks = case.replay, case.held_out.tracks
    refitted = fitted(replay, tracks, choice.sizes.point)
    differences = [
        [errors(replay, track, merged(sizes.point), sizes.plant) for track in tracks]
        for sizes in (choice.base, choice.sizes, refitted)
    ]
    sums = [np.array([np.sum(run**2) for run in model]) for model in differences]
    if sums[0].sum() <= sums[2].sum():
        return
    draws = np.random.default_rng([seed, 2]).integers(0, len(tracks), size=(_REPLICATES, len(tracks)))
    rms_errors = [rms(np.concatenate([run.ravel() for run in model])) for model in differences]
    interval = bootstrap_interval(sums, draws) if len(tracks) > 1 else (np.nan, np.nan)
    answer.closed = closed_share(sums)
    answer.gap = {channel_of(replay): Gap(*rms_errors, answer.closed, interval, unit_of(replay))}


def closed_share(sums: Sequence[np.ndarray]) -> float:
    """Share of the gap that is closed.

    sums: (blocks,) sums of squared errors of each model: before, after, refitted.
    """
    before, after, refitted = (float(part.sum()) for part in sums)
    return 1.0 - (after - refitted) / max(before - refitted, 1e-300)


def bootstrap_interval(sums: Sequence[np.ndarray], draws: np.ndarray) -> tuple[float, float]:
    """90 % interval of `closed_share`.

    sums: as for `closed_share`. draws: (replicates, blocks) numbers of blocks.
    """
    totals = [part[draws].sum(axis=1) for part in sums]
    gap = totals[0] - totals[2]
    known = gap > 0.05 * np.mean(gap)  # a draw without the blocks that show the gap says nothing
    if not known.any():
        return 0.0, 1.0
    low, high = np.quantile(1.0 - (totals[1] - totals[2])[known] / gap[known], [0.05, 0.95])
    return float(low), float(high)
