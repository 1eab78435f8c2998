"""A camera that knows the wheels: poses that were computed from their counts say nothing of where the robot is."""

from collections.abc import Iterator

import numpy as np
from scipy.stats import norm

from drake_ispace.explain.check.compare.links import FEWEST, LATENCIES_S, Base, inside_late_or_early
from drake_ispace.explain.check.compare.motion import between, has_motion, seen, turned
from drake_ispace.explain.check.finding import Finding
from drake_ispace.explain.counts import count_of
from drake_ispace.faults.repair import Without
from drake_ispace.files.recording import Recording

_MEDIAN = float(norm.isf(0.25))  # of the size of a normal number
_WHOLE = 0.1  # of a count, by which angles that were rounded in a file may be off
_ROWS = 2  # of the encoder, as far apart as motions begin and end: both are then rounded, each by itself


def odometry_findings(run: Recording, base: Base | None) -> Iterator[Finding]:
    """Poses that tell the motion of the wheels far better than their counts do, whatever the dimensions of the robot.

    What sees the robot, and not its encoders, cannot know how their counts are rounded.
    """
    if base is None or not base.robot.in_room or not has_motion(run):
        return
    encoder, kinect = base.encoder, run.channels["kinect"]
    count = _count(encoder.values, base.count_rad)
    last = np.searchsorted(kinect.t, kinect.t + _ROWS * np.median(np.diff(encoder.t)))
    first = np.flatnonzero(last < len(kinect.t))
    steps = between(kinect, first, last[first])
    inner = inside_late_or_early(base, steps)
    if not count or not inner.any():
        return
    ways, since, until = seen(kinect, steps)[inner], steps.since_s[inner], steps.until_s[inner]
    rounding = base.rounding(count)
    told = rounding > 0.0
    for lag_s in LATENCIES_S:
        angles = turned(encoder, since + lag_s, until + lag_s)
        moves, moved = (np.abs(angles) > count).any(axis=1), (angles @ base.geometry.forward.T)[:, told]
        off = np.abs(moved - ways @ np.linalg.lstsq(ways, moved, rcond=None)[0])[moves] / rounding[told]
        if len(off) >= FEWEST * FEWEST and np.median(off) < 0.5 * _MEDIAN:
            what = "poses tell the wheels' motion better than the counts do"
            yield Finding("camera_is_odometry", what, "kinect", repairs=(Without("kinect"),))
            return


def _count(angles, stated):
    """The step [rad] that all angles (n, wheels) are whole numbers of: as the model states, or they show; 0: none."""
    counts = (angles - angles[0]) / (stated or np.inf)
    is_stated = counts.any() and np.abs(counts - np.rint(counts)).max() < _WHOLE
    return stated if is_stated else count_of(angles)
