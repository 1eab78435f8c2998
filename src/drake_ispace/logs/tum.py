"""Trajectories in the TUM format, one pose a line: t x y z qx qy qz qw."""

import numpy as np

from drake_ispace.blocks.errors import InputError, expected_one_of
from drake_ispace.files.recording import Recording


def trajectory(recording: Recording, channel: str, where: str) -> str:
    """The text of the poses of a channel, on the floor, z = 0.

    Raises:
        InputError: no such channel in the recording, or one without poses. It begins with `where`.
    """
    known = [name for name in ("kinect", "truth", "reference") if name in recording.channels]
    if channel not in known:
        raise InputError(f"{where}: there are no poses in channel {channel}, {expected_one_of(channel, known)}")
    one = recording.channels[channel]
    x, y, phi = (one.column(name) for name in ("x", "y", "phi"))
    rows = np.column_stack([one.t, x, y, np.zeros((len(x), 3)), np.sin(phi / 2.0), np.cos(phi / 2.0)])
    return "".join(" ".join(map(repr, row)) + "\n" for row in rows.tolist())
