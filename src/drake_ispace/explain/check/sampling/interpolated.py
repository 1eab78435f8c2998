"""Fixes that a table interpolates between those of the camera: straight lines from fix to fix, with a bend at each.

Their noise is that of a few fixes, spread over many rows. The channel alone shows it.
"""

from collections.abc import Iterator

import numpy as np
from scipy.stats import binom

from drake_ispace.explain.check.finding import Finding
from drake_ispace.explain.check.sampling.samples import come_in_step, stretches
from drake_ispace.explain.levels import CHANCE
from drake_ispace.faults.repair import LeftOut
from drake_ispace.files.recording import Recording

_DIGITS = range(3, 10)  # of a place in metres, as tables are written
_WIDEST = 4  # rows on either side of a bend over which it is looked for: the more, the larger it is beside rounding
_SHOWS = 10.0  # times the last digit that a robot must move from row to row for every bend to show
_ROUNDS = 3  # in which the step and its multiples are found in turn


def interpolated_fixes(run: Recording) -> Iterator[Finding]:
    """Places on straight lines that bend every few rows; those at the bends are kept."""
    kinect = run.channels.get("kinect")
    if kinect is None or len(kinect.t) <= 2 * _WIDEST:
        return
    last = _last_digit(kinect.values[:, :2])
    kept = max((_bends(kinect, last, wide) for wide in range(1, _WIDEST + 1)), key=len)
    if not len(kept):
        return
    left_out = np.setdiff1d(np.arange(1, len(kinect.t) - 1), kept)
    what = f"straight lines over {len(kinect.t) / (len(kinect.t) - len(left_out)):.3g} rows on the average"
    repair = LeftOut("kinect", tuple(left_out.tolist()))
    yield Finding("samples_interpolated", what, "kinect", repairs=(repair,))


def _bends(kinect, last, wide) -> np.ndarray:
    """Numbers of the rows at which lines over `wide` rows bend, and of those at which they may; none if not in step.

    last: digit [m] of the places.
    """
    places, apart = kinect.values[:, :2], (kinect.t[wide:] - kinect.t[:-wide])[:, None]
    moved = places[wide:] - places[:-wide]
    speed = moved / apart
    bends = np.abs(speed[wide:] - speed[:-wide]) * np.minimum(apart[wide:], apart[:-wide])
    # of two differences of rounded numbers, each is off by a digit at most
    straight = (bends <= 2.0 * last + 1e-9 * np.abs(places).max()).all(axis=1)
    if 2 * straight.sum() < len(straight):
        return np.empty(0, int)
    # a bend shows from `wide` rows before it to as many after it
    at = np.array([(begin + end - 1) // 2 + wide for begin, end in stretches(~straight)], dtype=int)
    times = _steps_between(at)
    if times is not None:
        between = [np.linspace(*ends) for ends in zip(at[:-1], at[1:], times + 1, strict=True)]
        return np.unique(np.rint(np.concatenate(between)).astype(int))
    shows = wide == 1 and np.median(np.abs(moved).max(axis=1)) >= _SHOWS * last
    return at if shows and come_in_step(straight) else np.empty(0, int)


def _steps_between(at) -> np.ndarray | None:
    """(n - 1,) how many steps of one length lie between bends (n,) in turn; None if they do not come in step.

    Where the camera hardly saw a change of speed, rounding hides the bend. A bend shows within a row of its place, so
    that bends come in step if that is so for nearly all of them, and for more than chance would have it.
    """
    apart = np.diff(at)
    if not len(apart):
        return None
    step = np.quantile(apart, 0.1)
    for _ in range(_ROUNDS):
        times = np.maximum(np.rint(apart / step), 1).astype(int)
        step = apart.sum() / times.sum()
    right = np.abs(apart - times * step) <= 1.0
    by_chance = binom.sf(right.sum() - 1, len(apart), min(3.0 / step, 1.0))
    return times if right.mean() >= 0.9 and by_chance < CHANCE else None


def _last_digit(places):
    """The last digit [m] with which places are written; 0 where they have more than a table has."""
    digits = (10.0**-n for n in _DIGITS)
    return next((digit for digit in digits if np.abs(places - np.round(places / digit) * digit).max() < 1e-12), 0.0)
