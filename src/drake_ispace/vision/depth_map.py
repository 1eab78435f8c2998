"""The depth image as a map of the space: points by (5.5) as corrected, obstacles and their sizes, free space, and both
cameras fused into one configuration image; section 5.3.2, Figs. 5.6 and 5.7."""

from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numpy as np

from drake_ispace.blocks.errors import InputError
from drake_ispace.vision.optics.camera import View

FREE, UNKNOWN, OBSTACLE, ROBOT = 0, 1, 2, 3
CELL_M = 0.02  # side of a cell

_FLOOR_M = 0.05  # what is higher stands on the floor: four standard deviations of the depth noise at 3 m
_TOP_M = 0.012  # of a point from the plane of the top face that it belongs to, after the median filter
_LEAST_CELLS = 6  # of an obstacle, less is noise


@dataclass(frozen=True)
class Obstacle:
    """A box around what stands on the floor: middle in W [m], yaw [rad] of its length, sides and height [m]."""

    x_m: float
    y_m: float
    yaw_rad: float
    length_m: float
    width_m: float
    height_m: float


@dataclass(frozen=True)
class SpaceMap:
    """The space from above.

    Attributes:
        cells: (rows, columns) FREE, UNKNOWN (hidden behind something), OBSTACLE or ROBOT; columns along x of W, the
            first row at the largest y, as the top view.
        obstacles: without the robots.
    """

    cells: np.ndarray
    obstacles: tuple[Obstacle, ...]


def points(view: View, depth: np.ndarray) -> np.ndarray:
    """(rows, columns, 3) what each pixel sees, in W [m], NaN where there is no depth: from the camera on, composed
    rotation times pinhole ray, in place of d of (5.3)-(5.6).

    Args:
        depth: (rows, columns) along the view [m], 0 or NaN for none.

    Raises:
        InputError: a depth image of another size than the view's.
    """
    depth = np.asarray(depth, dtype=float)
    if depth.shape != view.size[::-1]:
        raise InputError(f"depth image: expected {view.size[0]} x {view.size[1]} pixels, got shape {depth.shape}")
    rays = view.rays(view.pixel_grid()).reshape(*depth.shape, 3)
    return view.p_ws + np.where(np.isfinite(depth) & (depth > 0.0), depth, np.nan)[..., None] * rays


def map_of(
    view: View, depth: np.ndarray, width_m: float, depth_m: float, robots: Iterable[np.ndarray] = (),
) -> SpaceMap:
    """The map of the space in a depth image.

    Args:
        depth: (rows, columns) along the view [m]; width_m, depth_m: of the space.
        robots: (4, 2) corners in W [m] of the area of each robot that was found by its markers.

    Raises:
        InputError: a depth image of another size than the view's.
    """
    smooth = cv2.medianBlur(np.nan_to_num(np.asarray(depth, dtype=np.float32)), 5)
    seen = points(view, smooth)
    flat = seen[np.isfinite(seen[..., 2])]
    rows, columns = round(depth_m / CELL_M), round(width_m / CELL_M)
    column, row = _cell(flat[:, :2], width_m, depth_m, rows, columns)
    inside = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
    height = np.full((rows, columns), -np.inf)
    np.maximum.at(height, (row[inside], column[inside]), flat[inside, 2])
    height[np.isinf(height)] = np.nan
    standing = np.nan_to_num(height) > _FLOOR_M
    cells = np.where(np.isnan(height), UNKNOWN, FREE).astype(np.uint8)
    cells[standing] = OBSTACLE
    for area in robots:
        mask = np.zeros(cells.shape, np.uint8)
        column, row = _cell(np.asarray(area), width_m, depth_m, rows, columns, whole=False)
        cv2.fillConvexPoly(mask, np.rint(np.column_stack([column, row]) - 0.5).astype(np.int32), 1)
        cells[(mask > 0) & standing] = ROBOT
    found, kept = _obstacles(view, seen, cells, width_m, depth_m)
    cells[(cells == OBSTACLE) & ~kept] = FREE
    return SpaceMap(cells, tuple(found))


def _cell(places, width_m, depth_m, rows, columns, whole=True):
    column = (places[:, 0] / width_m + 0.5) * columns
    row = (0.5 - places[:, 1] / depth_m) * rows
    return (np.floor(column).astype(int), np.floor(row).astype(int)) if whole else (column, row)


def _obstacles(view, seen, cells, width_m, depth_m):
    """The boxes of the connected regions of OBSTACLE, and (rows, columns) which cells belong to one."""
    count, labels, stats, _ = cv2.connectedComponentsWithStats((cells == OBSTACLE).astype(np.uint8), connectivity=8)
    rows, columns = cells.shape
    standing = np.nan_to_num(seen[..., 2]) > _FLOOR_M
    place = seen[standing]
    column, row = _cell(place[:, :2], width_m, depth_m, rows, columns)
    inside = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
    place, label = place[inside], labels[row[inside], column[inside]]
    found, kept = [], np.zeros(cells.shape, bool)
    for i in range(1, count):
        mine = place[label == i]
        if stats[i, cv2.CC_STAT_AREA] < _LEAST_CELLS or len(mine) < _LEAST_CELLS:
            continue
        kept |= labels == i
        found.append(_box(view, mine))
    return found, kept


def _box(view, place):
    """The box around points that stand on the floor: their rays meet the plane of the top face, whose height is known
    better than each depth."""
    height = float(np.percentile(place[:, 2], 95.0))
    top = place[place[:, 2] > height - _TOP_M]
    height = float(np.median(top[:, 2]))
    way = top - view.p_ws
    on_top = view.p_ws[:2] + (height - view.p_ws[2]) / way[:, 2:] * way[:, :2]
    (x, y), (length, width), degrees = cv2.minAreaRect(on_top.astype(np.float32))
    yaw = np.radians(degrees)
    if width > length:
        length, width, yaw = width, length, yaw + np.pi / 2.0
    return Obstacle(float(x), float(y), float(np.arctan(np.tan(yaw))), float(length), float(width), height)


def free_space_overlap(cells: np.ndarray, truth: np.ndarray) -> float:
    """Intersection over union of the free cells of two maps (rows, columns); a robot's own area is not free."""
    one, other = cells == FREE, truth == FREE
    return float((one & other).sum() / max((one | other).sum(), 1))


def true_cells(boxes, width_m: float, depth_m: float, cell_m: float = CELL_M) -> np.ndarray:
    """(rows, columns) FREE or OBSTACLE: which middles of cells lie in the footprint of one of the scene's boxes."""
    rows, columns = round(depth_m / cell_m), round(width_m / cell_m)
    x, y = np.meshgrid(
        (np.arange(columns) + 0.5) * cell_m - width_m / 2.0, depth_m / 2.0 - (np.arange(rows) + 0.5) * cell_m
    )
    cells = np.full((rows, columns), FREE, np.uint8)
    for box in boxes:
        c, s = np.cos(box.yaw_rad), np.sin(box.yaw_rad)
        along, across = c * (x - box.x_m) + s * (y - box.y_m), -s * (x - box.x_m) + c * (y - box.y_m)
        cells[(np.abs(along) <= box.length_m / 2.0) & (np.abs(across) <= box.width_m / 2.0)] = OBSTACLE
    return cells
