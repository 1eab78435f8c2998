"""Fixes that a table interpolates between those of the camera: straight lines from fix to fix, with a bend at each.

Their noise is that of a few fixes, spread over many rows. The channel alone shows it.
"""

from collections.abc import Iterator

import numpy as np

from drake_ispace.explain.check.finding import Finding
from drake_ispace.explain.check.samples import come_in_step, stretches
from drake_ispace.faults.repair import LeftOut
from drake_ispace.files.recording import Recording

_DIGITS = range(3, 10)  # of a place in metres, as tables are written
_SHOWS = 10.0  # times the last digit that a robot must move from row to row


def interpolated_fixes(run: Recording, number: int) -> Iterator[Finding]:
    """Places on straight lines that bend every few rows; those at the bends are kept."""
    kinect = run.channels.get("kinect")
    if kinect is None or len(kinect.t) < 3:
        return
    places, apart = kinect.values[:, :2], np.diff(kinect.t)[:, None]
    last = _last_digit(places)
    speed = np.diff(places, axis=0) / apart
    bends = np.abs(np.diff(speed, axis=0)) * np.minimum(apart[:-1], apart[1:])
    # of two differences of rounded numbers, each is off by a digit at most
    straight = (bends <= 2.0 * last + 1e-9 * np.abs(places).max()).all(axis=1)
    if np.median(np.abs(np.diff(places, axis=0)).max(axis=1)) < _SHOWS * last or not come_in_step(straight):
        return
    kept = np.zeros(len(kinect.t), bool)
    kept[[0, -1]] = True
    kept[[first + 1 for first, _ in stretches(~straight)]] = True  # a bend between two rows shows at both
    what = f"straight lines over {len(kinect.t) / np.sum(kept):.3g} rows on the average"
    repair = LeftOut("kinect", tuple(np.flatnonzero(~kept).tolist()))
    yield Finding("samples_interpolated", what, "", (number,), "kinect", repairs=(repair,))


def _last_digit(places):
    """The last digit [m] with which places are written; 0 where they have more than a table has."""
    digits = (10.0**-n for n in _DIGITS)
    return next((digit for digit in digits if np.abs(places - np.round(places / digit) * digit).max() < 1e-12), 0.0)
