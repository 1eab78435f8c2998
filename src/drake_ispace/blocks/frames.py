"""Angles and planar frames.

Frame W is the world, fixed to the room's floor. Frame B is the robot's body: x forward, y left, z up.
"""

import numpy as np

from drake_ispace.blocks.kernels import kernel


@kernel
def wrap(angle):
    """Return `angle` [rad] wrapped to [-pi, pi)."""
    return angle - 2.0 * np.pi * np.floor((angle + np.pi) / (2.0 * np.pi))
