"""A channel of one run under other clocks, and the likeliest of them."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from drake_ispace.explain.check.compare.agreement import ALIKE, RELATED, SAID, following
from drake_ispace.explain.check.compare.clocks.losses import losses
from drake_ispace.explain.check.compare.clocks.paths import (
    LAGS_S,
    OFFSET,
    Losses,
    Path,
    descended,
    is_at_end,
    least,
    rates_of,
    times_along,
)
from drake_ispace.explain.check.compare.links import (
    FEWEST,
    LATENCIES_S,
    LATENCY_S,
    Base,
    Link,
    in_motion,
    inside,
    moves,
)
from drake_ispace.explain.check.compare.regression import most, scores
from drake_ispace.explain.check.finding import Finding
from drake_ispace.faults.repair import Clock, time_text

Links = Sequence[tuple[int, Link, Base]]  # number of the run, link and base of every run that has a channel

_INTERVAL = 1.35  # loss of log likelihood at the ends of a 90 % interval


@dataclass(frozen=True)
class Likeliest:
    """The likeliest path, what it gains, and the names of other mistakes of a clock that gain about as much."""

    path: Path
    gain: float
    rivals: tuple[str, ...] = ()


class Trial:
    """A channel of one run under other clocks.

    loss (lags, windows): of each window, less that without any relation. moves_s: from the first to the last window in
    which something moves. peaks_as_given: whether no lag nearby would do
    better than one that a sound channel may have. latencies: paths of such a channel; given: the best score of these.
    """

    def __init__(self, number: int, link: Link, base: Base):
        self.number, self.link, self.base = number, link, base
        off = LAGS_S[:, None]
        self.loss = losses(link, base, link.since_s + off, link.until_s + off)
        self.total = np.nansum(self.loss, axis=1)
        self.middle_s = 0.5 * float(link.since_s[0] + link.until_s[-1])
        self.lasts_s = float(link.until_s[-1] - link.since_s[0])
        moving = in_motion(link.measured, link.measured, link.noise)
        self.moves_s = float(np.ptp(np.append(link.since_s[moving], link.until_s[moving]))) if moving.any() else 0.0
        self.usual = link.is_usual(LAGS_S)
        at = int(np.argmin(self.total[self.usual]))
        usual, self.peaks_as_given = LAGS_S[self.usual][at], 0 < at < self.usual.sum() - 1
        near = usual + LATENCIES_S[link.is_usual(usual + LATENCIES_S)]
        self.latencies = [Path(float(lag)) for lag in near]
        self.given = max(0.0, *self.scores(self.latencies, must_follow=False))

    def scores(self, paths: Sequence[Path], must_follow: bool = True, among: np.ndarray | bool = True) -> list[float]:
        """For each path the log likelihood along it over that without any relation, of the windows inside of the run.

        0 where the channel follows the wheels too little to tell the time, if it must follow them. among: (windows,)
        those that count, default all.
        """
        since, until = (times_along(paths, t) for t in (self.link.since_s, self.link.until_s))
        inner, found = inside(self.base, since, until), np.zeros(len(paths))
        inner &= among
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
        jumps, drifts = len(self.link.since_s) * len(LAGS_S), len(rates_of(self.lasts_s))
        if self._is_at_gap(path):
            jumps = len(self.gaps)
        return float(np.log(jumps if path.later_s else drifts if path.rate else 1))

    def _scored(self, since, until, measured, must_follow, link=None):
        """(p,) of p paths along which the same windows (p, n) lie inside of the run; measured: (n, d) in these."""
        link, times = link or self.link, (since.ravel(), until.ravel())
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
        """By how much a path is more likely than any latency that a sound channel may have.

        Each is compared with it by the windows that lie inside of the run along both: one more is not evidence.
        """
        since, until = (times_along([path, *self.latencies], t) for t in (self.link.since_s, self.link.until_s))
        along, *others = inside(self.base, since, until)
        both, gains = along & np.array(others), []
        for among in np.unique(both[both.sum(axis=1) >= FEWEST], axis=0):
            same = [self.latencies[i] for i in np.flatnonzero((both == among).all(axis=1))]
            own = self.scores([path], among=among)[0]
            gains.append(own - max(0.0, *self.scores(same, must_follow=False, among=among)))
        return min(gains, default=self.scores([path])[0] - self.given)  # of runs too short to have enough in common

    def rough(self, paths: Sequence[Path]) -> np.ndarray:
        """(paths,) losses along each path: smooth, without physics."""
        since, until = (times_along(paths, t) for t in (self.link.since_s, self.link.until_s))
        return np.nansum(losses(self.link, self.base, since, until), axis=-1)

    def unlikely(self, paths: Sequence[Path]) -> np.ndarray:
        """(paths,) losses along each path, as of `scores`: without the preference of rates that `rough` has.

        For a path that is right but for its last digit: it prefers those along which windows leave the run.
        """
        return -np.array(self.scores(paths))

    def of_same_windows(self, paths: Sequence[Path]) -> np.ndarray:
        """(paths,) losses along each path, of the windows that lie inside of the run along all of them.

        For lags that are nearly alike: a window that comes in along one of them says nothing against the others.
        """
        since, until = (times_along(paths, t) for t in (self.link.since_s, self.link.until_s))
        return -np.array(self.scores(paths, must_follow=False, among=inside(self.base, since, until).all(axis=0)))

    def of_latencies(self) -> np.ndarray:
        """(lags,) log likelihood of each of LATENCIES_S over that without any relation; zeros: none can be told.

        All of them are of the windows that lie inside of the run along every one. Of a short run these are few, and one
        that only some lags have would outweigh what the others say of these.
        """
        finer = self.link.finer
        link = self.link if finer is None or len(finer.since_s) < len(self.link.since_s) else finer
        since, until = (t + LATENCIES_S[:, None] for t in (link.since_s, link.until_s))
        kept = inside(self.base, since, until).all(axis=0)
        if not kept.any():
            return np.zeros(len(LATENCIES_S))
        related, followed = (
            self._scored(since[:, kept], until[:, kept], link.measured[kept], must_follow, link)
            for must_follow in (False, True)
        )
        return related * followed.any()

    def sharpened(self, path: Path, losses_of: Losses) -> Path:
        """The path with the best lag near its own, and the best rate of a drift, or the best jump but at a gap.

        losses_of: `rough` or `unlikely`.
        """
        path = least(path.shifted(), losses_of)
        while path.rate or (path.later_s and not self._is_at_gap(path)):
            if path.rate:
                tilted = path.tilted(self.lasts_s)
                nearer = tilted[descended(losses_of(tilted), path.number_in(tilted))]
            else:
                nearer = least(least(path.jumping(self._ends_near(path)), losses_of).later(), losses_of)
            nearer = least(nearer.shifted(), losses_of)
            if not np.subtract(*losses_of([nearer, path])) < 0.0:
                break
            path = nearer
        return path

    def _ends_near(self, path):
        """Ends [s] of the windows about a jump, none near the run's own; the jump itself beside motions of any share.
        """
        if self.link.any_share:
            return np.array([path.jump_s])
        ends = self.link.until_s[FEWEST // 2 : -(FEWEST // 2)]
        at = int(np.searchsorted(ends, path.jump_s))
        return ends[max(at - FEWEST, 0) : at + FEWEST]

    def best(self) -> Likeliest:
        """The likeliest path: no other than given where nothing promises enough."""
        at_gaps = [least(path.shifted(), self.rough) for path in self.gaps]
        rough = [path for path in (self.offset(), self.drift(), *self.jumps(), *at_gaps) if path is not None]
        promising = float(self.total[self.usual].min()) - 0.5 * SAID
        paths = [self.sharpened(path, self.rough) for path in rough if self.rough([path])[0] < promising]
        paths = [path for path in paths if not path.rate or self.is_drift(path.rate)]
        paths = [path for path in paths if not path.later_s or (self._is_jump(path) and self._is_followed(path))]
        if not paths:
            return Likeliest(Path(), 0.0)
        gains = [self.gain(path) for path in paths]
        gain, path = max(gains), paths[int(np.argmax(gains))]
        near = [other.fault for other, of_other in zip(paths, gains, strict=True) if of_other > gain - ALIKE]
        if path.rate and gain >= SAID:
            path = self.sharpened(path, self.unlikely)
        elif path.fault == OFFSET and gain >= SAID:
            path = least(path.shifted(), self.of_same_windows)
        return Likeliest(path, gain, tuple(name for name in dict.fromkeys(near) if name != path.fault))

    def _is_followed(self, path):
        """Whether something moves before and after a jump, and the wheels are followed wherever the clock is off there.

        Of an offset that only moves windows out of the run, so that nothing contradicts it any longer, nothing speaks.
        """
        link = self.link
        since, until = path.at(link.since_s), path.at(link.until_s)
        inner, later = inside(self.base, since, until), link.since_s >= path.jump_s
        moves = in_motion(link.predicted(since, until), link.measured, link.noise)
        for part, lag_s in ((~later, path.lag_s), (later, path.lag_s + path.later_s)):
            kept = part & inner
            if (kept & moves).sum() < FEWEST // 2:
                return False
            if link.is_usual(lag_s):
                continue
            if kept.sum() < FEWEST:
                return False
            there = since[None, kept], until[None, kept], link.measured[kept]
            if not self._scored(*there, must_follow=True)[0] > 0.0:
                return False
        return True

    def offset(self) -> Path | None:
        """The best constant offset; None where it is no more than a latency, or one beyond may be better."""
        lag = int(np.argmin(self.total))
        return None if self.usual[lag] or is_at_end(lag) else Path(float(LAGS_S[lag]))

    def along(self, rate: float) -> tuple[float, Path]:
        """Loss and path with a clock that is slow by that rate, at its best offset."""
        steps = 0.5 * (self.link.since_s + self.link.until_s) - self.middle_s
        at = np.arange(len(LAGS_S))[:, None] + np.rint(rate * steps / (LAGS_S[1] - LAGS_S[0])).astype(int)
        there = (at >= 0) & (at < len(LAGS_S))
        known = np.nan_to_num(self.loss)[np.clip(at, 0, len(LAGS_S) - 1), np.arange(len(steps))]
        total = np.where(there, known, 0.0).sum(axis=1)
        lag = int(np.argmin(total))
        return float(total[lag]), Path(float(LAGS_S[lag]), rate, self.middle_s)

    def drift(self) -> Path | None:
        """The best path with a clock that is fast or slow; None where a run is too short to see one.

        None beside motions of any share, too: a friction that fades looks alike. In several runs together a drift is
        looked for all the same.
        """
        if self.link.any_share:
            return None
        paths = [self.along(rate) for rate in rates_of(self.lasts_s) if self.is_drift(rate)]
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
        second, found = LAGS_S[np.argmin(after[:, ends], axis=0)], []
        for first_s, until in ((LAGS_S[self.usual], before[self.usual]), (LAGS_S, before)):
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
        lag = float(LAGS_S[self.usual][np.argmin(self.total[self.usual])])
        return [Path(lag, 0.0, 0.0, -float(left_out[i]), float(self.link.t[i + 1])) for i in at]

    def _is_jump(self, path):
        """Whether a clock jumps by more than latencies of the channel differ; all that jump at a gap do."""
        return abs(path.later_s) > self.link.differ_s + 1e-9

    def is_drift(self, rate):
        """Whether a clock of that rate is no nearer to a constant one than a clock that jumps would be.

        While something moves, as rest tells no time.
        """
        return abs(rate) * self.moves_s >= 2.0 * self.link.differ_s

    def _is_at_gap(self, path):
        return path.jump_s in [gap.jump_s for gap in self.gaps]

    def repair(self, path: Path) -> Clock:
        """What puts the channel on the wheels' clock."""
        if path.later_s:
            return Clock(self.link.channel, 1.0, path.later_s, path.jump_s)
        return Clock(self.link.channel, 1.0 + path.rate, path.lag_s - path.rate * path.middle_s)

    def interval(self, path: Path) -> tuple[float, float]:
        """The lags [s] that are about as likely, 90 %."""
        near = path.shifted()
        losses = self.of_same_windows(near)
        likely = [one.lag_s for one, loss in zip(near, losses, strict=True) if loss <= losses.min() + _INTERVAL]
        return min(path.lag_s, *likely), max(path.lag_s, *likely)

    def finding(self, path: Path, drop: float, rivals: tuple[str, ...] = ()) -> Finding:
        """The path as a finding; rivals: names of others that may be it."""
        since = until = interval = None
        if path.later_s:
            what = f"clock jumps by {-path.later_s:.3g} s at {time_text(path.jump_s, 3)} s"
            since, until = path.jump_s, float(self.link.until_s[-1])
        elif path.rate:
            what = f"clock {100 * abs(path.rate):.2g} % {'slow' if path.rate > 0 else 'fast'} against the wheels'"
        else:
            interval = self.interval(path)
            what = f"clock {abs(path.lag_s):.3g} s {'late' if path.lag_s < 0 else 'early'} against the wheels'"
        return Finding(
            path.fault, what, self.link.channel, since, until, drop, rivals, runs=(self.number,), interval=interval,
            repairs=(self.repair(path),), harmless=self._is_usual(path),
        )

    def _is_usual(self, path):
        """Whether along a path the channel is never later or earlier than a sound one may be."""
        t = np.array([self.link.since_s[0], self.link.until_s[-1]])
        return bool(np.all(self.link.is_usual(path.at(t) - t)))


def trials_of(links: Links) -> list[Trial]:
    """A Trial of every link that moves enough to tell the time."""
    return [Trial(*one) for one in links if moves(one[1])]
