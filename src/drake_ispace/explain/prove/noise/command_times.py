"""What it leaves of free runs that no log says when, between two of its samples, a command changed."""

from collections.abc import Sequence

import numpy as np

from drake_ispace.blocks.rates import TICK_S
from drake_ispace.explain.predict.tracks import Track


def left_by_command_times(tracks: Sequence[Track], horizon_s: float) -> dict[str, float]:
    """Root mean square error [m, rad] of "position" and "heading" over a horizon of robots under commanded velocity.

    A change by u at any moment of a step T moves the robot by up to u T more or less than said, u T / sqrt(12) in the
    root mean square. A turn so early or late leads aside all that the robot goes afterwards.
    """
    x, y, heading = _squares_per_s(tracks, np.eye(3)) * horizon_s
    driving = np.vstack([track.command[: track.ticks, :2] for track in tracks])
    way_m = np.mean(np.linalg.norm(driving, axis=1)) * horizon_s
    return {"position": float(np.sqrt(x + y + heading * way_m**2 / 3.0)), "heading": float(np.sqrt(heading))}


def angles_left_by_command_times(tracks: Sequence[Track], wheels: np.ndarray, horizon_s: float) -> float:
    """Root mean square error of the angle [rad] of the wheel that unknown moments of changes move most, over a horizon.

    wheels: (n, 3) speeds of the wheels per velocity of the body.
    """
    return float(np.sqrt(_squares_per_s(tracks, wheels).max() * horizon_s))


def _squares_per_s(tracks, axes) -> np.ndarray:
    """(n,) by how much the mean square of what commands add up to, along the axes (n, 3), grows in a second."""
    commands = [track.command[: track.ticks] @ axes.T for track in tracks]
    each = [
        np.sum(np.diff(command, axis=0) ** 2, axis=0) * track.command_step_s**2 / 12.0
        for command, track in zip(commands, tracks, strict=True)
    ]
    return np.sum(each, axis=0) / (sum(map(len, commands)) * TICK_S)
