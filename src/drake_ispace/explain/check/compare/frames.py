"""Stamps of the camera against even ones: frames are taken at even steps, but may be stamped when they arrive."""

from collections.abc import Iterator

import numpy as np
from scipy.fft import next_fast_len, rfft

from drake_ispace.explain.check.compare.agreement import SAID
from drake_ispace.explain.check.compare.links import LATENCIES_S, SERIES, Base, inside_late_or_early, seen_of_wheels
from drake_ispace.explain.check.compare.motion import between, camera_noise, has_motion, seen, windows
from drake_ispace.explain.check.finding import Finding
from drake_ispace.faults.repair import Evened, Gridded
from drake_ispace.files.recording import Recording

_BINS = 16  # to a step, into which stamps are sorted to find its length


def frame_findings(run: Recording, base: Base | None) -> Iterator[Finding]:
    """Stamps of a camera without which most of what it and the wheels disagree on, from frame to frame, is gone."""
    if base is None or not has_motion(run):
        return
    kinect = run.channels["kinect"]
    (given, count), best = _disagreement(run, base), None
    for repair in (Evened("kinect"), _grid(kinect.t)):
        even = repair.apply(run)
        left = max(_disagreement(even, base)[0], np.finfo(float).tiny)
        off_s = float(np.std(kinect.t - even.channels["kinect"].t))
        if 2.0 * left**2 < given**2 and (best is None or left < best[0]):
            best = left, repair, off_s
    if best is not None and count * np.log(given / best[0]) >= SAID:
        left, repair, off_s = best
        what = f"stamps are {1e3 * off_s:.2g} ms off the even steps of the frames"
        gained = count * float(np.log((given / left) ** 2))
        yield Finding("stamp_jitter", what, "kinect", drop_in_deviance=gained, repairs=(repair,))


def _grid(t: np.ndarray) -> Gridded:
    """The even steps that stamps (n,) lie nearest to."""
    usual = float(np.median(np.diff(t)))
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
    apart, _ = _apart(run, base, parts, seen(kinect, parts) / noise, 1.0 / noise)
    return float(min(LATENCIES_S[apart <= apart.min() + 1e-9], key=abs))


def _disagreement(run: Recording, base: Base) -> tuple[float, int]:
    """Median distance [m] between the motions from fix to fix that camera and wheels tell of, and number of these.

    At the best latency.
    """
    kinect = run.channels["kinect"]
    first = np.arange(len(kinect.t) - 1)
    steps = between(kinect, first, first + 1)
    places = np.array([1.0, 1.0, 0.0])
    apart, count = _apart(run, base, steps, seen(kinect, steps) * places, places)
    return float(apart.min()), count


def _apart(run, base, parts, moved, unit):
    """How far motions (n, 3) are apart from those of the wheels: (lags,) medians, one for each of LATENCIES_S.

    And the number of the motions. parts: the stretches of `moved`; unit: (3,) what it is measured in.
    """
    inner = inside_late_or_early(base, parts)
    if not inner.any():
        return np.zeros(len(LATENCIES_S)), 0
    since, until = (np.ravel(t[inner] + LATENCIES_S[:, None]) for t in (parts.since_s, parts.until_s))
    turned = (base.moved(since, until) @ seen_of_wheels(run, base) * unit).reshape(len(LATENCIES_S), -1, 3)
    return np.median(np.linalg.norm(moved[inner] - turned, axis=2), axis=1), int(inner.sum())
