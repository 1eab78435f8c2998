"""Recordings of the robots that the package knows, their wheels checked by name."""

from pathlib import Path

from drake_ispace.files import recording
from drake_ispace.files.recording import Recording
from drake_ispace.robots.library import robots


def load(path: str | Path) -> Recording:
    """The run in the folder `path`, checked and in SI units.

    Raises:
        InputError: what is wrong with it.
    """
    robots()  # tells what the wheels of each are called
    return recording.load(path)
