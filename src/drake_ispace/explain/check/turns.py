"""Turns of the robot, at once, that no wheel makes: somebody pushes it, counts are lost, or a marker is moved.

A turn of a few degrees is less than the way that must show in steps.py, and takes the robot aside for the rest of the
run. From then on camera and wheels are apart by an angle, which all fixes before and after it tell.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from drake_ispace.blocks.frames import wrap
from drake_ispace.blocks.rates import TICK_S
from drake_ispace.explain.check.compare.frames import latency_of
from drake_ispace.explain.check.compare.links import FEWEST, LATENCIES_S, Base, inside, seen_of_wheels
from drake_ispace.explain.check.compare.motion import WINDOW_S, between, has_motion, seen, windows
from drake_ispace.explain.check.compare.regression import SLACK
from drake_ispace.explain.check.finding import Finding
from drake_ispace.explain.check.steps import APART, SHOWS_M, largest_step
from drake_ispace.explain.levels import largest_by_chance
from drake_ispace.faults.repair import CutOut, Turned
from drake_ispace.files.recording import Recording

_FEWEST = FEWEST // 2  # fixes on either side of a turn


def turn_findings(run: Recording, base: Base | None) -> Iterator[Finding]:
    """The turns that stand out: twice as large as any other change of the angle between camera and wheels, and as what
    chance makes of it, whatever usual latency the camera has: a turn that begins looks alike to a late one.

    They must be no mere share of what the wheels do meanwhile, and take the robot aside by a way that shows. Headings
    are those of `run`, in radians.
    """
    if base is None or not base.robot.in_room or not has_motion(run):
        return
    kinect, lag_s = run.channels["kinect"], latency_of(run, base)
    kept = inside(base, kinect.t + lag_s, kinect.t + lag_s)
    if kept.sum() < FEWEST:
        return
    beside = _Beside(run, base, lag_s, kept)
    changed = _changes(beside.t, beside.angle)
    large = sorted(_standing_out(beside.t, np.abs(np.nan_to_num(changed))))
    lows, highs = [-np.inf, *(beside.t[k + 1] for k, _ in large)], [*(beside.t[k] for k, _ in large), np.inf]
    findings, jumps = [], []
    for m, (k, least) in enumerate(large):
        reach = np.linalg.norm(beside.places - beside.places[k], axis=1).max()
        if abs(changed[k]) > SLACK * beside.turned(k) and abs(changed[k]) * reach >= SHOWS_M:
            told = beside.told(k, float(changed[k]), least, lows[m], highs[m + 1])
            (jumps if isinstance(told, _Jump) else findings).append(told)
    yield from filter(None, findings)
    yield from _of_headings(beside, jumps)


@dataclass(frozen=True)
class _Jump:
    """A turn of the headings alone, between two fixes [s], by an angle [rad] that is known but for `least`."""

    since: float
    until: float
    turn: float
    least: float


class _Beside:
    """Camera and wheels of a run; lag_s: by how much later the wheels say what the camera sees. kept: which fixes.

    angle: (k,) between camera and wheels at these fixes.
    """

    def __init__(self, run, base, lag_s, kept):
        self.kinect = kinect = run.channels["kinect"]
        self.encoder, self.base, self.lag_s, self.seen_of = base.encoder, base, lag_s, seen_of_wheels(run, base, lag_s)
        self.t, self.places, self.phi = kinect.t[kept], kinect.values[kept, :2], np.unwrap(kinect.column("phi"))[kept]
        self.angle = self._apart(slice(None), lag_s)

    def moved(self, since_s, until_s):
        """(n, 3) motions [m, m, rad] that the camera should see, by the wheels at these times."""
        return self.base.moved(since_s, until_s) @ self.seen_of

    def _apart(self, part, lag_s):
        """The angle between camera and wheels at some of the fixes, at a lag."""
        at = self.t[part] + lag_s
        return self.phi[part] - np.concatenate([[0.0], np.cumsum(self.moved(at[:-1], at[1:])[:, 2])])

    def turned(self, k):
        """By how much [rad] the wheels turn the robot, to and fro, in the windows before and after step `k`."""
        at = self.t[self._near(k)] + self.lag_s
        return float(np.abs(self.moved(at[:-1], at[1:])[:, 2]).sum())

    def _near(self, k):
        return slice(*np.searchsorted(self.t, [self.t[k] - WINDOW_S, self.t[k + 1] + WINDOW_S]))

    def told(self, k, turn, least, low, high):
        """The Finding or the _Jump of a turn at step `k`; None unless it is more than `least` whatever the latency.

        low, high: when [s] the turns before and after it are.
        """
        t, degrees = self.t, f"{np.degrees(abs(turn)):.2g} degrees"
        since, until = _between(t, self.angle, k)
        row = self._fastest_row(since + self.lag_s, until + self.lag_s)
        if row is not None and row[2] > 0.5 * abs(turn):
            what = f"angles of the wheels change at once by a turn of {degrees}, and the heading does not"
            return Finding("counter_reset", what, "encoder", *row[:2], repairs=(CutOut(*row[:2]),))
        near = self._near(k)
        turns = [_changes(t[near], self._apart(near, lag_s))[k - near.start] for lag_s in LATENCIES_S]
        if not np.abs(turns).min() > least:
            return None
        path = self._path_turns_by(since, until, turn, low, high)
        if path is not None and abs(path) < abs(path - turn):
            return _Jump(since, until, turn, least)
        a, b = since + min(self.lag_s, 0.0), until + max(self.lag_s, 0.0)
        what = f"the robot turns by {degrees} at once, and its wheels do not turn it"
        rivals = ("counter_reset", "camera_jump", *(("heading_offset",) if path is None else ()))
        return Finding("robot_carried", what, "all", a, b, rivals=rivals, repairs=(CutOut(a, b),))

    def _fastest_row(self, since_s, until_s):
        """From when to when [s], and by which angle, wheels turn the robot most from one row to the next about a time.

        None where they turn it half as fast in another row.
        """
        t, (since, until) = self.encoder.t, largest_step(self.encoder, since_s, until_s)
        turns = np.abs(self.moved(t[:-1], t[1:])[:, 2])
        rates, at = turns / np.maximum(np.diff(t), TICK_S), int(np.searchsorted(t, since))
        return (since, until, turns[at]) if rates[at] > APART * np.delete(rates, at).max(initial=0.0) else None

    def _path_turns_by(self, since, until, turn, low, high):
        """By how much [rad] the path turns at a time at which the heading turns; None where the robot hardly drives.

        low, high: as of `told`.
        """
        before, after = self.path_apart(low, since), self.path_apart(until, high)
        if before is None or after is None:
            return None
        return turn + float(np.angle(after * np.conj(before)))  # in the body's axes a path goes on if it turns as well

    def path_apart(self, since, until):
        """A complex number whose angle is between the paths, in the body's axes, that camera and wheels tell of from
        one time to another; None where the robot hardly drives."""
        parts, ways = self._paths
        ways = [way[(parts.since_s >= since) & (parts.until_s <= until)] for way in ways]
        return np.sum(ways[0] * np.conj(ways[1])) if min(np.abs(way).sum() for way in ways) >= SHOWS_M else None

    @cached_property
    def _paths(self):
        """Windows that lie inside the wheels' time, and the ways in these by camera and wheels, complex numbers."""
        parts = windows(self.kinect)
        kept = inside(self.base, parts.since_s, parts.until_s, self.lag_s)
        parts = between(self.kinect, parts.first[kept], parts.last[kept])
        moved = self.moved(parts.since_s + self.lag_s, parts.until_s + self.lag_s)
        return parts, [motion[:, :2] @ [1.0, 1.0j] for motion in (seen(self.kinect, parts), moved)]


