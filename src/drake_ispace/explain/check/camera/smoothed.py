"""Fixes that a program smooths, by a mean over several or a low-pass: what noise they have goes on from fix to fix.

Beside the wheels' motion the camera's changes little from one fix to the next, and the more the further two fixes are
apart, up to as many as were smoothed together. The steady errors of a robot, such as wheels of another size, grow
faster than noise that is smoothed, and do not cease to within the time over which a program may smooth.
"""

from collections.abc import Iterator

import numpy as np

from drake_ispace.explain.check.compare.links import LATENCY_S, Base
from drake_ispace.explain.check.compare.motion import between, has_motion, of_third, seen
from drake_ispace.explain.check.finding import Finding
from drake_ispace.faults.repair import LeftOut
from drake_ispace.files.recording import Recording

_LAGS = (1, 2, 3, 4, 6, 8, 12, 16)  # fixes, between which the noise is compared
_FEWEST = 100  # differences that tell how large the noise is
_GROWS = 2.0  # times, from one fix to the next to where it is full: a mean of three makes it 2.2
_FULL = 1.25  # times, below which it grows no more
_STEADY = 4.0  # times as large over two fixes: noise twice, what is smooth eight times


def smoothed_fixes(run: Recording, base: Base | None) -> Iterator[Finding]:
    """Fixes whose places and headings are smoothed; those are kept that are as far apart as were smoothed together."""
    if base is None or not has_motion(run) or len(run.channels["kinect"].t) < _FEWEST:
        return
    as_stamped = _noise(run.channels["kinect"], base, 0.0)
    if len(as_stamped) < 2 or not as_stamped[0].all() or (as_stamped[1] < _FULL * as_stamped[0]).any():
        return  # with the right delay noise would grow still less
    late = np.linspace(0.0, LATENCY_S, 11)[1:]
    tried = [as_stamped, *(_noise(run.channels["kinect"], base, late_s) for late_s in late)]
    many = min(map(len, tried))
    if many < 2:
        return
    noise = min(tried, key=lambda one: np.prod(one[many - 1]))[:many]
    if not noise[0].all() or (noise[1] > _STEADY * noise[0]).any():
        return
    grown = (noise / noise[0]).min(axis=1)
    full = next((k for k in range(len(grown) - 1) if grown[k + 1] < _FULL * grown[k]), None)
    if full is None or grown[full] < _GROWS:
        return
    along, across, turn = base.noise
    if (noise[full] < (np.hypot(along, across), turn)).any():  # counts that last for several fixes may make as much
        return
    apart, t = _LAGS[full + 1], run.channels["kinect"].t
    if apart * np.median(np.diff(t)) > 2.0 * LATENCY_S:
        return  # whoever smooths for so long is late by half of it
    fixes = len(t)
    left_out = np.setdiff1d(np.arange(fixes), np.arange(0, fixes, apart))
    what = f"their noise is alike over some {apart} fixes"
    repair = LeftOut("kinect", tuple(left_out.tolist()))
    yield Finding("samples_smoothed", what, "kinect", repairs=(repair,))


def _noise(kinect, base, late_s) -> np.ndarray:
    """(lags, 2) noise of places [m] and headings [rad] beside the wheels' motion, by third differences at each lag.

    late_s: of the camera.
    """
    found, (begin, *_, end) = [], base.encoder.t + late_s
    inside = np.flatnonzero((kinect.t >= begin) & (kinect.t <= end))
    for lag in _LAGS:
        if len(inside) < 3 * lag + _FEWEST:
            break
        first, last = inside[:-lag], inside[lag:]
        windows = between(kinect, first, last)
        apart = seen(kinect, windows) - base.moved(windows.since_s - late_s, windows.until_s - late_s)
        twice = apart[2 * lag :] - 2.0 * apart[lag:-lag] + apart[: -2 * lag]
        along, across, turn = of_third(twice)
        found.append((np.hypot(along, across), turn))
    return np.array(found)
