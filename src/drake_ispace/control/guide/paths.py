"""Paths on the floor, as a table over arc length, and the distance of points to them."""

import itertools
import os
from dataclasses import dataclass

import numpy as np

from drake_ispace.blocks.errors import InputError, shown
from drake_ispace.blocks.kernels import kernel
from drake_ispace.blocks.messages import layout
from drake_ispace.files.quantity import quantity

KINDS = ("step", "pulse", "line", "square", "circle", "figure_eight", "polyline")
#: A row of a path's table: arc length s [m], x, y [m], unit tangent, curvature [1/m].
ROW = layout("Row", "s x y tangent_x tangent_y curvature")
_SAME_M = 1e-9
_FARTHEST_M = 1e9
_MOST_POINTS = 10_000
_LARGEST_FILE = 1 << 20  # bytes


@dataclass
class Trajectory:
    """The reference: a path and how the way point slides on it ("continuous tracking")."""

    kind: str = quantity("square", choices=KINDS)
    # middle of the square, circle or figure eight; start of the others
    centre_m: list[float] = quantity([0.0, 0.0], "m", length=2)
    # side of the square
    side_m: float = quantity(1.2, "m", above=0.0)
    # of the circle; a figure eight is 4 radii long and 2 wide
    radius_m: float = quantity(0.6, "m", above=0.0)
    # where step, pulse and line lead
    goal_m: list[float] = quantity([1.0, 0.0], "m", length=2)
    # of a polyline: [[x, y], ...]
    points_m: list[list[float]] = quantity([], "m", length=None)
    # or from a file with the header x,y and metres below; its place is taken from the current folder
    csv: str | None = quantity(None)
    # how long the pulse stays at its goal
    width_s: float = quantity(5.0, "s", above=0.0)
    # section 6.8.2
    speed_m_s: float = quantity(0.25, "m/s", above=0.0)
    # the way point rests at the path's start until then
    start_s: float = quantity(1.0, "s", minimum=0.0)
    # of a closed path; 0: for ever
    laps: int = quantity(1, minimum=0)
    # heading of the way point: fixed, or along the path
    heading: str = quantity("fixed", choices=("fixed", "tangent"))
    heading_rad: float = quantity(0.0, "rad")


@dataclass(frozen=True)
class Path:
    """A path as rows over arc length.

    Attributes:
        table: (n, 6) rows of arc length [m], x, y [m], unit tangent (2), curvature [1/m]. A corner is two rows of the
            same arc length. A single row is a point.
        closed: the end is the start.
    """

    table: np.ndarray
    closed: bool

    @property
    def length_m(self) -> float:
        return float(self.table[-1, ROW.s])

    @property
    def points_m(self) -> np.ndarray:
        """(n, 2) vertices."""
        return self.table[:, ROW.x : ROW.y + 1]

    def nearest(self, points_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Distance [m] to the path and arc length [m] of its nearest place, each (k,), for (k, 2) points."""
        if len(self.table) == 1:
            return np.linalg.norm(points_m - self.points_m[0], axis=1), np.zeros(len(points_m))
        gaps, arcs = np.empty(len(points_m)), np.empty(len(points_m))
        _nearest(self.table, np.ascontiguousarray(points_m, dtype=float), gaps, arcs)
        return gaps, arcs

    def progress(self, point_m: np.ndarray, arc_m: float) -> float:
        """How far [m] beyond `arc_m` the place nearest to a point (2,) lies, looked for within a sixth of the path
        only, so that a path that crosses itself or goes round many times keeps its order."""
        return _ahead(self.table, self.closed, float(point_m[0]), float(point_m[1]), float(arc_m))

    def follow(self, points_m: np.ndarray) -> np.ndarray:
        """Arc lengths [m] (k,) reached at points (k, 2) met one after the other: the sum of their `progress` from 0."""
        arcs = np.empty(len(points_m))
        _follow(self.table, self.closed, np.ascontiguousarray(points_m, dtype=float), arcs)
        return arcs


@kernel
def _project(table, edge, x, y):
    """Squared distance and arc length of the place on an edge that is nearest to (x, y)."""
    ax, ay = table[edge, ROW.x], table[edge, ROW.y]
    ex, ey = table[edge + 1, ROW.x] - ax, table[edge + 1, ROW.y] - ay
    along = ((x - ax) * ex + (y - ay) * ey) / max(ex * ex + ey * ey, 1e-30)
    along = min(max(along, 0.0), 1.0)
    gap_x, gap_y = ax + along * ex - x, ay + along * ey - y
    return gap_x * gap_x + gap_y * gap_y, table[edge, ROW.s] + along * (table[edge + 1, ROW.s] - table[edge, ROW.s])


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
    """The path of a trajectory.

    Raises:
        InputError: a line or polyline without two different points, or an unreadable file; `where` names the section.
    """
    centre = np.array(trajectory.centre_m)
    kind = trajectory.kind
    if trajectory.csv is not None and (kind != "polyline" or trajectory.points_m):
        raise InputError(f"{where}.csv: expected kind polyline and no points_m with it, or null")
    if kind in ("step", "pulse"):
        return _polyline(np.array([trajectory.goal_m]), closed=False)
    if kind == "line":
        if np.linalg.norm(centre - trajectory.goal_m) < _SAME_M:
            raise InputError(f"{where}.goal_m: the line would start there, expected another place than centre_m")
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
        raise InputError(f"{places[repeated[0] + 1]}: repeats the point before it, expected another place")
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
    """A smooth closed curve at(angle) -> (n, 2), tabulated; chords of 1/720 turn miss a 0.6 m circle by 6 um."""
    angle = np.linspace(0.0, 2.0 * np.pi, 721)
    step = 1e-4
    points, ahead, behind = at(angle), at(angle + step), at(angle - step)
    velocity, acceleration = (ahead - behind) / (2.0 * step), (ahead - 2.0 * points + behind) / step**2
    speed = np.linalg.norm(velocity, axis=1)
    curvature = (velocity[:, 0] * acceleration[:, 1] - velocity[:, 1] * acceleration[:, 0]) / speed**3
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    return Path(np.column_stack([arc, points, velocity / speed[:, None], curvature]), closed=True)


def _read_csv(name, source):
    """Points and the numbers of their lines; `source` names the file in messages."""
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
    """Raise InputError where a way point would lie outside of the space, centred at the origin of W."""
    outside = (np.abs(path.points_m) > np.array([width_m, depth_m]) / 2.0 + 1e-9).any(axis=1)
    if outside.any():
        x, y = path.points_m[np.flatnonzero(outside)[0]]
        raise InputError(
            f"{where}: way point ({x:.3g}, {y:.3g}) m lies outside of the {width_m:g} x {depth_m:g} m space, "
            f"expected |x| <= {width_m / 2:g} and |y| <= {depth_m / 2:g}"
        )


def start_pose(trajectory: Trajectory, path: Path) -> list[float]:
    """x, y [m], phi [rad] where the path begins; the origin for a path that is a single point."""
    if path.length_m == 0.0:
        return [0.0, 0.0, trajectory.heading_rad]
    _, x, y, along_x, along_y, _ = path.table[0]
    heading = np.arctan2(along_y, along_x) if trajectory.heading == "tangent" else trajectory.heading_rad
    return [float(x), float(y), float(heading)]
