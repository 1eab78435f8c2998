"""Direction, speed and corners of a recorded reference."""

import numpy as np

from drake_ispace.files.recording import Channel

_SAME_M_S = 1e-3
_CORNER_RAD = 0.25  # from one sample of the reference to the next


def direction_of(reference: Channel) -> tuple[np.ndarray, np.ndarray]:
    """Direction [rad] and speed [m/s] at every sample of the reference: the mean of both steps beside it on a smooth
    path, at a corner and where it starts and stops that of the steps which goes on as it is."""
    steps = np.diff(reference.values[:, :2], axis=0) / np.diff(reference.t)[:, None]
    steps = np.vstack([steps[:1], steps[:1], steps, steps[-1:], steps[-1:]])
    behind, ahead = steps[1:-2], steps[2:-1]
    change_behind, change_ahead = _size(behind - steps[:-3]), _size(steps[3:] - ahead)
    smooth = np.abs(change_ahead - change_behind) < 0.5 * np.maximum(change_ahead, change_behind) + _SAME_M_S
    kept = np.where((change_ahead < change_behind)[:, None], ahead, behind)
    velocity = np.where(smooth[:, None], 0.5 * (ahead + behind), kept)
    return np.arctan2(velocity[:, 1], velocity[:, 0]), _size(velocity)


def _size(vectors):
    return np.linalg.norm(vectors, axis=1)


def turn_of(reference: Channel, direction: np.ndarray, speed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rate [rad/s] at which `direction` turns at every sample, and whether that is a corner."""
    turn = np.gradient(np.unwrap(direction), reference.t) * (speed > 1e-6)
    return turn, np.abs(turn) * np.median(np.diff(reference.t)) > _CORNER_RAD
