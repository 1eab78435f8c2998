"""Angles and planar frames.

Frame W is the world, fixed to the room's floor. Frame B is the robot's body: x forward, y left, z up.
"""

import numpy as np

from drake_ispace.blocks.kernels import kernel


@kernel
def wrap(angle):
    """Return `angle` [rad] wrapped to [-pi, pi)."""
    return angle - 2.0 * np.pi * np.floor((angle + np.pi) / (2.0 * np.pi))


def rotated(vectors: np.ndarray, angles: np.ndarray | float) -> np.ndarray:
    """Return vectors (k, 2), each rotated counterclockwise by its angle (k,) [rad], or all by one.

    By a robot's heading that is from B into W, by minus the heading from W into B.
    """
    c, s = np.cos(angles), np.sin(angles)
    x, y = vectors.T
    return np.column_stack([c * x - s * y, s * x + c * y])
