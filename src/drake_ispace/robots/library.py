"""All robots by name: those of the package, then those that others register as entry points `drake_ispace.robots`."""

import functools
from importlib.metadata import entry_points

from drake_ispace.blocks.errors import InputError
from drake_ispace.files.recording import WHEELS
from drake_ispace.robots.omni import Omni
from drake_ispace.robots.pendulum import Pendulum
from drake_ispace.robots.robot import Robot
from drake_ispace.robots.rover import Rover


@functools.cache
def robots() -> dict[str, Robot]:
    """Name -> robot. An entry point names a Robot, or a subclass of it.

    Raises:
        InputError: an entry point that is no robot, or whose name is taken.
    """
    found: dict[str, Robot] = {robot.name: robot for robot in (Omni(), Pendulum(), Rover())}
    for entry in entry_points(group="drake_ispace.robots"):
        where, loaded = f"entry point {entry.name} of drake_ispace.robots", entry.load()
        robot = loaded() if isinstance(loaded, type) and issubclass(loaded, Robot) else loaded
        if not isinstance(robot, Robot):
            raise InputError(f"{where}: expected a Robot, got {robot!r}")
        if robot.name in found:
            raise InputError(f"{where}: there is a robot {robot.name} already")
        found[robot.name] = robot
    WHEELS.update({robot.name: robot.wheel_names for robot in found.values() if robot.wheel_names})
    return found
