"""The mistakes of a channel's clock, over all runs together."""

from dataclasses import replace

import numpy as np

from drake_ispace.explain.check.compare.agreement import RELATED, SAID
from drake_ispace.explain.check.compare.clocks.far import far_jumps, far_offsets
from drake_ispace.explain.check.compare.clocks.latencies import other_latencies
from drake_ispace.explain.check.compare.clocks.paths import LAGS_S, OFFSET, Path, descended, is_at_end, least, rates_of
from drake_ispace.explain.check.compare.clocks.trial import Links, trials_of
from drake_ispace.explain.check.finding import Finding
from drake_ispace.robots.robot import COMMAND


def clocks(links: Links) -> list[Finding]:
    """The mistakes of one channel's clock: the same in all runs if that explains as much as one of each run's own."""
    trials = trials_of(links)
    far = list(far_offsets(trials))
    jumps = [] if far else list(far_jumps(trials))
    if far or jumps:
        set_by = {trial.number for trial, _, _ in (*far, *jumps)}
        others = clocks([one for one in links if one[0] not in set_by])
        return [*_far(far), *(trial.finding(path, 2.0 * gain) for trial, path, gain in jumps), *others]
    own = [(trial, best) for trial, best in ((trial, trial.best()) for trial in trials) if best.gain >= SAID]
    apart = sum(best.gain - SAID for _, best in own)  # each of them must be worth what is said of a fault
    common = _common(trials, [best.path for _, best in own]) if len(trials) > 1 else None
    if common is not None:
        gains = [trial.gain(common) for trial in trials]
        if sum(gains) - SAID >= max(0.0, apart) and min(gains) > -SAID:
            finding = trials[int(np.argmax(gains))].finding(common, 2.0 * sum(gains))
            return [replace(finding, runs=tuple(trial.number for trial in trials))]
    drift = _common_drift(trials)
    for paths in (drift, [_as_one_clock(trials, drift)] * len(trials)) if drift else ():
        gains = [trial.gain(path) for trial, path in zip(trials, paths, strict=True)]
        # a steady motion shows no drift but a gain, and runs of the same motion show as little
        if sum(gains) - SAID * len(set(paths)) >= max(0.0, apart) and min(gains) > -SAID:
            lasts_s = max(trial.lasts_s for trial in trials)
            drift = _tilted_alike(drift, lasts_s, [trial.unlikely for trial in trials])
            return [trial.finding(path, 2.0 * sum(gains)) for trial, path in zip(trials, drift, strict=True)]
    if len(own) < len(trials):  # the other clocks are right, and motion that comes again looks alike a period later
        own = [
            (trial, best) for trial, best in own
            if best.path.fault != OFFSET or not trial.peaks_as_given
            or best.gain >= RELATED * trial.scores([best.path])[0]
        ]
    found = [trial.finding(best.path, 2.0 * best.gain, best.rivals) for trial, best in own]
    if found or not trials or trials[0].link.channel not in ("kinect", COMMAND):
        return found
    scores = [trial.of_latencies() for trial in trials]
    return list(other_latencies(trials[0].link.channel, [trial.number for trial in trials], scores))


def _far(far):
    """Findings of the trials, offsets and gains of `far_offsets`: one where it is the same in several runs."""
    found = []
    for path in dict.fromkeys(path for _, path, _ in far):
        same = [(trial, gain) for trial, of_trial, gain in far if of_trial == path]
        (clearest, _), gain = max(same, key=lambda one: one[1]), sum(gain for _, gain in same)
        finding = clearest.finding(path, 2.0 * gain)
        found.append(replace(finding, runs=tuple(trial.number for trial, _ in same)))
    return found


def late_since(links: Links, at_s: float) -> tuple[float, float]:
    """By how much [s] all channels of a run are late against its wheels from a moment on, and the drop in deviance.

    Zeros: they are not, or were so before. links: of one run.
    """
    later = trials_of([(i, link.only(link.since_s >= at_s), base) for i, link, base in links])
    common = _common(later, []) if later else None
    if common is None:
        return 0.0, 0.0
    gains = [trial.gain(common) for trial in later]
    if sum(gains) < SAID or min(gains) <= -SAID:
        return 0.0, 0.0
    earlier = trials_of([(i, link.only(link.until_s < at_s), base) for i, link, base in links])
    if sum(trial.gain(common) for trial in earlier) > 0.0:
        return 0.0, 0.0
    return -common.lag_s, 2.0 * sum(gains)


def _common_drift(trials):
    """For each run its best offset with the drift that all runs may share; empty where they are too short."""
    if len(trials) < 2:
        return []
    longest, shortest = (of(trials, key=lambda trial: trial.lasts_s) for of in (max, min))
    rates = [rate for rate in rates_of(longest.lasts_s) if shortest.is_drift(rate)]
    if not rates:
        return []
    rate = min(rates, key=lambda rate: sum(trial.along(rate)[0] for trial in trials))
    rough = [trial.rough for trial in trials]
    paths = [least(trial.along(rate)[1].shifted(), of) for trial, of in zip(trials, rough, strict=True)]
    paths = _tilted_alike(paths, longest.lasts_s, rough)
    return paths if shortest.is_drift(paths[0].rate) else []


def _as_one_clock(trials, drift):
    """The path along which the clock of all runs drifts as it does in each, if it is one that runs on."""
    first = drift[0]
    starts = [path.lag_s + path.rate * (first.middle_s - path.middle_s) for path in drift]
    near = replace(first, lag_s=float(np.median(starts))).shifted()
    return least(near, lambda paths: np.sum([trial.unlikely(paths) for trial in trials], axis=0))


def _tilted_alike(paths, lasts_s, losses_of):
    """The path of each run with the rate that is best for all together, and its best lag; losses_of: of each run."""
    tilted = [path.tilted(lasts_s) for path in paths]
    losses = sum(of(near) for of, near in zip(losses_of, tilted, strict=True))
    best = descended(losses, paths[0].number_in(tilted[0]))
    return [least(near[best].shifted(), of) for of, near in zip(losses_of, tilted, strict=True)]


def _common(trials, own):
    """The constant offset that all runs may share, the best one together or that of one run; None: a mere latency."""
    best = int(np.argmin(np.sum([trial.total for trial in trials], axis=0)))
    offsets = [] if is_at_end(best) else [float(LAGS_S[best])]
    offsets += [path.lag_s for path in own if path.fault == OFFSET]
    paths = [Path(lag) for lag in offsets if not trials[0].link.is_usual(lag)]
    if not paths:
        return None
    path = max(paths, key=lambda path: sum(trial.gain(path) for trial in trials))
    return least(path.shifted(), lambda near: np.sum([trial.of_same_windows(near) for trial in trials], axis=0))
