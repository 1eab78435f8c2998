"""Do the clocks of the channels agree? Offsets, drifts and jumps against the wheels' clock.

Motion itself is the clock: what a channel says of it is compared with what the wheels say some time earlier or later.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from drake_ispace.explain.check.compare.agreement import RELATED, SAID, following
from drake_ispace.explain.check.compare.latencies import other_latencies
from drake_ispace.explain.check.compare.links import (
    FEWEST,
    LATENCIES_S,
    LATENCY_S,
    RATE_S,
    Base,
    Link,
    inside,
    lags,
    moves,
)
from drake_ispace.explain.check.compare.losses import losses
from drake_ispace.explain.check.compare.regression import most, scores
from drake_ispace.explain.check.finding import Finding
from drake_ispace.faults.repair import Clock
from drake_ispace.robots.robot import COMMAND

LATEST_S = 5.0  # by which a clock may be off that is looked for
_LAGS_S = lags(LATEST_S, RATE_S)
_FASTEST = 0.05  # rate at which a clock may drift
_INTERVAL = 1.35  # loss of log likelihood at the ends of a 90 % interval


@dataclass(frozen=True)
class Path:
    """Times t of a channel on the wheels' clock: t + lag_s + rate (t - middle_s), and later_s more from jump_s on."""

    lag_s: float = 0.0
    rate: float = 0.0
    middle_s: float = 0.0
    later_s: float = 0.0
    jump_s: float = np.inf

    def at(self, t: np.ndarray) -> np.ndarray:
        """(n,) times [s] on the wheels' clock."""
        return t + self.lag_s + self.rate * (t - self.middle_s) + np.where(t >= self.jump_s, self.later_s, 0.0)


