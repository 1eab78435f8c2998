"""Stamps of the camera against even ones: frames are taken at even steps, but may be stamped when they arrive."""

from collections.abc import Iterator

import numpy as np
from scipy.fft import next_fast_len, rfft

from drake_ispace.explain.check.compare.agreement import SAID
from drake_ispace.explain.check.compare.links import LATENCIES_S, SERIES, Base, inside_late_or_early, seen_of_wheels
from drake_ispace.explain.check.compare.motion import Windows, between, camera_noise, has_motion, seen, windows
from drake_ispace.explain.check.finding import Finding
from drake_ispace.faults.repair import Evened, Gridded
from drake_ispace.files.recording import Channel, Recording

_BINS = 16  # to a step, into which stamps are sorted to find its length


def frame_findings(run: Recording, base: Base | None) -> Iterator[Finding]:
    """Stamps of a camera without which most of what it and the wheels disagree on, from frame to frame, is gone."""
    if base is None or not has_motion(run):
        return
    kinect, best = run.channels["kinect"], None
    for repair in (Evened("kinect"), _grid(kinect.t)):
        if repair is None:
            continue
        even = repair.apply(run)
        among = _inner(run, base) & _inner(even, base)
        given, left = _disagreement(run, base, among), max(_disagreement(even, base, among), np.finfo(float).tiny)
        off_s = float(np.std(kinect.t - even.channels["kinect"].t))
        if 2.0 * left**2 < given**2 and (best is None or left < best[0]):
            best = left, given, int(among.sum()), repair, off_s
    if best is None:
        return
    left, given, count, repair, off_s = best
    if count * np.log(given / left) >= SAID:
        what = f"stamps are {1e3 * off_s:.2g} ms off the even steps of the frames"
        gained = count * float(np.log((given / left) ** 2))
        yield Finding("stamp_jitter", what, "kinect", drop_in_deviance=gained, repairs=(repair,))


def _grid(t: np.ndarray) -> Gridded | None:
    """The even steps that stamps (n,) lie nearest to; None where most steps have none."""
    usual = float(np.median(np.diff(t)))
    if t[-1] - t[0] > 2.0 * usual * len(t):
        return None
    bins = np.round((t - t[0]) * (_BINS / usual)).astype(int)
    rows = next_fast_len(4 * int(bins[-1] + 1), real=True)  # rates so fine that no phase is lost from end to end
    sums, rates = np.abs(rfft(np.bincount(bins, minlength=rows))), np.arange(rows // 2 + 1) * (_BINS / usual / rows)
    near = np.flatnonzero((rates > 0.8 / usual) & (rates < 1.2 / usual))
    rate = float(rates[near[np.argmax(sums[near])]])
    phase = float(np.angle(np.exp(2j * np.pi * rate * (t - t[0])).sum()))
    step_s, since_s = np.polyfit(np.rint(rate * (t - t[0]) - phase / (2.0 * np.pi)), t, 1)
    return Gridded("kinect", float(step_s), float(since_s))


def latency_of(run: Recording, base: Base) -> float:
    """The latency [s] of the camera at which most of its motions over a window are nearest to those of the wheels.

    The least of equal ones: a robot that mostly rests tells none.
    """
    kinect = run.channels["kinect"]
    parts = windows(kinect, SERIES)
    noise = base.noise_beside(camera_noise(kinect))
    noise = np.where(noise > 0.0, noise, noise.max() or 1.0)
    inner = inside_late_or_early(base, parts)
    apart = _apart(run, base, parts, seen(kinect, parts) / noise, 1.0 / noise, inner)
    return float(min(LATENCIES_S[apart <= apart.min() + 1e-9], key=abs))


def _steps(kinect: Channel) -> Windows:
    """The stretches from each fix to the next."""
    first = np.arange(len(kinect.t) - 1)
    return between(kinect, first, first + 1)


def _inner(run: Recording, base: Base) -> np.ndarray:
    """(n,) which of these lie inside the wheels' time."""
    return inside_late_or_early(base, _steps(run.channels["kinect"]))


def _disagreement(run: Recording, base: Base, among: np.ndarray) -> float:
    """Median distance [m] between the motions from fix to fix that camera and wheels tell of, at the best latency.

    among: (n,) which of them.
    """
    kinect, places = run.channels["kinect"], np.array([1.0, 1.0, 0.0])
    steps = _steps(kinect)
    return float(_apart(run, base, steps, seen(kinect, steps) * places, places, among).min())


def _apart(run, base, parts, moved, unit, among):
    """How far motions (n, 3) are apart from those of the wheels: (lags,) medians, one for each of LATENCIES_S.

    parts: the stretches of `moved`; unit: (3,) what it is measured in; among: (n,) which of them, all inside.
    """
    if not among.any():
        return np.zeros(len(LATENCIES_S))
    since, until = (np.ravel(t[among] + LATENCIES_S[:, None]) for t in (parts.since_s, parts.until_s))
    turned = (base.moved(since, until) @ seen_of_wheels(run, base) * unit).reshape(len(LATENCIES_S), -1, 3)
    return np.median(np.linalg.norm(moved[among] - turned, axis=2), axis=1)
