"""Turns of the robot, at once, that no wheel makes: somebody pushes it, or counts are lost at once.

A turn of a few degrees is less than the way that must show in steps.py, and takes the robot aside for the rest of the
run. From then on camera and wheels are apart by an angle, which all fixes before and after it tell.
"""

from collections.abc import Iterator

import numpy as np

from drake_ispace.explain.check.compare.frames import latency_of
from drake_ispace.explain.check.compare.links import FEWEST, LATENCIES_S, Base, inside, seen_of_wheels
from drake_ispace.explain.check.compare.motion import WINDOW_S, has_motion
from drake_ispace.explain.check.finding import Finding
from drake_ispace.explain.check.steps import APART, SHOWS_M, largest_by_chance, largest_step
from drake_ispace.faults.repair import CutOut
from drake_ispace.files.recording import Recording


def turn_findings(run: Recording, base: Base | None) -> Iterator[Finding]:
    """The turn that stands out: twice as large as any other change of the angle between camera and wheels, and as what
    chance makes of it, whatever usual latency the camera has: a turn that begins looks alike to a late one. It must
    take the robot aside by a way that shows. Headings are those of `run`, in radians.
    """
    if base is None or not base.robot.in_room or not has_motion(run):
        return
    kinect, lag_s, seen_of = run.channels["kinect"], latency_of(run, base), seen_of_wheels(run, base)
    kept = inside(base, kinect.t + lag_s, kinect.t + lag_s)
    t, phi = kinect.t[kept], np.unwrap(kinect.column("phi"))[kept]
    if len(t) < FEWEST:
        return

    def apart_in(part, lag_s):
        """The angle between camera and wheels at some of the fixes, if the camera is so early."""
        at = t[part] + lag_s
        turned = (base.moved(at[:-1], at[1:]) @ seen_of)[:, 2]
        return phi[part] - np.concatenate([[0.0], np.cumsum(turned)])

    apart = apart_in(slice(None), lag_s)
    changed = _changes(t, apart)
    known = np.isfinite(changed)
    if known.sum() < FEWEST:
        return
    sizes = np.where(known, np.abs(changed), 0.0)
    k = int(np.argmax(sizes))
    others = known & ((t[1:] < t[k] - 2.0 * WINDOW_S) | (t[:-1] > t[k + 1] + 2.0 * WINDOW_S))
    if not others.any():
        return
    chance = largest_by_chance(int(known.sum()), 1) * float(np.median(sizes[others]))
    reach = float(np.linalg.norm(kinect.values[kept, :2] - kinect.values[kept, :2][k], axis=1).max())
    least = max(APART * max(float(sizes[others].max()), chance), SHOWS_M / max(reach, SHOWS_M))
    if not sizes[k] > least:
        return
    (since, until), degrees = _between(t, apart, k), f"{np.degrees(sizes[k]):.2g} degrees"
    row = _fastest_row(run.channels["encoder"], base, seen_of, since + lag_s, until + lag_s)
    if row is not None and row[2] > 0.5 * sizes[k]:
        what = f"angles of the wheels change at once by a turn of {degrees}, and the heading does not"
        yield Finding("counter_reset", what, "encoder", *row[:2], repairs=(CutOut(*row[:2]),))
        return
    near = slice(*np.searchsorted(t, [t[k] - WINDOW_S, t[k + 1] + WINDOW_S]))
    if min(abs(_changes(t[near], apart_in(near, lag))[k - near.start]) for lag in LATENCIES_S) > least:
        since, until = since + min(lag_s, 0.0), until + max(lag_s, 0.0)
        what = f"the robot turns by {degrees} at once, and its wheels do not turn it"
        yield Finding("robot_carried", what, "all", since, until, rivals=("camera_jump", "counter_reset"),
                      repairs=(CutOut(since, until),))


def _fastest_row(encoder, base, seen_of, since_s, until_s):
    """From when to when [s], and by which angle, wheels turn the robot most from one row to the next about a time.

    None where they turn it half as fast in another row.
    """
    since, until = largest_step(encoder, since_s, until_s)
    turns = np.abs((base.moved(encoder.t[:-1], encoder.t[1:]) @ seen_of)[:, 2])
    rates, at = turns / np.diff(encoder.t), int(np.searchsorted(encoder.t, since))
    return (since, until, turns[at]) if rates[at] > APART * np.delete(rates, at).max(initial=0.0) else None


def _changes(t, apart):
    """(k - 1,) by how much the mean of `apart` (k,) over the fixes of WINDOW_S after a step differs from that before.

    NaN where fixes are missing.
    """
    total = np.concatenate([[0.0], np.cumsum(apart)])
    last, first = np.arange(1, len(t)), np.searchsorted(t, t - WINDOW_S)[:-1]
    end = np.searchsorted(t, t + WINDOW_S, side="right")[1:]
    before, after = last - first, end - last
    changed = (total[end] - total[last]) / after - (total[last] - total[first]) / before
    fewest = 0.5 * min(np.median(before), np.median(after))
    there = (before >= fewest) & (after >= fewest) & (np.diff(t) <= WINDOW_S)
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