class _Trial:
    """A channel of one run under other clocks.

    loss (lags, windows): of each window, less that without any relation. peaks_as_given: whether no lag nearby would do
    better than one that a sound channel may have.
    """

    def __init__(self, number: int, link: Link, base: Base):
        self.number, self.link, self.base = number, link, base
        off = _LAGS_S[:, None]
        self.loss = losses(link, base, link.since_s + off, link.until_s + off)
        self.total = np.nansum(self.loss, axis=1)
        self.middle_s = 0.5 * float(link.since_s[0] + link.until_s[-1])
        self.lasts_s = float(link.until_s[-1] - link.since_s[0])
        self.usual = link.is_usual(_LAGS_S)
        at = int(np.argmin(self.total[self.usual]))
        usual, self.peaks_as_given = _LAGS_S[self.usual][at], 0 < at < self.usual.sum() - 1
        near = usual + LATENCIES_S[link.is_usual(usual + LATENCIES_S)]
        self.given = max(0.0, *self.scores([Path(float(lag)) for lag in near], must_follow=False))

    def scores(self, paths: Sequence[Path], must_follow: bool = True) -> list[float]:
        """For each path the log likelihood along it over that without any relation, of the windows inside of the run.

        0 where the channel follows the wheels too little to tell the time, if it must follow them.
        """
        since, until = (np.stack([path.at(t) for path in paths]) for t in (self.link.since_s, self.link.until_s))
        inner, found = inside(self.base, since, until), np.zeros(len(paths))
        for kept in np.unique(inner, axis=0):
            if kept.sum() >= FEWEST:
                same = np.flatnonzero((inner == kept).all(axis=1))
                there = since[same][:, kept], until[same][:, kept]
                found[same] = self._scored(*there, self.link.measured[kept], must_follow)
        return [score - self.loss_of(path) if score else 0.0 for score, path in zip(found.tolist(), paths, strict=True)]

    def loss_of(self, path: Path) -> float:
        """The log likelihood that a clock must gain beyond a constant offset, because many more of them are tried.

        They jump at any window to any offset, or where stamps leave that out, or drift at any rate.
        """
        jumps, drifts = len(self.link.since_s) * len(_LAGS_S), len(_rates(self.lasts_s))
        if self._is_at_gap(path):
            jumps = len(self.gaps)
        return float(np.log(jumps if path.later_s else drifts if path.rate else 1))

    def _scored(self, since, until, measured, must_follow):
        """(p,) of p paths along which the same windows (p, n) lie inside of the run; measured: (n, d) in these."""
        link, times = self.link, (since.ravel(), until.ravel())
        x, besides = link.predicted(*times).reshape(*since.shape, -1), None
        without = np.zeros_like(x[:1])  # beside nothing, to be unrelated is the same along all paths
        if link.any_share:
            besides, without = link.besides(*times).reshape(*x.shape, -1), np.zeros_like(x)
            besides = np.concatenate([besides, besides])
        x = np.concatenate([x, without])
        y, noise = measured[None], np.broadcast_to(link.noise, (len(x), len(link.noise)))
        related, unrelated = np.split(scores(x, y, link.groups, noise, besides, link.slack), [len(since)])
        if not must_follow:
            return related - unrelated
        exact, unrelated = float(most(y, link.groups, noise[:1])[0]), np.broadcast_to(unrelated, related.shape)
        followed = [following(one, other, exact) for one, other in zip(related, unrelated, strict=True)]
        return np.where([f is not None and f >= RELATED for f in followed], related - unrelated, 0.0)

    def gain(self, path: Path) -> float:
        """By how much a path is more likely than any latency that a sound channel may have."""
        return self.scores([path])[0] - self.given

    def rough(self, paths: Sequence[Path]) -> np.ndarray:
        """(paths,) losses along each path: smooth, without physics."""
        since, until = (np.stack([path.at(t) for path in paths]) for t in (self.link.since_s, self.link.until_s))
        return np.nansum(losses(self.link, self.base, since, until), axis=-1)

    def unlikely(self, paths: Sequence[Path]) -> np.ndarray:
        """(paths,) losses along each path, as of `scores`: without the preference of rates that `rough` has.

        For a path that is right but for its last digit: it prefers those along which windows leave the run.
        """
        return -np.array(self.scores(paths))

    def sharpened(self, path: Path, losses_of: Callable[[Sequence[Path]], np.ndarray]) -> Path:
        """The path with the best lag near its own, and the best rate of a drift, or the best jump but at a gap.

        losses_of: `rough` or `unlikely`.
        """
        path = _least(_shifted(path), losses_of)
        while path.rate or (path.later_s and not self._is_at_gap(path)):
            near = _tilted(path, self.lasts_s) if path.rate else _later(path)
            nearer = _least(_shifted(_least(near, losses_of)), losses_of)
            if not np.subtract(*losses_of([nearer, path])) < 0.0:
                break
            path = nearer
        return path

    def best(self) -> tuple[Path, float]:
        """The most likely path, and its gain: that of no path where nothing promises enough."""
        rough = [path for path in (self.offset(), self.drift(), *self.jumps(), *self.gaps) if path is not None]
        least = float(self.total[self.usual].min()) - 0.5 * SAID
        paths = [self.sharpened(path, self.rough) for path in rough if self.rough([path])[0] < least]
        paths = [path for path in paths if not path.rate or self.is_drift(path.rate)]
        paths = [path for path in paths if not path.later_s or (self._is_jump(path) and self._is_followed(path))]
        if not paths:
            return Path(), 0.0
        path = max(paths, key=self.gain)
        gained = self.gain(path)
        if path.rate and gained >= SAID:
            path = self.sharpened(path, self.unlikely)
        return path, gained

    def _is_followed(self, path):
        """Whether the wheels are followed before and after a jump, wherever the clock is off there.

        Of an offset that only moves windows out of the run, so that nothing contradicts it any longer, nothing speaks.
        """
        link = self.link
        since, until = path.at(link.since_s), path.at(link.until_s)
        inner, later = inside(self.base, since, until), link.since_s >= path.jump_s
        for part, lag_s in ((~later, path.lag_s), (later, path.lag_s + path.later_s)):
            kept = part & inner
            if link.is_usual(lag_s):
                continue
            if kept.sum() < FEWEST:
                return False
            there = since[None, kept], until[None, kept], link.measured[kept]
            if not self._scored(*there, must_follow=True)[0] > 0.0:
                return False
        return True

    def offset(self) -> Path | None:
        """The best constant offset; None where it is no more than a latency."""
        lag = int(np.argmin(self.total))
        return None if self.usual[lag] else Path(float(_LAGS_S[lag]))

    def along(self, rate: float) -> tuple[float, Path]:
        """Loss and path with a clock that is slow by that rate, at its best offset."""
        steps = 0.5 * (self.link.since_s + self.link.until_s) - self.middle_s
        at = np.arange(len(_LAGS_S))[:, None] + np.rint(rate * steps / (_LAGS_S[1] - _LAGS_S[0])).astype(int)
        there = (at >= 0) & (at < len(_LAGS_S))
        known = np.nan_to_num(self.loss)[np.clip(at, 0, len(_LAGS_S) - 1), np.arange(len(steps))]
        total = np.where(there, known, 0.0).sum(axis=1)
        lag = int(np.argmin(total))
        return float(total[lag]), Path(float(_LAGS_S[lag]), rate, self.middle_s)

    def drift(self) -> Path | None:
        """The best path with a clock that is fast or slow; None where a run is too short to see one.

        None beside motions of any share, too: a friction that fades looks alike. In several runs together a drift is
        looked for all the same.
        """
        if self.link.any_share:
            return None
        paths = [self.along(rate) for rate in _rates(self.lasts_s) if self.is_drift(rate)]
        return min(paths, key=lambda found: found[0])[1] if paths else None

    def jumps(self) -> list[Path]:
        """The best paths with a clock that jumps once: one that is right until then, and any.

        None of a plant of one's own, whose friction and weight nobody knows and whose runs may last for a second.
        """
        if not self.base.robot.in_room:
            return []
        known = np.nan_to_num(self.loss)
        before, after = np.cumsum(known, axis=1), np.cumsum(known[:, ::-1], axis=1)[:, ::-1]
        ends = np.arange(FEWEST // 2, known.shape[1] - FEWEST // 2)
        if not len(ends):
            return []
        second, found = _LAGS_S[np.argmin(after[:, ends], axis=0)], []
        for first_s, until in ((_LAGS_S[self.usual], before[self.usual]), (_LAGS_S, before)):
            until = until[:, ends - 1]
            end = int(np.argmin(until.min(axis=0) + after[:, ends].min(axis=0)))
            first = float(first_s[np.argmin(until[:, end])])
            path = Path(first, 0.0, 0.0, float(second[end]) - first, float(self.link.since_s[ends[end]]))
            found += [path] if self._is_jump(path) else []
        return found

    @cached_property
    def gaps(self) -> list[Path]:
        """Paths with a clock that jumps where its stamps leave out more than a latency, by as much.

        Steady motion does not say when a clock jumps. None where none is looked for, as for `jumps`.
        """
        steps = np.diff(self.link.t)
        left_out = steps - np.median(steps)
        at = np.flatnonzero(left_out > LATENCY_S) if self.base.robot.in_room else ()
        lag = float(_LAGS_S[self.usual][np.argmin(self.total[self.usual])])
        return [Path(lag, 0.0, 0.0, -float(left_out[i]), float(self.link.t[i + 1])) for i in at]

    def _is_jump(self, path):
        """Whether a clock jumps by more than latencies of the channel differ; all that jump at a gap do."""
        return abs(path.later_s) > self.link.differ_s + 1e-9

    def is_drift(self, rate):
        """Whether a clock of that rate is no nearer to a constant one than a clock that jumps would be."""
        return abs(rate) * self.lasts_s >= 2.0 * self.link.differ_s

    def _is_at_gap(self, path):
        return path.jump_s in [gap.jump_s for gap in self.gaps]

    def repair(self, path: Path) -> Clock:
        """What puts the channel on the wheels' clock."""
        if path.later_s:
            return Clock(self.link.channel, 1.0, path.later_s, path.jump_s)
        return Clock(self.link.channel, 1.0 + path.rate, path.lag_s - path.rate * path.middle_s)

    def interval(self, path: Path) -> tuple[float, float]:
        """The lags [s] that are about as likely, 90 %."""
        near = _shifted(path)
        scored = np.array(self.scores(near))
        likely = [one.lag_s for one, score in zip(near, scored, strict=True) if score >= scored.max() - _INTERVAL]
        return min(path.lag_s, *likely), max(path.lag_s, *likely)

    def finding(self, path: Path, drop: float) -> Finding:
        """The path as a finding."""
        since = until = interval = None
        if path.later_s:
            fault, what = "clock_jump", f"clock jumps by {-path.later_s:.3g} s at {path.jump_s:.4g} s"
            since, until = path.jump_s, float(self.link.until_s[-1])
        elif path.rate:
            fault = "clock_drift"
            what = f"clock {100 * abs(path.rate):.2g} % {'slow' if path.rate > 0 else 'fast'} against the wheels'"
        else:
            fault, interval = "clock_offset", self.interval(path)
            what = f"clock {abs(path.lag_s):.3g} s {'late' if path.lag_s < 0 else 'early'} against the wheels'"
        return Finding(
            fault, what, self.link.channel, since, until, drop, runs=(self.number,), interval=interval,
            repairs=(self.repair(path),),
        )


def clocks(links: Sequence[tuple[int, Link, Base]]) -> list[Finding]:
    """The mistakes of one channel's clock: the same in all runs if that explains as much as one of each run's own.

    links: number of the run, link and base of every run that has the channel.
    """
    trials = _trials(links)
    own = [(trial, *trial.best()) for trial in trials]
    own = [(trial, path, gain) for trial, path, gain in own if gain >= SAID]
    apart = sum(gain - SAID for *_, gain in own)  # each of them must be worth what is said of a fault
    common = _common(trials, [path for _, path, _ in own]) if len(trials) > 1 else None
    if common is not None:
        gains = [trial.gain(common) for trial in trials]
        if sum(gains) - SAID >= max(0.0, apart) and min(gains) > -SAID:
            finding = trials[int(np.argmax(gains))].finding(common, 2.0 * sum(gains))
            return [replace(finding, runs=tuple(trial.number for trial in trials))]
    drift = _common_drift(trials)
    if drift:
        gains = [trial.gain(path) for trial, path in zip(trials, drift, strict=True)]
        # a steady motion shows no drift but a gain, and runs of the same motion show as little
        if sum(gains) - SAID * len(trials) >= max(0.0, apart) and min(gains) > -SAID:
            lasts_s = max(trial.lasts_s for trial in trials)
            drift = _tilted_alike(drift, lasts_s, [trial.unlikely for trial in trials])
            return [trial.finding(path, 2.0 * sum(gains)) for trial, path in zip(trials, drift, strict=True)]
    if len(own) < len(trials):  # the other clocks are right, and motion that comes again looks alike a period later
        own = [
            (trial, path, gain) for trial, path, gain in own
            if path.later_s or path.rate or not trial.peaks_as_given or gain >= RELATED * (trial.given + gain)
        ]
    found = [trial.finding(path, 2.0 * gain) for trial, path, gain in own]
    if found or not trials or trials[0].link.channel not in ("kinect", COMMAND):
        return found
    scores = [np.array(trial.scores([Path(float(lag)) for lag in LATENCIES_S])) for trial in trials]
    return list(other_latencies(trials[0].link.channel, [trial.number for trial in trials], scores))


def late_since(links: Sequence[tuple[int, Link, Base]], at_s: float) -> tuple[float, float]:
    """By how much [s] all channels of a run are late against its wheels from a moment on, and the drop in deviance.

    Zeros: they are not, or were so before. links: as of `clocks`, of one run.
    """
    later = _trials([(i, link.only(link.since_s >= at_s), base) for i, link, base in links])
    common = _common(later, []) if later else None
    if common is None:
        return 0.0, 0.0
    gains = [trial.gain(common) for trial in later]
    if sum(gains) < SAID or min(gains) <= -SAID:
        return 0.0, 0.0
    earlier = _trials([(i, link.only(link.until_s < at_s), base) for i, link, base in links])
    if sum(trial.gain(common) for trial in earlier) > 0.0:
        return 0.0, 0.0
    return -common.lag_s, 2.0 * sum(gains)


def _trials(links):
    """A _Trial of every link that moves enough to tell the time; links: as of `clocks`."""
    return [_Trial(*one) for one in links if moves(one[1])]


def _common_drift(trials):
    """For each run its best offset with the drift that all runs may share; empty where they are too short."""
    if len(trials) < 2:
        return []
    longest, shortest = (of(trials, key=lambda trial: trial.lasts_s) for of in (max, min))
    rates = [rate for rate in _rates(longest.lasts_s) if shortest.is_drift(rate)]
    if not rates:
        return []
    rate = min(rates, key=lambda rate: sum(trial.along(rate)[0] for trial in trials))
    rough = [trial.rough for trial in trials]
    paths = [_least(_shifted(trial.along(rate)[1]), of) for trial, of in zip(trials, rough, strict=True)]
    paths = _tilted_alike(paths, longest.lasts_s, rough)
    return paths if shortest.is_drift(paths[0].rate) else []


def _tilted_alike(paths, lasts_s, losses_of):
    """The path of each run with the rate that is best for all together, and its best lag; losses_of: of each run."""
    tilted = [_tilted(path, lasts_s) for path in paths]
    best = int(np.argmin(sum(of(near) for of, near in zip(losses_of, tilted, strict=True))))
    return [_least(_shifted(near[best]), of) for of, near in zip(losses_of, tilted, strict=True)]


def _rates(lasts_s: float) -> list[float]:
    """Rates at which a clock may drift: from one to the next by a latency more during a run that lasts so long.

    Of a longer run than one in which the fastest clock passes all offsets that are looked at, as many as of that one.
    """
    return lags(_FASTEST, LATENCY_S / min(lasts_s, np.ptp(_LAGS_S) / _FASTEST)).tolist()


def _common(trials, own):
    """The constant offset that all runs may share, the best one together or that of one run; None: a mere latency."""
    best = float(_LAGS_S[np.argmin(np.sum([trial.total for trial in trials], axis=0))])
    offsets = [best, *(path.lag_s for path in own if not path.rate and not path.later_s)]
    paths = [Path(lag) for lag in offsets if not trials[0].link.is_usual(lag)]
    if not paths:
        return None
    path = max(paths, key=lambda path: sum(trial.gain(path) for trial in trials))
    return _least(_shifted(path), lambda near: np.sum([trial.rough(near) for trial in trials], axis=0))


def _shifted(path):
    """The path with every lag near its own."""
    return [replace(path, lag_s=path.lag_s + float(d)) for d in LATENCIES_S]


def _later(path):
    """The path with every jump near its own."""
    return [replace(path, later_s=path.later_s + float(d)) for d in LATENCIES_S]


def _tilted(path, lasts_s):
    """The path with every rate near its own: from one to the next by a tick more during a run that lasts so long."""
    rates = path.rate + LATENCIES_S / lasts_s
    return [replace(path, rate=float(rate)) for rate in rates[np.abs(rates) <= _FASTEST]] or [path]


def _least(paths, losses_of):
    """The path with the least loss; losses_of: gives those of several."""
    return paths[int(np.argmin(losses_of(paths)))]
