"""The gyro beside the camera's headings, where no model of the robot says what a gyro shows: its zero and its scale.

A model with an IMU has effects for both, which a diagnosis tries.
"""

from collections.abc import Iterator

import numpy as np

from drake_ispace.explain.check.compare.gyro_rates import fitted, turns_seen
from drake_ispace.explain.check.compare.regression import MOST_SLACK
from drake_ispace.explain.check.finding import Finding
from drake_ispace.explain.levels import CERTAIN
from drake_ispace.faults.repair import Mixed
from drake_ispace.files.recording import Recording
from drake_ispace.robots.robot import Robot

_SOUND = np.array([0.01, 0.012])  # by which a sound gyro's scale, and its rate at rest [rad/s], are off at most


def gyro_findings(run: Recording, robot: Robot) -> Iterator[Finding]:
    """A gyro whose turns about the vertical are larger or smaller than the camera's, or go on at rest."""
    if robot.has_imu or not robot.in_room or not {"imu", "kinect"} <= run.channels.keys():
        return
    found = fitted(run.channels["imu"], *turns_seen(run.channels["kinect"]))
    if found is None:
        return
    (factor, offset, _), std = found
    wrong = np.abs([factor - 1.0, offset]) - CERTAIN * std[:2] > _SOUND
    if not wrong.any() or abs(factor - 1.0) > MOST_SLACK:
        return
    texts = f"{1.0 / factor:.3g} times the camera's rate", f"off by {-offset / factor:.2g} rad/s at rest"
    said = [text for text, which in zip(texts, wrong, strict=True) if which]
    factor, offset = np.where(wrong, [factor, offset], [1.0, 0.0]).tolist()
    repair = Mixed("imu", ("wz",), ((factor,),), (offset,))
    yield Finding("gyro_off", f"wz is {' and '.join(said)}", "imu", repairs=(repair,))