def _of_headings(beside, jumps) -> Iterator[Finding]:
    """The Findings of headings that are off between jumps, or before or after them.

    What the headings say for longest counts as right. Others are turned only where the path has not turned with them;
    else some of the jumps were not found, and those that were are cut out.
    """
    if not jumps:
        return
    t = beside.kinect.t
    off_by = np.cumsum([0.0, *(jump.turn for jump in jumps)])
    begins, ends = [t[0], *(jump.until for jump in jumps)], [*(jump.since for jump in jumps), t[-1]]
    least = max(jump.least for jump in jumps)
    is_alike = np.abs(wrap(off_by[:, None] - off_by)) <= least
    right = int(np.argmax(is_alike @ np.subtract(ends, begins)))
    paths, turned = [beside.path_apart(*part) for part in zip(begins, ends, strict=True)], is_alike[right].copy()
    for k in np.flatnonzero(~is_alike[right]):
        off = float(wrap(off_by[k] - off_by[right]))
        if paths[k] is None or paths[right] is None:
            continue
        apart = np.angle(paths[k] * np.conj(paths[right]))
        if abs(wrap(apart + off)) < abs(apart):
            turned[k] = True
            degrees = f"{np.degrees(abs(off)):.2g} degrees"
            what = f"headings turn by {degrees} at once, and neither the path nor the wheels do"
            yield Finding("heading_offset", what, "kinect", float(begins[k]), float(ends[k]),
                          repairs=(Turned("kinect", float(begins[k]), float(ends[k]), -off),))
    for jump, before, after in zip(jumps, turned[:-1], turned[1:], strict=True):
        if not (before and after):
            what = f"headings turn by {np.degrees(abs(jump.turn)):.2g} degrees at once, and the wheels do not"
            yield Finding("heading_offset", what, "kinect", jump.since, jump.until, rivals=("robot_carried",),
                          repairs=(CutOut(jump.since, jump.until),))


