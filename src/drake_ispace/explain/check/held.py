"""Samples that a table holds until the next one, because it has a row for every sample of a faster channel.

Such a sample is as late as it is old, and no constant delay makes up for it.
"""

from collections.abc import Iterator

import numpy as np

from drake_ispace.explain.check.compare.links import RATE_S, Base, inside
from drake_ispace.explain.check.compare.motion import has_motion
from drake_ispace.explain.check.finding import Finding
from drake_ispace.explain.check.samples import STUCK_S, stretches
from drake_ispace.explain.predict.counts import count_of
from drake_ispace.faults.repair import LeftOut
from drake_ispace.files.recording import Recording

_OFTEN = 0.1  # share of the samples on the move
_DUST_M = 1e-9  # rounding of numbers


def held_fixes(run: Recording, base: Base | None, number: int) -> Iterator[Finding]:
    """Fixes that come again although the robot moves by more than the camera's finest step."""
    if base is None or not has_motion(run):
        return
    kinect = run.channels["kinect"]
    since, until = kinect.t[:-1], kinect.t[1:]
    shows = inside(base, since, until)
    moved = np.linalg.norm(base.moved(since[shows], until[shows])[:, :2], axis=1)
    shows[shows] = moved > np.sqrt(2.0) * _finest_m(kinect)
    again = ~np.diff(kinect.values[:, :3], axis=0).any(axis=1)
    yield from _held("kinect", kinect.t, again, shows, lambda: again, number)


def held_angles(run: Recording, number: int) -> Iterator[Finding]:
    """Angles of all wheels that come again although one of them turns by several counts from row to row."""
    encoder = run.channels.get("encoder")
    if encoder is None or len(encoder.t) < 2:
        return
    t, again, turned = encoder.t, ~np.diff(encoder.values, axis=0).any(axis=1), np.zeros(len(encoder.t) - 1)
    for angle in encoder.values.T:
        before = (angle[:-1] - np.interp(t[:-1] - RATE_S, t, angle)) / RATE_S
        after = (np.interp(t[1:] + RATE_S, t, angle) - angle[1:]) / RATE_S
        steady = np.where(before * after > 0.0, np.minimum(np.abs(before), np.abs(after)), 0.0) * np.diff(t)
        turned = np.maximum(turned, steady / max(count_of(angle), np.finfo(float).eps))
    shows = turned > 2.0  # a wheel that turns on by that passes at least one count
    yield from _held("encoder", t, again, shows, lambda: _old_angles(again, shows), number)


def _held(channel, t, again, shows, old, number):
    """The Finding that samples of a channel repeat the one before too often where motion shows.

    again, shows (n - 1,), of each sample at `t` (n,) but the first: whether it repeats the one before, and whether it
    should not. A channel that stops for a while is another matter. old: gives those (n - 1,) that are left out.
    """
    for first, last in stretches(again):
        if t[last] - t[first] >= STUCK_S:
            shows[first:last] = False
    if shows.any() and again[shows].mean() > _OFTEN:
        what = f"{100.0 * again[shows].mean():.0f} % of the samples on the move repeat the one before"
        samples = tuple((np.flatnonzero(old()) + 1).tolist())
        yield Finding("samples_held", what, "", (number,), channel, repairs=(LeftOut(channel, samples),))


def _old_angles(again, shows):
    """(n - 1,) which angles are old: where every k-th sample is fresh all others, else those that should differ.

    Of a robot that hardly moves a sample that repeats the one before may be fresh.
    """
    fresh, samples = shows & ~again, np.arange(len(again))
    every = round(shows.sum() / max(fresh.sum(), 1))
    phases = np.unique(samples[fresh] % every)
    return samples % every != phases[0] if len(phases) == 1 else again & shows


def _finest_m(kinect) -> float:
    """Twice the finest step of the camera's places [m]: where they are the middle of two markers, a step of one."""
    steps = [np.diff(np.unique(kinect.values[:, axis])) for axis in (0, 1)]
    return 2.0 * max(min(step[step > _DUST_M], default=0.0) for step in steps)
