"""Paths on the floor as tables over arc length, and the distance of points from a path."""

import itertools
import os
from dataclasses import dataclass

import numpy as np

from drake_ispace.blocks.errors import InputError, shown
from drake_ispace.blocks.kernels import kernel
from drake_ispace.blocks.messages import layout
from drake_ispace.files.quantity import quantity

KINDS = ("step", "pulse", "line", "square", "circle", "figure_eight", "polyline")
#: A row of a path's table: arc length s [m], x, y [m] in W, unit tangent in W, curvature [1/m].
ROW = layout("Row", "s x y tangent_x tangent_y curvature")
_SAME_M = 1e-9
_FARTHEST_M = 1e9
_MOST_POINTS = 10_000
_LARGEST_FILE = 1 << 20  # bytes


@dataclass
class Trajectory:
    """The reference: a path and how the way point moves along it ("continuous tracking")."""

    kind: str = quantity("square", choices=KINDS)
    # middle of the square, circle or figure eight; start of the line
    centre_m: list[float] = quantity([0.0, 0.0], "m", length=2)
    # side of the square
    side_m: float = quantity(1.2, "m", above=0.0)
    # of the circle; a figure eight is 4 radii long and 2 wide
    radius_m: float = quantity(0.6, "m", above=0.0)
    # goal of step, pulse and line
    goal_m: list[float] = quantity([1.0, 0.0], "m", length=2)
    # points of a polyline: [[x, y], ...]
    points_m: list[list[float]] = quantity([], "m", length=None)
    # or a file with the header x,y and the points in metres; a relative file name refers to the current folder
    csv: str | None = quantity(None)
    # time for which the pulse stays at its goal
    width_s: float = quantity(5.0, "s", above=0.0)
    # speed of the way point, section 6.8.2
    speed_m_s: float = quantity(0.25, "m/s", above=0.0)
    # time at which the way point leaves the start of the path
    start_s: float = quantity(1.0, "s", minimum=0.0)
    # number of laps of a closed path; 0: without end
    laps: int = quantity(1, minimum=0)
    # heading of the way point: fixed, or along the path
    heading: str = quantity("fixed", choices=("fixed", "tangent"))
    heading_rad: float = quantity(0.0, "rad")