def _standing_out(t, sizes):
    """Yield the numbers of the steps at which the largest sizes (k - 1,) are, and what each must be more than.

    As many as are twice as large as the next smaller one, and as what chance makes of it.
    """
    left, found = sizes.copy(), []
    known = sizes[sizes > 0.0]
    chance = largest_by_chance(len(known), 1) * float(np.median(known)) if len(known) else 0.0
    while left.any():
        k = int(np.argmax(left))
        found.append((k, float(left[k])))
        left[(t[1:] > t[k] - 2.0 * WINDOW_S) & (t[:-1] < t[k + 1] + 2.0 * WINDOW_S)] = 0.0
    next_smaller = [max(size, chance) for _, size in found[1:]]
    last = max((m for m, size in enumerate(next_smaller) if found[m][1] > APART * size), default=-1)
    for k, _ in found[: last + 1]:
        yield k, APART * next_smaller[last]


def _changes(t, apart):
    """(k - 1,) by how much the mean of `apart` (k,) over the fixes of WINDOW_S after a step differs from that before.

    NaN where there are too few.
    """
    total = np.concatenate([[0.0], np.cumsum(apart)])
    last, first = np.arange(1, len(t)), np.searchsorted(t, t - WINDOW_S)[:-1]
    end = np.searchsorted(t, t + WINDOW_S, side="right")[1:]
    before, after = last - first, end - last
    changed = (total[end] - total[last]) / after - (total[last] - total[first]) / before
    there = (before >= _FEWEST) & (after >= _FEWEST) & (np.diff(t) <= WINDOW_S)
    return np.where(there, changed, np.nan)


def _between(t, apart, k):
    """The fixes [s] between which `apart` (k,) changes from what it is before step `k` to what it is after it.

    But for a quarter of the change, which noise may make.
    """
    first, end = np.searchsorted(t, t[k] - WINDOW_S), np.searchsorted(t, t[k + 1] + WINDOW_S, side="right")
    before, after = float(np.mean(apart[first : k + 1])), float(np.mean(apart[k + 1 : end]))
    near = 0.25 * abs(after - before)
    since = first + np.flatnonzero(np.abs(apart[first : k + 1] - before) <= near).max(initial=0)
    until = k + 1 + np.flatnonzero(np.abs(apart[k + 1 : end] - after) <= near).min(initial=end - k - 2)
    return float(t[since]), float(t[until])
