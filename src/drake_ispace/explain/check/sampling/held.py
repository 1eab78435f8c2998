"""Samples that a table holds until the next one, because it has a row for every sample of a faster channel.

Such a sample is as late as it is old, and no constant delay makes up for it. The channel alone shows it: after samples
that repeat the one before it catches up, by as many times its usual step. What is rounded goes on by one step of its
rounding, and what stood still by a step of its motion.
"""

from collections.abc import Iterator

import numpy as np

from drake_ispace.explain.check.finding import Finding
from drake_ispace.explain.check.sampling.samples import STUCK_S, repeats, stretches
from drake_ispace.explain.counts import count_of
from drake_ispace.explain.levels import BLOCK_TICKS
from drake_ispace.faults.repair import LeftOut
from drake_ispace.files.recording import Recording

_OFTEN = 0.1  # share of the steps
_LARGE = 3.0  # finest steps: a camera's markers may both move on by one of its pixels along both axes
_CAUGHT_UP = 0.7  # of the way of the samples that were missed
_AROUND = 5  # times a stretch of samples, before and after it, in which the channel's usual speed is told


def held_samples(run: Recording) -> Iterator[Finding]:
    """Fixes, or angles of all wheels, that come again and then catch up."""
    for name in ("kinect", "encoder"):
        channel = run.channels.get(name)
        if channel is None or len(channel.t) < 2:
            continue
        is_camera, values = name == "kinect", channel.values
        again = repeats(values[:, :3] if is_camera else values)
        places = values[:, :2] if is_camera else values
        held, share = _held(places, again, _finest_step(places) if is_camera else _usual_count(places))
        if share > _OFTEN and len(held) >= 1.0 / _OFTEN:
            old = _brief(channel.t, again) if is_camera else _old_angles(again, held)
            what = f"{100.0 * share:.0f} % of the larger steps come after samples that repeat the one before"
            repair = LeftOut(name, tuple((np.flatnonzero(old) + 1).tolist()))
            yield Finding("samples_held", what, name, repairs=(repair,))


def _finest_step(places) -> float:
    """The shortest way between two of (n, 2) places in turn that is no rounding of numbers; 0 if there is none."""
    ways = np.linalg.norm(np.diff(places, axis=0), axis=1)
    return float(min(ways[ways > np.sqrt(np.finfo(float).eps) * ways.max()], default=0.0))


def _usual_count(angles) -> float:
    """The count of angles (n, wheels), or that of most parts of a run: numbers of few digits grow coarser with size."""
    parts = np.array_split(angles, max(len(angles) // BLOCK_TICKS, 1))
    of_all, *of_parts = (max(map(count_of, part.T)) for part in [angles, *parts])
    return max(of_all, float(np.median(of_parts)))


def _held(values, again, finest) -> tuple[list[tuple[int, int]], float]:
    """Stretches (first, last sample) that are held, and the share of the larger steps that come after one.

    finest: step that values (n, d) may make.
    """
    sizes = np.linalg.norm(np.diff(values, axis=0), axis=1)
    large = sizes > _LARGE * finest
    held = []
    for first, last in stretches(again):
        if last == len(sizes) or not large[last]:
            continue
        rows = last - first + 1
        usual = np.mean(sizes[max(first - _AROUND * rows, 0) : last + 1 + _AROUND * rows])
        if sizes[last] > _CAUGHT_UP * rows * usual:
            held.append((first, last))
    return held, len(held) / max(np.sum(large), 1)


def _brief(t, again):
    """(n - 1,) which samples repeat the one before, but where a channel stops for longer."""
    old = again.copy()
    for first, last in stretches(again):
        if t[last] - t[first] >= STUCK_S:
            old[first:last] = False
    return old


def _old_angles(again, held):
    """(n - 1,) which angles are old: where every k-th sample is fresh all others, else those that are held.

    Of a wheel that hardly turns a sample that repeats the one before may be fresh.
    """
    old, samples = np.zeros(len(again), bool), np.arange(len(again))
    for first, last in held:
        old[first:last] = True
    every = round(np.median([last - first + 1 for first, last in held]))
    phases = np.unique(samples[~again] % every)
    return samples % every != phases[0] if len(phases) == 1 else old