@dataclass(frozen=True)
class Path:
    """A path as a table over arc length.

    Attributes:
        table: (n, 6) rows of arc length [m], x, y [m] in W, unit tangent (2) in W, curvature [1/m]. A corner is two
            rows of the same arc length. A path of a single row is a point.
        closed: whether the path ends where it starts.
    """

    table: np.ndarray
    closed: bool

    @property
    def length_m(self) -> float:
        return float(self.table[-1, ROW.s])

    @property
    def points_m(self) -> np.ndarray:
        """The vertices (n, 2) in W [m]."""
        return self.table[:, ROW.x : ROW.y + 1]

    def nearest(self, points_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the distance [m] of points (k, 2) [m] in W from the path and the nearest arc length [m], each (k,)."""
        if len(self.table) == 1:
            return np.linalg.norm(points_m - self.points_m[0], axis=1), np.zeros(len(points_m))
        gaps, arcs = np.empty(len(points_m)), np.empty(len(points_m))
        _nearest(self.table, np.ascontiguousarray(points_m, dtype=float), gaps, arcs)
        return gaps, arcs

    def progress(self, point_m: np.ndarray, arc_m: float) -> float:
        """Return by how much [m] the arc length of the place nearest to a point (2,) exceeds `arc_m`.

        Only places within a sixth of the path's length before or after `arc_m` count, so that a path that crosses
        itself is followed in order. The result is negative for a place before `arc_m`.
        """
        return _ahead(self.table, self.closed, float(point_m[0]), float(point_m[1]), float(arc_m))

    def follow(self, points_m: np.ndarray) -> np.ndarray:
        """Return the arc lengths (k,) [m] reached at successive points (k, 2) in W [m].

        The arc length starts at 0 and each point adds its `progress`, so that it keeps growing over several laps.
        """
        arcs = np.empty(len(points_m))
        _follow(self.table, self.closed, np.ascontiguousarray(points_m, dtype=float), arcs)
        return arcs


@kernel
def to_edge(ax, ay, bx, by, x, y):
    """Return the squared distance [m^2] from (x, y) to the edge from a to b, and the share of it to the nearest place.
    """
    ex, ey = bx - ax, by - ay
    along = ((x - ax) * ex + (y - ay) * ey) / max(ex * ex + ey * ey, 1e-30)
    along = min(max(along, 0.0), 1.0)
    gap_x, gap_y = ax + along * ex - x, ay + along * ey - y
    return gap_x * gap_x + gap_y * gap_y, along


@kernel
def _project(table, edge, x, y):
    """Return the squared distance [m^2] from (x, y) to an edge and the arc length [m] of the nearest place on it."""
    ax, ay, bx, by = table[edge, ROW.x], table[edge, ROW.y], table[edge + 1, ROW.x], table[edge + 1, ROW.y]
    squared, along = to_edge(ax, ay, bx, by, x, y)
    return squared, table[edge, ROW.s] + along * (table[edge + 1, ROW.s] - table[edge, ROW.s])


@kernel(nogil=True)
def _nearest(table, points, gaps, arcs):
    for k in range(points.shape[0]):
        least, best = np.inf, 0.0
        for edge in range(table.shape[0] - 1):
            squared, arc = _project(table, edge, points[k, 0], points[k, 1])
            if squared < least:
                least, best = squared, arc
        gaps[k], arcs[k] = np.sqrt(least), best


@kernel(nogil=True)
def _ahead(table, closed, x, y, reached):
    length = table[-1, ROW.s]
    least, best = np.inf, 0.0
    for edge in range(table.shape[0] - 1):
        squared, arc = _project(table, edge, x, y)
        ahead = arc - reached
        if closed:
            ahead = (ahead + length / 2.0) % length - length / 2.0
        if abs(ahead) <= length / 6.0 and squared < least:
            least, best = squared, ahead
    return best


@kernel(nogil=True)
def _follow(table, closed, points, arcs):
    reached = 0.0
    for k in range(points.shape[0]):
        reached += _ahead(table, closed, points[k, 0], points[k, 1], reached)
        arcs[k] = reached


def build_path(trajectory: Trajectory, where: str) -> Path:
    """Return the path of a trajectory.

    Raises:
        InputError: a line or polyline has two equal successive points, a polyline has too few or too many points or
            entries that are not [x, y], `csv` does not go with the other settings, or the file cannot be read. The
            message begins with `where`, the path of the trajectory in the scenario.
    """
    centre = np.array(trajectory.centre_m)
    kind = trajectory.kind
    if trajectory.csv is not None and (kind != "polyline" or trajectory.points_m):
        raise InputError(f"{where}.csv: expected kind polyline and no points_m with it, or null")
    if kind in ("step", "pulse"):
        return _polyline(np.array([trajectory.goal_m]), closed=False)
    if kind == "line":
        if np.linalg.norm(centre - trajectory.goal_m) < _SAME_M:
            raise InputError(f"{where}.goal_m: the line also starts there, expected another place than centre_m")
        return _polyline(np.array([centre, trajectory.goal_m]), closed=False)
    if kind == "square":
        half = trajectory.side_m / 2.0
        corners = centre + half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]])
        return _polyline(corners, closed=True)
    if kind == "circle":
        return _curve(lambda a: centre + trajectory.radius_m * np.column_stack([np.cos(a), np.sin(a)]))
    if kind == "figure_eight":
        r = trajectory.radius_m
        return _curve(lambda a: centre + r * np.column_stack([2.0 * np.sin(a), np.sin(2.0 * a)]))
    if trajectory.csv is None:
        source, points = f"{where}.points_m", trajectory.points_m
        places = [f"{source}[{i}]" for i in range(len(points))]
    else:
        source = f"{where}.csv: {shown(trajectory.csv, 200)}"
        points, lines = _read_csv(trajectory.csv, source)
        places = [f"{source} line {line}" for line in lines]
    for place, point in zip(places, points, strict=True):
        if len(point) != 2:
            raise InputError(f"{place}: expected [x, y], got {shown(point)}")
    if not 2 <= len(points) <= _MOST_POINTS:
        raise InputError(f"{source}: expected 2 to {_MOST_POINTS} points x, y for a polyline, got {len(points)}")
    points = np.array(points)
    repeated = np.flatnonzero(np.linalg.norm(np.diff(points, axis=0), axis=1) < _SAME_M)
    if len(repeated):
        raise InputError(f"{places[repeated[0] + 1]}: repeats the previous point, expected another place")
    return _polyline(points, closed=bool(np.allclose(points[0], points[-1])))


def _polyline(points, closed):
    if len(points) == 1:
        return Path(np.array([[0.0, *points[0], 1.0, 0.0, 0.0]]), closed=False)
    rows, arc = [], 0.0
    for a, b in itertools.pairwise(points):
        length = float(np.linalg.norm(b - a))
        tangent = (b - a) / length
        rows += [[arc, *a, *tangent, 0.0], [arc + length, *b, *tangent, 0.0]]
        arc += length
    return Path(np.array(rows), closed)


def _curve(at):
    """Return the path along a smooth closed curve at(angle) -> (n, 2), tabulated at 720 angles.

    The chords deviate from a circle of 0.6 m radius by 6 um.
    """
    angle = np.linspace(0.0, 2.0 * np.pi, 721)
    step = 1e-4
    points, ahead, behind = at(angle), at(angle + step), at(angle - step)
    velocity, acceleration = (ahead - behind) / (2.0 * step), (ahead - 2.0 * points + behind) / step**2
    speed = np.linalg.norm(velocity, axis=1)
    curvature = (velocity[:, 0] * acceleration[:, 1] - velocity[:, 1] * acceleration[:, 0]) / speed**3
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    return Path(np.column_stack([arc, points, velocity / speed[:, None], curvature]), closed=True)


def _read_csv(name, source):
    """Return the points of a CSV file and the numbers of their lines; `source` names the file in messages.

    Raises:
        InputError: the file is not a regular file of UTF-8 text with the header x,y and finite numbers below it.
    """
    header = "expected a CSV file with the header x,y"
    try:
        if not os.path.isfile(name):  # a pipe or a device might never end
            raise InputError(f"{source} is {'no file' if os.path.exists(name) else 'not there'}, {header}")
        with open(name, "rb") as file:
            data = file.read(_LARGEST_FILE + 1)
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError(f"{source} is not UTF-8 text, {header}") from None
    except OSError as error:
        raise InputError(f"{source} cannot be read ({error.strerror}), {header}") from None
    if len(data) > _LARGEST_FILE:
        raise InputError(f"{source} is larger than {_LARGEST_FILE} bytes, {header}")
    if "\0" in text:
        raise InputError(f"{source} holds NUL bytes, {header}")
    rows = [(line, row) for line, row in enumerate(text.splitlines(), 1) if row.strip()]
    if not rows or [cell.strip() for cell in rows[0][1].split(",")] != ["x", "y"]:
        raise InputError(f"{source} line 1: expected the header x,y, got {shown(rows[0][1] if rows else '')}")
    points = []
    for line, row in rows[1:]:
        try:
            x, y = (float(cell) for cell in row.split(",") if row.isascii() and "_" not in row)
        except ValueError:
            raise InputError(
                f"{source} line {line}: expected two numbers x,y with decimal points, got {shown(row)}"
            ) from None
        if not (abs(x) < _FARTHEST_M and abs(y) < _FARTHEST_M):
            raise InputError(f"{source} line {line}: expected finite numbers of metres, got {shown(row)}")
        points.append([x, y])
    return points, [line for line, _ in rows[1:]]


def check_inside(path: Path, width_m: float, depth_m: float, where: str) -> None:
    """Check that the path lies within the space of `width_m` x `depth_m` around the origin of W.

    Raises:
        InputError: a point of the path lies outside the space; the message begins with `where`.
    """
    outside = (np.abs(path.points_m) > np.array([width_m, depth_m]) / 2.0 + 1e-9).any(axis=1)
    if outside.any():
        x, y = path.points_m[np.flatnonzero(outside)[0]]
        raise InputError(
            f"{where}: way point ({x:.3g}, {y:.3g}) m lies outside of the {width_m:g} x {depth_m:g} m space, "
            f"expected |x| <= {width_m / 2:g} and |y| <= {depth_m / 2:g}"
        )


def start_pose(trajectory: Trajectory, path: Path) -> list[float]:
    """Return x, y [m], phi [rad] in W at the start of the path; x = y = 0 for a path that is a single point."""
    if path.length_m == 0.0:
        return [0.0, 0.0, trajectory.heading_rad]
    _, x, y, along_x, along_y, _ = path.table[0]
    heading = np.arctan2(along_y, along_x) if trajectory.heading == "tangent" else trajectory.heading_rad
    return [float(x), float(y), float(heading)]
