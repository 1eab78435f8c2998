"""The gyro beside the camera's headings, where no model of the robot says what a gyro shows: its zero and its scale.

A model with an IMU has effects for both, which a diagnosis tries.
"""

from collections.abc import Iterator

import numpy as np

from drake_ispace.explain.check.compare.links import FEWEST, LATENCY_S, integral
from drake_ispace.explain.check.compare.motion import windows
from drake_ispace.explain.check.compare.regression import MOST_SLACK, scale_of, weights
from drake_ispace.explain.check.finding import Finding
from drake_ispace.explain.levels import CERTAIN
from drake_ispace.faults.repair import Mixed
from drake_ispace.files.recording import Recording
from drake_ispace.robots.robot import Robot

_SOUND = np.array([0.01, 0.012])  # by which a sound gyro's scale, and its rate at rest [rad/s], are off at most
_ROUNDS = 20


def gyro_findings(run: Recording, robot: Robot) -> Iterator[Finding]:
    """A gyro whose turns about the vertical are larger or smaller than the camera's, or go on at rest."""
    if robot.has_imu or not robot.in_room or not {"imu", "kinect"} <= run.channels.keys():
        return
    kinect, imu = run.channels["kinect"], run.channels["imu"]
    seen = windows(kinect)
    inner = (seen.since_s - LATENCY_S >= imu.t[0]) & (seen.until_s + LATENCY_S <= imu.t[-1])
    if inner.sum() < 2 * FEWEST:
        return
    since, until = seen.since_s[inner], seen.until_s[inner]
    headings = np.unwrap(kinect.column("phi"))
    turns = headings[seen.last[inner]] - headings[seen.first[inner]]
    later = [integral(imu, ("wz",), at - LATENCY_S, at + LATENCY_S)[:, 0] for at in (since, until)]
    late = later[1] - later[0]  # what a camera that is late adds is in proportion to this
    known = np.column_stack([integral(imu, ("wz",), since, until)[:, 0], until - since, late])
    (factor, offset, _), std = _fitted(known, turns)
    wrong = np.abs([factor - 1.0, offset]) - CERTAIN * std[:2] > _SOUND
    if not wrong.any() or abs(factor - 1.0) > MOST_SLACK:
        return
    texts = f"{1.0 / factor:.3g} times the camera's rate", f"off by {-offset / factor:.2g} rad/s at rest"
    said = [text for text, which in zip(texts, wrong, strict=True) if which]
    factor, offset = np.where(wrong, [factor, offset], [1.0, 0.0]).tolist()
    repair = Mixed("imu", ("wz",), ((factor,),), (offset,))
    yield Finding("gyro_off", f"wz is {' and '.join(said)}", "imu", repairs=(repair,))


def _fitted(x, y):
    """(k,) factors of x (n, k) that make y (n,), and their standard deviations; what is far out hardly counts."""
    size = np.sqrt((x**2).mean(axis=0)) + 1e-12
    x, weight = x / size, np.ones(len(y))  # errors are taken to be of Student's distribution
    steady = 1e-12 * np.eye(x.shape[1])
    for _ in range(_ROUNDS):
        covariance = np.linalg.inv((x * weight[:, None]).T @ x + steady)
        factors = covariance @ (x * weight[:, None]).T @ y
        left = y - x @ factors
        scale = float(scale_of(left)) + 1e-12
        weight = weights(left / scale)
    return factors / size, scale * np.sqrt(np.diag(covariance)) / size
