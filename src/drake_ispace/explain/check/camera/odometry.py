"""A camera that knows the wheels: poses that were computed from their counts say nothing of where the robot is."""

from collections.abc import Iterator

import numpy as np
from scipy.stats import norm

from drake_ispace.explain.check.compare.links import FEWEST, LATENCIES_S, LATENCY_S, Base
from drake_ispace.explain.check.compare.motion import Windows, has_motion, seen, turned, within
from drake_ispace.explain.check.finding import Finding
from drake_ispace.faults.repair import Without
from drake_ispace.files.recording import Recording

_MEDIAN = float(norm.isf(0.25))  # of the size of a normal number
_WHOLE = 0.1  # of a count, by which angles that were rounded in a file may be off
_DIGITS = 9  # of angles [rad], beyond which computing rounds them
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
    steps = Windows(kinect.t[first], kinect.t[last[first]], first, last[first])
    inner = within(encoder, steps, -LATENCY_S) & within(encoder, steps, LATENCY_S)
    if not count or not inner.any():
        return
    ways, since, until = seen(kinect, steps)[inner], steps.since_s[inner], steps.until_s[inner]
    rounding = count / np.sqrt(6.0) * np.linalg.norm(base.geometry.forward, axis=1)
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
    """The step [rad] that all angles (n, wheels) are whole numbers of; 0 where it is not known.

    It is as stated by the model, or the smallest by which changes of angles differ.
    """
    ways, angles = np.abs(np.diff(angles, axis=0)), angles - angles[0]
    gaps = np.diff(np.unique(np.round(ways, _DIGITS)))
    for about in (stated or np.inf, gaps.min(initial=np.inf)):
        count = _of_whole(angles, _of_whole(ways, about))  # changes are few counts, even of a step that is a little off
        if np.isfinite(count) and np.abs(angles / count - np.rint(angles / count)).max() < _WHOLE:
            return count
    return 0.0


def _of_whole(values, about):
    """The step that values are nearest to whole numbers of, near `about`; infinite where they are none."""
    counts = np.rint(values / about)
    return float(np.vdot(counts, values) / np.vdot(counts, counts)) if counts.any() else np.inf
