"""Recordings of the robots that the package knows, their wheels checked by name."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from drake_ispace.files import recording
from drake_ispace.files.recording import Recording
from drake_ispace.robots.library import robots
from drake_ispace.robots.robot import TORQUE, Robot


def load(path: str | Path) -> Recording:
    """The run in the folder `path`, checked and in SI units.

    Raises:
        InputError: what is wrong with it.
    """
    robots()  # tells what the wheels of each are called
    return recording.load(path)


def by_wheel(run: Recording, robot: Robot, plant: Any, name: str) -> Recording:
    """The run with the columns of its wheels in the order of the plant's; name: of the run, for messages.

    Raises:
        InputError: a column of no wheel, or a wheel without a column.
    """
    ordered = {
        channel: robot.by_wheel(run.channels[channel], plant, f"{name}: channel {channel}")
        for channel in ("encoder", TORQUE) if channel in run.channels
    }
    return replace(run, channels=run.channels | ordered)
