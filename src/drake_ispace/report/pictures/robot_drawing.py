"""The top view of a robot to scale: wheels, names, senses of rotation."""

from pathlib import Path

import numpy as np

from drake_ispace.report.pictures.plots import plt, save
from drake_ispace.robots.robot_file import RobotFile

_WIDTH_SHARE = 0.35  # of a wheel's width, of its diameter; robot files do not tell it


def draw_robot(robot: RobotFile, out: Path) -> None:
    """Write the picture: x of the robot up, each wheel with its name and an arrow along its drive direction."""
    figure, axis = plt.subplots(figsize=(6.0, 6.0), layout="constrained")
    reach = max(np.hypot(w.x_m, w.y_m) + 2.0 * w.radius_m for w in (entry.wheel for entry in robot.wheels))
    for entry in robot.wheels:
        wheel = entry.wheel
        c, s = np.cos(wheel.drive_rad), np.sin(wheel.drive_rad)
        r, half = wheel.radius_m, _WIDTH_SHARE * wheel.radius_m
        corners = np.array([[r, half], [-r, half], [-r, -half], [r, -half]]) @ np.array([[c, s], [-s, c]])
        corners += [wheel.x_m, wheel.y_m]
        axis.add_patch(plt.Polygon(_up(corners), fc="0.85" if not wheel.holds_sideways else "0.55", ec="0.2"))
        if wheel.roller_rad:
            along = wheel.drive_rad + wheel.roller_rad
            ends = np.array([[wheel.x_m, wheel.y_m]]) + np.outer([-half, half], [np.cos(along), np.sin(along)]) * 1.5
            axis.plot(*_up(ends).T, color="0.2", lw=1.0)
        tip = np.array([wheel.x_m + 1.6 * r * c, wheel.y_m + 1.6 * r * s])
        axis.annotate("", _up(tip), _up(np.array([wheel.x_m, wheel.y_m])), arrowprops={"arrowstyle": "->", "lw": 1.6})
        away = np.array([wheel.x_m, wheel.y_m]) * (1.0 + 1.4 * r / max(np.hypot(wheel.x_m, wheel.y_m), 1e-9))
        axis.text(*_up(away), entry.name, ha="center", va="center")
    for direction, name in (((1.0, 0.0), "x"), ((0.0, 1.0), "y")):
        end = 0.35 * reach * np.array(direction)
        axis.annotate("", _up(end), (0.0, 0.0), arrowprops={"arrowstyle": "->", "color": "tab:blue"})
        axis.text(*_up(1.12 * end), name, color="tab:blue", ha="center", va="center")
    axis.set(
        xlim=(-1.3 * reach, 1.3 * reach), ylim=(-1.3 * reach, 1.3 * reach),
        aspect="equal", xlabel="-y [m]", ylabel="x [m]", title=f"{robot.name}, from above; arrows: turning forward",
    )
    save(figure, out)


def _up(points):
    """Points of the robot's frame on the page: x up, y to the left."""
    points = np.asarray(points)
    return np.stack([-points[..., 1], points[..., 0]], axis=-1)
