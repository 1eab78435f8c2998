"""What counts leave: a run as its encoders would have shown it, had each stood elsewhere within its count.

A wheel is within half a count of what its encoder shows, and stays there while it rests. The error lasts as long as the
wheel needs for a count: with few counts a turn longer than a sample, so that it does not average out.
"""

from dataclasses import replace

import numpy as np

from drake_ispace.blocks.rates import TICK_S
from drake_ispace.explain.counts import straightened
from drake_ispace.explain.predict.tracks import Track


class Recounting:
    """Draws of where the encoders of a run under commanded velocity stood within their counts.

    Args:
        track: the run. wheels: the number of them. count_rad: of their encoders.
    """

    def __init__(self, track: Track, wheels: int, count_rad: float):
        self._track, self._count = track, count_rad
        self._at = np.arange(len(track.measured)) if track.reads is None else track.reads
        self._path = track.turned[self._at, :wheels]

    def drawn(self, generator: np.random.Generator) -> Track:
        """The run with other counts: each encoder is displaced by part of a count, the same all the time."""
        track, by = self._track, generator.uniform(-0.5, 0.5, self._path.shape[1])
        counted = self._count * (np.floor(self._path / self._count + by) + 0.5 - by)
        turned = self._change(straightened(self._at * TICK_S, counted))
        if track.rounding is None:
            return replace(track, measured=track.measured + turned)
        shown = self._change(counted)
        return replace(track, measured=track.measured + shown, rounding=track.rounding + shown - turned)

    def _change(self, angles):
        """(rows, p) change of `measured` if wheels stood at angles (k, wheels) where they were read."""
        change, ticks = np.zeros(self._track.measured.shape), np.arange(len(self._track.measured))
        for wheel, column in enumerate((angles - self._path).T):
            change[:, wheel] = np.interp(ticks, self._at, column)
        return change
